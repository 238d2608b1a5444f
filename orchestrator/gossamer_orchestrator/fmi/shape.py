r"""The shape of a membrane, read from the resources of its FMU and from its serialized state.

Symbols: ``N`` nodes, ``n`` faces, ``R`` regions, ``K`` sensors. An FMU that can be drawn holds two files: ``shape.npz``, the
nodes, faces and what moves them, and ``state.json``, where variables and states lie among the bytes of a state. A membrane
whose size is a variable, the square, has places from the corner of its held edge, as all results of it; a mesh has its own.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuError
from .file import FmuFile

logger = logging.getLogger(__name__)

SHAPE, STATE = "shape.npz", "state.json"
_KNOWN = {SHAPE: ("gossamer.shape", 2), STATE: ("gossamer.state", 1)}

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surface:
    """A membrane as faces, without its motion.

    Attributes
    ----------
    nodes : ndarray, shape (N, 3)
        Places without strain [m].
    faces : ndarray of int, shape (n, 4)
        Nodes of each face; the last of a triangle is -1.
    element, region, zone : ndarray of int, shape (n,)
        What each face belongs to, from 0; zone -1 where damage does not act. Regions whose zones have temperatures of their
        own come apart into these.
    poisson_ratio : ndarray, shape (R,)
        Of the regions [1].
    direction : ndarray, shape (R, 3)
        Projected on the surface, the first axis of the eigenstrain.
    sensor_points, sensor_directions : ndarray, shape (K, 3)
        Where the sensors are [m], and along what they measure.
    segments, segment_zone : ndarray of int, shapes (s, 2) and (s,)
        Nodes of each segment of a cable or beam, and its zone.
    part_of : ndarray of int, shape (R,) or (0,)
        Region of the setup, from 0, that each is a part of, if regions come apart.
    """

    nodes: Array
    faces: Integers
    element: Integers
    region: Integers
    zone: Integers
    poisson_ratio: Array
    direction: Array
    sensor_points: Array
    sensor_directions: Array
    segments: Integers = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    segment_zone: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    part_of: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def region_of_setup(self) -> Integers:
        """Region of the setup that each face belongs to, from 0, shape (n,)."""
        return self.part_of[self.region] if len(self.part_of) else self.region

    @property
    def zones(self) -> int:
        """How many zones there are, up to the last that has a face or a segment."""
        return 1 + int(np.concatenate([self.zone, self.segment_zone]).max(initial=-1))

    @classmethod
    def stored(cls, files: Mapping[str, Any]) -> Surface:
        """Make it of the arrays of ``shape.npz``, lengths in units of the size."""
        there = (
            "faces",
            "element",
            "region",
            "zone",
            *(name for name in ("segments", "segment_zone", "part_of") if name in files),
        )
        integers = {name: files[name].astype(np.int64) for name in there}
        floats = ("nodes", "poisson_ratio", "direction", "sensor_points", "sensor_directions")
        return cls(**integers, **{name: files[name].astype(float) for name in floats})


class Shape:
    """How to read the shape of a membrane from the state of its FMU.

    Parameters
    ----------
    files : dict
        Arrays of ``shape.npz``.
    layout : dict
        Content of ``state.json``.
    """

    def __init__(self, files: dict[str, Any], layout: dict[str, int]) -> None:
        self._files, self._layout = files, {name: int(layout[name]) for name in ("values", "n_values", "x", "n_x")}
        self._surface = Surface.stored(files)
        nodes, faces = self._surface.nodes, self._surface.faces
        first, moving = int(files["q"]), files["moving"]
        if (
            nodes.ndim != 2
            or nodes.shape[1] != 3
            or not 0 <= moving.min(initial=0) <= moving.max(initial=0) < len(nodes)
            or first < 0
            or first + 3 * len(moving) > self._layout["n_x"]
        ):
            msg = "its nodes do not fit the states"
            raise ValueError(msg)
        segments, zones = self._surface.segments, self._surface.segment_zone
        pairs = segments.ndim == 2 and segments.shape[1] == 2 and zones.shape == segments[:, 0].shape
        last = max(faces.max(initial=0), segments.max(initial=0))
        first_node = min(faces[:, :3].min(initial=0) if faces.ndim == 2 else -1, segments.min(initial=0))
        if first_node < 0 or faces.shape[1] != 4 or last >= len(nodes) or not pairs:
            msg = "its faces or segments name nodes that it lacks"
            raise ValueError(msg)

    def surface(self, state: bytes) -> Surface:
        """Return what does not change during a run, with the size of the membrane and its material in a state."""
        values, files = self._doubles(state, "values", "n_values"), self._files
        size = _value(values, files["size"], 1.0)
        known, corner = self._surface, self._corner(values)
        return replace(
            known,
            nodes=size * known.nodes - corner,
            sensor_points=size * known.sensor_points - corner,
            poisson_ratio=_value(values, files["poisson_from"], known.poisson_ratio),
        )

    def read(self, state: bytes) -> tuple[Array, Array]:
        """Return the places of the nodes, shape (N, 3) [m], and the eigenstrain of the regions, shape (R, 3) [1].

        Parameters
        ----------
        state : bytes
            A serialized state of the FMU.

        Notes
        -----
        The eigenstrain is what the material strains beyond the geometry, by prestress and cooling: along the first axis,
        across, and shear.

        Raises
        ------
        FmuError
            The state is shorter than the FMU says.
        """
        values, x = self._doubles(state, "values", "n_values"), self._doubles(state, "x", "n_x")
        surface, files = self.surface(state), self._files
        first, moving = int(files["q"]), files["moving"]
        places = surface.nodes + self._ways(values)
        places[moving] += x[first : first + 3 * len(moving)].reshape(-1, 3)
        E, nu, S = values[files["youngs_modulus"]], surface.poisson_ratio, files["prestress"]
        none = np.full(len(E), -1)
        rise = sum(_value(values, files.get(name, none), 0.0) for name in ("temperature", "zone_temperature"))
        warm = files["thermal_expansion"] * rise
        along, across = ((S[:, a] - nu * S[:, 1 - a]) / E - warm for a in range(2))
        return places, np.column_stack([along, across, (1.0 + nu) * S[:, 2] / E])

    def _ways(self, values: Array) -> Array:
        """Return how inputs and parameters move the nodes, shape (N, 3) [m]."""
        moved: Array = np.tensordot(_value(values, self._files["moved_by"], 1.0), self._files["ways"], axes=1)
        return moved

    def _corner(self, values: Array) -> Array:
        """Return the least place of the held edge along each axis [m], shape (3,); zero where the size is no variable."""
        if (size := self._files["size"]) < 0:
            return np.zeros(3)
        held: Array = values[size] * self._surface.nodes + self._ways(values)
        corner: Array = held.min(axis=0)
        return corner

    def _doubles(self, state: bytes, place: str, count: str) -> Array:
        begin, size = self._layout[place], self._layout[count]
        if len(state) < begin + 8 * size:
            msg = (
                f"the state of the FMU is {len(state)} bytes, too short for the {size} numbers at byte {begin} that its "
                f"{STATE} names. Build it again, or write frames = 0 under [record]."
            )
            raise FmuError(msg)
        return np.frombuffer(state, np.float64, size, begin)


def _value(values: Array, number: Integers, otherwise: float | Array) -> Array:
    """Return variables by number; where there is none, -1, something else."""
    return np.where(number >= 0, values[number], otherwise)


def read_shape(file: FmuFile) -> Shape | None:
    """Read the shape of an FMU; None if it has none, or its state cannot be serialized; a warning if it cannot be read."""
    folder = file.folder() / "resources"
    if not ((folder / SHAPE).is_file() and (folder / STATE).is_file() and file.interface.canSerializeFMUstate):
        return None
    try:
        return _read(folder)
    except (OSError, ValueError, KeyError, TypeError, IndexError, BadZipFile) as error:
        logger.warning("%s: its shape cannot be read, so none is recorded: %s", file.path, error)
        return None


def _read(folder: Path) -> Shape | None:
    layout = json.loads((folder / STATE).read_text(encoding="utf-8"))
    with np.load(folder / SHAPE, allow_pickle=False) as opened:
        files = dict(opened)
    cards = {SHAPE: json.loads(str(files.pop("card"))), STATE: layout}
    for name, card in cards.items():
        if (found := (card["schema"], card["version"])) != _KNOWN[name]:
            msg = f"{name} is {found[0]!r} version {found[1]}, not {_KNOWN[name][0]!r} version {_KNOWN[name][1]}"
            raise ValueError(msg)
    return Shape(files, layout)
