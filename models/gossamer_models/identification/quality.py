"""How good a fit is: errors on stretches of records, and how well the data determine each parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..measures import e1, nrmse
from .preisach import Fit
from .records import Record

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

DETERMINED = 0.5  # share of a parameter's information that must come from the data
ALIKE = 0.98  # correlation from which two parameters cannot be told apart
HOLD_RATE = 0.02  # of the fastest strain rate: slower is a hold
LEAST_HOLD = 0.05  # of the training stretch
UNSTRAINED, REST = 0.01, 0.1  # of full scale, and of the output's range that counts as another output at rest


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Errors of one stretch.

    Attributes
    ----------
    record, stretch : str
        Where.
    samples : int
        How many samples.
    e1 : float
        Of the change of output from rest [%], see ``measures.e1``.
    nrmse : float
        Root mean square error over the range of the record [%].
    strain_nrmse : float or None
        The same of the strain that the compensator's method inverse recovers; None for a model without compensator.
    """

    record: str
    stretch: str
    samples: int
    e1: float
    nrmse: float
    strain_nrmse: float | None = None


def errors(record: str, stretch: str, measured: Vector, predicted: Vector, *, rest: float, size: float) -> Errors:
    """Compare a prediction with a measurement; ``rest`` is the output at rest, ``size`` the range of the whole record."""
    return Errors(
        record=record,
        stretch=stretch,
        samples=measured.size,
        e1=e1(measured, predicted, rest=rest),
        nrmse=nrmse(measured, predicted, size),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Determination:
    """How well one parameter is known.

    Attributes
    ----------
    name : str
        Parameter, for instance ``b_mu[2]``.
    value, deviation : float
        Estimate and its standard deviation, data and preferences taken together.
    share : float
        Part of what is known about it that comes from the data, 0 to 1 [1]; the rest are preferences of the settings.
    """

    name: str
    value: float
    deviation: float
    share: float


def covariance(fit: Fit) -> tuple[Matrix, Matrix]:
    r"""Return how well the parameters are determined.

    Returns
    -------
    covariance : ndarray, shape (n, n)
        :math:`C = \sigma^2 (J^T J + P^T P)^{-1}` of the parameters that are not at a bound, zero for the others.
    resolution : ndarray, shape (n, n)
        :math:`C J^T J / \sigma^2`: the identity where the data alone decide, zero where the settings do.

    Notes
    -----
    Linearised at the solution, with white residuals of one variance. Residuals of a model that is not exact are correlated,
    so deviations are too small; what cannot be told apart shows all the same.
    """
    n = fit.x.size
    lower, upper = fit.solver.problem.lower, fit.solver.problem.upper
    slack = 1e-7 * np.maximum(1.0, np.abs(fit.x))
    free = (fit.x > lower + slack) & (fit.x < upper - slack)
    data, preferred = (part[:, free] for part in fit.solver.slopes(fit.x))
    count = sum(int(rows.sum()) for rows in fit.train)
    variance = 2.0 * fit.solutions[0].cost / max(count - int(free.sum()), 1)
    information = data.T @ data
    inverse = np.linalg.pinv(information + preferred.T @ preferred, rcond=1e-14, hermitian=True)
    C, R = np.zeros((n, n)), np.zeros((n, n))
    C[np.ix_(free, free)] = variance * inverse
    R[np.ix_(free, free)] = inverse @ information
    return C, R


def determinations(fit: Fit) -> tuple[Determination, ...]:
    """Return how well every parameter is determined."""
    C, R = covariance(fit)
    deviations, shares = np.sqrt(np.maximum(np.diag(C), 0.0)), np.clip(np.diag(R), 0.0, 1.0)
    return tuple(
        Determination(name=name, value=float(value), deviation=float(deviation), share=float(share))
        for name, value, deviation, share in zip(fit.names, fit.x, deviations, shares, strict=True)
    )


def doubts(fit: Fit, records: tuple[Record, ...]) -> tuple[str, ...]:
    """Say what the data cannot decide, one sentence each."""
    sentences = []
    if not fit.solutions[0].converged:
        sentences.append(
            f"The fit was still improving after {fit.solutions[0].iterations} steps. Take more starts, or fewer modes or "
            "relaxations."
        )
    if fit.settings.earlier:
        sentences.append(
            "The errors count what was relaxing before a record began as known. FMUs start at rest and do not know it."
        )
    else:
        sentences += [_rest(fit, record) for record in records]
    held = [_held(record, rows) for record, rows in zip(records, fit.train, strict=True) if rows.any()]
    if fit.settings.relaxations and max(held) < LEAST_HOLD:
        sentences.append(
            f"The strain is at rest for {100.0 * max(held):.1f} % of the training stretch: without holds, eta and slow "
            "relaxation cannot be told apart. Add a hold to the record, or read eta as an assumption."
        )
    C, R = covariance(fit)
    fitted = fit.solver.problem.lower < fit.solver.problem.upper
    weak = [
        name for name, share in zip(fit.names, np.where(fitted, np.diag(R), 1.0), strict=True) if share < DETERMINED
    ]
    groups: dict[str, int] = {}
    for name in weak:
        groups[name.split("[")[0]] = groups.get(name.split("[")[0], 0) + 1
    sizes = {b.name: b.size for b in fit.blocks}
    if groups:
        told = ", ".join(f"{count} of {sizes[name]} {name}" for name, count in groups.items())
        sentences.append(
            f"The settings rather than the data decide or bound {told}. Fewer modes or relaxations would do."
        )
    sentences.append(alike(fit.names, C, "Fix one."))
    return tuple(filter(None, sentences))


def alike(names: tuple[str, ...], covariance: Matrix, advice: str) -> str:
    """Name the two parameters of the highest correlation and what to do, if they cannot be told apart; else say nothing."""
    deviations = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    with np.errstate(invalid="ignore"):  # no data at all: infinite deviations
        correlation = np.nan_to_num(np.triu(np.abs(covariance / np.outer(deviations, deviations)), 1))
    i, k = np.unravel_index(int(np.argmax(correlation)), correlation.shape)
    if not correlation[i, k] > ALIKE:
        return ""
    return f"{names[i]} and {names[k]} cannot be told apart: their correlation is {correlation[i, k]:.3f}. {advice}"


def _rest(fit: Fit, record: Record) -> str:
    """Say where a record begins unstrained, but not with the output at rest; empty where it does not."""
    first = float(record.output[0])
    if record.strain[0] > UNSTRAINED * fit.full_scale or abs(first - fit.offset) <= REST * float(np.ptp(record.output)):
        return ""
    return (
        f"{record.name} begins unstrained with an output of {first:.6g}, where {fit.offset:.6g} is taken for that at rest. "
        "Check it and its unit, or fit what was still relaxing."
    )


def _held(record: Record, rows: NDArray[np.bool_]) -> float:
    """Return the part of the training time in which strain stands still."""
    steps = np.diff(record.time)
    rates = np.abs(np.diff(record.strain)) / steps
    inside = rows[1:]
    if not inside.any():
        return 0.0
    still = rates[inside] < HOLD_RATE * rates.max()
    return float(steps[inside][still].sum() / steps[inside].sum())
