r"""How a record is weighed: by the covariance of its noise, white or coloured, and of errors of the model.

Symbols: ``s`` sensors, ``n`` samples; ``phi`` correlation of the noise in neighbouring samples [1].
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.linalg import matmul_toeplitz, toeplitz

from ..arrays import Matrix, Rows, Vector

NEGLIGIBLE = 1e-9  # of the largest eigenvalue: directions that gaps leave without values; of the noise's variance
SLIGHT = 1e-4  # of the largest variance: modes of a process below it are left out
ROUNDED = 1e-14  # of the largest eigenvalue: what round-off leaves of it


class RecordWeights:
    r"""Weigh by the covariance of noise and of components beside it.

    Parameters
    ----------
    present : ndarray of bool, shape (s, n)
        Where the record has values.
    noise : ndarray, shape (s,)
        Standard deviations, in the unit of the record.
    components : ndarray, shape (k, s, n)
        Of an error of the model, in the unit of the record; their outer products add up to its covariance.
    splines : ndarray, shape (n, splines), or None
        Functions of time on which alone the record is compared; None to compare all of it.
    own : ndarray, shape (f, s, n), or None
        Components too, but those of a sensor know nothing of those of another; None for none.
    follows : ndarray, shape (s,), or float
        Correlation of the noise in neighbouring samples [1]; 0 for white noise.

    Attributes
    ----------
    values : int
        Independent numbers that are compared.
    of_sensors : list of slice
        Which of them belong to each sensor.
    log_determinant : float
        Of the covariance, in units of the noise's.

    Notes
    -----
    Coloured noise is a Markov chain: :math:`x_i` of deviation s after :math:`x_{i-1}`, g samples before, has the mean
    :math:`\varphi^g x_{i-1}` and the variance :math:`s^2 (1 - \varphi^{2g})`, whatever the gap. On splines it is weighed by
    its covariance there: weighed before, what is faster than the splines would not be left out.
    """

    def __init__(
        self,
        present: Rows,
        noise: Vector,
        components: Matrix,
        splines: Matrix | None = None,
        own: Matrix | None = None,
        follows: Vector | float = 0.0,
    ) -> None:
        self._present, self._bases = present, list[Matrix]()
        self._scale = np.where(present, 1.0 / np.where(present, noise[:, None], 1.0), 0.0)
        each = list(zip(present, np.broadcast_to(follows, len(present)).tolist(), strict=True))
        chains = [phi ** np.diff(np.flatnonzero(row), prepend=-np.inf) for row, phi in each]  # nothing before the first
        self._chain = np.concatenate(chains)
        determinant = 0.0 if splines is not None else float(np.log1p(-(self._chain**2)).sum())
        for row, phi in each if splines is not None else ():
            seen = splines * row[:, None]
            e, V = np.linalg.eigh(seen.T @ seen)
            good = e > max(NEGLIGIBLE * e[-1], 1e-300)
            basis = seen @ (V[:, good] / np.sqrt(e[good]))
            if phi and basis.size:
                L = np.linalg.cholesky(basis.T @ matmul_toeplitz(phi ** np.arange(len(row)), basis))
                basis, determinant = np.linalg.solve(L, basis.T).T, determinant + 2.0 * float(np.log(np.diag(L)).sum())
            self._bases.append(basis)
        self.values = sum(basis.shape[1] for basis in self._bases) if self._bases else int(present.sum())
        last = np.cumsum([basis.shape[1] for basis in self._bases] or present.sum(axis=1)).tolist()
        self.of_sensors = [slice(*ends) for ends in pairwise([0, *last])]
        self._along = list[tuple[slice, Matrix, Vector]]()
        if own is not None:
            scaled = self._project(own)
            self._along = [(values, *_modes(scaled[:, values])) for values in self.of_sensors]
        self._along.append((slice(None), *_modes(self.weigh(components))))
        self.log_determinant = determinant - 2.0 * float(sum(np.log1p(-less).sum() for _, _, less in self._along))

    def weigh(self, y: Matrix) -> Matrix:
        """Turn rows of readings, shape (m, s, n), into independent numbers of variance 1, shape (m, values)."""
        scaled = self._project(y)
        for values, along, less in self._along:
            scaled[:, values] -= (scaled[:, values] @ along.T * less) @ along
        return scaled

    def _project(self, y: Matrix) -> Matrix:
        scaled = np.where(self._present, y, 0.0) * self._scale
        if not self._bases:
            values = scaled[:, self._present]
            if self._chain.any():
                values = (values - self._chain * np.roll(values, 1, axis=1)) / np.sqrt(1.0 - self._chain**2)
            return np.asarray(values)
        return np.concatenate([scaled[:, k] @ basis for k, basis in enumerate(self._bases)], axis=1)


def scale_evidence(G: Matrix, b: Vector, scales: Vector) -> Vector:
    r"""Return twice the logarithm of the evidence of scales of components over that of none, shape (scales,).

    Parameters
    ----------
    G : ndarray, shape (k, k)
        Products of the components, weighed by the covariance of all else.
    b : ndarray, shape (k,)
        Their products with the residuals.
    scales : ndarray, shape (scales,)
        Deviations that all coefficients of the components may have [1].

    Notes
    -----
    :math:`2 \log p = \sum_i s^2 c_i^2 / (1 + s^2 g_i) - \log(1 + s^2 g_i)` over the modes of G, with c = b along them.
    """
    g, V = np.linalg.eigh(G)
    g, c, s2 = np.maximum(g, 0.0), V.T @ b, scales[:, None] ** 2
    return np.asarray(np.sum(s2 * c**2 / (1.0 + s2 * g) - np.log1p(s2 * g), axis=1))


def process_of(spectrum: Vector) -> tuple[Vector, Matrix]:
    """Return variances and modes of n samples of a stationary process, of its power at n + 1 frequencies."""
    n = spectrum.size - 1
    variance, modes = np.linalg.eigh(toeplitz(np.fft.irfft(spectrum)[:n] / n))
    return variance, modes


def process_like(y: Matrix) -> Matrix:
    """Return components of a stationary process of each row, with the spectrum of its values about their mean, (k, s, n)."""
    moving, n = y - y.mean(axis=1, keepdims=True), y.shape[1]
    found = [process_of(np.abs(np.fft.rfft(row, 2 * n)) ** 2) for row in moving]
    k = max(int((variance > SLIGHT * variance.max()).sum()) for variance, _ in found)  # the largest come last
    return np.stack([(modes * np.sqrt(np.maximum(variance, 0.0)))[:, n - k :].T for variance, modes in found], axis=1)


def _modes(components: Matrix) -> tuple[Matrix, Vector]:
    """Return orthonormal modes of components beside white noise, shape (k, values), and what weighing takes from each."""
    square, modes = np.linalg.eigh(components @ components.T)  # there are fewer components than values
    seen = square > max(NEGLIGIBLE, ROUNDED * square.max(initial=0.0))
    return (modes[:, seen] / np.sqrt(square[seen])).T @ components, 1.0 - 1.0 / np.sqrt(1.0 + square[seen])
