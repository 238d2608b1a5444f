"""Paths that the pages for developers name exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BELOW = re.compile(r"`((?:models|fmus|orchestrator|docs|tests)/[\w./]+)(?:::(\w+))?`")  # and maybe a test in it


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "docs/verification.md"])
def test_every_path_exists(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    paths = BELOW.findall(text)
    assert len(paths) > 10
    for path, test in paths:
        assert (ROOT / path).exists(), path
        assert not test or f"def {test}(" in (ROOT / path).read_text(encoding="utf-8"), test
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert ((ROOT / page).parent / link).exists(), link


@pytest.mark.parametrize(("room", "title"), [("models", "gossamer_models"), ("orchestrator", "gossamer_orchestrator")])
def test_every_room_is_described(room, title):
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    folder = ROOT / room / title
    rooms = {each.parent.name for each in folder.glob("*/__init__.py")}
    table = text.partition(f"The rooms of `{room}/{title}`:")[2].strip().partition("\n\n")[0]
    names = " ".join(re.findall(r"^\|([^|]*)\|", table, re.MULTILINE))  # of the first column
    assert rooms == set(re.findall(r"`(\w+)/`", names))
