r"""Smallest value of a convex quadratic between bounds.

Symbols: ``d`` move from the present point, ``A`` curvature, ``g`` slope: minimise :math:`d^T A d - 2 g^T d`.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from ..arrays import Matrix, Vector

MOST_SWAPS = 40


def bounded_minimum(A: Matrix, g: Vector, low: Vector, high: Vector) -> Vector:
    r"""Return the move d between bounds at which :math:`d^T A d - 2 g^T d` is smallest, shape (n,).

    Parameters
    ----------
    A : ndarray, shape (n, n)
        Curvature, positive definite.
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
    A, g, low, high = A * np.outer(scale, scale), g * scale, low / scale, high / scale
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
