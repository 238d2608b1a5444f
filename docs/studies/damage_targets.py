"""What the assessment is to reach, and what it reached.

Targets name a method by the beginning of its name; every judge that begins so has a line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from gossamer_models.assessment import AssessmentResults
from gossamer_models.assessment.figures import Figures

from .metrics import Metric

NETWORK, WIDE, TWIN = "posterior nominal", "posterior wide", "twin"
OFF_95 = "share of damaged zones in the stated 95 % interval, off 95 %"
RESISTANCE = "twin on resistance"


class Target(NamedTuple):
    """A figure of a method under a condition: its value in a unit, what to reach, and whether more is better."""

    method: str
    condition: str
    what: str
    unit: str
    value: Callable[[Figures], float]
    reach: float
    more: bool = False


def _errors(method: str, condition: str, all_zones: float, damaged: float) -> tuple[Target, Target]:
    unit = "% damage"
    return (
        Target(method, condition, "error, all zones", unit, lambda f: f.error_all, all_zones),
        Target(method, condition, "error, damaged zones", unit, lambda f: f.error_damaged, damaged),
    )


def _false_calls(f: Figures) -> float:
    return 100.0 * f.false_calls.value


def _admitted(f: Figures) -> float:
    return 100.0 * f.wrong_and_marked.value


TARGETS = (
    *_errors(NETWORK, "clean", 0.15, 0.9),
    *_errors(NETWORK, "noise", 0.3, 1.6),
    Target(NETWORK, "clean", OFF_95, "%", lambda f: abs(100.0 * f.damaged_within_95 - 95.0), 2.0),
    Target(NETWORK, "noise", OFF_95, "%", lambda f: abs(100.0 * f.damaged_within_95 - 95.0), 2.0),
    *_errors(WIDE, "everything varied", 1.2, 6.0),
    *_errors(TWIN, "everything varied", 0.3, 1.5),
    *_errors(TWIN, "noise", 0.15, 0.65),
    Target(TWIN, "noise", "z rms of damaged zones less 1", "1", lambda f: abs(f.damaged_z_rms - 1.0), 0.2),
    *_errors(RESISTANCE, "whole chain", 0.03, 0.1),
    *_errors(TWIN, "another mesh", 0.8, 2.0),
    Target(WIDE, "healthy, everything varied", "records with a call", "%", _false_calls, 1.0),
    Target(TWIN, "healthy, everything varied", "records with a call", "%", _false_calls, 1.0),
    *(
        Target(method, condition, "wrong by more than 10 % and marked so", "%", _admitted, 95.0, more=True)
        for method in (NETWORK, WIDE)
        for condition in ("noise", "everything varied", "dead sensor", "swapped sensors", "whole chain")
    ),
)
DETECTION = {"noise": 5.0, "whole chain": 1.5}  # largest a90/95 of any zone [% damage], by the beginning of the condition
Line = tuple[str, str, float, Metric | None]


def metrics(assessment: AssessmentResults) -> Iterator[Line]:
    """Yield what, unit, target and metric of everything that is to be reached; None for what was not assessed."""
    for target in TARGETS:
        exact = target.method in (TWIN, RESISTANCE)
        judges = [j for j in assessment.judges if (j == target.method if exact else j.startswith(target.method))]
        for judge in judges or [target.method]:
            row = assessment.row(judge, target.condition)
            value = math.nan if row is None else target.value(row.figures)
            yield _line(f"{judge}, {target.condition}: {target.what}", target.unit, value, target.reach, target.more)
    for judge in assessment.judges[1:]:
        for condition, reach in DETECTION.items():
            asked = [r for r in assessment.detections if r.judge == judge and r.condition.startswith(condition)]
            zones = [row for row in asked if row.zone]
            worst = max((100.0 * (row.a90_95 if row.a90_95 <= 1.0 else 1.0) for row in zones or asked), default=math.nan)
            of = "the worst zone" if zones else "all zones together"
            yield _line(f"{judge}, {condition}: a90/95 of {of} (100: none)", "% damage", worst, reach)


def _line(what: str, unit: str, value: float, reach: float, more: bool = False) -> Line:
    if not math.isfinite(value):
        return what, unit, reach, None
    return what, unit, reach, Metric(what=what, unit=unit, value=value, target=reach, more_is_better=more)
