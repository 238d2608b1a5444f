"""``gossamer report``, the page of a run, and ``gossamer view``, any page."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from ..errors import ResultsError
from .command import Result, note, show
from .common import Results

STORES = (".json", ".zarr")  # have their page in a folder of their name


def report(results: Results) -> Result:
    """Write report.html, the page of a run, from its results.

    One file that opens from disk in any browser, without a network or a server: the verdict, the membrane in 3-D, damage,
    sensors and compensators over time, and what each component was given. 'gossamer run' writes it too.

    For example:

        gossamer report out/damage_begins
    """
    show(page := make_page(results))
    return Result({"page": page})


def view(
    results: Annotated[
        Path,
        typer.Argument(
            help="Folder of a page or of a run, results.nc or results.csv, or an artifact, such as a sensor.",
            metavar="RESULTS",
            show_default=False,
        ),
    ],
) -> Result:
    """Open a page in the browser: of a run, or of what another command found.

    The page of a run is written first if it is not there, or older than the results.

    For example:

        gossamer view out/damage_begins

        gossamer view out/mine/sensor
    """
    path = newest_page(results)
    show(path)
    if not webbrowser.open(path.resolve().as_uri()):
        note(f"No browser could be started. Open {path} in one.")
    return Result({"page": path})


def newest_page(results: Path) -> Path:
    """Return a page; write that of a run first if it is not there, or older than the results.

    Parameters
    ----------
    results : Path
        Folder of a page or a run, a file in it, or an artifact or a store whose page is in the folder of its name.

    Raises
    ------
    ResultsError
        There is neither a page nor results of a run.
    """
    from ..pages import PAGE
    from ..results.files import RECORDED, WATCH

    own = results.parent / results.stem  # folder of the page of an artifact or a store
    folder = own if results.suffix in STORES and (own / PAGE).is_file() else _folder(results)
    path, recorded = folder / PAGE, [folder / name for name in RECORDED]
    missing = results.suffix in STORES and not results.exists() and folder != own
    if missing or not any(each.is_file() for each in (path, *recorded)):
        raise ResultsError(_nothing_at(results))
    shown = [*recorded, folder / WATCH] if any(each.is_file() for each in recorded) else []
    latest = max((each.stat().st_mtime for each in shown if each.is_file()), default=0.0)
    return path if path.is_file() and path.stat().st_mtime >= latest else make_page(results)


def _nothing_at(results: Path) -> str:
    """Say what is missing, and which folders near by have a page or results."""
    from ..pages import PAGE
    from ..results.files import MAKE_SOME, RECORDED, others

    if results.suffix in STORES and results.exists():
        page = results.with_suffix("") / PAGE
        return f"{results} has no page {page}. The command that wrote it writes one, unless --no-pictures forbids it."
    what = (
        f"the folder {results} has no page and no results"
        if results.is_dir()
        else f"there is no file or folder {results}"
    )
    return f"{what}. {others(results, (PAGE, *RECORDED)) or MAKE_SOME}"


def make_page(results: Path) -> Path:
    """Write the page of results that are on the disk; return its path."""
    from ..results.files import load_results
    from ..results.report import write_report

    return write_report(load_results(results), _folder(results))


def _folder(results: Path) -> Path:
    return results if results.is_dir() else results.parent
