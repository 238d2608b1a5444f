"""Pictures of a run. Every ``plot_*`` draws into one ``Axes`` and returns it; ``save_pictures`` makes the usual set.

Colours are those of Okabe and Ito and of the maps viridis and cividis, which colour-blind readers can tell apart.
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from .errors import ResultsError
from .report import doubts, judge, need, windows
from .roles import compensators, find, sensors

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

logger = logging.getLogger(__name__)

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
GREY = "#9a9a9a"
STYLE: dict[Any, Any] = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "font.size": 10,
    "axes.titlesize": 10,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 150,
}


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.figure().add_subplot()


def _element(values: xr.DataArray, number: int) -> NDArray[np.float64]:
    """Return element ``number`` (from 1) of an array over time."""
    return values.sel({values.dims[1]: number}).to_numpy()


def _pick(components: dict[int, str], number: int, role: str) -> str:
    """Return the component at a sensor's place."""
    if number not in components:
        msg = f"there is no {role} {number}; there are {', '.join(map(str, components)) or 'none'}."
        raise ResultsError(msg)
    return components[number]


def _side(data: xr.Dataset) -> tuple[float, str]:
    """Return the side of the stretched square and its unit; 1 and "side" if its parameters are not known."""
    membrane = find(data, "membrane")
    known = json.loads(data.attrs.get("fmus", "{}")).get(membrane, {}).get("parameters", {})
    for name in ("side_length", "edge_displacement"):
        if f"{membrane}.{name}" in data.data_vars:
            known[name] = float(data[f"{membrane}.{name}"][0])
    side = known.get("side_length", math.nan) + 2.0 * known.get("edge_displacement", math.nan)
    return (1.0, "side") if math.isnan(side) else (side, "m")


def plot_sensor_loop(data: xr.Dataset, sensor: int = 1, *, ax: Axes | None = None) -> Axes:
    """Draw resistance against strain of one sensor, coloured by time: hysteresis and drift.

    Of more than two windows of the detector the first and the last are drawn.
    """
    from matplotlib.collections import LineCollection

    component = _pick(sensors(data), sensor, "sensor")
    strains, resistance = need(data, f"{find(data, 'membrane')}.strain", f"{component}.resistance")
    ax, time = _axes(ax), data["time"].to_numpy()
    points = np.column_stack([_element(strains, sensor), resistance.to_numpy()])
    ends = _window_ends(data)
    many = len(ends) > 2
    drawn = (time[1:] <= ends[0]) | ((time[1:] > ends[-2]) & (time[1:] <= ends[-1])) if many else time[1:] >= time[0]
    lines = LineCollection(list(np.stack([points[:-1], points[1:]], axis=1)[drawn]), cmap="viridis", linewidths=1.0)
    lines.set_array(time[1:][drawn])
    ax.add_collection(lines)
    ax.autoscale_view()
    title = f"Sensor {sensor}" + (", first and last window" if many else "")
    ax.set(xlabel="strain [1]", ylabel="resistance [Ω]", title=title)
    ax.figure.colorbar(lines, ax=ax, label="time [s]")
    return ax


def _window_ends(data: xr.Dataset) -> list[float]:
    """Return when windows of the detector ended, if there is one."""
    try:
        return [window.time for window in windows(data)]
    except ResultsError:
        return []


def _strains(data: xr.Dataset, sensor: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return true and compensated strain and the range of the true one, not zero."""
    component = _pick(compensators(data), sensor, "compensator")
    strains, compensated = need(data, f"{find(data, 'membrane')}.strain", f"{component}.strain")
    true = _element(strains, sensor)
    return true, compensated.to_numpy(), float(np.ptp(true)) or 1.0


def plot_strain(data: xr.Dataset, sensor: int = 1, *, ax: Axes | None = None) -> Axes:
    """Draw true and compensated strain at one sensor over time."""
    true, compensated, span = _strains(data, sensor)
    ax, time = _axes(ax), data["time"]
    ax.plot(time, true, color="black", lw=1.6, label="true")
    ax.plot(time, compensated, color=COLORS[1], lw=1.0, ls="--", label="compensated")
    percent = 100.0 * float(np.sqrt(np.mean((compensated - true) ** 2))) / span
    shown = "< 1e-9" if percent < 1e-9 else f"{percent:.2g}"
    ax.set(xlabel="time [s]", ylabel="strain [1]", title=f"Sensor {sensor}: RMS error {shown} % of range")
    ax.legend(loc="upper right", ncols=2, borderaxespad=0.1)
    ax.margins(x=0.0)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.15 * (high - low))
    return ax


def plot_strain_error(data: xr.Dataset, sensor: int = 1, *, ax: Axes | None = None) -> Axes:
    """Draw compensated minus true strain at one sensor over time, in percent of the true strain's range."""
    true, compensated, span = _strains(data, sensor)
    ax, percent = _axes(ax), 100.0 * (compensated - true) / span
    ax.plot(data["time"], percent, color=COLORS[0], lw=0.8)
    top = max(1.1 * float(np.abs(percent).max()), 1e-3)  # less is a line at zero
    ax.set(xlabel="time [s]", ylabel="error [%]", ylim=(-top, top))
    ax.margins(x=0.0)
    return ax


def plot_damage_map(
    data: xr.Dataset, which: Literal["true", "estimated"] = "estimated", *, ax: Axes | None = None
) -> Axes:
    """Draw damage of the zones at the last valid judgement as numbers: zone 1 at the origin, x to the right.

    Parameters
    ----------
    data : xarray.Dataset
        Results.
    which : {"true", "estimated"}
        What was put in, or what the detector found.
    ax : matplotlib.axes.Axes, optional
        Where to draw.
    """
    judgement, (length, unit) = judge(data), _side(data)
    ax = _axes(ax)
    percent = 100.0 * (judgement.true if which == "true" else judgement.estimated)
    side = round(percent.size**0.5)
    top = max(50.0, 100.0 * float(max(judgement.true.max(), judgement.estimated.max())))
    extent = (0.0, length, 0.0, length)
    ax.imshow(percent.reshape(side, side), origin="lower", extent=extent, vmin=0.0, vmax=top, cmap="Blues")
    size = length / side
    for zone, value in enumerate(percent):
        x, y = (zone % side + 0.5) * size, (zone // side + 0.5) * size
        color = "white" if value > 0.55 * top else "black"
        ax.text(x, y, f"{value:.1f}", ha="center", va="center", color=color, fontsize=11)
        ax.text(x - 0.46 * size, y + 0.46 * size, f"{zone + 1}", ha="left", va="top", color=color, fontsize=8)
    ticks = np.linspace(0.0, length, side + 1)
    title = f"{which.capitalize()} damage [%] at t = {judgement.time:.4f} s"
    ax.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]", title=title, xticks=ticks, yticks=ticks)
    ax.grid(color=GREY, alpha=0.6, lw=0.8)
    return ax


def plot_damage_history(data: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the estimate of every zone over time, true damage dashed; zones that matter in colour, the others grey.

    A dot stands at every judgement, a cross where a window ended without a valid one.
    """
    true, estimated = need(data, f"{find(data, 'membrane')}.damage", f"{find(data, 'detector')}.damage")
    ax, time = _axes(ax), data["time"].to_numpy()
    t, e = 100.0 * true.to_numpy(), 100.0 * estimated.to_numpy()
    damaged = list(np.flatnonzero(t.max(axis=0) > 0.0))
    suspects = [z for z in np.argsort(-e.max(axis=0)) if z not in damaged and e[:, z].max() > 3.0]
    shown = (damaged + suspects)[: len(COLORS)]
    rest = [z for z in range(e.shape[1]) if z not in shown]
    for i, zone in enumerate(rest):
        ax.step(time, e[:, zone], where="post", color=GREY, lw=0.6, label="other zones" if i == 0 else None)
    for color, zone in zip(COLORS, shown, strict=False):
        ax.step(time, e[:, zone], where="post", color=color, lw=1.8, label=f"zone {zone + 1}, estimated")
        if zone in damaged:
            ax.step(time, t[:, zone], where="post", color=color, lw=1.2, ls="--", label=f"zone {zone + 1}, true")
    ended = windows(data)
    for valid, marker, label in ((True, "o", "judgement"), (False, "x", "not valid")):
        some = [window for window in ended if window.valid == valid]
        heights = [100.0 * window.estimated.max() for window in some]
        if some:
            ax.plot([w.time for w in some], heights, marker, color="black", ms=5, label=label, zorder=3)
    for window in ended:
        ax.axvline(window.time, color=GREY, lw=0.6, ls=":")
    ax.set(xlabel="time [s]", ylabel="damage [%]", title="Damage over time; a dotted line ends a window")
    ax.set_xlim(time[0], time[-1] + 0.03 * (time[-1] - time[0]))  # room for the last judgement
    ax.set_ylim(-1.0, max(10.0, 1.15 * float(max(t.max(), e.max()))))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=4)
    return ax


def plot_deflection(data: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the membrane's deflection, a spline through its nodes, at the instant at which the centre is farthest out."""
    from matplotlib.patheffects import withStroke
    from scipy.interpolate import RectBivariateSpline

    membrane, (length, unit) = find(data, "membrane"), _side(data)
    w, centre = need(data, f"{membrane}.w", f"{membrane}.deflection")
    ax = _axes(ax)
    k = int(np.argmax(np.abs(centre.to_numpy())))
    nodes = 1e3 * np.pad(w.to_numpy()[k], 1)
    x, fine = np.linspace(0.0, length, nodes.shape[0]), np.linspace(0.0, length, 97)
    shape = RectBivariateSpline(x, x, nodes)(fine, fine).round(9)  # the edge is zero, not a rounding error below it
    contours = ax.contourf(fine, fine, shape.T, levels=16, cmap="viridis")
    ax.contour(fine, fine, shape.T, levels=16, colors="white", linewidths=0.3, alpha=0.6)
    thirds = (length / 3, 2 * length / 3)
    for number, (px, py) in enumerate([(px, py) for py in thirds for px in thirds], start=1):
        ax.plot(px, py, "o", ms=4, mfc="white", mec="black")
        text = ax.annotate(f"{number}", (px, py), xytext=(4, 4), textcoords="offset points", color="white", fontsize=9)
        text.set_path_effects([withStroke(linewidth=2, foreground="black")])
    ax.set_aspect("equal")
    ax.grid(visible=False)
    title = f"Deflection [mm] at t = {float(data['time'][k]):.4f} s, and the sensors"
    ax.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]", title=title)
    ax.figure.colorbar(contours, ax=ax, shrink=0.8)
    return ax


def plot_deflection_history(data: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the deflection of the membrane's centre over time and mark its largest."""
    (centre,) = need(data, f"{find(data, 'membrane')}.deflection")
    ax, time = _axes(ax), data["time"].to_numpy()
    values = 1e3 * centre.to_numpy()
    k = int(np.argmax(np.abs(values)))
    ax.plot(time, values, color=COLORS[0], lw=1.2)
    ax.plot(time[k], values[k], "o", color=COLORS[1], ms=5)
    ax.set(xlabel="time [s]", ylabel="deflection [mm]", title=f"Centre: {values[k]:.1f} mm at t = {time[k]:.4f} s")
    ax.margins(x=0.02, y=0.1)
    return ax


def _page_sensors(data: xr.Dataset, figure: Figure) -> None:
    for number, part in _parts(figure, sensors(data), "sensor"):
        plot_sensor_loop(data, number, ax=part.subplots())


def _page_strains(data: xr.Dataset, figure: Figure) -> None:
    for number, part in _parts(figure, compensators(data), "compensator"):
        upper, lower = part.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        plot_strain(data, number, ax=upper).set(xlabel="")
        plot_strain_error(data, number, ax=lower)


def _page_damage(data: xr.Dataset, figure: Figure) -> None:
    left, right = figure.subplots(1, 2)
    plot_damage_map(data, "true", ax=left)
    plot_damage_map(data, "estimated", ax=right)
    if not windows(data)[-1].valid:
        figure.supxlabel(doubts(data, windows(data))[0], fontsize=9)


def _page_history(data: xr.Dataset, figure: Figure) -> None:
    (true,) = need(data, f"{find(data, 'membrane')}.damage")
    if len(windows(data)) < 2 and not np.ptp(true.to_numpy(), axis=0).any():
        msg = "a single window under constant damage has no history."
        raise ResultsError(msg)
    plot_damage_history(data, ax=figure.subplots())


def _page_deflection(data: xr.Dataset, figure: Figure) -> None:
    left, right = figure.subplots(1, 2)
    plot_deflection(data, ax=left)
    plot_deflection_history(data, ax=right)


def _parts(figure: Figure, components: dict[int, str], role: str) -> Iterator[tuple[int, SubFigure]]:
    """Divide a page among components; give their numbers and parts."""
    if not components:
        msg = f"no component is a {role}: an FMU with the model name {role!r}."
        raise ResultsError(msg)
    columns = min(len(components), 2)
    parts = figure.subfigures(math.ceil(len(components) / columns), columns, squeeze=False)
    return zip(components, np.ravel(parts), strict=False)


_PAGES: dict[str, tuple[tuple[float, float], Callable[[xr.Dataset, Figure], None]]] = {
    "sensors": ((9.0, 7.0), _page_sensors),
    "strains": ((11.0, 7.5), _page_strains),
    "damage": ((9.0, 4.7), _page_damage),
    "damage_history": ((9.0, 4.6), _page_history),
    "deflection": ((11.0, 4.4), _page_deflection),
}


def save_pictures(data: xr.Dataset, folder: Path) -> list[Path]:
    """Draw what the recorded variables allow and write it as PNG, without a display; return the paths.

    If that is nothing, one line of the log says why.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    reasons: list[str] = []
    for name, (size, draw) in _PAGES.items():
        with mpl.rc_context(STYLE):
            figure = Figure(figsize=size)
            FigureCanvasAgg(figure)
            path = folder / f"{name}.png"
            try:
                draw(data, figure)
            except ResultsError as error:
                path.unlink(missing_ok=True)  # of an earlier run
                reasons.append(str(error))
                continue
            figure.suptitle(str(data.attrs.get("title", "")))
            figure.savefig(path)
            written.append(path)
    if not written:
        logger.warning("no pictures: %s", reasons[0])
    return written
