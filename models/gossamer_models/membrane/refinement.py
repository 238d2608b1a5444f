r"""The same membrane with more unknowns: every element in four, or of a higher order.

New nodes lie on the elements that were there, so a curved surface stays as flat between its nodes as its mesh made it: what
they show is the error of the elements, not of the shape. A facet under pressure bulges on the finer mesh, where the true
surface is curved from the start; ``Structure.chord_error`` states how far from it the mesh is.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Matrix
from .element import lobatto_points, value_matrix
from .reading import MeshFile
from .surface import Integers, SurfaceMesh, corners_of, surface_mesh

RAISED = 2  # by which the order of spectral elements is raised
# of a quadrilateral: places on a grid of 5 x 5 of the nine nodes of each quarter, corners first, then sides, then middle
_NINE = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]
_QUARTERS = [[5 * (j + b) + i + a for a, b in _NINE] for i, j in ((0, 0), (2, 0), (2, 2), (0, 2))]
_WHOLE = [5 * 2 * b + 2 * a for a, b in _NINE]
_CORNERS, _SIDES = [0, 4, 24, 20], [2, 14, 22, 10]


def refined(mesh: SurfaceMesh, order: int, *, quarters: bool = True) -> SurfaceMesh:
    """Return a surface whose elements are divided in four, or not, and have some order; its groups hold the same places."""
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
