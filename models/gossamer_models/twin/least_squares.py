"""Points and quadratic models of chi2, common to all least-squares problems of the twin.

Symbols: ``x`` unknowns; ``r`` weighed residuals and ``J`` derivatives of the weighed predictions; ``A``, ``g`` curvature and
slope of half of chi2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError

MOST_DAMAGE = 0.95
DAMAGE_STEP = 2e-3  # of finite differences


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
    predicted : ndarray, shape (4, samples)
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


def points_at(x: Matrix, predicted: Matrix, r: Matrix, prior: Vector) -> list[Point]:
    """Return the points of rows of unknowns, shape (m, n), with priors of mean 0 and these curvatures, shape (n,)."""
    chi2 = np.einsum("ij,ij->i", r, r) + np.sum(prior * x**2, axis=1)
    return [Point(*row) for row in zip(x, predicted, r, np.where(np.isfinite(chi2), chi2, np.inf), strict=True)]


def neighbours(x: Vector, places: NDArray[np.int64], steps: Vector, high: Vector) -> tuple[Matrix, Vector]:
    """Return rows of unknowns with one of them moved in each, shape (m, n), and the moves: backwards at an upper bound."""
    steps = np.where(x[places] + steps > high[places], -steps, steps)
    rows = np.repeat(x[None], places.size, axis=0)
    rows[np.arange(places.size), places] += steps
    return rows, steps


def check_derivatives(J: Matrix) -> Matrix:
    """Return derivatives if they are finite, else raise ``ConvergenceError``: a simulation has failed."""
    if not np.isfinite(J).all():
        msg = "the twin's membrane failed near its present damages. Check the load and the parameters of the twin."
        raise ConvergenceError(msg)
    return J


def quadratic_about(point: Point, free: Rows, J: Matrix, prior: Vector) -> Quadratic:
    """Return the quadratic model of chi2 about a point over the free unknowns, from their derivatives."""
    at = point.x[free]
    return Quadratic(A=J.T @ J + np.diag(prior[free]), g=J.T @ point.r - prior[free] * at, at=at)
