r"""The nodes of a membrane on a frame that flies, for the expressions of ``frame``.

Symbols: ``q`` displacements [m] of the M nodes that move, ``at`` their positions from the membrane's own origin [m] and
``s`` their velocities [m/s] less that of the frame's origin, node by node, shape (3 M,), in the membrane's axes; by columns
``r`` positions from the frame's origin [m] and ``f`` forces [N]; ``m`` masses [kg]; ``h`` step [s].
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import casadi as ca

from ..variables import Values, pack, unpack
from .assembly import Forces, MembraneEquations
from .frame import (
    FrameState,
    FrameStep,
    Mounting,
    accelerated,
    cross,
    drift,
    frame_results,
    held_back,
    held_to,
    kick,
    mass_properties,
    mounting,
    wrench,
)
from .law import Entry
from .loops import Columns, NodeLoop

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


@dataclass(frozen=True, slots=True)
class Common:
    """What all nodes share in a step, each a scalar but for those with a shape.

    Attributes
    ----------
    half, h, a, w, w_dot : casadi.MX
        Those of ``FrameStep``.
    damping : casadi.MX
        Mass damping [1/s].
    shed : casadi.MX
        Share of the elements' load that pushes the frame the other way [1].
    shift : casadi.MX, shape (3,)
        The membrane's own origin from the frame's [m].
    weight : casadi.MX
        Factor on all masses [1].
    """

    half: ca.MX
    h: ca.MX
    a: ca.MX
    w: ca.MX
    w_dot: ca.MX
    damping: ca.MX
    shed: ca.MX
    shift: ca.MX
    weight: ca.MX


_SCALAR, _VECTOR = ca.MX(1, 1), ca.MX(3, 1)
_LIKE = Common(ca.MX(3, 3), _SCALAR, _VECTOR, _VECTOR, _VECTOR, _SCALAR, _SCALAR, _VECTOR, _SCALAR)


class Rider:
    """The nodes of a membrane on a frame.

    Parameters
    ----------
    equations : MembraneEquations
        The membrane; the loops over its nodes are added to its own.
    compiled : bool
        Whether sums over nodes are loops.
    """

    def __init__(self, equations: MembraneEquations, *, compiled: bool) -> None:
        structure, shared = equations.structure, pack(_LIKE).numel()
        n, mass = len(structure.moving), structure.mass[structure.order]
        self._equations, self._n_q, self._compiled = equations, 3 * n, compiled
        self._slowing = [equations.arrays["slowing"]] if structure.setup.inplane_mass > 1.0 else []
        self._holds = not structure.free.reshape(-1, 3)[structure.moving].all()
        self._drift = NodeLoop("drift", _drift, 2, shared, mass[:n])
        kicked = partial(_kick, slowed=bool(self._slowing), holds=self._holds)
        self._kick = NodeLoop("kick", kicked, 4 + len(self._slowing) + 2 * self._holds, shared, mass[:n])
        self._held = NodeLoop("held", _held, 3, shared, mass[n:])
        if compiled:
            equations.loops += [nodes.loop for nodes in (self._drift, self._kick, self._held)]

    def start(self, q: ca.MX, found: Forces, f: ca.MX, gas: ca.MX, u: Values, p: Values) -> Ride:
        """Begin at rest relative to the frame."""
        mount, at = mounting(p), self._equations.positions(q, u, p)
        w, n = ca.mtimes(mount.axes.T, u.angular_velocity), self._n_q
        r = [at[axis:n:3] + mount.shift[axis] for axis in range(3)]
        s = ca.vec(ca.horzcat(*cross([w[i] for i in range(3)], r)).T)
        common = self._common(ca.MX.eye(3), ca.MX(0.0), ca.MX.zeros(3), w, ca.MX.zeros(3), mount, p)
        _, _, reaction, results = self._kicked(at, s, found, f, at, common)
        state = FrameState(w, w, ca.MX.zeros(6), ca.MX(0.0))
        return Ride(q, s, state, found, gas, frame_results(mount, *results, reaction))

    def advance(self, q: ca.MX, s: ca.MX, state: FrameState, pulled: Pulled, u: Values, p: Values, h: ca.MX) -> Ride:
        """Advance by one step; ``pulled`` gives the forces at positions from the membrane's origin."""
        mount, n = mounting(p), self._n_q
        frame = FrameStep.of(state, u, mount, h)
        common = self._common(frame.half, h, frame.a, frame.w, frame.w_dot, mount, p)
        rest = self._equations.positions(ca.MX.zeros(n), u, p)
        (at, s), _ = self._drift([rest[:n] + q, s], pack(common), compiled=self._compiled)
        at = ca.vertcat(at, rest[n:])
        found, f, gas = pulled(at)
        at, s, reaction, results = self._kicked(at, s, found, f, rest, common)
        state, reaction = frame.pass_on(reaction)
        return Ride(at - rest[:n], s, state, found, gas, frame_results(mount, *results, reaction))

    def _common(self, half: ca.MX, h: ca.MX, a: ca.MX, w: ca.MX, w_dot: ca.MX, mount: Mounting, p: Values) -> Common:
        weight = ca.MX(1.0 / self._equations.lightness(p))
        return Common(half, h, a, w, w_dot, p.mass_damping, p.enclosed_pressure, mount.shift, weight)

    def _kicked(
        self, at: ca.MX, s: ca.MX, found: Forces, f: ca.MX, rest: ca.MX, common: Common
    ) -> tuple[ca.MX, ca.MX, ca.MX, tuple[ca.MX, ca.MX]]:
        """Return positions and velocities at the end of the step, the force on the frame in its middle, and the masses."""
        n, d = self._n_q, pack(common)
        held = [1.0 - self._equations.arrays["free"], rest[:n]] if self._holds else []
        (moved, s), sums = self._kick([at[:n], s, f[:n], found.f[:n], *self._slowing, *held], d, compiled=self._compiled)
        _, fixed = self._held([at[n:], f[n:], found.f[n:]], d, compiled=self._compiled)
        return moved, s, sums[16:] + fixed[10:], (sums[:16], fixed[:10])


def _drift(vectors: list[Columns], d: ca.MX, own: Entry) -> tuple[list[Columns], list[Entry]]:  # noqa: ARG001
    """Move a node by half a step: place and velocity."""
    common, (at, s) = unpack(_LIKE, d), vectors
    r, s = drift(common.half, common.h, _shifted(at, common.shift), s)
    return [_shifted(r, -common.shift), s], []


def _kick(vectors: list[Columns], d: ca.MX, own: Entry, *, slowed: bool, holds: bool) -> tuple[list[Columns], list[Entry]]:
    """Kick a node and move it by the other half: place and velocity; its sums, and what it exerts on the frame.

    The last vectors of a node are what slows it, if it is slowed; and if it may be held in some directions, which these are
    (1, else 0) and where it rests.

    Notes
    -----
    The frame takes what pulls at the held nodes, and the drag. That is the load less the change of the membrane's
    momentum, since the elements' own forces add up to nothing; what scaled inertia takes from a node goes there too, and
    what a direction takes that is held. Of all nodes they add up to the load, of which enclosed
    gas pushes the frame the other way than the membrane.
    """
    common, (at, s, f, found, *more) = unpack(_LIKE, d), vectors
    m, r = common.weight * own, _shifted(at, common.shift)
    free = [x / m for x in f]
    held, rest = more[-2:] if holds else ([0.0] * 3, at)

    def moving(s: Columns) -> Columns:
        A = accelerated(common.a, common.w, common.w_dot, r, s, free)
        return [(1.0 - k) * x for k, x in zip(held, A, strict=True)]

    def kicked(pull: Columns) -> tuple[Columns, Columns, Columns]:
        """Return velocities after the kick, the mean relative ones, and what directions have taken that are held."""
        after, relative = kick(common.h, common.a, common.w, r, s, pull, common.damping)
        taken = held_to(common.half, common.h, r, after, held, _shifted(rest, common.shift)) if holds else []
        return [x - y for x, y in zip(after, taken, strict=True)] if holds else after, relative, taken

    pull, less, middle = free, [], s
    for _ in range(2 if slowed else 0):  # by the velocity before the kick, then by that in its middle
        less = held_back(more[0], moving(middle))
        pull = [x - y for x, y in zip(free, less, strict=True)]
        middle = [(x + y) / 2.0 for x, y in zip(s, kicked(pull)[0], strict=True)]
    after, relative, impulse = kicked(pull)
    force = [common.damping * m * v - common.shed * x for v, x in zip(relative, found, strict=True)]
    if less:
        taken = m / (1.0 + common.damping * common.h / 2.0)
        force = [x + taken * y for x, y in zip(force, less, strict=True)]
    if holds:
        at_rest = accelerated(common.a, common.w, common.w_dot, r, middle, free)  # where it begins, without a step
        pulls = [ca.if_else(common.h > 0.0, x / common.h, k * y) for x, k, y in zip(impulse, held, at_rest, strict=True)]
        force = [x + m * y for x, y in zip(force, pulls, strict=True)]
    reaction = wrench(r, force)
    r, s = drift(common.half, common.h, r, after)
    momentum = wrench(r, [m * x for x in s])
    return [_shifted(r, -common.shift), s], [*mass_properties(r, m), *momentum, *reaction]


def _held(vectors: list[Columns], d: ca.MX, own: Entry) -> tuple[list[Columns], list[Entry]]:
    """Sum what held nodes weigh and exert on the frame."""
    common, (at, f, found) = unpack(_LIKE, d), vectors
    r = _shifted(at, common.shift)
    force = [x - common.shed * y for x, y in zip(f, found, strict=True)]
    return [], [*mass_properties(r, common.weight * own), *wrench(r, force)]


def _shifted(r: Columns, by: ca.MX) -> Columns:
    return [x + by[i] for i, x in enumerate(r)]
