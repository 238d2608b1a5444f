"""A picture of placements: the membrane seen along its normal, zones coloured by a90, sensors as lines."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gossamer_files.pictures import COLORS, axes_or_new, picture

from ..arrays import Matrix, Vector
from ..membrane import Structure
from .placing import Placement, Placing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RED = COLORS[1]
_LENGTH = 0.05  # of the line of a sensor, shares of the size
_MOST_NAMED = 40  # zones: more names would cover the picture


def plot_placement(
    structure: Structure, placement: Placement, limits: tuple[float, float], *, ax: Axes | None = None
) -> Axes:
    """Draw zones coloured by a90 on a logarithmic scale, with the sensors.

    Parameters
    ----------
    structure : Structure
        The membrane.
    placement : Placement
        Its sensors.
    limits : tuple of float
        Ends of the colours [1].
    ax : Axes or None
        Where to draw; None for new axes.
    """
    from matplotlib import colormaps
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LogNorm

    ax = axes_or_new(ax)
    view = view_of(structure.mesh.nodes)
    faces, zone = faces_of(structure)
    flat = [structure.mesh.nodes[nodes] @ view for nodes in faces]
    a90 = np.append(placement.a90, np.nan)  # the last is that of no zone
    colours = PolyCollection(flat, array=np.ma.masked_invalid(100.0 * a90[zone]), edgecolors="face", lw=0.4)
    colours.set_norm(LogNorm(100.0 * limits[0], 100.0 * limits[1]))
    colours.set_cmap(colormaps["viridis_r"].with_extremes(bad="0.85"))
    ax.add_collection(colours)
    for k in range(len(structure.setup.zones) if len(structure.setup.zones) <= _MOST_NAMED else 0):
        middle = np.mean([polygon.mean(axis=0) for polygon, z in zip(flat, zone, strict=True) if z == k], axis=0)
        shade = np.log(a90[k] / limits[0]) / np.log(limits[1] / limits[0])
        contrast = "white" if shade > 0.55 else "black"
        text = f"{k + 1}\n{100.0 * a90[k]:.2g} %"
        ax.text(float(middle[0]), float(middle[1]), text, ha="center", va="center", fontsize=7, color=contrast)
    for sensor in placement.sensors:
        point, along = np.array(sensor.point) @ view, np.array(sensor.direction) @ view
        half = 0.5 * max(_LENGTH * structure.mesh.size, sensor.gauge_length) * along / np.linalg.norm(sensor.direction)
        ends = np.array([point - half, point + half])
        ax.plot(*ends.T, color="white", lw=4.0, solid_capstyle="round")
        ax.plot(*ends.T, color=RED, lw=2.2, solid_capstyle="round")
        ax.plot(*point, "o", color=RED, mec="white", ms=4.5, mew=0.8)
    ax.set_aspect("equal")
    ax.grid(visible=False)
    ax.autoscale_view()
    names = [
        "xyz"[k] if np.allclose(view[:, i], np.eye(3)[k]) else "" for i, k in enumerate(np.abs(view).argmax(axis=0))
    ]
    ax.set(xlabel=f"{names[0]} [m]".strip(), ylabel=f"{names[1]} [m]".strip())
    ax.set_title(f"worst zone: a90 = {100.0 * placement.a90.max():.3g} %")
    return ax


def save_picture(found: Placing, path: Path) -> None:
    """Draw the membrane's own sensors and the chosen ones side by side."""
    shown = [(name, p) for name, p in (("own", found.own), ("chosen", found.chosen)) if p is not None]
    values = np.concatenate([p.a90 for _, p in shown])
    limits = (float(values.min()), float(max(values.max(), 1.01 * values.min())))
    with picture(path, (4.6 * len(shown) + 0.9, 4.6)) as figure:
        axes: Any = figure.subplots(1, len(shown), squeeze=False)[0]
        for ax, (name, placement) in zip(axes, shown, strict=True):
            plot_placement(found.structure, placement, limits, ax=ax)
            ax.set_title(f"{len(placement.sensors)} {name} sensors, {ax.get_title()}")
        bar = figure.colorbar(
            axes[-1].collections[0],
            ax=list(axes),
            label="damage found in 90 % of cases, a90 [%]",
            shrink=0.85,
            format="{x:.3g}",
        )
        bar.ax.yaxis.set_minor_formatter("{x:.3g}")


def view_of(nodes: Matrix) -> Matrix:
    """Return the two directions to draw along, shape (3, 2): axes if the surface lies across one, else its widest ones."""
    extent = np.ptp(nodes, axis=0)
    if extent.min() <= 0.3 * extent.max():
        return np.eye(3)[:, np.delete(np.arange(3), extent.argmin())]
    return np.linalg.svd(nodes - nodes.mean(axis=0), full_matrices=False)[2][:2].T


def faces_of(structure: Structure) -> tuple[list[Vector], Vector]:
    """Return the corners of every face, and its zone, -1 for none."""
    corners, zones = [], []
    for block, elements in zip(structure.mesh.blocks, structure.elements, strict=True):
        p = block.order
        ring = [0, 1, 2] if p == 0 else [0, p, (p + 1) ** 2 - 1, p * (p + 1)]
        corners += list(block.elements[:, ring])
        zones += list(structure.zone[elements.combination])
    return corners, np.array(zones)
