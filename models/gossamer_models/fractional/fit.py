r"""Fit a fractional model to records of strain and resistance by separable least squares.

Symbols: ``y`` change of resistance over its scale [1], :math:`\theta` orders, rates and exponents, ``c`` coefficients,
:math:`\Phi(\theta)` columns of unit coefficient; ``A``, ``B`` coefficients of a term on the strain and on its quadrature.
Every model of Chapter 3 of the thesis is linear in its coefficients and, because a phase turns a record into its cosine and
sine parts, in its phases too::

    y = Phi(theta) c      columns: strain, terms on the record, terms on its quadrature, fading integrals

so :math:`C_k, b_k` become two linear coefficients, :math:`A = C_k\cos(\pi b_k/2)` and :math:`B = -C_k\sin(\pi b_k/2)`, and
every pair of these is one :math:`(C_k, b_k)` within the bounds of the thesis. The sum of squares is that of Eq. (3.14). A
search over :math:`\theta` remains, in a box, with ``c`` eliminated at every step (``fitting/separable.py``). The modes do
not depend on the orders and are computed once; what depends on :math:`\theta` is differentiated by CasADi.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from ..arrays import Matrix, Rows, Vector
from ..errors import DataError
from ..fitting.errors import Errors, stretch_errors
from ..fitting.records import Record, check_rest, in_equal_steps, strain_range
from ..fitting.separable import Derivative, SeparableProblem
from .artifact import FadingTerm, FractionalArtifact, FractionalTerm
from .columns import RecordColumns
from .model import predict
from .settings import FractionalSettings


@dataclass(frozen=True, kw_only=True)
class FractionalFit:
    """Result of a fit.

    Attributes
    ----------
    artifact : FractionalArtifact
        The model.
    settings : FractionalSettings
        Settings of the fit; the range of times of the memory covers the records.
    records : tuple of Record
        Fitted records.
    predicted : tuple of ndarray
        Resistance [ohm] at the samples of every record.
    train : tuple of ndarray of bool
        Samples of every record that were fitted.
    theta : ndarray, shape (N + 2 L,)
        Orders, rates and exponents, in the order of the artifact's terms.
    problem : SeparableProblem
        For derivatives at the solution.
    box : tuple of ndarray, shape (N + 2 L,)
        Bounds of ``theta``.
    rest_fitted : bool
        Whether the resistance at rest was fitted.
    costs : tuple of float
        Root mean square residual [% of the scale] after each start.
    seconds : float
        Wall time.
    """

    artifact: FractionalArtifact
    settings: FractionalSettings
    records: tuple[Record, ...]
    predicted: tuple[Vector, ...]
    train: tuple[Rows, ...]
    theta: Vector
    problem: SeparableProblem
    box: tuple[Vector, Vector]
    rest_fitted: bool
    costs: tuple[float, ...]
    seconds: float = field(compare=False)

    @property
    def rest_resistance(self) -> float:
        """Resistance [ohm] of the unstrained sensor at rest, given or fitted."""
        return self.artifact.rest_resistance

    @property
    def errors(self) -> tuple[Errors, ...]:
        """Errors on the training and the test stretch of every record."""
        return stretch_errors(self.records, self.predicted, self.train, self.rest_resistance)


def fit_fractional(
    records: tuple[Record, ...],
    train: tuple[Rows, ...],
    settings: FractionalSettings,
    *,
    full_scale: float | None = None,
    rest_resistance: float | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> FractionalFit:
    """Fit one of the three fractional models to one or several records of one sensor.

    Parameters
    ----------
    records : tuple of Record
        Resampled in equal steps if they have none.
    train : tuple of ndarray of bool
        Samples of each record to fit.
    settings : FractionalSettings
        The model and how to fit it; the range of times of its memory is widened to what the records need.
    full_scale : float or None
        Strain [1] at the end of the range; None for the largest in the records.
    rest_resistance : float or None
        Resistance [ohm] before the first loading, where it is known; None to fit it.
    progress : callable
        Called with a sentence after each start.

    Returns
    -------
    FractionalFit
        The model, its predictions, and the result of the search.

    Raises
    ------
    DataError
        The records cannot be fitted: too short, constant, or beyond full scale.
    """
    began = time.perf_counter()
    check_rest(rest_resistance)
    full_scale = strain_range(records, full_scale)
    even, rows = zip(*(in_equal_steps(*pair) for pair in zip(records, train, strict=True)), strict=True)
    steps = [float(r.time[1] - r.time[0]) for r in even]
    settings = replace(
        settings,
        shortest=min(settings.shortest, *steps),
        longest=max(settings.longest, *(h * r.time.size for h, r in zip(steps, even, strict=True))),
    )
    for record, kept in zip(even, rows, strict=True):
        _check(record, kept, settings)
    rest = float(even[0].resistance[0]) if rest_resistance is None else rest_resistance
    changes = [(r.resistance - rest)[kept] for r, kept in zip(even, rows, strict=True)]
    scale = max(float(np.ptp(change)) for change in changes)
    columns = [
        RecordColumns(r.strain / full_scale, h, kept, settings, rest=rest_resistance is None)
        for r, h, kept in zip(even, steps, rows, strict=True)
    ]
    problem = _problem(columns, changes, scale, [r.weight for r in records], settings, rest=rest_resistance is None)
    bounds = [
        *[settings.orders] * settings.terms,
        *[settings.rates] * settings.n_fading,
        *[settings.exponents] * settings.n_fading,
    ]
    low, high = np.array(bounds).T
    costs, points = [], []
    for k, start in enumerate(random_starts(low, high, settings)):
        with threadpool_limits(1):  # small matrices: waking other threads for them costs many times their work
            solution = least_squares(
                problem.residual,
                start,
                problem.jacobian,
                bounds=(low, high),
                x_scale=high - low,
                max_nfev=settings.most_evaluations,
            )
        costs.append(float(100.0 * np.sqrt(2.0 * solution.cost / problem.y.size)))
        points.append(solution.x)
        progress(f"{settings.model}: start {k + 1} of {settings.starts}, misfit {costs[-1]:.3f} %")
    theta = _sorted(points[int(np.argmin(costs))], settings)
    c = problem.coefficients(theta)
    artifact = FractionalArtifact(
        model=settings.model,
        direct=float(c[0]),
        terms=_terms(theta, c, settings),
        fading=_fading_terms(theta, c[columns[0].first_fading :], settings),
        full_scale_strain=full_scale,
        resistance_change=scale,
        rest_resistance=rest + scale * float(c[-1]) if rest_resistance is None else rest,
        shortest=settings.shortest,
        longest=settings.longest,
    )
    return FractionalFit(
        artifact=artifact,
        settings=settings,
        records=records,
        predicted=tuple(predict_record(artifact, record) for record in records),
        train=train,
        theta=theta,
        problem=problem,
        box=(low, high),
        rest_fitted=rest_resistance is None,
        costs=tuple(costs),
        seconds=time.perf_counter() - began,
    )


def predict_record(artifact: FractionalArtifact, record: Record) -> Vector:
    """Return the resistance [ohm] that a model gives at the samples of a record, in equal steps or not, shape (m,)."""
    even, _ = in_equal_steps(record, np.ones(record.time.size, dtype=bool))
    return np.interp(record.time, even.time, predict(artifact, even.strain, float(even.time[1] - even.time[0])))


def _problem(
    columns: list[RecordColumns],
    changes: list[Vector],
    scale: float,
    weights: list[float],
    settings: FractionalSettings,
    *,
    rest: bool,
) -> SeparableProblem:
    def evaluate(theta: Vector) -> tuple[Matrix, list[Derivative]]:
        parts = [each.evaluate(theta) for each in columns]
        derivatives = [
            (pairs[0][0], np.vstack([slope for _, slope in pairs]))
            for pairs in zip(*(derivative for _, derivative in parts), strict=True)
        ]
        return np.vstack([Phi for Phi, _ in parts]), derivatives

    # with C_k >= 0, b_k in -1..1 leaves the sine parts free, and b_k in -2..0 the cosine parts
    nonnegative = np.full(columns[0].count, settings.nonnegative)
    if settings.model != "sub-model-1":
        first = 1 if settings.model == "model-1" else 1 + settings.terms
        nonnegative[first : first + settings.terms] = False
    restrained = np.ones(nonnegative.size, dtype=bool)
    if rest:
        nonnegative[-1] = restrained[-1] = False
    return SeparableProblem(
        evaluate,
        np.concatenate(changes) / scale,
        weights=np.concatenate([np.full(part.size, w) for part, w in zip(changes, weights, strict=True)]),
        nonnegative=nonnegative,
        restraint=settings.restraint,
        restrained=restrained,
    )


def random_starts(low: Vector, high: Vector, settings: FractionalSettings) -> Iterator[Vector]:
    """Draw starting points: orders spread over their range, the others uniform in the logarithm."""
    rng, n = np.random.default_rng(settings.seed), settings.terms
    for _ in range(settings.starts):
        share = rng.uniform(0.02, 0.98, low.size)
        theta = low * (high / low) ** share
        theta[:n] = low[:n] + (high[:n] - low[:n]) * (np.arange(n) + share[:n]) / n
        yield theta


def _sorted(theta: Vector, settings: FractionalSettings) -> Vector:
    """Return a point with its terms in the order of their orders, its fading integrals in that of their rates."""
    a, p, q = np.split(theta, [settings.terms, settings.terms + settings.n_fading])
    return np.concatenate([np.sort(a), np.sort(p), q[np.argsort(p)]])


def _terms(theta: Vector, c: Vector, settings: FractionalSettings) -> tuple[FractionalTerm, ...]:
    N = settings.terms
    A, B = c[1 : 1 + N], np.zeros(N) if settings.model == "sub-model-1" else c[1 + N : 1 + 2 * N]
    terms = []
    for a_k, A_k, B_k in zip(theta, A, B, strict=False):
        if settings.model == "sub-model-1":
            terms.append(FractionalTerm(coefficient=float(A_k), order=float(a_k)))
            continue
        # the phase within the bounds of the model
        sign = -1.0 if (B_k if settings.model == "model-1" else A_k) < 0.0 else 1.0
        phase = 2.0 / np.pi * np.arctan2(-sign * B_k, sign * A_k)
        terms.append(FractionalTerm(coefficient=float(sign * np.hypot(A_k, B_k)), order=float(a_k), phase=float(phase)))
    return tuple(terms)


def _fading_terms(theta: Vector, c: Vector, settings: FractionalSettings) -> tuple[FadingTerm, ...]:
    p, q = np.split(theta[settings.terms :], 2)
    return tuple(
        FadingTerm(coefficient=float(C), rate=float(rate), exponent=float(exponent))
        for C, rate, exponent in zip(c, p, q, strict=False)
    )


def _check(record: Record, rows: Rows, settings: FractionalSettings) -> None:
    strain, resistance = record.strain[rows], record.resistance[rows]
    n_parameters = 1 + 3 * (settings.terms + settings.n_fading)
    problem = None
    if strain.size < 2 * n_parameters:
        problem = f"{strain.size} samples are too few for up to {n_parameters} parameters: give twice as many"
    elif not (np.ptp(strain) > 0.0 and np.ptp(resistance) > 0.0):
        problem = "strain or resistance is constant in the training stretch"
    if problem is not None:
        msg = f"cannot fit {record.name!r}: {problem}."
        raise DataError(msg)
