"""Look into FMUs, start a scenario, and write scenarios and results for other programs."""

from __future__ import annotations

import logging
import webbrowser
from pathlib import Path
from typing import Any

from ..results.files import FmuInfo

logger = logging.getLogger(__name__)


def new(name: str) -> Path:
    """Write a scenario."""
    from gossamer_orchestrator.cli.new import new_given

    return new_given(name)


def info(fmu: Path, locals_: bool) -> FmuInfo:
    """Look into an FMU."""
    from gossamer_orchestrator.cli.inspect import look_into

    content = look_into(fmu, locals_)
    variables = {each.pop("variable"): each for each in content.pop("variables")}
    return FmuInfo(path=fmu, variables=variables, **content)


def view(results: Path) -> Path:
    """Open a page in the browser; return its path."""
    from gossamer_orchestrator.cli.report import newest_page

    path = newest_page(results)
    if not webbrowser.open(path.resolve().as_uri()):
        logger.warning("No browser could be started. Open %s in one.", path)
    return path


def report(results: Path) -> Path:
    """Write the page of a run."""
    from gossamer_orchestrator.cli.report import make_page

    return make_page(results)


def plot(results: Path, out: Path | None, form: str) -> list[Path]:
    """Draw the pictures of a run again."""
    from gossamer_orchestrator.cli.pictures import plot_given

    return plot_given(results, out=out, form=form, say=logger.warning)


def export_vtk(results: Path, **options: Any) -> list[Path]:  # noqa: ANN401
    """Write the membranes of a run for ParaView."""
    from gossamer_orchestrator.cli.pictures import vtk_given

    return vtk_given(results, **options)


def export_ssp(scenario: str, **options: Any) -> Path:  # noqa: ANN401
    """Write a scenario and its FMUs as one .ssp."""
    from gossamer_orchestrator.cli.exchange import export_given

    return export_given(scenario, **options)[0]


def container(scenario: str, **options: Any) -> Path:  # noqa: ANN401
    """Merge a scenario and its FMUs into one FMU."""
    from gossamer_orchestrator.cli.exchange import container_given

    return container_given(scenario, **options)[0]
