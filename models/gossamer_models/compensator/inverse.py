r"""Exact inverse of one sensor step with a fixed number of operations.

Symbols, all for rising strain (falling strain is its mirror image :math:`s \to 1 - s`, :math:`\mu \to \nu`): ``front[i]`` of
line i [1], not decreasing in i; ``m[i]`` weight below it [1]; ``C[i, l]`` weight of line i below strain l/N [1]; ``target``
rise of output that the new strain has to make [1].

The static rise :math:`F(s) = \sum_i \max(m_i, C_i(s)) - \sum_i m_i` bends only at the lattice l/N and at the fronts. Its
values on the lattice tell the interval; there every line that moves has a constant slope, and since the fronts are
sorted, prefix sums give F at each of them; on the last piece F plus the relaxation term is a quadratic, solved in closed
form.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ..sensor.hysteresis import offsets
from ..sensor.relaxation import rise
from ..sensor.state import SensorLaw, SensorState

REACH_TOLERANCE = 1e-9  # a target this little [1] out of reach is rounding at the end of the range, not saturation


def invert(law: SensorLaw, state: SensorState, target: ca.SX, h: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Find the strain whose step changes the output by ``target``.

    Parameters
    ----------
    law : SensorLaw
        Physics of the sensor.
    state : SensorState
        Before the step.
    target : casadi.SX, scalar
        Output [1] minus static output minus decayed modes; positive means that strain rises.
    h : casadi.SX, scalar
        Step [s].

    Returns
    -------
    s : casadi.SX, scalar
        Normalised strain [1], in 0..1.
    unreachable : casadi.SX, scalar
        1 where no strain in 0..1 gives the target; ``s`` is then the nearer end.
    """
    n = law.n_lines
    up = target >= 0.0
    front = ca.if_else(up, state.front, 1.0 - state.front + offsets(n))
    s0 = ca.if_else(up, state.s, 1.0 - state.s)
    target = ca.fabs(target)

    # F on the lattice, both ways: the tables are constants, and choosing the sums is cheaper than choosing the tables
    mu, nu = law.mu, _mirror(law.nu)
    below = ca.if_else(up, _rise_on_lattice(mu, state.up), _rise_on_lattice(nu, nu.sum(axis=1) / n - state.down))
    grid = np.arange(n + 1) / n
    if law.bank.size:
        first, second = (ca.if_else(up, ca.sum1(part), 0.0) for part in rise(law.bank, state.s, h))
    else:
        first = second = ca.SX(0.0)

    def relaxation(s: ca.SX) -> ca.SX:
        delta = ca.fmax(s - s0, 0.0)
        return delta * (first + delta * second)

    reached = below + relaxation(ca.DM(grid)) <= target
    unreachable = below[n] + relaxation(ca.SX(1.0)) + REACH_TOLERANCE < target
    # interval l is the last one whose lower end is reached; the end of the range itself counts to the last interval
    within = [1.0 - reached[1], *(reached[ell] - reached[ell + 1] for ell in range(1, n - 1)), reached[n - 1]]
    here = ca.vertcat(*within)
    base = ca.fmax(ca.dot(ca.DM(grid[:n]), here), s0)
    F = ca.dot(below[:n], here)
    here_up = ca.if_else(up, here, 0.0)
    here_down = here - here_up
    slope = [ca.dot(ca.DM(mu[i, i:]), here_up[i:]) + ca.dot(ca.DM(nu[i, i:]), here_down[i:]) for i in range(n)]

    # lines join in the order of their fronts; each front that the target passes moves the start of the last piece
    at, Q = base, slope[0]
    s, F_s, Q_s = at, F, Q
    for i in range(1, n):
        following = ca.fmax(front[i], base)
        F = F + Q * (following - at)
        at, Q = following, Q + slope[i]
        passed = F + relaxation(at) <= target
        s, F_s, Q_s = (ca.if_else(passed, new, old) for new, old in ((at, s), (F, F_s), (Q, Q_s)))

    delta = ca.fmax(s - s0, 0.0)
    rest = ca.fmax(target - F_s - relaxation(s), 0.0)
    c = Q_s + first + 2.0 * second * delta
    s = ca.fmin(s + 2.0 * rest / (c + ca.sqrt(c * c + 4.0 * second * rest)), 1.0)
    return ca.if_else(up, s, 1.0 - s), unreachable


def _mirror(nu: np.ndarray) -> np.ndarray:
    """Turn a table over alpha into one over 1 - beta, line by line."""
    n = nu.shape[0]
    mirrored = np.zeros_like(nu)
    for i in range(n):
        mirrored[i, i:] = nu[i, i:][::-1]
    return mirrored


def _rise_on_lattice(table: np.ndarray, m: ca.SX) -> ca.SX:
    """Return F at all points l/N, shape (N + 1,), from a table of slopes and the weights below the fronts."""
    n = table.shape[0]
    C = np.zeros((n, n + 1))
    C[:, 1:] = np.cumsum(table, axis=1) / n
    total = ca.sum1(m)
    # line i has no operators below strain i/N: it keeps its weight there
    idle = ca.cumsum(m)
    rises = []
    for ell in range(n + 1):
        moving = min(ell + 1, n)
        rest = total - idle[moving - 1] if moving < n else 0.0
        rises.append(ca.sum1(ca.fmax(m[:moving], ca.DM(C[:moving, ell]))) + rest - total)
    return ca.vertcat(*rises)
