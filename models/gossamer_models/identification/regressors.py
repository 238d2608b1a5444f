r"""What a record of strain does to the operators: the matrix in which the output is linear.

Symbols: ``s`` normalised strain [1], ``N`` lines, ``U``, ``D`` length of every cell (i, k >= i) of ``hysteresis.py`` that
has switched up and down so far [1], ``Z`` responses of one mode per decay rate :math:`\lambda` [1/s] and drive [1]; with
``mu``, ``nu = eta*mu`` the weights on the cells and ``w`` the weights of the modes,

.. math:: y = U\mu - D\nu + Z w + y_0,

Eqs. (4.7) and (4.13). Switching depends on strain alone, so U, D and Z are known before anything is fitted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

DRIVES = ("rising", "rising linear", "falling", "falling linear")
GAIN = "rising gain"  # extension: the response to rising strain, multiplied by the present strain


def switched(strain: Vector, n_lines: int) -> tuple[Matrix, Matrix]:
    """Return what has switched up and down until every sample.

    Parameters
    ----------
    strain : ndarray, shape (m,)
        Normalised strain [1] in 0..1; the record starts at rest at the first value.
    n_lines : int
        Number of lines N.

    Returns
    -------
    up, down : ndarray, shape (m, N (N + 1) / 2)
        Length of every cell (i, k >= i), in the order of ``numpy.triu_indices``, that has switched so far [1].
    """
    width = np.arange(n_lines) / n_lines
    fronts = np.empty((strain.size, n_lines))
    front = np.maximum(width, strain[0])
    for row, s in enumerate(strain):
        front = np.maximum(s, np.minimum(s + width, front))  # the play operator of ``hysteresis.move_fronts``
        fronts[row] = front
    i, k = np.triu_indices(n_lines)
    filled = np.clip(fronts[:, i] - k / n_lines, 0.0, 1.0 / n_lines)
    moved = np.diff(filled, axis=0)
    up = np.cumsum(np.vstack([filled[:1], np.maximum(moved, 0.0)]), axis=0)
    down = np.cumsum(np.vstack([0.0 * filled[:1], np.maximum(-moved, 0.0)]), axis=0)
    return up, down


def relaxed(time: Vector, strain: Vector, rates: Vector, drives: tuple[str, ...] = DRIVES[:2]) -> Matrix:
    r"""Return the responses of modes of unit weight.

    Parameters
    ----------
    time, strain : ndarray, shape (m,)
        Time [s], increasing, and normalised strain [1], linear between samples; no mode is excited before the first.
    rates : ndarray, shape (R,)
        Decay rates [1/s].
    drives : tuple of str, length d
        Which of ``DRIVES`` and ``GAIN``: while strain rises, or falls, a mode is driven by :math:`|\dot s|` or
        :math:`s|\dot s|`; responses of ``GAIN`` are multiplied by the strain of their sample.

    Returns
    -------
    ndarray, shape (m, d R)
        Responses [1], all rates of the first drive first.

    Notes
    -----
    Exact for strain linear over a step, as ``relaxation.rise``:
    :math:`\int_0^h (s_0 + \Delta\,\tau/h)\,(|\Delta|/h)\,e^{-\lambda(h-\tau)}\,d\tau
    = |\Delta|\,(s_0 \varphi_1 + \Delta\,\varphi_2)`.
    """
    steps, change = np.diff(time), np.diff(strain)
    x = steps[:, None] * rates
    phi_1 = -np.expm1(-x) / x
    phi_2 = np.where(x < 1e-4, 0.5 - x / 6.0, (1.0 - phi_1) / x)
    linear = strain[:-1, None] * phi_1 + change[:, None] * phi_2
    size = {"rising": np.maximum(change, 0.0), "falling": np.maximum(-change, 0.0)}
    parts = [size[drive.split()[0]][:, None] * (linear if "linear" in drive else phi_1) for drive in drives]
    gained, left = np.hstack(parts), np.tile(np.exp(-x), len(drives))
    Z = np.zeros((strain.size, gained.shape[1]))
    for k in range(steps.size):
        Z[k + 1] = left[k] * Z[k] + gained[k]
    scale = np.repeat([drive == GAIN for drive in drives], rates.size)
    return np.where(scale, strain[:, None] * Z, Z)
