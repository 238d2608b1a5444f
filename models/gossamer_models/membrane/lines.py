r"""Cables and beams, lines of nodes along edges of a mesh or between its nodes; what their parts exert. Point masses.

Symbols: ``x`` node positions [m]; of a segment between two nodes ``l`` length, ``L`` unstretched length [m], ``t`` unit
tangent [1], ``EA`` stiffness [N]; of a bend, two segments and the node between them, ``EI`` [N m2], ``l_v`` length that
bends there [m], ``theta`` angle between the segments, ``s`` square of the difference of their tangents [1]; ``G`` stiffness
at a node [N/m], ``m`` masses [kg].

There are no rotations among the unknowns: an angle is one between segments. So beams neither twist nor shear.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NoReturn, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..element_loop import ElementLoop
from ..mistakes import DescriptionError, Mistake, outside, raise_any
from .surface import Integers, SurfaceMesh
from .zones import Triple

MOST_PARTS = 1000
_SAME = 1e-9  # of the size: places that are nearer are one


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """What cables and beams have in common.

    Attributes
    ----------
    name : str
        Of the group of its nodes; of one with a path ``<name>_start`` and ``<name>_end`` are groups, too.
    group : str
        Group of edges that it runs along.
    path : tuple of str or tuple of float
        Or where it runs, straight from each to the next: groups of one node, or places [m].
    parts : int
        Equal segments between two of these.
    youngs_modulus, area, density : float
        [Pa], [m2], [kg/m3].
    thermal_expansion : float
        Strain per rise of temperature [1/K]; with it the line has an input ``temperature``, behind those of regions.
    zone : bool
        Whether it is a damage zone; these follow those of faces, beams first.
    """

    name: str
    youngs_modulus: float
    area: float
    density: float
    group: str = ""
    path: tuple[str | Triple, ...] = ()
    parts: int = 10
    thermal_expansion: float = 0.0
    zone: bool = False

    def __post_init__(self) -> None:
        raise_any([*self._mistakes()])

    def _mistakes(self) -> Iterator[Mistake]:
        limits = {"youngs_modulus": (1.0, 1e13), "area": (1e-16, 1e2), "density": (1e-3, 1e5), "parts": (1, MOST_PARTS)}
        yield from outside(self, **limits, thermal_expansion=(-1.0, 1.0))
        if not self.name.isidentifier():
            text = f"'name' is {self.name!r}. Use letters, digits and underscores, and no digit at the start."
            yield Mistake(("name",), text)
        if bool(self.group) == bool(self.path) or len(self.path) == 1:
            text = "it runs along the edges of a 'group', or along a 'path' of two places or more. Write one of them."
            yield Mistake(("path",), text)


_L = TypeVar("_L", bound=Line)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cable(Line):
    """A line that carries tension alone.

    Attributes
    ----------
    tension : float
        Where it is drawn [N].
    length : float
        Unstretched, in place of ``tension`` [m]; 0 for as drawn.
    """

    tension: float = 0.0
    length: float = 0.0

    def _mistakes(self) -> Iterator[Mistake]:
        yield from Line._mistakes(self)
        most = self.youngs_modulus * self.area / 2.0
        if not 0.0 <= self.tension <= most:
            text = f"'tension' is {self.tension:g} N, and a cable carries tension alone. Write 0 to {most:g}."
            yield Mistake(("tension",), text)
        yield from outside(self, length=(0.0, 1e6))
        if self.length and self.tension:
            yield Mistake(("length",), "'length' and 'tension' both say how taut it is. Leave out one of them.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Beam(Line):
    """A slender line that carries tension and compression and bends alike about all axes; straight where nothing bends it.

    Attributes
    ----------
    second_moment : float
        Of area [m4].
    clamped : tuple of str
        Groups of nodes: ends that they hold keep place and direction.
    """

    second_moment: float
    clamped: tuple[str, ...] = ()

    def _mistakes(self) -> Iterator[Mistake]:
        yield from Line._mistakes(self)
        yield from outside(self, second_moment=(1e-24, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class PointMass:
    """Mass at nodes.

    Attributes
    ----------
    group : str
        Group of points, edges or faces, or of the nodes of a line.
    mass : float
        Of all nodes together, shared evenly [kg].
    """

    group: str
    mass: float

    def __post_init__(self) -> None:
        raise_any([*outside(self, mass=(0.0, 1e6))])


@dataclass(frozen=True, eq=False)
class LineParts:
    """Segments or bends of all lines.

    Attributes
    ----------
    nodes : ndarray of int, shape (n, 2) or (n, 3)
        Of each.
    line : ndarray of int, shape (n,)
        Which line each belongs to.
    own : ndarray, shape (n, 3) or (n, 1)
        Of segments ``EA``, ``L`` and 1 for a cable, else 0; of bends ``EI/l_v`` [N m].
    limit : ndarray, shape (n,)
        Bound of the squared angular frequency [1/s2].
    stiffness : ndarray, shape (N,)
        Masses [kg] with which none has an angular frequency above 1/s.
    """

    nodes: Integers
    line: Integers
    own: Matrix
    limit: Vector
    stiffness: Vector

    def loop(self, nodes: Integers, lines: int, shared: int) -> ElementLoop:
        """Write the forces of one as a function, for all of them in a loop over the nodes of lines alone, rising.

        The first of ``shared`` numbers of a line is the share of its stiffness that is left [1], a second its expansion [1].
        """
        k = self.nodes.shape[1]
        x, d, g = ca.SX.sym("x", 3 * k), ca.SX.sym("d", shared), ca.SX.sym("g", self.own.shape[1] + 1)
        results = ca.cse((_stretched if k == 2 else _bent)(x, d, g))
        function = ca.Function(f"line_{k}", [x, d, g], results)
        own, largest = np.column_stack([self.own, self.limit]), ("largest",) * (len(results) - 1)
        at = np.searchsorted(nodes, self.nodes)
        return ElementLoop(f"lines_{k}", function, k, largest, len(nodes), lines, at, self.line, own)


def _stretched(x: ca.SX, d: ca.SX, g: ca.SX) -> list[ca.SX]:
    r"""Return forces, bound of the squared frequency [1/s2] and twice the Green-Lagrange strain of a segment.

    Notes
    -----
    Hooke's law in the nominal strain, :math:`N = EA\,(l/L - 1)`, less that of heat; a cable without tension is slack. Across
    it the stiffness :math:`N/l` is below :math:`EA/L` along it.
    """
    EA, L, is_cable, limit = ca.vertsplit(g)
    e = x[1::2] - x[0::2]
    l = ca.norm_2(e)
    left, *warm = ca.vertsplit(d)
    strain = l / L - 1.0 - sum(warm)
    N = EA * left * ca.if_else(is_cable, ca.fmax(strain, 0.0), strain)
    f = N / l * e
    return [ca.vec(ca.horzcat(f, -f).T), limit * left, (l / L) ** 2 - 1.0]


def _bent(x: ca.SX, d: ca.SX, g: ca.SX) -> list[ca.SX]:
    r"""Return forces and bound of the squared frequency [1/s2] of a bend.

    Notes
    -----
    The energy :math:`\tfrac12 EI\,\theta^2/l_v`, where [1]_ has :math:`2 \tan(\theta/2)` for the angle, with
    :math:`\theta^2 = 4 \arcsin^2(\sqrt s/2) = s + s^2/12 + s^3/90 + \dots`: its moment is 1e-5 off at 18 degrees, 1e-3
    at 45. A circle is exact.

    References
    ----------
    .. [1] M. Bergou, M. Wardetzky, S. Robinson, B. Audoly, E. Grinspun, ACM Transactions on Graphics 27(3), 63, 2008,
       doi:10.1145/1360612.1360662.
    """
    (k, limit), left = ca.vertsplit(g), d[0]
    a, b = x[1::3] - x[0::3], x[2::3] - x[1::3]
    s = ca.sumsqr(b / ca.norm_2(b) - a / ca.norm_2(a))
    energy = k * left / 2.0 * s * (1.0 + s / 12.0 + s**2 / 90.0)
    return [-ca.gradient(energy, x), limit * left]


def with_lines(tables: Mapping[str, Sequence[Line]], mesh: SurfaceMesh) -> SurfaceMesh:
    """Lay lines on a mesh.

    Parameters
    ----------
    tables : mapping of str to sequence of Line
        By the names of the tables of the setup.
    mesh : SurfaceMesh
        With or without the nodes of these lines.

    Returns
    -------
    SurfaceMesh
        With nodes of paths, and one behind each end that is clamped; with ``lines`` and their groups.

    Raises
    ------
    DescriptionError
        Groups that the mesh lacks or that are no single node, a line without length, or a clamp at no end.
    """
    lines = [(table, i, line) for table, rows in tables.items() for i, line in enumerate(rows)]
    if not lines:
        return mesh
    n = 1 + max(int(block.elements.max()) for block in mesh.blocks)  # of faces
    nodes, points = [*mesh.nodes[:n]], {name: rows[rows < n] for name, rows in mesh.points.items()}
    laid: dict[str, Integers] = {}
    clamped: list[tuple[int, int, int, int]] = []
    mistakes: list[Mistake] = []
    for number, (table, i, line) in enumerate(lines):
        try:
            if line.name in laid or line.name in mesh.faces or line.name in mesh.sides:
                text = f"there is a group {line.name!r} already. Give each its own name."
                _refuse("name", text)
            if line.group:
                if line.group not in mesh.sides:
                    _refuse("group", f"{mesh.name} has no group {line.group!r} of edges.", line.group, mesh.sides)
                rows = mesh.sides[line.group]
                pairs = np.concatenate([rows[:, k : k + 2] for k in range(rows.shape[1] - 1)])
            else:
                ends = [_node(place, nodes, points, mesh) for place in line.path]
                pairs = _along(ends, line.parts, nodes)
                points |= {f"{line.name}_start": np.array(ends[:1]), f"{line.name}_end": np.array(ends[-1:])}
            length = np.linalg.norm(np.diff(np.array(nodes)[pairs], axis=1), axis=2)
            if length.min() <= _SAME * mesh.size:
                _refuse("path", "two places of it in a row are one. Leave out one of them.")
            laid[line.name], points[line.name] = pairs, np.unique(pairs)
            for group in getattr(line, "clamped", ()):
                clamped += [(*each, number) for each in _clamps(group, pairs, nodes, points)]
        except DescriptionError as error:
            mistakes += [Mistake((table, i, *mistake.place), *mistake[1:]) for mistake in error.mistakes]
    raise_any(mistakes)
    held = np.array(clamped, dtype=np.int64).reshape(-1, 4)
    return replace(mesh, nodes=np.array(nodes), points=points, lines=laid, clamped=held)


def taken(tables: Mapping[str, Sequence[Line]], mesh: SurfaceMesh) -> Iterator[Mistake]:
    """Find lines whose groups would take the place of groups of a mesh that has no lines yet."""
    for table, rows in tables.items():
        for i, line in enumerate(rows):
            own = [line.name, *(f"{line.name}_{end}" for end in ("start", "end") if line.path)]
            for name in mesh.points.keys() & set(own):
                text = f"{mesh.name} has a group {name!r}, and the line {line.name!r} makes one of that name. Rename one."
                yield Mistake((table, i, "name"), text)


def _refuse(key: str, text: str, name: str = "", known: Iterable[str] = ()) -> NoReturn:
    raise DescriptionError(Mistake((key,), text, name, tuple(known)))


def _node(place: str | Triple, nodes: list[Vector], points: dict[str, Integers], mesh: SurfaceMesh) -> int:
    """Return the node at a place of a path; where there is none, a new one."""
    if isinstance(place, str):
        if place not in points:
            _refuse("path", f"{mesh.name} has no group {place!r} of nodes.", place, points)
        if len(points[place]) != 1:
            _refuse("path", f"{place!r} holds {len(points[place])} nodes. A path runs through groups of one node each.")
        return int(points[place][0])
    if not np.all(np.isfinite(place)):
        _refuse("path", f"{list(place)} is no place. Write three finite numbers.")
    away = np.linalg.norm(np.array(nodes) - np.array(place), axis=1)
    if away.min() <= _SAME * mesh.size:
        return int(away.argmin())
    nodes.append(np.array(place))
    return len(nodes) - 1


def _along(ends: list[int], parts: int, nodes: list[Vector]) -> Integers:
    """Return the segments of a path, shape (n, 2), and add the nodes inside it."""
    chain = ends[:1]
    for end in ends[1:]:
        begin, first = nodes[chain[-1]], len(nodes)
        nodes += [begin + k / parts * (nodes[end] - begin) for k in range(1, parts)]
        chain += [*range(first, len(nodes)), end]
    return np.column_stack([chain[:-1], chain[1:]])


def _clamps(group: str, pairs: Integers, nodes: list[Vector], points: dict[str, Integers]) -> Iterator[tuple[int, int, int]]:
    """Add a node behind each end of a line that a group holds; give it, the end, and the next node."""
    if group not in points:
        _refuse("clamped", f"there is no group {group!r} of nodes.", group, points)
    count = np.bincount(pairs.ravel())
    ends = [int(node) for node in points[group] if node < len(count) and count[node] == 1]
    if not ends:
        _refuse("clamped", f"no end of the beam is in the group {group!r}. Name one that holds an end.")
    for end in ends:
        (pair,) = pairs[(pairs == end).any(axis=1)]
        inner = int(pair.sum()) - end
        nodes.append(2.0 * nodes[end] - nodes[inner])
        yield len(nodes) - 1, end, inner


def point_masses(masses: Sequence[PointMass], mesh: SurfaceMesh) -> Vector:
    """Return the point masses at each node [kg], shape (N,)."""
    found = np.zeros(len(mesh.nodes))
    for each in masses:
        found[mesh.points[each.group]] += each.mass / len(mesh.points[each.group])
    return found


def line_masses(lines: Sequence[Line], mesh: SurfaceMesh) -> Vector:
    """Return the mass of lines at each node [kg], shape (N,)."""
    mass = np.zeros(len(mesh.nodes))
    for line in lines:
        pairs, _, L = _segments(line, mesh)
        np.add.at(mass, pairs, (line.density * line.area * L / 2.0)[:, None])
    return mass


def line_parts(lines: Sequence[Line], mesh: SurfaceMesh, mass: Vector, free: NDArray[np.bool_]) -> tuple[LineParts, ...]:
    r"""Return the segments of all lines, and their bends if there are beams.

    Parameters
    ----------
    lines : sequence of Line
        As they lie on the mesh.
    mesh : SurfaceMesh
        The mesh.
    mass, free : ndarray, shape (N,)
        Masses that lines move [kg], and whether nodes move in some direction.

    Notes
    -----
    Each part takes a share of the mass of its nodes that goes with its stiffness there, so that the largest of their squared
    frequencies, :math:`\sum_i G_i/m_i` over the nodes of a part, bounds that of all.
    """
    nodes, _, lengths = zip(*(_segments(line, mesh) for line in lines), strict=True)
    of, L = np.repeat(np.arange(len(lines)), [len(pairs) for pairs in nodes]), np.concatenate(lengths)
    EA = np.array([line.youngs_modulus * line.area for line in lines])[of]
    slack = np.array([isinstance(line, Cable) for line in lines], dtype=float)[of]
    at = np.concatenate(nodes)
    own, slope = np.column_stack([EA, L, slack]), np.ones(at.shape)
    segments = _part(at, of, own, EA / L, slope, mass, free)

    bends = [
        _bends(pairs, mesh.clamped[mesh.clamped[:, 3] == k])
        if isinstance(line, Beam)
        else pairs[:0].repeat(2, axis=1)[:, :3]
        for k, (line, pairs) in enumerate(zip(lines, nodes, strict=True))
    ]
    of, at = np.repeat(np.arange(len(lines)), [len(each) for each in bends]), np.concatenate(bends)
    a, b = (np.linalg.norm(mesh.nodes[at[:, i + 1]] - mesh.nodes[at[:, i]], axis=1) for i in (0, 1))
    EI = np.array([line.youngs_modulus * line.second_moment if isinstance(line, Beam) else 0.0 for line in lines])[of]
    k = EI / np.where(np.isin(at[:, 0], mesh.clamped[:, 0]), b / 2.0, (a + b) / 2.0)
    bent = _part(at, of, k[:, None], k, np.column_stack([1.0 / a, 1.0 / a + 1.0 / b, 1.0 / b]), mass, free)
    return (segments, bent) if len(at) else (segments,)


def _part(
    at: Integers, line: Integers, own: Matrix, k: Vector, slope: Matrix, mass: Vector, free: NDArray[np.bool_]
) -> LineParts:
    """Return parts of stiffness k by what they do at their nodes, with their bounds."""
    G = np.zeros(len(mass))
    np.add.at(G, at, k[:, None] * slope**2)
    limit = np.sum((free * G / np.maximum(mass, 1e-300))[at], axis=1)
    return LineParts(at, line, own, limit, at.shape[1] * G)


def halved(line: _L) -> _L:
    """Return a line of a mesh whose elements are divided in four."""
    return replace(line, parts=min(2 * line.parts, MOST_PARTS))


def _segments(line: Line, mesh: SurfaceMesh) -> tuple[Integers, Vector, Vector]:
    """Return the segments of a line, shape (n, 2), their drawn and their unstretched lengths [m]."""
    pairs = mesh.lines[line.name]
    drawn = np.linalg.norm(mesh.nodes[pairs[:, 1]] - mesh.nodes[pairs[:, 0]], axis=1)
    if not isinstance(line, Cable):
        return pairs, drawn, drawn
    share = line.length / drawn.sum() if line.length else 1.0 / (1.0 + line.tension / (line.youngs_modulus * line.area))
    return pairs, drawn, share * drawn


def _bends(pairs: Integers, clamped: Integers) -> Integers:
    """Return the nodes of each bend of a line, the one that bends in the middle; first those behind clamped ends."""
    found = [tuple(row) for row in clamped[:, :3].tolist()]
    for node in np.flatnonzero(np.bincount(pairs.ravel()) == 2).tolist():
        one, other = pairs[(pairs == node).any(axis=1)]
        found.append((int(one.sum()) - node, node, int(other.sum()) - node))
    return np.array(found, dtype=np.int64).reshape(-1, 3)
