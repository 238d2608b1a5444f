r"""Separable least squares: every step of the search for the other parameters eliminates the linear coefficients.

Symbols: ``y`` weighted measurement, ``Phi`` weighted columns, ``c`` coefficients, :math:`\theta` parameters of the
columns. For every :math:`\theta` the best ``c`` is the solution of a linear, bounded problem; the search minimizes
:math:`r(\theta) = \Phi(\theta)\,c(\theta) - y` and one row more, a penalty on columns that cancel each other:
:math:`\rho\,(\sum_k |c_k|\,\|\Phi_k\| - \|y\|)`, with :math:`\rho` the ``restraint``. This is variable projection [1]_
with the Jacobian of [2]_.

``constrained.py`` solves the Preisach problem, whose coefficients obey general inequalities and whose columns are fixed;
here coefficients obey signs and a penalty, and columns such as :math:`s^q` depend on :math:`\theta`: neither method can do
the other's work.

References
----------
.. [1] G. H. Golub, V. Pereyra, SIAM Journal on Numerical Analysis 10(2), 413-432, 1973, doi:10.1137/0710036.
.. [2] L. Kaufman, BIT Numerical Mathematics 15, 49-57, 1975, doi:10.1007/BF01932995.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from ..arrays import Matrix, Rows, Vector

# the columns that an element of theta moves, shape (k,), and their derivatives, shape (m, k)
Derivative = tuple[NDArray[np.int_], Matrix]
ColumnFunction = Callable[[Vector], tuple[Matrix, Callable[[], list[Derivative]]]]
TINY = 1e-300  # in place of the length of a column of zeros


class SeparableProblem:
    r"""Residuals with the coefficients eliminated.

    Parameters
    ----------
    columns : callable
        :math:`\theta` to the columns, shape (m, n), and a function that returns the derivatives by each element of
        :math:`\theta`: which columns it moves, shape (k,), and their derivatives, shape (m, k).
    y : ndarray, shape (m,)
        Measurement that the columns add up to.
    weights : ndarray, shape (m,), or float
        Weights of the squared residuals.
    nonnegative : ndarray of bool, shape (n,), or bool
        Coefficients that may not be negative.
    restraint : float
        Penalty on columns that cancel each other.
    restrained : ndarray of bool, shape (n,), or bool
        Columns that the penalty counts.
    """

    def __init__(
        self,
        columns: ColumnFunction,
        y: Vector,
        *,
        weights: Vector | float = 1.0,
        nonnegative: Rows | bool = True,
        restraint: float = 0.0,
        restrained: Rows | bool = True,
    ) -> None:
        self._columns, self._nonnegative = columns, np.asarray(nonnegative)
        self._restraint = restraint * np.asarray(restrained, dtype=float)
        self._root = np.broadcast_to(np.sqrt(weights), y.shape)
        self.y = self._root * y
        self._wanted = np.append(self.y, restraint * np.linalg.norm(self.y))
        self._last: tuple[Vector, Callable[[], list[Derivative]], Matrix, Vector] | None = None

    def solve(self, theta: Vector) -> tuple[Matrix, Vector]:
        """Return the weighted columns and the best coefficients."""
        return self._solved(theta)[2:]

    def derivatives(self, theta: Vector) -> list[Derivative]:
        """Return the derivatives of the weighted columns."""
        return [(where, self._root[:, None] * each) for where, each in self._solved(theta)[1]()]

    def coefficients(self, theta: Vector) -> Vector:
        """Return the best coefficients, shape (n,)."""
        return self.solve(theta)[1]

    def residual(self, theta: Vector) -> Vector:
        """Return the residuals and, last, the penalty [1]."""
        Phi, c = self.solve(theta)
        return np.asarray(np.vstack([Phi, self._cancelling(Phi, c)]) @ c - self._wanted)

    def jacobian(self, theta: Vector, *, released: bool = False) -> Matrix:
        """Return the derivative of ``residual`` without its part along the columns.

        Columns whose coefficient is held at zero do not count; with ``released`` they do, which converges faster where
        columns are so alike that one takes up what another leaves.
        """
        Phi, c = self.solve(theta)
        row = self._cancelling(Phi, c)
        acting = (c != 0.0) | ~(self._nonnegative | (self._restraint > 0.0)) | released
        basis, _ = np.linalg.qr(np.vstack([Phi, row])[:, acting])
        growth = row * c / np.maximum(np.einsum("ij,ij->j", Phi, Phi), TINY)
        derivatives = self.derivatives(theta)
        change = np.empty((len(basis), len(derivatives)))
        for i, (k, slope) in enumerate(derivatives):
            change[:-1, i] = slope @ c[k]
            change[-1, i] = growth[k] @ np.einsum("ij,ij->j", Phi[:, k], slope)
        return np.asarray(change - basis @ (basis.T @ change))

    def _solved(self, theta: Vector) -> tuple[Vector, Callable[[], list[Derivative]], Matrix, Vector]:
        """Return the last solution where it is that of the same point."""
        if self._last is None or not np.array_equal(self._last[0], theta):
            columns, derive = self._columns(theta)
            Phi = self._root[:, None] * columns
            self._last = theta.copy(), derive, Phi, self._best(Phi)
        return self._last

    def _cancelling(self, Phi: Matrix, c: Vector) -> Vector:
        """Return the row that adds up the sizes of the columns, shape (n,)."""
        return np.asarray(self._restraint * np.sign(c) * np.linalg.norm(Phi, axis=0))

    def _best(self, Phi: Matrix) -> Vector:
        """Solve for the coefficients, of columns scaled to unit length; a free one is a difference of two."""
        size = np.maximum(np.linalg.norm(Phi, axis=0), TINY)
        X = Phi / size
        nonnegative, restraint = (np.broadcast_to(each, size.shape) for each in (self._nonnegative, self._restraint))
        if not (nonnegative.any() or restraint.any()):
            return np.asarray(np.linalg.lstsq(X, self.y, rcond=None)[0] / size)
        free = ~nonnegative
        both = np.vstack([np.hstack([X, -X[:, free]]), np.append(restraint, restraint[free])])
        solved, _ = nnls(both, self._wanted, maxiter=10_000)
        c = solved[: size.size]
        c[free] -= solved[size.size :]
        return np.asarray(c / size)
