"""From damages and nuisances to what the sensors read: the membrane, and the sensors behind it, in lanes.

Symbols: ``m`` cases, ``n`` samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Matrix, Vector
from ..batch import Batch
from ..errors import ParameterError
from ..membrane import MembraneParams, membrane_model
from ..membrane.params import stretch
from ..sensor import SensorArtifact, sensor_model
from .record import N_SENSORS

STRAINS = tuple(f"strain[{k + 1}]" for k in range(N_SENSORS))


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
        self._sensor: Batch | None = None
        if sensor is not None:
            written = sensor_model(sensor)
            starts = {v.name: v.start for v in written.variables if v.start is not None}
            starts.pop("strain")
            known: dict[str, ArrayLike] = {**starts, "rest_strain": stretch(params) - 1.0, **(sensor_parameters or {})}
            self.sensor_parameters = {name: np.broadcast_to(value, (N_SENSORS,)) for name, value in known.items()}
            self._sensor = Batch(written, ("resistance",), ("strain",))

    @property
    def has_sensor(self) -> bool:
        """Whether records of resistance can be fitted."""
        return self._sensor is not None

    def reading(self, kind: str) -> Reading:
        """Return the scale of records of a kind."""
        if kind == "strain":
            return Reading(zero=np.zeros((N_SENSORS, 1)), scale=np.ones((N_SENSORS, 1)))
        known = self.sensor_parameters
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
            return self._membrane.run(steps, h, start).results
        return self._pressed.run(steps, h, start, {"pressure": pressure}).results

    def resistance(self, strain: Matrix, h: float) -> Matrix:
        """Return the resistance [ohm] of sensors under strain, shape (m, 4, n); not a number where a case failed."""
        if self._sensor is None:
            msg = "the twin has no sensor. Give it one: Twin(sensor=...)."
            raise ParameterError(msg)
        m, _, n = strain.shape
        bad = np.asarray(~np.isfinite(strain).all(axis=(1, 2)))
        parameters = {name: np.tile(value, m) for name, value in self.sensor_parameters.items()}
        signal = np.where(bad[:, None, None], self.sensor_parameters["rest_strain"][:, None], strain).reshape(-1, n)
        found = self._sensor.run(n, h, parameters, {"strain": signal}).results.reshape(m, N_SENSORS, n)
        found[bad] = np.nan
        return found
