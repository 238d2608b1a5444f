"""The pages of detectors: of a training, of one of the thesis, and of an assessment of several under many conditions."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from gossamer_files.charts import Chart, bars, curve, names_from_top, points, section, with_interval
from gossamer_files.tables import percent
from gossamer_models.arrays import Matrix
from gossamer_models.assessment import AssessmentResults, Verdicts, reliability, share, tables
from gossamer_models.assessment.figures import CALL, NOMINAL
from gossamer_models.assessment.plots import COLORS, ZERO, assessment_charts, reliability_charts
from gossamer_models.assessment.results import Row
from gossamer_models.detector import DetectorArtifact, PosteriorArtifact
from gossamer_models.membrane import Structure
from gossamer_models.membrane.shape import membrane_shape
from gossamer_orchestrator.fmi.shape import Surface
from gossamer_orchestrator.pages import Page, folded, on_page, table
from gossamer_orchestrator.results.dataset import zone_label
from gossamer_orchestrator.results.report.membrane import surface_content
from gossamer_orchestrator.results.report.page import ASSETS
from gossamer_orchestrator.results.shapes import ShapeHistory

FIRST = "window 1, damaged, "  # records that are drawn case by case
FEW_CASES, FEW = 100, 30  # held-out records of a training, and records of a judge, below which figures are rough
DRAWN = 1500  # damaged zones as points
SIZES = 9  # ranges of size that calls are counted in
MAIN = "noise"  # the condition of the verdict: the thesis' noise on strain, nothing else wrong
MADE = "How the detector was made"
SURFACE = ASSETS / "surface.js"
MOST = 50.0  # [%] of the scale of colours
Errors = Mapping[str, Mapping[str, float]]
Judged = Mapping[str, tuple[Matrix, Verdicts]]


def training_page(name: str, artifact: PosteriorArtifact, judged: Judged) -> Page:
    """Describe a training of a posterior network.

    Parameters
    ----------
    name : str
        What it was trained on.
    artifact : PosteriorArtifact
        What came of it.
    judged : mapping
        True damage and verdicts by kind of record, see ``held_out_verdicts``.
    """
    kinds = [kind for kind in artifact.held_out if ", damaged, " in kind]
    zero, main = artifact.held_out[ZERO], artifact.held_out[kinds[0]]
    lost = [kind for kind in kinds if artifact.held_out[kind]["all zones"] >= zero["all zones"]]
    beside = f"the answer '{ZERO}' is off by {zero['all zones']:.2f} % and {zero['damaged zones']:.2f} %"
    off = f"{main['all zones']:.2f} % damage over all zones and {main['damaged zones']:.2f} % over damaged ones"
    sentence = f"On held-out cases ({kinds[0]}) it is off by {off}; {beside}."
    if len(lost) == len(kinds):
        sentence = f"This detector tells nothing: the answer '{ZERO}' is as good. {sentence}"
    unsure = [kind for kind in kinds if artifact.held_out[kind]["valid"] == 0.0]
    if len(unsure) == len(kinds):
        sentence = f"Not a single record is valid, so no estimate is to be used. {sentence}"
    fewest = min(len(judged[kind][0]) for kind in kinds)
    more = [_line(kind, artifact.held_out[kind]) for kind in kinds]
    if lost:
        more.append(f"The answer '{ZERO}' is as good or better over all zones: {'; '.join(lost)}.")
    if 0 < len(unsure) < len(kinds):
        more.append(f"Not a single record is valid, so no estimate is to be used: {'; '.join(unsure)}.")
    if fewest < FEW_CASES:
        more.append(f"Of some kinds only {fewest} records were held out: rough figures.")
    over = [(quantity, f"{low:g} to {high:g}") for quantity, (low, high) in artifact.trained_over.items()]
    return Page(
        title=f"Training of a detector on {name}",
        kind="invalid" if lost or unsure else "none",
        sentence=sentence,
        more=more,
        charts=[
            *section("Errors", [_errors(artifact.held_out)]),
            *section("Held-out cases", [*_cases(judged), _by_zone(judged), *_called(judged)]),
            *section("Stated deviations", _stated(judged)),
            *section("Training", _losses(artifact)),
        ],
        facts=[
            tables.error_table(artifact.held_out),
            table(("quantity", "range"), over, "What the detector is trained over"),
            table((), artifact.provenance.items(), MADE),
        ],
        how="Everything is of cases that were neither trained nor calibrated on, but for the loss.",
    )


def thesis_page(name: str, artifact: DetectorArtifact, found: Errors) -> Page:
    """Describe one of the thesis' trainings; ``found`` has the errors of the detector, and those that the thesis prints."""
    own = {kind: row for kind, row in found.items() if not kind.endswith(": the thesis")}
    lines = [
        f"{kind}: off by {row['damaged zones']:.2f} % damage over damaged zones; the thesis prints "
        f"{found[f'{kind}: the thesis']['damaged zones']:.2f} %."
        for kind, row in own.items()
    ]
    return Page(
        title=f"Training of the thesis' detector, {name}",
        sentence=lines[0],
        more=lines[1:],
        charts=[_errors(found)],
        facts=[tables.error_table(found), table((), artifact.provenance.items(), MADE)],
        how="The test cases are those of the thesis, in their first window.",
    )


def _line(kind: str, row: Mapping[str, float]) -> str:
    band = f"; {100.0 * row['in 95 % band']:.1f} % of damages within the stated 95 % band" if "in 95 % band" in row else ""
    return (
        f"{kind}: off by {row['all zones']:.2f} % over all zones, {row['damaged zones']:.2f} % over damaged ones{band}; "
        f"{100.0 * row['valid']:.1f} % of records valid, {100.0 * row['false calls']:.1f} % with a false call."
    )


def _errors(found: Errors) -> Chart:
    kinds = [kind for kind, row in found.items() if "damaged zones" in row]
    names = [kind.replace(", damaged", "") for kind in kinds]
    traces = [
        bars(zones, [found[kind][zones] for kind in kinds], names, color) | {"orientation": "h"}
        for zones, color in (("all zones", "@0"), ("damaged zones", "@1"))
    ]
    layout = {"barmode": "group", "yaxis": names_from_top(names)}
    return Chart("Mean absolute error", "error [% damage]", "damaged cases", traces, layout=layout, broad=True)


def _first(judged: Judged) -> dict[str, tuple[Matrix, Verdicts]]:
    """Return what was said of damaged records in the first window, by their noise."""
    return {kind.removeprefix(FIRST): pair for kind, pair in judged.items() if kind.startswith(FIRST)}


def _cases(judged: Judged) -> list[Chart]:
    """Draw the estimates of damaged zones over the truth."""
    charts = []
    for noise, (damage, verdicts) in _first(judged).items():
        records, zones = np.nonzero(damage > 0.0)
        some = np.unique(np.linspace(0, len(records) - 1, min(len(records), DRAWN)).round().astype(int))
        records, zones = records[some], zones[some]
        true, estimated = 100.0 * damage[records, zones], 100.0 * verdicts.damage[records, zones]
        valid, ends = verdicts.valid[records], [0.0, float(true.max())]
        traces = [
            points("not valid", true[~valid], estimated[~valid], "@grey", size=4),
            points("valid", true[valid], estimated[valid], "@0", size=4),
            curve("right", ends, ends, "@ink", dash="dash"),
        ]
        note = f"Damaged zones of the first window; {len(some)} of {int((damage > 0.0).sum())}, evenly chosen."
        title = f"Estimated over true damage, {noise}"
        charts.append(Chart(title, "true damage [%]", "estimated damage [%]", traces, note=note))
    return charts


def _by_zone(judged: Judged) -> Chart:
    """Draw the mean absolute error of each zone where it is damaged."""
    traces = []
    for color, (noise, (damage, verdicts)) in zip(COLORS, _first(judged).items(), strict=False):
        there = damage > 0.0
        error = np.where(there, np.abs(verdicts.damage - damage), 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
        traces.append(
            bars(noise, np.arange(1, damage.shape[1] + 1), np.where(there.any(axis=0), 100.0 * error, np.nan), color)
        )
    layout = {"barmode": "group", "xaxis": {"dtick": 1}}
    title = "Mean absolute error of a zone where it is damaged"
    return Chart(title, "zone", "error [% damage]", traces, layout=layout, broad=True)


def _stated(judged: Judged) -> list[Chart]:
    traces = []
    for kind, (damage, verdicts) in judged.items():
        observed = reliability(damage, verdicts) if ", damaged, " in kind else np.full(1, np.nan)
        if np.isfinite(observed).all():
            window = int(kind.split()[1].strip(",")) - 1
            dash = "dash" if "no noise" in kind else "solid"
            traces.append(curve(kind.replace(", damaged", ""), NOMINAL, observed, COLORS[window % len(COLORS)], dash=dash))
    return reliability_charts(traces)


def _called(judged: Judged) -> list[Chart]:
    """Draw the share of damaged zones that are called, by size."""
    traces = []
    for color, (noise, (damage, verdicts)) in zip(COLORS, _first(judged).items(), strict=False):
        records, zones = np.nonzero(damage > 0.0)
        size, called = damage[records, zones], verdicts.valid[records] & (verdicts.damage[records, zones] > CALL)
        edges = np.linspace(size.min(), size.max(), SIZES + 1)
        place = np.clip(np.searchsorted(edges, size, side="right") - 1, 0, SIZES - 1)
        shares = [share(called[place == k]) for k in range(SIZES)]
        middle = 50.0 * (edges[1:] + edges[:-1])
        trace = points(noise, middle, [100.0 * each.value for each in shares], color)
        traces.append(with_interval(trace, [100.0 * each.low for each in shares], [100.0 * each.high for each in shares]))
    note = (
        f"A call is a valid estimate above {100.0 * CALL:g} %; bars are 95 % intervals. First window, most with other "
        "damaged zones; 'gossamer assess-detector' finds a90/95 from single damages."
    )
    title, layout = "Damaged zones that are called", {"yaxis": {"range": [0, 102]}}
    chart = Chart(title, "damage of the zone [%]", "share [%]", traces, note=note, layout=layout, broad=True)
    return [chart] if traces else []


def _losses(artifact: PosteriorArtifact) -> list[Chart]:
    traces = [
        curve(f"window {k + 1}", np.arange(1, len(loss) + 1), loss, COLORS[k % len(COLORS)])
        for k, loss in enumerate(artifact.losses)
    ]
    note = "Of training cases, first on the coarser mesh if there is one, with fresh gain and noise in every step."
    chart = Chart("Mean negative log likelihood of a case", "part of the steps", "loss [1]", traces, note=note, broad=True)
    return [chart] if traces else []


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
        facts=[
            folded("Errors and shares by condition", on_page(tables.condition_table(found))),
            folded("Probability of detection by zone", on_page(tables.detection_table(found))),
            *(folded(name, on_page(shown)) for name, shown in tables.thesis_tables(found).items()),
            table((), found.provenance.items(), "The assessment"),
        ],
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
        stored = Surface.stored(arrays)
    points = np.array([sensor.point for sensor in structure.setup.sensors])
    surface = replace(stored, nodes=structure.mesh.nodes, sensor_points=points)
    still = ShapeHistory(surface, np.zeros(1), surface.nodes[None], np.zeros((1, len(surface.poisson_ratio), 3)))
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
