"""Pictures of a run. Every ``plot_*`` draws into one ``Axes`` and returns it; ``save_pictures`` makes the usual set.

Colours are those of Okabe and Ito and of the maps viridis and cividis, which colour-blind readers can tell apart.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .errors import ResultsError
from .report import Judgement, judge, judgements, need

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
GREY = "#9a9a9a"
SIDE = 0.6  # [m] of the prestressed thesis membrane
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


def _element(values: xr.DataArray, number: int) -> xr.DataArray:
    """Return element ``number`` (from 1) of an array over time."""
    return values.sel({values.dims[1]: number})


def plot_sensor_loop(data: xr.Dataset, sensor: int = 1, *, membrane: str = "membrane", ax: Axes | None = None) -> Axes:
    """Draw resistance against strain of one sensor, coloured by time: hysteresis and drift."""
    from matplotlib.collections import LineCollection

    strains, resistance = need(data, f"{membrane}.strain", f"sensor{sensor}.resistance")
    ax = _axes(ax)
    points = np.column_stack([_element(strains, sensor).to_numpy(), resistance.to_numpy()])
    lines = LineCollection(list(np.stack([points[:-1], points[1:]], axis=1)), cmap="viridis", linewidths=1.0)
    lines.set_array(data["time"].to_numpy()[1:])
    ax.add_collection(lines)
    ax.autoscale_view()
    ax.set(xlabel="strain [1]", ylabel="resistance [Ω]", title=f"Sensor {sensor}")
    ax.figure.colorbar(lines, ax=ax, label="time [s]")
    return ax


def plot_strain(data: xr.Dataset, sensor: int = 1, *, membrane: str = "membrane", ax: Axes | None = None) -> Axes:
    """Draw true and compensated strain at one sensor over time."""
    strains, compensated = need(data, f"{membrane}.strain", f"compensator{sensor}.strain")
    ax, time = _axes(ax), data["time"]
    true = _element(strains, sensor)
    ax.plot(time, true, color="black", lw=1.6, label="true")
    ax.plot(time, compensated, color=COLORS[1], lw=1.0, ls="--", label="compensated")
    error = float(np.sqrt(np.mean((compensated.to_numpy() - true.to_numpy()) ** 2)))
    span = float(np.ptp(true.to_numpy())) or 1.0
    ax.set(
        xlabel="time [s]", ylabel="strain [1]", title=f"Sensor {sensor}: RMS error {100 * error / span:.2g} % of range"
    )
    ax.legend(loc="upper right", ncols=2, borderaxespad=0.1)
    ax.margins(x=0.0)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.15 * (high - low))
    return ax


def plot_damage_map(
    data: xr.Dataset | Judgement, which: Literal["true", "estimated"] = "estimated", *, ax: Axes | None = None
) -> Axes:
    """Draw damage of the zones as numbers on the membrane: zone 1 at the origin, x to the right.

    Parameters
    ----------
    data : xarray.Dataset or Judgement
        Results, of which the last judgement is drawn, or one judgement.
    which : {"true", "estimated"}
        What was put in, or what the detector found.
    ax : matplotlib.axes.Axes, optional
        Where to draw.
    """
    judgement = data if isinstance(data, Judgement) else judge(data)
    ax = _axes(ax)
    percent = 100.0 * (judgement.true if which == "true" else judgement.estimated)
    side = round(percent.size**0.5)
    top = max(50.0, 100.0 * float(max(judgement.true.max(), judgement.estimated.max())))
    extent = (0.0, SIDE, 0.0, SIDE)
    ax.imshow(percent.reshape(side, side), origin="lower", extent=extent, vmin=0.0, vmax=top, cmap="Blues")
    for zone, value in enumerate(percent):
        x, y = (zone % side + 0.5) * SIDE / side, (zone // side + 0.5) * SIDE / side
        color = "white" if value > 0.55 * top else "black"
        ax.text(x, y, f"{value:.1f}", ha="center", va="center", color=color, fontsize=11)
        ax.text(
            x - 0.46 * SIDE / side, y + 0.46 * SIDE / side, f"{zone + 1}", ha="left", va="top", color=color, fontsize=7
        )
    ticks = np.linspace(0.0, SIDE, side + 1)
    ax.set(xlabel="x [m]", ylabel="y [m]", title=f"{which.capitalize()} damage [%]", xticks=ticks, yticks=ticks)
    ax.grid(color=GREY, alpha=0.6, lw=0.8)
    return ax


def plot_damage_history(
    data: xr.Dataset, *, membrane: str = "membrane", detector: str = "detector", ax: Axes | None = None
) -> Axes:
    """Draw the estimate of every zone over time, true damage dashed; zones that matter in colour, the others grey."""
    true, estimated = need(data, f"{membrane}.damage", f"{detector}.damage")
    ax, time = _axes(ax), data["time"]
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
    for judgement in judgements(data, membrane, detector):
        ax.axvline(judgement.time, color=GREY, lw=0.6, ls=":")
    ax.set(xlabel="time [s]", ylabel="damage [%]", title="Damage over time; a dotted line ends a window")
    ax.set_ylim(-1.0, max(10.0, 1.15 * float(max(t.max(), e.max()))))
    ax.margins(x=0.0)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def _plot_windows(data: xr.Dataset, ax: Axes) -> None:
    """Draw the history if there is more than one window."""
    if len(judgements(data)) < 2:
        msg = "a single judgement has no history"
        raise ResultsError(msg)
    plot_damage_history(data, ax=ax)


def plot_deflection(data: xr.Dataset, *, membrane: str = "membrane", ax: Axes | None = None) -> Axes:
    """Draw the membrane's deflection, a spline through its nodes, at the instant at which the centre is farthest out."""
    from scipy.interpolate import RectBivariateSpline

    w, centre = need(data, f"{membrane}.w", f"{membrane}.deflection")
    ax = _axes(ax)
    k = int(np.argmax(np.abs(centre.to_numpy())))
    nodes = 1e3 * np.pad(w.to_numpy()[k], 1)
    x, fine = np.linspace(0.0, SIDE, nodes.shape[0]), np.linspace(0.0, SIDE, 97)
    shape = RectBivariateSpline(x, x, nodes)(fine, fine)
    contours = ax.contourf(fine, fine, shape.T, levels=16, cmap="viridis")
    ax.contour(fine, fine, shape.T, levels=16, colors="white", linewidths=0.3, alpha=0.6)
    thirds = np.array([SIDE / 3, 2 * SIDE / 3])
    for number, (px, py) in enumerate([(px, py) for py in thirds for px in thirds], start=1):
        ax.plot(px, py, "o", ms=4, mfc="white", mec="black")
        ax.annotate(f"{number}", (px, py), xytext=(4, 4), textcoords="offset points", color="white", fontsize=8)
    ax.set_aspect("equal")
    ax.grid(visible=False)
    ax.set(xlabel="x [m]", ylabel="y [m]", title=f"Deflection at t = {float(data['time'][k]):.4f} s, and the sensors")
    ax.figure.colorbar(contours, ax=ax, label="deflection [mm]", shrink=0.8)
    return ax


def plot_deflection_history(data: xr.Dataset, *, membrane: str = "membrane", ax: Axes | None = None) -> Axes:
    """Draw the deflection of the membrane's centre over time and mark its largest."""
    (centre,) = need(data, f"{membrane}.deflection")
    ax, time = _axes(ax), data["time"].to_numpy()
    values = 1e3 * centre.to_numpy()
    k = int(np.argmax(np.abs(values)))
    ax.plot(time, values, color=COLORS[0], lw=1.2)
    ax.plot(time[k], values[k], "o", color=COLORS[1], ms=5)
    ax.set(xlabel="time [s]", ylabel="deflection [mm]", title=f"Centre: {values[k]:.1f} mm at t = {time[k]:.4f} s")
    ax.margins(x=0.02, y=0.1)
    return ax


def save_pictures(data: xr.Dataset, folder: Path) -> list[Path]:
    """Draw what the recorded variables allow and write it as PNG, without a display; return the paths."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    pages: dict[str, tuple[tuple[int, int], tuple[float, float], Callable[[Any], object]]] = {
        "sensors": ((2, 2), (9, 7), lambda axes: [plot_sensor_loop(data, i + 1, ax=ax) for i, ax in enumerate(axes)]),
        "strains": ((2, 2), (11, 6.5), lambda axes: [plot_strain(data, i + 1, ax=ax) for i, ax in enumerate(axes)]),
        "damage": (
            (1, 2),
            (9.0, 4.7),
            lambda axes: (plot_damage_map(data, "true", ax=axes[0]), plot_damage_map(data, "estimated", ax=axes[1])),
        ),
        "damage_history": ((1, 1), (9, 4.2), lambda axes: _plot_windows(data, axes[0])),
        "deflection": (
            (1, 2),
            (11, 4.4),
            lambda axes: (plot_deflection(data, ax=axes[0]), plot_deflection_history(data, ax=axes[1])),
        ),
    }
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, (shape, size, draw) in pages.items():
        with mpl.rc_context(STYLE):
            figure = Figure(figsize=size)
            FigureCanvasAgg(figure)
            axes = np.atleast_1d(figure.subplots(*shape)).ravel()
            path = folder / f"{name}.png"
            try:
                draw(axes)
            except ResultsError:
                path.unlink(missing_ok=True)  # of an earlier run
                continue
            figure.suptitle(str(data.attrs.get("title", "")))
            figure.savefig(path)
            written.append(path)
    return written
