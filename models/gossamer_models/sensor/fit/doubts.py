"""Doubts about a fit of the modified Preisach model: parameters that the data do not determine, and assumptions."""

from __future__ import annotations

from collections import Counter

import numpy as np

from ...arrays import Matrix, Rows
from ...fitting.records import Record
from ...fitting.uncertainty import Parameter, alike, covariance, rest_doubt
from .preisach import PreisachFit

DETERMINED = 0.5  # share of a parameter's information that must come from the data
HOLD_RATE = 0.02  # of the fastest strain rate: slower is a hold
LEAST_HOLD = 0.05  # of the training stretch
RESTED = 0.1  # of the range of resistance that counts as another resistance at rest
REST_ADVICE = "Check it and its unit, or fit the earlier relaxation too (--earlier)."


def determination(fit: PreisachFit) -> tuple[Matrix, Matrix]:
    """Return covariance and resolution of the parameters, shape (n, n), zero for those at a bound; see ``covariance``."""
    n = fit.x.size
    lower, upper = fit.solver.problem.lower, fit.solver.problem.upper
    slack = 1e-7 * np.maximum(1.0, np.abs(fit.x))
    free = (fit.x > lower + slack) & (fit.x < upper - slack)
    data, preferred = (part[:, free] for part in fit.solver.slopes(fit.x))
    count = sum(int(rows.sum()) for rows in fit.train)
    variance = 2.0 * fit.solutions[0].cost / max(count - int(free.sum()), 1)
    C, R = np.zeros((n, n)), np.zeros((n, n))
    C[np.ix_(free, free)], R[np.ix_(free, free)] = covariance(data, preferred, variance)
    return C, R


def parameters(fit: PreisachFit) -> tuple[tuple[Parameter, ...], Matrix]:
    """Return the parameters and their covariance, shape (n, n); parameters with a fixed value count as determined."""
    C, R = determination(fit)
    deviations = np.sqrt(np.maximum(np.diag(C), 0.0))
    fitted = fit.solver.problem.lower < fit.solver.problem.upper
    determined = ~fitted | (np.diag(R) >= DETERMINED)
    return tuple(
        Parameter(name=name, value=float(value), deviation=float(deviation), determined=bool(known))
        for name, value, deviation, known in zip(fit.names, fit.x, deviations, determined, strict=True)
    ), C


def doubts(fit: PreisachFit) -> tuple[str, ...]:
    """Return what the data do not determine, one sentence each."""
    sentences = []
    if not fit.solutions[0].converged:
        sentences.append(
            f"The fit was still improving after {fit.solutions[0].iterations} steps. Take more starts, or fewer modes or "
            "relaxations."
        )
    if fit.settings.earlier:
        sentences.append(
            "The errors include the relaxation from before a record began. FMUs start at rest and do not include it."
        )
    else:
        sentences += [rest_doubt(r, fit.rest_resistance, fit.full_scale, RESTED, REST_ADVICE) for r in fit.records]
    held = [_held(record, rows) for record, rows in zip(fit.records, fit.train, strict=True) if rows.any()]
    if fit.settings.relaxations and max(held) < LEAST_HOLD:
        sentences.append(
            f"The strain is at rest for {100.0 * max(held):.1f} % of the training stretch: without holds, the data do "
            "not separate eta from slow relaxation. Add a hold to the record, or treat eta as an assumption."
        )
    known, covariances = parameters(fit)
    weak = Counter(p.name.split("[")[0] for p in known if not p.determined)
    sizes = {b.name: b.size for b in fit.blocks}
    if weak:
        which = ", ".join(f"{count} of {sizes[name]} {name}" for name, count in weak.items())
        sentences.append(
            f"{which} are set by regularisation or a bound, not by the data. Fewer modes or relaxations would do."
        )
    sentences.append(alike(fit.names, covariances, "Fix one of them."))
    return tuple(filter(None, sentences))


def _held(record: Record, rows: Rows) -> float:
    """Return the share of the training time in which strain is constant."""
    steps = np.diff(record.time)
    rates = np.abs(np.diff(record.strain)) / steps
    inside = rows[1:]
    if not inside.any():
        return 0.0
    still = rates[inside] < HOLD_RATE * rates.max()
    return float(steps[inside][still].sum() / steps[inside].sum())
