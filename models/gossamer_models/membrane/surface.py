r"""A surface of quadrilaterals and triangles in space, with its named groups; and the same with more unknowns.

Symbols: ``m`` nodes of an element, ``n`` elements of a kind, ``p`` order, ``s``, ``t`` parent coordinates [1]. A
quadrilateral holds (p + 1)^2 nodes at the Gauss-Lobatto-Legendre points, s fastest; neighbours share the nodes of their
common side, found by the numbers of its corners and not by distance, so that two sheets may lie on each other.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..errors import DataError
from .element import lobatto_points, value_matrix
from .reading import MeshFile

Integers = NDArray[np.int64]

NINE = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]  # nodes: corners, sides, middle
_TURNED = [0, 3, 2, 1, 7, 6, 5, 4, 8]  # nodes of a quadrilateral that faces the other way
# of a quadrilateral: places on a grid of 5 x 5 of the nine nodes of each quarter, corners first, then sides, then middle
_QUARTERS = [[5 * (j + b) + i + a for a, b in NINE] for i, j in NINE[:4]]
_WHOLE = [5 * 2 * b + 2 * a for a, b in NINE]
_CORNERS, _SIDES = [0, 4, 24, 20], [2, 14, 22, 10]


@dataclass(frozen=True, eq=False)
class Block:
    """All elements of one kind.

    Attributes
    ----------
    order : int
        Polynomial order along a side; 0 for triangles of constant strain.
    elements : ndarray of int, shape (n, m)
        Nodes of each element: s fastest for quadrilaterals, counter-clockwise for triangles.
    faces : ndarray of int, shape (n,)
        Number of each element among the faces of the file.
    """

    order: int
    elements: Integers
    faces: Integers


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Nodes, elements and groups of a surface.

    Attributes
    ----------
    name : str
        Of the file.
    nodes : ndarray, shape (N, 3)
        Reference positions [m].
    blocks : tuple of Block
        Quadrilaterals and triangles, whichever there are.
    faces : dict
        Faces of a group by its name.
    points : dict
        Nodes of every group by its name: of its points, edges or faces.
    sides : dict
        Sides of a group of edges by its name: nodes along each, shape (sides, order + 1).
    lines : dict
        Segments of a cable or beam by its name, shape (n, 2); their nodes that no face has are the last.
    clamped : ndarray of int, shape (k, 4)
        Of ends that keep their direction: a node behind each, the end, the next one, and the number of the line.
    """

    name: str
    nodes: Vector
    blocks: tuple[Block, ...]
    faces: dict[str, Integers]
    points: dict[str, Integers]
    sides: dict[str, Integers]
    lines: dict[str, Integers] = field(default_factory=dict)
    clamped: Integers = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int64))

    @property
    def n_faces(self) -> int:
        """Number of elements."""
        return sum(len(block.elements) for block in self.blocks)

    @cached_property
    def size(self) -> float:
        """Largest extent along an axis [m]."""
        return float(np.ptp(self.nodes, axis=0).max())


def surface_mesh(file: MeshFile, order: int = 1) -> SurfaceMesh:
    """Make elements of an order from the faces of a file.

    Parameters
    ----------
    file : MeshFile
        Faces.
    order : int
        Of the quadrilaterals: 1 for bilinear ones, 2 and more for spectral ones, whose nodes lie on the file's surface.

    Returns
    -------
    SurfaceMesh
        Neighbouring elements face the same way as the first one of their sheet, and closed sheets outward. A group of
        points that holds both ends of a side holds the nodes between them too.

    Raises
    ------
    DataError
        Triangles beside quadrilaterals of a higher order, or a surface with one side only.
    """
    quads, triangles = file.quadrilaterals.copy(), file.triangles.copy()
    if len(triangles) and order > 1:
        msg = (
            f"{file.name} holds {len(triangles)} triangles, and elements of order {order} are quadrilaterals. Mesh with "
            "quadrilaterals only (in gmsh: Mesh.RecombineAll = 1, Mesh.SubdivisionAlgorithm = 1), or write order = 1."
        )
        raise DataError(msg)
    turned = _turned(file)
    for faces, turn in ((quads, turned[: len(quads)]), (triangles, turned[len(quads) :])):
        faces[turn] = faces[turn][:, [k for k in _TURNED if k < faces.shape[1]] if faces.shape[1] > 3 else [0, 2, 1]]

    corners = np.unique(np.concatenate([quads[:, :4].ravel(), triangles.ravel()]))
    number = np.full(len(file.nodes), -1)
    number[corners] = np.arange(len(corners))
    elements, sides = _tensor_elements(number[quads[:, :4]], order, len(corners))
    nodes = np.zeros((max(len(corners), 1 + int(elements.max(initial=-1))), 3))
    nodes[elements] = np.einsum("pm,nmi->npi", _geometry(quads.shape[1], order), file.nodes[quads])
    nodes[: len(corners)] = file.nodes[corners]
    blocks = []
    if len(quads):
        blocks.append(Block(order, elements, np.arange(len(quads))))
    if len(triangles):
        blocks.append(Block(0, number[triangles], len(quads) + np.arange(len(triangles))))
        for a, b in zip((0, 1, 2), (1, 2, 0), strict=True):
            sides |= {(min(pair), max(pair)): () for pair in number[triangles][:, [a, b]].tolist()}

    rows = [row for block in blocks for row in block.elements]
    points = {name: np.unique(np.concatenate([rows[k] for k in members])) for name, members in file.faces.items()}
    on_mesh = {}
    for name, pairs in file.edges.items():
        found = [_along(sides, a, b) for a, b in number[pairs].tolist() if (min(a, b), max(a, b)) in sides]
        if found:
            on_mesh[name] = np.array(found)
            points[name] = np.unique(on_mesh[name])
    for name, members in file.points.items():
        if (known := number[members][number[members] >= 0]).size:
            within = np.isin(np.arange(len(nodes)), known)
            between = [inner for (a, b), inner in sides.items() if within[a] and within[b]]
            points[name] = np.unique(np.concatenate([known, *between])).astype(np.int64)
    return SurfaceMesh(file.name, nodes, tuple(blocks), file.faces, points, on_mesh)


def corners_of(order: int) -> list[int]:
    """Return which nodes of an element are its corners, counter-clockwise; order 0 for triangles."""
    return [0, 1, 2] if order == 0 else [0, order, (order + 1) ** 2 - 1, order * (order + 1)]


def sides_of(mesh: SurfaceMesh) -> Iterator[tuple[int, frozenset[int]]]:
    """Give every face with each of its sides, by the corners."""
    for block in mesh.blocks:
        for face, nodes in zip(block.faces.tolist(), block.elements[:, corners_of(block.order)].tolist(), strict=True):
            for a, b in zip(nodes, [*nodes[1:], nodes[0]], strict=True):
                yield face, frozenset((a, b))


def _tensor_elements(corners: Integers, p: int, first: int) -> tuple[Integers, dict[tuple[int, int], tuple[int, ...]]]:
    """Give every node of quadrilaterals a number: corners, from ``first`` on those inside sides, then those inside elements.

    Returns
    -------
    ndarray of int, shape (n, (p + 1)^2)
    dict
        Inner nodes of every side by its corners, from the lower number to the higher.
    """
    n = len(corners)
    pairs = np.stack([corners[:, [0, 1]], corners[:, [3, 2]], corners[:, [0, 3]], corners[:, [1, 2]]], axis=1)
    keys, which = np.unique(np.sort(pairs, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    inner = first + (p - 1) * np.arange(len(keys))[:, None] + np.arange(p - 1)
    along = inner[which.reshape(n, 4)]  # (n, 4, p - 1), from the lower corner to the higher
    along = np.where((pairs[..., 0] < pairs[..., 1])[..., None], along, along[..., ::-1])
    grid = np.full((n, p + 1, p + 1), -1)  # row t, column s
    grid[:, 0, 0], grid[:, 0, p], grid[:, p, p], grid[:, p, 0] = corners.T
    grid[:, 0, 1:p], grid[:, p, 1:p], grid[:, 1:p, 0], grid[:, 1:p, p] = along.transpose(1, 0, 2)
    begin = first + (p - 1) * len(keys)
    grid[:, 1:p, 1:p] = begin + np.arange(n * (p - 1) ** 2).reshape(n, p - 1, p - 1)
    found = {(a, b): tuple(row) for (a, b), row in zip(keys.tolist(), inner.tolist(), strict=True)}
    return grid.reshape(n, (p + 1) ** 2), found


def _along(sides: dict[tuple[int, int], tuple[int, ...]], a: int, b: int) -> list[int]:
    inner = sides[min(a, b), max(a, b)]
    return [a, *(inner if a < b else inner[::-1]), b]


def _geometry(nodes: int, order: int) -> Vector:
    """Evaluate the shape functions of a quadrilateral of 4, 8 or 9 nodes at those of an element, shape (m, nodes)."""
    line, _ = lobatto_points(order + 1)
    s, t = np.tile(line, order + 1), np.repeat(line, order + 1)
    if nodes == 8:  # serendipity, Eq. (3.7.6) of Hughes, The Finite Element Method, 1987
        x, y = 2.0 * s, 2.0 * t
        corner = [(1 + a * x) * (1 + b * y) * (a * x + b * y - 1) / 4 for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        middle = [(1 - x**2) * (1 - y) / 2, (1 + x) * (1 - y**2) / 2, (1 - x**2) * (1 + y) / 2, (1 - x) * (1 - y**2) / 2]
        return np.column_stack([*corner, *middle])
    knots = np.linspace(-0.5, 0.5, 2 if nodes == 4 else 3)
    along_s, along_t = value_matrix(knots, s), value_matrix(knots, t)
    last = len(knots) - 1
    return np.column_stack([along_s[:, last * i // 2] * along_t[:, last * j // 2] for i, j in NINE[:nodes]])


def _turned(file: MeshFile) -> NDArray[np.bool_]:
    """Find the faces to turn over so that neighbours face the same way, and closed sheets outward.

    Notes
    -----
    Two faces that do run through their common side in opposite directions. Sides of more than two faces are left alone.
    """
    faces = [*file.quadrilaterals[:, :4].tolist(), *file.triangles.tolist()]
    by_side: dict[tuple[int, int], list[tuple[int, bool]]] = {}
    for k, face in enumerate(faces):
        for a, b in zip(face, [*face[1:], face[0]], strict=True):
            by_side.setdefault((min(a, b), max(a, b)), []).append((k, a < b))
    neighbours: list[list[tuple[int, bool]]] = [[] for _ in faces]
    for pair in by_side.values():
        if len(pair) == 2:
            (k, forward), (other, too) = pair
            neighbours[k].append((other, forward == too))
            neighbours[other].append((k, forward == too))
    turned = np.zeros(len(faces), dtype=bool)
    seen = np.zeros(len(faces), dtype=bool)
    for start in range(len(faces)):
        queue, sheet = deque([] if seen[start] else [start]), []
        seen[start] = True
        while queue:
            k = queue.popleft()
            sheet.append(k)
            for other, against in neighbours[k]:
                if not seen[other]:
                    seen[other], turned[other] = True, turned[k] ^ against
                    queue.append(other)
                elif turned[other] != turned[k] ^ against:
                    msg = (
                        f"the surface in {file.name} has one side only (a Moebius strip): faces {k + 1} and {other + 1} "
                        "cannot face the same way, so pressure has no meaning. Cut it open along a line."
                    )
                    raise DataError(msg)
        if sheet and all(len(neighbours[k]) == len(faces[k]) for k in sheet):
            corners = [[file.nodes[i] for i in faces[k]] for k in sheet]
            volumes = np.array([sum(np.dot(X[0], np.cross(a, b)) for a, b in pairwise(X[1:])) for X in corners])
            turned[sheet] ^= np.sum(np.where(turned[sheet], -volumes, volumes)) < 0.0
    return turned


def refined(mesh: SurfaceMesh, order: int, *, quarters: bool = True) -> SurfaceMesh:
    """Return a surface whose elements are divided in four, or not, and have some order; its groups hold the same places.

    New nodes lie on the elements that were there, so a curved surface stays as flat between its nodes as its mesh made it:
    what they show is the error of the elements, not of the shape. A facet under pressure bulges on the finer mesh, where the
    true surface is curved from the start; ``Structure.chord_error`` states how far from it the mesh is.
    """
    return surface_mesh(_file(mesh, quarters=quarters), order)


def _file(mesh: SurfaceMesh, *, quarters: bool) -> MeshFile:
    """Write a surface as a mesh file of quadrilaterals of nine nodes and triangles, or of the quarters of both."""
    blocks = {block.order > 0: block for block in mesh.blocks}
    corners = {kind: block.elements[:, corners_of(block.order)] for kind, block in blocks.items()}
    sides = np.concatenate([np.stack([each, np.roll(each, -1, axis=1)], axis=2).reshape(-1, 2) for each in corners.values()])
    pairs = np.unique(np.sort(sides, axis=1), axis=0)
    middle = {(a, b): len(mesh.nodes) + k for k, (a, b) in enumerate(pairs.tolist())}
    nodes = [mesh.nodes, mesh.nodes[pairs].mean(axis=1)]  # middles of quadrilaterals' sides are set below

    def between(each: Integers) -> Integers:
        ends = np.sort(np.stack([each, np.roll(each, -1, axis=1)], axis=2), axis=2)
        return np.array([[middle[a, b] for a, b in face] for face in ends.tolist()], dtype=np.int64).reshape(each.shape)

    quadrilaterals, triangles = np.zeros((0, 9), dtype=np.int64), np.zeros((0, 3), dtype=np.int64)
    if True in blocks:
        block, each = blocks[True], corners[True]
        at = np.einsum("pm,nmi->npi", _on_grid(block.order), mesh.nodes[block.elements])
        grid = len(mesh.nodes) + len(pairs) + np.arange(25 * len(each)).reshape(-1, 25)
        grid[:, _CORNERS] = each
        grid[:, _SIDES] = between(each)
        nodes[1][grid[:, _SIDES] - len(mesh.nodes)] = at[:, _SIDES]
        nodes.append(at.reshape(-1, 3))
        quadrilaterals = grid[:, _QUARTERS if quarters else [_WHOLE]].reshape(-1, 9)
    if False in blocks:
        each = corners[False]
        (a, b, c), (e, f, g) = each.T, between(each).T
        parts = np.stack([[a, e, g], [e, b, f], [g, f, c], [e, f, g]]) if quarters else each.T[None]
        triangles = np.transpose(parts, (2, 0, 1)).reshape(-1, 3)
    faces = {name: (4 * v[:, None] + np.arange(4)).ravel() if quarters else v for name, v in mesh.faces.items()}
    halves = {name: np.stack([side[:, 0], side[:, -1]], axis=1) for name, side in mesh.sides.items()}
    if quarters:
        halves = {
            name: np.array(
                [half for a, b in ends.tolist() for m in [middle[min(a, b), max(a, b)]] for half in ((a, m), (m, b))]
            )
            for name, ends in halves.items()
        }
    points = {}
    for name, members in mesh.points.items():
        if name not in mesh.faces and name not in mesh.sides:
            within = np.isin(pairs, members).all(axis=1)
            points[name] = np.concatenate([members, len(mesh.nodes) + np.flatnonzero(within)]).astype(np.int64)
    return MeshFile(mesh.name, np.concatenate(nodes), quadrilaterals, triangles, faces, halves, points)


def _on_grid(order: int) -> Matrix:
    """Evaluate the shape functions of a quadrilateral on a grid of 5 x 5 places, shape (25, m)."""
    along = value_matrix(lobatto_points(order + 1)[0], np.linspace(-0.5, 0.5, 5))
    return np.asarray(np.kron(along, along))
