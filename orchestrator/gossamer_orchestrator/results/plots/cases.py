"""Small multiples of a sweep: a panel per case, with the same axes: a variable over time, or the last values of an array."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill, shorten
from typing import TYPE_CHECKING

import xarray as xr
from gossamer_files.pictures import COLORS, GREY, picture

from ...errors import ResultsError
from ...names import suggest
from ..dataset import WATCHED, find_all
from ..judgements import changes, true_damage

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PICTURE = "sweep.png"
PANELS = 36  # of more cases every k-th is drawn
POINTS = 2000  # of a curve
TICKS = 6  # of the elements of an array
LINE = 32  # characters; a title has two


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
    with xr.open_zarr(store, consolidated=False) as data:
        names = [str(name) for name, each in data.data_vars.items() if "time" in each.dims]
        if not names:
            return []
        name = variable or _default(data, names)
        if name not in names:
            msg = f"no case recorded {name!r}. {suggest(name, names)}"
            raise ResultsError(msg)
        detector, _, what = name.partition(".")
        true = true_damage(data) if what == "damage" and detector in find_all(data, "detector") else ""
        with picture(folder / PICTURE) as figure:
            judged = [f"{detector}.{each}" for each in WATCHED if f"{detector}.{each}" in data]
            plot_cases(data[name], varied, figure, data[judged] if judged else None, data.get(true))
    return [folder / PICTURE]


def plot_cases(
    values: xr.DataArray,
    varied: Sequence[str],
    figure: Figure,
    judged: xr.Dataset | None = None,
    true: xr.DataArray | None = None,
) -> None:
    """Draw a variable with the dimensions ``case``, ``time`` and perhaps one more, a panel per case; damage in percent.

    ``judged`` is what the detector says of its windows: last values that are no valid judgement are grey. Diamonds are the
    values of ``true``, of the dimensions of the variable, when the last window ended.
    """
    stride = -(-values.sizes["case"] // PANELS)
    thinned = values.isel(case=slice(None, None, stride))
    if not _is_long(values):
        thinned = thinned.isel(time=slice(None, None, -(-values.sizes["time"] // POINTS)))
    factor, unit = (100.0, "%") if _is_damage(values) else (1.0, values.attrs.get("units", "1"))
    thinned = factor * thinned.load()
    columns = math.ceil(math.sqrt(thinned.sizes["case"]))
    rows = -(-thinned.sizes["case"] // columns)
    figure.set_size_inches(2.4 * columns + 1.4, 1.9 * rows + 1.2)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for ax in axes.flat[thinned.sizes["case"] :]:
        ax.set_axis_off()
    many, detector = _is_long(values), str(values.name).partition(".")[0]
    for ax, (_, case) in zip(axes.flat, thinned.groupby("case"), strict=False):
        number = case["case"].item()
        said = xr.Dataset() if judged is None else judged.sel(case=number).dropna("time", how="all")
        last = said.get(f"{detector}.valid", xr.DataArray([1.0]))[-1:]
        _panel(ax, case.squeeze("case"), varied, is_valid=bool((last > 0.5).all()))
        if many and true is not None:
            _diamonds(ax, factor * true.sel(case=number), said)
    handles, labels = axes.flat[0].get_legend_handles_labels()
    if labels:
        figure.legend(handles, labels, loc="outside right upper", title=None if many else values.dims[-1])
    some = "" if stride == 1 else f", one in {stride} of {values.sizes['case']} cases"
    figure.suptitle(f"{'last ' * many}{values.name}{some}", parse_math=False)
    figure.supxlabel(str(values.dims[-1]) if many else "time [s]")
    figure.supylabel(f"{str(values.name).rpartition('.')[2]} [{unit}]", parse_math=False)


def _is_long(values: xr.DataArray) -> bool:
    """Tell an array of many elements, whose last values are drawn as bars, from what is drawn over time."""
    return values.ndim > 2 and values.shape[-1] > len(COLORS)


def _is_damage(values: xr.DataArray) -> bool:
    return str(values.name).rpartition(".")[2] in ("damage", "deviation") and values.attrs.get("units", "1") == "1"


def _diamonds(ax: Axes, true: xr.DataArray, said: xr.Dataset) -> None:
    ended = true.dropna("time", how="all")
    if ended.sizes["time"]:
        rows = [-1, *(changes(said) if "time" in said.sizes else ())]
        zones, judged = ended[ended.dims[-1]], ended.isel(time=rows[-1])
        ax.plot(zones, judged, marker="D", ms=5, mfc="none", mec=COLORS[1], ls="", label="true")


def _panel(ax: Axes, case: xr.DataArray, varied: Sequence[str], *, is_valid: bool) -> None:
    if case.ndim > 1 and case.shape[1] > len(COLORS):
        ended = case.dropna("time", how="all")
        if ended.sizes["time"]:
            color = COLORS[0] if is_valid else GREY
            elements = ended[case.dims[1]].to_numpy()
            ax.bar(elements, ended.isel(time=-1).to_numpy(), color=color)
            ax.set_xticks(elements[:: -(-len(elements) // TICKS)])
        if not is_valid:
            ax.annotate("not valid", (0.98, 0.95), xycoords="axes fraction", ha="right", va="top")
    elif case.ndim > 1:
        for color, element in zip(COLORS, case[case.dims[1]].to_numpy(), strict=False):
            ax.plot(case["time"], case.sel({case.dims[1]: element}), color=color, label=str(element))
    else:
        ax.plot(case["time"], case, color=COLORS[0])
    given = ", ".join(f"{name.rpartition('.')[2]}={_short(case[name].item())}" for name in varied)
    title = shorten(f"{int(case['case'])}: {given}", 2 * LINE)
    ax.set_title(fill(title, LINE), fontsize=8, parse_math=False)


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _default(data: xr.Dataset, names: Sequence[str]) -> str:
    """Name the estimated damage where there is one, else the first variable."""
    damage = [f"{detector}.damage" for detector in find_all(data, "detector")]
    return next((name for name in damage if name in names), names[0])
