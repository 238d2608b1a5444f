"""The shape of a membrane on a mesh, for programs that draw it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Vector
from ..shape import faces_of, shape_file
from ..variables import Variable
from .structure import Structure
from .surface import Block, Integers


def mesh_shape(structure: Structure, variables: Sequence[Variable]) -> bytes:
    """Describe the shape of a membrane.

    Parameters
    ----------
    structure : Structure
        The membrane.
    variables : sequence of Variable
        Table of its model, whose state begins with the displacements of all nodes.
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
    return shape_file(
        setup.title or mesh.name,
        nodes=mesh.nodes,
        faces=np.concatenate(faces).astype(np.int32),
        element=element.astype(np.int32),
        region=structure.region[combination].astype(np.int32),
        zone=structure.zone[combination].astype(np.int32),
        size=-1,
        q=0,
        moving=np.arange(len(mesh.nodes)),
        ways=ways[moving],
        moved_by=_integers([number.get(setup.supports[s].motion, -1) for s in moving]),
        youngs_modulus=_integers([number[f"youngs_modulus[{i + 1}]"] for i in range(len(regions))]),
        temperature=_integers([number.get(f"temperature[{i + 1}]", -1) for i in range(len(regions))]),
        poisson_from=_integers([-1] * len(regions)),
        poisson_ratio=np.array([region.poisson_ratio for region in regions]),
        thermal_expansion=np.array([region.thermal_expansion for region in regions]),
        prestress=np.array([region.prestress for region in regions]),
        direction=np.array([region.direction for region in regions]),
        sensor_points=_rows([sensor.point for sensor in setup.sensors]),
        sensor_directions=_rows([sensor.direction for sensor in setup.sensors]),
    )


def _faces(block: Block) -> Integers:
    """Return the faces of elements: a triangle, or the quadrilaterals between neighbouring nodes."""
    if block.order == 0:
        return np.column_stack([block.elements, np.full(len(block.elements), -1)])
    return faces_of(block.elements, block.order)


def _integers(values: Sequence[int]) -> Integers:
    return np.array(values, dtype=np.int64)


def _rows(values: Sequence[Sequence[float]]) -> Vector:
    return np.array(values, dtype=float).reshape(-1, 3)
