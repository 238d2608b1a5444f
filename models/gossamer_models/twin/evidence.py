r"""What windows of readings say together: how far each load is off, and whether damage has begun in one of the last.

Symbols: ``l`` loads, ``z`` zones; ``r`` residuals in units of the noise and ``J`` their derivatives; ``A`` = sum of J^T J
and ``g`` = sum of J^T r over the windows, first the factors of the loads, then z damages for each onset.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Matrix, Vector

NEGLIGIBLE = 1e-10  # of the largest eigenvalue


class Evidence:
    r"""Sums over windows, and Rao's score statistic of new damage.

    Parameters
    ----------
    loads, zones : int
        Numbers l and z.
    deviation : float
        Prior's standard deviation of the factor of a load, less 1 [1].

    Attributes
    ----------
    score : float
        Statistic over its mean while nothing changes.
    freedom : int
        Degrees of freedom of its chi2 distribution.
    factors : ndarray, shape (l,)
        By how much each load is larger than known [1], if no damage has begun.

    Notes
    -----
    Damage that begins at one of some onsets, and in parts at many, is linear in the z damages of each onset. With d damages,
    a factors, the statistic is :math:`g^T A^{-1} g` of both less that of the factors alone [1]_. A window says nothing of
    damage that begins after it, so what is said of the oldest onsets goes with their rows and columns, exactly.

    References
    ----------
    .. [1] C. R. Rao, Mathematical Proceedings of the Cambridge Philosophical Society 44(1), 50-57, 1948,
       doi:10.1017/S0305004100023987.
    """

    def __init__(self, loads: int, zones: int, deviation: float) -> None:
        self._A, self._g = np.eye(loads) / deviation**2, np.zeros(loads)
        self._loads, self._zones = loads, zones
        self.score, self.freedom, self.factors = 0.0, 1, np.zeros(loads)

    def add(self, r: Vector, J: Matrix, kept: int) -> None:
        """Add a window.

        Parameters
        ----------
        r : ndarray, shape (n,)
            Residuals.
        J : ndarray, shape (n, l + (kept + new) z)
            Derivatives by the factors of the loads, and by the damages since each onset.
        kept : int
            How many of the latest onsets are known from earlier windows.
        """
        stay = np.r_[: self._loads, len(self._g) - kept * self._zones : len(self._g)]
        new = (0, J.shape[1] - stay.size)
        self._A = np.pad(self._A[np.ix_(stay, stay)], new) + J.T @ J
        self._g = np.pad(self._g[stay], new) + J.T @ r
        e, V = np.linalg.eigh(self._A)
        seen = e > NEGLIGIBLE * e[-1]
        self.freedom = max(1, int(seen.sum()) - self._loads)
        of_all = V[:, seen].T @ self._g
        part = slice(self._loads)
        self.factors = np.asarray(np.linalg.solve(self._A[part, part], self._g[part]))
        self.score = float(of_all**2 @ (1.0 / e[seen]) - self._of(part)) / self.freedom

    def likeliest(self) -> int:
        """Return which onset explains most if all damage began there."""
        firsts = range(self._loads, len(self._g), self._zones)
        return int(np.argmax([self._of(slice(first, first + self._zones)) for first in firsts]))

    def forget(self, factors: Vector) -> None:
        """Forget all onsets; the factors of the loads are those that are given, and as certain as they are."""
        self._A = self._A[: self._loads, : self._loads]
        self._g = self._A @ factors

    def _of(self, part: slice) -> float:
        g = self._g[part]
        return float(g @ np.linalg.pinv(self._A[part, part], hermitian=True) @ g)
