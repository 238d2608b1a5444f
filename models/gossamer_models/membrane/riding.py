r"""A membrane on a mesh on a frame that flies: its nodes for the expressions of ``membrane.frame``.

Symbols: ``q`` displacements [m] of all nodes and ``s`` their velocities [m/s] less that of the frame's origin, zero where
they are held, shape (3 N,); ``r`` positions from the frame's origin [m], shape (3, N), in the axes of the mesh; ``f`` forces
[N]; ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from ..variables import Values
from .equations import Forces
from .frame import FrameState, FrameStep, Nodes, frame_results, mounting, wrench

Pulled = Callable[[ca.MX], tuple[Forces, ca.MX, ca.MX]]


@dataclass(frozen=True, slots=True)
class Ride:
    """The membrane after a step on its frame.

    Attributes
    ----------
    q, s : casadi.MX, shape (3 N,)
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
    """The nodes of a membrane on a mesh on a frame.

    Parameters
    ----------
    p : SimpleNamespace
        Parameters by name, those of the frame included.
    rest : casadi.MX, shape (3, N)
        Positions [m] without displacements, from the origin of the mesh.
    free : casadi.MX, shape (3 N,)
        1 where a node may move, 0 where it is held.
    mass : casadi.MX, shape (3 N,)
        Mass of its node [kg], for each displacement.
    """

    def __init__(self, p: Values, rest: ca.MX, free: ca.MX, mass: ca.MX) -> None:
        self._p, self._mount = p, mounting(p)
        self._origin = rest[:, 0] - self._mount.positions(rest[:, 0])  # of the mesh, less that of the frame
        self._rest = self._mount.positions(rest)
        self._free, self._pull = ca.reshape(free, 3, -1), ca.reshape(free / mass, 3, -1)
        self._held = 1.0 - self._free
        m, moves = mass[0::3].T, free[0::3].T
        self._m, self._m_held = m * moves, m * (1.0 - moves)

    def start(self, q: ca.MX, found: Forces, f: ca.MX, gas: ca.MX, u: Values) -> Ride:
        """Begin at rest relative to the frame."""
        w = ca.mtimes(self._mount.axes.T, u.angular_velocity)
        r = self._rest + ca.reshape(q, 3, -1)
        s = self._free * ca.mtimes(ca.skew(w), r)
        state = FrameState(w, w, ca.MX.zeros(6), ca.MX(0.0))
        reaction = self._reaction(r, found, ca.reshape(f, 3, -1), ca.MX.zeros(*s.shape))
        return Ride(q, ca.vec(s), state, found, gas, self._results(r, s, reaction))

    def advance(self, q: ca.MX, s: ca.MX, state: FrameState, pulled: Pulled, u: Values, h: ca.MX) -> Ride:
        """Advance by one step; ``pulled`` gives the forces at positions from the origin of the mesh."""
        frame = FrameStep.of(state, u, self._mount, h)
        r, s = frame.to_middle(self._rest + ca.reshape(q, 3, -1), ca.reshape(s, 3, -1))
        r = self._kept(r)
        found, f, gas = pulled(ca.vec(r + ca.repmat(self._origin, 1, r.shape[1])))
        f = ca.reshape(f, 3, -1)
        s, v = frame.kick(r, s, self._pull * f, self._p.mass_damping)
        s = self._free * s
        state, reaction = frame.pass_on(self._reaction(r, found, f, v))
        r, s = frame.to_end(r, s)
        r = self._kept(r)
        results = self._results(r, s, reaction)
        return Ride(ca.vec(r - self._rest), ca.vec(s), state, found, gas, results)

    def _kept(self, r: ca.MX) -> ca.MX:
        """Leave held nodes where the frame holds them."""
        return self._free * r + self._held * self._rest

    def _results(self, r: ca.MX, s: ca.MX, reaction: ca.MX) -> dict[str, ca.MX]:
        return {**frame_results(self._mount, Nodes(r, self._m), s, Nodes(self._rest, self._m_held), reaction)}

    def _reaction(self, r: ca.MX, found: Forces, f: ca.MX, v: ca.MX) -> ca.MX:
        """Write force [N] and torque [N m] on the frame, shape (6,), with velocities ``v`` relative to it, shape (3, N).

        Notes
        -----
        As for the square membrane: what the elements pull at the held nodes, and the drag. Enclosed gas pushes the frame the
        other way than the membrane.
        """
        drag = wrench(r, self._p.mass_damping * ca.repmat(self._m, 3, 1) * v)
        pressure = wrench(r, ca.reshape(found.f, 3, -1))  # of all nodes, where the elements' own forces cancel
        return wrench(r, self._held * f) + drag - self._p.enclosed_pressure * pressure
