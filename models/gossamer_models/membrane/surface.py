r"""A surface of quadrilaterals and triangles in space, with its named groups.

Symbols: ``m`` nodes of an element, ``n`` elements of a kind, ``p`` order, ``s``, ``t`` parent coordinates [1]. A
quadrilateral holds (p + 1)^2 nodes at the Gauss-Lobatto-Legendre points, s fastest; neighbours share the nodes of their
common side, found by the numbers of its corners and not by distance, so that two sheets may lie on each other.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from ..errors import DataError
from .element import lobatto_points, value_matrix
from .reading import MeshFile

Integers = NDArray[np.int64]

_TURNED = [0, 3, 2, 1, 7, 6, 5, 4, 8]  # nodes of a quadrilateral that faces the other way


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
    """

    name: str
    nodes: Vector
    blocks: tuple[Block, ...]
    faces: dict[str, Integers]
    points: dict[str, Integers]
    sides: dict[str, Integers]

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
    knots = np.array([-0.5, 0.5]) if nodes < 9 else np.array([-0.5, 0.0, 0.5])
    where = (
        [(0, 0), (1, 0), (1, 1), (0, 1)]
        if nodes < 9
        else [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]
    )
    along_s, along_t = value_matrix(knots, s), value_matrix(knots, t)
    return np.column_stack([along_s[:, i] * along_t[:, j] for i, j in where])


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
