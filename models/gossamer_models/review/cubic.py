"""The static cubic that every judgement of a sensor stands beside: what a user would have without a model of hysteresis."""

from __future__ import annotations

import numpy as np

from ..arrays import Rows, Vector

DEGREE = 3


def static_cubic(x: Vector, y: Vector, rows: Rows) -> Vector:
    """Return a polynomial of ``x`` at all samples, shape (m,), fitted to ``y`` on some of them by least squares.

    Parameters
    ----------
    x, y : ndarray, shape (m,)
        Strain [1] and resistance [ohm], or the other way round.
    rows : ndarray of bool, shape (m,)
        Samples to fit.
    """
    low, high = float(x[rows].min()), float(x[rows].max())
    if not high > low:
        return np.full(x.size, float(np.mean(y[rows])))
    fitted = np.polynomial.Polynomial.fit(x[rows], y[rows], DEGREE)
    return np.asarray(fitted(np.clip(x, low, high)))
