"""The variables of a membrane on a mesh: one table, made from its setup."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..mistakes import Mistake, raise_any
from ..variables import Variable, input_, local, output, parameter
from .law import LAWS
from .setup import LEFT, SPRINGS, Setup

BUILT_IN = (
    parameter("mass_damping", "1/s", "Damping force per mass and velocity relative to the base", 20.0, 0.0, 1e4),
    parameter("pressure_amplitude", "Pa", "Amplitude of the built-in follower pressure", 1e4, 0.0, 1e6),
    parameter("pressure_frequency", "Hz", "Frequency of the built-in follower pressure", 7.9, 0.0, 1e4),
    parameter("pressure_phase", "rad", "Phase of the built-in follower pressure when the run begins", 0.0, -1e3, 1e3),
)
STRAIN = local("largest_strain", "1", "Largest principal nominal strain", minimum=-1.0, maximum=0.5, nominal=0.1)
MAX_STEP = local("max_step", "s", "Largest internal step; longer communication steps are divided")
COMPRESSED = 0.1  # share of the area [1] beyond which a law that carries compression is not valid


def mesh_variables(setup: Setup, zone_names: tuple[str, ...], n_nodes: int) -> tuple[Variable, ...]:
    """Make the table of a setup on a mesh of some nodes: parameters, inputs, outputs and locals."""
    known = {} if setup.calibration is None else setup.calibration.parameters
    own = [replace(row, start=known.get(row.name, row.start)) for row in (*_parameters(setup), *_inputs(setup, zone_names))]
    if lost := set(known) - {row.name for row in own}:
        text = (
            f"the model has no {sorted(lost)[0]!r}, which the calibration knows. Write back 'factors', or calibrate again."
        )
        raise_any([Mistake(("calibration", "parameters"), text)])
    return (*own, *_outputs(setup), *node_rows(setup, n_nodes), *_locals(setup))


def _parameters(setup: Setup) -> list[Variable]:
    built_in = [replace(v, start=getattr(setup, v.name, v.start)) for v in BUILT_IN]
    moduli = [
        parameter(
            f"youngs_modulus[{i + 1}]", "Pa", f"Young's modulus of region {r.group or i + 1}", r.youngs_modulus, 1.0, 1e13
        )
        for i, r in enumerate(setup.regions)
    ]
    springs = [
        parameter(f"{SPRINGS}[{k}]", "N/m", f"Stiffness of the support {s.group}", s.stiffness, 1e-9, 1e12)
        for k, s in enumerate((setup.supports[i] for i in setup.springs), 1)
    ]
    text = "Factor on what the setup says of the"
    factors = [parameter(f"{name}_factor", "1", f"{text} {name}", 1.0, 0.01, 100.0) for name in setup.factors]
    return [*moduli, *springs, *built_in, *factors]


def _inputs(setup: Setup, zone_names: tuple[str, ...]) -> list[Variable]:
    rows = []
    kinds = {
        "pressure": ("Pa", "Follower pressure", 1e4),
        "dead_pressure": ("Pa", "Pressure along the normal of the reference shape", 1e4),
        "light": ("Pa", "Pressure of light that is wholly absorbed", 1e-5),
        "force": ("N", "Force on each node", 1.0),
        "centrifugal": ("rad/s", "Rate at which the axes of the membrane turn, with its centrifugal force", 1.0),
    }
    for load in setup.loads:
        unit, text, nominal = kinds[load.kind]
        where = f" on {', '.join(load.groups)}" if load.groups else ""
        rows.append(input_(load.name, unit, text + where, load.start, -1e6, 1e6, nominal=nominal))
        if load.kind == "light":
            for axis, start in zip("xyz", (np.array(load.direction) / np.linalg.norm(load.direction)).tolist(), strict=True):
                text = f"Direction in which the light travels, along {axis}; its length does not matter"
                rows.append(input_(f"{load.name}_direction[{'xyz'.index(axis) + 1}]", "1", text, start, -1.0, 1.0))
            text = "Share of the light that is in shadow: 0 outside of an eclipse, 1 in its umbra"
            rows.append(input_(f"{load.name}_eclipse", "1", text, 0.0, 0.0, 1.0, optional=True))
    for i, axis in enumerate("xyz"):
        text = f"Acceleration of the rigid frame along {axis}, which displacements are relative to"
        rows.append(input_(f"base_acceleration[{i + 1}]", "m/s2", text, 0.0, -1e5, 1e5, nominal=10.0))
    if setup.gas is not None:
        text = "Amount of gas, times its absolute temperature, over that at the start"
        rows.append(input_("gas_amount", "1", text, 1.0, 0.0, 1e3))
    warm = [f"region {r.group or i + 1}" for i, r in enumerate(setup.regions) if setup.warms]
    for k, what in enumerate((*warm, *(f"the line {line.name}" for line in setup.warm_lines)), 1):
        text = f"Temperature of {what} over that of the reference shape"
        rows.append(input_(f"temperature[{k}]", "K", text, 0.0, -1e3, 1e3, nominal=100.0))
    for k, zone in enumerate(zone_names[: len(zone_names) - sum(line.zone for line in setup.lines)] if warm else (), 1):
        text = f"Temperature of {zone} over that of its region"
        rows.append(input_(f"zone_temperature[{k}]", "K", text, 0.0, -1e3, 1e3, nominal=100.0, optional=True))
    for support in setup.supports:
        if support.motion:
            text = f"Share of the way that the support {support.group} is moved"
            rows.append(input_(support.motion, "1", text, 1.0, -1e3, 1e3))
    for name in LEFT if setup.directional else ():
        text = f"Share of the stiffness {name.partition('_')[2]} the direction of its region that is left in"
        rows += [input_(f"{name}[{k}]", "1", f"{text} {zone}", 1.0, 0.05, 1.0) for k, zone in enumerate(zone_names, 1)]
    return [*rows, *damage_rows(zone_names)]


def damage_rows(zone_names: Sequence[str]) -> list[Variable]:
    """Make the rows of the damages."""
    text = "Lost fraction of Young's modulus in"
    return [input_(f"damage[{k}]", "1", f"{text} {name}", 0.0, 0.0, 0.95) for k, name in enumerate(zone_names, 1)]


def _outputs(setup: Setup) -> list[Variable]:
    rows = []
    for k, sensor in enumerate(setup.sensors):
        at = ", ".join(f"{x:g}" for x in sensor.point)
        along = ", ".join(f"{x:g}" for x in sensor.direction)
        length = f", mean over {sensor.gauge_length:g} m" if sensor.gauge_length else ""
        rows.append(output(f"strain[{k + 1}]", "1", f"Nominal strain at ({at}) m along ({along}){length}", nominal=0.1))
    for surface in setup.surfaces:
        rms, shift, pointing = surface.outputs
        text = f"the paraboloid that fits {surface.name} best"
        rows.append(output(rms, "m", f"Distance from {text}, root mean square over the area", minimum=0.0, nominal=1e-3))
        rows.append(output(shift, "m", f"Focal length of {text}, less that of the drawing", nominal=1e-2))
        rows.append(output(pointing, "rad", f"Angle by which the axis of {text} is off", minimum=0.0, nominal=1e-3))
    rows.append(output("displacement", "m", "Largest displacement of a node from the mesh", nominal=0.1))
    if setup.gas is not None:
        rows.append(output("gas_pressure", "Pa", "Pressure of the gas over the ambient one", nominal=1e4))
        rows.append(output("volume", "m3", "Volume that the enclosing faces bound", nominal=1.0))
    return rows


def node_rows(setup: Setup, n_nodes: int) -> list[Variable]:
    """Make the rows of the displacements of nodes, if they are exposed."""
    return [
        local(f"node[{3 * i + a + 1}]", "m", f"Displacement of node {i + 1} along {axis}", nominal=0.1)
        for i in range(n_nodes if setup.expose else 0)
        for a, axis in enumerate("xyz")
    ]


def _locals(setup: Setup) -> list[Variable]:
    largest = 1.0 if LAWS[setup.law].wrinkles else COMPRESSED
    return [
        STRAIN,
        local("displacement_ratio", "1", "Largest displacement over the size", minimum=0.0, maximum=1.0, nominal=0.1),
        local(
            "compressed_share",
            "1",
            "Share of the area under compression by Hooke's law, where a membrane would wrinkle",
            minimum=0.0,
            maximum=largest,
            nominal=0.1,
            advice='Write law = "relaxed" in its setup, so that it wrinkles.',
        ),
        MAX_STEP,
    ]
