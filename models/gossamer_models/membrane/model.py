r"""A membrane as a pure step: what the FMU runs.

Symbols: ``q`` displacements [m] and ``v`` velocities [m/s] of the nodes that move, ``phase`` of the built-in pressure
[cycles], ``f`` forces [N], ``m`` masses [kg], ``c`` mass damping [1/s], ``h`` step [s], ``V`` volume of gas [m3], ``u``
inputs and ``p`` parameters by name. Of the slowest vibration ``K`` tangent [N/m], ``M`` masses [kg], ``N`` of
``Structure.slowing`` [1], ``omega`` angular frequency [1/s].
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike
from scipy.sparse.linalg import eigsh

from ..arrays import Vector
from ..errors import ConvergenceError
from ..mistakes import DescriptionError, Mistake, raise_any
from ..step_model import StepModel
from ..variables import Values
from .assembly import Forces, MembraneEquations
from .element import lobatto_points, value_matrix
from .equilibrium import in_plane, of_base, pulled, relaxed, with_nodal_loads
from .frame import RESTARTED, FrameState, flying, held_back
from .gauges import Gauge
from .newton import Newton
from .portable import FILE, structure_text
from .riding import Rider
from .setup import Setup
from .shape import SHAPE, membrane_shape
from .square import square_structure
from .statics import Equilibrium
from .structure import Structure, make_structure
from .surface import refined

STEP_FRACTION = 0.6  # of the stable step
MOST_DIFFERENTIATED = 5000  # nodes, of which an expression without loops is still of a size that compiles
STEPS_PER_CYCLE = 20.0  # of the built-in pressure, at least
_SHIFT = 1e-6  # of the largest stiffness over mass: below all frequencies, so that a slack film can be factored


@dataclass(frozen=True, slots=True)
class MembraneState:
    """State of the membrane.

    Attributes
    ----------
    q, v : casadi.MX, shape (3 M,)
        Displacements [m] beside those of supports that take nodes along, and velocities [m/s].
    phase : casadi.MX, scalar
        Phase of the built-in pressure [cycles].
    volume : casadi.MX, shape (1,) or (0,)
        Volume of the gas at the start [m3].
    frame : FrameState or casadi.MX, shape (0,)
        What is known of a frame that flies; velocities are those less that of its origin then.
    """

    q: ca.MX
    v: ca.MX
    phase: ca.MX
    volume: ca.MX
    frame: FrameState | ca.MX


@lru_cache(maxsize=4)
def _rest(structure: Structure, *, frame: bool) -> Vector | None:
    """Return where the relaxation of a structure begins, the same for all forms of its model; None where it is flat."""
    if structure.starts_in_plane:
        return None
    begin = _at_corners(structure, frame=frame) if structure.setup.order > 1 else None
    found = Newton(MembraneEquations(structure), flying(structure.table) if frame else structure.table).start(begin)
    return begin if found is None else found


def _at_corners(structure: Structure, *, frame: bool) -> Vector | None:
    """Return the equilibrium of bilinear elements between the corners of others, for the nodes of these; None without one.

    It is found in a fraction of the time, and Newton's method reaches from it what it does not reach from the mesh.
    """
    setup = replace(structure.setup, order=1, refine=0, zones=(), sensors=())
    try:
        bilinear = make_structure(setup, refined(structure.mesh, 1, quarters=False))
    except DescriptionError:  # a group has no corners
        return None
    found = _rest(bilinear, frame=frame)
    if found is None:
        return None
    at_corners, at_nodes = np.zeros((len(bilinear.mesh.nodes), 3)), np.zeros((len(structure.mesh.nodes), 3))
    at_corners[bilinear.moving] = found.reshape(-1, 3)
    (corners,), (block,) = bilinear.mesh.blocks, structure.mesh.blocks
    along = value_matrix(lobatto_points(2)[0], lobatto_points(block.order + 1)[0])
    at_nodes[block.elements] = np.kron(along, along) @ at_corners[corners.elements]
    first, last = (1 + int(each.elements.max()) for each in (block, corners))  # nodes of cables and beams alone
    at_nodes[first:] = at_corners[last:]
    return np.asarray(at_nodes[structure.moving].ravel())


def membrane_model(
    structure: Structure | None = None, *, frame: bool = False, compiled: bool = False, mapped: bool = False
) -> StepModel:
    r"""Build the step model of a membrane.

    Parameters
    ----------
    structure : Structure or None
        As from ``make_structure``; None for the square of the thesis.
    frame : bool
        True: the supports ride on a frame that moves and turns in space, and the membrane returns force and torque on it.
        False: the frame is only accelerated.
    compiled : bool
        True: arrays are tables and sums over elements are loops, for the C of an FMU. False: all in the expression, for
        CasADi's virtual machine and for batches. The numbers are the same but for round-off.
    mapped : bool
        True: the expression maps one element's function, whose C is small: for derivatives.

    Returns
    -------
    StepModel
        Model ``membrane``; ``max_step`` limits its internal step.

    Raises
    ------
    DescriptionError
        A membrane on a frame has supports that are springs, or a centrifugal load.

    Notes
    -----
    Position Verlet with the damping taken implicitly; inputs hold over the step:

    .. math::

        q_{1/2} &= q + \tfrac h2 v, \\
        v^+ &= \frac{(1 - \tfrac{ch}2)\,v + h\,(f(q_{1/2}, t + \tfrac h2)/m - a_{base})}{1 + \tfrac{ch}2}, \\
        q^+ &= q_{1/2} + \tfrac h2 v^+.

    One force evaluation, second order, self-starting, any sequence of steps. With equal steps its half-step positions are
    those of the central difference method of [1]_, whose limit :math:`h < 2/\omega_{max}` it shares, damped or not.
    Without damping it is symplectic [2]_. The phase of the built-in pressure is kept within one cycle, so that its
    round-off does not grow with time. ``max_step`` belongs to the middle of the last step, where the forces are evaluated.
    On a frame that flies the step is that of ``frame.FrameStep``, and only the acceleration relative to the frame is scaled.

    It starts at rest in equilibrium, without the built-in pressure. Inertia along the surface may be scaled, see
    ``Structure.slowing``.

    References
    ----------
    .. [1] T. Belytschko, W. K. Liu, B. Moran, K. Elkhodary, Nonlinear Finite Elements for Continua and Structures,
       2nd ed., Wiley, 2014, Section 6.2.
    .. [2] E. Hairer, C. Lubich, G. Wanner, Acta Numerica 12, 399-450, 2003, doi:10.1017/S0962492902000144.
    """
    structure = square_structure() if structure is None else structure
    setup = structure.setup
    if frame:
        raise_any([*_cannot_ride(structure)])
    variables = flying(structure.table) if frame else structure.table
    equations = MembraneEquations(structure, compiled=compiled, mapped=mapped, rest=_rest(structure, frame=frame))
    rider = Rider(equations, compiled=compiled) if frame else None
    n, t = equations.n_q, equations.arrays
    table = structure.table
    names = {v.name.partition("[")[0] for v in table}
    gauges = [_gauge(structure, gauge) for gauge in structure.gauges]
    probes = {name: ca.sparsify(ca.DM(weights[:, structure.moving])) for name, weights in structure.probes.items()}

    def only_free(vectors: ca.MX) -> ca.MX:
        return vectors if structure.free.reshape(-1, 3)[structure.moving].all() else t["free"] * vectors

    def gained(f: ca.MX, u: Values, p: Values, gain: ca.MX) -> ca.MX:  # velocity in a time ``gain``; few passes over nodes
        v = gain * equations.lightness(p) * (t["mobility"] * f) - only_free(of_base(equations, u, gain))
        if setup.inplane_mass == 1.0:
            return v
        taken = held_back(*([x[axis::3] for axis in range(3)] for x in (t["slowing"], v)))
        return only_free(v - ca.vec(ca.horzcat(*taken).T))

    def step(x: MembraneState, u: Values, p: Values, h: ca.MX) -> tuple[MembraneState, dict[str, ca.MX]]:
        phase_half, phase_end = (x.phase + p.pressure_frequency * part for part in (h / 2.0, h))
        built_in = p.pressure_amplitude * ca.sin(2.0 * np.pi * phase_half)
        drag = p.mass_damping * h / 2.0
        keep, gain = (1.0 - drag) / (1.0 + drag), h / (1.0 + drag)  # two divisions, where one per node would be slow

        phase = phase_end - ca.floor(phase_end)
        if rider is not None:
            ride = rider.advance(x.q, x.v, x.frame, partial(pulled, equations, x.volume, built_in, u=u, p=p), u, p, h)
            state = MembraneState(ride.q, ride.s, phase, x.volume, ride.frame)
            return state, results(state, u, p, ride.found, ride.gas) | ride.results
        q = x.q + h / 2.0 * x.v  # half a step
        found, f, gas = pulled(equations, x.volume, built_in, equations.positions(q, u, p), u, p)
        v = keep * x.v + gained(equations.parted(f)[0], u, p, gain)
        q = q + h / 2.0 * v  # the other half
        state = MembraneState(q, v, phase, x.volume, x.frame)
        return state, results(state, u, p, found, gas)

    def init(u: Values, p: Values) -> tuple[MembraneState, dict[str, ca.MX]]:
        q, left = (in_plane if structure.starts_in_plane else relaxed)(equations, u, p)
        state, values = begin(q, u, p)
        # where there is no equilibrium, what is left of the forces is told in the place of the phase
        return replace(state, phase=ca.if_else(left <= 1.0, state.phase, left)), values

    def begin(q: ca.MX, u: Values, p: Values) -> tuple[MembraneState, dict[str, ca.MX]]:
        at, built_in = equations.positions(q, u, p), p.pressure_amplitude * ca.sin(p.pressure_phase)
        gas = equations.gas_of_start(u)
        found = equations.forces(at, equations.shared(u, p, built_in, gas), u, p)
        phase = p.pressure_phase / (2.0 * np.pi)
        phase -= ca.floor(phase)
        V = ca.MX.zeros(0) if setup.gas is None else equations.volume(at)
        if rider is not None:
            ride = rider.start(q, found, with_nodal_loads(equations, found.f, at, u, p), gas, u, p)
            state = MembraneState(q, ride.s, phase, V, ride.frame)
            return state, results(state, u, p, found, gas) | ride.results
        state = MembraneState(q, ca.MX.zeros(n), phase, V, ca.MX.zeros(0))
        return state, results(state, u, p, found, gas)

    def results(state: MembraneState, u: Values, p: Values, found: Forces, gas: ca.MX) -> dict[str, ca.MX]:
        x = equations.positions(state.q, u, p)
        cycle = 1.0 / ca.fmax(p.pressure_frequency, 1e-300) / STEPS_PER_CYCLE
        values = {name: ca.mtimes(weights, state.q[2::3]) for name, weights in probes.items()}
        values |= {
            "largest_strain": ca.sqrt(1.0 + found.strain) - 1.0,
            "max_step": ca.fmin(2.0 * STEP_FRACTION / ca.sqrt(found.rate), cycle),
            "compressed_share": found.compressed,
        }
        if gauges:
            read = (gauge(equations.positions_at(places, state.q, u, p), equations.size(p)) for places, gauge in gauges)
            values["strain"] = ca.vertcat(*read)
        for surface in structure.surfaces:
            values |= surface(ca.reshape(x, 3, -1)[:, np.argsort(structure.order)[surface.nodes].tolist()])
        if "deflection_ratio" in names:
            values["deflection_ratio"] = ca.mmax(ca.fabs(values["w"])) / p.side_length
        if "displacement" in names or "node" in names:
            away = x - t["nodes"]
            values["displacement"] = ca.sqrt(ca.mmax(_products(away, away)))
            values["displacement_ratio"] = values["displacement"] / structure.mesh.size
            values["node"] = ca.vec(ca.reshape(away, 3, -1)[:, np.argsort(structure.order).tolist()])
        if setup.gas is not None:
            values |= {"gas_pressure": gas, "volume": equations.filled_volume(equations.volume(x), state.volume)}
        return {name: value for name, value in values.items() if name in names}

    return StepModel.written(
        name="membrane",
        description=_description(structure) + ", on a frame that flies" * frame,
        variables=variables,
        init=init,
        step=step,
        begin=begin,
        n_q=n,
        finder=None if structure.starts_in_plane else partial(_equilibrium, structure, frame=frame),
        step_limit="max_step",
        resources={
            SHAPE: membrane_shape(structure, variables),
            **({} if structure.starts_in_plane else {FILE: structure_text(structure).encode()}),
        },
        restarted=RESTARTED if frame else 0,
        residual=2 * n,
        advice=_advice(setup, frame),
        table_column=equations.column,
        tables=equations.tables,
        expression=partial(membrane_model, structure, frame=frame, mapped=True) if _is_differentiable(structure) else None,
        compiled=None if compiled else partial(membrane_model, structure, frame=frame, compiled=True),
    )


def _equilibrium(structure: Structure, *, frame: bool) -> Equilibrium:
    return Equilibrium(structure, membrane_model(structure, frame=frame))


def _is_differentiable(structure: Structure) -> bool:
    """Return whether C holds derivatives too: of a mesh that is not too large, whose start is no iteration."""
    return bool(structure.starts_in_plane and len(structure.mesh.nodes) <= MOST_DIFFERENTIATED)


def _advice(setup: Setup, frame: bool) -> str:
    motions = ", ".join(support.motion for support in setup.supports if support.motion)
    return (
        f"Check supports{motions and f' ({motions})'}, prestress, loads and damage"
        + ", the motion of the frame, and that mount_x does not lie along mount_normal" * frame
        + ": the membrane may be stretched beyond any use, or there is no equilibrium to start from."
    )


def _cannot_ride(structure: Structure) -> Iterator[Mistake]:
    if structure.setup.springs:
        text = "on a frame that flies supports are rigid. Leave out 'stiffness'."
        yield Mistake(("supports", structure.setup.springs[0], "stiffness"), text)
    for i, load in enumerate(structure.setup.loads):
        if load.kind == "centrifugal":
            text = "a frame that flies turns the membrane itself, by 'angular_velocity'. Leave out the centrifugal load."
            yield Mistake(("loads", i, "kind"), text)


def _gauge(structure: Structure, gauge: Gauge) -> tuple[list[int], Callable[[ca.MX, Any], ca.MX]]:
    r"""Return places of the positions that a gauge needs, and what writes its strain of these, at a size of the membrane.

    It is the mean of :math:`|\partial x/\partial L| - 1` over the gauge's samples.
    """
    lines = gauge.lines[:, structure.order]
    nodes = np.unique(lines.indices)
    places = (3 * nodes[:, None] + np.arange(3)).ravel().tolist()
    matrix, weights = ca.DM(lines[:, nodes].toarray().T), ca.DM(gauge.weights)

    def strain(x: ca.MX, size: Any) -> ca.MX:  # noqa: ANN401
        became = ca.mtimes(ca.reshape(x, 3, -1), matrix) / size
        return ca.mtimes(ca.sqrt(ca.sum1(became**2)), weights) - 1.0

    return places, strain


def _products(x: ca.MX, y: ca.MX) -> ca.MX:
    """Return the scalar products of vectors that lie node by node, shape (N,)."""
    return sum(x[axis::3] * y[axis::3] for axis in range(3))


def _description(structure: Structure) -> str:
    mesh = structure.mesh
    kinds = {0: "triangles"} | {
        block.order: f"quadrilaterals of order {block.order}" for block in mesh.blocks if block.order
    }
    text = " and ".join(f"{len(block.elements)} {kinds[block.order]}" for block in mesh.blocks)
    law = "" if structure.setup.law == "st_venant_kirchhoff" else f", law {structure.setup.law}"
    lines = f", {len(mesh.lines)} beams and cables" if mesh.lines else ""
    return f"{structure.setup.title or 'Membrane'}: {mesh.name}, {text}{lines}{law}"


def first_period(structure: Structure, given: Mapping[str, ArrayLike] | None = None) -> float:
    r"""Return the longest period of small vibrations about equilibrium [s], without damping and without the gas' stiffness.

    Parameters
    ----------
    structure : Structure
        The membrane.
    given : mapping of str to float, optional
        Parameters and inputs that differ from their start values.

    Raises
    ------
    ConvergenceError
        There is no equilibrium.

    Notes
    -----
    The smallest :math:`\omega` of :math:`K v = \omega^2 M v`, with the inertia of the model, scaled along the surface.
    """
    model = membrane_model(structure)
    equilibrium, first = Equilibrium(structure, model), model.variables[0]
    found = equilibrium.solve({first.name: first.start or 0.0} | dict(given or {}))
    if found.failed[0]:
        msg = "there is no equilibrium to vibrate about. Check supports, prestress and loads of the setup."
        raise ConvergenceError(msg)
    K = equilibrium.tangent(found, 0)
    N = structure.slowing[structure.moving, :, None]
    kept = np.eye(3) * (1.0 - np.sum(N**2, axis=1, keepdims=True)) + N * N.transpose(0, 2, 1)
    blocks = structure.mass[structure.moving, None, None] * np.linalg.inv(kept)
    M = scipy.sparse.block_diag([scipy.sparse.csc_array(each) for each in blocks], format="csc")
    M = M[:, equilibrium.free][equilibrium.free]
    shift = -_SHIFT * float(np.max(np.abs(K.diagonal()) / M.diagonal()))
    values = eigsh(K, 1, M=M, sigma=shift, return_eigenvectors=False)
    return math.tau / math.sqrt(max(float(values[0]), -shift))
