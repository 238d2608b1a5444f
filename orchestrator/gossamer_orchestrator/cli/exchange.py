"""``gossamer export-ssp`` and ``gossamer container``: a scenario for other tools."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import ScenarioError
from ..scenario.source import find_scenario, shipped_scenarios
from .command import Result, note, show
from .common import FMUS, FmuFolder, ScenarioName, keep_inputs, kinds_of

if TYPE_CHECKING:
    from ..scenario.schema import Scenario


def export(
    scenario: Annotated[str, typer.Argument(help="A scenario file, or the name of one that is shipped.")],
    out: Annotated[Path | None, typer.Option(help="File to write; out/NAME.ssp by default.", metavar="FILE")] = None,
    fmus: FmuFolder = FMUS,
) -> Result:
    """Write a scenario and its FMUs as one .ssp for other tools.

    System Structure and Parameterization is the standard in which co-simulation tools exchange connected FMUs. Prints the
    path. Events, noise and dropout are refused, because SSP cannot express them.

    For example:

        gossamer build --native && gossamer export-ssp damaged

        gossamer export-ssp my_scenario.toml --out mine.ssp
    """
    return _answer(*export_given(scenario, out=out, fmus=fmus))


def container(
    scenario: ScenarioName,
    out: Annotated[Path | None, typer.Option(help="File to write; out/NAME.fmu by default.", metavar="FILE")] = None,
    fmus: FmuFolder = FMUS,
    fmi: Annotated[int, typer.Option(help="FMI version of the container, 2 or 3.", min=2, max=3)] = 2,
) -> Result:
    """Merge a scenario and its FMUs into one FMU.

    Its inputs are those that the scenario gives a value. Its outputs are those that no component receives and those that are
    recorded. All are named component.variable. Prints the path. Events, gain, bias, noise and dropout are refused.

    For example:

        gossamer build --native && gossamer container damaged

        gossamer container damaged --fmi 3 --out monitoring.fmu
    """
    return _answer(*container_given(scenario, out=out, fmus=fmus, fmi=fmi))


def export_given(scenario: str, *, out: Path | None, fmus: Path) -> tuple[Path, str]:
    """Write an .ssp with the options of the command; return its path and what it holds."""
    from ..exchange.ssp_writer import export_ssp

    return _write(export_ssp, scenario, fmus, out, ".ssp")


def container_given(scenario: str, *, out: Path | None, fmus: Path, fmi: int) -> tuple[Path, str]:
    """Merge FMUs with the options of the command; return the path of the FMU and what it holds."""
    from ..exchange.container import build_container

    return _write(partial(build_container, fmi=fmi), scenario, fmus, out, ".fmu")


@contextmanager
def _naming_shipped(path: Path) -> Iterator[None]:
    """Say where a shipped scenario is, which is not to be changed, below what is wrong with it."""
    try:
        yield
    except ScenarioError as error:
        if path in shipped_scenarios().values():
            error.add_note(f"{path.name} ships with Gossamer as {path}. If it must change, change a copy.")
        raise


def _write(
    write: Callable[[Scenario, Path, Path], Path], text: str, fmus: Path, out: Path | None, ending: str
) -> tuple[Path, str]:
    """Write a scenario, which is not overwritten, as another kind of file; return its path and what it holds."""
    from ..exchange import open_scenario

    path = find_scenario(text)
    target = Path("out") / f"{path.stem}{ending}" if out is None else out
    with open_scenario(path) as opened, _naming_shipped(path):
        packed = [opened.fmu_path(component, fmus) for component in opened.components]
        keep_inputs([path, *packed], [target])
        return write(opened, fmus, target), kinds_of(packed)


def _answer(path: Path, packed: str) -> Result:
    show(path)
    note(f"packed: {packed}")
    return Result({"file": path})
