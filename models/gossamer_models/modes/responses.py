r"""Responses of exponential modes to a record, exact for records linear between samples.

Symbols: ``u`` record, :math:`\Delta` its change over a step, ``h`` step [s], :math:`\lambda` decay rate [1/s],
:math:`x = \lambda h` [1], ``r`` size of the excitation over a step,

.. math:: z(t + h) = e^{-x} z(t) + r\,\varphi_1(x) \quad\text{or}\quad
          z(t + h) = e^{-x} z(t) + r\,[u\,\varphi_1(x) + \Delta\,\varphi_2(x)].

Excitation is of power 0 or 1 in the record. With :math:`r = \max(\Delta, 0)` these are the relaxation modes of a sensor,
Eq. (4.13) of the thesis; with :math:`r = \Delta`, power 0, the modes of a fractional derivative, and with
:math:`r = h`, power 1, those of a fractional integral.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Matrix, Vector

SERIES_BELOW = 0.5
SERIES_TERMS = 14


def phi_1(x: ca.MX) -> ca.MX:
    r"""Return :math:`\varphi_1(x) = (1 - e^{-x})/x` for x > 0 without cancellation."""
    return -ca.expm1(-x) / x


def phi_2(x: ca.MX) -> ca.MX:
    r"""Return :math:`\varphi_2(x) = (x - 1 + e^{-x})/x^2` for x > 0: a series where the difference would cancel."""
    small = ca.fmin(x, SERIES_BELOW)
    series = 1.0
    for k in reversed(range(SERIES_TERMS - 1)):
        series = 1.0 - small / (k + 3) * series
    return ca.if_else(x < SERIES_BELOW, 0.5 * series, (1.0 - phi_1(x)) / x)


def responses(steps: ArrayLike, u: Vector, rates: Vector, excitations: Sequence[tuple[ArrayLike, int]]) -> Matrix:
    r"""Return the modes of a record at its samples; all are zero at the first one.

    Parameters
    ----------
    steps : array_like, shape (m - 1,) or scalar
        Steps between samples [s]; a scalar for equal ones, which cost less.
    u : ndarray, shape (m,)
        Record.
    rates : ndarray, shape (n,)
        Decay rates [1/s].
    excitations : sequence of (array_like, {0, 1}), length d
        Sizes :math:`r` over each step, shape (m - 1,) or scalar, and power of the record.

    Returns
    -------
    ndarray, shape (m, d n)
        All rates of the first excitation first.
    """
    x = np.asarray(steps, dtype=float).reshape(-1, 1) * rates
    kernels = [phi_1(ca.DM(x)).full()]
    if any(power for _, power in excitations):
        kernels.append(u[:-1, None] * kernels[0] + np.diff(u)[:, None] * phi_2(ca.DM(x)).full())
    sizes = [np.broadcast_to(size, (u.size - 1,))[:, None] for size, _ in excitations]
    gained = np.hstack(
        [np.empty((u.size - 1, 0)), *(r * kernels[p] for r, (_, p) in zip(sizes, excitations, strict=True))]
    )
    left = np.tile(np.exp(-x), len(excitations))
    Z = np.zeros((u.size, gained.shape[1]))
    if len(left) == 1:
        from scipy.signal import lfilter  # slow to import

        for q in range(Z.shape[1]):
            Z[1:, q] = lfilter([1.0], [1.0, -left[0, q]], gained[:, q])
    else:
        for k in range(u.size - 1):
            Z[k + 1] = left[k] * Z[k] + gained[k]
    return Z
