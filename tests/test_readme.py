"""The README's examples run as they are printed."""

import re
import shutil
from pathlib import Path

import gossamer
from building import build_fmu
from gossamer_models.membrane import membrane_model

README = Path(__file__).resolve().parents[1] / "README.md"
IN_PYTHON = README.parent / "docs/python.md"


def examples(page=README):
    return re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def test_the_example_of_a_run_finds_the_damage_that_it_sets(tmp_path, monkeypatch, built, capsys):
    fmus = built("native")
    (tmp_path / "out").mkdir()
    monkeypatch.setattr(
        gossamer, "build", lambda **_: shutil.copytree(fmus["sensor"].parent, tmp_path / "out/fmus"), raising=False
    )
    monkeypatch.chdir(tmp_path)
    exec(examples()[0], {})
    printed = capsys.readouterr().out
    assert printed.startswith("Damaged: zone 11 lost 30.0 ± 0.5 % of its stiffness and zone 1 lost 10.2 ± 0.7 %, judged")
    assert "zone_x" in printed


def test_the_python_example_prints_a_resistance(capsys):
    exec(examples(IN_PYTHON)[0], {})
    assert float(capsys.readouterr().out) > 100.0


def test_the_fmpy_example_runs(tmp_path, monkeypatch):
    build_fmu(membrane_model(), tmp_path / "out" / "fmus")
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(examples()[1], names)
    assert names["result"]["deflection"].max() > 0.1


def test_the_readme_is_read_in_ten_minutes():
    assert len(README.read_text(encoding="utf-8").split()) <= 2000


def test_every_file_the_readme_links_to_exists():
    for target in re.findall(r"\]\(([^)#:]+)\)", README.read_text(encoding="utf-8")):
        assert (README.parent / target).exists(), target
