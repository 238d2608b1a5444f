"""Membranes that a judge does not know: other material, other places of sensors, damage that does not fill its zones.

Symbols: ``z`` zones, ``n`` records, ``s`` sensors, ``T`` samples, ``d`` damage [1]. Every change is one of a setup on a
mesh; the square is taken for a setup, too, where none of its own parameters says it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays import Matrix
from ..campaign import CampaignPlan, Mesh
from ..detector.thesis_tables import Damages
from ..membrane import Structure, Zone, make_structure
from ..membrane.gauges import place_matrix
from ..membrane.portable import structure_text
from ..membrane.setup import Load, Region
from ..membrane.surface import refined

QUARTERS = 4  # parts of a zone that are damaged by themselves
STRIP = 0.25  # of the size of a zone: half of the width of a band
HOLE = 0.9  # damage of a quarter of a zone [1]
DEPTH = (0.2, 0.5)  # of other partial damage [1]
OF_SQUARE = {"prestrain": "edge_displacement", "modulus": "youngs_modulus"}
STRIPS = 8
TILT = 0.05  # of the pressure, from one side to the other
ROUGH = 0.01  # deviation of the pressure's noise over its amplitude
HARMONIC = 0.03  # of the pressure, at twice its frequency


def with_material(mesh: Mesh, what: str, factor: float) -> Mesh | None:
    """Return the membrane with another modulus, density, thickness or prestrain; None of one without prestrain."""
    if mesh.setup is None:
        name = OF_SQUARE.get(what, what)
        return replace(mesh, parameters={**mesh.parameters, name: factor * mesh.base(name)})
    if what == "modulus":
        moduli = [name for name in mesh.settable if name.startswith("youngs_modulus[")]
        return replace(mesh, parameters={**mesh.parameters, **{name: factor * mesh.base(name) for name in moduli}})
    stressed = any(any(region.prestress) for region in mesh.setup.regions)
    if what == "prestrain" and not stressed:
        return None

    def changed(region: Region) -> Region:
        if what == "prestrain":
            x, y, shear = region.prestress
            return replace(region, prestress=(factor * x, factor * y, factor * shear))
        changed: dict[str, Any] = {what: factor * getattr(region, what)}
        return replace(region, **changed)

    return replace(mesh, setup=replace(mesh.setup, regions=tuple(map(changed, mesh.setup.regions))))


def as_setup(mesh: Mesh) -> Mesh:
    """Return the square as a setup on its mesh, with the same response; any other membrane as it is."""
    if mesh.setup is not None:
        return mesh
    structure = mesh.structure
    known: dict[str, Any] = {name: mesh.base(name) for name in mesh.settable}
    of_region = {name: known[name] for name in ("youngs_modulus", "poisson_ratio", "density", "thickness")}
    of_load = {name: known[name] for name in ("mass_damping", "pressure_amplitude", "pressure_frequency")}
    setup = replace(structure.setup, regions=(replace(structure.setup.regions[0], **of_region),), **of_load)
    kept = {name: known[name] for name in ("edge_displacement", "pressure_phase", "pressure")}
    return Mesh(setup=setup, carried=structure_text(replace(structure, setup=setup)), parameters=kept)


def with_moved_sensors(mesh: Mesh, share: float) -> Mesh:
    """Return the membrane with every sensor again at two other places, off by a share of the size (``off_place``)."""
    mesh = as_setup(mesh)
    setup, structure = mesh.setup, mesh.structure
    assert setup is not None
    low, high = structure.mesh.nodes.min(axis=0), structure.mesh.nodes.max(axis=0)
    first, second = np.argsort(low - high)[:2]  # the longest axes
    moved = []
    for axis in (first, second):
        for sensor in setup.sensors:
            inward = np.sign((low + high)[axis] / 2.0 - sensor.point[axis]) or 1.0
            point = np.array(sensor.point) + inward * share * (high - low)[first] * np.eye(3)[axis]
            x, y, z = (place_matrix(structure.mesh, point[None]) @ structure.mesh.nodes)[0].tolist()  # on a curved surface
            moved.append(sensor if sensor.line else replace(sensor, point=(x, y, z)))
    return replace(mesh, setup=replace(setup, sensors=(*setup.sensors, *moved)))


def quartered(mesh: Mesh, parts: int = QUARTERS) -> Mesh:
    """Return the membrane with every element in four and every zone in some parts; 0 for whole zones."""
    structure = mesh.structure
    own = as_setup(mesh)
    groups = structure.zone_groups
    finer = refined(replace(structure.mesh, faces=structure.mesh.faces | groups), structure.setup.order)
    assert own.setup is not None
    setup = replace(own.setup, zones=tuple(Zone(group=group, parts=parts) for group in groups), refine=0)
    return replace(own, setup=setup, carried=structure_text(make_structure(setup, finer)))


def whole_zones(structure: Structure, damage: Matrix) -> Matrix:
    """Return the mean over the area of each zone, shape (n, z), of the damage of its parts, shape (n, QUARTERS z)."""
    part = structure.zone_of_elements
    area = np.bincount(part[part >= 0], structure.areas[part >= 0]).reshape(-1, QUARTERS)
    return np.asarray((damage.reshape(len(damage), -1, QUARTERS) * area).sum(axis=2) / area.sum(axis=1))


def partial_damages(kind: str, structure: Structure, count: int, seed: int) -> Damages:
    """List damages of parts of zones.

    Parameters
    ----------
    kind : {"band", "corner", "hole"}
        A band across the membrane that holds half of each zone on its way, the parts around a point where zones meet, or
        nearly all of one part.
    structure : Structure
        Of ``quartered``.
    count, seed : int
        How many, and what the places and depths follow from.

    Returns
    -------
    tuple of dict
        Damage [1] by part, from 1.
    """
    random, places = np.random.default_rng(seed), structure.zone_places
    size = math.sqrt(QUARTERS * structure.areas.sum() / len(places))
    corners = list(_corners(structure)) if kind == "corner" else []
    found = []
    for _ in range(count):
        part, d = int(random.integers(len(places))), float(random.uniform(*DEPTH))
        if kind == "corner":
            parts = corners[int(random.integers(len(corners)))]
        elif kind == "band":
            near = np.linalg.norm(places - places[part], axis=1)
            across = places[np.argsort(near)[1]] - places[part]
            away = (places - places[part]) @ across / np.linalg.norm(across)
            parts = np.flatnonzero(np.abs(away) < STRIP * size).tolist()
        else:
            parts, d = [part], HOLE
        found.append({int(k) + 1: d for k in parts})
    return tuple(found)


def _corners(structure: Structure) -> Iterator[list[int]]:
    """Give the parts around each node where most zones meet."""
    around: dict[int, set[int]] = {}
    for block in structure.elements:
        for nodes, part in zip(block.nodes.tolist(), structure.zone[block.combination].tolist(), strict=True):
            for node in nodes if part >= 0 else ():
                around.setdefault(node, set()).add(part)
    zones = {node: len({part // QUARTERS for part in parts}) for node, parts in around.items()}
    most = max(zones.values())
    yield from (sorted(around[node]) for node, count in zones.items() if count == most)


def tilted(mesh: Mesh) -> Mesh:
    """Return the membrane with every element in four and a load on each strip along its longest axis."""
    mesh = quartered(mesh, 0)
    structure, setup = mesh.structure, mesh.setup
    assert setup is not None
    middles = np.concatenate([structure.mesh.nodes[block.nodes].mean(axis=1) for block in structure.elements])
    along = middles[:, np.argmax(np.ptp(structure.mesh.nodes, axis=0))]
    strip = np.minimum(STRIPS * (along - along.min()) / np.ptp(along) * (1.0 + 1e-9), STRIPS - 1).astype(int)
    groups = {f"strip_{k}": np.flatnonzero(strip == k) for k in np.unique(strip).tolist()}
    loads = tuple(Load(name=f"of_{group}", groups=(group,)) for group in groups)
    setup = replace(setup, loads=(*setup.loads, *loads))
    finer = replace(structure.mesh, faces=structure.mesh.faces | groups)
    return replace(mesh, setup=setup, carried=structure_text(make_structure(setup, finer)))


def tilt(plan: CampaignPlan) -> dict[str, Matrix]:
    """Return the loads that tilt the built-in pressure, shape (n, T) [Pa]."""
    known = {name: plan.membrane.base(name) for name in plan.membrane.settable}
    t = plan.step * np.arange(1.0, plan.steps + 1.0)
    pressure = np.sin(2.0 * np.pi * known["pressure_frequency"] * t + known["pressure_phase"])
    pressure *= TILT * known["pressure_amplitude"]
    names = [name for name in known if name.startswith("of_strip_")]
    at = {name: (int(name.rpartition("_")[2]) + 0.5) / STRIPS - 0.5 for name in names}
    return {name: np.tile(share * pressure, (plan.count, 1)) for name, share in at.items()}


def rough_pressure(plan: CampaignPlan) -> dict[str, Matrix]:
    """Return white noise of the pressure by its load, shape (n, T) [Pa]."""
    size = ROUGH * plan.membrane.base("pressure_amplitude")
    return {_pressure(plan): size * np.random.default_rng(plan.seed).standard_normal((plan.count, plan.steps))}


def harmonic(plan: CampaignPlan) -> dict[str, Matrix]:
    """Return a part of the pressure at twice its frequency by its load, with a phase of each record, shape (n, T) [Pa]."""
    size = HARMONIC * plan.membrane.base("pressure_amplitude")
    phase = np.random.default_rng(plan.seed).uniform(0.0, 2.0 * np.pi, (plan.count, 1))
    turns = 2.0 * plan.membrane.base("pressure_frequency") * plan.step * np.arange(1, plan.steps + 1)
    return {_pressure(plan): size * np.sin(2.0 * np.pi * turns + phase)}


def _pressure(plan: CampaignPlan) -> str:
    return next(load.name for load in plan.membrane.structure.setup.loads if load.kind == "pressure")
