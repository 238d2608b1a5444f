"""Charts of placements: the membrane seen along its normal, zones coloured by a90, its sensors, the check."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gossamer_files.charts import Array, Chart, Trace, bars, points, section, words
from gossamer_files.pictures import picture
from gossamer_files.plots import Panels, draw_panels

from ..arrays import Matrix, Vector
from ..membrane import Structure
from ..twin.least_squares import MOST_DAMAGE
from .placing import Placing

NAMED = 40  # zones with a label: more would cover the picture
LENGTH = 0.05  # of the line of a sensor, shares of the membrane's size


def placement_charts(found: Placing) -> list[Chart]:
    """Return all charts of a placement."""
    parts = (("Membrane", _maps(found)), ("Zones", [_zones(found)]), ("Sensors", _curve(found)), ("Check", _check(found)))
    return [chart for title, charts in parts for chart in section(title, charts)]


def save_picture(found: Placing, path: Path) -> None:
    """Draw the membrane's own sensors and the chosen ones side by side."""
    charts = [*_maps(found), *_curve(found)]
    panels = Panels(charts, (4.9 * len(charts) + 0.9, 4.6), len(charts))
    with picture(path, panels.size) as figure:
        draw_panels(panels, figure)


def damage_text(value: float) -> str:
    """Say how large a damage is that is found."""
    return f"{100.0 * MOST_DAMAGE:g} % or more" if value >= MOST_DAMAGE else f"{100.0 * value:.3g} %"


def _zones(found: Placing) -> Chart:
    zones = np.arange(1, found.structure.n_zones + 1)
    traces = [
        bars(f"{len(p.sensors)} {name} sensors", zones, 100.0 * p.a90, color)
        for color, (name, p) in zip(("@grey", "@0"), found.placements.items(), strict=False)
    ]
    layout = {"barmode": "group", "xaxis": {"dtick": 1} if len(zones) <= NAMED else {}}
    return Chart("Smallest damage found in 90 % of cases", "zone", "a90 [% damage]", traces, layout=layout, broad=True)


def _curve(found: Placing) -> list[Chart]:
    """Draw the deviation of the worst zone over the number of sensors."""
    counts, worst = np.array(found.curve, dtype=float).reshape(-1, 2).T
    traces = [points("worst zone", counts, 100.0 * worst, "@0")]
    texts = {"x": [f"{count:g}" for count in counts], "y": sorted({f"{float(f'{100.0 * each:.1g}'):g}" for each in worst})}
    layout = {f"{a}axis": {"type": "log", "tickvals": [*map(float, t)], "ticktext": t} for a, t in texts.items()}
    title = "What a number of sensors tells"
    return [Chart(title, "sensors", "deviation [% damage]", traces, layout=layout)] if found.curve else []


def _check(found: Placing) -> list[Chart]:
    traces = []
    for color, (name, p) in zip(("@1", "@0"), found.placements.items(), strict=False):
        if p.check is not None:
            zones = np.arange(1, len(p.check.predicted) + 1)
            predicted, observed = 100.0 * p.check.predicted, 100.0 * p.check.observed
            traces.append(points(f"{name}, predicted", zones, predicted, color, symbol="line-ew-open", size=14))
            traces.append(points(f"{name}, of fits", zones, observed, color))
    title = "Deviation of the damage at 30 % damage"
    return [Chart(title, "zone", "deviation [% damage]", traces, broad=True)] if traces else []


def _maps(found: Placing) -> list[Chart]:
    """Draw the membrane along its normal, zones coloured by a90 on a logarithmic scale, with the sensors."""
    values = np.concatenate([p.a90 for p in found.placements.values()])
    limits = np.log10([values.min(), max(values.max(), 1.01 * values.min())])
    mesh = found.structure.mesh
    view = view_of(mesh.nodes)
    faces, zone = faces_of(found.structure)
    flat = [mesh.nodes[nodes] @ view for nodes in faces]
    named = [next((x for x, axis in zip("xyz", np.eye(3), strict=True) if np.allclose(along, axis)), "") for along in view.T]
    axes = [f"{name} [m]".strip() for name in named]
    charts = []
    for name, p in found.placements.items():
        shade = (np.log10(p.a90) - limits[0]) / (limits[1] - limits[0])
        traces: list[Trace] = []
        places = []
        for k in range(-1, len(p.a90)):
            own = [polygon for polygon, z in zip(flat, zone, strict=True) if z == k]
            if own:
                label = f"zone {k + 1}: a90 {damage_text(p.a90[k])}" if k >= 0 else "no zone"
                traces.append(_area(label, own, _color(shade[k]) if k >= 0 else "@grey"))
                places += [(k, *np.mean([polygon.mean(axis=0) for polygon in own], axis=0))] if k >= 0 else []
        if 0 < len(places) <= NAMED:
            traces.append(_labels(places, p.a90, shade))
        traces += [_sensor(k, s, view, mesh.size) for k, s in enumerate(p.sensors)]
        traces.append(_scale(limits))
        equal = {"xaxis": {"constrain": "domain"}, "yaxis": {"scaleanchor": "x", "constrain": "domain"}}
        title = f"{len(p.sensors)} {name} sensors, worst zone a90 = {damage_text(p.a90.max())}"
        charts.append(Chart(title, axes[0], axes[1], traces, layout=equal | {"showlegend": False}, tall=True))
    return charts


def _area(name: str, polygons: list[Array], color: str) -> Trace:
    """Return faces of one colour."""
    gap = np.full((1, 2), np.nan)
    x, y = np.concatenate([part for polygon in polygons for part in (polygon, polygon[:1], gap)]).T
    look = {"mode": "lines", "line": {"width": 0.4, "color": color}, "fillcolor": color, "fill": "toself"}
    return {"type": "scatter", "name": name, "x": x, "y": y, "hoveron": "fills", "hoverinfo": "name"} | look


def _labels(places: Sequence[tuple[int, float, float]], a90: Array, shade: Array) -> Trace:
    zones, x, y = zip(*places, strict=True)
    text = [f"{k + 1}<br>{damage_text(a90[k])}" for k in zones]
    return words(x, y, text, ["#ffffff" if shade[k] > 0.55 else "#000000" for k in zones], font={"size": 10})


def _sensor(number: int, sensor: Any, view: Array, size: float) -> Trace:  # noqa: ANN401
    """Return a sensor as a line along its direction, at least so long that it is seen."""
    point, along = np.array(sensor.point) @ view, np.array(sensor.direction) @ view
    half = 0.5 * max(LENGTH * size, sensor.gauge_length) * along / np.linalg.norm(sensor.direction)
    x, y = np.array([point - half, point, point + half]).T
    look = {"mode": "lines+markers", "line": {"color": "#D55E00", "width": 4}}
    marker = {"color": "#D55E00", "size": [1, 9, 1], "line": {"color": "#ffffff", "width": 1}}
    return {"type": "scatter", "name": f"sensor {number + 1}", "x": x, "y": y, "marker": marker, "hoverinfo": "name"} | look


def _scale(limits: Array) -> Trace:
    """Return a scale of the colours beside the picture."""
    ticks = np.linspace(limits[0], limits[1], 4)
    labels = [f"{100.0 * 10.0**tick:.2g}" for tick in ticks]
    bar = {"title": {"text": "a90 [%]"}, "tickvals": ticks.tolist(), "ticktext": labels, "thickness": 12}
    marker = {"color": limits.tolist(), "colorscale": "Viridis", "reversescale": True, "showscale": True, "colorbar": bar}
    return {"type": "scatter", "mode": "markers", "x": [None, None], "y": [None, None], "marker": marker}


def _color(shade: float) -> str:
    """Return a colour of Viridis, 0 the lightest and 1 the darkest."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return str(to_hex(colormaps["viridis"](1.0 - shade)))


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
