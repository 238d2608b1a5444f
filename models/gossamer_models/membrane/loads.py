"""The dead loads of a setup as forces on the nodes of a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from .geometry import Geometry
from .quadrature import derivative_matrix, lobatto_points
from .setup import Load, Setup
from .surface import SurfaceMesh, sides_of


def members_of(mesh: SurfaceMesh, groups: tuple[str, ...]) -> NDArray[np.bool_]:
    """Return which faces belong to some of the groups; all if there are no groups."""
    found = np.full(mesh.n_faces, not groups)
    for group in groups:
        if group in mesh.faces:
            found[mesh.faces[group]] = True
    return found


def edge_force(setup: Setup, mesh: SurfaceMesh, measured: list[Geometry]) -> Vector:
    """Return the nodal forces of tension along edges, by the Lobatto rule of their order."""
    force, normals = np.zeros((len(mesh.nodes), 3)), np.zeros((len(mesh.nodes), 3))
    inward = _inward(mesh) if setup.edges else {}
    for block, found in zip(mesh.blocks, measured, strict=True):
        np.add.at(normals, block.elements, found.node_normals)
    for edge in setup.edges:
        for side in mesh.sides[edge.group]:
            nodes, weights = lobatto_points(len(side))
            along = derivative_matrix(nodes, nodes) @ mesh.nodes[side]
            n = normals[side] / np.linalg.norm(normals[side], axis=1, keepdims=True)
            outward = np.cross(along, n)  # its length is that of the side
            middle = mesh.nodes[side].mean(axis=0) - inward[frozenset((int(side[0]), int(side[-1])))]
            outward *= np.sign(np.sum(outward * middle, axis=1, keepdims=True))
            np.add.at(force, side, edge.tension * weights[:, None] * outward)
    return force.ravel()


def _inward(mesh: SurfaceMesh) -> dict[frozenset[int], Vector]:
    """Return the middle of an element beside each side, by the corners of the side."""
    middles = np.concatenate([mesh.nodes[block.elements].mean(axis=1) for block in mesh.blocks])
    return {side: middles[face] for face, side in sides_of(mesh)}


def unit_force(load: Load, mesh: SurfaceMesh, measured: list[Geometry]) -> Vector:
    """Return the nodal forces of a dead load per unit of its input."""
    force = np.zeros((len(mesh.nodes), 3))
    if load.kind == "force":
        nodes = np.unique(np.concatenate([mesh.points[group] for group in load.groups]))
        force[nodes] = np.array(load.direction) / np.linalg.norm(load.direction)
        return force.ravel()
    acts = members_of(mesh, load.groups)
    for block, found in zip(mesh.blocks, measured, strict=True):
        np.add.at(force, block.elements, found.node_normals * acts[block.faces][:, None, None])
    return force.ravel()
