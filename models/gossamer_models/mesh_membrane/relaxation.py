r"""Static equilibrium by dynamic relaxation, as part of ``init``.

Symbols: ``q`` displacements [m], ``v`` velocities [m/s], ``f`` forces [N], ``m`` masses [kg], ``h`` step [s], ``c`` damping
[1/s], ``omega`` lowest frequency in play [1/s], ``z`` all that a step of the relaxation remembers.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

LEVELS = 4  # at most 10^4 steps
TOLERANCE = 1e-13  # largest force left on a node, over the scale of forces
_STEP = 0.9  # of the stable step


def relax(
    balance: Callable[[ca.MX], tuple[ca.MX, ca.MX]],
    q: ca.MX,
    inverse_mass: ca.MX,
    scale: ca.MX,
    given: list[tuple[ca.MX, ca.MX]],
) -> ca.MX:
    r"""Write the equilibrium that damped motion reaches from ``q``.

    Parameters
    ----------
    balance : callable
        ``balance(q) -> (f, rate)``: forces [N], zero where held, and the bound of the squared highest frequency [1/s2].
    q : casadi.MX, shape (n,)
        Where to start; stays where it is held.
    inverse_mass : casadi.MX, shape (n,)
        One over the masses [1/kg].
    scale : casadi.MX, scalar
        Force [N] that ``TOLERANCE`` is a share of.
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
    n = q.numel()
    z, force = ca.MX.sym("z", 3 * n + 2), ca.MX.sym("scale")  # q, v, f, h of the step before, whether it has ended
    symbols, values = [symbol for symbol, _ in given] + [force], [value for _, value in given] + [scale]
    at, v, f_before, h_before, _ = ca.vertsplit(z, [0, n, 2 * n, 3 * n, 3 * n + 1, 3 * n + 2])
    f, rate = balance(at)
    h = 2.0 * _STEP / ca.sqrt(rate)
    energy = ca.dot(v, v / inverse_mass)
    omega2 = -ca.dot(v, f - f_before) / ca.fmax(h_before * energy, 1e-300)
    drag = h * ca.sqrt(ca.fmin(ca.fmax(omega2, 0.0), rate))
    moved = (1.0 - drag) / (1.0 + drag) * v + h / (1.0 + drag) * (f * inverse_mass)
    over = ca.norm_inf(f) <= TOLERANCE * force
    after = ca.vertcat(at + ca.if_else(over, 0.0, h) * moved, moved, f, h, over)
    step = ca.Function("relaxation_0", [z, *symbols], [after])
    kept = ca.Function("relaxation_over", [z, *symbols], [z])
    for level in range(LEVELS):
        end = z
        for _ in range(10):
            end = step(end, *symbols)
        ten = ca.Function(f"relaxation_ten_{level}", [z, *symbols], [end])
        unless = ca.Function.if_else(f"relaxation_unless_{level}", kept, ten)
        step = ca.Function(f"relaxation_{level + 1}", [z, *symbols], [unless(z[-1], z, *symbols)])
    end = step(ca.vertcat(q, ca.MX.zeros(2 * n + 2)), *values)
    return ca.if_else(end[-1] == 1.0, end[:n], float("nan"))
