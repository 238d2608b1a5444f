"""The page of damage detection, from an assessment."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from gossamer_models.assessment import AssessmentResults
from gossamer_models.assessment.figures import thesis_errors
from gossamer_models.assessment.plots import save_pictures
from gossamer_models.assessment.results import DetectionRow
from gossamer_models.detector.thesis_tables import GROUPS, MULTIPLE_TRAINING, SINGLE_TRAINING, TABLES, ThesisTables
from gossamer_models.detector.thesis_training import TRAININGS, train_detector
from numpy.typing import NDArray

from .damage_targets import metrics
from .metrics import beside_target, number, table, verdict

Cell = Callable[[AssessmentResults, str, str], str]  # of a judge under a condition
Trainings = dict[str, dict[str, tuple[dict[str, float], dict[str, float]]]]  # errors by training and cases

FOLDER = "damage"
CONDITIONS = ("clean", "noise", "whole chain")
SHOWN = 1.0  # [%] estimates below are left out of the tables of cases
HEAD = """# Results of damage detection

Three ways lead from a record to damage. `gossamer twin` fits a simulation to the first 0.3 s of a record, with damage that
is there from its beginning: it is the most accurate, and takes seconds. `gossamer watch`, or `gossamer run --watch`, is
the twin beside a running structure, window by window: alarm, onset, then damages. The detector FMU is a trained network
that runs inside any host; `gossamer campaign` simulates what it learns from, `gossamer train` trains it, and `gossamer
assess-detector` made the figures below, also where its training does not hold: noise, another load, dead or swapped
sensors, a finer mesh. All state a standard deviation per zone and say when their answer is not valid. Their pages,
`report.html`, show what was drawn and simulated, errors beside those of the answer "always 0", and what is found under
which condition, how surely.

Read this page beside Chapter 7 of the thesis: M. R. Sunny, "Towards Structural Health Monitoring of Gossamer
Structures Using Conductive Polymer Nanocomposite Sensors", dissertation, Virginia Tech, 2010. `make figures` writes
it from what `gossamer assess-detector --twin --cases 200` found; do not edit it. The twins take seconds for a record:
they judged the first six records of the conditions that matter most, and three sizes in each zone; twin.md has more.

**Errors** are mean absolute errors in % damage, over all zones / over the damaged zones. Answers that the detector
marks as not valid are included; a **call** is a valid estimate above 5 %. **Random cases** have 1 to 4 damaged zones
of 5 to 50 %; *always 0* is the judge that never finds damage. **Noise** is the thesis' U(0, 0.02) on every sample of
strain. **Whole chain** is strain through the sensor, 0.1 % noise on resistance, and the estimator. A dash stands for
what a method does not state, or for one that was not assessed. The slips of the printed tables are read as
`detector/thesis_tables.py` says."""


def write(assessment: AssessmentResults, trainings: Trainings, docs: Path) -> None:
    """Write the page and its pictures into a folder, from an assessment and what ``thesis_trainings`` gave."""
    pictures = docs / FOLDER
    for old in pictures.glob("*.png"):
        old.unlink()
    paths = save_pictures(assessment, pictures)
    lines = [
        HEAD,
        "",
        f"Membrane: {assessment.provenance.get('mesh', '-')}; {assessment.provenance.get('cases', '-')} records",
    ]
    lines[-1] += " of each condition."
    lines += [*_targets(assessment), *_thesis(assessment), *_trainings(trainings)]
    lines += [*_conditions(assessment), *_detection(assessment)]
    lines += ["", "## Pictures", ""]
    lines += [f"![{path.stem.replace('_', ' ')}]({FOLDER}/{path.name})\n" for path in paths]
    lines += ["## Tables 7.1 to 7.5, case by case", "", *_cases(assessment)]
    text = "\n".join(lines).rstrip() + "\n"
    (docs / "damage.md").write_text(text, encoding="utf-8")


def _targets(assessment: AssessmentResults) -> list[str]:
    """Return the figures that were asked for beside those reached."""
    head = ("what", "unit", "reached", "met")
    body = []
    for what, unit, target, metric in metrics(assessment):
        if metric is None:
            body.append((what, unit, f"- (target {target:g})", "-"))
        else:
            body.append((what, unit, beside_target(metric), verdict(metric.met)))
    return ["", "## Asked and reached", "", *table(head, body)]


def _thesis(assessment: AssessmentResults) -> list[str]:
    head = ("cases", "condition", "thesis", *assessment.judges)
    body = []
    for what, tables, rows in GROUPS:
        for condition in CONDITIONS:
            said = {"clean": tables.clean, "noise": tables.noisy}.get(condition)
            cells = [_pair(100.0 * tables.damage[rows], None if said is None else said[rows])]
            for judge in assessment.judges:
                ours = estimates(assessment, tables, judge, condition)
                cells.append(_pair(100.0 * tables.damage[rows], None if ours is None else ours[rows]))
            body.append((what, condition, *cells))
    return ["", "## The test cases of the thesis", "", *table(head, body)]


def thesis_trainings() -> Trainings:
    """Train as the thesis did, four times, and return the errors on its test cases by training and cases."""
    return {name: thesis_errors(train_detector(training), noisy=training.noisy) for name, training in TRAININGS.items()}


def _trainings(trainings: Trainings) -> list[str]:
    body = []
    for name, found in trainings.items():
        for what, tables, _ in GROUPS:
            if tables is (MULTIPLE_TRAINING if TRAININGS[name].multiple else SINGLE_TRAINING):
                ours, printed = found[what]
                pairs = [f"{row['all zones']:.2f} / {row['damaged zones']:.2f}" for row in (printed, ours)]
                body.append((name.replace("_", ", "), what, *pairs))
    text = (
        "Sixteen packet energies and neuro-fuzzy networks of similarities, trained on single or multiple damage, without "
        "the noise or with it (`gossamer train --kind thesis`). Energies have no sign and no phase: what several damages do "
        "to them, and what noise leaves of them, does not determine the damages."
    )
    return ["", "## Trained as the thesis did", "", text, "", *table(("training", "cases", "thesis", "ours"), body)]


def estimates(assessment: AssessmentResults, tables: ThesisTables, judge: str, condition: str) -> NDArray[np.float64] | None:
    """Return what a judge says of all cases of two tables, shape (n, 16) [%]; None if it was not asked."""
    wanted = (tables.name, judge, condition)
    found = {row.case: row.damage for row in assessment.tables if (row.table, row.judge, row.condition) == wanted}
    return np.array([found[case] for case in tables.cases]) if len(found) == len(tables.cases) else None


def _pair(truth: NDArray[np.float64], said: NDArray[np.float64] | None) -> str:
    """Return mean absolute errors over all and damaged zones [% damage]."""
    if said is None:
        return "-"
    error = np.abs(said - truth)
    return f"{error.mean():.2f} / {error[truth > 0.0].mean():.2f}"


def _conditions(assessment: AssessmentResults) -> list[str]:
    lines = ["", "## Random cases under other conditions", "", "Errors, and in brackets the share of valid records [%].", ""]
    named = list(dict.fromkeys(row.condition for row in assessment.rows))
    damaged, healthy = ([name for name in named if name.startswith("healthy") == which] for which in (False, True))
    lines += table(("condition", *assessment.judges), _rows(assessment, damaged, _errors))
    lines += ["", "Healthy records with a call [% of records], and its upper 95 % bound:", ""]
    lines += table(("condition", *assessment.judges), _rows(assessment, healthy, _false_calls))
    mesh = assessment.provenance.get("another mesh", "-")
    return [*lines, "", f"*Another mesh*: truth from {mesh}. The other conditions are those of this program's own world."]


def _rows(assessment: AssessmentResults, conditions: Sequence[str], cell: Cell) -> Iterator[Sequence[str]]:
    for condition in conditions:
        yield condition, *(cell(assessment, judge, condition) for judge in assessment.judges)


def _errors(assessment: AssessmentResults, judge: str, condition: str) -> str:
    row = assessment.row(judge, condition)
    if row is None:
        return "-"
    f = row.figures
    return f"{f.error_all:.2f} / {f.error_damaged:.2f} ({100.0 * f.valid.value:.0f})"


def _false_calls(assessment: AssessmentResults, judge: str, condition: str) -> str:
    row = assessment.row(judge, condition)
    if row is None:
        return "-"
    calls = row.figures.false_calls
    return f"{100.0 * calls.value:.1f} (< {100.0 * calls.high:.1f})"


def _detection(assessment: AssessmentResults) -> list[str]:
    lines = ["", "## Probability of detection", ""]
    lines.append(
        "One damaged zone. A call is a valid answer whose P(damaged), or else its estimate, is above a threshold, which is "
        "chosen so that 1 % of one half of the healthy records are called; "
        "false calls are counted in the other half. a90/95 as in MIL-HDBK-1823A; sizes in % damage; none: above 100 %."
    )
    head = ("method", "condition", "call", "false calls [%]", "a90/95, all zones together", "best zone", "worst zone")
    body = []
    for judge in assessment.judges:
        for condition in dict.fromkeys(row.condition for row in assessment.detections):
            found = [row for row in assessment.detections if (row.judge, row.condition) == (judge, condition)]
            if found:
                body.append((judge, condition, *_bounds(found)))
    return [*lines, "", *table(head, body)]


def _bounds(rows: Sequence[DetectionRow]) -> tuple[str, ...]:
    whole, zones = next(row for row in rows if row.zone == 0), [row for row in rows if row.zone]
    bounds = sorted((100.0 * row.a90_95 if row.a90_95 <= 1.0 else math.inf, row.zone) for row in zones)
    ends = [f"{number(a)} (zone {zone})" if math.isfinite(a) else "none" for a, zone in (bounds[:1] + bounds[-1:])]
    together = number(100.0 * whole.a90_95) if whole.a90_95 <= 1.0 else f"none{': ' * bool(whole.remark)}{whole.remark}"
    false = f"{100.0 * whole.false_calls.value:.1f} (< {100.0 * whole.false_calls.high:.1f})"
    return f"{whole.score} > {100.0 * whole.threshold:.2g} %", false, together, *(ends or ("-", "-"))


def _cases(assessment: AssessmentResults) -> Iterator[str]:
    yield f"Zone: damage [%]; estimates below {SHOWN:g} % are left out, and a star marks an answer that is not valid."
    head = ("case", "actual", "thesis", *assessment.judges)
    for tables in TABLES:
        for condition in CONDITIONS:
            said = {"clean": tables.clean, "noise": tables.noisy}.get(condition)
            yield f"\n### {tables.name}: {condition}\n"
            body = []
            for k, case in enumerate(tables.cases):
                thesis = "-" if said is None or np.isnan(said[k]).any() else _zones(said[k])
                cells = [_case(assessment, tables.name, case, judge, condition) for judge in assessment.judges]
                body.append((str(case), _zones(100.0 * tables.damage[k]), thesis, *cells))
            yield "\n".join(table(head, body))


def _case(assessment: AssessmentResults, name: str, case: int, judge: str, condition: str) -> str:
    wanted = (name, case, judge, condition)
    for row in assessment.tables:
        if (row.table, row.case, row.judge, row.condition) == wanted:
            return _zones(np.array(row.damage)) + ("" if row.valid else " *")
    return "-"


def _zones(percent: NDArray[np.float64]) -> str:
    return ", ".join(f"{zone}: {value:.3g}" for zone, value in enumerate(percent, start=1) if value >= SHOWN) or "none"
