r"""Where sensors may be, and what they read from the nodes.

Symbols: ``G`` gauges, ``S`` their samples, ``N`` nodes; ``e1``, ``e2`` axes in the surface at a point.
"""

from __future__ import annotations

import numpy as np
from gossamer_files.options import option

from ..arrays import Matrix, Vector
from ..errors import ParameterError
from .gauges import Gauges, gauge, shape_functions, stacked
from .setup import Sensor
from .structure import Structure

ANGLES = (0.0, 90.0, 45.0, -45.0)  # [degrees] from the first axis
_PLACES = {
    True: [(s, t) for t in (-0.25, 0.25) for s in (-0.25, 0.25)],
    False: [(1.0 / 3.0, 1.0 / 3.0)],
}  # quadrilaterals, triangles
_BEYOND = 1e-6  # how far a gauge may reach beyond an edge, shares of the size


def candidates(structure: Structure, points: int, gauge_length: float = 0.0, *, own: bool = False) -> Gauges:
    """Spread gauges over a surface: some points, four directions at each.

    Parameters
    ----------
    structure : Structure
        The membrane.
    points : int
        Most points. They are taken from four inner points of every quadrilateral and the middle of every triangle, each the
        farthest from those before.
    gauge_length : float
        Length over which gauges read the mean [m]; those that reach beyond an edge are left out.
    own : bool
        Whether the structure's own sensors stand before them.

    Returns
    -------
    Gauges
        The directions are the material's first axis, the one across, and those half-way between.

    Raises
    ------
    ParameterError
        No gauge of this length fits.
    """
    mesh = structure.mesh
    place, e1, e2 = _frames(structure)
    sensors, found = (list(structure.setup.sensors), list(structure.gauges)) if own else ([], [])
    before = len(found)
    for k in _far_apart(place, points):
        for angle in np.deg2rad(ANGLES):
            along = np.cos(angle) * e1[k] + np.sin(angle) * e2[k]
            one = gauge(mesh, place[k], along, gauge_length)
            if one.away <= _BEYOND * mesh.size:
                point, direction = _three(place[k]), _three(along)
                sensors.append(Sensor(point=point, direction=direction, gauge_length=gauge_length))
                found.append(one)
    if len(found) == before:
        msg = f"no gauge of {gauge_length:g} m fits on the membrane. Give a shorter {option('gauge_length')}."
        raise ParameterError(msg)
    return stacked(tuple(sensors), found, len(mesh.nodes))


def _three(values: Vector) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in np.where(np.abs(values) < 1e-12, 0.0, values))
    return x, y, z


def _frames(structure: Structure) -> tuple[Matrix, Matrix, Matrix]:
    """Return points and the two axes there, of all elements, each of shape (places, 3)."""
    rows = []
    for block, elements in zip(structure.mesh.blocks, structure.elements, strict=True):
        axis = np.array([r.direction for r in structure.setup.regions])[structure.region[elements.combination]]
        for st in _PLACES[block.order > 0]:
            N, D = shape_functions(block.order, np.array(st))
            X = structure.mesh.nodes[block.elements]
            T = np.einsum("ma,nmi->nai", D, X)
            normal = np.cross(T[:, 0], T[:, 1])
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            e1 = axis - np.sum(axis * normal, axis=1, keepdims=True) * normal
            steep = np.linalg.norm(e1, axis=1) < 1e-6 * np.linalg.norm(axis, axis=1)  # the axis is the normal
            e1[steep] = T[steep, 0]
            e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
            rows.append((N @ X, e1, np.cross(normal, e1)))
    place, e1, e2 = (np.concatenate(part) for part in zip(*rows, strict=True))
    return place, e1, e2


def _far_apart(place: Matrix, count: int) -> list[int]:
    """Choose points, each the farthest from those before; the first is nearest to the middle of all."""
    kept = [int(np.argmin(np.linalg.norm(place - place.mean(axis=0), axis=1)))]
    away = np.linalg.norm(place - place[kept[0]], axis=1)
    while len(kept) < min(count, len(place)):
        kept.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(place - place[kept[-1]], axis=1))
    return sorted(kept)
