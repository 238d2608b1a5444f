r"""Which faces each damage zone holds: groups of the mesh, or groups divided by rings, sectors, slices, a grid or evenly.

Symbols: ``n`` faces, ``at`` their middles [m], ``r`` distance from an axis [m], ``d_a``, ``d_b`` lengths of the shortest
ways to two ends of a surface, from face to face [m].
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from string import Formatter

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from ..arrays import Matrix, Vector
from ..mistakes import DescriptionError, Mistake, no_direction, not_finite, raise_any
from .surface import Integers, SurfaceMesh, sides_of

Triple = tuple[float, float, float]
ZERO: Triple = (0.0, 0.0, 0.0)
MOST_ZONES = 256
_TOUCHING = 1e-9  # shares of a turn or an extent: a middle on a border belongs beyond it, whatever its round-off
_HALVES = 0.1  # how much a cut into halves is worth beside one into even parts


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone:
    """Faces that damage makes softer together, or that are divided into such zones; these are numbered in their order.

    A face belongs where its middle is.

    Attributes
    ----------
    group : str
        Group of faces; empty for all that no other zone holds.
    name : str
        Of the zone; ``{ring}``, ``{sector}``, ``{slice}``, ``{column}``, ``{row}`` and ``{part}`` stand for its number in a
        division, from 1, and ``{group}`` for the group. Empty for the group and the division.
    rings, slices : int or tuple of float
        How many of equal width, or the distances from ``axis``, or from ``centre`` along it, between them [m].
    sectors : int or tuple of int
        How many around ``axis``, of all rings or of each from the inside out.
    centre, axis, direction : tuple of float
        A point of the axis [m], the axis, and where the first sector begins; by default along x, of an axis along x along y.
    angles : tuple of float
        Where sectors begin and end [degrees], from ``direction`` by the right hand about ``axis``.
    grid : tuple of int
        Columns along the first of ``directions`` and rows along the second, of equal width.
    directions : tuple
        Two directions.
    parts : int
        Connected parts of about equal area.
    overlap : bool
        Whether it takes faces that zones above it hold.
    """

    group: str = ""
    name: str = ""
    rings: int | tuple[float, ...] = 0
    sectors: int | tuple[int, ...] = 0
    slices: int | tuple[float, ...] = 0
    centre: Triple = ZERO
    axis: Triple = (0.0, 0.0, 1.0)
    direction: Triple = ZERO
    angles: tuple[float, float] = (0.0, 360.0)
    grid: tuple[int, ...] = ()
    directions: tuple[Triple, Triple] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    parts: int = 0
    overlap: bool = False

    @property
    def divisions(self) -> tuple[str, ...]:
        """What numbers its zones have."""
        around = {"ring": self.rings, "sector": self.sectors, "slice": self.slices}
        if self.parts or self.grid:
            return ("part",) if self.parts else ("column", "row")
        return tuple(name for name, value in around.items() if value)

    def __post_init__(self) -> None:
        raise_any([*_mistakes_of(self)])


def _mistakes_of(zone: Zone) -> Iterator[Mistake]:
    """Find values of a zone that do not go together."""
    yield from [*not_finite(zone, "centre", "direction"), *no_direction(zone, "axis")]
    ways = [name for name in ("parts", "grid") if getattr(zone, name)]
    ways += ["rings, sectors and slices"] * bool(zone.rings or zone.sectors or zone.slices)
    if len(ways) > 1:
        yield Mistake((ways[0],), f"a zone is divided one way, and this one by {' and by '.join(ways)}. Choose one.")
    for name in ("rings", "slices"):
        value = getattr(zone, name)
        if isinstance(value, tuple) and (any(a >= b for a, b in pairwise(value)) or not all(map(math.isfinite, value))):
            yield Mistake((name,), f"{name!r} are not in order. Write rising lengths, or how many there are.")
    for name, values in (("sectors", zone.sectors), ("rings", zone.rings), ("slices", zone.slices), ("parts", zone.parts)):
        counts = values if isinstance(values, tuple) and name == "sectors" else (values,)
        if any(isinstance(k, int) and not 0 <= k <= MOST_ZONES for k in counts) or (len(counts) > 1 and 0 in counts):
            yield Mistake((name,), f"{name!r} is {values}. Write 1 to {MOST_ZONES}.")
    rings = zone.rings or 1 if isinstance(zone.rings, int) else len(zone.rings) + 1
    if isinstance(zone.sectors, tuple) and len(zone.sectors) != rings:
        text = f"'sectors' has {len(zone.sectors)} numbers for {rings} rings. Write one number of each, from the inside out."
        yield Mistake(("sectors",), text)
    if zone.grid and (len(zone.grid) != 2 or not all(1 <= k <= MOST_ZONES for k in zone.grid)):
        yield Mistake(("grid",), f"'grid' is {list(zone.grid)}. Write how many columns and rows: [4, 3].")
    across = math.hypot(*np.cross(zone.axis, zone.direction).tolist())
    if any(zone.direction) and across <= 1e-9 * math.hypot(*zone.axis) * math.hypot(*zone.direction):
        yield Mistake(("direction",), "'direction' lies along 'axis'. Write where the first sector begins, across it.")
    low, high = zone.angles
    if not 0.0 < high - low <= 360.0:
        text = f"'angles' is [{low:g}, {high:g}]. Write where sectors begin and end in degrees, the lower one first."
        yield Mistake(("angles",), text)
    known = ("group", *zone.divisions)
    try:
        parts = [part for _, *part in Formatter().parse(zone.name) if part[0] is not None]
    except ValueError:
        parts = [["?", "", None]]
    if any(name not in known or spec or conversion for name, spec, conversion in parts) or not zone.name.isprintable():
        text = f"'name' is {zone.name!r}. In braces it can hold {', '.join(known)}: \"ring {{ring}}\" of a zone with rings."
        yield Mistake(("name",), text)


def divide(zones: tuple[Zone, ...], mesh: SurfaceMesh, areas: Vector) -> tuple[tuple[str, ...], Integers]:
    """Divide zones.

    Parameters
    ----------
    zones : tuple of Zone
        As a setup has them.
    mesh : SurfaceMesh
        The mesh, which has their groups.
    areas : ndarray, shape (n,)
        Of the faces [m2].

    Returns
    -------
    tuple of str
        Names of the zones.
    ndarray of int, shape (n,)
        The zone of each face, from 0; -1 for none.

    Raises
    ------
    DescriptionError
        Zones that overlap, have the same name or no faces, or are too many.
    """
    at = np.concatenate([mesh.nodes[block.elements].mean(axis=1) for block in mesh.blocks])
    rows: list[tuple[int, str, Integers]] = []
    owner = np.full(mesh.n_faces, -1)
    for i in sorted(range(len(zones)), key=lambda i: not zones[i].group):  # the rest last
        zone = zones[i]
        members = mesh.faces[zone.group] if zone.group else np.flatnonzero(owner < 0)
        if np.any(taken := owner[members] >= 0) and not zone.overlap:
            other = zones[owner[members][taken][0]].group
            text = (
                f"{np.sum(taken)} faces of {zone.group!r} are in the zone {other!r} already, the first is face "
                f"{members[taken][0] + 1}. Let no two zones overlap, or write overlap = true to take them from it."
            )
            raise DescriptionError(Mistake(("zones", i, "group"), text))
        if not len(members):
            raise DescriptionError(Mistake(("zones", i), "this zone holds no faces: others hold all of them."))
        owner[members] = i
        rows += [(i, name, faces) for name, faces in _divided(i, zones, mesh, members, at, areas)]
    rows = [(i, name, faces[owner[faces] == i]) for i, name, faces in sorted(rows, key=lambda row: row[0])]
    raise_any([*_unusable(rows, areas)])
    found = np.full(mesh.n_faces, -1)
    for k, (_, _, faces) in enumerate(rows):
        found[faces] = k
    return tuple(name for _, name, _ in rows), found


def _unusable(rows: list[tuple[int, str, Integers]], areas: Vector) -> Iterator[Mistake]:
    """Find zones without faces, names that stand twice, and too many zones."""
    if len(rows) > MOST_ZONES:
        yield Mistake(("zones",), f"there are {len(rows)} zones. Divide into {MOST_ZONES} at most.")
    for i in dict.fromkeys(i for i, _, _ in rows):
        empty = [name for other, name, faces in rows if other == i and not len(faces)]
        if empty:
            more = f" and {len(empty) - 3} more" * (len(empty) > 3)
            text = (
                f"no face has its middle in {', '.join(map(repr, empty[:3]))}{more}: there is nothing, or the mesh is too "
                f"coarse there, with faces of {np.sqrt(areas.mean()):.2g} m. Mesh more finely, or divide less."
            )
            yield Mistake(("zones", i), text)
    for name, count in Counter(name for _, name, _ in rows).items():
        if count > 1:
            i = [i for i, other, _ in rows if other == name][-1]
            text = f"{count} zones have the name {name!r}. Give each its own: in 'name' {{ring}}, {{part}} ... are numbers."
            yield Mistake(("zones", i), text)


def _divided(
    i: int, zones: tuple[Zone, ...], mesh: SurfaceMesh, members: Integers, at: Matrix, areas: Vector
) -> Iterator[tuple[str, Integers]]:
    """Give the zones of one table by name."""
    zone = zones[i]
    cells = np.zeros((len(members), 0), dtype=np.int64)  # the place of each face in the division
    if zone.parts:
        if zone.parts > len(members):
            text = f"{len(members)} faces cannot make {zone.parts} parts. Mesh more finely, or divide less."
            raise DescriptionError(Mistake(("zones", i, "parts"), text))
        neighbours = _neighbours(mesh, at)[members][:, members]
        cells = _parts(i, neighbours, areas[members], zone.parts)[:, None]
        shape: list[tuple[int, ...]] = [(k,) for k in range(zone.parts)]
    elif zone.divisions:
        corners = np.unique(np.concatenate([b.elements[np.isin(b.faces, members)].ravel() for b in mesh.blocks]))
        cells, shape = (_of_grid if zone.grid else _around_axis)(zone, at[members], mesh.nodes[corners])
    else:
        shape = [()]
    alone = zone.divisions and (len(zones) == 1 or not zone.group)
    usual = " ".join([*(() if alone else ("{group}",)), *(f"{part} {{{part}}}" for part in zone.divisions)])
    for place in shape:
        numbers = {part: k + 1 for part, k in zip(zone.divisions, place, strict=True)}
        name = (zone.name or usual).format(group=zone.group or "rest", **numbers)
        yield name, members[np.all(cells == np.array(place, dtype=np.int64), axis=1)]


def _of_grid(zone: Zone, at: Matrix, nodes: Matrix) -> tuple[Integers, list[tuple[int, ...]]]:
    """Return column and row of each face, and all of them."""
    found = []
    for count, direction in zip(zone.grid, zone.directions, strict=True):
        along = np.array(direction) / np.linalg.norm(direction)
        found.append(_between(at @ along, _evenly(nodes @ along, count)))
    return np.column_stack(found), [(a, b) for b in range(zone.grid[1]) for a in range(zone.grid[0])]


def _around_axis(zone: Zone, at: Matrix, nodes: Matrix) -> tuple[Integers, list[tuple[int, ...]]]:
    """Return which ring, sector and slice each face is in, of those that the zone has, and all of them."""
    axis = np.array(zone.axis) / np.linalg.norm(zone.axis)
    first = np.array(zone.direction) if any(zone.direction) else np.eye(3)[1 if abs(axis[0]) > 0.9 else 0]
    first = first - (first @ axis) * axis
    first /= np.linalg.norm(first)

    def seen(points: Matrix) -> tuple[Vector, Vector, Vector]:
        away = points - np.array(zone.centre)
        x, y = away @ first, away @ np.cross(axis, first)
        return np.hypot(x, y), np.arctan2(y, x), away @ axis

    (r, angle, height), (radii, _, heights) = seen(at), seen(nodes)
    borders = _evenly(radii, zone.rings) if isinstance(zone.rings, int) else np.array(zone.rings)
    ring = _between(r, borders)
    rings = len(borders) + 1
    counts = [zone.sectors or 1] * rings if isinstance(zone.sectors, int) else list(zone.sectors)
    low, high = np.deg2rad(zone.angles)
    turned = np.mod(angle - low + _TOUCHING, 2.0 * np.pi)
    sector = (turned / (high - low) * np.array(counts)[ring]).astype(np.int64)  # beyond the last: in no zone
    borders = _evenly(heights, zone.slices) if isinstance(zone.slices, int) else np.array(zone.slices)
    found = {"ring": ring, "sector": sector, "slice": _between(height, borders)}
    every = [
        {"ring": a, "sector": b, "slice": c} for c in range(len(borders) + 1) for a in range(rings) for b in range(counts[a])
    ]
    beyond = sector >= np.array(counts)[ring]
    cells = np.where(beyond[:, None], -1, np.column_stack([found[name] for name in zone.divisions]))
    return cells, [tuple(place[name] for name in zone.divisions) for place in every]


def _evenly(values: Vector, count: int) -> Vector:
    """Return the borders between stretches of equal length; a count of 0 makes one."""
    return np.linspace(values.min(), values.max(), max(count, 1) + 1)[1:-1]


def _between(values: Vector, borders: Vector) -> Integers:
    return np.searchsorted(borders, values + _TOUCHING * np.ptp(values), side="right")


def _neighbours(mesh: SurfaceMesh, at: Matrix) -> csr_array:
    """Return how far the middles of faces with a common side are from each other [m], shape (n, n)."""
    by_side: dict[frozenset[int], list[int]] = {}
    for face, side in sides_of(mesh):
        by_side.setdefault(side, []).append(face)
    pairs = np.array([pair for faces in by_side.values() for pair in pairwise(faces)]).reshape(-1, 2)
    a, b = pairs.T
    away = np.linalg.norm(at[a] - at[b], axis=1)
    graph = coo_array((np.r_[away, away], (np.r_[a, b], np.r_[b, a])), shape=(mesh.n_faces, mesh.n_faces))
    return csr_array(graph)


def _parts(i: int, neighbours: csr_array, areas: Vector, count: int) -> Integers:
    """Divide faces into connected parts of about equal area; those that do not touch share the parts by their area."""
    sheets, sheet = connected_components(neighbours, directed=False)
    if sheets > count:
        text = f"these faces are {sheets} sheets that do not touch. Write parts = {sheets} or more."
        raise DescriptionError(Mistake(("zones", i, "parts"), text))
    total = np.bincount(sheet, weights=areas)
    each = np.ones(sheets, dtype=np.int64)
    for _ in range(count - sheets):
        each[np.argmax(np.where(np.bincount(sheet) > each, total / each, 0.0))] += 1
    found, first = np.zeros(len(areas), dtype=np.int64), 0
    for k, parts in enumerate(each.tolist()):
        members = np.flatnonzero(sheet == k)
        found[members] = first + _bisected(neighbours[members][:, members], areas[members], parts)
        first += parts
    return found


def _bisected(neighbours: csr_array, areas: Vector, count: int) -> Integers:
    r"""Cut a connected surface in two again and again.

    Notes
    -----
    Faces are ordered by :math:`d_a - d_b`, and those with less than some value are one side of the cut. Along the shortest
    way to a this never rises, and along that to b it never falls, so both sides are connected as long as faces with the same
    value, as on a branch off the way from a to b, stay together.
    """
    n = len(areas)
    if count == 1:
        return np.zeros(n, dtype=np.int64)
    away = dijkstra(neighbours, indices=[0])[0]
    d_a = dijkstra(neighbours, indices=[int(np.argmax(away))])[0]
    d_b = dijkstra(neighbours, indices=[int(np.argmax(d_a))])[0]
    value = np.round((d_a - d_b) / d_a.max(), 9)
    order = np.argsort(value, kind="stable")
    cuts = 1 + np.flatnonzero(np.diff(value[order]) > 0.0)  # faces before the cut; a and b are never on one side
    share = np.cumsum(areas[order])[cuts - 1] / areas.sum()
    before = np.clip(np.round(count * share), 1, count - 1).astype(np.int64)
    fits = (before <= cuts) & (count - before <= n - cuts)
    off = np.abs(share - before / count) + _HALVES * np.abs(before / count - 0.5)
    best = np.argmin(np.where(fits, off, np.inf))
    cut, left = int(cuts[best]), int(before[best])
    found = np.empty(n, dtype=np.int64)
    for members, parts, first in ((order[:cut], left, 0), (order[cut:], count - left, left)):
        found[members] = first + _bisected(neighbours[members][:, members], areas[members], parts)
    return found
