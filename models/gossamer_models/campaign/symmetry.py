"""Images of a structure: exchanges of its sensors and zones that leave structure and load as they are.

Symbols: ``m`` images, the first of them the structure itself, ``s`` sensors, ``z`` zones, ``q = z / m`` of them that stand
for all others; ``P`` matrices that exchange sensors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Matrix

if TYPE_CHECKING:
    from ..membrane import Structure
    from .chunk import Kernels
    from .description import CampaignPlan

Integers = NDArray[np.int64]
_NEAR = 1e-6  # of the size: places that are the same
_ALIKE = 1e-4  # of the swing of the strain: histories that are the same
_STEPS = 100  # of a check
_MIRRORS = ((1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0))  # signs of x and y


@dataclass(frozen=True, eq=False)
class Symmetry:
    """Images of a record: the strain of sensors and the damage of zones, exchanged.

    Attributes
    ----------
    sensors : ndarray of int, shape (m, s)
        Whose signal stands in the place of each sensor.
    zones : ndarray of int, shape (m, z)
        Whose damage stands in the place of each zone.
    """

    sensors: Integers
    zones: Integers

    @classmethod
    def none(cls, sensors: int, zones: int) -> Symmetry:
        """Return that of a structure without any: the record is its only image."""
        return cls(np.arange(sensors)[None], np.arange(zones)[None])

    @classmethod
    def stored(cls, lists: dict[str, list[list[int]]]) -> Symmetry:
        """Make it of what ``lists`` gave."""
        return cls(**{name: np.array(rows, dtype=np.int64) for name, rows in lists.items()})

    def lists(self) -> dict[str, list[list[int]]]:
        """Return both arrays as JSON values."""
        return {"sensors": self.sensors.tolist(), "zones": self.zones.tolist()}

    @cached_property
    def modes(self) -> Matrix:
        """Orthonormal sums of the sensors' signals, shape (s, s), one per row, of which images change the sign only."""
        if len(self.sensors) == 1:
            return np.eye(self.sensors.shape[1])
        P = np.eye(self.sensors.shape[1])[self.sensors]
        weights = 2.0 ** -np.arange(len(P))  # so that no two kinds of signs have the same sum
        rows = np.linalg.eigh(np.tensordot(weights, P, 1))[1].T[::-1]
        return np.asarray(rows * np.sign(rows[np.arange(len(rows)), np.abs(rows).argmax(axis=1)])[:, None])

    def signs(self, modes: Matrix) -> Matrix:
        """Return the sign of each of some modes in each image, shape (m, s)."""
        return np.array([np.round(np.sum(modes[:, order] * modes, axis=1)) for order in self.sensors])

    def images(self, x: NDArray[Any], damage: Matrix) -> tuple[NDArray[Any], Matrix]:
        """Return all images of some cases.

        Parameters
        ----------
        x : ndarray, shape (n, s, ...)
            Signals of the sensors.
        damage : ndarray, shape (n, z)
            Damage [1].

        Returns
        -------
        ndarray, shape (m n, s, ...), and ndarray, shape (m n, z)
            The cases, then their images, one kind after the other.
        """
        return (
            np.concatenate([x[:, order] for order in self.sensors]),
            np.concatenate([damage[:, order] for order in self.zones]),
        )


def find_symmetry(campaign: CampaignPlan, kernels: Kernels) -> Symmetry:
    """Find the images of a campaign's structure and load: mirrored damage must give mirrored strain.

    Parameters
    ----------
    campaign : CampaignPlan
        What is run.
    kernels : Kernels
        Its models.
    """
    from .cases import draw_cases
    from .chunk import acting_on

    drawn = draw_cases(campaign, [0])
    first, acting = acting_on(campaign, drawn)
    varied = {name: value for name, value in drawn.varied.items() if name in campaign.membrane.settable}
    damage = np.linspace(0.1, 0.4, kernels.zones)[None]  # other in every zone
    steps = campaign.steps if acting else min(campaign.steps, _STEPS)
    *candidates, alone = mirrors(campaign.membrane.structure)
    for symmetry in candidates:
        rows = damage[0][symmetry.zones]
        start: dict[str, ArrayLike] = {**campaign.membrane.parameters, **first, **varied, "damage": rows}
        histories = np.repeat(rows.T[:, :, None], steps, 2)
        damages = kernels.membrane.inputs[: len(kernels.membrane.inputs) - len(acting)]  # none where damage does not begin
        inputs = dict(zip(damages, histories, strict=False)) | {name: np.ravel(load) for name, load in acting.items()}
        run = kernels.membrane.run(steps, campaign.step, start, inputs)
        expected = symmetry.images(run.results[:1], damage)[0]
        if np.abs(run.results - expected).max() <= _ALIKE * np.ptp(expected, axis=2).max():
            return symmetry
    return alone


def mirrors(structure: Structure) -> Iterator[Symmetry]:
    """Find the mirror images in x and y that zones and sensors allow, most images first; loads are not looked at.

    An image counts if it puts every zone and every gauge, apart from the sense of its direction, on another one. The last
    is the structure itself alone.
    """
    zones, gauges = structure.zone_places, structure.setup.sensors
    places, directions = (np.array([getattr(each, of) for each in gauges]).reshape(-1, 3) for of in ("point", "direction"))
    along = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    nodes = structure.mesh.nodes
    middle = (nodes.min(axis=0) + nodes.max(axis=0)) / 2.0
    near = _NEAR * structure.mesh.size
    found = []
    for signs in _MIRRORS:
        flip = np.array([*signs, 1.0])
        zone = _nearest(zones, (zones - middle) * flip + middle, near)
        sensor = _nearest(
            np.hstack([places, _tensors(along) * structure.mesh.size]),
            np.hstack([(places - middle) * flip + middle, _tensors(along * flip) * structure.mesh.size]),
            near,
        )
        found.append(None if zone is None or sensor is None else (sensor, zone))
    for chosen in ((0, 1, 2, 3), (0, 1), (0, 2), (0, 3)):
        some = [found[k] for k in chosen]
        if None in some:
            continue
        symmetry = Symmetry(*(np.array([pair[k] for pair in some if pair]) for k in (0, 1)))
        if all(len(set(column)) == len(some) for column in symmetry.zones.T):  # no zone is its own image
            yield symmetry
    yield Symmetry.none(structure.n_sensors, structure.n_zones)


def _tensors(v: Matrix) -> Matrix:
    """Return the products of the parts of unit vectors, which their sense leaves as they are, shape (n, 9)."""
    return np.asarray(np.einsum("ni,nj->nij", v, v).reshape(len(v), 9))


def _nearest(places: Matrix, images: Matrix, near: float) -> Integers | None:
    """Return which of some places lies at each image, shape (n,); None if one lies at none."""
    away = np.linalg.norm(places[None] - images[:, None], axis=2)
    found: Integers = away.argmin(axis=1)
    return found if np.all(away.min(axis=1, initial=np.inf) <= near) and len(set(found)) == len(places) else None
