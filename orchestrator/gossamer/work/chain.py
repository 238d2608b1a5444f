"""Build, run, sweep and verify FMUs."""

from __future__ import annotations

import logging
from contextlib import nullcontext
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import xarray as xr
from gossamer_orchestrator.results.places import with_places

from ..results.chain import Run, Sweep, Validation, Verification
from ..table import in_python

logger = logging.getLogger(__name__)


def build(names: list[str] | None, **options: Any) -> dict[str, Path]:  # noqa: ANN401
    """Build FMUs; return their paths by name."""
    from gossamer_orchestrator.cli.build import build_given

    return build_given(names, **options)


def run(scenario: str, out: Path | None, fmus: Path, *, pictures: bool, **options: Any) -> Run:  # noqa: ANN401
    """Run a scenario; draw its pictures and write its page."""
    from gossamer_orchestrator.cli.run import draw, simulate
    from gossamer_orchestrator.results.drawing import Drawing

    with Drawing() if pictures else nullcontext() as drawing:
        data, folder = simulate(scenario, out, fmus, **options)
        if drawing:
            draw(drawing, data, folder, logger.warning)
    return Run(folder=folder, data=with_places(data, folder))


def validate(scenario: str, fmus: Path, **options: Any) -> Validation:  # noqa: ANN401
    """Check a scenario and its FMUs without running it."""
    from gossamer_orchestrator.cli.validate import validate_given

    outline = validate_given(scenario, fmus, **options)
    return Validation(outline=replace(outline, warnings=[in_python("validate", each) for each in outline.warnings]))


def demo(out: Path) -> Run:
    """Build the FMUs, and find damage that begins during a run."""
    from gossamer_orchestrator.cli.build import build_fmus
    from gossamer_orchestrator.cli.run import DEMO

    fmus = out / "fmus"
    build_fmus(fmus)
    return run(DEMO, out / DEMO, fmus, pictures=True, watched=True)


def load(results: str | PathLike[str]) -> Run:
    """Look at the results of an earlier run.

    Parameters
    ----------
    results : path
        Folder of a run, or its results.nc or results.csv.

    Returns
    -------
    Run
        Data, verdict and judgements; it is displayed in a notebook.

    Raises
    ------
    ResultsError
        There are no results.

    Examples
    --------
    >>> gossamer.load("out/damaged").data["membrane.deflection"].plot()
    """
    from gossamer_orchestrator import load_results

    path = Path(results)
    folder = path if path.is_dir() else path.parent
    return Run(folder=folder, data=with_places(load_results(path), folder))


def sweep(scenario: str, ranges: list[str], out: Path | None, fmus: Path, **options: Any) -> Sweep:  # noqa: ANN401
    """Run a scenario with many values."""
    from gossamer_orchestrator.cli.sweep import run_cases
    from gossamer_orchestrator.run.sweep import is_finished

    cases, ended, folder, files = run_cases(scenario, ranges, out, fmus, **options)
    store = next((path for path in files if path.suffix == ".zarr"), None)
    finished = (folder / case.name for case, text in zip(cases, ended, strict=True) if is_finished(text))
    data = None if store is None else with_places(xr.open_zarr(store, consolidated=False), next(finished, None))
    return Sweep(folder=folder, cases=cases, ended=ended, data=data)


def verify(fmus: list[Path], limit: float) -> Verification:
    """Check FMUs."""
    from gossamer_orchestrator.verify import verify as check

    return Verification(findings={str(path): check(path, limit=limit) for path in fmus})
