"""Toy FMUs, made once per session by pythonfmu's own builder, and scenarios around them."""

from __future__ import annotations

import contextlib
import io
import re
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from browsing import launched
from command_line import invoke
from gossamer.descriptions import load_campaign
from gossamer_models.campaign import run_campaign
from gossamer_orchestrator import Scenario, parse_scenario
from pythonfmu.builder import FmuBuilder

TOYS = Path(__file__).parent / "toys"


def rewrite(source: Path, target: Path, edit: Callable[[str], str]) -> None:
    """Copy an FMU with an edited model description."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for member in old.infolist():
            content = old.read(member)
            if member.filename == "modelDescription.xml":
                content = edit(content.decode()).encode()
            new.writestr(member, content)


def with_unit(name: str, unit: str, base: str) -> Callable[[str], str]:
    """Give one variable a unit and define it."""

    def edit(xml: str) -> str:
        definition = f'<UnitDefinitions><Unit name="{unit}"><BaseUnit {base}/></Unit></UnitDefinitions>'
        xml = re.sub(r"(<LogCategories>)", definition + r"\1", xml)
        return re.sub(rf'(name="{re.escape(name)}"[^>]*>\s*<Real)', rf'\1 unit="{unit}"', xml)

    return edit


@pytest.fixture(scope="session")
def few_cases(once) -> Path:
    """Return a folder with a campaign of as few and as short cases as ``train`` takes, and a detector to go on from."""

    def fill(folder: Path) -> None:
        text = "cases = 560\nseed = 3\nstop = 0.03\n[damage]\nzones = [1, 2]\ndepth = [0.3, 0.5]\nhealthy = 0.1\n"
        (folder / "few.toml").write_text(text)
        run_campaign(load_campaign(folder / "few.toml")[0], folder / "few.zarr", workers=1)
        options = ["--window", "0.03", "--steps", "40", "--out", folder / "start.json"]
        done = invoke(["train", folder / "few.zarr", *options])
        assert done.exit_code == 0, done.stderr

    return once("few_cases", fill)


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of toy FMUs."""
    folder = tmp_path_factory.mktemp("fmus")
    for script in sorted(TOYS.glob("toy_*.py")):
        name = script.stem.removeprefix("toy_")
        with contextlib.redirect_stdout(io.StringIO()):
            FmuBuilder.build_FMU(script, dest=folder / f"{name}.fmu", canGetAndSetFMUstate=True)
    detector = folder / "detector.fmu"
    rewrite(detector.rename(folder / "toy_detector.fmu"), detector, lambda xml: xml.replace("ToyDetector", "detector", 1))
    rewrite(folder / "clock.fmu", folder / "delay.fmu", _without_feedthrough)
    rewrite(folder / "integrator.fmu", folder / "forgetful.fmu", _without_state)
    rewrite(folder / "gain.fmu", folder / "pascal.fmu", with_unit("y", "Pa", 'kg="1" m="-1" s="-2"'))
    rewrite(folder / "gain.fmu", folder / "kilo.fmu", with_unit("u", "kPa", 'kg="1" m="-1" s="-2" factor="1000"'))
    rewrite(folder / "gain.fmu", folder / "ratio.fmu", with_unit("u", "1", ""))
    rewrite(folder / "gain.fmu", folder / "metre.fmu", with_unit("u", "m", 'm="1"'))
    rewrite(folder / "gain.fmu", folder / "bounded.fmu", _with_bounds)
    return folder


@pytest.fixture
def edited(fmus: Path, tmp_path: Path) -> Callable[[str, str, Callable[[str], str]], None]:
    """Copy a toy under another name, with an edited model description."""
    return lambda toy, name, edit: rewrite(fmus / f"{toy}.fmu", tmp_path / f"{name}.fmu", edit)


@pytest.fixture
def other_unit(fmus: Path, tmp_path: Path) -> Callable[[str, str, str, str], None]:
    """Copy the toy gain under another name, with a unit for one of its variables."""
    return lambda name, *unit: rewrite(fmus / "gain.fmu", tmp_path / f"{name}.fmu", with_unit(*unit))


def _with_bounds(xml: str) -> str:
    return re.sub(r'(name="factor"[^>]*>\s*<Real)', r'\1 unit="m" min="-10" max="10"', xml).replace(
        "<LogCategories>", '<UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit></UnitDefinitions><LogCategories>'
    )


def _without_feedthrough(xml: str) -> str:
    return re.sub(r'(<Unknown index="\d+")', r'\1 dependencies=""', xml)


def _without_state(xml: str) -> str:
    return xml.replace('canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"')


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    """A browser without a window."""
    with launched() as program:
        yield program


CHAIN = """
title = "A constant, integrated"
step = 0.1
stop = 1.0

[components.source]
fmu = "gain"
inputs = { u = 2.0, "offset[*]" = 0.0 }

[components.integral]
fmu = "integrator"

[[connections]]
from = "source.y"
to = "integral.u"
"""


@pytest.fixture
def chain() -> Callable[..., Scenario]:
    """Scenario of a source and an integrator; pairs of texts are replaced in it, more is appended."""

    def make(*changes: tuple[str, str], more: str = "") -> Scenario:
        text = CHAIN
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        return parse_scenario(text + more, name="chain.toml")

    return make


@pytest.fixture(autouse=True)
def no_temporary_files_remain(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Every test must leave no unpacked FMU behind."""
    folder = tmp_path_factory.mktemp("tmp")
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    yield
    assert list(folder.glob("gossamer-*")) == []
