"""Charts of a page: traces and layout of plotly, with colours by name.

A colour is one of ``@0`` to ``@5``, lines that colour-blind readers can tell apart, ``@ink``, ``@grey`` or ``@alarm``; with
a share after a stroke, ``@0/0.25``, it is translucent. The page paints them as it is light or dark.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .thin import Pixels
from .words import unbroken

SCRIPT = Path(__file__).parent / "assets/charts.js"

Array = NDArray[np.float64]
Trace = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Chart:
    """One picture.

    Attributes
    ----------
    title : str
        Heading.
    x, y : str
        What the axes show, with the unit in brackets.
    traces : sequence of dict
        Traces of plotly, for instance of ``curve``.
    section : str
        Heading above this and the following charts, where it is another than before.
    note : str
        What a reader must know of it.
    text : str
        What it shows, for those who do not see it; the title if empty.
    layout : mapping
        More of plotly's layout, for instance ``{"yaxis": {"type": "log"}}``.
    broad : bool
        As wide as the page.
    tall : bool
        Higher than others, for instance as high as wide.
    linked : str
        Charts of the same name are zoomed together along x.
    """

    title: str
    x: str
    y: str
    traces: Sequence[Trace]
    section: str = ""
    note: str = ""
    text: str = ""
    layout: Mapping[str, Any] = field(default_factory=dict)
    broad: bool = False
    tall: bool = False
    linked: str = ""


def drawn(charts: Sequence[Chart]) -> dict[str, Any]:
    """Return the content of a page of charts, which ``SCRIPT`` draws."""
    words = [{name: unbroken(getattr(chart, name)) for name in ("title", "note")} for chart in charts]
    return {"charts": [asdict(chart) | each for chart, each in zip(charts, words, strict=True)]}


def curve(name: str, x: ArrayLike, y: ArrayLike, color: str = "@0", **more: Any) -> Trace:  # noqa: ANN401
    """Return a curve; of many points those of the smallest and the largest value in each of some thousand parts in a row.

    Parameters
    ----------
    name : str
        For the legend.
    x, y : array, shape (n,)
        Points, in their order along the curve.
    color : str
        A colour by name.
    **more
        More of plotly's line, for instance ``dash="dash"`` or ``width=3``.
    """
    thin_x, thin_y = _thinned(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    return {"type": "scatter", "mode": "lines", "name": name, "x": thin_x, "y": thin_y, "line": {"color": color} | more}


def band(name: str, x: ArrayLike, low: ArrayLike, high: ArrayLike, color: str = "@0") -> list[Trace]:
    """Return the area between two curves."""
    edges = [curve(name, x, y, color, width=0) | {"hoverinfo": "skip"} for y in (low, high)]
    return [edges[0] | {"showlegend": False}, edges[1] | {"fill": "tonexty", "fillcolor": f"{color}/0.25"}]


def points(
    name: str,
    x: ArrayLike,
    y: ArrayLike,
    color: str = "@0",
    deviation: ArrayLike | None = None,
    **more: Any,  # noqa: ANN401
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
    **more
        More of plotly's marker, for instance ``symbol="x"``.
    """
    trace: Trace = {"type": "scatter", "mode": "markers", "name": name, "x": np.asarray(x), "y": np.asarray(y)}
    trace["marker"] = {"color": color} | more
    return trace if deviation is None else trace | {"error_y": {"array": np.asarray(deviation), "color": color}}


def with_interval(trace: Trace, low: ArrayLike, high: ArrayLike, axis: str = "y") -> Trace:
    """Return points or bars with intervals, from ``low`` to ``high`` along an axis, around their values."""
    values = np.asarray(trace[axis], dtype=float)
    ends = {"array": np.asarray(high) - values, "arrayminus": values - np.asarray(low), "symmetric": False}
    return trace | {f"error_{axis}": ends | {"color": trace["marker"]["color"], "thickness": 1.2, "width": 3}}


def bars(name: str, x: ArrayLike, y: ArrayLike, color: str = "@0") -> Trace:
    """Return bars; ``x`` may be words."""
    return {"type": "bar", "name": name, "x": np.asarray(x), "y": np.asarray(y), "marker": {"color": color}}


def names_from_top(names: Sequence[str]) -> dict[str, Any]:
    """Return the layout of y with names from the top down, for bars or points of ``"orientation": "h"``; all find place."""
    return {"type": "category", "categoryorder": "array", "categoryarray": list(names)[::-1], "dtick": 1}


def heat(x: ArrayLike, y: ArrayLike, z: ArrayLike, label: str, **more: Any) -> Trace:  # noqa: ANN401
    """Return a map of colours, ``z`` of shape (len(y), len(x)), with ``label`` at its scale."""
    bar = {"title": {"text": label}, "thickness": 12}
    x, y, z = (np.asarray(each) for each in (x, y, z))
    return {"type": "heatmap", "x": x, "y": y, "z": z, "colorscale": "Viridis", "colorbar": bar} | more


def _thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """Return fewer points: of a curve over time smallest and largest of each pixel, of a loop those of x and of y."""
    pixels = Pixels(len(x))
    if pixels.stride == 1:
        return x, y
    if (np.diff(x) > 0.0).all():
        parts = [(pixels.times(x[rows]), pixels.thin(y[rows])) for rows in pixels.parts()]
        return np.concatenate([time for time, _ in parts]), np.concatenate([values for _, values in parts])
    rows = _turns(x, y, 2 * pixels.stride)
    return x[rows], y[rows]


def _turns(x: Array, y: Array, length: int) -> NDArray[np.intp]:
    """Return the rows of the smallest and the largest x and y of every so many points, in their order along the curve."""
    rows = np.arange(-(-len(x) // length) * length).clip(max=len(x) - 1).reshape(-1, length)
    found = []
    for values in (x[rows], y[rows]):
        known = np.isfinite(values)
        found += [np.where(known, values, np.inf).argmin(axis=1), np.where(known, values, -np.inf).argmax(axis=1)]
    return np.unique(np.take_along_axis(rows, np.column_stack(found), axis=1))
