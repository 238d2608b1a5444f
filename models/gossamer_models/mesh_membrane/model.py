r"""A membrane on a mesh as a pure step: what the FMU of ``gossamer build membrane --mesh`` runs.

Symbols: ``q`` displacements [m] and ``v`` velocities [m/s] of all nodes, zero where they are held, ``phase`` of the built-in
pressure [cycles], ``f`` forces [N], ``m`` masses [kg], ``c`` mass damping [1/s], ``h`` step [s], ``V`` volume of gas [m3],
``u`` inputs and ``p`` parameters by name.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ..arrays import Vector
from ..element_loop import Tables
from ..membrane.stability import STEPS_PER_CYCLE
from ..step_model import StepModel
from ..variables import Results, Values
from .equations import Forces, MeshForces, rows
from .interface import mesh_variables
from .relaxation import relax
from .shape import SHAPE, shape_file
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
    """

    q: ca.MX
    v: ca.MX
    phase: ca.MX
    volume: ca.MX


def mesh_membrane_model(structure: Structure, *, compiled: bool = False) -> StepModel:
    r"""Build the step model of a membrane on a mesh.

    Parameters
    ----------
    structure : Structure
        As from ``make_structure``.
    compiled : bool
        True: arrays are tables and sums over elements are loops, for C. False: all in the expression, for CasADi's virtual
        machine. The numbers are the same but for round-off.

    Returns
    -------
    StepModel
        Model ``membrane``; ``max_step`` limits its internal step.

    Notes
    -----
    The position Verlet step of ``membrane_model``. It starts at rest, in equilibrium with all inputs and without the
    built-in pressure. Inertia along the surface may be scaled by a factor k: with n the normals of the reference surface,

    .. math:: a = f/(k m) + (1 - 1/k)\,n\,(n \cdot f)/m.
    """
    setup, n_nodes = structure.setup, len(structure.mesh.nodes)
    arrays = _arrays(structure)
    column = ca.MX.sym("t", sum(array.size for array in arrays.values())) if compiled else None
    t = _named(arrays, column)
    equations = MeshForces(structure, compiled=compiled)
    lines = [_stacked(structure, i) for i in range(len(structure.gauges))]

    def positions(q: ca.MX, u: Values) -> ca.MX:
        x = t["nodes"] + q
        for i, support in enumerate(setup.supports):
            if f"way_{i}" in t:
                x += (getattr(u, support.motion) if support.motion else 1.0) * t[f"way_{i}"]
        return x

    def all_forces(x: ca.MX, u: Values, p: Values, built_in: ca.MX, gas: ca.MX) -> Forces:
        found = equations.forces(x, _shared(structure, u, p, built_in, gas))
        f = found.f
        if "edge_force" in t:
            f += t["edge_force"]
        for name in structure.unit_forces:
            f += getattr(u, name) * t[f"unit_{name}"]
        return replace(found, f=t["free"] * f)

    def acceleration(f: ca.MX) -> ca.MX:
        a, k = f * t["inverse_mass"], setup.inplane_mass
        if k == 1.0:
            return a
        n = ca.reshape(t["normals"], 3, -1)
        along = ca.sum1(n * ca.reshape(a, 3, -1))
        return t["free"] * (a / k + (1.0 - 1.0 / k) * ca.vec(n * ca.vertcat(along, along, along)))

    def gas_pressure(x: ca.MX, u: Values, start: ca.MX) -> ca.MX:
        if setup.gas is None:
            return ca.MX(0.0)
        shrunk = all_volume(start, start) / all_volume(equations.volume(x), start)
        filled = (setup.gas.pressure + setup.gas.ambient) * u.gas_amount
        return filled * shrunk**setup.gas.exponent - setup.gas.ambient

    def all_volume(bounded: ca.MX, start: ca.MX) -> ca.MX:  # with what lies behind an open surface
        given = setup.gas.volume if setup.gas else None
        return bounded if given is None else bounded - start + given

    def step(x: Motion, u: Values, p: Values, h: ca.MX) -> tuple[Motion, Results]:
        phase_half, phase_end = (x.phase + p.pressure_frequency * part for part in (h / 2.0, h))
        built_in = p.pressure_amplitude * ca.sin(2.0 * np.pi * phase_half)
        drag = p.mass_damping * h / 2.0
        keep, gain = (1.0 - drag) / (1.0 + drag), h / (1.0 + drag)

        q = x.q + h / 2.0 * x.v  # half a step
        at = positions(q, u)
        gas = gas_pressure(at, u, x.volume)
        found = all_forces(at, u, p, built_in, gas)
        a = acceleration(found.f) - t["free"] * ca.vec(ca.repmat(u.base_acceleration, 1, n_nodes))
        v = keep * x.v + gain * a
        q = q + h / 2.0 * v  # the other half
        motion = Motion(q, v, phase_end - ca.floor(phase_end), x.volume)
        return motion, results(motion, u, p, found, gas)

    def init(u: Values, p: Values) -> tuple[Motion, Results]:
        given = [(ca.MX.sym(name, value.numel()), value) for name, value in [*vars(u).items(), *vars(p).items()]]
        by_symbol = SimpleNamespace(**{symbol.name(): symbol for symbol, _ in given})
        if column is not None:
            given.append((column, column))
        start = ca.MX(0.0 if setup.gas is None else setup.gas.pressure)

        def balance(q: ca.MX) -> tuple[ca.MX, ca.MX]:
            found = all_forces(positions(q, by_symbol), by_symbol, by_symbol, ca.MX(0.0), start)
            return found.f, found.rate

        n = 3 * n_nodes
        q = relax(balance, ca.MX.zeros(n), t["inverse_mass"], _force_scale(structure), given)
        at = positions(q, u)
        found = all_forces(at, u, p, ca.MX(0.0), start)
        phase = p.pressure_phase / (2.0 * np.pi)
        filled = ca.MX.zeros(0) if setup.gas is None else equations.volume(at)
        motion = Motion(q, ca.MX.zeros(n), phase - ca.floor(phase), filled)
        return motion, results(motion, u, p, found, start)

    def results(motion: Motion, u: Values, p: Values, found: Forces, gas: ca.MX) -> Results:
        x = positions(motion.q, u)
        away = ca.reshape(x - t["nodes"], 3, -1)
        cycle = 1.0 / ca.fmax(p.pressure_frequency, 1e-300) / STEPS_PER_CYCLE
        values: dict[str, ca.MX] = {}
        if lines:
            values["strain"] = ca.vertcat(*(_gauge_strain(x, *line) for line in lines))
        values["displacement"] = ca.sqrt(ca.mmax(ca.sum1(away**2)))
        if setup.gas is not None:
            values |= {"gas_pressure": gas, "volume": all_volume(equations.volume(x), motion.volume)}
        if setup.expose:
            values["node"] = ca.vec(away)
        values |= {
            "largest_strain": ca.sqrt(1.0 + found.strain) - 1.0,
            "displacement_ratio": values["displacement"] / structure.mesh.size,
            "compressed_share": found.compressed,
            "max_step": ca.fmin(2.0 * STEP_FRACTION / ca.sqrt(found.rate), cycle),
        }
        return values

    numbers, variables = np.concatenate(list(arrays.values())), mesh_variables(structure)
    return StepModel.written(
        name="membrane",
        description=_description(structure),
        variables=variables,
        init=init,
        step=step,
        step_limit="max_step",
        resources={SHAPE: shape_file(structure, variables)},
        advice="Check supports, prestress, loads and damage: the membrane may be stretched beyond any use, or no equilibrium "
        "was found to start from.",
        table_column=column,
        tables=Tables(numbers, equations.loops) if compiled else None,
    )


def _arrays(structure: Structure) -> dict[str, Vector]:
    """Return the arrays of the expressions by name, all but those of the elements."""
    found = {
        "nodes": structure.mesh.nodes.ravel(),
        "free": structure.free.astype(float),
        "inverse_mass": 1.0 / np.repeat(structure.mass, 3),
    }
    if structure.setup.inplane_mass > 1.0:
        found["normals"] = structure.normals.ravel()
    found |= {f"way_{i}": way for i, way in enumerate(structure.ways) if way.any()}
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
            direction = ca.vertsplit(getattr(u, f"{load.name}_direction"))
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


def _force_scale(structure: Structure) -> ca.MX:
    """Return the force [N] that an element of mean size takes to double its length."""
    size = float(np.sqrt(structure.areas.mean()))
    return ca.MX(max(r.youngs_modulus * r.thickness for r in structure.setup.regions) * size)


def _stacked(structure: Structure, which: int) -> tuple[ca.DM, Vector]:
    found = structure.gauges[which]
    lines = found.lines.tocsc()
    pattern = ca.Sparsity(*lines.shape, lines.indptr.tolist(), lines.indices.tolist())
    return ca.DM(pattern, lines.data), found.weights


def _gauge_strain(x: ca.MX, lines: ca.DM, weights: Vector) -> ca.MX:
    r"""Write the mean of :math:`|\partial x/\partial L| - 1` over the samples of a gauge."""
    became = ca.mtimes(ca.reshape(x, 3, -1), lines.T)
    return ca.mtimes(ca.sqrt(ca.sum1(became**2)), ca.DM(weights)) - 1.0


def _description(structure: Structure) -> str:
    mesh = structure.mesh
    kinds = {0: "triangles"} | {
        block.order: f"quadrilaterals of order {block.order}" for block in mesh.blocks if block.order
    }
    text = " and ".join(f"{len(block.elements)} {kinds[block.order]}" for block in mesh.blocks)
    law = "" if structure.setup.law == "st_venant_kirchhoff" else f", law {structure.setup.law}"
    return f"{structure.setup.title or 'Membrane'}: {mesh.name}, {text}{law}"
