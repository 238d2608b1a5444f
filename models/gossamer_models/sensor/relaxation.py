r"""Dynamic relaxation operators as a bank of exponential modes.

Symbols: ``z[q]`` mode [1], :math:`\lambda_q` decay rate [1/s], :math:`g_q, k_q` drive [1]; while strain rises,

.. math:: \dot z_q = -\lambda_q z_q + (g_q + k_q s)\,\dot s, \qquad f_d = \sum_q z_q,

which is Eq. (4.13) with :math:`A = a\zeta^d`, d = 0 (:math:`g`) or 1 (:math:`k`), and the stretched exponentials replaced by
sums. Falling strain drives nothing in the thesis. As an extension it drives the same modes with amplitudes of its own,
:math:`(g'_q + k'_q s)\,|\dot s|`: carbon-black sensors jump up when unloading begins. As another, modes ``g`` of the same
law are multiplied by the present strain, :math:`f_d = \sum_q z_q + s \sum_q g_q`: the loops of silver thread grow from cycle
to cycle. ``x`` = :math:`\lambda h` [1]. The step is exact for strain linear over it.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .artifact import RelaxationTerm

SMALLEST = 1e-300
SERIES_BELOW = 0.5
SERIES_TERMS = 14


@dataclass(frozen=True, slots=True)
class ModeBank:
    """Rates and drives of all relaxation modes.

    Attributes
    ----------
    decay_rates : ndarray, shape (n,)
        Rates [1/s], increasing, all different.
    constant, linear : ndarray, shape (n,)
        Drives per unit of rising strain [1]: independent of strain, and proportional to it.
    falling_constant, falling_linear : ndarray, shape (n,)
        The same for falling strain.
    """

    decay_rates: NDArray[np.float64]
    constant: NDArray[np.float64]
    linear: NDArray[np.float64]
    falling_constant: NDArray[np.float64]
    falling_linear: NDArray[np.float64]

    @classmethod
    def of(cls, terms: tuple[RelaxationTerm, ...]) -> ModeBank:
        """Collect the exponentials of all terms; equal rates share one mode."""
        drives: dict[float, list[float]] = {}
        for term in terms:
            for rate, weight in zip(term.decay_rates, term.weights, strict=True):
                place = term.power + 2 * (term.drive == "falling")
                drives.setdefault(rate, [0.0] * 4)[place] += term.amplitude * weight
        kept = sorted((rate, *four) for rate, four in drives.items() if any(four))
        table = np.array(kept, dtype=float).reshape(len(kept), 5)
        return cls(*table.T)

    @property
    def size(self) -> int:
        """Number of modes."""
        return int(self.decay_rates.size)

    @property
    def falls(self) -> bool:
        """Tell whether falling strain drives a mode."""
        return bool(self.falling_constant.any() or self.falling_linear.any())

    @property
    def signed(self) -> bool:
        """Tell whether a mode may be negative."""
        drives = (self.constant, self.linear, self.falling_constant, self.falling_linear)
        return any((drive < 0.0).any() for drive in drives)


def relax(bank: ModeBank, z: ca.MX, start: ca.MX, end: ca.MX, h: ca.MX) -> ca.MX:
    """Advance the modes [1], shape (n,), by ``h`` [s] in which strain moves linearly from ``start`` to ``end`` [1]."""
    z = decay(bank, z, h)
    if bank.size:
        delta = ca.fmax(end - start, 0.0)
        first, second = rise(bank, start, h)
        z = z + delta * (first + delta * second)
    if bank.falls:
        delta = ca.fmax(start - end, 0.0)
        first, second = fall(bank, start, h)
        z = z + delta * (first + delta * second)
    return z


def decay(bank: ModeBank, z: ca.MX, h: ca.MX) -> ca.MX:
    """Let the modes [1], shape (n,), decay for ``h`` seconds at constant strain.

    They end in zero: subnormal numbers, which processors are slow with, would stay for hours of a simulated hold.
    """
    left = ca.exp(-ca.DM(bank.decay_rates) * h) * z
    if bank.signed:
        return ca.if_else(ca.fabs(left) > SMALLEST, left, 0.0)
    return ca.fmax(left - SMALLEST, 0.0)


def rise(bank: ModeBank, start: ca.MX, h: ca.MX) -> tuple[ca.MX, ca.MX]:
    r"""Prepare what a linear rise within one step leaves in the modes.

    Parameters
    ----------
    bank : ModeBank
        Rates and drives.
    start : casadi.MX, scalar
        Normalised strain [1] at the start of the step.
    h : casadi.MX, scalar
        Step [s].

    Returns
    -------
    first, second : casadi.MX, shape (n,)
        A rise by :math:`\Delta \ge 0` adds :math:`\Delta\,(first + \Delta\,second)` to the modes [1]; both are not negative.

    Notes
    -----
    :math:`\int_0^h (g + k(s + \Delta\,\tau/h))\,(\Delta/h)\,e^{-\lambda(h - \tau)}\,d\tau
    = \Delta\,(g + k s)\,\varphi_1(\lambda h) + \Delta^2 k\,\varphi_2(\lambda h)`. The printed Eq. (5.3) takes operators
    switched in the last step undecayed, :math:`\varphi_1 = 1`; exact is as cheap, and a ramp may then be cut into any steps.
    """
    x = ca.DM(bank.decay_rates) * h
    first = (ca.DM(bank.constant) + ca.DM(bank.linear) * start) * phi_1(x)
    if not bank.linear.any():
        return first, ca.DM.zeros(bank.size)
    return first, ca.DM(bank.linear) * phi_2(x)


def fall(bank: ModeBank, start: ca.MX, h: ca.MX) -> tuple[ca.MX, ca.MX]:
    r"""Prepare what a linear fall within one step leaves in the modes: ``rise`` for falling strain.

    Returns
    -------
    first, second : casadi.MX, shape (n,)
        A fall by :math:`\Delta \ge 0` adds :math:`\Delta\,(first + \Delta\,second)` to the modes [1].

    Notes
    -----
    :math:`\int_0^h (g' + k'(s - \Delta\,\tau/h))\,(\Delta/h)\,e^{-\lambda(h - \tau)}\,d\tau
    = \Delta\,(g' + k' s)\,\varphi_1(\lambda h) - \Delta^2 k'\,\varphi_2(\lambda h)`.
    """
    x = ca.DM(bank.decay_rates) * h
    first = (ca.DM(bank.falling_constant) + ca.DM(bank.falling_linear) * start) * phi_1(x)
    return first, -ca.DM(bank.falling_linear) * phi_2(x)


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
