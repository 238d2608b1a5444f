r"""What a viewer needs to draw a membrane on a mesh from a state of its model, as a file.

Symbols: ``N`` nodes, ``n`` faces that are drawn, ``S`` supports that move nodes, ``R`` regions, ``K`` sensors. The
place of a node is :math:`x = X + q + \sum_s m_s w_s`: ``nodes``, the displacements at the places ``q`` of the state,
and of each support its ``ways`` times the variable in ``moved_by``, or times one.
"""

from __future__ import annotations

import io
import json
from collections.abc import Sequence

import numpy as np

from ..arrays import Vector
from ..variables import Variable
from .mesh import Block, Integers
from .structure import Structure

SHAPE = "shape.npz"
SCHEMA, VERSION = "gossamer.shape", 1


def shape_file(structure: Structure, variables: Sequence[Variable]) -> bytes:
    """Describe the shape of a membrane.

    Parameters
    ----------
    structure : Structure
        The membrane.
    variables : sequence of Variable
        Table of its model, whose state begins with the displacements of all nodes.

    Returns
    -------
    bytes
        An NPZ file; the same structure gives the same bytes. Its arrays: ``card`` (schema, version and name as JSON);
        ``nodes`` (N, 3) [m]; ``faces`` (n, 4), nodes of quadrilaterals and, with -1 as the last, of triangles;
        ``element``, ``region`` and ``zone`` (n,) from 0, zone -1 where damage does not act; ``q`` (2,), place and
        number of the displacements in the state; ``ways`` (S, N, 3) [m] and ``moved_by`` (S,), numbers of variables or
        -1; ``youngs_modulus`` and ``temperature`` (R,), numbers of variables or -1; ``poisson_ratio`` [1],
        ``thermal_expansion`` [1/K] (R,); ``prestress`` [Pa] and ``direction`` (R, 3); ``sensor_points`` [m] and
        ``sensor_directions`` (K, 3).
    """
    setup, mesh = structure.setup, structure.mesh
    number = {variable.name: i for i, variable in enumerate(variables)}
    faces = [_faces(block) for block in mesh.blocks]
    combination = np.concatenate(
        [np.repeat(e.combination, len(f) // len(e.nodes)) for e, f in zip(structure.elements, faces, strict=True)]
    )
    element = np.concatenate(
        [np.repeat(b.faces, len(f) // len(b.faces)) for b, f in zip(mesh.blocks, faces, strict=True)]
    )
    ways = structure.ways.reshape(-1, len(mesh.nodes), 3)
    moving = [s for s, way in enumerate(ways) if way.any()]
    regions = setup.regions
    arrays = {
        "card": np.array(json.dumps({"schema": SCHEMA, "version": VERSION, "name": setup.title or mesh.name})),
        "nodes": mesh.nodes,
        "faces": np.concatenate(faces).astype(np.int32),
        "element": element.astype(np.int32),
        "region": structure.region[combination].astype(np.int32),
        "zone": structure.zone[combination].astype(np.int32),
        "q": np.array([0, mesh.nodes.size]),
        "ways": ways[moving],
        "moved_by": _integers([number.get(setup.supports[s].motion, -1) for s in moving]),
        "youngs_modulus": _integers([number[f"youngs_modulus[{i + 1}]"] for i in range(len(regions))]),
        "temperature": _integers([number.get(f"temperature[{i + 1}]", -1) for i in range(len(regions))]),
        "poisson_ratio": np.array([region.poisson_ratio for region in regions]),
        "thermal_expansion": np.array([region.thermal_expansion for region in regions]),
        "prestress": np.array([region.prestress for region in regions]),
        "direction": np.array([region.direction for region in regions]),
        "sensor_points": _rows([sensor.point for sensor in setup.sensors]),
        "sensor_directions": _rows([sensor.direction for sensor in setup.sensors]),
    }
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def _faces(block: Block) -> Integers:
    """Return the faces of elements: a triangle, or the quadrilaterals between neighbouring nodes."""
    if block.order == 0:
        return np.column_stack([block.elements, np.full(len(block.elements), -1)])
    side = block.order + 1
    s, t = np.meshgrid(np.arange(block.order), np.arange(block.order))
    first = (t * side + s).ravel()
    corners = np.column_stack([first, first + 1, first + side + 1, first + side])
    return block.elements[:, corners].reshape(-1, 4)


def _integers(values: Sequence[int]) -> Integers:
    return np.array(values, dtype=np.int64)


def _rows(values: Sequence[Sequence[float]]) -> Vector:
    return np.array(values, dtype=float).reshape(-1, 3)
