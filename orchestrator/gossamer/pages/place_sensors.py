"""The page of a placement of sensors: the smallest damage that is found, by zone and on the membrane, and its check."""

from __future__ import annotations

from typing import Any

import numpy as np
from gossamer_models.placement import Placement, Placing
from gossamer_models.placement.check import MonteCarloCheck
from gossamer_models.placement.plots import faces_of, view_of
from gossamer_models.twin.least_squares import MOST_DAMAGE
from gossamer_orchestrator.pages import SCRIPT, Chart, Page, bars, drawn, points, table
from gossamer_orchestrator.words import counted
from numpy.typing import NDArray

from ..results import TableText, on_page

NAMED = 40  # zones with a label: more would cover the picture
LENGTH = 0.05  # of the line of a sensor, shares of the membrane's size
VIRIDIS = ((68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37))

Array = NDArray[np.float64]


def placement_page(found: Placing, samples: int) -> Page:
    """Describe a placement; ``samples`` are those of a record of each sensor."""
    shown = _shown(found)
    own, chosen = found.own, found.chosen
    worst = f"With {len(chosen.sensors)} chosen sensors the worst zone has a90 = {_percent(chosen.a90.max())} damage"
    if own is not None:
        worst += f"; with the membrane's own {len(own.sensors)} it has {_percent(own.a90.max())}"
    if own is not None and chosen.a90.max() >= own.a90.max():
        many = counted(len(chosen.sensors), "sensor")
        worst = f"No placement of {many} was found that is better than the membrane's own. {worst}"
    disagree = [name for name, p in shown if p.check is not None and not p.check.agrees]
    lost = {name: [z + 1 for z in np.flatnonzero(p.a90 >= MOST_DAMAGE)] for name, p in shown}
    more = ["a90 is the damage that is detected in 90 % of cases at 5 % false alarms."]
    more += [f"The {name} sensors do not find zones {', '.join(map(str, z))}." for name, z in lost.items() if z]
    more += [check_sentence(name, p.check) for name, p in shown if p.check is not None]
    more.append("The model is taken to be exact, so real sensors find less.")
    return Page(
        title="Placement of sensors",
        kind="invalid" if disagree else "none",
        sentence=f"{worst}.",
        more=more,
        content=drawn([*_maps(found), *_zone_charts(found), *_check_charts(found)]),
        scripts=[SCRIPT],
        facts="\n".join((on_page(zone_table(found)), _sensors(found), _about(found, samples))),
        how="All zones, the load's amplitude, the damping and an offset of each sensor are unknown together.",
    )


def zone_table(found: Placing) -> TableText:
    """Return the smallest damage that is found, a row for each zone, and the worst."""
    shown = _shown(found)
    checked = [(name, p.check) for name, p in shown if p.check is not None]
    head = [f"a90 [%], {len(p.sensors)} {name} sensors" for name, p in shown]
    head += [f"{name}: deviation, predicted and of {c.records} fits [%]" for name, c in checked]
    rows = [
        (
            str(k + 1),
            zone.group,
            *(f"{100.0 * p.a90[k]:.2f}" for _, p in shown),
            *(f"{100.0 * c.predicted[k]:.2f}, {100.0 * c.observed[k]:.2f}" for _, c in checked),
        )
        for k, zone in enumerate(found.structure.setup.zones)
    ]
    rows.append(("worst", "", *(f"{100.0 * p.a90.max():.2f}" for _, p in shown), *("" for _ in checked)))
    caption = "Smallest damage that is found" + (", and deviation at 30 % damage" if checked else "")
    return TableText(("zone", "group", *head), rows, caption)


def _shown(found: Placing) -> list[tuple[str, Placement]]:
    return [(name, p) for name, p in (("own", found.own), ("chosen", found.chosen)) if p is not None]


def check_sentence(name: str, check: MonteCarloCheck) -> str:
    """Say whether fits to simulated records err as predicted."""
    verdict = "agrees with" if check.agrees else "does NOT agree with"
    return (
        f"{check.records} fits with the {name} sensors: their mean square error over the predicted variance, "
        f"{check.spread:.3f}, {verdict} 1 ± {check.spread_error:.3f}; {100.0 * check.false_alarms:.1f} % false alarms (5), "
        f"a90 found in {100.0 * check.found:.1f} % (90)."
    )


def _zone_charts(found: Placing) -> list[Chart]:
    zones = np.arange(1, len(found.structure.setup.zones) + 1)
    traces = [
        bars(f"{len(p.sensors)} {name} sensors", zones, 100.0 * p.a90, color)
        for color, (name, p) in zip(("@grey", "@0"), _shown(found)[-2:], strict=False)
    ]
    layout = {"barmode": "group", "xaxis": {"dtick": 1} if len(zones) <= NAMED else {}}
    title = "Smallest damage found in 90 % of cases"
    return [Chart(section="Zones", title=title, x="zone", y="a90 [% damage]", traces=traces, layout=layout, broad=True)]


def _check_charts(found: Placing) -> list[Chart]:
    traces = []
    for color, (name, p) in zip(("@1", "@0"), _shown(found), strict=False):
        if p.check is not None:
            zones = np.arange(1, len(p.check.predicted) + 1)
            traces.append(
                points(f"{name}, predicted", zones, 100.0 * p.check.predicted, color, symbol="line-ew-open", size=14)
            )
            traces.append(points(f"{name}, of fits", zones, 100.0 * p.check.observed, color))
    if not traces:
        return []
    title = "Deviation of the damage at 30 % damage"
    return [Chart(section="Check", title=title, x="zone", y="deviation [% damage]", traces=traces, broad=True)]


def _maps(found: Placing) -> list[Chart]:
    """Draw the membrane along its normal, zones coloured by a90 on a logarithmic scale, with the sensors."""
    values = np.concatenate([p.a90 for _, p in _shown(found)])
    limits = np.log10([values.min(), max(values.max(), 1.01 * values.min())])
    mesh = found.structure.mesh
    view = view_of(mesh.nodes)
    faces, zone = faces_of(found.structure)
    flat = [mesh.nodes[nodes] @ view for nodes in faces]
    charts = []
    for name, p in _shown(found):
        shade = (np.log10(p.a90) - limits[0]) / (limits[1] - limits[0])
        traces: list[dict[str, Any]] = []
        places = []
        for k in range(-1, len(p.a90)):
            own = [polygon for polygon, z in zip(flat, zone, strict=True) if z == k]
            if own:
                label = f"zone {k + 1}: a90 {_percent(p.a90[k])}" if k >= 0 else "no zone"
                traces.append(_area(label, own, _color(shade[k]) if k >= 0 else "@grey"))
                places += [(k, *np.mean([polygon.mean(axis=0) for polygon in own], axis=0))] if k >= 0 else []
        if len(places) <= NAMED:
            traces.append(_labels(places, p.a90, shade))
        traces += [_sensor(k, s, view, mesh.size) for k, s in enumerate(p.sensors)]
        traces.append(_scale(limits))
        layout = {
            "xaxis": {"constrain": "domain"},
            "yaxis": {"scaleanchor": "x", "constrain": "domain"},
            "showlegend": False,
        }
        title = f"{len(p.sensors)} {name} sensors, worst zone a90 = {_percent(p.a90.max())}"
        charts.append(Chart(section="Membrane", title=title, x="[m]", y="[m]", traces=traces, layout=layout, tall=True))
    return charts


def _area(name: str, polygons: list[Array], color: str) -> dict[str, Any]:
    """Return faces of one colour."""
    gap = np.full((1, 2), np.nan)
    x, y = np.concatenate([part for polygon in polygons for part in (polygon, polygon[:1], gap)]).T
    look = {"mode": "lines", "line": {"width": 0.4, "color": color}, "fillcolor": color}
    return {
        "type": "scatter",
        "name": name,
        "x": x,
        "y": y,
        "fill": "toself",
        "hoveron": "fills",
        "hoverinfo": "name",
    } | look


def _labels(places: list[tuple[int, float, float]], a90: Array, shade: Array) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "text",
        "x": [x for _, x, _ in places],
        "y": [y for _, _, y in places],
        "text": [f"{k + 1}<br>{_percent(a90[k])}" for k, _, _ in places],
        "textfont": {"size": 10, "color": ["#ffffff" if shade[k] > 0.55 else "#000000" for k, _, _ in places]},
        "hoverinfo": "skip",
    }


def _sensor(number: int, sensor: Any, view: Array, size: float) -> dict[str, Any]:  # noqa: ANN401
    """Return a sensor as a line along its direction, at least so long that it is seen."""
    point, along = np.array(sensor.point) @ view, np.array(sensor.direction) @ view
    half = 0.5 * max(LENGTH * size, sensor.gauge_length) * along / np.linalg.norm(sensor.direction)
    x, y = np.array([point - half, point, point + half]).T
    look = {"mode": "lines+markers", "line": {"color": "#D55E00", "width": 4}}
    marker = {"color": "#D55E00", "size": [1, 9, 1], "line": {"color": "#ffffff", "width": 1}}
    return {
        "type": "scatter",
        "name": f"sensor {number + 1}",
        "x": x,
        "y": y,
        "marker": marker,
        "hoverinfo": "name",
    } | look


def _scale(limits: Array) -> dict[str, Any]:
    """Return a scale of the colours beside the picture."""
    ticks = np.linspace(limits[0], limits[1], 4)
    bar = {
        "title": {"text": "a90 [%]"},
        "tickvals": ticks.tolist(),
        "ticktext": [f"{100.0 * 10.0**tick:.2g}" for tick in ticks],
        "thickness": 12,
    }
    marker = {
        "color": limits.tolist(),
        "colorscale": "Viridis",
        "reversescale": True,
        "showscale": True,
        "colorbar": bar,
    }
    return {"type": "scatter", "mode": "markers", "x": [None, None], "y": [None, None], "marker": marker}


def _color(shade: float) -> str:
    """Return a colour of Viridis, 0 the lightest and 1 the darkest."""
    place = (1.0 - min(max(shade, 0.0), 1.0)) * (len(VIRIDIS) - 1)
    low = min(int(place), len(VIRIDIS) - 2)
    parts = np.array(VIRIDIS[low]) + (place - low) * (np.array(VIRIDIS[low + 1]) - np.array(VIRIDIS[low]))
    return "#" + "".join(f"{round(float(part)):02x}" for part in parts)


def _sensors(found: Placing) -> str:
    rows = [
        (f"{name} {k + 1}", *(", ".join(f"{x:.4g}" for x in v) for v in (s.point, s.direction)), f"{s.gauge_length:g}")
        for name, p in _shown(found)
        for k, s in enumerate(p.sensors)
    ]
    return table(("sensor", "point [m]", "direction", "length [m]"), rows, "Sensors")


def _about(found: Placing, samples: int) -> str:
    rows = [
        ("Candidates", found.candidates),
        ("Samples of a record", samples),
        ("Deviation of the noise of a sample [1]", f"{found.noise:.4g}"),
        ("Simulated cases", found.simulations),
    ]
    return table((), rows, "The choice")


def _percent(value: float) -> str:
    return f"{100.0 * MOST_DAMAGE:g} % or more" if value >= MOST_DAMAGE else f"{100.0 * value:.3g} %"
