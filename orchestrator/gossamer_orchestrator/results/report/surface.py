"""A membrane on a mesh as triangles, its zones and its sensors, at the instants of the slider.

Symbols: ``N`` nodes, ``n`` faces, ``T`` triangles, ``F`` instants.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmi.shape import Array, Integers, Surface
from ..shapes import ShapeHistory, face_strains

SEEN = 0.1  # of its size: how far a membrane that moves less is drawn
CLEAR = 0.12  # of its size: from a sensor to the number of a zone
STILL = 1e-9  # of its size: a motion that is round-off


def surface_content(history: ShapeHistory, shown: NDArray[np.intp]) -> dict[str, Any]:
    """Return a membrane and its motion.

    Parameters
    ----------
    history : ShapeHistory
        Its shapes.
    shown : numpy.ndarray, shape (F,)
        Which of them.

    Returns
    -------
    dict
        ``places`` (F, 3 N) [m], moved by ``factor`` times their displacement; ``deflection`` (F, N), its size [m];
        ``triangles`` (T, 3) and ``face``, the face of each; ``zone`` of each face, -1 for none, and how many ``zones``;
        ``strain`` and ``mark`` (F, n) as ``face_strains``; ``borders``, for each zone the nodes of its edge in pairs,
        the last those of the whole membrane; ``labels``, the node of each zone beside its number, and ``label_offsets``
        from it; ``sensors``, the node beside each and ``offsets`` from it.
    """
    surface, nodes = history.surface, history.surface.nodes
    away = history.places[shown] - nodes
    deflection = np.linalg.norm(away, axis=2)
    found = [face_strains(surface, history.places[k], history.eigenstrain[k]) for k in shown]
    factor = _factor(float(deflection.max()), float(np.ptp(nodes, axis=0).max()))
    triangles, face = _triangles(surface)
    zones = int(surface.zone.max(initial=-1)) + 1
    labels = [_label(surface, zone) for zone in range(zones)]
    beside = [int(np.argmin(np.linalg.norm(nodes - point, axis=1))) for point in surface.sensor_points]
    return {
        "places": (nodes + factor * away).reshape(len(shown), -1),
        "factor": factor,
        "deflection": deflection,
        "triangles": triangles,
        "face": face,
        "zone": surface.zone,
        "zones": zones,
        "strain": np.stack([each.largest for each in found]),
        "mark": np.stack([each.mark for each in found]).astype(float),
        "borders": [_border(surface.faces[some]) for some in [*(surface.zone == z for z in range(zones)), slice(None)]],
        "labels": [node for node, _ in labels],
        "label_offsets": [offset.tolist() for _, offset in labels],
        "sensors": beside,
        "offsets": (surface.sensor_points - nodes[beside]).tolist(),
    }


def _factor(most: float, size: float) -> float:
    """Return 1, or a round number that lets a small motion be seen."""
    if most <= STILL * size or most >= SEEN / 2.0 * size:
        return 1.0
    wanted = SEEN * size / most
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted))


def _triangles(surface: Surface) -> tuple[Integers, Integers]:
    faces, number = surface.faces, np.arange(len(surface.faces))
    quad = faces[:, 3] >= 0
    return np.concatenate([faces[:, :3], faces[quad][:, [0, 2, 3]]]), np.concatenate([number, number[quad]])


def _border(faces: Integers) -> list[int]:
    """Return the sides that belong to one of some faces only, as pairs of nodes."""
    quad = faces[:, 3] >= 0
    rings = [(faces[quad], (0, 1, 2, 3)), (faces[~quad], (0, 1, 2))]
    sides = np.concatenate(
        [ring[:, [a, b]] for ring, order in rings for a, b in zip(order, (*order[1:], 0), strict=True)]
    )
    _, first, count = np.unique(np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True)
    pairs: list[int] = sides[first[count == 1]].ravel().tolist()
    return pairs


def _label(surface: Surface, zone: int) -> tuple[int, Array]:
    """Return the node in the middle of a zone, -1 if the zone has no faces, and how far from it its number is [m].

    The number is moved away from a sensor that is near, but no farther than the zone reaches.
    """
    some = surface.faces[surface.zone == zone]
    if not len(some):
        return -1, np.zeros(3)
    members = np.unique(some[some >= 0])
    places: Array = surface.nodes[members]
    node = int(members[np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1))])
    away = surface.nodes[node] - surface.sensor_points
    distance = np.linalg.norm(away, axis=1)
    wanted = CLEAR * float(np.ptp(surface.nodes, axis=0).max())
    if not len(away) or (least := float(distance.min())) >= wanted:
        return node, np.zeros(3)
    direction = away[np.argmin(distance)] / least if least > 0.0 else np.array([1.0, 0.0, 0.0])
    return node, direction * min(wanted - least, float(np.linalg.norm(np.ptp(places, axis=0))) / 4.0)
