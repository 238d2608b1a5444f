r"""First-order low-pass on the resistance.

Symbols: ``R`` resistance and ``Rf`` what passes [ohm], ``T`` filter time [s], ``h`` step [s].
"""

from __future__ import annotations

import casadi as ca

from ..modes import phi_1
from ..variables import Variable

SHORTEST_FILTER_TIME = 1e-300  # [s]; stands for 0

FILTER_TIME = Variable(
    name="filter_time",
    causality="parameter",
    unit="s",
    description="Time constant of a first-order low-pass on the resistance; 0 switches it off",
    start=0.0,
    minimum=0.0,
    nominal=1.0,
)


def low_pass(Rf: ca.MX, last: ca.MX, R: ca.MX, T: ca.MX, h: ca.MX) -> ca.MX:
    r"""Return what passes at the end of a step [ohm].

    Parameters
    ----------
    Rf, last : casadi.MX, scalar
        What passes and the resistance itself at the start of the step [ohm].
    R : casadi.MX, scalar
        Resistance [ohm] at its end.
    T, h : casadi.MX, scalar
        Filter time, 0 for none, and step [s].

    Notes
    -----
    :math:`T \dot R_f = R - R_f`, exact for resistance linear over the step.
    """
    ratio = h / ca.fmax(T, SHORTEST_FILTER_TIME)
    left, mean = ca.exp(-ratio), phi_1(ratio)
    return left * Rf + (mean - left) * last + (1.0 - mean) * R
