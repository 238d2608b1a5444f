"""The page of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr

from ...errors import ResultsError
from ...pages import PAGE, Page, folded, table, write_page
from ...words import counted
from . import facts
from .content import collect, windows_of
from .verdict import make_verdict

ASSETS = Path(__file__).with_name("assets")
SCRIPTS = ("membrane.js", "surface.js", "damage.js", "sensors.js", "run.js")


def write_report(data: xr.Dataset, folder: Path) -> Path:
    """Write ``report.html``, what ``run_page`` describes, into a folder; return its path.

    Raises
    ------
    ResultsError
        As ``run_page``, or the folder cannot be written; a page that was there is as it was.
    """
    return write_page(run_page(data, folder), folder / PAGE)


def run_page(data: xr.Dataset, folder: Path) -> Page:
    """Describe the page of a run from its results.

    Parameters
    ----------
    data : xarray.Dataset
        Results, for instance of ``load_results``; they may be longer than memory.
    folder : Path
        Where ``watch.json``, shapes and messages may be.

    Raises
    ------
    ResultsError
        There is not a single row.
    """
    if not data.sizes.get("time", 0):
        msg = f"the results for {folder} have no row. Run the scenario again."
        raise ResultsError(msg)
    ended = windows_of(data)
    content = collect(data, ended, folder)
    verdict = make_verdict(data, ended, content["watch"])
    parts = (
        facts.run_table(data, content),
        facts.messages(folder),
        facts.watch_tables(content["watch"]),
        facts.judgement_tables(ended),
        facts.components(data),
        facts.connections(data),
        _constants(data, content["constant"]),
        facts.scenario(data),
    )
    return Page(
        title=str(data.attrs.get("title") or data.attrs.get("scenario_name") or "A run"),
        kind=verdict.kind,
        sentence=verdict.sentence,
        more=verdict.more,
        content=content,
        scripts=[ASSETS / name for name in SCRIPTS],
        controls=(ASSETS / "player.html").read_text(encoding="utf-8"),
        facts="\n".join(parts),
        how=f"{_thinning(content)} Strain of a compensator is drawn earlier by the delay that it states. Bands are two "
        "standard deviations wide to each side.",
    )


def _constants(data: xr.Dataset, values: dict[str, float]) -> str:
    """Return a table of recorded variables that never changed."""
    if not values:
        return ""
    rows = [(name, f"{value:.9g}", data[name].attrs.get("units", "")) for name, value in values.items()]
    inner = table(("variable", "value", "unit"), rows, "Constant during the run")
    return folded(f"Constant: {counted(len(values), 'recorded variable')}", inner)


def _thinning(content: dict[str, Any]) -> str:
    """Say which points the page holds."""
    frames = f"The slider stops at {len(content['frames'])} recorded instants, evenly spaced."
    if content["stride"] == 1:
        return f"Curves over time show every recorded point. {frames}"
    return (
        f"Of the {content['rows']} recorded points, curves over time show the smallest and the largest of every "
        f"{content['stride']} that follow each other, so that no peak is lost. {frames} All numbers are of all points."
    )
