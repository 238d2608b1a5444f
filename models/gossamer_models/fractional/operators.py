r"""Fractional integral and derivative of a sampled record, in time that grows with its length only.

Symbols: :math:`u_m` samples, ``h`` sampling step [s], :math:`a` order [1], :math:`z_q` modes of a bank with rates
:math:`\lambda_q` and weights :math:`g_q` (see ``kernels.py``), :math:`x = \lambda h`.

The operators are those of Riemann and Liouville, Eqs. (3.1) and (3.2) of [1]_. They differ from Caputo's in one term:
the derivative of a record that does not start at zero begins with :math:`u_0 t^{-a}/\Gamma(1-a)`, which is infinite
at t = 0.

References
----------
.. [1] M. R. Sunny, dissertation, Virginia Tech, chapter 3.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.signal import hilbert, lfilter
from scipy.special import gamma

from ..errors import DataError
from ..sensor.relaxation import phi_1, phi_2
from .kernels import ModeGrid, at_order, check_order

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def integral(u: Vector, h: float, order: float, grid: ModeGrid | None = None) -> Vector:
    r"""Return :math:`J^a u` [unit of u times s**order], Eq. (3.2), shape (m,).

    Parameters
    ----------
    u : ndarray, shape (m,)
        Samples; linear in between, which the result is exact for, up to the relative error of the kernel, 1e-6.
    h : float
        Sampling step [s].
    order : float
        :math:`a` [1], 0 < a < 1.
    grid : ModeGrid or None
        Rates; None for those that the record needs.

    Raises
    ------
    ParameterError
        The order is outside 0..1.
    DataError
        The record is not one column of finite numbers, or ``grid`` does not cover it.
    """
    grid = grid_of(u, h, grid)
    g, mass = at_order(grid, order)
    return weighed_modes(u, h, grid.rates, g) + mass * started(u)


def derivative(u: Vector, h: float, order: float, grid: ModeGrid | None = None) -> Vector:
    r"""Return :math:`D^a u` [unit of u times s**-order], Eq. (3.1), shape (m,); arguments as of ``integral``.

    Notes
    -----
    :math:`D^a u = J^{1-a} \dot u + u_0 t^{-a}/\Gamma(1-a)`, with :math:`\dot u` constant over a sample. The value at
    t = 0 is zero if the record starts at zero, else infinite.
    """
    grid = grid_of(u, h, grid)
    check_order(order)
    g, mass = at_order(grid, 1.0 - order)
    slope = np.diff(u, prepend=u[:1]) / h
    found = sum(g[q] * _rise_mode(u, h, rate, 0.0) for q, rate in enumerate(grid.rates)) + mass * slope
    return np.asarray(found + initial_term(u, h, order))


def initial_term(u: Vector, h: float, order: float) -> Vector:
    r"""Return :math:`u_0 t^{-a}/\Gamma(1-a)`, shape (m,), Eq. (3.11): what the derivative keeps of the first sample."""
    if u[0] == 0.0:
        return np.zeros(u.size)
    t = h * np.arange(1, u.size)
    return np.asarray(u[0] * np.concatenate([[np.inf], t**-order / gamma(1.0 - order)]))


def quadrature(u: Vector) -> Vector:
    r"""Return the record with each Fourier component turned back by a quarter: cos -> sin, sin -> -cos; shape (m,).

    Notes
    -----
    The Hilbert transform. It needs the whole record and takes it as one period: not causal, offline only.
    """
    return np.asarray(np.imag(hilbert(u)))


def modes(u: Vector, h: float, rates: Vector) -> Matrix:
    r"""Return the modes :math:`\int_0^t e^{-\lambda_q (t-\tau)} u\,d\tau` [unit of u times s] of a record, shape (m, n)."""
    return np.column_stack([_mode(u, h, rate) for rate in rates])


def rise_modes(u: Vector, h: float, rates: Vector) -> Matrix:
    r"""Return the modes of the slope, of a record that jumps from zero to its first sample at t = 0, shape (m, n).

    :math:`z_q(t) = u_0 e^{-\lambda_q t} + \int_0^t e^{-\lambda_q (t - \tau)} \dot u\,d\tau` [unit of u].
    """
    return np.column_stack([_rise_mode(u, h, rate, u[0]) for rate in rates])


def weighed_modes(u: Vector, h: float, rates: Vector, weights: Vector) -> Vector:
    """Return the weighted sum of ``modes``, shape (m,), without keeping them."""
    return np.asarray(sum((g * _mode(u, h, rate) for g, rate in zip(weights, rates, strict=True)), np.zeros(u.size)))


def started(u: Vector) -> Vector:
    """Return the record with a zero for its first sample: nothing is remembered at t = 0."""
    return np.concatenate([[0.0], u[1:]])


def grid_of(u: Vector, h: float, grid: ModeGrid | None) -> ModeGrid:
    """Return rates that cover a record; check both."""
    if u.ndim != 1 or u.size < 2 or not (np.isfinite(u).all() and 0.0 < h < np.inf):
        msg = f"need a record of two or more finite samples and a positive step [s], not shape {u.shape} every {h!r} s"
        raise DataError(msg)
    lasts = h * (u.size - 1)
    if grid is None:
        return ModeGrid(h, max(lasts, 2.0 * h))
    if h < 0.999 * grid.shortest or lasts > 1.001 * grid.longest:
        msg = (
            f"a record of {lasts:g} s in steps of {h:g} s is outside the memory of {grid.shortest:g} s to "
            f"{grid.longest:g} s. Widen its range of times."
        )
        raise DataError(msg)
    return grid


def _mode(u: Vector, h: float, rate: float) -> Vector:
    x = ca.DM(rate * h)
    late = h * float(phi_2(x))
    early = h * float(phi_1(x)) - late
    found, _ = lfilter([late, early], [1.0, -np.exp(-rate * h)], u, zi=[-late * u[0]])
    return np.asarray(found)


def _rise_mode(u: Vector, h: float, rate: float, start: float) -> Vector:
    rises = np.diff(u, prepend=u[:1])
    rises[0] = start / float(phi_1(ca.DM(rate * h)))
    return np.asarray(lfilter([float(phi_1(ca.DM(rate * h)))], [1.0, -np.exp(-rate * h)], rises))
