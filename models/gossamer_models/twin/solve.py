r"""Bounded Levenberg-Marquardt that tries eight dampings at once.

Symbols: ``x`` unknowns, ``r`` residuals, ``lam`` dampings [1], ``A``, ``g`` curvature and slope of the quadratic model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Matrix, Rows, Vector
from .problem import Quadratic
from .quadratic import bounded_minimum, change

DAMPINGS = np.array([0.0, 1e-3, 1e-2, 0.05, 0.2, 1.0, 5.0, 50.0])  # one for each lane
NEGLIGIBLE = 0.02  # of chi2: no damage moves by more than a seventh of its deviation


class LeastSquares(Protocol):
    """What ``minimise`` needs of a problem."""

    low: Vector
    high: Vector

    def residuals(self, x: Matrix) -> Matrix:
        """Return weighed residuals of rows of unknowns."""
        ...

    def chi2(self, r: Matrix, x: Matrix) -> Vector:
        """Return chi2 of rows of residuals and unknowns."""
        ...

    def quadratic(self, x: Vector, free: Rows) -> tuple[Quadratic, Vector]:
        """Return the quadratic model at x over the free unknowns, and the residuals there."""
        ...


@dataclass(frozen=True)
class Minimum:
    """Where the search ended.

    Attributes
    ----------
    x, r : ndarray
        Unknowns and residuals there.
    model : Quadratic
        Quadratic model over the free unknowns, there or one negligible move before.
    free : ndarray of bool
        Free unknowns.
    chi2 : float
        Chi2 with priors.
    """

    x: Vector
    r: Vector
    model: Quadratic
    free: Rows
    chi2: float


def minimise(problem: LeastSquares, start: Vector, free: Rows, most: int = 12, enough: float = NEGLIGIBLE) -> Minimum:
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
    """
    x = np.clip(start, problem.low, problem.high)
    for _ in range(most):
        model, r = problem.quadratic(x, free)
        chi2 = float(problem.chi2(r[None], x[None])[0])
        low, high = problem.low[free] - x[free], problem.high[free] - x[free]
        moves = np.array(
            [bounded_minimum(model.A + np.diag(lam * np.diag(model.A)), model.g, low, high) for lam in DAMPINGS]
        )
        promised = -change(model.A, model.g, moves[0])
        if promised < enough:
            break
        trials = np.repeat(x[None], len(moves), axis=0)
        trials[:, free] = np.clip(trials[:, free] + moves, problem.low[free], problem.high[free])
        residuals = problem.residuals(trials)
        found = problem.chi2(residuals, trials)
        best = int(np.argmin(found))
        if not found[best] < chi2:
            break
        gained = chi2 - found[best]
        x, r, chi2 = trials[best], residuals[best], float(found[best])
        if gained < enough:
            break
    return Minimum(x=x, r=r, model=model, free=free, chi2=chi2)
