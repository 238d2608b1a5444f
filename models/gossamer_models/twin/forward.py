"""From damages and nuisances to what the sensors read, from the start of the load, in lanes.

Symbols: ``m`` cases, ``n`` samples.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Matrix, Vector
from ..batch import Batch
from ..errors import ParameterError
from ..membrane import MembraneParams, membrane_model
from ..sensor import SensorArtifact
from .record import N_SENSORS
from .sensors import Sensors

STRAINS = tuple(f"strain[{k + 1}]" for k in range(N_SENSORS))
WORKERS = os.cpu_count() or 1  # threads of a simulation of many cases


@dataclass(frozen=True)
class Reading:
    """The scale that sensors read on.

    Attributes
    ----------
    zero, scale : ndarray, shape (4, 1)
        Reading of each sensor that a gain leaves as it is, and what its offset is a fraction of.
    """

    zero: Matrix
    scale: Matrix


class Forward:
    """The compiled membrane and, for resistance, the compiled sensor.

    Parameters
    ----------
    elements_per_side, order : int
        Mesh, as in ``membrane_model``.
    params : MembraneParams
        Membrane and load.
    sensor : SensorArtifact or None
        Sensor; None if records hold strain only.
    sensor_parameters : mapping of str to float or sequence of 4 floats
        Parameters of the sensors that differ from their start values.

    Attributes
    ----------
    params : MembraneParams
        Membrane and load.
    sensors : Sensors or None
        Sensors, if there are some.
    """

    def __init__(
        self,
        elements_per_side: int,
        order: int,
        params: MembraneParams,
        sensor: SensorArtifact | None = None,
        sensor_parameters: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        model = membrane_model(elements_per_side, order, compiled=True)
        self.params = params
        self._membrane = Batch(model, STRAINS)
        self._pressed = Batch(model, STRAINS, ("pressure",))
        self.sensors = None if sensor is None else Sensors(sensor, params, sensor_parameters)

    def reading(self, kind: str) -> Reading:
        """Return the scale of records of a kind; raise ``ParameterError`` for resistance without sensors."""
        if kind == "strain":
            return Reading(zero=np.zeros((N_SENSORS, 1)), scale=np.ones((N_SENSORS, 1)))
        known = self.require_sensors().parameters
        zero, scale = (known[name][:, None] for name in ("rest_resistance", "full_scale_resistance_change"))
        return Reading(zero=zero, scale=scale)

    def strain(
        self, damage: Matrix, parameters: Mapping[str, Vector], pressure: Matrix | None, steps: int, h: float
    ) -> Matrix:
        """Simulate the strain [1] of the sensors, shape (m, 4, steps); not a number where a case fails.

        Parameters
        ----------
        damage : ndarray, shape (m, 16)
            Lost fraction of Young's modulus [1].
        parameters : mapping of str to ndarray of shape (m,)
            Parameters that differ from those of the twin.
        pressure : ndarray of shape (m, steps), or None
            Pressure [Pa] added to the built-in one.
        steps, h : int, float
            Samples and the time between them [s].
        """
        start = {**asdict(self.params), **parameters, "damage": damage}
        if pressure is None:
            return self._membrane.run(steps, h, start, workers=WORKERS).results
        return self._pressed.run(steps, h, start, {"pressure": pressure}, workers=WORKERS).results

    def resistance(self, strain: Matrix, h: float) -> Matrix:
        """Return the resistance [ohm] of sensors under strain, shape (m, 4, n); not a number where a case failed."""
        return self.require_sensors().read(strain, h)[0]

    def require_sensors(self) -> Sensors:
        """Return the sensors; raise ``ParameterError`` if there are none."""
        if self.sensors is None:
            msg = "the record holds resistance, but the twin has no sensor. Give it one: Twin(sensor=...)."
            raise ParameterError(msg)
        return self.sensors
