r"""Bounded Levenberg-Marquardt that tries eight dampings at once.

Symbols: ``x`` unknowns, ``r`` residuals, ``lam`` dampings [1], ``A``, ``g`` curvature and slope of the quadratic model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Matrix, Rows, Vector
from .least_squares import Point, Quadratic, quadratic_about
from .quadratic import bounded_minimum, change

DAMPINGS = np.array([0.0, 1e-3, 1e-2, 0.05, 0.2, 1.0, 5.0, 50.0])  # one for each lane
NEGLIGIBLE = 0.02  # of chi2: no damage moves by more than a seventh of its deviation
LINEAR = 0.9  # share of what the model promised
SHORT = 5.0  # of chi2: longer steps change the derivatives


class LeastSquares(Protocol):
    """What ``descend`` needs of a problem, as ``Problem`` documents it."""

    low: Vector
    high: Vector
    prior: Vector  # curvature that the priors add to each unknown

    def points(self, x: Matrix) -> list[Point]:
        """Simulate rows of unknowns."""
        ...

    def derivatives(self, point: Point, free: Rows) -> Matrix:
        """Return the derivatives of the weighed predictions."""
        ...


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
        Stop where the quadratic model promises less of chi2 than this.

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
    model, fresh = quadratic_about(point, free, J, problem.prior), True
    for _ in range(most):
        low, high = problem.low[free] - point.x[free], problem.high[free] - point.x[free]
        moves = [bounded_minimum(model.A + np.diag(lam * np.diag(model.A)), model.g, low, high) for lam in DAMPINGS]
        promised = -change(model.A, model.g, moves[0])
        if promised < enough:
            break
        trials = np.repeat(point.x[None], len(moves), axis=0)
        trials[:, free] = np.clip(trials[:, free] + moves, problem.low[free], problem.high[free])
        best = min(problem.points(trials), key=lambda trial: trial.chi2)
        gained = point.chi2 - best.chi2
        if gained > 0.0:
            point = best
        elif fresh:
            break
        fresh = promised > SHORT or gained < LINEAR * promised
        if fresh:
            J = problem.derivatives(point, free)
        model = quadratic_about(point, free, J, problem.prior)
    return Minimum(point=point, J=J, model=model)
