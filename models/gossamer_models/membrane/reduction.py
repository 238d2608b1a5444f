r"""A membrane reduced to its slowest modes about an equilibrium, its frame or supports fixed (Craig-Bampton).

Symbols: ``eta`` coordinates of n modes [m kg^1/2], :math:`\Omega` their angular frequencies [1/s], ``c`` mass damping [1/s];
``u`` changes of m inputs; ``L`` participation, shape (n, 6), of the accelerations ``a`` along and about x, y and z through
the membrane's own origin [m/s2], [1/s2]; ``y`` changes of outputs; ``z`` eta and those changes of inputs that deform; ``w``
angular velocity [rad/s]; ``h`` step [s]; ``g`` forces on the modes [m kg^1/2/s2].

.. math::

    \ddot\eta + c\,\dot\eta + \Omega^2 \eta &= B u = g, \\
    y &= Y \eta + D u + \tfrac12 z^T H z.

D holds the static answer of all other modes, so that y is exact at rest to first order; H, of strains alone, what the film
stretches to second order, with all other modes at rest too: in a flat film a mode across has no other strain.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..errors import ParameterError, require
from ..step_model import StepModel
from ..variables import Results, Values, Variable, output
from .frame import FRAME_INPUTS, PAIRS, flying, frame_results, mounting
from .setup import LEFT
from .structure import Structure
from .vibration import Linearised, Modes, Seen

ACCELERATION = "base_acceleration"
STIFFNESS = ("damage", *LEFT)  # inputs that do not deform by themselves, of which strain is first order only
TINY = 1e-9  # of those by one and by the other alone: second derivatives that are rounding
CRITICAL = 1e-3  # of the frequency: damping that is nearer to critical counts as that near
WRONG = 0.05  # share of a change by which the linear model may be wrong
SETTLING, SETTLED = 60, 1e-9  # steps to the rest of the full membrane at most, and the last one over its way
LEAST, MOST, STRIDE = 1e-4, 0.2, 1.5  # shares of the size from and to which the membrane is moved, and the factor between
SOFTEST = 0.01  # of the squared frequency that damage leaves at least, where its first order would leave less


@dataclass(frozen=True, kw_only=True)
class Reduced:
    """A membrane reduced to n modes.

    Attributes
    ----------
    modes : Modes
        Those that are kept.
    nodes : tuple of int
        Nodes of the mesh, from 1, whose displacements are outputs.
    inputs : tuple of Variable, length m
        Those of the membrane without the acceleration of its base, then that of the frame, 6.
    outputs : tuple of Variable, length o
        Strains, probes, displacements of some nodes; then force and torque of the loads on the frame, 6 of those on
        elements and 6 of those that keep their direction.
    start : ndarray, shape (o,)
        Outputs at the equilibrium.
    f : ndarray, shape (F, m)
        Forces on what is free per unit of the inputs [N].
    B : ndarray, shape (n, m)
        Force on the modes per unit of the inputs.
    Y, D : ndarray, shape (o, n), (o, m)
        Outputs per unit of modes and inputs.
    bending : tuple of int
        Inputs in z.
    H : ndarray, shape (s, n + b, n + b)
        Second derivatives of the strains by z.
    softening : ndarray, shape (z, n, n)
        Derivative of the stiffness of the modes by damage of each zone [1/s2], that of the equilibrium included.
    """

    modes: Modes
    nodes: tuple[int, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    start: Vector
    f: Matrix
    B: Matrix
    Y: Matrix
    D: Matrix
    bending: tuple[int, ...]
    H: NDArray[np.float64]
    softening: NDArray[np.float64]

    @property
    def damping(self) -> float:
        """Mass damping [1/s]."""
        known = self.modes.linearised
        return float(known.p[[v.name for v in known.variables].index("mass_damping")])

    @property
    def n_y(self) -> int:
        """Number of outputs that are no force."""
        return len(self.outputs) - 12

    def matrices(self) -> dict[str, Matrix]:
        r"""Return the linear model.

        Returns
        -------
        dict
            ``A``, ``B``, ``C``, ``D`` of states :math:`(\eta, \dot\eta)`, inputs ``inputs`` and outputs: those that are no
            force, then force and torque on the frame about the membrane's own origin. ``M``, ``damping`` and ``K`` of six
            motions of the frame, then the modes.
        """
        n, c, L, squares = len(self.modes.squares), self.damping, self.modes.participation, self.modes.squares
        zero, one = np.zeros((n, n)), np.eye(n)
        rigid = np.zeros((6, len(self.inputs)))
        rigid[:, -6:] = self.modes.moving
        loads = slice(self.n_y, self.n_y + 6), slice(self.n_y + 6, None)
        Y, D = (each[loads[0]] + each[loads[1]] for each in (self.Y, self.D))
        C = np.block([[self.Y[: self.n_y], np.zeros((self.n_y, n))], [Y + L.T * squares, c * L.T]])
        return {
            "A": np.block([[zero, one], [-np.diag(squares), -c * one]]),
            "B": np.vstack([np.zeros_like(self.B), self.B]),
            "C": C,
            "D": np.vstack([self.D[: self.n_y], D - L.T @ self.B - rigid]),
            "M": np.block([[self.modes.moving, L.T], [L, one]]),
            "damping": np.diag([*np.zeros(6), *np.full(n, c)]),
            "K": np.diag([*np.zeros(6), *squares]),
        }


def reduce_membrane(modes: Modes, nodes: Sequence[int] = ()) -> Reduced:
    """Reduce a membrane to modes.

    Parameters
    ----------
    modes : Modes
        Those to keep.
    nodes : sequence of int
        Nodes of the mesh, from 1, whose displacements are outputs; by default the one that the slowest mode moves most.

    Raises
    ------
    ParameterError
        The mesh has no such node, no node is held, so that there is no frame to fix, or the frame is accelerated.
    """
    known = modes.linearised
    structure, count = known.structure, len(known.structure.mesh.nodes)
    nodes = tuple(nodes) or (int(np.argmax(np.linalg.norm(modes.shapes[0], axis=1))) + 1,)
    if wrong := [node for node in nodes if not 1 <= node <= count]:
        msg = f"node {wrong[0]} is none of the mesh, which has 1 to {count}. Name one of these."
        raise ParameterError(msg)
    text = "no node is held in all directions, so the frame is held by nothing that carries the membrane. Hold a group so."
    require(len(structure.moving) < count, text)
    kept = [i for i, v in enumerate(known.inputs) if v.name.partition("[")[0] != ACCELERATION]
    text = f"a reduced membrane begins on a frame that is not accelerated. Leave out {ACCELERATION!r}: it is an input later."
    require(not np.delete(known.u, kept).any(), text)
    inputs = tuple(known.inputs[i] for i in kept) + _accelerations()
    du = np.hstack([np.eye(known.u.size)[:, kept], np.zeros((known.u.size, 6))])
    moved = known.moved(du=du)
    inertia = -(known.nodal_mass[:, None] * known.R)[known.free]
    f = np.hstack([moved.f[:, : len(kept)], inertia])
    B = modes.phi.T @ f
    rest = known.embedded(known.solve(f) - modes.phi @ (B / modes.squares[:, None]))
    own, static = known.moved(dq=known.embedded(modes.phi)), known.moved(du=du, dq=rest)
    now = known.seen(known.u, known.q)
    places = [3 * (node - 1) + axis for node in nodes for axis in range(3)]

    def stacked(seen: Seen) -> Matrix:
        found = [seen.y, seen.away.reshape(len(seen.away), -1).T[places], seen.W]
        moved = np.abs(seen.away).max(axis=(1, 2))
        for each, scale in zip(found, (moved / structure.mesh.size, moved, np.abs(seen.W).max(axis=0)), strict=True):
            each[np.abs(each) < TINY * scale] = 0.0
        return np.vstack(found)

    bending = tuple(k for k, v in enumerate(inputs) if v.name.partition("[")[0] not in STIFFNESS)
    return Reduced(
        modes=modes,
        nodes=nodes,
        inputs=inputs,
        outputs=(*known.outputs, *_displacements(structure, nodes), *_loads()),
        start=stacked(now).ravel(),
        f=f,
        B=B,
        Y=stacked(own),
        D=stacked(static),
        bending=bending,
        H=_second(modes, du[:, bending], rest[:, bending]),
        softening=_softening(modes, du, f, inputs),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """How far a load may go until the linear model is wrong by a share of the change that it causes, at rest.

    Attributes
    ----------
    load : Variable
        The input.
    displacement, strain : tuple of float
        Change of the input at which displacements and strains are wrong by ``WRONG`` of the largest change of any, and
        that change [m], [1]. Not a number where they are right as far as it was compared, and of strains without gauges.
    compared : float
        Change of the input up to which it was compared: until both are wrong, the membrane moves by ``MOST`` of its size,
        or it finds no rest near.
    """

    load: Variable
    displacement: tuple[float, float]
    strain: tuple[float, float]
    compared: float


def reaches(reduced: Reduced) -> list[Reach]:
    """Find how far each load may go, by equilibria of the full membrane under more and more of it.

    Loads are pressures, light, forces, and the accelerations of the base. Each is raised from its value at the equilibrium;
    gas keeps its amount.
    """
    known = reduced.modes.linearised
    return [_reach(reduced, i, v) for i, v in enumerate(known.inputs) if v.unit in ("Pa", "N", "m/s2")]


def _reach(reduced: Reduced, i: int, load: Variable) -> Reach:
    known, s, n = reduced.modes.linearised, reduced.modes.linearised.structure.n_sensors, len(reduced.modes.squares)
    size, names = known.structure.mesh.size, [v.name for v in reduced.inputs]
    axis = int(load.name[-2]) if load.name.endswith("]") else 3  # of the base
    column = names.index(load.name if load.name in names else f"frame_acceleration[{axis}]")
    f, du = reduced.f[:, column], np.eye(known.u.size)[i]
    dq = known.embedded(known.solve(f[:, None]))
    away = known.moved(du=du[:, None], dq=dq).away[0]
    nowhere = Reach(load=load, displacement=(np.nan, np.nan), strain=(np.nan, np.nan), compared=0.0)
    if (largest := float(np.linalg.norm(away, axis=1).max())) == 0.0:
        return nowhere
    z = np.zeros(reduced.H.shape[1])
    z[:n], z[n + reduced.bending.index(column)] = reduced.B[:, column] / reduced.modes.squares, 1.0
    first, second = reduced.Y[:s] @ z[:n] + reduced.D[:s, column], np.einsum("sij,i,j->s", reduced.H, z, z) / 2.0
    dead = f if load.name not in names else np.zeros_like(f)  # the base's acceleration is none of the forces
    at, sizes, errors = [LEAST * size / largest], [np.zeros(2)], [np.zeros(2)]
    low, high = load.limits
    while at[-1] * largest <= MOST * size and low <= known.u[i] + at[-1] <= high and not np.all(errors[-1] > WRONG):
        found = _settled(known, known.u + at[-1] * du, at[-1] * dq[:, 0], at[-1] * dead)
        if found is None:
            break
        moved, strain = found.away[0] - known.displacement, found.y[:s, 0] - reduced.start[:s]
        sizes.append(np.array([np.linalg.norm(moved, axis=1).max(), np.abs(strain).max(initial=0.0)]))
        off = moved - at[-1] * away, strain - at[-1] * (first + at[-1] * second)
        wrong = np.linalg.norm(off[0], axis=1).max(), np.abs(off[1]).max(initial=0.0)
        errors.append(np.array(wrong) / np.maximum(sizes[-1], 1e-300))
        at.append(STRIDE * at[-1])
    ends = [_crossing(np.array([0.0, *at[:-1]]), *(np.array(each)[:, k] for each in (errors, sizes))) for k in range(2)]
    return Reach(load=load, displacement=ends[0], strain=ends[1], compared=([0.0, *at])[len(errors) - 1])


def _settled(known: Linearised, u: Vector, dq: Vector, dead: Vector) -> Seen | None:
    """Return the full membrane at rest near an estimate of its displacements, with gas that keeps its amount."""
    q, last = known.q + dq, np.inf
    solve: Callable[[Matrix], Matrix] = known.solve
    for _ in range(SETTLING):
        found = known.seen(u, q)
        step = known.embedded(solve(found.f + dead[:, None]))[:, 0]
        size = float(np.linalg.norm(step))
        if size > last / 2.0:  # too slow with these factors
            solve = known.solver(u, q)
        last, q = size, q + step
        if size < SETTLED * np.linalg.norm(q - known.q):
            return known.seen(u, q)
    return None


def _crossing(at: Vector, errors: Vector, sizes: Vector) -> tuple[float, float]:
    """Return where errors first are ``WRONG``, between the changes that were tried, and the size there."""
    over = np.flatnonzero(errors > WRONG)
    if not len(over):
        return np.nan, np.nan
    k = over[0]
    share = np.log(WRONG / errors[k - 1]) / np.log(errors[k] / errors[k - 1]) if errors[k - 1] > 0.0 else 1.0
    change, size = (float(x[k] ** share * x[k - 1] ** (1.0 - share)) for x in (at, sizes))  # powers of the change
    return change, size


def _accelerations() -> tuple[Variable, ...]:
    return tuple(v for v in FRAME_INPUTS if "velocity" not in v.name)


def _displacements(structure: Structure, nodes: Sequence[int]) -> list[Variable]:
    rows = []
    for k, node in enumerate(nodes):
        at = ", ".join(f"{x:.4g}" for x in structure.mesh.nodes[node - 1])
        text = f"Displacement of node {node} of the mesh, at ({at}) m, along"
        rows += [output(f"displacement[{3 * k + a}]", "m", f"{text} {axis}", nominal=0.1) for a, axis in enumerate("xyz", 1)]
    return rows


def _loads() -> list[Variable]:
    kinds = ("loads on elements", "load"), ("loads that keep their direction", "dead_load")
    parts = [("force", "N"), ("torque", "N m")]
    return [
        output(f"{name}_{part}[{k}]", unit, f"{part.capitalize()} of {text} along {axis}")
        for text, name in kinds
        for part, unit in parts
        for k, axis in enumerate("xyz", 1)
    ]


def _second(modes: Modes, du: Matrix, dq: Matrix) -> NDArray[np.float64]:
    """Return the second derivatives of the strains by modes and inputs, all other modes at rest."""
    known, s = modes.linearised, modes.linearised.structure.n_sensors
    du = np.hstack([np.zeros((known.u.size, len(modes.squares))), du])
    dq = np.hstack([known.embedded(modes.phi), dq])
    size = dq.shape[1]
    H = np.zeros((s, size, size))
    if not s:
        return H
    i, j = np.triu_indices(size)
    bent = known.bent((du[:, i], dq[:, i], None), (du[:, j], dq[:, j], None))
    slopes = known.slopes()[:s].toarray().T
    per_force = known.solve(slopes) - modes.phi @ ((modes.phi.T @ slopes) / modes.squares[:, None])  # K is symmetric
    values = bent.y[:s] + per_force.T @ bent.f
    H[:, i, j] = H[:, j, i] = values
    scale = np.sqrt(np.abs(np.diagonal(H, axis1=1, axis2=2)).max(axis=0))
    H[np.abs(H) < TINY * np.outer(scale, scale)] = 0.0
    return H


def _softening(modes: Modes, du: Matrix, f: Matrix, inputs: tuple[Variable, ...]) -> NDArray[np.float64]:
    known, n = modes.linearised, len(modes.squares)
    zones = [k for k, v in enumerate(inputs) if v.name.startswith("damage[")]
    if not zones:
        return np.zeros((0, n, n))
    du, dq, phi = du[:, zones], known.embedded(known.solve(f[:, zones])), known.embedded(modes.phi)
    found = np.empty((len(zones), n, n))
    for j in range(n):
        v = np.repeat(phi[:, [j]], len(zones), axis=1)
        found[:, :, j] = -(modes.phi.T @ known.bent((None, v, None), (du, dq, None)).f).T
    return found


@dataclass(frozen=True, slots=True)
class ReducedState:
    """State of a reduced membrane.

    Attributes
    ----------
    eta, eta_dot : casadi.MX, shape (n,)
        Coordinates of the modes [m kg^1/2] and their velocities [m kg^1/2/s].
    """

    eta: ca.MX
    eta_dot: ca.MX


def advance(x: ReducedState, g: ca.MX, squares: ca.MX, c: ca.MX, h: ca.MX) -> ReducedState:
    r"""Advance oscillators by a step, exactly for a force that is constant over it.

    Notes
    -----
    With :math:`s = \Omega^2 - c^2/4`, :math:`C = e^{-ch/2} \cos\sqrt s h` and :math:`S = e^{-ch/2} \sin(\sqrt s h)/\sqrt s`,
    or with hyperbolic functions where s is negative, the exponential of the matrix of each mode takes the distance from
    rest :math:`g/\Omega^2` to :math:`C + \tfrac c2 S` of it.
    """
    s = squares - c**2 / 4.0
    r = ca.fmax(ca.sqrt(ca.fabs(s)), CRITICAL * ca.sqrt(squares))
    decay, slow, fast = ca.exp(-c * h / 2.0), ca.exp((r - c / 2.0) * h), ca.exp(-(r + c / 2.0) * h)
    C = ca.if_else(s > 0.0, decay * ca.cos(r * h), (slow + fast) / 2.0)
    S = ca.if_else(s > 0.0, decay * ca.sin(r * h), (slow - fast) / 2.0) / r
    rest = g / squares
    away, v = x.eta - rest, x.eta_dot
    return ReducedState(rest + (C + c / 2.0 * S) * away + S * v, (C - c / 2.0 * S) * v - squares * S * away)


def _weighed(X: Matrix, m: Vector, d: ca.MX) -> ca.MX:
    """Return the sums of ``mass_properties`` over nodes at X that are moved by d [m]."""
    M, S, G = float(m.sum()), ca.DM(m @ X), ca.DM(X.T @ (m[:, None] * X))
    G = G + ca.mtimes(S, d.T) + ca.mtimes(d, S.T) + M * ca.mtimes(d, d.T)
    return ca.vertcat(M, S + M * d, *(G[a, b] for a, b in PAIRS))


def reduced_model(reduced: Reduced, *, frame: bool = False) -> StepModel:
    r"""Build the step model of a reduced membrane.

    Parameters
    ----------
    reduced : Reduced
        As from ``reduce_membrane``.
    frame : bool
        True: it rides on a frame that flies, with the interface of such a membrane. False: its frame is only accelerated.

    Returns
    -------
    StepModel
        Model ``reduced_membrane``, whose step has no limit.

    Notes
    -----
    Damage of a zone moves the equilibrium and softens each mode, to first order; shapes stay. On a frame that flies the
    membrane exerts

    .. math:: F = W - L^T \ddot\eta - M a,

    the load, less the change of its momentum, the mean over the step of each; M is that of a rigid body, at rates of turn
    that are small against the frequencies.
    """
    known, modes, inputs = reduced.modes.linearised, reduced.modes, reduced.inputs[:-6]
    start = known.u[[i for i, v in enumerate(known.inputs) if not v.name.startswith(ACCELERATION)]]
    damping = next(v for v in known.variables if v.name == "mass_damping")
    given = [replace(v, start=float(value)) for v, value in zip(known.inputs, known.u, strict=True)]
    shown = sorted(reduced.outputs[: reduced.n_y], key=lambda v: v.causality != "output")
    table = (replace(damping, start=reduced.damping), *given, *shown)
    variables = flying(table) if frame else table
    names = [v.name.partition("[")[0] for v in reduced.outputs]
    arrays = {name: [i for i, each in enumerate(names) if each == name] for name in dict.fromkeys(names[: reduced.n_y])}
    zones = [k for k, v in enumerate(inputs) if v.name.startswith("damage[")]
    soft = ca.DM(np.diagonal(reduced.softening, axis1=1, axis2=2).T) if zones else None
    B, Y, D, L = (ca.sparsify(ca.DM(each)) for each in (reduced.B, reduced.Y, reduced.D, modes.participation))
    size = reduced.H.shape[1]
    upper = [ca.sparsify(ca.DM(np.triu(H, 1) + np.diag(np.diag(H)) / 2.0)) for H in reduced.H]  # each pair once

    unloaded = np.array([float(k in zones) for k in range(len(reduced.inputs))])  # the square starts so
    begin = np.where(unloaded > 0.0, 0.0, np.append(-start, np.zeros(6)))

    def changes(u: Values, acceleration: ca.MX) -> ca.MX:
        columns = dict.fromkeys(v.name.partition("[")[0] for v in inputs)
        return ca.vertcat(ca.vertcat(*(getattr(u, name) for name in columns)) - start, acceleration)

    def squares(change: ca.MX) -> ca.MX:
        omega2 = ca.DM(modes.squares)
        return omega2 if soft is None else ca.fmax(omega2 + ca.mtimes(soft, change[zones]), SOFTEST * omega2)

    def seen(eta: ca.MX, change: ca.MX) -> tuple[dict[str, ca.MX], ca.MX]:
        y = reduced.start + ca.mtimes(Y, eta) + ca.mtimes(D, change)
        results = {name: y[rows] for name, rows in arrays.items()}
        if upper and size:
            z = ca.vertcat(eta, change[list(reduced.bending)])
            results["strain"] += ca.vertcat(*(ca.dot(z, ca.mtimes(H, z)) for H in upper))
        return results, y[reduced.n_y :]

    def based(u: Values) -> ca.MX:
        if frame:
            return ca.MX.zeros(6)
        a = getattr(u, ACCELERATION)
        return ca.vertcat(ca.MX.zeros(2), a, ca.MX.zeros(3)) if a.is_scalar() else ca.vertcat(a, ca.MX.zeros(3))

    def init(u: Values, p: Values) -> tuple[ReducedState, Results]:
        change = changes(u, based(u))
        rest = ca.MX(unloaded) * change + begin if known.structure.starts_in_plane else change
        eta = ca.mtimes(B, rest) / squares(change)
        results, W = seen(eta, change)
        x, eta_2dot = ReducedState(eta, ca.MX.zeros(eta.numel())), ca.mtimes(B, change) - squares(change) * eta
        return x, results | (riding(x, eta_2dot, W, change[-6:], u, p, ca.MX(0.0)) if frame else {})

    def step(x: ReducedState, u: Values, p: Values, h: ca.MX) -> tuple[ReducedState, Results]:
        a = accelerated(u, p, h) if frame else based(u)
        change = changes(u, a)
        to = advance(x, ca.mtimes(B, change), squares(change), p.mass_damping, h)
        results, W = seen(to.eta, change)
        if not frame:
            return to, results
        W += ca.mtimes(Y[reduced.n_y :, :], (x.eta - to.eta) / 2.0)  # to the middle of the step
        return to, results | riding(to, (to.eta_dot - x.eta_dot) / h, W, a, u, p, h)

    def accelerated(u: Values, p: Values, h: ca.MX) -> ca.MX:
        mount = mounting(p)
        a, w, w_dot = ca.horzsplit(
            ca.mtimes(mount.axes.T, ca.horzcat(u.frame_acceleration, u.angular_velocity, u.angular_acceleration))
        )
        middle, d = w - h / 2.0 * w_dot, mount.shift
        return ca.vertcat(a + ca.cross(w_dot, d) + ca.cross(middle, ca.cross(middle, d)), w_dot)

    def riding(x: ReducedState, eta_2dot: ca.MX, W: ca.MX, a: ca.MX, u: Values, p: Values, h: ca.MX) -> dict[str, ca.MX]:
        mount = mounting(p)
        w_end, w_dot = (ca.mtimes(mount.axes.T, each) for each in (u.angular_velocity, u.angular_acceleration))
        w, d = w_end - h / 2.0 * w_dot, mount.shift
        M = ca.DM(modes.moving)
        turning = ca.mtimes(M[:3, 3:], w)  # momentum of the rigid body that turns about the membrane's own origin
        gyration = ca.vertcat(ca.cross(w, turning), ca.cross(w, ca.mtimes(M[3:, 3:], w)))
        reaction = (1.0 - p.enclosed_pressure) * W[:6] + W[6:] - ca.mtimes(L.T, eta_2dot) - ca.mtimes(M, a) - gyration
        reaction = ca.vertcat(reaction[:3], reaction[3:] + ca.cross(d, reaction[:3]))
        relative = ca.mtimes(L.T, x.eta_dot) + ca.mtimes(M, ca.vertcat(ca.cross(w_end, d), w_end))
        momentum = ca.vertcat(relative[:3], relative[3:] + ca.cross(d, relative[:3]))
        n = known.q.size // 3
        moving, held = (known.at_rest[:n], known.nodal_mass[::3]), (known.at_rest[n:], known.held_mass)
        return frame_results(mount, ca.vertcat(_weighed(*moving, d), momentum), _weighed(*held, d), reaction)

    model = StepModel.written(
        name="reduced_membrane",
        description=f"{len(modes.squares)} modes of {known.structure.setup.title or 'a membrane'}" + ", on a frame" * frame,
        variables=variables,
        init=init,
        step=step,
        advice="Check the parameters and the inputs: far from its equilibrium a linear model is no model of the membrane.",
    )
    return replace(model, init=model.init.expand(), step=model.step.expand())  # numbers in the code: a third of the time
