"""``gossamer report`` and ``gossamer view``: the page of a run."""

from __future__ import annotations

import webbrowser
from pathlib import Path

from .command import Result, note, show
from .common import Results


def report(results: Results) -> Result:
    """Write report.html, the page of a run, from its results.

    One file that opens from disk in any browser, without a network or a server: the verdict, the membrane in 3-D, damage,
    sensors and compensators over time, and what each component was given. 'gossamer run' writes it too.

    For example:

        gossamer report out/damage_begins
    """
    show(page := make_page(results))
    return Result({"page": page})


def view(results: Results) -> Result:
    """Open the page of a run in the browser; write it first if it is not there, or older than the results.

    For example:

        gossamer view out/damage_begins
    """
    path = newest_page(results)
    show(path)
    if not webbrowser.open(path.resolve().as_uri()):
        note(f"No browser could be started. Open {path} in one.")
    return Result({"page": path})


def newest_page(results: Path) -> Path:
    """Return the page of a run; write it first if it is not there, or older than the results."""
    from ..pages import PAGE
    from ..results.files import CSV, NETCDF, UNFINISHED_NETCDF

    folder = _folder(results)
    path, recorded = folder / PAGE, [folder / name for name in (NETCDF, UNFINISHED_NETCDF, CSV)]
    latest = max((each.stat().st_mtime for each in recorded if each.is_file()), default=0.0)
    return path if path.is_file() and path.stat().st_mtime >= latest else make_page(results)


def make_page(results: Path) -> Path:
    """Write the page of results that are on the disk; return its path."""
    from ..results.files import load_results
    from ..results.report import write_report

    return write_report(load_results(results), _folder(results))


def _folder(results: Path) -> Path:
    return results if results.is_dir() else results.parent
