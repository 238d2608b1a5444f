r"""The kernel of fractional operators, a power of time, as a sum of exponentials on fixed rates.

Symbols: :math:`a` order [1], 0 < a < 1; :math:`\lambda_q` decay rate [1/s]; :math:`g_q` weight [s**(a - 1)] of mode q;
:math:`c` mass [s**a] of the part of the kernel that decays within any step; :math:`\Delta` spacing of the rates [1].
For :math:`t` from ``shortest`` to ``longest``,

.. math:: \frac{t^{a-1}}{\Gamma(a)} = \frac{\sin \pi a}{\pi} \int_{-\infty}^{\infty} e^{(1-a)x}\,e^{-e^x t}\,dx
          \approx \sum_q g_q(a)\,e^{-\lambda_q t}, \qquad \lambda_q = e^{x_q}.

It is the kernel of Eqs. (3.1) and (3.2) of the thesis. The rates do not depend on the order: all terms of a model share one
bank of modes, and whatever is linear in the weights is differentiable in the order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ..arrays import Vector
from ..errors import ParameterError

SPACING = 0.55  # of the logarithms of the rates: the trapezoidal rule errs by about exp(-pi**2 / SPACING)
SLOWEST = 0.006  # slowest rate times longest time: the sum of all slower modes is a straight line up to there
FASTEST = 20.0  # least product of fastest rate and shortest time: faster modes decay within one step
STANDING = 1e-9  # rate times longest time of the mode that represents a constant


@dataclass(frozen=True)
class PowerLawKernels:
    """Fixed decay rates that represent the kernels of all orders.

    Attributes
    ----------
    shortest, longest : float
        Range of times [s] in which the relative error of the kernel is at most 1e-6. ``shortest`` is also the shortest
        ramp of an input that the memory resolves; it smooths shorter ones.
    """

    shortest: float
    longest: float

    def __post_init__(self) -> None:
        if not (0.0 < self.shortest < self.longest < np.inf):
            msg = f"a memory cannot run from {self.shortest:g} s to {self.longest:g} s: need 0 < shortest < longest"
            raise ParameterError(msg)

    @cached_property
    def rates(self) -> Vector:
        """Decay rates [1/s], increasing; the first one represents zero."""
        low, high = np.log(SLOWEST / self.longest), np.log(FASTEST / self.shortest)
        n = int(np.ceil((high - low) / SPACING))
        return np.concatenate([[STANDING / self.longest], np.exp(high - SPACING * np.arange(n, -1, -1))])

    @cached_property
    def weights(self) -> ca.Function:
        r"""Weights of the modes as a function of the order, ``a -> g``, differentiable.

        The result has one element more than ``rates``: the last is the mass :math:`c`. All are positive.

        Notes
        -----
        Trapezoidal rule in :math:`x = \ln\lambda`, spectrally accurate [1]_. Modes faster than the grid are lumped
        into its fastest mode and a mass, which keeps the integral and the first moment of the kernel: the response to
        an input that is linear over ``shortest`` or longer stays correct. Modes slower than the grid are lumped into
        its slowest mode and a constant, which keeps value and slope. Both sums are geometric series.

        References
        ----------
        .. [1] G. Beylkin, L. Monzón, Applied and Computational Harmonic Analysis 28(2), 131-149, 2010,
           doi:10.1016/j.acha.2009.08.011.
        """
        a = ca.SX.sym("a")
        slow, fast = float(self.rates[1]), float(self.rates[-1])

        def tail(rate: float, power: ca.SX) -> ca.SX:
            """Sum of rate**power over a grid that begins at ``rate`` and runs to where the power vanishes."""
            return rate**power / (1.0 - ca.exp(-SPACING * ca.fabs(power)))

        value, slope = tail(slow, 1.0 - a), tail(slow, 2.0 - a)
        mass, moment = tail(fast, -a), tail(fast, -1.0 - a)
        g = ca.vertcat(
            value - slope / slow,
            slope / slow,
            ca.DM(self.rates[2:-1]) ** (1.0 - a),
            moment * fast**2,
            mass - moment * fast,
        )
        return ca.Function("weights", [a], [SPACING * ca.sin(np.pi * a) / np.pi * g])

    def at_order(self, order: float) -> tuple[Vector, float]:
        """Return the weights [s**(order - 1)], shape (n,), and the mass [s**order] of the kernel of one order.

        Raises
        ------
        ParameterError
            The order is outside 0..1.
        """
        check_order(order)
        g = np.array(self.weights(order)).ravel()
        return g[:-1], float(g[-1])


def check_order(order: float) -> None:
    """Raise ``ParameterError`` unless 0 < order < 1."""
    if not 0.0 < order < 1.0:
        msg = f"the order is {order:g}; a fractional operator needs 0 < order < 1"
        raise ParameterError(msg)
