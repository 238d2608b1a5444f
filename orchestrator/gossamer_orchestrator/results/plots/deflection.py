"""Plots of the membrane's deflection."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ..roles import find, need
from .axes import COLORS, axes_or_new, side

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_deflection(data: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the membrane's deflection, a spline through its grid, at the instant at which the centre is farthest out."""
    from matplotlib.patheffects import withStroke
    from scipy.interpolate import RectBivariateSpline

    membrane, (length, unit) = find(data, "membrane"), side(data)
    w, centre = need(data, f"{membrane}.w", f"{membrane}.deflection")
    ax = axes_or_new(ax)
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
    ax, time = axes_or_new(ax), data["time"].to_numpy()
    values = 1e3 * centre.to_numpy()
    k = int(np.argmax(np.abs(values)))
    ax.plot(time, values, color=COLORS[0], lw=1.2)
    ax.plot(time[k], values[k], "o", color=COLORS[1], ms=5)
    ax.set(xlabel="time [s]", ylabel="deflection [mm]", title=f"Centre: {values[k]:.1f} mm at t = {time[k]:.4f} s")
    ax.margins(x=0.02, y=0.1)
    return ax


def _deflection(data: xr.Dataset, figure: Figure) -> None:
    left, right = figure.subplots(1, 2)
    plot_deflection(data, ax=left)
    plot_deflection_history(data, ax=right)


PAGES = {"deflection": (_deflection, (11.0, 4.4))}
