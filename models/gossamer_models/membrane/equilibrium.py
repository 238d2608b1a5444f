r"""Static equilibrium by dynamic relaxation, as part of ``init``.

Symbols: ``q`` displacements [m], ``v`` velocities [m/s], ``f`` forces [N], ``m`` masses [kg], ``h`` step [s], ``c`` damping
[1/s], ``omega`` lowest frequency in play [1/s], ``z`` q, v and f of the step before.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

LEVELS = 5  # at most 10^5 steps
TOLERANCE = 1e-13  # largest force left on a node, over the scale of forces
_STEP = 0.9  # of the stable step


def relax(
    balance: Callable[[ca.MX], tuple[ca.MX, ca.MX, ca.MX]],
    q: ca.MX,
    mass: ca.MX,
    given: list[tuple[ca.MX, ca.MX]],
) -> ca.MX:
    r"""Write the equilibrium that damped motion reaches from ``q``.

    Parameters
    ----------
    balance : callable
        ``balance(q) -> (f, rate, scale)``: forces [N], zero where held, the bound of the squared highest frequency [1/s2],
        and the force [N] that ``TOLERANCE`` is a share of.
    q : casadi.MX, shape (n,)
        Where to start; stays where it is held.
    mass : casadi.MX, shape (n,)
        Masses [kg].
    given : list of (casadi.MX, casadi.MX)
        Symbols that ``balance`` depends on beside its argument, with their values.

    Returns
    -------
    casadi.MX, shape (n,)
        Not a number if the steps are not enough.

    Notes
    -----
    Central differences with the damping :math:`c = 2\omega`, critical for the lowest mode in play, whose frequency is the
    Rayleigh quotient of the velocity, :math:`\omega^2 = -v \cdot \Delta f/(h\,v \cdot m v)`, as in [1]_. Once the forces
    are small enough, all steps that are left are skipped, so that a membrane in equilibrium costs one evaluation.

    References
    ----------
    .. [1] P. Underwood, Dynamic relaxation, in: T. Belytschko, T. J. R. Hughes (eds.), Computational Methods for Transient
       Analysis, North-Holland, 1983, 245-265.
    """
    n, symbols, values = q.numel(), [symbol for symbol, _ in given], [value for _, value in given]
    at, v, f_before = z = [ca.MX.sym(name, n) for name in ("q", "v", "f")]
    h_before, ended = rest = [ca.MX.sym("h"), ca.MX.sym("ended")]
    f, rate, scale = balance(at)
    h = 2.0 * _STEP / ca.sqrt(rate)
    energy = ca.dot(v, mass * v)
    omega2 = -ca.dot(v, f - f_before) / ca.fmax(h_before * energy, 1e-300)
    drag = h * ca.sqrt(ca.fmin(ca.fmax(omega2, 0.0), rate))
    moved = (1.0 - drag) / (1.0 + drag) * v + h / (1.0 + drag) * f / mass
    over = ca.norm_inf(f) <= TOLERANCE * scale
    inputs = [*z, *rest, *symbols]
    step = ca.Function("relaxation_0", inputs, [at + ca.if_else(over, 0.0, h) * moved, moved, f, h, over])
    kept = ca.Function("relaxation_over", inputs, [*z, *rest])
    for level in range(LEVELS):
        end = [*z, *rest]
        for _ in range(10):
            end = step.call([*end, *symbols])
        ten = ca.Function(f"relaxation_ten_{level}", inputs, end)
        unless = ca.Function.if_else(f"relaxation_unless_{level}", kept, ten)
        step = ca.Function(f"relaxation_{level + 1}", inputs, unless.call([ended, *inputs]))
    q, _, _, _, ended = step.call([q, ca.MX.zeros(n), ca.MX.zeros(n), 0.0, 0.0, *values])
    return ca.if_else(ended == 1.0, q, float("nan"))
