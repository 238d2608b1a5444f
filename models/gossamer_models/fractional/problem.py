r"""The separable least squares problem behind ``identify_fractional``.

Symbols: ``y`` weighted change of resistance over its scale [1], ``Phi`` weighted columns, ``c`` coefficients,
:math:`\theta` orders, rates, exponents. For every :math:`\theta` the best ``c`` is a linear, bounded problem; a
search sees :math:`r(\theta) = \Phi(\theta)\,c(\theta) - y` and one row more, a penalty on terms that cancel each other:
:math:`\rho\,(\sum_k |c_k|\,\|\Phi_k\| - \|y\|)`, with :math:`\rho` the ``restraint``.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from .columns import Columns

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
TINY = 1e-300  # length that stands for that of a column of zeros


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
    restraint : float
        Penalty on terms that cancel each other, see ``FractionalSettings``.
    restrained : ndarray of bool, shape (n_columns,)
        Terms that it counts.
    """

    def __init__(
        self,
        columns: list[Columns],
        y: list[Vector],
        weights: list[float],
        nonnegative: NDArray[np.bool_],
        restraint: float,
        restrained: NDArray[np.bool_],
    ) -> None:
        self._columns, self._nonnegative = columns, nonnegative
        self._restraint = restraint * restrained.astype(float)
        self._row_weights = np.concatenate([np.full(part.size, np.sqrt(w)) for part, w in zip(y, weights, strict=True)])
        self.y = self._row_weights * np.concatenate(y)
        self._wanted = np.append(self.y, restraint * np.linalg.norm(self.y))
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
        """Return the residuals and, last, the penalty [1]."""
        Phi, _, c = self.solve(theta)
        return np.asarray(np.vstack([Phi, self._cancelling(Phi, c)]) @ c - self._wanted)

    def jacobian(self, theta: Vector) -> Matrix:
        """Return the derivative of ``residual`` without its part along the columns, after Kaufman."""
        Phi, slopes, c = self.solve(theta)
        row = self._cancelling(Phi, c)
        acting = (c != 0.0) | ~(self._nonnegative | (self._restraint > 0.0))
        basis, _ = np.linalg.qr(np.vstack([Phi, row])[:, acting])
        growth = row / np.maximum(np.einsum("ij,ij->j", Phi, Phi), TINY)
        change = np.column_stack(
            [np.append(slope @ c, growth * np.einsum("ij,ij->j", Phi, slope) @ c) for slope in slopes]
        )
        return np.asarray(change - basis @ (basis.T @ change))

    def _cancelling(self, Phi: Matrix, c: Vector) -> Vector:
        """Return the row that adds up the sizes of the terms, shape (n_columns,)."""
        return np.asarray(self._restraint * np.sign(c) * np.linalg.norm(Phi, axis=0))

    def _coefficients(self, Phi: Matrix) -> Vector:
        """Solve for the coefficients, of columns scaled to unit length; a free one is a difference of two."""
        size = np.maximum(np.linalg.norm(Phi, axis=0), TINY)
        X = Phi / size
        if not (self._nonnegative.any() or self._restraint.any()):
            return np.asarray(np.linalg.lstsq(X, self.y, rcond=None)[0] / size)
        free = ~self._nonnegative
        both = np.vstack([np.hstack([X, -X[:, free]]), np.append(self._restraint, self._restraint[free])])
        found, _ = nnls(both, self._wanted, maxiter=10_000)
        c = found[: size.size]
        c[free] -= found[size.size :]
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
