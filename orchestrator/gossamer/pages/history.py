"""The page of a structure's inspections: damage, faults and sensors over time."""

from __future__ import annotations

from typing import Any

import numpy as np
from gossamer_files.charts import Chart, heat, points, section
from gossamer_files.tables import TableText
from gossamer_models.arrays import Matrix
from gossamer_models.membrane import Structure
from gossamer_models.twin import InspectionHistory
from gossamer_orchestrator.pages import Page, table
from gossamer_orchestrator.pages.page import Kind
from gossamer_orchestrator.results.dataset import zone_label
from gossamer_orchestrator.results.report.page import ASSETS
from gossamer_orchestrator.words import between, uncertain

from .space import in_space, space_chart

COLOURS = 6
LEAST = 0.5  # damage [%] of a zone that is outlined
MONTHS = "months since the first inspection"


def history_page(name: str, history: InspectionHistory, structure: Structure | None = None) -> Page:
    """Describe the inspections of a structure.

    Parameters
    ----------
    name : str
        Of the structure.
    history : InspectionHistory
        What they have found.
    structure : Structure or None
        To draw in space, with a slider over the dates.
    """
    said = [f"{text[0].upper()}{text[1:]}." for text in history.sentences()]
    damaged = bool(np.nansum(history.damage[-1]) > 0.0) or bool(said)
    kind: Kind = "invalid" if not history.valid[-1] else "damage" if damaged else "healthy"
    withheld = [str(day) for day, valid in zip(history.dates, history.valid, strict=True) if not valid]
    first = f"{len(history.dates)} inspections from {history.dates[0]} to {history.dates[-1]}."
    more = said or ["No zone grows."]
    if withheld:
        more.append(f"Withheld, since they are not valid: {', '.join(withheld)}; the table says why.")
    rows = [
        (str(day), "yes" if valid else "no", "; ".join(doubts))
        for day, valid, doubts in zip(history.dates, history.valid, history.doubts, strict=True)
    ]
    months = np.round(history.months, 2)
    labels = [zone_label(zone) for zone in history.zones]
    map_ = heat([str(day) for day in history.dates], labels, 100.0 * history.damage.T, "damage [%]", colorscale="@damage")
    category = {axis: {"type": "category"} for axis in ("xaxis", "yaxis")}
    charts = [damage_over_time(history), Chart("Damage by date", "date", "zone", [map_], layout=category)]
    beside = [
        _over_time(
            "Faults", "share [%]", months, {n: 100.0 * v for n, v in history.faults.items() if np.nanmax(v[:, 0]) > 0.0}
        ),
        _over_time("Sensors", "gain, or error [1]", months, dict(history.drift)),
    ]
    content = _in_space(structure, history) if structure is not None else {}
    if content:
        text = "The structure in three dimensions with the damage of its zones; the tables hold the numbers."
        charts.insert(0, space_chart("The structure", "The slider goes over the dates; what is withheld is grey.", text))
    return Page(
        title=f"Inspections of {name}",
        kind=kind,
        sentence=first,
        more=more,
        charts=[*section("Damage", charts), *section("Beside damage", [chart for chart in beside if chart.traces])],
        content=content,
        scripts=[ASSETS / "surface.js", ASSETS / "run.js"] if content else [],
        controls=(ASSETS / "player.html").read_text(encoding="utf-8") if content else "",
        facts=[history_table(history), table(("date", "valid", "what was said"), rows, "Inspections")],
        how="Bars are one standard deviation wide to each side. Growth is the slope of a line through all values of a zone; "
        "its bound holds in 95 of 100 cases.",
    )


def _in_space(structure: Structure, history: InspectionHistory) -> dict[str, Any]:
    """Return what the page needs to draw a structure in space, coloured by damage, at every date."""
    damage, months = 100.0 * np.nan_to_num(history.damage), history.months
    colour = {"name": "estimated damage", "of": "zone", "values": damage, "time": months, "valid": history.valid.tolist()}
    colour |= {"least": LEAST, "ends": [0.0, max(1.0, float(damage.max()))], "unit": "%", "scale": "@damage"}
    return {
        "start": 0.0,
        "end": float(months[-1]),
        "instants": [str(day) for day in history.dates],
        **in_space(structure, months, [colour], [zone_label(zone) for zone in history.zones]),
    }


def damage_over_time(history: InspectionHistory) -> Chart:
    """Draw the damage of each zone that has been damaged."""
    months = np.round(history.months, 2)
    there = np.flatnonzero(np.nan_to_num(history.damage).max(axis=0) > 0.0)
    pairs = {
        zone_label(history.zones[z]): 100.0 * np.stack([history.damage[:, z], history.deviation[:, z]], 1) for z in there
    }
    return _over_time("Damage", "damage [%]", months, pairs)


def _over_time(title: str, y: str, months: Matrix, pairs: dict[str, Matrix]) -> Chart:
    """Draw values with their deviations, shape (d, 2), over time."""
    traces = [
        points(name, months, each[:, 0], f"@{k % COLOURS}", each[:, 1]) for k, (name, each) in enumerate(pairs.items())
    ]
    return Chart(title, MONTHS, y, traces)


def history_table(history: InspectionHistory) -> TableText:
    """Return for each zone that has been damaged its first and last damage, and its growth with a bound."""
    rows = []
    for z, (rate, sigma) in enumerate(history.growth):
        if not np.nan_to_num(history.damage[:, z]).any():
            continue
        ends = [_value(history, k, z) for k in (0, -1)]
        bound = f"below {100.0 * (rate + 1.645 * sigma):.2g}" if np.isfinite(rate) else ""
        grows = uncertain(100.0 * float(rate), 100.0 * float(sigma)) if np.isfinite(rate) else ""
        rows.append((zone_label(history.zones[z]), *ends, grows, bound))
    head = ("zone", f"{history.dates[0]} [%]", f"{history.dates[-1]} [%]", "growth [points/month]", "95 % bound")
    return TableText(head, rows, "Damage and growth")


def _value(history: InspectionHistory, k: int, z: int) -> str:
    """Return the damage of a zone at a date [%]: a value, bounds, or that it was withheld."""
    if np.isfinite(history.damage[k, z]):
        return uncertain(100.0 * float(history.damage[k, z]), 100.0 * float(history.deviation[k, z]))
    if np.isfinite(history.low[k, z]):
        return between(100.0 * float(history.low[k, z]), 100.0 * float(history.high[k, z]))
    return "withheld"
