"""Charts of an assessment of detectors; a judge has one colour in all of them.

They stand on the page of ``gossamer assess-detector``, and are files with the curves of detection zone by zone.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gossamer_files.charts import (
    Chart,
    Trace,
    band,
    curve,
    heat,
    names_from_top,
    points,
    rule,
    section,
    with_interval,
    words,
)
from gossamer_files.plots import Panels, save_charts
from numpy.typing import ArrayLike

from .figures import CALL, NOMINAL
from .judges import AlwaysZero
from .pod import DETECTED, Share
from .results import AssessmentResults, DetectionRow

COLORS = ("@0", "@1", "@2", "@3", "@4", "@5")
ZERO = AlwaysZero.name
STATED = {"clean": "dash", "noise": "solid"}  # conditions of the reliability, and their lines
DASHES = ("solid", "dash", "dot", "dashdot")
BINS = 40  # of the largest estimates
MISLEADING = "An error above 5 % and above three stated deviations in a zone whose deviation is 2 % or less."
FILES = {
    "Mean absolute error over damaged zones": "errors",
    "Largest estimate of healthy records": "false_calls",
    "Observed over stated share": "reliability",
    "Zone called first": "confusion_",
}


def assessment_charts(found: AssessmentResults) -> list[Chart]:
    """Return all charts of an assessment."""
    return [
        *section("Errors", _errors(found)),
        *section("Calls", _calls(found)),
        *section("Probability of detection", _detections(found)),
        *section("Stated deviations", _stated(found)),
        *section("Zones", _confusions(found)),
    ]


def save_pictures(found: AssessmentResults, folder: Path) -> list[Path]:
    """Write the charts that have a name in ``FILES`` as PNG, and detection zone by zone; return the paths."""
    pictures: dict[str, Chart | Panels] = {}
    for judge in found.judges:
        for name in dict.fromkeys(row.condition for row in found.detections):
            rows = [row for row in found.detections if (row.judge, row.condition) == (judge, name)]
            if any(row.hits for row in rows):
                pictures[f"detection {judge} {name}"] = _by_zone(found, [row for row in rows if row.zone] or rows)
    for chart in assessment_charts(found):
        if file := next((name for title, name in FILES.items() if chart.title.startswith(title)), ""):
            names = len(chart.layout.get("yaxis", {}).get("categoryarray", ()))
            size = (8.0, 2.0 + 0.3 * names) if names else (7.0, 6.5)
            pictures[file + chart.title.partition(": ")[2]] = Panels([chart], size)
    return save_charts({re.sub("[^a-z0-9]+", "_", name.lower()): each for name, each in pictures.items()}, folder)


def reliability_charts(observed: Sequence[Trace]) -> list[Chart]:
    """Draw curves of the observed over the stated share of damages within an interval, if any; right is the diagonal."""
    title = "Observed over stated share of damages within an interval"
    right = curve("right", [0.0, 1.0], [0.0, 1.0], "@grey", dash="dot")
    traces = [right, *(each | {"mode": "lines+markers"} for each in observed)]
    note = "Below the line the stated deviations are too small. Damaged zones of valid records."
    return [Chart(title, "stated share [1]", "observed share [1]", traces, note=note, tall=True)] if observed else []


def _color(found: AssessmentResults, judge: str) -> str:
    return "@grey" if judge == ZERO else COLORS[_place(found, judge) % len(COLORS)]


def _place(found: AssessmentResults, judge: str) -> int:
    """Return the number of a judge, which chooses its colour and symbol."""
    return [each for each in found.judges if each != ZERO].index(judge)


def _by_condition(found: AssessmentResults, title: str, x: str, values: dict[tuple[str, str], Any], note: str = "") -> Chart:
    """Draw numbers, or shares with their bounds, of every judge and condition; a line of the chart is a condition."""
    conditions = [c for c in dict.fromkeys(row.condition for row in found.rows) if any(c == key[1] for key in values)]
    traces = []
    for judge in found.judges:
        value, low, high = np.array([_bounded(values.get((judge, c), math.nan)) for c in conditions]).reshape(-1, 3).T
        if np.isnan(value).all():
            continue
        symbol = "diamond" if judge == ZERO or _place(found, judge) < len(COLORS) else "square"
        trace = points(judge, value, conditions, _color(found, judge), symbol=symbol, size=8)
        if np.isfinite(low).any():
            trace = with_interval(trace, low, high, "x")
        traces.append(trace | {"orientation": "h"})
    return Chart(title, x, "condition", traces, note=note, layout={"yaxis": names_from_top(conditions)}, broad=True)


def _bounded(value: float | Share) -> tuple[float, float, float]:
    """Return a number without bounds, or a share with its bounds [%]."""
    if isinstance(value, Share):
        return 100.0 * value.value, 100.0 * value.low, 100.0 * value.high
    return value, math.nan, math.nan


def _errors(found: AssessmentResults) -> list[Chart]:
    """Draw the mean absolute errors of all judges under all conditions."""
    charts = []
    for name, title in (
        ("error_damaged", "Mean absolute error over damaged zones"),
        ("error_all", "Mean absolute error over all zones"),
        ("worst_healthy", "Largest error of an undamaged zone"),
    ):
        values = {(row.judge, row.condition): getattr(row.figures, name) for row in found.rows}
        finite = {key: value for key, value in values.items() if math.isfinite(value)}
        charts.append(_by_condition(found, title, "error [% damage]", finite))
    return charts


def _calls(found: AssessmentResults) -> list[Chart]:
    """Draw the shares of valid records, of false calls and of calls, and the largest estimates of healthy records."""
    call = f"A call is a valid estimate above {100.0 * CALL:g} %."
    charts = []
    for name, title, note in (
        ("valid", "Valid records", ""),
        ("wrong_and_valid", "Records that are wrong and valid", MISLEADING),
        ("false_calls", "Records with a call in an undamaged zone", call),
        ("hits", "Damaged zones that were called", call),
    ):
        values = {(row.judge, row.condition): getattr(row.figures, name) for row in found.rows}
        charts.append(_by_condition(found, title, "share [%]", {k: v for k, v in values.items() if v.total}, note))
    return [*charts, *_largest(found)]


def _largest(found: AssessmentResults) -> list[Chart]:
    """Draw how many healthy records have a largest estimate of a size."""
    rows = [row for row in found.rows if any(row.largest)]
    if not rows:
        return []
    edges = np.linspace(0.0, max(CALL, *(max(row.largest) for row in rows)), BINS + 1)
    conditions, traces = list(dict.fromkeys(row.condition for row in rows)), []
    for row in rows:
        counts, _ = np.histogram(row.largest, edges)
        name = f"{row.judge}, {row.condition.removeprefix('healthy, ')}"
        dash = DASHES[conditions.index(row.condition) % len(DASHES)]
        traces.append(curve(name, 100.0 * edges, [*counts, 0], _color(found, row.judge), shape="hv", dash=dash))
    note = "0 where the record is not valid. Judges that say 0 of all records are left out."
    title, layout = "Largest estimate of healthy records", {"yaxis": {"type": "log"}}
    return [Chart(title, "largest estimate [% damage]", "records", traces, note=note, layout=layout, broad=True)]


def _detections(found: AssessmentResults) -> list[Chart]:
    """Draw the probability of detection of all zones together, and the size that is found by zone."""
    charts: list[Chart] = []
    names = found.zone_names
    for condition in dict.fromkeys(row.condition for row in found.detections):
        rows = [row for row in found.detections if row.condition == condition]
        traces = [t for row in rows if not row.zone for t in _curves(row.judge, row.curve, _color(found, row.judge))]
        if traces:
            note = "All zones together, single damages; the area reaches down to the lower 95 % bound."
            charts.append(_detection_chart(f"Probability of detection, {condition}", traces, note))
        own = [([r for r in rows if r.judge == judge and r.zone], _color(found, judge)) for judge in found.judges]
        if by_zone := [t for some, color in own for t in _zones(some, color)]:
            title = f"Size found in 90 % of cases by zone, {condition}"
            note = "Bars reach up to the 95 % bound, a90/95; a point alone is that. Zones without it are left out."
            axis = {"tickvals": list(range(1, len(names) + 1)), "ticktext": names} if names else {"dtick": 1}
            layout = {"xaxis": axis, "yaxis": {"rangemode": "tozero"}, "scattermode": "group"}
            charts.append(Chart(title, "zone", "damage [%]", by_zone, note=note, layout=layout))
    return charts


def _curves(name: str, rows: ArrayLike, color: str) -> list[Trace]:
    """Return the curve of a probability of detection and the area down to its lower 95 % bound, or the bound alone.

    Parameters
    ----------
    name : str
        For the legend.
    rows : array, shape (n, 3)
        Size, probability, not a number where there is none, and its lower bound [1].
    color : str
        By name.
    """
    size, probability, low = np.array(rows, dtype=float).T
    if np.isnan(probability).all():  # hits and misses do not overlap: the likelihood has no maximum
        return [curve(f"{name}, 95 % bound", 100.0 * size, low, color, dash="dash")] if low.any() else []
    area = band(name, 100.0 * size, low, probability, color)
    return [*(each | {"showlegend": False} for each in area), curve(name, 100.0 * size, probability, color)]


def _detection_chart(title: str, traces: Sequence[Trace], note: str = "", marks: Sequence[Trace] = ()) -> Chart:
    """Draw probabilities of detection over the size of damage, with a line at ``DETECTED``."""
    sizes = [0.5, 1, 2, 5, 10, 20, 50, 100]
    axis = {"type": "log", "tickvals": sizes, "ticktext": [f"{size:g}" for size in sizes]}
    layout = {"xaxis": axis, "yaxis": {"range": [0.0, 1.02]}}
    marks = [rule(y=DETECTED, dash="dot", width=1), *marks]
    x, y = "damage of the zone [%]", "probability of detection [1]"
    return Chart(title, x, y, traces, note=note, layout=layout, marks=marks)


def _by_zone(found: AssessmentResults, rows: Sequence[DetectionRow]) -> Panels:
    """Draw the curves of one judge zone by zone with hits and misses; of the square zone 1 is below on the left."""
    charts = []
    for row in rows:
        marks = [
            points(name, 100.0 * np.array(sizes), np.full(len(sizes), height), "@ink", symbol="line-ns-open", size=6)
            for name, sizes, height in (("hit", row.hit_sizes, 1.0), ("missed", row.missed_sizes, 0.0))
            if sizes
        ]
        known = math.isfinite(row.a90_95)
        said = [words([5.0], [0.4], [row.remark], font={"size": 9})] if row.remark else []
        bound = [rule(x=100.0 * row.a90_95, color="@1", dash="dash", width=1)] if known else []
        traces = [*_curves("detection", row.curve, "@0"), *marks, *said]
        name = f"{'zone ' * (not found.zone_names)}{found.zone_name(row.zone)}"
        title = f"{name}: a90/95 {100.0 * row.a90_95:.2g} %" if known else name
        charts.append(_detection_chart(title, traces, marks=bound))
    side = math.isqrt(len(charts))
    if not found.zone_names and side**2 == len(charts):
        charts = [chart for k in reversed(range(side)) for chart in charts[k * side : (k + 1) * side]]
    title = f"{rows[0].judge}, {rows[0].condition}: {rows[0].score} above {100.0 * rows[0].threshold:.2g} % is a call"
    columns = math.ceil(math.sqrt(len(charts)))
    size = (2.6 * columns + 1.0, 2.1 * -(-len(charts) // columns) + 1.0)
    return Panels(charts, size, columns, title=title, shared=True)


def _zones(rows: Sequence[Any], color: str) -> list[Trace]:
    """Draw a90 with its bound of each zone that has both; of others the bound alone."""
    there = [row for row in rows if row.a90_95 <= 1.0]  # more than all is no bound
    if not there:
        return []
    bound = np.array([100.0 * row.a90_95 for row in there])
    size = np.array([100.0 * row.a90 if math.isfinite(row.a90) else b for row, b in zip(there, bound, strict=True)])
    return [with_interval(points(there[0].judge, [row.zone for row in there], size, color), size, bound)]


def _stated(found: AssessmentResults) -> list[Chart]:
    """Draw how often the truth lies in the stated intervals."""
    traces = []
    for row in (row for row in found.rows if row.condition in STATED and row.reliability):
        if np.isfinite(row.reliability).all():
            name = f"{row.judge}, {row.condition}: z rms {row.figures.damaged_z_rms:.2f}"
            traces.append(curve(name, NOMINAL, row.reliability, _color(found, row.judge), dash=STATED[row.condition]))
    return reliability_charts(traces)


def _confusions(found: AssessmentResults) -> list[Chart]:
    """Draw which zone is called first where one is damaged."""
    charts = []
    for row in found.confusions:
        counts = np.array(row.counts)
        if counts[:, :-1].any():
            percent = 100.0 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
            zones = [found.zone_name(zone) for zone in range(1, len(counts) + 1)]
            title = f"Zone called first: {row.judge}, {row.condition}"
            layout = {axis: {"type": "category", "dtick": 1} for axis in ("xaxis", "yaxis")}
            cells = heat([*zones, "none"], zones, percent, "% of records", zmin=0.0, zmax=100.0)
            charts.append(Chart(title, "zone called first", "damaged zone", [cells], layout=layout))
    return charts
