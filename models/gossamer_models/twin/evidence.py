r"""What windows of readings say together: what does not change, and whether damage has begun since one of some onsets.

Symbols: ``p`` unknowns that last, in units of their priors' deviations, ``z`` zones, ``m`` onsets; ``r`` residuals in units
of the noise and ``J`` their derivatives; ``A`` = sum of J^T J and ``g`` = sum of J^T r over the windows, first the unknowns
that last, then z damages for each onset.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from ..arrays import Matrix, Vector

NEGLIGIBLE = 1e-9  # of its curvature: what the unknowns that last leave of a damage that they explain


class Evidence:
    r"""Sums over windows, and Rao's score statistics of new damage.

    Parameters
    ----------
    mean : ndarray, shape (p,)
        Of the prior of the unknowns that last, whose deviations are 1.
    zones : int
        Number z.

    Attributes
    ----------
    lasting : ndarray, shape (p,)
        Unknowns that last, if no damage has begun.
    scores : ndarray, shape (m, z)
        Statistic of damage of one zone that began at one onset: chi2 of one degree of freedom while nothing changes.
    curvature : ndarray, shape (m, z)
        What this damage [1] adds to its own statistic, over its square; 0 where unknowns that last explain it.

    Notes
    -----
    Damage that begins at one of some onsets is linear in the z damages of each onset. With a damage c beside the unknowns
    that last, it is
    :math:`(g_c - A_{cp} A_{pp}^{-1} g_p)^2 / (A_{cc} - A_{cp} A_{pp}^{-1} A_{pc})` [1]_. A window
    says nothing of damage that begins after it, so an onset is forgotten with its rows and columns.

    References
    ----------
    .. [1] C. R. Rao, Mathematical Proceedings of the Cambridge Philosophical Society 44(1), 50-57, 1948,
       doi:10.1017/S0305004100023987.
    """

    def __init__(self, mean: Vector, zones: int) -> None:
        self._A, self._g, self._p, self._z = np.eye(mean.size), mean.copy(), mean.size, zones
        self.lasting, self.scores, self.curvature = mean.copy(), np.zeros((0, zones)), np.zeros((0, zones))

    def add(self, r: Vector, J: Matrix, stay: NDArray[np.int64]) -> None:
        """Add a window.

        Parameters
        ----------
        r : ndarray, shape (n,)
            Residuals.
        J : ndarray, shape (n, p + m z)
            Derivatives by the unknowns that last, and by the damages since each onset: those that stay, then new ones.
        stay : ndarray of int
            Which of the onsets before stay, from 0.
        """
        p, z = self._p, self._z
        rows = np.r_[:p, (p + z * stay[:, None] + np.arange(z)).ravel()]
        new = (0, J.shape[1] - rows.size)
        self._A = np.pad(self._A[np.ix_(rows, rows)], new) + J.T @ J
        self._g = np.pad(self._g[rows], new) + J.T @ r
        factor = scipy.linalg.cho_factor(self._A[:p, :p], lower=True)
        self.lasting = scipy.linalg.cho_solve(factor, self._g[:p])
        beside = self._A[:p, p:]
        S = self._A[p:, p:] - beside.T @ scipy.linalg.cho_solve(factor, beside)
        left, size = self._g[p:] - beside.T @ self.lasting, np.diag(S)
        seen = size > NEGLIGIBLE * np.diag(self._A)[p:]
        self.scores = np.where(seen, left**2 / np.where(seen, size, 1.0), 0.0).reshape(-1, z)
        self.curvature = np.where(seen, size, 0.0).reshape(-1, z)

    @property
    def precision(self) -> Matrix:
        """Inverse of the covariance of the unknowns that last, shape (p, p)."""
        return self._A[: self._p, : self._p].copy()

    def recentre(self, moves: Vector) -> None:
        """Count the first unknowns that last from a point that is moved, by what residuals have lost."""
        self._g = self._g - self._A[:, : moves.size] @ moves
        self.lasting = self.lasting - np.pad(moves, (0, self._p - moves.size))

    def forget(self, lasting: Vector) -> None:
        """Forget all onsets; the unknowns that last are those that are given, and as certain as they are."""
        self._A = self._A[: self._p, : self._p]
        self._g = self._A @ lasting
