"""The shape of the square membrane, for programs that draw it; coordinates from its centre."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..shape import faces_of, shape_file
from ..variables import Variable
from .mesh import SquareMesh
from .strain import SENSOR_POINTS


def square_shape(mesh: SquareMesh, variables: Sequence[Variable]) -> bytes:
    """Describe the shape of a membrane whose state begins with the displacements of the interior nodes.

    Parameters
    ----------
    mesh : SquareMesh
        Its mesh.
    variables : sequence of Variable
        Table of its model.
    """
    number = {variable.name: i for i, variable in enumerate(variables)}
    per_element = mesh.order**2
    nodes = _in_space(mesh.nodes - 0.5)
    return shape_file(
        "Square membrane",
        nodes=nodes,
        faces=faces_of(mesh.elements, mesh.order).astype(np.int32),
        element=np.repeat(np.arange(len(mesh.elements)), per_element).astype(np.int32),
        region=np.zeros(len(mesh.elements) * per_element, dtype=np.int32),
        zone=np.repeat(mesh.zone, per_element).astype(np.int32),
        size=number["side_length"],
        q=0,
        moving=mesh.interior,
        ways=2.0 * nodes[None],  # both edges move outwards
        moved_by=[number["edge_displacement"]],
        youngs_modulus=[number["youngs_modulus"]],
        temperature=[-1],
        poisson_from=[number["poisson_ratio"]],
        poisson_ratio=[0.0],
        thermal_expansion=[0.0],
        prestress=np.zeros((1, 3)),
        direction=[[1.0, 0.0, 0.0]],
        sensor_points=_in_space(np.array(SENSOR_POINTS) - 0.5),
        sensor_directions=np.tile([0.0, 1.0, 0.0], (len(SENSOR_POINTS), 1)),
    )


def _in_space(plane: np.ndarray) -> np.ndarray:
    return np.column_stack([plane, np.zeros(len(plane))])
