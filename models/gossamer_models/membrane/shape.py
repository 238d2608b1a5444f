r"""What a viewer needs to draw a membrane from a state of its model, as a file.

Symbols: ``N`` nodes, ``M`` of them free, ``n`` faces that are drawn, ``S`` ways in which inputs and parameters move nodes,
``R`` regions, or their parts with a temperature of their own, ``K`` sensors. The place of a node is
:math:`x = l X + q + \sum_s m_s w_s`: ``nodes`` times the variable ``size``; the displacements of the nodes in
``moving``, in the state from the place ``q`` on; and ``ways``, each times its variable in ``moved_by``.
"""

import io
import json
from collections.abc import Sequence

import numpy as np

from ..arrays import Vector
from ..variables import Variable
from .structure import Structure
from .surface import Block, Integers

SHAPE = "shape.npz"
SCHEMA, VERSION = "gossamer.shape", 2


def membrane_shape(structure: Structure, variables: Sequence[Variable]) -> bytes:
    """Describe the shape of a membrane.

    Parameters
    ----------
    structure : Structure
        The membrane.
    variables : sequence of Variable
        Table of its model, whose state begins with the displacements of the nodes that move.

    Returns
    -------
    bytes
        An NPZ file, with schema, version and name as JSON in ``card``; the same structure gives the same bytes.

    Notes
    -----
    ``nodes`` (N, 3), in units of the size; ``faces`` (n, 4), nodes of quadrilaterals and, with -1 as the last, of
    triangles; ``element``, ``region`` and ``zone`` (n,) from 0, zone -1 where damage does not act; ``q``, place of the
    displacements in the state, three for each node in ``moving`` (M,); ``ways`` (S, N, 3) and ``moved_by`` (S,).
    Numbers of variables, or -1 for none: ``moved_by`` and ``size``, none being 1, and ``youngs_modulus``,
    ``temperature``, of some also ``zone_temperature`` to add, and ``poisson_from`` (R,), which is in place of
    ``poisson_ratio`` (R,) [1]. Of regions also
    ``thermal_expansion`` [1/K] (R,), ``prestress`` [Pa] and ``direction`` (R, 3); of parts ``part_of`` (R,), regions of the
    setup from 0. ``sensor_points``, in units of
    the size, and ``sensor_directions`` (K, 3). Of cables and beams ``segments`` (s, 2), nodes, and ``segment_zone`` (s,).
    """
    setup, mesh = structure.setup, structure.mesh
    number = {variable.name: i for i, variable in enumerate(variables)}
    size = mesh.size if "side_length" in number else 1.0
    faces = [_faces(block) for block in mesh.blocks]
    combination = np.concatenate(
        [np.repeat(e.combination, len(f) // len(e.nodes)) for e, f in zip(structure.elements, faces, strict=True)]
    )
    element = np.concatenate([np.repeat(b.faces, len(f) // len(b.faces)) for b, f in zip(mesh.blocks, faces, strict=True)])
    ways = structure.ways.reshape(-1, len(mesh.nodes), 3)
    moved = [s for s, way in enumerate(ways) if way.any()]
    regions, part = list(range(len(setup.regions))), structure.region
    warm: dict[str, Integers] = {}
    if "zone_temperature[1]" in number:
        parts, part = np.unique(np.column_stack([structure.region, structure.zone]), axis=0, return_inverse=True)
        regions = parts[:, 0].tolist()
        warm["part_of"] = parts[:, 0]
        warm["zone_temperature"] = _integers([number.get(f"zone_temperature[{zone + 1}]", -1) for zone in parts[:, 1]])
    arrays = {
        "nodes": (mesh.nodes - structure.origin) / size,
        "faces": np.concatenate(faces).astype(np.int32),
        "element": element.astype(np.int32),
        "region": part[combination].astype(np.int32),
        "zone": structure.zone[combination].astype(np.int32),
        "size": number.get("side_length", -1),
        "q": 0,
        "moving": structure.moving,
        "ways": ways[moved],
        "moved_by": _integers([number.get(setup.supports[s].motion, -1) for s in moved]),
        "youngs_modulus": _integers(
            [number.get(f"youngs_modulus[{i + 1}]", number.get("youngs_modulus", -1)) for i in regions]
        ),
        "temperature": _integers([number.get(f"temperature[{i + 1}]", -1) if setup.warms else -1 for i in regions]),
        **warm,
        "poisson_from": _integers([number.get("poisson_ratio", -1) for _ in regions]),
        **{
            name: np.array([getattr(setup.regions[i], name) for i in regions])
            for name in ("poisson_ratio", "thermal_expansion", "prestress", "direction")
        },
        "sensor_points": (_rows([sensor.point for sensor in setup.sensors]) - structure.origin) / size,
        "sensor_directions": _rows([sensor.direction for sensor in setup.sensors]),
    }
    if mesh.lines:
        pairs = [mesh.lines[line.name] for line in setup.lines]
        arrays["segments"] = np.concatenate(pairs).astype(np.int32)
        arrays["segment_zone"] = np.repeat(structure.line_zone, [len(each) for each in pairs]).astype(np.int32)
    file = io.BytesIO()
    card = {"schema": SCHEMA, "version": VERSION, "name": setup.title or mesh.name}
    np.savez(file, card=np.array(json.dumps(card)), **arrays)
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
