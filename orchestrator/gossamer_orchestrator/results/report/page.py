"""The page of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr
from gossamer_files.charts import Chart, section

from ...errors import ResultsError
from ...pages import PAGE, Page, folded, table, write_page
from ...words import counted
from ..dataset import find_all
from ..readers import curve_of
from ..verdict import make_verdict
from . import facts
from .damage import DamageHistory, doubt_charts, history_charts, zone_charts
from .membrane import membrane_charts
from .recorded import Recorded, over_time
from .sensors import sensor_charts

ASSETS = Path(__file__).with_name("assets")
OTHERS = 24  # curves of what has no picture of its own
DASHES = ("solid", "dash", "dot", "dashdot")


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
    run = Recorded(data, folder)
    judged = DamageHistory(run)
    verdict = make_verdict(data, run.ended, run.watch)
    membrane, surface = membrane_charts(run, judged)
    charts = [
        *section("Damage", history_charts(judged) + zone_charts(judged, judged.steps())),
        *section("The membrane and its load", membrane),
        *section("How far detector and twin are to be trusted", doubt_charts(judged)),
        *section("Sensors", sensor_charts(run)),
    ]
    others, constant = _others(run)
    frames = run.time[run.instants[0]]
    parts = (
        facts.run_table(data, len(run.time)),
        facts.messages(folder),
        facts.watch_tables(run.watch),
        facts.judgement_tables(run.ended),
        facts.components(data),
        facts.connections(data),
        _constants(data, constant),
        facts.scenario(data),
    )
    return Page(
        title=str(data.attrs.get("title") or data.attrs.get("scenario_name") or "A run"),
        kind=verdict.kind,
        sentence=verdict.sentence,
        more=verdict.more,
        charts=[*charts, *section("What else was recorded", others)],
        content={"start": float(run.time[0]), "end": float(run.time[-1]), "frames": frames, "surface": surface},
        scripts=[ASSETS / "surface.js", ASSETS / "run.js"],
        controls=(ASSETS / "player.html").read_text(encoding="utf-8"),
        facts="\n".join(filter(None, parts)),
        how=f"{_thinning(run)} Strain of a compensator is drawn earlier by the delay that it states. Bands are two "
        "standard deviations wide to each side.",
    )


def _others(run: Recorded) -> tuple[list[Chart], dict[str, float]]:
    """Draw recorded scalars that no other picture shows, a chart for each unit; those that never change are numbers."""
    hidden = {f"{name}.valid" for name in find_all(run.data, "detector")}
    if run.ended:
        hidden |= {f"{name}.{what}" for name in find_all(run.data, "detector") for what in ("similarity", "misfit", "risk")}
    units: dict[str, list[str]] = {}
    constant: dict[str, float] = {}
    for name in (str(name) for name, each in run.data.data_vars.items() if each.dims == ("time",)):
        if name in run.drawn | hidden:
            continue
        values = run.thin(curve_of(name))
        if np.ptp(values) == 0.0:
            constant[name] = float(values[0])
        else:
            units.setdefault(run.data[name].attrs.get("units", ""), []).append(name)
    charts = []
    for unit, names in units.items():
        few = names[:OTHERS]
        traces = [run.curve(name, name, f"@{k % 6}", dash=DASHES[k // 6 % 4]) for k, name in enumerate(few)]
        title = ", ".join(few) if len(few) < 4 else f"Recorded variables in [{unit or '1'}]"
        charts.append(over_time(title, f"[{unit or '1'}]", traces, layout={"showlegend": True}, broad=True))
    return charts, constant


def _constants(data: xr.Dataset, values: dict[str, float]) -> str:
    """Return a table of recorded variables that never changed."""
    if not values:
        return ""
    rows = [(name, f"{value:.9g}", data[name].attrs.get("units", "")) for name, value in values.items()]
    inner = table(("variable", "value", "unit"), rows, "Constant during the run")
    return folded(f"Constant: {counted(len(values), 'recorded variable')}", inner)


def _thinning(run: Recorded) -> str:
    """Say which points the page holds."""
    frames = f"The slider stops at {len(run.instants[0])} recorded instants, evenly spaced."
    if run.pixels.stride == 1:
        return f"Curves over time show every recorded point. {frames}"
    return (
        f"Of the {len(run.time)} recorded points, curves over time show the smallest and the largest of every "
        f"{run.pixels.stride} that follow each other, so that no peak is lost. {frames} All numbers are of all points."
    )
