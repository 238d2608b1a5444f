"""The page of an assessment of detectors: errors, calls, probability of detection, stated deviations, tables."""

from __future__ import annotations

import io
from dataclasses import fields
from typing import Any

import numpy as np
from gossamer_files.charts import Chart, section
from gossamer_files.tables import percent
from gossamer_models.assessment import AssessmentResults
from gossamer_models.assessment.plots import ZERO, assessment_charts
from gossamer_models.assessment.results import Row
from gossamer_models.assessment.tables import condition_table, detection_table, thesis_tables
from gossamer_models.membrane import Structure
from gossamer_models.membrane.shape import membrane_shape
from gossamer_orchestrator.fmi.shape import Surface
from gossamer_orchestrator.pages import Page, folded, on_page, table
from gossamer_orchestrator.results.dataset import zone_label
from gossamer_orchestrator.results.report.membrane import surface_content
from gossamer_orchestrator.results.report.page import ASSETS
from gossamer_orchestrator.results.shapes import ShapeHistory

MAIN = "noise"  # the condition of the verdict: the thesis' noise on strain, nothing else wrong
SURFACE = ASSETS / "surface.js"
MOST = 50.0  # [%] of the scale of colours
FEW = 30  # records below which a judge's figures are rough


def assessment_page(found: AssessmentResults, structure: Structure | None = None) -> Page:
    """Describe an assessment, with a picture in space of the membrane if that is given."""
    best, zero = _best(found), found.row(ZERO, MAIN)
    picture, content = ([], {}) if structure is None else _in_space(found, structure)
    if best is None:
        sentence = f"No detector was assessed, only the answer '{ZERO}'."
    elif zero is not None and zero.figures.error_damaged <= best.figures.error_damaged:
        sentence = f"No detector is nearer than the answer '{ZERO}' under the condition '{MAIN}'."
    else:
        base = "" if zero is None else f"; that of the answer '{ZERO}' is {zero.figures.error_damaged:.2f} %"
        error = f"{best.figures.error_damaged:.2f} % damage in the damaged zones of {best.figures.records} records"
        sentence = f"{best.judge} is the nearest under the condition '{MAIN}': its mean absolute error is {error}{base}."
    return Page(
        title="Assessment of detectors",
        sentence=sentence,
        more=[*_lines(found), *_lost(found), *_smallest(found), *_few(found)],
        charts=[*picture, *assessment_charts(found)],
        content=content,
        scripts=[SURFACE] if picture else [],
        facts=_facts(found),
        how="Bars of shares are two-sided 95 % intervals of Clopper and Pearson. Errors count invalid answers too.",
    )


def _in_space(found: AssessmentResults, structure: Structure) -> tuple[list[Chart], dict[str, Any]]:
    """Return the chart of the membrane in space, zones coloured by a90/95, and what its script needs; none without one."""
    zones, colours, lost = structure.n_zones, [], []
    for judge, condition in dict.fromkeys((row.judge, row.condition) for row in found.detections if row.judge != ZERO):
        rows = [row for row in found.detections if (row.judge, row.condition) == (judge, condition) and row.zone]
        size = {row.zone: 100.0 * row.a90_95 for row in rows if row.a90_95 <= 1.0}
        if not rows:
            continue
        values = np.array([[size.get(zone, MOST) for zone in range(1, zones + 1)]]).clip(max=MOST)
        name, unit = f"a90/95, {judge}, {condition}", f"% damage; {MOST:g}: more, or not shown"
        colours.append({"name": name, "of": "zone", "values": values, "ends": [0.0, MOST], "unit": unit})
        none = [structure.zone_names[zone - 1] for zone in range(1, zones + 1) if zone not in size]
        lost += [f"Not shown to be found by {judge}, {condition}: {', '.join(none)}."] if none else []
    if not colours:
        return [], {}
    with np.load(io.BytesIO(membrane_shape(structure, structure.table))) as arrays:
        parts = {each.name: arrays[each.name] for each in fields(Surface)}
    points = np.array([sensor.point for sensor in structure.setup.sensors])
    surface = Surface(**parts | {"nodes": structure.mesh.nodes, "sensor_points": points})
    still = ShapeHistory(surface, np.zeros(1), surface.nodes[None], np.zeros((1, len(structure.setup.regions), 3)))
    names = [zone_label(name) for name in structure.zone_names]
    shown = surface_content(still, np.zeros(1, dtype=np.int64))
    shown |= {"unit": "m", "marked": False, "colours": colours, "names": names}
    note = "Damage found in 90 % of cases with 95 % confidence (a90/95). Drag to turn; squares are zones, dots sensors."
    text = "The membrane in three dimensions, zones coloured by the size of damage found; the table holds the numbers."
    chart = Chart("Membrane", note=" ".join([note, *lost]), text=text, tall=True, broad=True, script="addSurface")
    return [*section("Where damage is found", [chart])], {"frames": np.zeros(1), "surface": shown}


def _best(found: AssessmentResults) -> Row | None:
    """Return the nearest detector under the main condition, of those with many records if there are any."""
    rows = [row for row in found.rows if row.condition == MAIN and row.judge != ZERO]
    return min(rows, key=lambda row: (row.figures.records < FEW, row.figures.error_damaged), default=None)


def _lines(found: AssessmentResults) -> list[str]:
    """Say how each detector does under the main condition."""
    sentences = []
    for row in (row for row in found.rows if row.condition == MAIN):
        f = row.figures
        sentences.append(
            f"{row.judge}: error {f.error_all:.2f} % over all zones, {f.error_damaged:.2f} % over damaged ones; "
            f"{f.valid.number} of {f.records} records valid; false calls in {f.false_calls.number} of {f.false_calls.total} "
            f"(95 %: below {100.0 * f.false_calls.high:.1f} %)."
        )
    return sentences


def _lost(found: AssessmentResults) -> list[str]:
    """Name the conditions with damage under which the answer 0 has the smaller error over all zones."""
    sentences = []
    for judge in (judge for judge in found.judges if judge != ZERO):
        pairs = [(row, found.row(ZERO, row.condition)) for row in found.rows if row.judge == judge]
        errors = {row.condition: (row.figures, zero.figures) for row, zero in pairs if zero is not None}
        lost = [name for name, (own, zero) in errors.items() if 0.0 < zero.error_all < own.error_all]
        if lost:
            sentences.append(
                f"The answer '{ZERO}' has a smaller error over all zones than {judge} under: {', '.join(lost)}."
            )
    return sentences


def _smallest(found: AssessmentResults) -> list[str]:
    """Name the sizes that are found for sure, of all zones together."""
    sentences = []
    for condition in dict.fromkeys(row.condition for row in found.detections):
        rows = [row for row in found.detections if row.condition == condition and not row.zone and row.judge != ZERO]
        parts = [f"{row.judge} {percent(row.a90_95)} %" for row in rows if row.a90_95 <= 1.0]
        none = [row.judge for row in rows if not row.a90_95 <= 1.0]
        parts += [f"not shown for {', '.join(none)}"] if none else []
        if parts:
            sentences.append(f"Found in 90 % of cases with 95 % confidence (a90/95), {condition}: {'; '.join(parts)}.")
    return sentences


def _few(found: AssessmentResults) -> list[str]:
    few = {row.judge: row.figures.records for row in found.rows if row.figures.records < FEW}
    parts = [f"{judge}, {number}" for judge, number in few.items()]
    return [f"Few records, so rough figures, and none for the verdict: {'; '.join(parts)}."] if parts else []


def _facts(found: AssessmentResults) -> str:
    parts = [
        folded("Errors and shares by condition", on_page(condition_table(found))),
        folded("Probability of detection by zone", on_page(detection_table(found))),
        *(folded(name, on_page(shown)) for name, shown in thesis_tables(found).items()),
        table((), found.provenance.items(), "The assessment"),
    ]
    return "\n".join(parts)
