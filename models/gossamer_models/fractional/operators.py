r"""Fractional integral and derivative of a sampled record, at a cost that is linear in its length.

Symbols: :math:`u_m` samples, ``h`` sampling step [s], :math:`a` order [1], :math:`z_q` modes of a bank with rates
:math:`\lambda_q` and weights :math:`g_q` (see ``modes/power_law.py``).

The operators are those of Riemann and Liouville, Eqs. (3.1) and (3.2) of [1]_. They differ from Caputo's in one term:
the derivative of a record that does not start at zero begins with :math:`u_0 t^{-a}/\Gamma(1-a)`, which is infinite
at t = 0.

References
----------
.. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
   Sensors, dissertation, Virginia Tech, 2010, Chapter 3.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
from scipy.special import gamma

from ..arrays import Matrix, Vector
from ..errors import DataError
from ..modes import PowerLawKernels, phi_1, phi_2, responses
from ..modes.power_law import check_order

_x = ca.SX.sym("x")
_PHI_SLOPES = ca.Function("slopes", [_x], [ca.jacobian(phi(_x), _x) for phi in (phi_1, phi_2)])


def integral(u: Vector, h: float, order: float, kernels: PowerLawKernels | None = None) -> Vector:
    r"""Return :math:`J^a u` [unit of u times s**order], Eq. (3.2) of [1]_, shape (m,).

    Parameters
    ----------
    u : ndarray, shape (m,)
        Samples; for a record linear in between, the result is exact up to the relative error of the kernel, 1e-6.
    h : float
        Sampling step [s].
    order : float
        :math:`a` [1], 0 < a < 1.
    kernels : PowerLawKernels or None
        Kernels to use; None for those that the record needs.

    Raises
    ------
    ParameterError
        The order is outside 0..1.
    DataError
        The record is not one column of finite numbers, or ``kernels`` do not cover it.
    """
    kernels = covering(u, h, kernels)
    g, mass = kernels.at_order(order)
    return weighed(integral_modes, u, h, kernels.rates, g) + mass * started(u)


def derivative(u: Vector, h: float, order: float, kernels: PowerLawKernels | None = None) -> Vector:
    r"""Return :math:`D^a u` [unit of u times s**-order], Eq. (3.1) of [1]_, shape (m,); arguments as in ``integral``.

    Notes
    -----
    :math:`D^a u = J^{1-a} \dot u + u_0 t^{-a}/\Gamma(1-a)`, with :math:`\dot u` constant over a sample. The value at
    t = 0 is zero if the record starts at zero, else infinite.
    """
    kernels = covering(u, h, kernels)
    check_order(order)
    g, mass = kernels.at_order(1.0 - order)
    slope = np.diff(u, prepend=u[:1]) / h
    return weighed(slope_modes, u - u[0], h, kernels.rates, g) + mass * slope + initial_term(u, h, order)


def initial_term(u: Vector, h: float, order: float) -> Vector:
    r"""Return :math:`u_0 t^{-a}/\Gamma(1-a)`, shape (m,), Eq. (3.11): the term of the derivative from the first sample."""
    if u[0] == 0.0:
        return np.zeros(u.size)
    t = h * np.arange(1, u.size)
    return np.asarray(u[0] * np.concatenate([[np.inf], t**-order / gamma(1.0 - order)]))


def quadrature(u: Vector) -> Vector:
    r"""Return the record with each Fourier component turned back by a quarter: cos -> sin, sin -> -cos; shape (m,).

    Notes
    -----
    The Hilbert transform: :math:`\epsilon_{Ph}` of Eq. (3.18) of [1]_ for b = -1. It needs the whole record and takes it as
    one period: not causal, offline only.
    """
    from scipy.signal import hilbert  # slow to import

    return np.asarray(np.imag(hilbert(u)))


def integral_modes(u: Vector, h: float, rates: Vector) -> Matrix:
    r"""Return the modes :math:`\int_0^t e^{-\lambda_q (t-\tau)} u\,d\tau` [unit of u times s] of a record, shape (m, n)."""
    return responses(h, u, rates, [(h, 1)])


def slope_modes(u: Vector, h: float, rates: Vector) -> Matrix:
    r"""Return the modes of the slope, of a record that jumps from zero to its first sample at t = 0, shape (m, n).

    :math:`z_q(t) = u_0 e^{-\lambda_q t} + \int_0^t e^{-\lambda_q (t - \tau)} \dot u\,d\tau` [unit of u].
    """
    jump = u[0] * np.exp(-h * np.outer(np.arange(u.size), rates)) if u[0] else 0.0
    return responses(h, u, rates, [(np.diff(u), 0)]) + jump


def fading_integral(s: Vector, h: float, rate: float, exponent: float) -> tuple[Vector, Vector, Vector]:
    r"""Return :math:`\int_0^t e^{-p(t-\tau)} s^q\,d\tau` [s] and its derivatives by rate p and exponent q, shape (m,).

    The power is linear between samples. The thesis uses the trapezoidal rule for the whole integrand, Eq. (3.20), which
    fails if :math:`p h` is not small; with :math:`s^q` as in Eq. (3.15). Negative strain counts as zero.
    """
    x, logs = ca.DM(rate * h), np.log(np.maximum(s, 1e-300))
    power = np.where(s > 0.0, np.exp(exponent * logs), 0.0)
    value, by_exponent = (integral_modes(u, h, np.array([rate]))[:, 0] for u in (power, logs * power))
    slope_1, slope_2 = (float(each) for each in _PHI_SLOPES(x))
    left = np.exp(-rate * h)
    from scipy.signal import lfilter  # slow to import

    gained = h**2 * ((slope_1 - slope_2) * power[:-1] + slope_2 * power[1:]) - h * left * value[:-1]
    return value, np.concatenate([[0.0], lfilter([1.0], [1.0, -left], gained)]), by_exponent


def weighed(modes: Callable[[Vector, float, Vector], Matrix], u: Vector, h: float, rates: Vector, w: Vector) -> Vector:
    """Return the sum of modes with weights ``w``, shape (m,); one mode is kept at a time."""
    return np.asarray(sum((w[q] * modes(u, h, rates[[q]])[:, 0] for q in range(rates.size)), np.zeros(u.size)))


def started(u: Vector) -> Vector:
    """Return the record with a zero for its first sample: nothing is remembered at t = 0."""
    return np.concatenate([[0.0], u[1:]])


def covering(u: Vector, h: float, kernels: PowerLawKernels | None) -> PowerLawKernels:
    """Return kernels that cover a record; check both."""
    if u.ndim != 1 or u.size < 2 or not (np.isfinite(u).all() and 0.0 < h < np.inf):
        msg = f"need a record of two or more finite samples and a positive step [s], not shape {u.shape} every {h!r} s"
        raise DataError(msg)
    lasts = h * (u.size - 1)
    if kernels is None:
        return PowerLawKernels(h, max(lasts, 2.0 * h))
    if h < 0.999 * kernels.shortest or lasts > 1.001 * kernels.longest:
        msg = (
            f"a record of {lasts:g} s in steps of {h:g} s is outside the memory of {kernels.shortest:g} s to "
            f"{kernels.longest:g} s. Widen the range of the memory."
        )
        raise DataError(msg)
    return kernels
