"""The membrane, and the sensors behind it, advanced from where they are, for many damages at once.

Symbols: ``m`` cases, ``n`` steps, ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Matrix, Vector
from ..batch import Batch
from ..batch.cases import BatchState
from ..membrane import MembraneParams, membrane_model
from ..membrane.mesh import N_ZONES
from ..sensor import SensorArtifact
from .forward import STRAINS, WORKERS
from .record import N_SENSORS
from .sensors import Sensors, repeated

DAMAGES = tuple(f"damage[{k + 1}]" for k in range(N_ZONES))


@dataclass(frozen=True)
class Place:
    """Where a simulation stands.

    Attributes
    ----------
    membrane : BatchState
        One case.
    sensors : BatchState or None
        A case for each of the four sensors; None where strain is read.
    """

    membrane: BatchState
    sensors: BatchState | None


class Running:
    """A simulation that can go on from any place it has been at.

    Parameters
    ----------
    elements_per_side, order : int
        Mesh, as in ``membrane_model``.
    params : MembraneParams
        Membrane and load.
    sensor : SensorArtifact or None
        Sensors; None where strain is read.
    sensor_parameters : mapping of str to float or array_like of shape (4,)
        Parameters of the sensors that differ from their start values; they rest at the prestrain.
    """

    def __init__(
        self,
        elements_per_side: int,
        order: int,
        params: MembraneParams,
        sensor: SensorArtifact | None,
        sensor_parameters: Mapping[str, ArrayLike] | None,
    ) -> None:
        self._params = params
        self._membrane = Batch(membrane_model(elements_per_side, order, compiled=True), STRAINS, DAMAGES)
        self._sensors = None if sensor is None else Sensors(sensor, params, sensor_parameters)

    def begin(self, damage: Vector, h: float) -> Place:
        """Return the place of rest with a damage, shape (16,) [1]."""
        nothing = np.zeros(0)
        start = {**asdict(self._params), "damage": damage[None]}
        membrane = self._membrane.run(0, h, start, dict.fromkeys(DAMAGES, nothing))
        return Place(membrane.state, None if self._sensors is None else self._sensors.rest(membrane.initial[0], h))

    def advance(self, place: Place, damage: Matrix, h: float) -> tuple[Matrix, Place]:
        """Go on from a place with many histories of damage.

        Parameters
        ----------
        place : Place
            Where all cases begin.
        damage : ndarray, shape (m, n, 16)
            Damage [1] at the end of every step.
        h : float
            Step [s].

        Returns
        -------
        ndarray, shape (m, 4, n)
            Strain [1] or resistance [ohm]; not a number where a case fails.
        Place
            Where the first case ends.
        """
        m, n, _ = damage.shape
        inputs = {name: damage[:, :, k] for k, name in enumerate(DAMAGES)}
        state = repeated(place.membrane, m)
        run = self._membrane.run(n, h, inputs=inputs, state=state, workers=WORKERS)
        if self._sensors is None:
            return run.results, Place(_first(run.state, 1), None)
        resistance, state = self._sensors.read(run.results, h, place.sensors)
        return resistance, Place(_first(run.state, 1), _first(state, N_SENSORS))


def _first(state: BatchState, cases: int) -> BatchState:
    return BatchState(x=state.x[:cases], values=state.values[:cases], model=state.model)
