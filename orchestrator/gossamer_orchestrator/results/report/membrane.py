"""Charts of the membrane: in space on the page, its deflection, its load, its strain.

Symbols: ``N`` nodes, ``n`` faces, ``T`` triangles, ``F`` instants of the slider.
"""

from __future__ import annotations

import math
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np
from gossamer_files.charts import Array, Chart, Trace, curve, heat, points, words
from gossamer_files.pictures import COLORS, GREY
from gossamer_files.plots import LONGEST_TITLE, Panels

from ...errors import ResultsError
from ...fmi.shape import Integers, Surface
from ..dataset import find, is_whole, need, origins_of, parameters_of, zone_labels
from ..places import side
from ..readers import Recorded, over_time
from ..shapes import SLACK, TAUT, FaceStrains, ShapeHistory, face_strains
from .damage import DamageHistory

SENSORS = ((1, 1), (2, 1), (1, 2), (2, 2))  # places of the sensors of a square in thirds of its side, as it numbers them

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEEN = 0.1  # of its size: how far a membrane that moves less is drawn
CLEAR = 0.12  # of its size: from a sensor to the number of a zone
STILL = 1e-9  # of its size: a motion that is round-off
FLAT_ZONES = 4  # along the side of a square of unknown zones


def membrane_charts(run: Recorded, judged: DamageHistory) -> tuple[list[Chart], dict[str, Any] | None]:
    """Return the charts of the membrane, and what the page needs to draw it in space."""
    history, flat = run.history, False
    if history is None:
        history, flat = square_history(run, judged)
    charts, content, found = [], None, None
    if history is not None:
        found = _strains(run, history)
        content = surface_content(history, run.instants[1]) | {
            "unit": "m" if run.history is not None else side(run.data)[1],
            "marked": any((each.mark != TAUT).any() for each in found),
            "names": zone_labels(run.data, int(history.surface.zone.max(initial=-1)) + 1),
            "colours": _colours(run, judged, history, found, flat=flat),
        }
        charts.append(_in_space(judged, content, flat=flat))
    if f"{run.membrane}.deflection" in run.data:
        charts.append(deflection_chart(run, tall=bool(judged.side)))
    return [*charts, *_load(run), *_strain(run, found)], content


def _in_space(judged: DamageHistory, content: dict[str, Any], *, flat: bool) -> Chart:
    scale = f"Displacements are drawn {content['factor']:g} times as large; the axes hold for the membrane at rest."
    if content["factor"] == 1.0:
        scale = "Drawn to scale."
    note = f"{scale} Drag to turn; squares are zones, dots sensors"
    note += ", crosses faces that wrinkle or are slack." if content["marked"] else "."
    if flat:
        note = "Deflections of the nodes (membrane.w) are not recorded, so it is drawn flat."
    text = "The membrane in three dimensions, with zones, sensors, wrinkles and damage marked; the tables hold the numbers."
    return Chart("Membrane", note=note, text=text, tall=True, broad=not judged.side, script="addSurface")


def square_history(run: Recorded, judged: DamageHistory) -> tuple[ShapeHistory | None, bool]:
    """Return the shapes of a square membrane from the deflections of its nodes, flat if they were not recorded."""
    w, zones = run.heights, judged.side
    if w is None and not zones:
        return None, False
    zones, time, (length, _) = zones or FLAT_ZONES, run.time[run.instants[0]], side(run.data)
    if w is None:
        heights: Array = np.zeros((len(time), 2 * zones + 1, 2 * zones + 1))
    else:
        heights = np.pad(w.isel(time=run.instants[0]).to_numpy(), ((0, 0), (1, 1), (1, 1)))  # the edge is fixed
    count = heights.shape[1]
    x, y = (each.ravel() * length / (count - 1) for each in np.indices((count, count)))
    corner = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    i, j = (corner // count * zones // (count - 1)), (corner % count * zones // (count - 1))
    surface = Surface(
        nodes=np.stack([x, y, np.zeros(count**2)], axis=1),
        faces=np.stack([corner, corner + count, corner + count + 1, corner + 1], axis=1),
        element=np.arange(len(corner)),
        region=np.zeros(len(corner), dtype=int),
        zone=j * zones + i if judged.side else np.full(len(corner), -1),
        poisson_ratio=np.array([0.5]),
        direction=np.array([[1.0, 0.0, 0.0]]),
        sensor_points=np.array([[length * a / 3.0, length * b / 3.0, 0.0] for a, b in SENSORS]),
        sensor_directions=np.tile([1.0, 0.0, 0.0], (4, 1)),
    )
    places = np.tile(surface.nodes, (len(time), 1, 1))
    places[..., 2] = heights.reshape(len(time), -1)
    return ShapeHistory(surface, time, places, np.zeros((len(time), 1, 3))), w is None


def _strains(run: Recorded, history: ShapeHistory) -> list[FaceStrains]:
    """Return strain and wrinkles of the faces at the slider's instants; of a square from its nodes there are none."""
    if run.history is None:
        return []
    return [face_strains(history.surface, history.places[k], history.eigenstrain[k]) for k in run.instants[1]]


def surface_content(history: ShapeHistory, shown: Integers) -> dict[str, Any]:
    """Return a membrane and its motion.

    Parameters
    ----------
    history : ShapeHistory
        Its shapes.
    shown : numpy.ndarray, shape (F,)
        Which of them.

    Returns
    -------
    dict
        ``places`` (F, 3 N) [m], moved by ``factor`` times their displacement; ``triangles`` (T, 3) and ``face``, the face of
        each; ``zone`` of each face, -1 for none; ``borders``, for each zone the nodes of its edge in pairs, the last of
        all faces; ``segments``, nodes of cables and beams in pairs; ``labels``, the node of each zone beside its number, and
        ``label_offsets`` from it; ``sensors``, the node beside each, and ``offsets`` from it.
    """
    surface, nodes = history.surface, history.surface.nodes
    away = history.places[shown] - nodes
    factor = _factor(float(np.linalg.norm(away, axis=2).max()), float(np.ptp(nodes, axis=0).max()))
    triangles, face = _triangles(surface)
    zones = surface.zones
    labels = [_label(surface, zone) for zone in range(zones)]
    beside = [int(np.argmin(np.linalg.norm(nodes - point, axis=1))) for point in surface.sensor_points]
    return {
        "places": (nodes + factor * away).reshape(len(away), -1),
        "factor": factor,
        "triangles": triangles,
        "face": face,
        "zone": surface.zone,
        "borders": [*(_outline(surface, zone) for zone in range(zones)), _border(surface.faces)],
        "segments": surface.segments.ravel(),
        "labels": [node for node, _ in labels],
        "label_offsets": [offset.tolist() for _, offset in labels],
        "sensors": beside,
        "offsets": (surface.sensor_points - nodes[beside]).tolist(),
    }


def _colours(
    run: Recorded, judged: DamageHistory, history: ShapeHistory, found: list[FaceStrains], *, flat: bool
) -> list[dict[str, Any]]:
    """Return what the membrane may be coloured by: values of nodes, faces or zones at each instant, with their scale."""
    zones = history.surface.zones
    size = np.linalg.norm(history.places[run.instants[1]] - history.surface.nodes, axis=2)
    colours: list[dict[str, Any]] = []
    if not flat:
        top = 1e3 * float(size.max()) or 1.0
        colours.append({"name": "deflection", "of": "node", "values": 1e3 * size, "ends": [0.0, top], "unit": "mm"})
    if found:
        strain = 100.0 * np.stack([each.largest for each in found])
        ends = [float(strain.min()), float(strain.max()) or 1.0]
        colours.append({"name": "largest strain", "of": "face", "values": strain, "ends": ends, "unit": "% strain"})
        marks = np.stack([each.mark for each in found]).astype(float)
        colours.append(
            {"name": "wrinkles", "of": "face", "values": marks, "ends": [-0.5, 2.5], "unit": "", "scale": "@marks"}
        )
    steps = judged.steps() if 0 < zones <= judged.zones else []
    time = np.array([each[0] for each in steps])
    for name, rows, column in (("estimated damage", judged.estimated, 1), ("true damage", judged.true, 2)):
        if len(rows) and steps:
            places = [(known if column == 2 else k) for _, k, known in steps]
            values = np.array([rows[k] if k >= 0 else np.zeros(judged.zones) for k in places], dtype=float)
            valid = [column == 2 or k < 0 or bool(judged.valid[k]) for k in places]
            more = {"values": values, "time": time, "valid": valid, "least": judged.least if column == 1 else 1e-7}
            colours.append({"name": name, "of": "zone", "ends": [0.0, judged.top], "unit": "%", "scale": "@damage"} | more)
    return colours


def deflection_chart(run: Recorded, *, tall: bool = False) -> Chart:
    """Draw the deflection of the membrane's centre over time and mark its largest."""
    name = f"{find(run.data, 'membrane')}.deflection"
    need(run.data, name)
    line = run.curve("centre", name, factor=1e3)
    k = int(np.nanargmax(np.abs(line["y"]))) if np.isfinite(line["y"]).any() else 0
    traces = [line, points("largest", line["x"][[k]], line["y"][[k]], "@1", size=8)]
    result = f"largest {line['y'][k]:.4g} mm at t = {line['x'][k]:.4f} s"
    title, layout = "Deflection of the membrane's centre", {"showlegend": False}
    return over_time(title, "deflection [mm]", traces, result=result, layout=layout, tall=tall)


def _load(run: Recorded) -> list[Chart]:
    """Draw what loads the membrane: the built-in pressure, and recorded inputs or where they come from."""
    known, origins, charts = parameters_of(run.data, run.membrane), origins_of(run.data), []
    traces: list[Trace] = []
    for name in (each.removesuffix("_amplitude") for each in known if each.endswith("_amplitude")):
        if known[f"{name}_amplitude"] and f"{name}_frequency" in known:
            phase = 2.0 * math.pi * known[f"{name}_frequency"] * run.t + known.get(f"{name}_phase", 0.0)
            traces.append(curve(f"{name}, built in", run.t, known[f"{name}_amplitude"] * np.sin(phase), f"@{len(traces)}"))
    moved: list[Trace] = []
    for target in (f"{run.membrane}.{each}" for each in ("pressure", "gas_pressure", *_BASE)):
        name = target if target in run.data else origins.get(target, "")
        if name in run.data and run.data[name].dims == ("time",):
            some = moved if "base" in target else traces
            some.append(run.curve(target.rpartition(".")[2], name, f"@{len(some)}"))
    if traces:
        charts.append(over_time("Load: pressure on the membrane", "pressure [Pa]", traces))
    if moved and any(np.any(each["y"]) for each in moved):
        charts.append(over_time("Load: motion of the base", "acceleration [m/s2]", moved))
    return charts


_BASE = ("base_acceleration", *(f"base_acceleration[{k}]" for k in (1, 2, 3)))


def _strain(run: Recorded, found: list[FaceStrains] | None) -> list[Chart]:
    """Draw the largest strain of the membrane, and how much of it wrinkles or is slack, over time."""
    charts, name, time = [], f"{run.membrane}.largest_strain", run.time[run.instants[0]]
    title, y = "Largest strain of the membrane", "strain [%]"
    if name in run.data:
        charts.append(over_time(title, y, [run.curve("largest", name, factor=100.0)]))
    elif found:
        largest = curve("largest", time, np.array([100.0 * each.largest.max() for each in found]))
        charts.append(over_time(title, y, [largest], note="Of all faces, at the slider's instants."))
    if found:
        traces = [
            curve(name, time, np.array([100.0 * np.mean(each.mark >= mark) for each in found]), color)
            for name, mark, color in (("wrinkled or slack", TAUT + 1, "@0"), ("slack", SLACK, "@1"))
        ]
        layout = {"yaxis": {"rangemode": "tozero"}}
        note = "Of the faces, at the slider's instants." if traces[0]["y"].any() else "None at any instant."
        charts.append(over_time("Wrinkled and slack share of the membrane", "share [%]", traces, note=note, layout=layout))
    return charts


def deflection_map(run: Recorded) -> Chart:
    """Draw the deflection, a spline through its grid, at the instant at which the centre is farthest out.

    Raises
    ------
    ResultsError
        Deflections were not recorded.
    """
    from scipy.interpolate import RectBivariateSpline

    membrane, (length, unit) = find(run.data, "membrane"), side(run.data)
    w, centre = need(run.data, f"{membrane}.w", f"{membrane}.deflection")
    if not is_whole(w):
        msg = f"the results lack {membrane}.w of some nodes. Record {membrane}.w* and run the scenario again."
        raise ResultsError(msg)
    k = int(np.argmax(np.abs(centre.to_numpy())))
    nodes = 1e3 * np.pad(w.isel(time=k).to_numpy(), 1)
    x, fine = np.linspace(0.0, length, nodes.shape[0]), np.linspace(0.0, length, 97)
    shape = RectBivariateSpline(x, x, nodes)(fine, fine).round(9)  # the edge is zero, not a rounding error below it
    levels = heat(fine, fine, shape.T, "mm") | {"type": "contour"}
    places = np.array(SENSORS) * length / 3.0
    dots = points("sensors", places[:, 0], places[:, 1], "@ink", size=5)
    numbers = words(places[:, 0] + 0.03 * length, places[:, 1] + 0.03 * length, ["1", "2", "3", "4"], "#ffffff")
    title = f"Deflection [mm] at t = {run.time[k]:.4f} s, and the sensors"
    layout = {"yaxis": {"scaleanchor": "x"}, "showlegend": False}
    return Chart(title, f"x [{unit}]", f"y [{unit}]", [levels, dots, numbers], layout=layout)


def plot_shape(history: ShapeHistory, title: str, figure: Figure) -> None:
    """Draw a membrane on a mesh at its largest displacement, coloured by it; faces that wrinkle have orange edges."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    ax: Any = figure.add_subplot(projection="3d")
    figure.suptitle(shorten(title, LONGEST_TITLE), parse_math=False)
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
            ax.add_collection3d(Poly3DCollection(places[corners[some]], facecolors=paint, edgecolors=edge, linewidths=width))
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
    figure.colorbar(colours, ax=ax, shrink=0.6, pad=0.1)


def _factor(most: float, size: float) -> float:
    """Return 1, or a round number that lets a small motion be seen."""
    if most <= STILL * size or most >= SEEN / 2.0 * size:
        return 1.0
    wanted = SEEN * size / most
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted))


def _triangles(surface: Surface) -> tuple[Integers, Integers]:
    faces, number = surface.faces, np.arange(len(surface.faces))
    quad = faces[:, 3] >= 0
    return np.concatenate([faces[:, :3], faces[quad][:, [0, 2, 3]]]), np.concatenate([number, number[quad]])


def _border(faces: Integers) -> list[int]:
    """Return the sides that belong to one of some faces only, as pairs of nodes."""
    quad = faces[:, 3] >= 0
    rings = [(faces[quad], (0, 1, 2, 3)), (faces[~quad], (0, 1, 2))]
    sides = np.concatenate([ring[:, [a, b]] for ring, order in rings for a, b in zip(order, (*order[1:], 0), strict=True)])
    _, first, count = np.unique(np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True)
    pairs: list[int] = sides[first[count == 1]].ravel().tolist()
    return pairs


def _outline(surface: Surface, zone: int) -> list[int]:
    """Return the nodes of the edge of a zone in pairs, or those of its segments."""
    return [*_border(surface.faces[surface.zone == zone]), *surface.segments[surface.segment_zone == zone].ravel().tolist()]


def _label(surface: Surface, zone: int) -> tuple[int, Array]:
    """Return the node in the middle of a zone, -1 if there is nothing of it, and how far from it its number is [m].

    The number is moved away from a sensor that is near, but no farther than the zone reaches.
    """
    some = np.append(surface.faces[surface.zone == zone].ravel(), surface.segments[surface.segment_zone == zone].ravel())
    if not len(some):
        return -1, np.zeros(3)
    members = np.unique(some[some >= 0])
    places: Array = surface.nodes[members]
    node = int(members[np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1))])
    away = surface.nodes[node] - surface.sensor_points
    distance = np.linalg.norm(away, axis=1)
    wanted = CLEAR * float(np.ptp(surface.nodes, axis=0).max())
    if not len(away) or (least := float(distance.min())) >= wanted:
        return node, np.zeros(3)
    direction = away[np.argmin(distance)] / least if least > 0.0 else np.array([1.0, 0.0, 0.0])
    return node, direction * min(wanted - least, float(np.linalg.norm(np.ptp(places, axis=0))) / 4.0)


def _side_by_side(run: Recorded) -> Panels:
    return Panels([deflection_map(run), deflection_chart(run)], (11.0, 4.4), 2)


PICTURES = {"deflection": _side_by_side}  # files
