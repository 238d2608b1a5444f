"""Charts of an assessment of detectors; a judge has one colour in all of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from gossamer_models.assessment import AlwaysZero, AssessmentResults, Share
from gossamer_models.assessment.figures import CALL, NOMINAL
from gossamer_orchestrator.pages import Chart, band, curve, heat, names_from_top, points, with_interval
from numpy.typing import ArrayLike

from .reliability import COLORS, reliability_chart

ZERO = AlwaysZero.name
STATED = {"clean": "dash", "noise": "solid"}  # conditions of the reliability, and their lines
DASHES = ("solid", "dash", "dot", "dashdot")
DETECTED = 0.9  # probability of detection of a90 and a90/95
BINS = 40  # of the largest estimates


def _color(found: AssessmentResults, judge: str) -> str:
    judges = [each for each in found.judges if each != ZERO]
    return "@grey" if judge == ZERO else COLORS[judges.index(judge) % len(COLORS)]


def _symbol(found: AssessmentResults, judge: str) -> str:
    judges = [each for each in found.judges if each != ZERO]
    return "diamond" if judge == ZERO or judges.index(judge) < len(COLORS) else "square"


def _by_condition(
    found: AssessmentResults, section: str, title: str, x: str, values: dict[tuple[str, str], Any], note: str
) -> Chart:
    """Draw numbers, or shares with their bounds, of every judge and condition; a line of the chart is a condition."""
    conditions = [c for c in dict.fromkeys(row.condition for row in found.rows) if any(c == key[1] for key in values)]
    traces = []
    for judge in found.judges:
        value, low, high = np.array([_bounded(values.get((judge, c), math.nan)) for c in conditions]).reshape(-1, 3).T
        if np.isnan(value).all():
            continue
        trace = points(judge, value, conditions, _color(found, judge), symbol=_symbol(found, judge), size=8)
        if np.isfinite(low).any():
            trace = with_interval(trace, low, high, "x")
        traces.append(trace | {"orientation": "h"})
    return Chart(
        section=section,
        title=title,
        x=x,
        y="condition",
        traces=traces,
        note=note,
        layout={"yaxis": names_from_top(conditions)},
        broad=True,
    )


def _bounded(value: float | Share) -> tuple[float, float, float]:
    """Return a number without bounds, or a share with its bounds [%]."""
    if isinstance(value, Share):
        return 100.0 * value.value, 100.0 * value.low, 100.0 * value.high
    return value, math.nan, math.nan


def error_charts(found: AssessmentResults) -> list[Chart]:
    """Draw the mean absolute errors of all judges under all conditions."""
    charts = []
    for name, zones in (("error_damaged", "damaged zones"), ("error_all", "all zones")):
        values = {(row.judge, row.condition): getattr(row.figures, name) for row in found.rows}
        finite = {key: value for key, value in values.items() if math.isfinite(value)}
        charts.append(
            _by_condition(found, "Errors", f"Mean absolute error over {zones}", "error [% damage]", finite, "")
        )
    return charts


def call_charts(found: AssessmentResults) -> list[Chart]:
    """Draw the shares of valid records, of false calls and of calls, and the largest estimates of healthy records."""

    def shares(name: str) -> dict[tuple[str, str], Any]:
        values = {(row.judge, row.condition): getattr(row.figures, name) for row in found.rows}
        return {key: value for key, value in values.items() if value.total}

    section, call = "Calls", f"A call is a valid estimate above {100.0 * CALL:g} %."
    charts = [
        _by_condition(found, section, "Valid records", "share [%]", shares("valid"), ""),
        _by_condition(
            found, section, "Records with a call in an undamaged zone", "share [%]", shares("false_calls"), call
        ),
        _by_condition(found, section, "Damaged zones that were called", "share [%]", shares("hits"), call),
    ]
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
        line = curve(name, 100.0 * edges, [*counts, 0], _color(found, row.judge), shape="hv", dash=dash)
        traces.append(line)
    note = "0 where the record is not valid. Judges that say 0 of all records are left out."
    return [
        Chart(
            section="Calls",
            title="Largest estimate of healthy records",
            x="largest estimate [% damage]",
            y="records",
            traces=traces,
            note=note,
            layout={"yaxis": {"type": "log"}},
            broad=True,
        )
    ]


def detection_charts(found: AssessmentResults) -> list[Chart]:
    """Draw the probability of detection of all zones together, and the size that is found by zone."""
    charts = []
    for condition in dict.fromkeys(row.condition for row in found.detections):
        rows = [row for row in found.detections if row.condition == condition]
        traces = [
            t for row in rows if not row.zone for t in _detection_traces(row.judge, row.curve, _color(found, row.judge))
        ]
        if traces:
            note = "All zones together, single damages; the area reaches down to the lower 95 % bound."
            charts.append(_detection_chart(f"Probability of detection, {condition}", traces, note))
        by_zone = [
            t
            for judge in found.judges
            for t in _zones([r for r in rows if r.judge == judge and r.zone], _color(found, judge))
        ]
        if by_zone:
            charts.append(
                Chart(
                    section="Probability of detection",
                    title=f"Size found in 90 % of cases by zone, {condition}",
                    x="zone",
                    y="damage [%]",
                    traces=by_zone,
                    note="Bars reach up to the 95 % bound, a90/95; a point alone is that. Zones without it are left out.",
                    layout={"xaxis": {"dtick": 1}, "yaxis": {"rangemode": "tozero"}, "scattermode": "group"},
                )
            )
    return charts


def _detection_traces(name: str, rows: ArrayLike, color: str) -> list[dict[str, Any]]:
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


def _detection_chart(title: str, traces: Sequence[dict[str, Any]], note: str) -> Chart:
    """Draw probabilities of detection over the size of damage, with a line at ``DETECTED``."""
    line = {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": DETECTED, "y1": DETECTED}
    return Chart(
        section="Probability of detection",
        title=title,
        x="damage of the zone [%]",
        y="probability of detection [1]",
        traces=traces,
        note=note,
        layout={
            "xaxis": {"type": "log", "tickvals": [0.5, 1, 2, 5, 10, 20, 50, 100]},
            "yaxis": {"range": [0.0, 1.02]},
            "shapes": [line | {"line": {"color": "@grey", "dash": "dot", "width": 1}}],
        },
    )


def _zones(rows: Sequence[Any], color: str) -> list[dict[str, Any]]:
    """Draw a90 with its bound of each zone that has both; of others the bound alone."""
    there = [row for row in rows if row.a90_95 <= 1.0]  # more than all is no bound
    if not there:
        return []
    bound = np.array([100.0 * row.a90_95 for row in there])
    size = np.array([100.0 * row.a90 if math.isfinite(row.a90) else b for row, b in zip(there, bound, strict=True)])
    trace = points(there[0].judge, [row.zone for row in there], size, color)
    return [with_interval(trace, size, bound)]


def stated_charts(found: AssessmentResults) -> list[Chart]:
    """Draw how often the truth lies in the stated intervals."""
    traces = []
    for row in (row for row in found.rows if row.condition in STATED and row.reliability):
        if np.isfinite(row.reliability).all():
            name = f"{row.judge}, {row.condition}: z rms {row.figures.damaged_z_rms:.2f}"
            traces.append(curve(name, NOMINAL, row.reliability, _color(found, row.judge), dash=STATED[row.condition]))
    return [reliability_chart(traces, "Damaged zones of valid records.")] if traces else []


def confusion_charts(found: AssessmentResults) -> list[Chart]:
    """Draw which zone is called first where one is damaged."""
    charts = []
    for row in found.confusions:
        counts = np.array(row.counts)
        if counts[:, :-1].any():
            percent = 100.0 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
            zones = [str(zone) for zone in range(1, len(counts) + 1)]
            title = f"Zone called first: {row.judge}, {row.condition}"
            layout = {axis: {"type": "category", "dtick": 1} for axis in ("xaxis", "yaxis")}
            cells = heat([*zones, "none"], zones, percent, "% of records", zmin=0.0, zmax=100.0)
            charts.append(
                Chart(
                    section="Zones", title=title, x="zone called first", y="damaged zone", traces=[cells], layout=layout
                )
            )
    return charts
