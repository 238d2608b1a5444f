r"""Exact inverse of one sensor step with a fixed number of operations.

Symbols, all for rising strain (falling strain is its mirror image :math:`s \to 1 - s`, :math:`\mu \to \nu`): ``front[i]`` of
line i [1], not decreasing in i; ``m[i]`` weight below it [1]; ``C[i, l]`` weight of line i below strain l/N [1]; ``target``
rise of output that the new strain has to make [1].

The static rise :math:`F(s) = \sum_i \max(C_i(s) - m_i, 0)` bends only at the lattice l/N and at the fronts. Its
values on the lattice tell the interval; there every line that moves has a constant slope, and since the fronts are
sorted, prefix sums give F at each of them; on the last piece F plus the relaxation term is a quadratic, solved in closed
form.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ..sensor.hysteresis import offsets
from ..sensor.relaxation import excitation
from ..sensor.state import SensorLaw, SensorState

REACH_TOLERANCE = 1e-9  # a target this little [1] out of reach is rounding at the end of the range, not saturation


def invert(law: SensorLaw, state: SensorState, target: ca.MX, h: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Find the strain whose step changes the output by ``target``.

    Parameters
    ----------
    law : SensorLaw
        Physics of the sensor.
    state : SensorState
        Before the step.
    target : casadi.MX, scalar
        Output [1] minus static output minus decayed modes; positive means that strain rises.
    h : casadi.MX, scalar
        Step [s].

    Returns
    -------
    s : casadi.MX, scalar
        Normalised strain [1], in 0..1.
    unreachable : casadi.MX, scalar
        1 where no strain in 0..1 gives the target; ``s`` is then the nearer end.
    """
    n = law.n_lines
    up = target >= 0.0
    front = ca.if_else(up, state.front, 1.0 - state.front + offsets(n))
    s0 = ca.if_else(up, state.s, 1.0 - state.s)
    target = ca.fabs(target)
    first = second = 0.0
    if law.bank.size:
        rising = [ca.sum1(part) for part in excitation(law.bank, state.s, h, "rising")]
        falling = [-ca.sum1(part) for part in excitation(law.bank, state.s, h, "falling")]
        first, second = (ca.if_else(up, a, b) for a, b in zip(rising, falling, strict=True))

    def relaxation(s: ca.MX) -> ca.MX:
        delta = ca.fmax(s - s0, 0.0)
        return delta * (first + second * delta)

    # F on the lattice, both ways: the tables are constants, and choosing the sums is cheaper than choosing the tables
    mu, nu = law.mu, _mirror(law.nu)
    F = ca.if_else(up, _rise_on_lattice(mu, state.up), _rise_on_lattice(nu, nu.sum(axis=1) / n - state.down))
    grid = ca.DM(np.arange(n + 1) / n)
    reached = F + relaxation(grid) <= target
    unreachable = F[n] + relaxation(grid[n]) + REACH_TOLERANCE < target

    # interval l is the last one whose lower end is reached; the end of the range itself counts to the last interval
    here = ca.vertcat(1.0, reached[1:n]) - ca.vertcat(reached[1:n], 0.0)
    base = ca.fmax(ca.dot(grid[:n], here), s0)
    F = ca.dot(F[:n], here)
    slope = ca.mtimes(_sparse(mu), ca.if_else(up, here, 0.0)) + ca.mtimes(_sparse(nu), ca.if_else(up, 0.0, here))

    # lines join in the order of their fronts; each front that the target passes moves the start of the last piece
    fronts = ca.fmax(front, base)
    gaps = fronts[1:] - fronts[:-1]
    rises = ca.mtimes(_sparse(np.tri(n - 1)), slope[:-1]) * gaps
    passed = F + ca.mtimes(_sparse(np.tri(n - 1)), rises) + relaxation(fronts[1:]) <= target
    s = base + ca.dot(passed, gaps)
    c = slope[0] + ca.dot(passed, slope[1:]) + first + 2.0 * second * (s - s0)
    rest = ca.fmax(target - F - ca.dot(passed, rises) - relaxation(s), 0.0)
    s = ca.fmin(s + 2.0 * rest / (c + ca.sqrt(c * c + 4.0 * second * rest)), 1.0)
    return ca.if_else(up, s, 1.0 - s), unreachable


def _mirror(nu: np.ndarray) -> np.ndarray:
    """Turn a table over alpha into one over 1 - beta, line by line."""
    n = nu.shape[0]
    mirrored = np.zeros_like(nu)
    for i in range(n):
        mirrored[i, i:] = nu[i, i:][::-1]
    return mirrored


def _sparse(table: np.ndarray) -> ca.DM:
    return ca.sparsify(ca.DM(table))


def _rise_on_lattice(table: np.ndarray, m: ca.MX) -> ca.MX:
    """Return F at all points l/N, shape (N + 1,), from a table of slopes and the weights below the fronts."""
    n = table.shape[0]
    C = np.zeros((n, n + 1))
    C[:, 1:] = np.cumsum(table, axis=1) / n
    # line i has no operators below strain i/N and cannot move there
    point, line = np.nonzero(np.tri(n + 1, n))
    gain = ca.fmax(ca.DM(C[line, point]) - m[line.tolist()], 0.0)
    place = ca.Sparsity.triplet(n + 1, line.size, point.tolist(), list(range(line.size)))
    return ca.mtimes(ca.DM(place, 1.0), gain)
