r"""How residuals are weighed: by their noise alone, or by noise and model error on splines in time.

Symbols: ``r`` residuals in units of the noise, where the record has values; ``Phi`` splines there; ``beta`` components of
the model error in the same units; ``S`` covariance of the projected residuals :math:`\Phi^T r`:

.. math:: S = \Phi^T\Phi + \Phi^T\beta\,\beta^T\Phi.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from ..arrays import Matrix, Rows, Vector
from .discrepancy import spline_matrix
from .record import N_SENSORS

NEGLIGIBLE = 1e-9  # of the largest eigenvalue: directions that gaps leave without values


class NoiseWeights:
    """Divide by the noise.

    Parameters
    ----------
    present : ndarray of bool, shape (4, n)
        Where the record has values.
    noise : ndarray, shape (4,)
        Standard deviations, in the unit of the record.
    """

    def __init__(self, present: Rows, noise: Vector) -> None:
        self._present = present
        self._sigma = np.repeat(noise[:, None], present.shape[1], axis=1)[present]
        self.values = int(present.sum())

    def weigh(self, y: Matrix) -> Matrix:
        """Turn rows of readings, shape (m, 4, n), into independent numbers of variance 1, shape (m, values)."""
        return np.asarray(y[:, self._present] / self._sigma)


class SplineWeights:
    """Project on splines in time, then weigh by the covariance of noise and model error.

    Parameters
    ----------
    present : ndarray of bool, shape (4, n)
        Where the record has values.
    noise : ndarray, shape (4,)
        Standard deviations, in the unit of the record.
    error : ndarray, shape (k, 4, n)
        Components of the model error, in the unit of the record.
    h, length : float
        Step of the record and time that the model error is known for [s].
    """

    def __init__(self, present: Rows, noise: Vector, error: Matrix, h: float, length: float) -> None:
        steps = present.shape[1]
        self._scale = np.where(present, 1.0 / np.where(present, noise[:, None], 1.0), 0.0)
        self._splines = spline_matrix(steps, h, length)
        self._splines = self._splines[:, self._splines.any(axis=0)]
        blocks = [self._splines.T @ (row[:, None] * self._splines) for row in present]
        projected = self._project(error)
        S = scipy.linalg.block_diag(*blocks) + projected.T @ projected
        e, V = np.linalg.eigh(S)
        good = e > NEGLIGIBLE * e[-1]
        self._whiten = V[:, good] / np.sqrt(e[good])
        self.values = int(good.sum())

    def weigh(self, y: Matrix) -> Matrix:
        """Turn rows of readings, shape (m, 4, n), into independent numbers of variance 1, shape (m, values)."""
        return np.asarray(self._project(y) @ self._whiten)

    def _project(self, y: Matrix) -> Matrix:
        scaled = np.where(self._scale > 0.0, y, 0.0) * self._scale
        return np.asarray((scaled @ self._splines).reshape(len(y), N_SENSORS * self._splines.shape[1]))
