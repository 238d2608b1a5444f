"""Doubts about a fit of a fractional model: parameters that the data do not determine, and assumptions."""

from __future__ import annotations

from math import inf

import numpy as np
from gossamer_files.options import option

from ..fitting.records import Record, in_equal_steps
from ..fitting.uncertainty import alike, rest_doubt
from .fit import FractionalFit

RESTED = 0.01  # of the range of resistance that counts as another resistance at rest, which was fitted
AT_BOUND = 1e-6  # of the width of the box
UNEVEN = 0.01  # of the median step: larger differences of steps are reported


def doubts(fit: FractionalFit) -> tuple[str, ...]:
    """Return the assumptions and what the data do not determine, one sentence each."""
    sentences = [_uneven(record) for record in fit.records]
    if any(each.name == "R_0" for each in fit.parameters):
        advice = f"If the sensor was at rest, give the resistance at rest ({option('rest_resistance')})."
        rest, full_scale = fit.rest_resistance, fit.artifact.full_scale_strain
        sentences += [rest_doubt(record, rest, full_scale, RESTED, advice) for record in fit.records]
    loose = [each.name for each in fit.parameters if not each.determined]
    if loose:
        sentences.append(
            f"The data do not determine {', '.join(loose)}: standard errors exceed the values. "
            "The model's output is unaffected on records like these; take fewer terms if the numbers matter."
        )
    bounds = {"a": fit.settings.orders, "p": fit.settings.rates, "q": fit.settings.exponents}
    at_bound = [each.name for each in fit.parameters if _at_bound(each.value, *bounds.get(each.name[0], (-inf, inf)))]
    if at_bound:
        sentences.append(f"{', '.join(at_bound)} ended at a bound: the data suggest a value beyond it.")
    names = tuple(each.name for each in fit.parameters)
    sentences.append(alike(names, fit.covariance, "Take fewer terms if the numbers matter."))
    if not fit.artifact.can_step:
        sentences.append(
            f"The fractional {fit.settings.model} needs the whole record and works offline only: no FMU can be built from "
            "it. For an FMU, identify fractional-sub-model-1."
        )
    return tuple(filter(None, sentences))


def _at_bound(value: float, low: float, high: float) -> bool:
    return min(value - low, high - value) < AT_BOUND * (high - low) < inf


def _uneven(record: Record) -> str:
    """Return a sentence on the resampling in equal steps; empty if the record has equal steps."""
    steps = np.diff(record.time)
    if np.ptp(steps) <= UNEVEN * float(np.median(steps)):
        return ""
    even, _ = in_equal_steps(record, np.ones(record.time.size, dtype=bool))
    back = np.interp(record.time, even.time, even.strain)
    moved = 100.0 * float(np.abs(back - record.strain).max() / np.ptp(record.strain))
    return (
        f"{record.name}: samples {steps.min():.3g} to {steps.max():.3g} s apart were brought to steps of "
        f"{even.time[1] - even.time[0]:.3g} s, which moves the strain by up to {moved:.2g} % of its range."
    )
