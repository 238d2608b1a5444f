r"""What any model of a sensor must beat: a static cubic, and a ridge regression on lags.

Symbols: ``u`` input and ``y`` output of the map, resistance and strain in either order; ``X`` its features. The regression
takes u, :math:`u^2`, :math:`u^3`, u at earlier samples, low-passes of u, and the low-passes times u.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..fitting.records import Record
from .split import cut

LAGS = 20  # [samples]
LOW_PASSES = 8
RIDGES = (1e-6, 1e-4, 1e-2)


def cubic(inputs: Sequence[Vector], outputs: Sequence[Vector], train: Sequence[Rows]) -> tuple[Vector, ...]:
    """Return what a cubic fitted to the training samples gives, of the shape of ``outputs``; beyond them it is held."""
    u, y = (np.concatenate([v[rows] for v, rows in zip(values, train, strict=True)]) for values in (inputs, outputs))
    low, high = float(u.min()), float(u.max())
    if not high > low:
        return tuple(np.full(v.size, float(np.mean(y))) for v in inputs)
    fitted = np.polynomial.Polynomial.fit(u, y, 3)
    return tuple(np.asarray(fitted(np.clip(v, low, high))) for v in inputs)


def regression(
    records: Sequence[Record], inputs: Sequence[Vector], outputs: Sequence[Vector], train: Sequence[Rows]
) -> tuple[Vector, ...]:
    """Return what a ridge regression fitted to the training samples gives; the later ones of them choose its ridge."""
    shortest = min(float(np.median(np.diff(r.time))) for r in records)
    longest = max(float(np.ptp(r.time[rows])) for r, rows in zip(records, train, strict=True))
    times = np.geomspace(3.0 * shortest, 0.25 * longest, LOW_PASSES)
    X = [features_of(r.time, u, times) for r, u in zip(records, inputs, strict=True)]
    early, late = cut(train)
    errors = []
    for ridge in RIDGES:
        predicted = _ridge(X, outputs, early, ridge)
        squares = [((p - y)[rows]) ** 2 for p, y, rows in zip(predicted, outputs, late, strict=True)]
        errors.append(float(np.mean(np.concatenate(squares))))
    return _ridge(X, outputs, train, RIDGES[int(np.argmin(errors))])


def features_of(time: Vector, u: Vector, times: Vector) -> Matrix:
    """Return the features, shape (m, f), of an input at some times [s]."""
    past = np.maximum(np.arange(u.size)[:, None] - np.arange(1, LAGS + 1), 0)
    low = np.empty((u.size, times.size))
    low[0] = state = np.full(times.size, u[0])
    for k, h in enumerate(np.diff(time)):
        left = np.exp(-h / times)
        low[k + 1] = state = left * state + (1.0 - left) * u[k + 1]
    return np.column_stack([u, u**2, u**3, u[past], low, low * u[:, None]])


def _ridge(X: Sequence[Matrix], y: Sequence[Vector], train: Sequence[Rows], ridge: float) -> tuple[Vector, ...]:
    fitted = np.vstack([x[rows] for x, rows in zip(X, train, strict=True)])
    wanted = np.concatenate([v[rows] for v, rows in zip(y, train, strict=True)])
    mean, size, level = fitted.mean(axis=0), fitted.std(axis=0) + 1e-12, float(wanted.mean())
    A = (fitted - mean) / size
    w = np.linalg.solve(A.T @ A + ridge * len(A) * np.eye(A.shape[1]), A.T @ (wanted - level))
    return tuple(level + ((x - mean) / size) @ w for x in X)
