r"""A setup on a mesh: everything about the membrane that does not change in time, as arrays.

Symbols: ``N`` nodes, ``n`` elements of a kind, ``G`` combinations of region, zone and loads that occur. Elements of one
combination share modulus, pressure and eigenstrain, so these are computed once for each.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..errors import DataError
from ..mistakes import DescriptionError, Mistake, raise_any
from ..variables import Variable
from .boundary import edge_force, free_displacements, leaking, loose, members_of, springs, unit_force, ways
from .element import Element
from .gauges import Gauge, moved_gauge, nearest_place, place_matrix
from .geometry import Geometry, geometry, stiffest, values
from .interface import mesh_variables
from .lines import LineParts, halved, line_masses, line_parts, point_masses, with_lines
from .paraboloid import BestFit, best_fits
from .setup import MAX_ORDER, MOST_REFINED, Setup
from .surface import Integers, SurfaceMesh, refined, sides_of
from .zones import Zone, divide

_DRAWN_BENT = 1e-3  # half the angle between segments [rad] that is remarked on
_FLAT = 1e-9  # share of its mean, or of the size cubed, below which an element has no area, a surface no volume
_EDGE = 0.2  # squared sine of a tilt [1] from which on the surface has an edge
_CHORDS = 0.01  # of which more is remarked on
_SHIFTED = 1.5  # times the deviation of the built shape at a sensor, by which it may be away beside
_FAR = 1e-3  # how far a sensor may be from the surface, shares of its size


@dataclass(frozen=True, eq=False)
class Elements:
    """Elements of one kind.

    Attributes
    ----------
    element : Element
        With a column per element, or, of equal squares, in units of their side.
    nodes : ndarray of int, shape (n, m)
        Nodes of each.
    combination : ndarray of int, shape (n,)
        Which of the G combinations each belongs to.
    geometry : Geometry
        Where they are.
    """

    element: Element
    nodes: Integers
    combination: Integers
    geometry: Geometry


@dataclass(frozen=True, eq=False)
class Structure:
    """A membrane ready to be written as equations.

    Attributes
    ----------
    setup : Setup
        What was asked for.
    mesh : SurfaceMesh
        The mesh.
    zone_names : tuple of str
        Names of the zones.
    elements : tuple of Elements
        By kind.
    region, zone : ndarray of int, shape (G,)
        Of each combination; zone -1 where damage does not act.
    loaded : ndarray of bool, shape (loads, G)
        Which combinations each load of the setup acts on; of forces none.
    enclosing : ndarray of bool, shape (G,)
        Which combinations enclose the gas.
    free : ndarray of bool, shape (3 N,)
        Which displacements are not held, node by node.
    mass : ndarray, shape (N,)
        Lumped masses [kg].
    stiffness : ndarray, shape (N,)
        Masses [kg] with which no element of the unstretched membrane has an angular frequency above 1/s.
    normals : ndarray, shape (N, 3)
        Unit normals of the reference surface.
    ways : ndarray, shape (supports, 3 N)
        Where each support moves nodes [m].
    springs : ndarray, shape (springs, 3 N)
        Share [1] of the stiffness of each support that is a spring.
    edge_force : ndarray, shape (3 N,)
        Force of the tension along edges [N].
    unit_forces : dict
        Nodal forces per unit of an input [1] or [m2] by the name of a dead load, shape (3 N,).
    gauges : tuple of Gauge
        By sensor.
    surfaces : tuple of BestFit
        By surface of the setup.
    lines : tuple of LineParts
        Segments of beams and cables, and bends.
    adds_lines : bool
        Whether the bound of their squared frequency is added to that of the elements, whose mass they share then.
    line_zone : ndarray of int
        Zone of each beam and cable; -1 where damage does not act.
    variables : callable
        ``variables(setup, zone_names, N) -> table`` of the model without a frame that flies. Numbers of the
        setup that stand among its parameters are chosen when the membrane starts to run: ``side_length`` (the largest
        extent of the mesh), ``thickness``, ``density``, ``poisson_ratio``, each of a setup with one region, and the motion
        of a support.
    probes : dict
        Results of the table that are displacements along z, shape (n, N): weights of those of the nodes.
    origin : ndarray, shape (3,)
        Place on the mesh [m] of the membrane's own origin.
    starts_in_plane : bool
        True: it starts without loads, flat, by Newton's method. False: in equilibrium with its inputs, by relaxation.
    """

    setup: Setup
    mesh: SurfaceMesh
    zone_names: tuple[str, ...]
    elements: tuple[Elements, ...]
    region: Integers
    zone: Integers
    loaded: NDArray[np.bool_]
    enclosing: NDArray[np.bool_]
    free: NDArray[np.bool_]
    mass: Vector
    stiffness: Vector
    normals: Vector
    ways: Vector
    springs: Vector
    edge_force: Vector
    unit_forces: dict[str, Vector]
    gauges: tuple[Gauge, ...]
    surfaces: tuple[BestFit, ...]
    lines: tuple[LineParts, ...] = ()
    adds_lines: bool = False
    line_zone: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    variables: Callable[[Setup, tuple[str, ...], int], tuple[Variable, ...]] = mesh_variables
    probes: Mapping[str, Vector] = field(default_factory=dict)
    origin: Vector = field(default_factory=lambda: np.zeros(3))
    starts_in_plane: bool = False

    @property
    def table(self) -> tuple[Variable, ...]:
        """Variables of the model without a frame that flies."""
        return self.variables(self.setup, self.zone_names, len(self.mesh.nodes))

    @property
    def slowing(self) -> Matrix:
        r"""Vectors N along the normals n [1], shape (N, 3), of what scaled inertia takes from accelerations A of nodes.

        Notes
        -----
        :math:`a = A - (|N|^2 A - N\,(N \cdot A))` with :math:`|N|^2 = 1 - 1/k`, which is A/k along the surface and A across
        it. Of the setup's own factor K a node has :math:`k = 1 + s\,(K - 1)`, where s is the film's share of its mass:
        cables, beams and point masses keep their inertia.
        """
        added = line_masses(self.setup.lines, self.mesh) + point_masses(self.setup.masses, self.mesh)
        k = 1.0 + (self.setup.inplane_mass - 1.0) * (1.0 - added / np.maximum(self.mass, 1e-300))
        return np.asarray(np.sqrt(1.0 - 1.0 / k)[:, None] * self.normals)

    @property
    def areas(self) -> Vector:
        """Reference areas of all elements [m2], in the order of the faces of the file."""
        return np.concatenate([block.geometry.areas for block in self.elements])

    @cached_property
    def order(self) -> Integers:
        """All nodes in the order of the model: first those that move, then those that are held wholly."""
        return np.argsort(~self.free.reshape(-1, 3).any(axis=1), kind="stable")

    @property
    def moving(self) -> Integers:
        """Nodes that move in some direction, in the order of the model's state."""
        return self.order[: int(self.free.reshape(-1, 3).any(axis=1).sum())]

    @property
    def volume(self) -> float | None:
        """Volume that the faces of the gas bound [m3], or all faces of a closed surface; None where there is none."""
        sides = Counter(side for _, side in sides_of(self.mesh))
        if self.setup.gas is None and min(sides.values()) < 2:
            return None
        total = 0.0
        for block in self.elements:
            bounds = self.enclosing[block.combination] | (self.setup.gas is None)
            at = np.einsum("pm,nmi->npi", values(block.element), self.mesh.nodes[block.nodes])
            swept = np.sum(at * block.geometry.normal, axis=2) * block.geometry.J @ block.element.w / 3.0
            total += float(swept[bounds].sum())
        return total

    @property
    def chord_error(self) -> float:
        """Estimate of the share of the volume [1] that is lost since elements are flatter than the curved surface.

        Notes
        -----
        Of chords that turn by an angle a against each other a circle loses a^2/6 of its area, and each is tilted by a/2
        against the normals of the nodes between them. Where the tilt is large the surface has an edge.
        """
        tilt = np.concatenate([block.geometry.tilts(self.normals[block.nodes]) for block in self.elements])
        return float(2.0 / 3.0 * np.average(np.where(tilt < _EDGE, tilt, 0.0), weights=self.areas))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What whoever builds it should know of its shape, in sentences."""
        volume = self.volume or 0.0
        found = [f"The surface encloses {volume:.6g} m3."] if abs(volume) > _FLAT * self.mesh.size**3 else []
        if self.chord_error > _CHORDS:
            found.append(
                f"Its elements are flatter than the surface: about {100.0 * self.chord_error:.1f} % of a volume is lost. "
                "Mesh more finely, or with quadrilaterals of 9 nodes and order = 2 or more."
            )
        for part in self.lines:
            t = np.diff(self.mesh.nodes[part.nodes], axis=1)
            t /= np.linalg.norm(t, axis=2, keepdims=True)
            if t.shape[1] == 2 and (sine := float(np.linalg.norm(t[:, 1] - t[:, 0], axis=1).max() / 2.0)) > _DRAWN_BENT:
                text = f"A beam is drawn bent, by {2.0 * math.degrees(math.asin(sine)):.2g} degrees at a node."
                found.append(f"{text} It is straight where nothing bends it, so it begins with a moment.")
        outside = self.zone_of_elements < 0
        if self.n_zones and np.any(outside):
            share = 100.0 * self.areas[outside].sum() / self.areas.sum()
            found.append(f"{outside.sum()} faces, {share:.2g} % of the area, are in no zone: nothing finds damage there.")
        return tuple(found)

    @property
    def n_zones(self) -> int:
        """Number of damage zones."""
        return len(self.zone_names)

    @property
    def n_face_zones(self) -> int:
        """Number of damage zones of faces; those of beams and cables follow."""
        return self.n_zones - int(np.sum(self.line_zone >= 0))

    @property
    def n_sensors(self) -> int:
        """Number of strain gauges."""
        return len(self.setup.sensors)

    @property
    def zone_of_elements(self) -> Integers:
        """Zone of each element, from 0, in the order of the faces of the file; -1 outside of all."""
        return np.asarray(self.zone[np.concatenate([block.combination for block in self.elements])])

    @property
    def zone_groups(self) -> dict[str, Integers]:
        """Faces of each zone by ``zone 0``, ``zone 1``, ..., as groups of a mesh."""
        zone = self.zone_of_elements
        return {f"zone {k}": np.flatnonzero(zone == k) for k in range(self.n_face_zones)}

    @cached_property
    def zone_places(self) -> Vector:
        """Middles of the zones on the reference shape [m], shape (zones, 3)."""
        middles = np.concatenate([self.mesh.nodes[block.nodes].mean(axis=1) for block in self.elements])
        zone = self.zone_of_elements
        found = [np.average(middles[zone == k], axis=0, weights=self.areas[zone == k]) for k in range(self.n_face_zones)]
        lines = [line.name for line in self.setup.lines if line.zone]
        return np.array([*found, *(self.mesh.nodes[self.mesh.lines[name]].mean(axis=(0, 1)) for name in lines)])

    def finer(self) -> Structure:
        """Return the membrane with spectral elements two orders higher, or those of the lowest and highest orders in four.

        Zones are divided anew where their description says where they are, and kept where it says how many parts alone.
        A force on the nodes of a group keeps its sum, shared by their masses.
        """
        zones, mesh, raised = self.setup.zones, self.mesh, 1 < self.setup.order <= MAX_ORDER - 2
        if any(zone.parts for zone in zones):
            groups = self.zone_groups
            zones = tuple(Zone(group=group, name=name) for group, name in zip(groups, self.zone_names, strict=False))
            mesh = replace(mesh, faces=mesh.faces | groups)
        order = self.setup.order + 2 * raised
        setup = replace(self.setup, order=order, zones=zones, refine=0)
        setup = replace(setup, beams=tuple(map(halved, setup.beams)), cables=tuple(map(halved, setup.cables)))
        found = make_structure(setup, refined(mesh, order, quarters=not raised))
        forces = dict(found.unit_forces)
        for load in setup.loads:
            if load.kind == "force" and load.point is None:
                shares = (found.mass - point_masses(setup.masses, found.mesh)) * forces[load.name].reshape(-1, 3).any(axis=1)
                whole = self.unit_forces[load.name].reshape(-1, 3).sum(axis=0)
                forces[load.name] = np.outer(shares / shares.sum(), whole).ravel()
        setup = replace(setup, refine=min(self.setup.refine + (not raised), MOST_REFINED))
        probes = {name: place_matrix(found.mesh, rows @ self.mesh.nodes) for name, rows in self.probes.items()}
        found = replace(found, setup=setup, unit_forces=forces, variables=self.variables, probes=probes)
        return stretched_evenly(found, self.origin) if self.starts_in_plane else found


def stretched_evenly(structure: Structure, centre: Vector) -> Structure:
    """Return a flat structure that starts in its plane, where its one support takes all nodes along, away from a centre."""
    per_metre = np.array(structure.setup.supports[0].stretch) - 1.0
    even = (per_metre * (structure.mesh.nodes - centre)).reshape(1, -1)
    return replace(structure, ways=even, origin=centre, starts_in_plane=True)


def make_structure(setup: Setup, mesh: SurfaceMesh) -> Structure:
    """Put a setup on a mesh.

    Parameters
    ----------
    setup : Setup
        Material, supports, loads, sensors.
    mesh : SurfaceMesh
        Mesh of the setup's order.

    Returns
    -------
    Structure

    Raises
    ------
    DescriptionError
        Groups that the mesh lacks, faces without a material or in two, zones that overlap or have no faces, elements without
        area or turned inside out, sensors away from the surface, or supports that leave the membrane free to move as a
        rigid body.
    """
    for _ in range(setup.refine):
        mesh = refined(mesh, setup.order)
    mesh = with_lines({"beams": setup.beams, "cables": setup.cables}, mesh)
    raise_any([*_lacking(setup, mesh), *_hit(setup, mesh), *_detached(setup, mesh)])
    region = _regions(setup, mesh)
    if np.any(region < 0):
        text = (
            f"{np.sum(region < 0)} of {mesh.n_faces} faces have no material, the first is face {np.argmin(region) + 1}. "
            "Add a region without 'group', which takes the rest."
        )
        raise DescriptionError(Mistake(("regions",), text))
    measured = [_measured(setup, mesh, k, region) for k in range(len(mesh.blocks))]
    zone_names, zone = divide(setup.zones, mesh, np.concatenate([found.areas for found in measured]))
    zoned = [line.zone for line in setup.lines]
    line_zone = np.where(zoned, len(zone_names) + np.cumsum(zoned) - 1, -1).astype(np.int64)
    zone_names += tuple(line.name for line in setup.lines if line.zone)
    acting = [members_of(mesh, load.groups) & (load.kind in ("pressure", "light")) for load in setup.loads]
    encloses = members_of(mesh, setup.gas.groups) if setup.gas else np.zeros(mesh.n_faces, dtype=bool)
    rows = np.column_stack([region, zone, *acting, encloses])
    kinds, combination = np.unique(rows, axis=0, return_inverse=True)
    mass, stiffness, normals = np.zeros(len(mesh.nodes)), np.zeros(len(mesh.nodes)), np.zeros((len(mesh.nodes), 3))
    areal = np.array([r.density * r.thickness for r in setup.regions])
    nu = np.array([r.poisson_ratio for r in setup.regions])
    D = np.array([r.youngs_modulus * r.thickness for r in setup.regions]) / (1.0 - nu**2)
    highest = [stiffest(found, nu[region[block.faces]]) for block, found in zip(mesh.blocks, measured, strict=True)]
    for block, found, high in zip(mesh.blocks, measured, highest, strict=True):
        np.add.at(mass, block.elements, found.node_areas * areal[region[block.faces]][:, None])
        np.add.at(stiffness, block.elements, found.node_areas * (high * D[region[block.faces]])[:, None])
        np.add.at(normals, block.elements, found.node_normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    of_lines, added = line_masses(setup.lines, mesh), point_masses(setup.masses, mesh)
    free, sprung = free_displacements(setup, mesh), springs(setup, mesh, mass + of_lines)
    added += of_lines
    mass += added
    raise_any([*loose(setup, mesh, free & ~sprung.any(axis=0)), *leaking(setup, mesh, free, encloses)])
    drawn = np.array([setup.supports[i].stiffness for i in setup.springs])
    stiffness += (drawn @ sprung).reshape(-1, 3).max(axis=1)
    lines: tuple[LineParts, ...] = ()
    adds_lines = False
    if setup.lines:  # both bounds hold, the lower one is taken
        moves = np.asarray(free.reshape(-1, 3).any(axis=1))
        lines, shared = (line_parts(setup.lines, mesh, each, moves) for each in (added, mass))
        film = max(float(np.max(high * (D / areal)[region[b.faces]])) for b, high in zip(mesh.blocks, highest, strict=True))
        own, whole = (sum(float(part.limit.max()) for part in parts) for parts in (lines, shared))
        adds_lines = film + whole < max(film, own)
        lines = shared if adds_lines else lines
        for part in lines:
            stiffness += part.stiffness
    return Structure(
        setup=setup,
        mesh=mesh,
        zone_names=zone_names,
        elements=tuple(
            Elements(found.placed(), block.elements, combination[block.faces], found)
            for block, found in zip(mesh.blocks, measured, strict=True)
        ),
        region=kinds[:, 0],
        zone=kinds[:, 1],
        loaded=kinds[:, 2:-1].T.astype(bool),
        enclosing=kinds[:, -1].astype(bool),
        free=free,
        mass=mass,
        stiffness=stiffness,
        normals=normals,
        ways=ways(setup, mesh),
        springs=sprung,
        edge_force=edge_force(setup, mesh, normals),
        unit_forces={
            load.name: unit_force(load, mesh, measured) for load in setup.loads if load.kind in ("force", "dead_pressure")
        },
        gauges=tuple(_gauges(setup, mesh, normals)),
        surfaces=best_fits(setup, mesh, measured),
        lines=lines,
        adds_lines=adds_lines,
        line_zone=line_zone,
    )


def _lacking(setup: Setup, mesh: SurfaceMesh) -> Iterator[Mistake]:
    """Find the groups that the mesh lacks."""
    faces, sides, points = list(mesh.faces), list(mesh.sides), list(mesh.points)
    wanted: list[tuple[tuple[str | int, ...], str, list[str], str]]
    wanted = [(("regions", i, "group"), r.group, faces, "faces") for i, r in enumerate(setup.regions) if r.group]
    wanted += [(("zones", i, "group"), z.group, faces, "faces") for i, z in enumerate(setup.zones) if z.group]
    wanted += [(("supports", i, "group"), s.group, points, "nodes") for i, s in enumerate(setup.supports)]
    wanted += [(("masses", i, "group"), m.group, points, "nodes") for i, m in enumerate(setup.masses)]
    wanted += [(("edges", i, "group"), e.group, sides, "edges") for i, e in enumerate(setup.edges)]
    for i, load in enumerate(setup.loads):
        known, what = (points, "nodes") if load.kind == "force" else (faces, "faces")
        wanted += [(("loads", i, "groups"), group, known, what) for group in load.groups]
    for i, surface in enumerate(setup.surfaces):
        wanted += [(("surfaces", i, "groups"), group, faces, "faces") for group in surface.groups]
    for group in setup.gas.groups if setup.gas else ():
        wanted.append((("gas", "groups"), group, faces, "faces"))
    for place, group, known, what in wanted:
        if group not in known:
            advice = "" if known else " It has none at all: name physical groups in gmsh."
            yield Mistake(place, f"{mesh.name} has no group {group!r} of {what}.{advice}", group, tuple(known))


def _regions(setup: Setup, mesh: SurfaceMesh) -> Integers:
    """Return which region each face belongs to, -1 for none."""
    found, mistakes, rest = np.full(mesh.n_faces, -1), [], -1
    for i, region in enumerate(setup.regions):
        if not region.group:
            rest = i
            continue
        members = mesh.faces[region.group]
        if np.any(twice := found[members] >= 0):
            text = f"face {members[twice][0] + 1} of {region.group!r} has another material already. Let no two overlap."
            mistakes.append(Mistake(("regions", i, "group"), text))
        found[members] = i
    raise_any(mistakes)
    return np.where(found < 0, rest, found)


def _measured(setup: Setup, mesh: SurfaceMesh, which: int, region: Integers) -> Geometry:
    block = mesh.blocks[which]
    axes = np.array([r.direction for r in setup.regions])[region[block.faces]]
    found = geometry(mesh.nodes[block.elements], block.order, setup.law, axes)
    bad = np.any(_FLAT * found.J.mean() >= found.J, axis=1) | ~np.all(np.isfinite(found.J), axis=1)
    # inside out: the normal turns over within the element
    bad |= np.any(np.einsum("npi,ni->np", found.normal, found.normal.mean(axis=1)) <= 0.0, axis=1)
    if np.any(bad):
        first = block.faces[np.argmax(bad)]
        middle = ", ".join(f"{x:.4g}" for x in mesh.nodes[block.elements[np.argmax(bad)]].mean(axis=0))
        text = (
            f"{np.sum(bad)} elements of {mesh.name} have no area or are turned inside out; the first is face {first + 1} "
            f"near ({middle}) m. Mesh that place again."
        )
        raise DescriptionError(Mistake(("mesh",), text))
    return found


def _hit(setup: Setup, mesh: SurfaceMesh) -> Iterator[Mistake]:
    """Find forces at points that are away from the surface."""
    for i, load in enumerate(setup.loads):
        if load.kind != "force" or load.point is None:
            continue
        away = float(np.linalg.norm(nearest_place(mesh, np.array(load.point))[0] - load.point))
        if away > max(_FAR * mesh.size, load.radius):
            text = f"load {load.name!r} at {list(load.point)} m is away from the surface by {away:.3g} m. Move it there."
            yield Mistake(("loads", i, "point"), text)


def _detached(setup: Setup, mesh: SurfaceMesh) -> Iterator[Mistake]:
    """Find places of lines on the surface where no corner of an element holds them: another mesh would not, either."""
    if not setup.lines:
        return
    ends = (0, -1)
    corners = [
        block.elements
        if block.order == 0
        else block.elements.reshape(-1, block.order + 1, block.order + 1)[:, ends][:, :, ends]
        for block in mesh.blocks
    ]
    held = mesh.nodes[np.unique(np.concatenate([each.ravel() for each in corners]))]
    for table, lines in (("beams", setup.beams), ("cables", setup.cables)):
        for i, line in enumerate(lines):
            for place in line.path:
                if isinstance(place, str) or np.linalg.norm(held - place, axis=1).min() <= _FAR * mesh.size:
                    continue
                if np.linalg.norm(nearest_place(mesh, np.array(place))[0] - place) <= _FAR * mesh.size:
                    text = f"{list(place)} m is on the surface, but at no corner of an element. Mesh one there."
                    yield Mistake((table, i, "path"), text)


def _gauges(setup: Setup, mesh: SurfaceMesh, normals: Vector) -> Iterator[Gauge]:
    mistakes, moves = [], setup.calibration.places if setup.calibration else ()
    if 0 < len(setup.sensors) < len(moves):
        text = f"there are places of {len(moves)} sensors, and the setup has {len(setup.sensors)}. Calibrate again."
        raise_any([Mistake(("calibration", "places"), text)])
    for i, sensor in enumerate(setup.sensors):
        try:
            found = moved_gauge(mesh, normals, sensor, *moves[i : i + 1])
        except DataError as error:
            mistakes.append(Mistake(("sensors", i, "direction"), f"sensor {i + 1}: {error}"))
            continue
        shifted = abs(setup.built.deviation(np.array([sensor.point]))[0]) if setup.built else 0.0  # from the drawn surface
        if found.away > _FAR * mesh.size + _SHIFTED * shifted:
            what = "its gauge reaches beyond an edge" if sensor.gauge_length else "it is away from the surface"
            text = f"sensor {i + 1} at {list(sensor.point)} m: {what} by {found.away:.3g} m. Move it onto the membrane."
            mistakes.append(Mistake(("sensors", i, "point"), text))
        yield found
    raise_any(mistakes)
