r"""A membrane on a mesh as a pure step: what the FMU of ``gossamer build membrane --mesh`` runs.

Symbols: ``q`` displacements [m] and ``v`` velocities [m/s] of all nodes, zero where they are held, ``phase`` of the built-in
pressure [cycles], ``f`` forces [N], ``m`` masses [kg], ``c`` mass damping [1/s], ``h`` step [s], ``V`` volume of gas [m3],
``u`` inputs and ``p`` parameters by name.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ..arrays import Vector
from ..membrane.params import PARAMETERS as SQUARE
from ..membrane.stability import STEPS_PER_CYCLE
from ..step_model import StepModel
from ..variables import Results, Values, Variable, input_, local, output, parameter
from .equations import Forces, State, forces, volume
from .relaxation import relax
from .setup import Setup
from .shape import FILE, shape_file
from .structure import Structure

STEP_FRACTION = 0.6  # of the stable step
BUILT_IN = ("mass_damping", "pressure_amplitude", "pressure_frequency", "pressure_phase")


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


def mesh_membrane_model(structure: Structure) -> StepModel:
    r"""Build the step model of a membrane on a mesh.

    Parameters
    ----------
    structure : Structure
        As from ``make_structure``.

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
    setup = structure.setup
    free = ca.DM(structure.free.astype(float))
    variables = (*_parameters(setup), *_inputs(setup), *_results(structure))
    lines = [_stacked(structure, i) for i in range(len(structure.gauges))]

    def positions(q: ca.MX, u: Values) -> ca.MX:
        x = ca.DM(structure.mesh.nodes.ravel()) + q
        for support, way in zip(setup.supports, structure.ways, strict=True):
            x += (getattr(u, support.motion) if support.motion else 1.0) * ca.DM(way)
        return x

    def all_forces(x: ca.MX, u: Values, p: Values, built_in: ca.MX, gas: ca.MX) -> Forces:
        found = forces(structure, x, _state(structure, u, p, built_in, gas))
        f = found.f + ca.DM(structure.edge_force)
        for name, unit in structure.unit_forces.items():
            f += getattr(u, name) * ca.DM(unit)
        return Forces(free * f, found.rate, found.strain, found.compressed)

    def gas_pressure(x: ca.MX, u: Values, start: ca.MX) -> ca.MX:
        if setup.gas is None:
            return ca.MX(0.0)
        shrunk = all_volume(start, start) / all_volume(volume(structure, x), start)
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
        a = _acceleration(structure, found.f) - free * ca.repmat(u.base_acceleration, len(structure.mesh.nodes), 1)
        v = keep * x.v + gain * a
        q = q + h / 2.0 * v  # the other half
        motion = Motion(q, v, phase_end - ca.floor(phase_end), x.volume)
        return motion, results(motion, u, p, found, gas)

    def init(u: Values, p: Values) -> tuple[Motion, Results]:
        given = [(ca.MX.sym(name, value.numel()), value) for name, value in [*vars(u).items(), *vars(p).items()]]
        by_symbol = SimpleNamespace(**{symbol.name(): symbol for symbol, _ in given})
        start = ca.MX(0.0) if setup.gas is None else ca.MX(setup.gas.pressure)

        def balance(q: ca.MX) -> tuple[ca.MX, ca.MX]:
            found = all_forces(positions(q, by_symbol), by_symbol, by_symbol, ca.MX(0.0), start)
            return found.f, found.rate

        n = structure.free.size
        mass = np.repeat(structure.mass, 3)
        q = relax(balance, ca.MX.zeros(n), mass, _force_scale(structure), given)
        at = positions(q, u)
        found = all_forces(at, u, p, ca.MX(0.0), start)
        phase = p.pressure_phase / (2.0 * np.pi)
        filled = ca.MX.zeros(0) if setup.gas is None else volume(structure, at)
        motion = Motion(q, ca.MX.zeros(n), phase - ca.floor(phase), filled)
        return motion, results(motion, u, p, found, start)

    def results(motion: Motion, u: Values, p: Values, found: Forces, gas: ca.MX) -> Results:
        x = positions(motion.q, u)
        away = ca.reshape(x - ca.DM(structure.mesh.nodes.ravel()), 3, -1)
        cycle = 1.0 / ca.fmax(p.pressure_frequency, 1e-300) / STEPS_PER_CYCLE
        values: dict[str, ca.MX] = {}
        if lines:
            values["strain"] = ca.vertcat(*(_gauge_strain(x, *line) for line in lines))
        values["displacement"] = ca.sqrt(ca.mmax(ca.sum1(away**2)))
        if setup.gas is not None:
            values |= {"gas_pressure": gas, "volume": all_volume(volume(structure, x), motion.volume)}
        if setup.expose:
            values["node"] = ca.vec(away)
        values |= {
            "largest_strain": ca.sqrt(1.0 + found.strain) - 1.0,
            "displacement_ratio": values["displacement"] / structure.mesh.size,
            "compressed_share": found.compressed,
            "max_step": ca.fmin(2.0 * STEP_FRACTION / ca.sqrt(found.rate), cycle),
        }
        return values

    return StepModel.written(
        name="membrane",
        description=_description(structure),
        variables=variables,
        init=init,
        step=step,
        step_limit="max_step",
        resources={FILE: shape_file(structure, variables)},
        advice="Check supports, prestress, loads and damage: the membrane may be stretched beyond any use, or no equilibrium "
        "was found to start from.",
    )


def _state(structure: Structure, u: Values, p: Values, built_in: ca.MX, gas: ca.MX) -> State:
    """Return what the elements of each combination of region, zone and loads share."""
    setup, region = structure.setup, structure.region.tolist()
    nu = np.array([r.poisson_ratio for r in setup.regions])[region]
    thickness = np.array([r.thickness for r in setup.regions])[region]
    E = ca.vec(p.youngs_modulus[region])
    left = ca.MX.ones(len(region), 1)
    if setup.zones:
        left = 1.0 - ca.vec(ca.vertcat(u.damage, 0.0)[structure.zone.tolist()])  # the last is that of no zone
    pressure, light, absorbed, mirrored = ca.MX.zeros(len(region)), None, None, None
    first = True
    for load, acts in zip(setup.loads, structure.loaded, strict=True):
        value = ca.DM(acts.astype(float)) * getattr(u, load.name)
        if load.kind == "pressure":
            pressure += value + (ca.DM(acts.astype(float)) * built_in if first else 0.0)
            first = False
        elif load.kind == "light":
            light = getattr(u, f"{load.name}_direction")
            absorbed, mirrored = (1.0 - load.reflectivity) * value, load.reflectivity * value
    pressure += ca.DM(structure.enclosing.astype(float)) * gas
    eigenstrain = None
    S = np.array([r.prestress for r in setup.regions])[region]
    heat = np.array([r.thermal_expansion for r in setup.regions])[region]
    if S.any() or heat.any():
        warm = 2.0 * ca.DM(heat) * ca.vec(u.temperature[region]) if heat.any() else ca.MX(0.0)
        along, across = (2.0 * ca.DM(S[:, a] - nu * S[:, 1 - a]) / E - warm for a in range(2))
        eigenstrain = (along, across, 2.0 * ca.DM((1.0 + nu) * S[:, 2]) / E)
    D = E * left * ca.DM(thickness / (1.0 - nu**2))
    return State(D=D, pressure=pressure, eigenstrain=eigenstrain, light=light, absorbed=absorbed, mirrored=mirrored)


def _acceleration(structure: Structure, f: ca.MX) -> ca.MX:
    a = f * ca.DM(1.0 / np.repeat(structure.mass, 3))
    k = structure.setup.inplane_mass
    if k == 1.0:
        return a
    n = ca.DM(structure.normals.T)
    along = ca.sum1(n * ca.reshape(a, 3, -1))
    return ca.DM(structure.free.astype(float)) * ca.vec(
        ca.reshape(a, 3, -1) / k + (1.0 - 1.0 / k) * n * ca.repmat(along, 3, 1)
    )


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
    kinds = {0: "triangles"} | {block.order: f"quadrilaterals of order {block.order}" for block in mesh.blocks if block.order}
    text = " and ".join(f"{len(block.elements)} {kinds[block.order]}" for block in mesh.blocks)
    law = "" if structure.setup.law == "st_venant_kirchhoff" else f", law {structure.setup.law}"
    return f"{structure.setup.title or 'Membrane'}: {mesh.name}, {text}{law}"


def _parameters(setup: Setup) -> list[Variable]:
    built_in = [v for v in SQUARE if v.name in BUILT_IN]
    starts = {"mass_damping": setup.mass_damping, "pressure_amplitude": 0.0}
    rows = [Variable(**{f.name: getattr(v, f.name) for f in fields(v)} | {"start": starts.get(v.name, v.start)}) for v in built_in]
    moduli = [
        parameter(
            f"youngs_modulus[{i + 1}]", "Pa", f"Young's modulus of region {r.group or i + 1}", r.youngs_modulus, 1.0, 1e13
        )
        for i, r in enumerate(setup.regions)
    ]
    return [*moduli, *rows]


def _inputs(setup: Setup) -> list[Variable]:
    rows = []
    kinds = {
        "pressure": ("Pa", "Follower pressure", 1e4),
        "dead_pressure": ("Pa", "Pressure along the normal of the reference shape", 1e4),
        "light": ("Pa", "Pressure of light that is wholly absorbed", 1e-5),
        "force": ("N", "Force on each node", 1.0),
    }
    for load in setup.loads:
        unit, text, nominal = kinds[load.kind]
        where = f" on {', '.join(load.groups)}" if load.groups else ""
        rows.append(input_(load.name, unit, text + where, load.start, -1e6, 1e6, nominal=nominal))
        if load.kind == "light":
            for axis, start in zip("xyz", load.direction, strict=True):
                text = f"Direction in which the light travels, along {axis}"
                rows.append(input_(f"{load.name}_direction[{'xyz'.index(axis) + 1}]", "1", text, start, -1.0, 1.0))
    for i, axis in enumerate("xyz"):
        text = f"Acceleration of the rigid frame along {axis}, which displacements are relative to"
        rows.append(input_(f"base_acceleration[{i + 1}]", "m/s2", text, 0.0, -1e5, 1e5, nominal=10.0))
    if setup.gas is not None:
        text = "Amount of gas, times its absolute temperature, over that at the start"
        rows.append(input_("gas_amount", "1", text, 1.0, 0.0, 1e3))
    if any(r.thermal_expansion for r in setup.regions):
        for i, r in enumerate(setup.regions):
            text = f"Temperature of region {r.group or i + 1} over that of the reference shape"
            rows.append(input_(f"temperature[{i + 1}]", "K", text, 0.0, -1e3, 1e3, nominal=100.0))
    for support in setup.supports:
        if support.motion:
            text = f"Share of the way that the support {support.group} is moved"
            rows.append(input_(support.motion, "1", text, 1.0, -1e3, 1e3))
    for k, zone in enumerate(setup.zones):
        rows.append(input_(f"damage[{k + 1}]", "1", f"Lost fraction of Young's modulus in {zone.group}", 0.0, 0.0, 0.95))
    return rows


def _results(structure: Structure) -> list[Variable]:
    setup = structure.setup
    rows = []
    for k, sensor in enumerate(setup.sensors):
        at = ", ".join(f"{x:g}" for x in sensor.point)
        along = ", ".join(f"{x:g}" for x in sensor.direction)
        length = f", mean over {sensor.gauge_length:g} m" if sensor.gauge_length else ""
        rows.append(output(f"strain[{k + 1}]", "1", f"Nominal strain at ({at}) m along ({along}){length}", nominal=0.1))
    rows.append(output("displacement", "m", "Largest displacement of a node from the mesh", nominal=0.1))
    if setup.gas is not None:
        rows.append(output("gas_pressure", "Pa", "Pressure of the gas over the ambient one", nominal=1e4))
        rows.append(output("volume", "m3", "Volume that the enclosing faces bound", nominal=1.0))
    if setup.expose:
        for i in range(len(structure.mesh.nodes)):
            for a, axis in enumerate("xyz"):
                rows.append(local(f"node[{3 * i + a + 1}]", "m", f"Displacement of node {i + 1} along {axis}", nominal=0.1))
    largest = 1.0 if setup.law == "relaxed" else COMPRESSED
    rows += [
        local("largest_strain", "1", "Largest principal nominal strain", minimum=-1.0, maximum=0.5, nominal=0.1),
        local("displacement_ratio", "1", "Largest displacement over the size", minimum=0.0, maximum=1.0, nominal=0.1),
        local(
            "compressed_share",
            "1",
            "Share of the area under compression by Hooke's law, where a membrane would wrinkle",
            minimum=0.0,
            maximum=largest,
            nominal=0.1,
        ),
        local("max_step", "s", "Largest internal step; longer communication steps are divided"),
    ]
    return rows


COMPRESSED = 0.1  # share of the area [1] beyond which a law that carries compression is not valid
