"""Small multiples of a sweep: one variable over time, a panel per case, all with the same axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from gossamer_files import replacing

from ...errors import ResultsError
from ...names import suggest
from ..roles import find_all
from .axes import COLORS, GREY
from .save import STYLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PICTURE = "sweep.png"
PANELS = 36  # of more cases every k-th is drawn
POINTS = 2000  # of a curve
LONGEST = 40  # characters of a title
NAMED = 6  # elements of an array that have colours of their own; the others are grey


def save_cases(store: Path, folder: Path, variable: str | None, varied: Sequence[str]) -> list[Path]:
    """Draw a variable of a sweep and write it as PNG; return the path, nothing if no case recorded any variable.

    Parameters
    ----------
    store : Path
        Zarr store with a dimension ``case``.
    folder : Path
        Where to write ``sweep.png``.
    variable : str or None
        What to draw; None for the estimated damage where there is a detector, else what was recorded first.
    varied : sequence of str
        Coordinates that differ from case to case, for the titles.

    Raises
    ------
    ResultsError
        There is no such variable.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with xr.open_zarr(store, consolidated=False) as data:
        names = [str(name) for name, each in data.data_vars.items() if "time" in each.dims]
        if not names:
            return []
        name = variable or _default(data, names)
        if name not in names:
            msg = f"no case recorded {name!r}. {suggest(name, names)}"
            raise ResultsError(msg)
        with mpl.rc_context(fname=STYLE):
            figure = Figure()
            FigureCanvasAgg(figure)
            plot_cases(data[name], varied, figure)
            with replacing(folder / PICTURE) as unfinished:
                figure.savefig(unfinished)
    return [folder / PICTURE]


def plot_cases(values: xr.DataArray, varied: Sequence[str], figure: Figure) -> None:
    """Draw a variable with the dimensions ``case``, ``time`` and perhaps one more, a panel per case."""
    stride = -(-values.sizes["case"] // PANELS)
    thinned = values.isel(case=slice(None, None, stride), time=slice(None, None, -(-values.sizes["time"] // POINTS)))
    thinned = thinned.load()
    columns = math.ceil(math.sqrt(thinned.sizes["case"]))
    rows = -(-thinned.sizes["case"] // columns)
    figure.set_size_inches(2.4 * columns + 1.2, 1.9 * rows + 1.2)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for ax in axes.flat[thinned.sizes["case"] :]:
        ax.set_axis_off()
    for ax, (_, case) in zip(axes.flat, thinned.groupby("case"), strict=False):
        _panel(ax, case.squeeze("case"), varied)
    handles, labels = axes.flat[0].get_legend_handles_labels()
    if labels:
        figure.legend(handles, labels, loc="outside right upper", title=values.dims[-1])
    unit = values.attrs.get("units", "1")
    some = "" if stride == 1 else f", every {stride}th of {values.sizes['case']} cases"
    figure.suptitle(f"{values.name} [{unit}]{some}", parse_math=False)
    figure.supxlabel("time [s]")


def _panel(ax: Axes, case: xr.DataArray, varied: Sequence[str]) -> None:
    time = case["time"].to_numpy()
    table = case.to_numpy().reshape(len(time), -1)
    largest = np.argsort(-np.nan_to_num(np.abs(table)).max(axis=0), kind="stable")
    colours = range(table.shape[1]) if table.shape[1] <= NAMED else ()
    for k in largest[::-1]:
        label = str(case[case.dims[1]].to_numpy()[k]) if k in colours and case.ndim > 1 else None
        ax.plot(time, table[:, k], color=COLORS[k] if k in colours else GREY, label=label)
    if not colours:  # the element that moves most stands for the many
        k = int(largest[0])
        ax.plot(time, table[:, k], color=COLORS[1])
        ax.annotate(str(case[case.dims[1]].to_numpy()[k]), (0.98, 0.9), xycoords="axes fraction", ha="right", va="top")
    given = ", ".join(f"{name.rpartition('.')[2]} = {_short(case[name].item())}" for name in varied)
    ax.set_title(shorten(f"{int(case['case'])}: {given}", LONGEST), fontsize=8, parse_math=False)


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _default(data: xr.Dataset, names: Sequence[str]) -> str:
    """Name the estimated damage where there is one, else the first variable."""
    damage = [f"{detector}.damage" for detector in find_all(data, "detector")]
    return next((name for name in damage if name in names), names[0])
