"""What all plots share: colours, axes, and the size of the membrane.

Colours are those of Okabe and Ito and of the maps viridis and cividis, which colour-blind readers can tell apart.
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

import xarray as xr

from ..roles import find_all

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
GREY = "#9a9a9a"


def axes_or_new(ax: Axes | None) -> Axes:
    """Return the axes given, or those of a new figure."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.figure().add_subplot()


def time_axis(ax: Axes) -> None:
    """Keep the ticks of a time axis apart, whatever its span: few of them, and what they share written once."""
    from matplotlib.ticker import MaxNLocator

    ax.xaxis.set_major_locator(MaxNLocator(6))
    ax.ticklabel_format(axis="x", style="sci", scilimits=(-2, 5), useOffset=True)


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
