r"""The nodes of a membrane on a frame that flies, for the expressions of ``frame``.

Symbols: ``q`` displacements [m] of the M nodes that move and ``s`` their velocities [m/s] less that of the frame's origin,
node by node, shape (3 M,), in the membrane's axes; ``r`` positions from the frame's origin [m] and ``f`` forces [N] by
columns; ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from ..variables import Values
from .assembly import Forces
from .frame import Columns, FrameState, FrameStep, Nodes, cross, frame_results, mounting, total, wrench

Pulled = Callable[[ca.MX], tuple[Forces, ca.MX, ca.MX]]


@dataclass(frozen=True, slots=True)
class Ride:
    """The membrane after a step on its frame.

    Attributes
    ----------
    q, s : casadi.MX, shape (3 M,)
        Displacements [m] and velocities [m/s].
    frame : FrameState
        What is known of the frame.
    found : Forces
        What the elements gave.
    gas : casadi.MX, scalar
        Pressure of the gas [Pa].
    results : dict
        See ``frame.frame_results``.
    """

    q: ca.MX
    s: ca.MX
    frame: FrameState
    found: Forces
    gas: ca.MX
    results: dict[str, ca.MX]


class Rider:
    """The nodes of a membrane on a frame.

    Parameters
    ----------
    p : SimpleNamespace
        Parameters by name, those of the frame included.
    rest : casadi.MX, shape (3 N,)
        Positions [m] without displacements, from the membrane's origin, first of the nodes that move.
    mass : casadi.MX, shape (N,)
        Masses [kg].
    n_q : int
        Number of displacements, 3 M.
    """

    def __init__(self, p: Values, rest: ca.MX, mass: ca.MX, n_q: int) -> None:
        self._p, self._mount, self._n_q = p, mounting(p), n_q
        self._rest, self._fixed = _columns(rest[:n_q]), rest[n_q:]
        self._shift = self._mount.shift
        self._m = mass[: n_q // 3]
        self._held = Nodes(self._from_frame(_columns(self._fixed)), mass[n_q // 3 :])

    def start(self, q: ca.MX, found: Forces, f: ca.MX, gas: ca.MX, u: Values) -> Ride:
        """Begin at rest relative to the frame."""
        w = ca.mtimes(self._mount.axes.T, u.angular_velocity)
        r = self._places(q)
        s = cross([w[i] for i in range(3)], r)
        state = FrameState(w, w, ca.MX.zeros(6), ca.MX(0.0))
        reaction = self._reaction(r, found, f, [ca.MX.zeros(self._n_q // 3)] * 3)
        return Ride(q, _vector(s), state, found, gas, self._results(r, s, reaction))

    def advance(self, q: ca.MX, s: ca.MX, state: FrameState, pulled: Pulled, u: Values, h: ca.MX) -> Ride:
        """Advance by one step; ``pulled`` gives the forces at positions from the membrane's origin."""
        frame = FrameStep.of(state, u, self._mount, h)
        r, velocity = frame.drift(self._places(q), _columns(s))
        from_own = [x - self._shift[i] for i, x in enumerate(r)]
        found, f, gas = pulled(ca.vertcat(_vector(from_own), self._fixed))
        pull = [x / self._m for x in _columns(f[: self._n_q])]
        velocity, relative = frame.kick(r, velocity, pull, self._p.mass_damping)
        state, reaction = frame.pass_on(self._reaction(r, found, f, relative))
        r, velocity = frame.drift(r, velocity)
        moved = [x - self._shift[i] - self._rest[i] for i, x in enumerate(r)]
        return Ride(_vector(moved), _vector(velocity), state, found, gas, self._results(r, velocity, reaction))

    def _from_frame(self, own: Columns) -> Columns:
        return [x + self._shift[i] for i, x in enumerate(own)]

    def _places(self, q: ca.MX) -> Columns:
        return self._from_frame([x + y for x, y in zip(self._rest, _columns(q), strict=True)])

    def _results(self, r: Columns, s: Columns, reaction: ca.MX) -> dict[str, ca.MX]:
        return frame_results(self._mount, Nodes(r, self._m), s, self._held, reaction)

    def _reaction(self, r: Columns, found: Forces, f: ca.MX, v: Columns) -> ca.MX:
        """Write force [N] and torque [N m] on the frame, shape (6,), with velocities ``v`` relative to it.

        Notes
        -----
        The frame takes what pulls at the held nodes, and the drag. That is the load less the change of the membrane's
        momentum, since the elements' own forces add up to nothing. Of all nodes they add up to the load, of which enclosed
        gas pushes the frame the other way than the membrane.
        """
        n, shed = self._n_q, self._p.enclosed_pressure
        moving, held = _columns(found.f[:n]), _columns(f[n:] - shed * found.f[n:])
        drag = [self._p.mass_damping * self._m * x for x in v]
        on_moving = [x - shed * y for x, y in zip(drag, moving, strict=True)]
        return total(wrench(r, on_moving)) + total(wrench(self._held.r, held))


def _columns(x: ca.MX) -> Columns:
    return [x[axis::3] for axis in range(3)]


def _vector(columns: Columns) -> ca.MX:
    return ca.vec(ca.horzcat(*columns).T)
