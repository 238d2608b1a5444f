r"""A membrane on a rigid frame that flies: what the frame's motion does to its nodes, and what it does to the frame.

Symbols, for N nodes, in axes that turn with the frame: ``r`` positions from the frame's origin [m], ``s = v + w x r``
velocities less that of the origin [m/s], ``v`` velocities relative to the frame, ``f`` forces [N], three columns along x, y
and z, shape (N,); ``m`` masses [kg], shape (N,); ``a`` acceleration of the origin less gravity [m/s2], ``w`` angular
velocity [rad/s] and ``w_dot`` angular acceleration [rad/s2] of the frame, shape (3,); ``c`` mass damping [1/s], against
the frame; ``h`` step [s]::

    s' + w x s = f/m - a - c v        r' = s - w x r

which is v' = A - c v with A = f/m - a - w' x r - w x (w x r) - 2 w x v. Where inertia along the surface is scaled by k, all
but 1/k of what A has along it is taken from the nodes and given to the frame. So momentum is kept, and what is at rest in
the frame rests alike. Gravity pulls at frame and membrane alike. Held nodes
belong to the frame: their mass is reported, to be added to the mass of what carries the frame. Those that are held in some
directions only move, and the frame takes what holds them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import casadi as ca

from ..variables import CAUSALITIES, Values, Variable, array, input_, output, parameter
from .loops import Columns

_LETTERS = ("xx", "yy", "zz", "xy", "xz", "yz")
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, slots=True)
class Mounting:
    """Where the membrane sits in the body that carries it.

    Attributes
    ----------
    place : casadi.MX, shape (3,)
        Position [m] of the membrane's own origin from the frame's, in body axes.
    axes : casadi.MX, shape (3, 3)
        The membrane's x, y and z axis as columns [1], in body axes.
    """

    place: ca.MX
    axes: ca.MX

    @property
    def shift(self) -> ca.MX:
        """The membrane's own origin from the frame's [m], in the membrane's axes, shape (3,)."""
        return ca.mtimes(self.axes.T, self.place)


def mounting(p: Values) -> Mounting:
    """Write place and axes of the membrane from the parameters; not a number where normal and x direction are parallel."""
    z = p.mount_normal / ca.norm_2(p.mount_normal)
    x = p.mount_x - ca.dot(p.mount_x, z) * z
    x = x / ca.norm_2(x)
    return Mounting(p.mount_position, ca.horzcat(x, ca.cross(z, x), z))


def turn(angle: ca.MX) -> ca.MX:
    r"""Write the matrix, shape (3, 3), that takes vectors to axes that have turned by a small angle [rad], shape (3,).

    Notes
    -----
    Cayley's transform, orthogonal to round-off, of the tangent of half the angle, to fifth order in that.
    """
    half = angle / 2.0 * (1.0 + ca.dot(angle, angle) / 12.0)
    K = ca.skew(half)
    return ca.MX.eye(3) + 2.0 / (1.0 + ca.dot(half, half)) * (ca.mtimes(K, K) - K)


@dataclass(frozen=True, slots=True)
class FrameState:
    """What the membrane remembers of its frame, in its own axes.

    The last two start from zero at every communication point.

    Attributes
    ----------
    w : casadi.MX, shape (3,)
        Angular velocity [rad/s] at the end of the last step.
    w_given : casadi.MX, shape (3,)
        The one that was given for the last communication point.
    impulse : casadi.MX, shape (6,)
        Impulse [N s] and angular impulse about the frame's origin [N m s] that the frame took since the communication
        point.
    elapsed : casadi.MX, scalar
        Time [s] since then.
    """

    w: ca.MX
    w_given: ca.MX
    impulse: ca.MX
    elapsed: ca.MX


HOLDS = 3  # iterations of what holds a node in some directions
RESTARTED = 7  # states at the end of FrameState that are zero when a communication step begins


@dataclass(frozen=True, slots=True)
class FrameStep:
    r"""One step of the frame, as the membrane sees it.

    Attributes
    ----------
    a, w, w_dot : casadi.MX, shape (3,)
        Acceleration of the origin less gravity [m/s2], angular velocity in the middle of the step [rad/s], and angular
        acceleration [rad/s2].
    half : casadi.MX, shape (3, 3)
        Takes vectors to axes that have turned by half a step.
    end : FrameState
        The state after the step, without what the frame takes in it.
    h : casadi.MX, scalar
        Step [s].

    Notes
    -----
    The step is that of position Verlet in axes that do not turn, seen from those that do [1]_: drift by half a step,
    turn by half a step, kick, turn, drift:

    .. math::

        r_{1/2} &= E\,(r + \tfrac h2 s), \\
        s_{1/2}^+ &= \frac{(1 - \tfrac{ch}2)\,E s + h\,(f(r_{1/2})/m - a + c\,w \times r_{1/2})}{1 + \tfrac{ch}2}, \\
        r^+ &= E\,(r_{1/2} + \tfrac h2 s_{1/2}^+), \qquad s^+ = E\,s_{1/2}^+

    So no force depends on the velocity but the drag, the step stays explicit, of second order and reversible, and its
    limit is the elastic one at any rate of turn. Momentum and angular momentum change by what the frame gives, to
    round-off.

    References
    ----------
    .. [1] E. Hairer, C. Lubich, G. Wanner, Acta Numerica 12, 399-450, 2003, doi:10.1017/S0962492902000144.
    """

    a: ca.MX
    w: ca.MX
    w_dot: ca.MX
    half: ca.MX
    end: FrameState
    h: ca.MX

    @classmethod
    def of(cls, state: FrameState, u: Values, mount: Mounting, h: ca.MX) -> FrameStep:
        """Turn the motion of the frame from body axes to the membrane's, and to the middle of the step.

        Notes
        -----
        Of a communication step that is divided, each part has the angular velocity of its own middle: what was given
        for the beginning of the whole, and from there on the angular acceleration.
        """
        vectors = ca.horzcat(u.frame_acceleration, u.angular_velocity, u.angular_acceleration)
        a, w_given, w_dot = ca.horzsplit(ca.mtimes(mount.axes.T, vectors))
        w = ca.if_else(state.elapsed > 0.0, state.w, state.w_given)
        middle = w + h / 2.0 * w_dot
        end = FrameState(w + h * w_dot, w_given, state.impulse, state.elapsed + h)
        return cls(a, middle, w_dot, turn(h / 2.0 * middle), end, h)

    def pass_on(self, reaction: ca.MX) -> tuple[FrameState, ca.MX]:
        """Count what the frame takes in the middle of the step, force [N] and torque [N m], shape (6,).

        Returns
        -------
        FrameState
            After the step.
        casadi.MX, shape (6,)
            Mean force and torque since the communication point, in the axes half way between those that the frame had
            then and has now.
        """
        E, state = ca.diagcat(self.half, self.half), self.end
        impulse = ca.mtimes(E, ca.mtimes(E, state.impulse) + self.h * reaction)
        back = turn(-state.elapsed / 2.0 * (state.w - state.elapsed / 2.0 * self.w_dot))
        mean = ca.mtimes(ca.diagcat(back, back), impulse) / state.elapsed
        return FrameState(state.w, state.w_given, impulse, state.elapsed), mean


def drift(half: ca.MX, h: ca.MX, r: Columns, s: Columns) -> tuple[Columns, Columns]:
    """Return positions [m] and velocities [m/s] half a step later, in the axes of then."""
    return turned(half, [x + h / 2.0 * y for x, y in zip(r, s, strict=True)]), turned(half, s)


def kick(h: ca.MX, a: ca.MX, w: ca.MX, r: Columns, s: Columns, pull: Columns, damping: ca.MX) -> tuple[Columns, Columns]:
    """Return the velocities [m/s] after the kick, and the mean velocity relative to the frame, which the drag goes with.

    Parameters
    ----------
    h, a, w : casadi.MX
        Those of ``FrameStep``.
    r, s : list of casadi.MX, shape (N,)
        What ``drift`` returns.
    pull : list of casadi.MX, shape (N,)
        Forces over masses [m/s2] there.
    damping : casadi.MX, scalar
        Mass damping c [1/s].
    """
    drag = damping * h / 2.0
    keep, gain, along = (1.0 - drag) / (1.0 + drag), h / (1.0 + drag), 2.0 * drag / (1.0 + drag)
    carried = cross([w[i] for i in range(3)], r)
    s_next = [keep * s[i] + gain * (pull[i] - a[i]) + along * carried[i] for i in range(3)]
    return s_next, [(s[i] + s_next[i]) / 2.0 - carried[i] for i in range(3)]


def accelerated(a: ca.MX, w: ca.MX, w_dot: ca.MX, r: Columns, s: Columns, pull: Columns) -> Columns:
    """Return the accelerations A of nodes relative to the frame [m/s2], but for the drag.

    Parameters
    ----------
    a, w, w_dot : casadi.MX
        Those of ``FrameStep``.
    r, s, pull : list of casadi.MX, shape (N,)
        As of ``kick``.
    """
    turns = [w[i] for i in range(3)]
    carried = cross(turns, r)
    turning = cross(turns, [2.0 * s[i] - carried[i] for i in range(3)])  # w x (w x r) + 2 w x v
    faster = cross([w_dot[i] for i in range(3)], r)
    return [pull[i] - a[i] - faster[i] - turning[i] for i in range(3)]


def held_back(N: Columns, A: Columns) -> Columns:
    """Return what inertia that is scaled along the surface takes from accelerations, see ``Structure.slowing``."""
    square = sum(x**2 for x in N)
    across = sum(x * y for x, y in zip(N, A, strict=True))
    return [square * y - x * across for x, y in zip(N, A, strict=True)]


def held_to(half: ca.MX, h: ca.MX, r: Columns, s: Columns, held: Columns, rest: Columns) -> Columns:
    """Return what to take from the velocities after a kick [m/s], so that nodes end the step where they are held.

    Parameters
    ----------
    half, h : casadi.MX
        Those of ``FrameStep``.
    r, s : list of casadi.MX, shape (N,)
        Positions and velocities after the kick.
    held : list of casadi.MX, shape (N,)
        1 for directions of the frame's axes in which a node is held, else 0.
    rest : list of casadi.MX, shape (N,)
        Where it is held, from the frame's origin [m].

    Notes
    -----
    The impulses of constraints on positions at the end of a step, as in the method SHAKE; along axes that turn by next to
    nothing in half a step, so that three iterations are exact to round-off, and what is left does not grow.
    """
    taken, per_way = [0.0 * x for x in s], 2.0 / ca.if_else(h > 0.0, h, 1.0)
    for _ in range(HOLDS):
        end, _ = drift(half, h, r, [x - y for x, y in zip(s, taken, strict=True)])
        taken = [t + k * per_way * (x - x0) for t, k, x, x0 in zip(taken, held, end, rest, strict=True)]
    return taken


def turned(E: ca.MX, r: Columns) -> Columns:
    """Return the columns of vectors that a matrix, shape (3, 3), turns."""
    return [E[i, 0] * r[0] + E[i, 1] * r[1] + E[i, 2] * r[2] for i in range(3)]


def cross(a: Columns, b: Columns) -> Columns:
    r"""Return :math:`a \times b` by columns."""
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def wrench(r: Columns, f: Columns) -> list[ca.MX]:
    """Write what sums to force [N] and torque about the frame's origin [N m], six columns."""
    return [*f, *cross(r, f)]


def mass_properties(r: Columns, m: ca.MX) -> list[ca.MX]:
    r"""Write what sums to mass [kg], first moment [kg m] and :math:`\sum m r r^T` [kg m2] by ``_LETTERS``, ten columns."""
    weighted = [m * x for x in r]
    return [m, *weighted, *(weighted[a] * r[b] for a, b in PAIRS)]


def frame_results(mount: Mounting, moving: ca.MX, held: ca.MX, reaction: ca.MX) -> dict[str, ca.MX]:
    """Write the results of ``FRAME_OUTPUTS``, in body axes.

    Parameters
    ----------
    mount : Mounting
        Turns to body axes.
    moving : casadi.MX, shape (16,)
        Sums of ``mass_properties`` over the nodes that move relative to the frame, and of ``wrench`` of their momenta.
    held : casadi.MX, shape (10,)
        Sums of ``mass_properties`` over those that do not.
    reaction : casadi.MX, shape (6,)
        Force [N] and torque [N m] that the membrane exerts on the frame, as means over the step, in the membrane's
        axes.
    """
    A = mount.axes
    results: dict[str, ca.MX] = {"force": ca.mtimes(A, reaction[:3]), "torque": ca.mtimes(A, reaction[3:])}
    for name, sums in (("moving", moving), ("held", held)):
        xx, yy, zz, xy, xz, yz = ca.vertsplit(sums[4:10])
        G = ca.blockcat([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        results |= {f"{name}_mass": sums[0], f"{name}_first_moment": ca.mtimes(A, sums[1:4])}
        J = ca.mtimes(ca.mtimes(A, ca.trace(G) * ca.MX.eye(3) - G), A.T)
        results[f"{name}_inertia"] = ca.vertcat(*(J[a, b] for a, b in PAIRS))
    results["momentum"], results["angular_momentum"] = ca.mtimes(A, moving[10:13]), ca.mtimes(A, moving[13:])
    return results


_vector = partial(array, parts=[f"in body axes, along {axis}" for axis in "xyz"])
_inertia = partial(array, parts=[f"in body axes, {letters}" for letters in _LETTERS])
FRAME_PARAMETERS = (
    *_vector(parameter, "mount_position", "m", "Place of the membrane's centre from the frame's origin", 0.0, 1e4),
    *_vector(parameter, "mount_normal", "1", "Normal of the membrane, its z axis, of any length", (0.0, 0.0, 1.0), 1e3),
    *_vector(
        parameter,
        "mount_x",
        "1",
        "Direction of the membrane's x axis, freed of what lies along the normal",
        (1.0, 0.0, 0.0),
        1e3,
    ),
    parameter(
        "enclosed_pressure",
        "1",
        "Part of the pressure that pushes the frame the other way: 1 for gas between both, 0 for pressure from outside",
        0.0,
        0.0,
        1.0,
    ),
)
_MEAN = "mean over the step"
FRAME_INPUTS = (
    *_vector(
        input_, "frame_acceleration", "m/s2", f"Acceleration of the frame's origin less gravity, {_MEAN}", 0.0, 1e5, 10.0
    ),
    *_vector(input_, "angular_velocity", "rad/s", "Angular velocity of the frame at the end of the step", 0.0, 1e3, 0.1),
    *_vector(input_, "angular_acceleration", "rad/s2", f"Angular acceleration of the frame, {_MEAN}", 0.0, 1e6, 1.0),
)
FRAME_OUTPUTS = (
    *_vector(output, "force", "N", f"Force on the frame, {_MEAN}", nominal=1.0),
    *_vector(output, "torque", "N m", f"Torque on the frame about its origin, {_MEAN}", nominal=1.0),
    output("held_mass", "kg", "Mass of the held edge, to be added to what carries the frame"),
    *_vector(output, "held_first_moment", "kg m", "Mass times place of the held edge"),
    *_inertia(output, "held_inertia", "kg m2", "Inertia of the held edge about the frame's origin"),
    output("moving_mass", "kg", "Mass that moves relative to the frame"),
    *_vector(output, "moving_first_moment", "kg m", "Mass times place of what moves"),
    *_inertia(output, "moving_inertia", "kg m2", "Inertia of what moves about the frame's origin"),
    *_vector(output, "momentum", "kg m/s", "Momentum of what moves, of its velocity less that of the frame's origin"),
    *_vector(output, "angular_momentum", "kg m2/s", "Angular momentum about the frame's origin, of the same velocity"),
)


def flying(table: Sequence[Variable]) -> tuple[Variable, ...]:
    """Put the motion of a frame that flies in the place of the acceleration of one that does not, and what it takes."""
    kinds = {kind: [v for v in table if v.causality == kind] for kind in CAUSALITIES}
    inputs: list[Variable] = []
    for v in kinds["input"]:
        if not v.name.startswith("base_acceleration"):
            inputs.append(v)
        elif FRAME_INPUTS[0] not in inputs:
            inputs += FRAME_INPUTS
    return (*kinds["parameter"], *FRAME_PARAMETERS, *inputs, *kinds["output"], *FRAME_OUTPUTS, *kinds["local"])
