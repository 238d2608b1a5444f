"""What the plots of a run share: axes, and the size of the membrane."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Literal

import xarray as xr

from ..dataset import find_all

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

LEAST_SPAN = 1e-4  # of an axis, in shares of the values
STEPS = [1, 2, 2.5, 5, 10]  # of ticks, but for powers of ten


def time_axis(ax: Axes) -> None:
    """Keep the ticks of a time axis apart, whatever its span: few of them, and what they share written once."""
    from matplotlib.ticker import MaxNLocator

    ax.xaxis.set_major_locator(MaxNLocator(6, steps=STEPS))
    ax.ticklabel_format(axis="x", style="sci", scilimits=(-2, 5), useOffset=True, useMathText=True)


def plain_axis(ax: Axes, which: Literal["x", "y"]) -> None:
    """Write the numbers of an axis out, few of them, on a scale on which values that hardly differ are one."""
    from matplotlib.ticker import MaxNLocator

    axis, low, high = _widened(ax, which)
    are_long = which == "x" and high - low < 1e-2 * max(abs(low), abs(high))
    axis.set_major_locator(MaxNLocator(2 if are_long else 5, steps=STEPS))
    ax.ticklabel_format(axis=which, useOffset=False)


def short_axis(ax: Axes, which: Literal["x", "y"]) -> None:
    """Write few digits at each tick of an axis, and what they share, a power or a beginning, once."""
    from matplotlib.ticker import MaxNLocator

    axis, _, _ = _widened(ax, which)
    axis.set_major_locator(MaxNLocator(4, steps=STEPS))
    ax.ticklabel_format(axis=which, style="sci", scilimits=(-2, 4), useOffset=True, useMathText=True)


def _widened(ax: Axes, which: Literal["x", "y"]) -> tuple[Axis, float, float]:
    """Widen an axis until values that hardly differ are one; return it and its ends."""
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = axis.get_view_interval()
    room = 0.5 * max(0.0, LEAST_SPAN * max(abs(low), abs(high)) - (high - low))
    ax.set(**{f"{which}lim": (low - room, high + room)})
    return axis, low - room, high + room


def side(data: xr.Dataset) -> tuple[float, str]:
    """Return the side of the stretched square and its unit; 1 and "side" if its parameters are not known."""
    known = _square_parameters(data, next(iter(find_all(data, "membrane")), ""))
    length = known.get("side_length", math.nan) + 2.0 * known.get("edge_displacement", math.nan)
    return (1.0, "side") if math.isnan(length) else (length, "m")


def _square_parameters(data: xr.Dataset, membrane: str) -> dict[str, float]:
    """Return the parameters of a square membrane that are recorded, or else stated by its FMU."""
    known = dict(json.loads(data.attrs.get("fmus", "{}")).get(membrane, {}).get("parameters", {}))
    for name in ("side_length", "edge_displacement"):
        if f"{membrane}.{name}" in data.data_vars:
            known[name] = float(data[f"{membrane}.{name}"][0])
    return known
