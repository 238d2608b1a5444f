r"""The square membrane on a frame that flies: its nodes for the expressions of ``frame``.

Symbols: ``q`` displacements [m] of the interior nodes and ``s`` their velocities [m/s] less that of the frame's origin,
shape (n_q,), in the membrane's axes, whose own origin is its centre; ``f`` forces [N] on all nodes, shape (3, nodes);
``r`` positions from the frame's origin [m], shape (3, N); ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..variables import Values
from .assembly import MembraneEquations
from .frame import FrameState, FrameStep, Nodes, frame_results, mounting, wrench
from .params import stretch

Force = Callable[[ca.MX], tuple[ca.MX, ca.MX, ca.MX]]  # of q: forces on all nodes, and what else is found


@dataclass(frozen=True, slots=True)
class Ride:
    """The membrane after a step on its frame.

    Attributes
    ----------
    q, s : casadi.MX, shape (n_q,)
        Displacements [m] and velocities [m/s].
    frame : FrameState
        What is known of the frame.
    wave, strain : casadi.MX, scalar
        See ``MembraneEquations.force_expression``.
    results : dict
        See ``frame.frame_results``.
    """

    q: ca.MX
    s: ca.MX
    frame: FrameState
    wave: ca.MX
    strain: ca.MX
    results: dict[str, ca.MX]


class MountedMembrane:
    """The nodes of a square membrane on a frame.

    Parameters
    ----------
    equations : MembraneEquations
        Mesh and masses.
    p : SimpleNamespace
        Parameters by name, those of the frame included.
    """

    def __init__(self, equations: MembraneEquations, p: Values) -> None:
        mesh, self._p = equations.mesh, p
        self._interior, self._edge = mesh.interior.tolist(), equations.edge.tolist()
        self.mount = mounting(p)
        plane = np.column_stack([mesh.nodes - 0.5, np.zeros(len(mesh.nodes))]).T
        self._rest = self.mount.positions(stretch(p) * p.side_length * ca.MX(ca.DM(plane)))
        mass = p.density * p.thickness * p.side_length**2
        self._m, held = (mass * ca.MX(ca.DM(area)).T for area in (equations.node_area, equations.edge_area))
        self.held = Nodes(self._rest[:, self._edge], held)

    def start(self, q: ca.MX, force: Force, u: Values) -> Ride:
        """Begin at rest relative to the frame."""
        w = ca.mtimes(self.mount.axes.T, u.angular_velocity)
        free = self._free(q)
        s, (f, wave, strain) = ca.mtimes(ca.skew(w), free.r), force(q)
        state = FrameState(w, w, ca.MX.zeros(6), ca.MX(0.0))
        reaction = self._reaction(free, ca.reshape(f, 3, -1), ca.MX.zeros(*s.shape))
        return Ride(q, ca.vec(s), state, wave, strain, frame_results(self.mount, free, s, self.held, reaction))

    def advance(self, q: ca.MX, s: ca.MX, state: FrameState, force: Force, u: Values, h: ca.MX) -> Ride:
        """Advance by one step."""
        frame, at_rest = FrameStep.of(state, u, self.mount, h), self._rest[:, self._interior]
        r, s = frame.to_middle(self._free(q).r, ca.reshape(s, 3, -1))
        f, wave, strain = force(ca.vec(r - at_rest))
        f = ca.reshape(f, 3, -1)
        pull = f[:, self._interior] / ca.repmat(self._m, 3, 1)
        s, v = frame.kick(r, s, pull, self._p.mass_damping)
        state, reaction = frame.pass_on(self._reaction(Nodes(r, self._m), f, v))
        r, s = frame.to_end(r, s)
        results = frame_results(self.mount, Nodes(r, self._m), s, self.held, reaction)
        return Ride(ca.vec(r - at_rest), ca.vec(s), state, wave, strain, results)

    def _free(self, q: ca.MX) -> Nodes:
        return Nodes(self._rest[:, self._interior] + ca.reshape(q, 3, -1), self._m)

    def _reaction(self, free: Nodes, f: ca.MX, v: ca.MX) -> ca.MX:
        """Write force [N] and torque [N m] on the frame, shape (6,), with velocities ``v`` relative to it, shape (3, N).

        Notes
        -----
        The frame takes what the elements pull at the held nodes, and the drag. That is the pressure's force less the
        change of the membrane's momentum, since the elements' own forces add up to nothing. Enclosed gas pushes the
        frame the other way than the membrane.
        """
        drag = wrench(free.r, self._p.mass_damping * ca.repmat(self._m, 3, 1) * v)
        held = wrench(self.held.r, f[:, self._edge])
        pressure = held + wrench(free.r, f[:, self._interior])  # of all nodes, where the elements' own forces cancel
        return held + drag - self._p.enclosed_pressure * pressure
