r"""Least squares between bounds: problems, quadratic models of chi2, Levenberg-Marquardt with eight dampings at once.

Symbols: ``x`` unknowns, ``y`` weighed record, ``r`` residuals and ``J`` derivatives of the weighed predictions; ``A``, ``g``
curvature and slope of half of chi2, ``d`` moves: :math:`d^T A d - 2 g^T d` is the change of chi2; ``lam`` dampings [1].
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError

MOST_SWAPS = 40
ROUND_OFF = 1e-12  # of the curvature by an unknown: more than what is left of one where unknowns act alike
MOST_DAMAGE = 0.95
PRIOR_DEVIATION = MOST_DAMAGE / math.sqrt(12.0)  # of a damage that may be anything
DAMAGE_STEP = 2e-3  # of finite differences
DAMPINGS = np.array([0.0, 1e-3, 1e-2, 0.05, 0.2, 1.0, 5.0, 50.0])  # one for each lane
NEGLIGIBLE = 0.02  # of chi2: no damage moves by more than a seventh of its deviation
LINEAR = 0.9  # share of what the model promised
WORTHWHILE = 0.5  # share of it with which no other damping is tried, where each costs as much as the first
LITTLE = 0.1  # share of it with which no more is gained: chi2 of sensors with plays has edges
FAR = 3.0  # chi2 per value of a record that is not explained
ROUGHLY = 0.1  # share of what is above this that is not worth a step
SHORT = 5.0  # of chi2: longer steps change the derivatives


def bounded_minimum(A: Matrix, g: Vector, low: Vector, high: Vector) -> Vector:
    r"""Return the move d between bounds at which :math:`d^T A d - 2 g^T d` is smallest, shape (n,).

    Parameters
    ----------
    A : ndarray, shape (n, n)
        Curvature, positive semidefinite with a positive diagonal; singular where unknowns act alike.
    g : ndarray, shape (n,)
        Slope.
    low, high : ndarray, shape (n,)
        Bounds.

    Notes
    -----
    The primal-dual active set method of [1]_: which bounds hold follows from the last solution and its multipliers. Where it
    goes in circles, ``scipy.optimize.lsq_linear`` finishes.

    References
    ----------
    .. [1] M. Hintermueller, K. Ito, K. Kunisch, SIAM Journal on Optimization 13(3), 865-888, 2002,
       doi:10.1137/S1052623401383558.
    """
    scale = 1.0 / np.sqrt(np.diag(A))
    A, g, low, high = A * np.outer(scale, scale) + ROUND_OFF * np.eye(len(g)), g * scale, low / scale, high / scale
    d, slope = np.zeros(len(g)), g.copy()
    for _ in range(MOST_SWAPS):
        below, above = d + slope < low, d + slope > high
        held = below | above
        before, d = d, np.where(below, low, np.where(above, high, 0.0))
        if not held.all():
            rest = ~held
            d[rest] = np.linalg.solve(A[np.ix_(rest, rest)], g[rest] - A[np.ix_(rest, held)] @ d[held])
        slope = np.where(held, g - A @ d, 0.0)
        if np.array_equal(before, d):
            return np.asarray(np.clip(d, low, high) * scale)
    L = np.linalg.cholesky(A)
    room = np.maximum(high - low, 1e-12)
    return np.asarray(lsq_linear(L.T, np.linalg.solve(L, g), (low, low + room), method="bvls").x * scale)


def change(A: Matrix, g: Vector, d: Vector) -> float:
    """Return the change of the quadratic by a move."""
    return float(d @ A @ d - 2.0 * g @ d)


@dataclass(frozen=True)
class Quadratic:
    """Quadratic model of chi2 about a point: chi2 - 2 g d + d A d.

    Attributes
    ----------
    A, g : ndarray, shape (n, n) and (n,)
        Curvature and slope; ``A`` includes the priors.
    at : ndarray, shape (n,)
        The point.
    """

    A: Matrix
    g: Vector
    at: Vector


@dataclass(frozen=True)
class Point:
    """Unknowns and what they predict.

    Attributes
    ----------
    x : ndarray, shape (n,)
        Unknowns.
    predicted : ndarray, shape (sensors, samples)
        Strain or resistance that sensors without gain and offset read.
    r : ndarray, shape (values,)
        Weighed residuals.
    chi2 : float
        Chi2 with the priors; infinite where the simulation failed.
    """

    x: Vector
    predicted: Matrix
    r: Vector
    chi2: float


def neighbours(x: Vector, places: NDArray[np.int64], steps: Vector, high: Vector) -> tuple[Matrix, Vector]:
    """Return rows of unknowns with one of them moved in each, shape (m, n), and the moves: backwards at an upper bound."""
    steps = np.where(x[places] + steps > high[places], -steps, steps)
    rows = np.repeat(x[None], places.size, axis=0)
    rows[np.arange(places.size), places] += steps
    return rows, steps


class LeastSquares(ABC):
    """A weighed record to explain, and what unknowns with normal priors of mean 0 predict of it.

    Attributes
    ----------
    y : ndarray, shape (values,)
        The record, weighed.
    low, high : ndarray, shape (n,)
        Bounds of the unknowns.
    prior : ndarray, shape (n,)
        Curvature that the prior of each adds.
    steps : ndarray, shape (n,)
        Of finite differences.
    simulated : int
        How many unknowns change the prediction; those after them change how it is read.
    """

    y: Vector
    low: Vector
    high: Vector
    prior: Vector
    steps: Vector
    simulated: int

    @property
    def at_once(self) -> bool:
        """Whether some predictions cost little more than one, as those in motion do in the lanes of a processor."""
        return True

    @abstractmethod
    def predict(self, x: Matrix) -> Matrix:
        """Simulate rows of unknowns, shape (m, n); return histories, shape (m, sensors, samples)."""

    @abstractmethod
    def weigh(self, predicted: Matrix, x: Matrix) -> Matrix:
        """Turn histories, as they are read with rows of unknowns, into numbers of variance 1, shape (m, values)."""

    def points(self, x: Matrix) -> list[Point]:
        """Simulate rows of unknowns, shape (m, n)."""
        return self.judged(x, self.predict(x))

    def judged(self, x: Matrix, predicted: Matrix) -> list[Point]:
        """Compare what rows of unknowns, shape (m, n), predict with the record."""
        r = self.y - self.weigh(predicted, x)
        chi2 = np.einsum("ij,ij->i", r, r) + np.sum(self.prior * x**2, axis=1)
        return [Point(*row) for row in zip(x, predicted, r, np.where(np.isfinite(chi2), chi2, np.inf), strict=True)]

    def derivatives(self, point: Point, free: Rows) -> Matrix:
        """Return the derivatives of the weighed predictions by the free unknowns, shape (values, number of them).

        Raises
        ------
        ConvergenceError
            A simulation has failed.
        """
        places = np.flatnonzero(free)
        rows, steps = neighbours(point.x, places, self.steps[places], self.high)
        simulated = int(np.searchsorted(places, self.simulated))
        weighed = np.empty((self.y.size, places.size))
        if simulated:
            weighed[:, :simulated] = self.weigh(self.predict(rows[:simulated]), rows[:simulated]).T
        if simulated < places.size:
            weighed[:, simulated:] = self.weigh(point.predicted[None], rows[simulated:]).T
        return require_finite((weighed - (self.y - point.r)[:, None]) / steps)

    def about(self, point: Point, free: Rows, J: Matrix) -> Quadratic:
        """Return the quadratic model of chi2 about a point over the free unknowns, from their derivatives."""
        at = point.x[free]
        return Quadratic(A=J.T @ J + np.diag(self.prior[free]), g=J.T @ point.r - self.prior[free] * at, at=at)


def require_finite(J: Matrix) -> Matrix:
    """Return derivatives if they are finite, else raise ``ConvergenceError``: a simulation has failed."""
    if not np.isfinite(J).all():
        msg = "the twin's membrane failed near its present damages. Check the load and the parameters of the twin."
        raise ConvergenceError(msg)
    return J


@dataclass(frozen=True)
class Minimum:
    """Where the search ended.

    Attributes
    ----------
    point : Point
        Unknowns, residuals and chi2 there.
    J : ndarray, shape (values, number of free unknowns)
        Derivatives there, or a negligible move before.
    model : Quadratic
        Quadratic model there over the free unknowns.
    """

    point: Point
    J: Matrix
    model: Quadratic


def descend(problem: LeastSquares, start: Vector, free: Rows, most: int = 12, enough: float = NEGLIGIBLE) -> Minimum:
    """Search the smallest chi2 between the bounds, from a start.

    Parameters
    ----------
    problem : LeastSquares
        What is fitted.
    start : ndarray, shape (n,)
        Unknowns; those that are not free stay.
    free : ndarray of bool, shape (n,)
        Unknowns to search.
    most : int
        Iterations.
    enough : float
        Stop where the quadratic model promises less of chi2 than this, or a tenth of what is above three per value.

    Raises
    ------
    ConvergenceError
        A simulation has failed at the start or beside it.

    Notes
    -----
    Where a short step has gained what the model promised, its derivatives serve for the next step too.
    """
    point = problem.points(np.clip(start, problem.low, problem.high)[None])[0]
    J = problem.derivatives(point, free)
    model, fresh = problem.about(point, free, J), True
    for _ in range(most):
        low, high = problem.low[free] - point.x[free], problem.high[free] - point.x[free]
        moves = [bounded_minimum(model.A + np.diag(lam * np.diag(model.A)), model.g, low, high) for lam in DAMPINGS]
        promised = -change(model.A, model.g, moves[0])
        least = max(enough, ROUGHLY * (point.chi2 - FAR * problem.y.size))
        if promised < least:
            break
        trials = np.repeat(point.x[None], len(moves), axis=0)
        trials[:, free] = np.clip(trials[:, free] + moves, problem.low[free], problem.high[free])
        best = _likeliest(problem, trials, point.chi2 - WORTHWHILE * promised)
        gained = point.chi2 - best.chi2
        if gained > 0.0:
            point = best
        if fresh and gained < max(least, LITTLE * promised):
            break
        fresh = promised > SHORT or gained < LINEAR * promised
        if fresh:
            J = problem.derivatives(point, free)
        model = problem.about(point, free, J)
    return Minimum(point=point, J=J, model=model)


def _likeliest(problem: LeastSquares, trials: Matrix, enough: float) -> Point:
    """Return the likeliest of rows of unknowns; where each costs as much as the first, the first whose chi2 is enough."""
    if problem.at_once:
        return min(problem.points(trials), key=lambda trial: trial.chi2)
    best = problem.points(trials[:1])[0]
    for trial in trials[1:]:
        if best.chi2 <= enough:
            break
        best = min(best, problem.points(trial[None])[0], key=lambda trial: trial.chi2)
    return best
