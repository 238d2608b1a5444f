"""The page of a run: charts, and in words and tables how the run went, what each component was given, the judgements."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from gossamer_files.charts import Chart, section

from ...errors import ResultsError, require
from ...pages import PAGE, Page, folded, on_page, table, write_page, written
from ...words import counted, recorded
from ..dataset import effort_of, find_all, variables_of
from ..files import MESSAGES
from ..judgements import Judgement, window_table
from ..readers import Recorded, over_time
from ..verdict import make_verdict
from .damage import DamageHistory, doubt_charts, history_charts, zone_charts
from .membrane import membrane_charts
from .sensors import sensor_charts
from .watch import watch_tables

ASSETS = Path(__file__).with_name("assets")
OTHERS = 24  # curves of what has no picture of its own
DASHES = ("solid", "dash", "dot", "dashdot")
SHOWN_WINDOWS = 60
SHOWN_MESSAGES = 40


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
    require(data.sizes.get("time", 0), f"the results for {folder} have no row. Run the scenario again.", ResultsError)
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
    return Page(
        title=str(data.attrs.get("title") or data.attrs.get("scenario_name") or "A run"),
        kind=verdict.kind,
        sentence=verdict.sentence,
        more=verdict.more,
        charts=[*charts, *section("What else was recorded", others)],
        content={"start": float(run.time[0]), "end": float(run.time[-1]), "frames": frames, "surface": surface},
        scripts=[ASSETS / "surface.js", ASSETS / "run.js"],
        controls=(ASSETS / "player.html").read_text(encoding="utf-8"),
        facts=[
            _run_table(data, len(run.time)),
            _messages(folder),
            watch_tables(run.watch),
            _judgement_tables(run.ended),
            _components(data),
            _connections(data),
            _constants(data, constant),
            _scenario(data),
        ],
        how=f"{_thinning(run)} Strain of a compensator is drawn earlier by the delay that it states. Bands are two "
        "standard deviations wide to each side.",
    )


def _others(run: Recorded) -> tuple[list[Chart], dict[str, float]]:
    """Draw recorded scalars that no other picture shows, a chart for each unit; those that never change are numbers."""
    hidden = {f"{name}.valid" for name in find_all(run.data, "detector")}
    if run.ended:
        hidden |= {f"{name}.{what}" for name in find_all(run.data, "detector") for what in ("similarity", "misfit")}
    units: dict[str, list[str]] = {}
    constant: dict[str, float] = {}
    hidden |= run.drawn
    for name, each in variables_of(run.data).items():
        if each.dims != ("time",) or name in hidden:
            continue
        first = each[:1].to_numpy()[0]
        if all((each[rows].to_numpy() == first).all() for rows in run.pixels.parts()):
            constant[name] = float(first)
        else:
            units.setdefault(each.attrs.get("units", ""), []).append(name)
    charts = []
    for unit, names in units.items():
        few = names[:OTHERS]
        traces = [run.curve(name, name, f"@{k % 6}", dash=DASHES[k // 6 % 4]) for k, name in enumerate(few)]
        title = ", ".join(few) if len(few) < 4 else f"Recorded variables in [{unit or '1'}]"
        charts.append(over_time(title, f"[{unit or '1'}]", traces, layout={"showlegend": True}, broad=True))
    return charts, constant


def _constants(data: xr.Dataset, values: dict[str, float]) -> str:
    """Return a table of recorded variables that never changed."""
    rows = [(name, f"{value:.9g}", data.variables[name].attrs.get("units", "")) for name, value in values.items()]
    inner = table(("variable", "value", "unit"), rows, "Constant during the run")
    return folded(f"Constant: {counted(len(values), 'recorded variable')}", inner) if values else ""


def _thinning(run: Recorded) -> str:
    """Say which points the page holds."""
    frames = f"The slider stops at {len(run.instants[0])} recorded instants, evenly spaced."
    if run.pixels.stride == 1:
        return f"Curves over time show every recorded point. {frames}"
    return (
        f"Of the {len(run.time)} recorded points, curves over time show the smallest and the largest of every "
        f"{run.pixels.stride} that follow each other, so that no peak is lost. {frames} All numbers are of all points."
    )


def _run_table(data: xr.Dataset, rows_recorded: int) -> str:
    """Return the table of what happened."""
    known, time = data.attrs, data["time"]
    scalars = sum(int(np.prod(variable.shape[1:])) for variable in variables_of(data).values())
    versions = json.loads(known.get("versions", "{}"))
    every, divided = int(known.get("record_every", 1)), int(known.get("divided_steps", 0))
    some = f"; one in {every} is recorded" if every > 1 else ""
    rows = [
        ("Scenario", known.get("scenario_name", "not recorded")),
        ("Time", f"{float(time[0]):.6g} s to {float(time[-1]):.6g} s"),
        ("How it ended", known.get("ended", "not recorded")),
        ("Step", f"{float(known['step']):.6g} s{some}" if "step" in known else ""),
        ("Recorded", f"{counted(rows_recorded, 'instant')} of {recorded(len(data.data_vars), scalars)}"),
        ("Wall time", f"{float(known['wall_time']):.3g} s" if "wall_time" in known else ""),
        ("Divided steps", str(divided or "")),
        ("Master", str(known.get("master", ""))),
        ("Versions", ", ".join(f"{name} {number}" for name, number in versions.items())),
    ]
    if text := known.get("scenario"):
        rows.append(("SHA-256 of the scenario", hashlib.sha256(str(text).encode()).hexdigest()))
    return table((), [row for row in rows if row[1]], "The run")


def _messages(folder: Path) -> str:
    """Return the warnings of the run, if there were any."""
    try:
        texts = (folder / MESSAGES).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return ""
    lines = "".join(f"<li>{written(text)}</li>" for text in texts[:SHOWN_MESSAGES])
    more = f"<p>All {len(texts)} are in {MESSAGES}.</p>" if len(texts) > SHOWN_MESSAGES else ""
    return f'<h3 id="messages">Messages of the run</h3><ul class="messages">{lines}</ul>{more}' if texts else ""


def _components(data: xr.Dataset) -> str:
    """Return a table of the components, and for each its parameters."""
    fmus = json.loads(data.attrs.get("fmus", "{}"))
    if not fmus:
        return "<p>The results do not say which FMUs made them.</p>"
    effort = effort_of(data)
    rows = [
        (name, each.get("file", ""), each.get("model", ""), *(f"{value:g}" for value in effort.get(name, {}).values()))
        for name, each in fmus.items()
    ]
    more = ("time [s]", "steps refused", "states restored") if effort else ()
    parts = [table(("component", "file", "model", *more), rows, "Components")]
    for name, each in fmus.items():
        start, values, units = (each.get(what, {}) for what in ("start", "parameters", "units"))
        lines = [(v, f"{x:.9g}", units.get(v, ""), "scenario" if v in start else "FMU") for v, x in values.items()]
        lines += [(v, str(x), units.get(v, ""), "scenario") for v, x in start.items() if v not in values]
        caption = f"Parameters and start values of {name}"
        inner = table(("name", "value", "unit", "set by"), lines, caption) if lines else ""
        inner += f"<p>GUID of the FMU: <code>{escape(each.get('guid', 'not recorded'))}</code></p>"
        parts.append(folded(f"{name}: {counted(len(lines), 'value')}", inner))
    return "\n".join(parts)


def _connections(data: xr.Dataset) -> str:
    """Return a table of the connections, and of what they do to their signals."""
    found = json.loads(data.attrs.get("connections", "[]"))
    if not found:
        return ""
    rows = [(origin, target, _on_the_way(*change)) for origin, target, *change in found]
    head = ("from", "to", "on the way") if any(words for *_, words in rows) else ("from", "to")
    inner = table(head, [row[: len(head)] for row in rows], "Connections", row_heads=False)
    return folded(counted(len(found), "connection"), inner)


def _on_the_way(change: Mapping[str, Any] | None = None) -> str:
    """Say what a connection does to its signal; nothing if it arrives as it is, or was not recorded."""
    change = change or {}
    words = [f"{what} {change[what]:.9g}" for what in ("gain", "bias") if what in change]
    if noise := change.get("noise"):
        size = "standard deviation" if noise["kind"] == "normal" else "half-width"
        words.append(f"{noise['kind']} noise, {size} {noise['amplitude']:.9g}, seed {noise.get('seed', 0)}")
    if dropout := change.get("dropout"):
        then = "the last is held" if dropout.get("hold", True) else "zero arrives"
        lost = f"{100 * dropout['probability']:.9g} % of the samples are lost"
        words.append(f"{lost}, {then}, seed {dropout.get('seed', 0)}")
    if change.get("delayed"):
        words.append("arrives one step later")
    return "; ".join(words)


def _scenario(data: xr.Dataset) -> str:
    """Return the scenario's text."""
    text = data.attrs.get("scenario")
    return folded("The scenario file", f"<pre>{escape(str(text))}</pre>") if text else ""


def _judgement_tables(ended: Sequence[Judgement]) -> str:
    """Return the last valid judgement zone by zone, and the windows."""
    if not ended:
        return ""
    known, certain = (bool(np.isfinite(x).all()) for x in (ended[-1].true, ended[-1].deviation))
    parts = []
    for last in [window for window in ended if window.valid][-1:]:
        numbers = tuple(str(k + 1) for k in range(len(last.estimated)))
        named = ["name"] * (last.labels != numbers)
        head = ["zone", *named, *["true [%]"] * known, "estimated [%]", *["standard deviation [%]"] * certain]
        columns = [[f"{100 * x:.1f}" for x in each] for each in (*[last.true] * known, last.estimated)]
        columns += [[f"{100 * x:.2f}" for x in last.deviation]] * certain
        rows = zip(numbers, *[last.labels] * len(named), *columns, strict=True)
        parts.append(folded("Damage in numbers", table(head, rows, f"Damage of every zone at t = {last.time:.4f} s")))
    return "\n".join([*parts, folded(counted(len(ended), "window"), on_page(window_table(ended, SHOWN_WINDOWS)))])
