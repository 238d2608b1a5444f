"""Charts as data: what a figure shows, its axes with their units, and how its parts look.

Traces are in plotly's words, which the page draws as they are; the other pen knows those that the functions here use. A
colour is one of ``@0`` to ``@5``, lines that colour-blind readers can tell apart, ``@ink``, ``@grey`` or ``@alarm``; with a
share after a stroke, ``@0/0.25``, it is translucent. ``@over/0.7`` is what can be read on so much of the colours of damage,
``@damage``; those of a judgement that is not valid are ``@unsure``, and of values to both sides of zero ``@signed``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .thinning import Array as Array
from .thinning import thinned

Trace = dict[str, Any]


@dataclass(frozen=True)
class Stages:
    """What changes in a chart from time to time.

    Attributes
    ----------
    time : ndarray, shape (n,)
        When each of the following begins to hold [s].
    traces : sequence of sequence of dict
        Traces above those that stay, n times; the same kinds in each.
    """

    time: Array
    traces: Sequence[Sequence[Trace]]


@dataclass(frozen=True)
class Chart:
    """One picture.

    Attributes
    ----------
    title : str
        Heading.
    x, y : str
        What the axes show, with the unit in brackets.
    traces : sequence of dict
        Curves, bars, points and so on, the first one at the bottom.
    note : str
        What a reader must know of it.
    text : str
        What it shows, for those who do not see it; the title if empty.
    result : str
        What it comes to, in few words that stand in it.
    layout : mapping
        More of its axes in plotly's words, for instance ``{"yaxis": {"type": "log"}}``.
    marks : sequence of dict
        Lines and areas across it, of ``rule`` and ``area``.
    steps : Stages, optional
        What the slider of a page changes; in a file the last of them is drawn.
    broad, tall : bool
        As wide as the page; higher than others, for instance as high as wide.
    linked : str
        Charts of the same name are zoomed together along x; a page with a slider marks its time in those of "time".
    section : str
        Heading above this and the following charts, where it is another than before.
    choice : str
        Which of several, for instance sensors, it is of: of charts with one title a page shows the chosen one.
    script : str
        Function of the page's JavaScript that draws it in place of the traces.
    """

    title: str
    x: str = ""
    y: str = ""
    traces: Sequence[Trace] = ()
    _: KW_ONLY
    note: str = ""
    text: str = ""
    result: str = ""
    layout: Mapping[str, Any] = field(default_factory=dict)
    marks: Sequence[Trace] = ()
    steps: Stages | None = None
    broad: bool = False
    tall: bool = False
    linked: str = ""
    section: str = ""
    choice: str = ""
    script: str = ""


def section(name: str, charts: Iterable[Chart]) -> list[Chart]:
    """Return charts under a heading."""
    return [replace(chart, section=name) for chart in charts]


def curve(name: str, x: ArrayLike, y: ArrayLike, color: str = "@0", **line: Any) -> Trace:  # noqa: ANN401
    """Return a curve; of many points those of the smallest and the largest value in each of some thousand parts in a row.

    Parameters
    ----------
    name : str
        For the legend.
    x, y : array, shape (n,)
        Points, in their order along the curve.
    color : str
        A colour by name.
    **line
        More of the line: ``dash="dash"``, ``width=3``, ``shape="hv"`` for values that hold until the next.
    """
    thin_x, thin_y = thinned(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    return {"type": "scatter", "mode": "lines", "name": name, "x": thin_x, "y": thin_y, "line": {"color": color} | line}


def band(name: str, x: ArrayLike, low: ArrayLike, high: ArrayLike, color: str = "@0", **line: Any) -> list[Trace]:  # noqa: ANN401
    """Return the area between two curves."""
    edges = [curve(name, x, y, color, width=0, **line) | {"hoverinfo": "skip"} for y in (low, high)]
    return [edges[0] | {"showlegend": False}, edges[1] | {"fill": "tonexty", "fillcolor": f"{color}/0.25"}]


def points(
    name: str,
    x: ArrayLike,
    y: ArrayLike,
    color: str = "@0",
    deviation: ArrayLike | None = None,
    **marker: Any,  # noqa: ANN401
) -> Trace:
    """Return points, with bars of one standard deviation to each side if they are given.

    Parameters
    ----------
    name : str
        For the legend.
    x : array, shape (n,)
        Numbers, or words.
    y : array, shape (n,)
        Values.
    color : str
        A colour by name.
    deviation : array, shape (n,), optional
        Standard deviations.
    **marker
        More of the marker, for instance ``symbol="x"``.
    """
    trace: Trace = {"type": "scatter", "mode": "markers", "name": name, "x": np.asarray(x), "y": np.asarray(y)}
    trace |= {"marker": {"color": color} | marker, "cliponaxis": False}
    return trace if deviation is None else trace | {"error_y": {"array": np.asarray(deviation), "color": color}}


def with_interval(trace: Trace, low: ArrayLike, high: ArrayLike, axis: str = "y", color: str = "") -> Trace:
    """Return points or bars with intervals, from ``low`` to ``high`` along an axis, around their values."""
    values = np.asarray(trace[axis], dtype=float)
    ends = {"array": np.asarray(high) - values, "arrayminus": values - np.asarray(low), "symmetric": False}
    return trace | {f"error_{axis}": ends | {"color": color or trace["marker"]["color"], "thickness": 1.2, "width": 3}}


def bars(name: str, x: ArrayLike, y: ArrayLike, color: str = "@0") -> Trace:
    """Return bars; ``x`` may be words."""
    return {"type": "bar", "name": name, "x": np.asarray(x), "y": np.asarray(y), "marker": {"color": color}}


def words(x: ArrayLike, y: ArrayLike, text: Sequence[str], color: str | Sequence[str] = "@ink", **more: Any) -> Trace:  # noqa: ANN401
    """Return words at places; ``<br>`` in them ends a line."""
    font = {"color": color, "size": 12} | more.pop("font", {})
    trace = {"type": "scatter", "mode": "text", "x": np.asarray(x), "y": np.asarray(y), "text": text, "textfont": font}
    return trace | {"showlegend": False, "hoverinfo": "skip", "cliponaxis": False} | more


def heat(x: ArrayLike, y: ArrayLike, z: ArrayLike, label: str, **more: Any) -> Trace:  # noqa: ANN401
    """Return a map of colours, ``z`` of shape (len(y), len(x)), with ``label`` at its scale."""
    bar = {"title": {"text": label}, "thickness": 12}
    x, y, z = (np.asarray(each) for each in (x, y, z))
    return {"type": "heatmap", "x": x, "y": y, "z": z, "colorscale": "Viridis", "colorbar": bar} | more


def rule(x: float | None = None, y: float | None = None, color: str = "@grey", **line: Any) -> Trace:  # noqa: ANN401
    """Return a line across a chart: upright at ``x``, or level at ``y``."""
    place = {"yref": "paper", "x0": x, "x1": x, "y0": 0, "y1": 1} if y is None else {"y0": y, "y1": y, "x0": 0, "x1": 1}
    return {"type": "line", "xref": "x" if y is None else "paper"} | place | {"line": {"color": color, "width": 1.5} | line}


def area(x0: float, x1: float, color: str = "@grey/0.15") -> Trace:
    """Return a marked stretch of x, below everything else."""
    ends = {"xref": "x", "yref": "paper", "x0": x0, "x1": x1, "y0": 0, "y1": 1}
    return {"type": "rect", "layer": "below", "fillcolor": color, "line": {"width": 0}} | ends


def names_from_top(names: Sequence[str]) -> dict[str, Any]:
    """Return the layout of y with names from the top down, for bars or points of ``"orientation": "h"``; all find place."""
    return {"type": "category", "categoryorder": "array", "categoryarray": list(names)[::-1], "dtick": 1}
