r"""The separable least squares problem behind ``identify_fractional``.

Symbols: ``y`` weighted change of resistance over its scale [1], ``Phi`` weighted columns, ``c`` coefficients,
:math:`\theta` orders, rates, exponents. For every :math:`\theta` the best ``c`` is a linear, bounded problem; a
search sees :math:`r(\theta) = \Phi(\theta)\,c(\theta) - y`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from .columns import Columns

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class SeparableProblem:
    """Residuals with the coefficients eliminated.

    Parameters
    ----------
    columns : list of Columns
        One per record.
    y : list of ndarray
        Changes of resistance over their scale [1], the kept samples of each record.
    weights : list of float
        Weight of the squared residuals of each record.
    nonnegative : ndarray of bool, shape (n_columns,)
        Coefficients that may not be negative.
    ridge : float
        Penalty on the root mean square of each term, relative to that of ``y``.
    """

    def __init__(
        self,
        columns: list[Columns],
        y: list[Vector],
        weights: list[float],
        nonnegative: NDArray[np.bool_],
        ridge: float,
    ) -> None:
        self._columns, self._nonnegative, self._ridge = columns, nonnegative, ridge
        self._row_weights = np.concatenate([np.full(part.size, np.sqrt(w)) for part, w in zip(y, weights, strict=True)])
        self.y = self._row_weights * np.concatenate(y)
        self._last: tuple[Vector, Matrix, list[Matrix], Vector] | None = None

    def solve(self, theta: Vector) -> tuple[Matrix, list[Matrix], Vector]:
        """Return the columns, their derivatives and the best coefficients."""
        if self._last is None or not np.array_equal(self._last[0], theta):
            found = [columns.evaluate(theta) for columns in self._columns]
            w = self._row_weights[:, None]
            Phi = w * np.vstack([each[0] for each in found])
            slopes = [w * np.vstack(parts) for parts in zip(*(each[1] for each in found), strict=True)]
            self._last = theta.copy(), Phi, slopes, self._coefficients(Phi)
        return self._last[1:]

    def residual(self, theta: Vector) -> Vector:
        """Return the residuals and the penalties [1]."""
        Phi, _, c = self.solve(theta)
        return np.concatenate([Phi @ c - self.y, self._penalty(Phi) * c])

    def jacobian(self, theta: Vector) -> Matrix:
        """Return the derivative of ``residual`` without its part along the columns, after Kaufman."""
        Phi, slopes, c = self.solve(theta)
        penalty = self._penalty(Phi)
        free = ~self._nonnegative | (c > 0.0)
        basis, _ = np.linalg.qr(np.vstack([Phi, np.diag(penalty)])[:, free])
        change = np.column_stack([np.concatenate([slope @ c, np.zeros(c.size)]) for slope in slopes])
        return np.asarray(change - basis @ (basis.T @ change))

    def _penalty(self, Phi: Matrix) -> Vector:
        return np.asarray(self._ridge * np.linalg.norm(Phi, axis=0))

    def _coefficients(self, Phi: Matrix) -> Vector:
        """Solve for the coefficients; the columns are scaled to unit length, which the penalty acts on."""
        size = np.maximum(np.linalg.norm(Phi, axis=0), 1e-300)
        X = np.vstack([Phi / size, self._ridge * np.eye(size.size)])
        wanted = np.concatenate([self.y, np.zeros(size.size)])
        if not self._nonnegative.any():
            return np.asarray(np.linalg.lstsq(X, wanted, rcond=None)[0] / size)
        signed = ~self._nonnegative
        found, _ = nnls(np.hstack([X, -X[:, signed]]), wanted, maxiter=10_000)
        c = found[: size.size]
        c[signed] -= found[size.size :]
        return np.asarray(c / size)


def random_starts(low: Vector, high: Vector, n_terms: int, count: int, seed: int) -> Iterator[Vector]:
    """Draw starting points: orders spread over their range, the others uniform in the logarithm."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        share = rng.uniform(0.02, 0.98, low.size)
        theta = low * (high / low) ** share
        spread = (np.arange(n_terms) + share[:n_terms]) / n_terms
        theta[:n_terms] = low[:n_terms] + (high[:n_terms] - low[:n_terms]) * spread
        yield theta
