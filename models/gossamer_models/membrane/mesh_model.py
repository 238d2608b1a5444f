r"""A membrane on a mesh as a pure step: what the FMU of ``gossamer build membrane --mesh`` runs.

Symbols: ``q`` displacements [m] and ``v`` velocities [m/s] of all nodes, zero where they are held, ``phase`` of the built-in
pressure [cycles], ``f`` forces [N], ``m`` masses [kg], ``c`` mass damping [1/s], ``h`` step [s], ``V`` volume of gas [m3],
``u`` inputs and ``p`` parameters by name.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ..arrays import Vector
from ..element_loop import Tables
from ..mistakes import Mistake, raise_any
from ..shape import SHAPE
from ..step_model import StepModel
from ..variables import Values
from .equations import Forces, MeshForces, rows
from .equilibrium import relax
from .frame import RESTARTED, FrameState
from .gauges import Gauge
from .interface import mesh_variables
from .mesh_shape import mesh_shape
from .riding import Rider
from .stability import STEPS_PER_CYCLE
from .structure import Structure

STEP_FRACTION = 0.6  # of the stable step


@dataclass(frozen=True, slots=True)
class Motion:
    """State of the membrane.

    Attributes
    ----------
    q, v : casadi.MX, shape (3 N,)
        Displacements [m] beside those of moved supports, and velocities [m/s].
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


def mesh_membrane_model(structure: Structure, *, frame: bool = False, compiled: bool = False) -> StepModel:
    r"""Build the step model of a membrane on a mesh.

    Parameters
    ----------
    structure : Structure
        As from ``make_structure``.
    frame : bool
        True: the supports ride on a frame that moves and turns in space, and the membrane returns force and torque on it.
        False: the frame is only accelerated.
    compiled : bool
        True: arrays are tables and sums over elements are loops, for C. False: all in the expression, for CasADi's virtual
        machine. The numbers are the same but for round-off.

    Returns
    -------
    StepModel
        Model ``membrane``; ``max_step`` limits its internal step.

    Raises
    ------
    DescriptionError
        A membrane on a frame with nodes that are held in some directions only, or with scaled inertia.

    Notes
    -----
    The position Verlet step of ``membrane_model``, or on a frame that of ``frame.FrameStep``. It starts at rest, in
    equilibrium with all inputs and without the built-in pressure. Inertia along the surface may be scaled by a factor k:
    with n the normals of the reference surface,

    .. math:: a = f/(k m) + (1 - 1/k)\,n\,(n \cdot f)/m.
    """
    setup, n_nodes = structure.setup, len(structure.mesh.nodes)
    if frame:
        raise_any([*_cannot_ride(structure)])
    arrays = _arrays(structure)
    column = ca.MX.sym("t", sum(array.size for array in arrays.values())) if compiled else None
    t = _named(arrays, column)
    equations = MeshForces(structure, compiled=compiled)

    def positions(q: ca.MX, u: Values) -> ca.MX:
        x = t["start"] + q
        for i, support in enumerate(setup.supports):
            if support.motion:
                x += getattr(u, support.motion) * t[f"way_{i}"]
        return x

    def all_forces(x: ca.MX, u: Values, p: Values, built_in: ca.MX, gas: ca.MX) -> Forces:
        return equations.forces(x, _shared(structure, u, p, built_in, gas))

    def with_dead_loads(f: ca.MX, u: Values) -> ca.MX:
        if "edge_force" in t:
            f += t["edge_force"]
        for name in structure.unit_forces:
            f += getattr(u, name) * t[f"unit_{name}"]
        return f

    def weight(u: Values) -> ca.MX:  # that the acceleration of the frame takes
        return t["mass"] * ca.vec(ca.repmat(u.base_acceleration, 1, n_nodes))

    def acceleration(f: ca.MX) -> ca.MX:
        a, k = t["mobility"] * f, setup.inplane_mass
        if k == 1.0:
            return a
        a = f / t["mass"]
        across = ca.MX.zeros(3 * n_nodes)
        for axis in range(3):
            across[axis::3] = _products(a, t["normals"])
        return t["free"] * (a / k + (1.0 - 1.0 / k) * t["normals"] * across)

    def filled(u: Values) -> ca.MX:  # pressure of the gas at its volume of the start, with the ambient one
        return (setup.gas.pressure + setup.gas.ambient) * u.gas_amount if setup.gas else ca.MX(0.0)

    def all_volume(bounded: ca.MX, start: ca.MX) -> ca.MX:  # with what lies behind an open surface
        given = setup.gas.volume if setup.gas else None
        return bounded if given is None else bounded - start + given

    def step(x: Motion, u: Values, p: Values, h: ca.MX) -> tuple[Motion, dict[str, ca.MX]]:
        phase_half, phase_end = (x.phase + p.pressure_frequency * part for part in (h / 2.0, h))
        built_in = p.pressure_amplitude * ca.sin(2.0 * np.pi * phase_half)
        drag = p.mass_damping * h / 2.0
        keep, gain = (1.0 - drag) / (1.0 + drag), h / (1.0 + drag)

        def pulled(at: ca.MX) -> tuple[Forces, ca.MX, ca.MX]:
            if setup.gas is None:
                found = all_forces(at, u, p, built_in, ca.MX(0.0))
                return found, with_dead_loads(found.f, u), ca.MX(0.0)
            V = all_volume(equations.volume(at), x.volume)
            inside = filled(u) * (all_volume(x.volume, x.volume) / V) ** setup.gas.exponent
            gas = inside - setup.gas.ambient
            found = all_forces(at, u, p, built_in, gas)
            found = replace(found, rate=found.rate + setup.gas.exponent * inside / V * _gas_mobility(structure))
            return found, with_dead_loads(found.f, u), gas

        phase = phase_end - ca.floor(phase_end)
        if frame:
            ride = rider(u, p).advance(x.q, x.v, x.frame, pulled, u, h)
            motion = Motion(ride.q, ride.s, phase, x.volume, ride.frame)
            return motion, results(motion, u, p, ride.found, ride.gas) | ride.results
        q = x.q + h / 2.0 * x.v  # half a step
        found, f, gas = pulled(positions(q, u))
        a = acceleration(f - weight(u))
        v = keep * x.v + gain * a
        q = q + h / 2.0 * v  # the other half
        motion = Motion(q, v, phase, x.volume, x.frame)
        return motion, results(motion, u, p, found, gas)

    def rider(u: Values, p: Values) -> Rider:
        return Rider(p, ca.reshape(positions(ca.MX.zeros(3 * n_nodes), u), 3, -1), t["free"], t["mass"])

    def init(u: Values, p: Values) -> tuple[Motion, dict[str, ca.MX]]:
        given = [(ca.MX.sym(name, value.numel()), value) for name, value in [*vars(u).items(), *vars(p).items()]]
        by_symbol = SimpleNamespace(**{symbol.name(): symbol for symbol, _ in given})
        if column is not None:
            given.append((column, column))
        ambient = setup.gas.ambient if setup.gas else 0.0
        start = filled(u) - ambient

        # masses of its own, so that neither a small element nor a stiff region nor inplane_mass delays the others
        shared, names = _shared(structure, by_symbol, by_symbol, ca.MX(0.0), filled(by_symbol) - ambient), rows(setup)
        stiffer = ca.mmax(by_symbol.youngs_modulus / ca.DM([r.youngs_modulus for r in setup.regions]))
        parts = [ca.fabs(shared[names.index(name), :]) for name in ("along", "across", "shear") if name in names]
        strained = ca.mmax(sum(parts)) if parts else 0.0

        def balance(q: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
            found = equations.forces(positions(q, by_symbol), shared)
            f = with_dead_loads(found.f, by_symbol) - (0.0 if frame else weight(by_symbol))
            strain = ca.fmax(found.strain, 0.0)
            rate = stiffer * (1.0 + 2.0 * strain + strained)  # rho c^2 over D is below what is in brackets
            scale = _force_scale(structure) * (1.0 + strain) ** 1.5  # as forces grow, and their rounding
            return t["free"] * f, rate, scale

        n = 3 * n_nodes
        q = relax(balance, ca.MX.zeros(n), t["stiffness"], given)
        at = positions(q, u)
        found = all_forces(at, u, p, ca.MX(0.0), start)
        phase = p.pressure_phase / (2.0 * np.pi)
        V = ca.MX.zeros(0) if setup.gas is None else equations.volume(at)
        phase -= ca.floor(phase)
        if frame:
            ride = rider(u, p).start(q, found, with_dead_loads(found.f, u), start, u)
            motion = Motion(q, ride.s, phase, V, ride.frame)
            return motion, results(motion, u, p, found, start) | ride.results
        motion = Motion(q, ca.MX.zeros(n), phase, V, ca.MX.zeros(0))
        return motion, results(motion, u, p, found, start)

    def results(motion: Motion, u: Values, p: Values, found: Forces, gas: ca.MX) -> dict[str, ca.MX]:
        x = positions(motion.q, u)
        away = x - t["nodes"]
        cycle = 1.0 / ca.fmax(p.pressure_frequency, 1e-300) / STEPS_PER_CYCLE
        values: dict[str, ca.MX] = {}
        if structure.gauges:
            values["strain"] = ca.vertcat(*(_gauge_strain(x, gauge) for gauge in structure.gauges))
        values["displacement"] = ca.sqrt(ca.mmax(_products(away, away)))
        if setup.gas is not None:
            values |= {"gas_pressure": gas, "volume": all_volume(equations.volume(x), motion.volume)}
        if setup.expose:
            values["node"] = away
        values |= {
            "largest_strain": ca.sqrt(1.0 + found.strain) - 1.0,
            "displacement_ratio": values["displacement"] / structure.mesh.size,
            "compressed_share": found.compressed,
            "max_step": ca.fmin(2.0 * STEP_FRACTION / ca.sqrt(found.rate), cycle),
        }
        return values

    numbers, variables = np.concatenate(list(arrays.values())), mesh_variables(structure, frame=frame)
    return StepModel.written(
        name="membrane",
        description=_description(structure) + ", on a frame that flies" * frame,
        variables=variables,
        init=init,
        step=step,
        step_limit="max_step",
        resources={SHAPE: mesh_shape(structure, variables)},
        restarted=RESTARTED if frame else 0,
        advice="Check supports, prestress, loads and damage: the membrane may be stretched beyond any use, or no "
        "equilibrium was found to start from.",
        table_column=column,
        tables=Tables(numbers, equations.loops) if compiled else None,
    )


def _cannot_ride(structure: Structure) -> Iterator[Mistake]:
    held = ~structure.free.reshape(-1, 3)
    if np.any(held.any(axis=1) != held.all(axis=1)):
        text = (
            'on a frame that flies a node is held in all directions or in none. Write fixed = "xyz" for each support.'
        )
        yield Mistake(("supports",), text)
    if structure.setup.inplane_mass > 1.0:
        text = "on a frame that flies inertia must be that of the mass. Leave out 'inplane_mass'."
        yield Mistake(("inplane_mass",), text)


def _arrays(structure: Structure) -> dict[str, Vector]:
    """Return the arrays of the expressions by name, all but those of the elements."""
    found = {
        "nodes": structure.mesh.nodes.ravel(),
        "start": structure.mesh.nodes.ravel() + sum(structure.ways[[not s.motion for s in structure.setup.supports]]),
        "free": structure.free.astype(float),
        "mass": np.repeat(structure.mass, 3),
        "stiffness": np.repeat(structure.stiffness, 3),
        "mobility": structure.free / np.repeat(structure.mass, 3),  # one over the mass, zero where held
    }
    if structure.setup.inplane_mass > 1.0:
        found["normals"] = structure.normals.ravel()
    found |= {f"way_{i}": structure.ways[i] for i, support in enumerate(structure.setup.supports) if support.motion}
    if structure.edge_force.any():
        found["edge_force"] = structure.edge_force
    return found | {f"unit_{name}": force for name, force in structure.unit_forces.items()}


def _named(arrays: dict[str, Vector], column: ca.MX | None) -> dict[str, ca.MX]:
    """Return the arrays as constants, or as parts of a column that holds them one after another."""
    if column is None:
        return {name: ca.MX(ca.DM(array)) for name, array in arrays.items()}
    ends = np.cumsum([0, *(array.size for array in arrays.values())]).tolist()
    return dict(zip(arrays, ca.vertsplit(column, ends), strict=True))


def _shared(structure: Structure, u: Values, p: Values, built_in: ca.MX, gas: ca.MX) -> ca.MX:
    """Write what elements share, a row of ``rows`` by a column of each combination of region, zone and loads."""
    setup, region = structure.setup, structure.region.tolist()
    nu = np.array([r.poisson_ratio for r in setup.regions])[region]
    thickness = np.array([r.thickness for r in setup.regions])[region]
    E = ca.vec(p.youngs_modulus[region])
    left = ca.MX.ones(len(region), 1)
    if setup.zones:
        left = 1.0 - ca.vec(ca.vertcat(u.damage, 0.0)[structure.zone.tolist()])  # the last is that of no zone
    values = {"D": E * left * ca.DM(thickness / (1.0 - nu**2)), "nu": ca.MX(ca.DM(nu))}
    pressure, oscillates = ca.DM(structure.enclosing.astype(float)) * gas, True
    for load, acts in zip(setup.loads, structure.loaded, strict=True):
        on = ca.DM(acts.astype(float))
        if load.kind == "pressure":
            pressure += on * (getattr(u, load.name) + (built_in if oscillates else 0.0))
            oscillates = False
        elif load.kind == "light":
            value = on * getattr(u, load.name)
            values |= {"absorbed": (1.0 - load.reflectivity) * value, "mirrored": load.reflectivity * value}
            along = getattr(u, f"{load.name}_direction")
            direction = ca.vertsplit(along / ca.fmax(ca.norm_2(along), 1e-300))
            values |= {
                f"light_{axis}": ca.repmat(part, len(region), 1) for axis, part in zip("xyz", direction, strict=True)
            }
    values["pressure"] = pressure
    S = np.array([r.prestress for r in setup.regions])[region]
    heat = np.array([r.thermal_expansion for r in setup.regions])[region]
    warm = 2.0 * ca.DM(heat) * ca.vec(u.temperature[region]) if heat.any() else 0.0
    for a, name in enumerate(("along", "across")):
        values[name] = 2.0 * ca.DM(S[:, a] - nu * S[:, 1 - a]) / E - warm
    values["shear"] = 2.0 * ca.DM((1.0 + nu) * S[:, 2]) / E
    return ca.horzcat(*(values[name] for name in rows(setup))).T


def _gas_mobility(structure: Structure) -> float:
    r"""Return :math:`\sum A_i^2/m_i` [m4/kg] of the nodes that enclose the gas: with its stiffness, a squared frequency."""
    areas = np.zeros((len(structure.mesh.nodes), 3))
    for block in structure.elements:
        on = structure.enclosing[block.combination]
        np.add.at(areas, block.nodes[on], block.node_normals[on])
    moves = structure.free.reshape(-1, 3)
    return float(np.sum(moves * areas**2 / structure.mass[:, None]))


def _force_scale(structure: Structure) -> float:
    """Return the force [N] that an element of mean size takes to double its length, or a little for rounding far out."""
    size = max(float(np.sqrt(structure.areas.mean())), 0.05 * float(np.abs(structure.mesh.nodes).max()))
    return max(r.youngs_modulus * r.thickness for r in structure.setup.regions) * size


def _gauge_strain(x: ca.MX, gauge: Gauge) -> ca.MX:
    r"""Write the mean of :math:`|\partial x/\partial L| - 1` over the samples of a gauge."""
    nodes = np.unique(gauge.lines.indices)
    places = (3 * nodes[:, None] + np.arange(3)).ravel()
    became = ca.mtimes(ca.reshape(x[places.tolist()], 3, -1), ca.DM(gauge.lines[:, nodes].toarray().T))
    return ca.mtimes(ca.sqrt(ca.sum1(became**2)), ca.DM(gauge.weights)) - 1.0


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
    return f"{structure.setup.title or 'Membrane'}: {mesh.name}, {text}{law}"
