"""Plots of the membrane's deflection, of a square one from above and of one on a mesh in space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from gossamer_files.pictures import COLORS, GREY, axes_or_new

from ...errors import ResultsError
from ..dataset import find, is_whole, need
from ..shapes import TAUT, ShapeHistory, face_strains
from .axes import side, time_axis

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mpl_toolkits.mplot3d import Axes3D

    Page = tuple[Callable[[xr.Dataset, "Figure"], None], tuple[float, float]]

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_deflection(data: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the membrane's deflection, a spline through its grid, at the instant at which the centre is farthest out."""
    from matplotlib.patheffects import withStroke
    from scipy.interpolate import RectBivariateSpline

    membrane, (length, unit) = find(data, "membrane"), side(data)
    w, centre = need(data, f"{membrane}.w", f"{membrane}.deflection")
    if not is_whole(w):
        msg = f"the results lack {membrane}.w of some nodes. Record {membrane}.w* and run the scenario again."
        raise ResultsError(msg)
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
    ax.set(xlabel="time [s]", ylabel="deflection [mm]", title=f"Centre: {values[k]:.4g} mm at t = {time[k]:.4f} s")
    ax.margins(x=0.02, y=0.1)
    time_axis(ax)
    return ax


def plot_shape(history: ShapeHistory, *, ax: Axes3D | None = None) -> Axes3D:
    """Draw a membrane on a mesh at its largest displacement, coloured by it; faces that wrinkle have orange edges."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.figure().add_subplot(projection="3d")
    surface = history.surface
    size = 1e3 * np.linalg.norm(history.places - surface.nodes, axis=2)
    k = int(np.argmax(size.max(axis=1)))
    places = history.places[k]
    colours = ScalarMappable(Normalize(0.0, max(float(size[k].max()), 1e-12)), colormaps["viridis"])
    corners = np.where(surface.faces < 0, surface.faces[:, [2]], surface.faces)  # a triangle's last corner twice
    mark = face_strains(surface, places, history.eigenstrain[k]).mark
    for some, edge, width in ((mark == TAUT, GREY, 0.1), (mark != TAUT, COLORS[1], 0.8)):
        if some.any():
            paint = colours.to_rgba(size[k][corners[some]].mean(axis=1))
            ax.add_collection3d(
                Poly3DCollection(places[corners[some]], facecolors=paint, edgecolors=edge, linewidths=width)
            )
    low, high = places.min(axis=0), places.max(axis=0)
    room = np.maximum(0.02 * float((high - low).max()), 0.05 * (high - low))
    ax.set(xlim=(low[0] - room[0], high[0] + room[0]), ylim=(low[1] - room[1], high[1] + room[1]))
    ax.set(zlim=(low[2] - room[2], high[2] + room[2]), xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    ax.set_box_aspect(high - low + 2.0 * room, zoom=1.2)
    ax.locator_params(nbins=4)
    ax.xaxis.labelpad = ax.yaxis.labelpad = 12.0
    if high[2] - low[2] < 0.1 * float((high - low).max()):  # a flat membrane has no room for numbers
        ax.set(zticks=[], zlabel="")
    wrinkled = f"; {np.mean(mark != TAUT):.0%} of the faces wrinkle (orange edges)" if (mark != TAUT).any() else ""
    ax.set_title(f"Displacement [mm] at t = {history.time[k]:.4f} s{wrinkled}")
    ax.figure.colorbar(colours, ax=ax, shrink=0.6, pad=0.1)
    return ax


def shape_pages(data: xr.Dataset, shapes: Mapping[str, ShapeHistory]) -> dict[str, Page]:
    """Return a page for each membrane that is not drawn from above, by file name: ``deflection``, of several with names."""
    in_space = {name: history for name, history in shapes.items() if f"{name}.w" not in data}

    def page(history: ShapeHistory) -> Callable[[xr.Dataset, Figure], None]:
        def draw(_: xr.Dataset, figure: Figure) -> None:
            plot_shape(history, ax=figure.add_subplot(projection="3d"))

        return draw

    one = len(in_space) == 1
    return {"deflection" if one else f"deflection_{name}": (page(each), (9.0, 6.5)) for name, each in in_space.items()}


def _deflection(data: xr.Dataset, figure: Figure) -> None:
    left, right = figure.subplots(1, 2)
    plot_deflection(data, ax=left)
    plot_deflection_history(data, ax=right)


PAGES = {"deflection": (_deflection, (11.0, 4.4))}
