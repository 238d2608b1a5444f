"""``gossamer export-ssp`` and ``gossamer container``: a scenario for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import OrchestratorError
from ..scenario.shipped import find_scenario
from .common import FMUS, FmuFolder, say_kinds


def export(
    scenario: Annotated[str, typer.Argument(help="A scenario file, or the name of one that is shipped.")],
    out: Annotated[Path | None, typer.Option(help="File to write; out/NAME.ssp if not given.", metavar="FILE")] = None,
    fmus: FmuFolder = FMUS,
) -> None:
    """Write a scenario and its FMUs as one .ssp for other tools.

    System Structure and Parameterization is the standard in which co-simulation tools exchange connected FMUs. Prints the
    path. What SSP cannot say (events, noise, dropout) is refused.

    For example:

        gossamer build --native && gossamer export-ssp damaged

        gossamer export-ssp my_scenario.toml --out mine.ssp
    """
    from ..exchange.open import open_scenario
    from ..exchange.ssp.writer import export_ssp

    path = find_scenario(scenario)
    with open_scenario(path) as opened:
        typer.echo(export_ssp(opened, fmus, _target(out, path, ".ssp")))
        say_kinds("packed", (opened.fmu_path(component, fmus) for component in opened.components))


def container(
    scenario: Annotated[str, typer.Argument(help="A scenario file, an .ssp, or the name of a shipped scenario.")],
    out: Annotated[Path | None, typer.Option(help="File to write; out/NAME.fmu if not given.", metavar="FILE")] = None,
    fmus: FmuFolder = FMUS,
    fmi: Annotated[int, typer.Option(help="Version of FMI outside, 2 or 3.", min=2, max=3)] = 2,
) -> None:
    """Merge a scenario and its FMUs into one FMU.

    Inputs are what the scenario gives from outside, outputs what nobody receives and what is recorded, all named
    component.variable. Prints the path. Events, gain, bias, noise and dropout are refused.

    For example:

        gossamer build --native && gossamer container damaged

        gossamer container damaged --fmi 3 --out monitoring.fmu
    """
    from ..exchange.container import build_container
    from ..exchange.open import open_scenario

    path = find_scenario(scenario)
    with open_scenario(path) as opened:
        typer.echo(build_container(opened, fmus, _target(out, path, ".fmu"), fmi=fmi))
        say_kinds("packed", (opened.fmu_path(component, fmus) for component in opened.components))


def _target(out: Path | None, scenario: Path, ending: str) -> Path:
    """Return the file to write, which must not be the scenario itself."""
    target = Path("out") / f"{scenario.stem}{ending}" if out is None else out
    if target.resolve() == scenario.resolve():
        msg = f"{target} is the scenario itself. Name another file with --out."
        raise OrchestratorError(msg)
    return target
