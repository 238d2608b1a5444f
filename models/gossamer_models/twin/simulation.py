"""The four sensors behind a twin's membrane: strain in, resistance out, in lanes.

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
from ..batch.cases import BatchState
from ..errors import ParameterError
from ..membrane import MembraneParams, membrane_model
from ..membrane.mesh import N_ZONES
from ..membrane.params import stretch
from ..sensor import SensorArtifact, sensor_model
from .record import N_SENSORS

STRAINS = tuple(f"strain[{k + 1}]" for k in range(N_SENSORS))
WORKERS = os.cpu_count() or 1  # threads of a simulation of many cases
DAMAGES = tuple(f"damage[{k + 1}]" for k in range(N_ZONES))


class Sensors:
    """Four sensors of one artifact, each with its parameters.

    Parameters
    ----------
    artifact : SensorArtifact
        What they are.
    params : MembraneParams
        Membrane that they are on; they rest at its prestrain.
    parameters : mapping of str to float or array_like of shape (4,)
        Parameters that differ from their start values.

    Raises
    ------
    ParameterError
        A parameter has another shape.

    Attributes
    ----------
    parameters : dict of ndarray, shape (4,)
        All parameters.
    """

    def __init__(
        self, artifact: SensorArtifact, params: MembraneParams, parameters: Mapping[str, ArrayLike] | None = None
    ) -> None:
        model = sensor_model(artifact)
        starts = {v.name: v.start for v in model.variables if v.causality == "parameter" and v.start is not None}
        known: dict[str, ArrayLike] = {**starts, "rest_strain": stretch(params) - 1.0, **(parameters or {})}
        for name, value in known.items():
            if np.shape(value) not in ((), (1,), (N_SENSORS,)):
                msg = f"sensor parameter {name!r} has shape {np.shape(value)}. Give one value, or one for each of 4 sensors."
                raise ParameterError(msg)
        self.parameters = {name: np.broadcast_to(value, (N_SENSORS,)) for name, value in known.items()}
        self._batch = Batch(model, ("resistance",), ("strain",))

    def rest(self, strain: Vector, h: float) -> BatchState:
        """Return the state of sensors that have rested under a strain, shape (4,) [1]."""
        start = {**self.parameters, "strain": strain}
        return self._batch.run(0, h, start, {"strain": np.zeros(0)}).state

    def read(self, strain: Matrix, h: float, state: BatchState | None = None) -> tuple[Matrix, BatchState]:
        """Return the resistance of sensors under strain, and their state.

        Parameters
        ----------
        strain : ndarray, shape (m, 4, n)
            Strain [1]; not a number in cases that have failed.
        h : float
            Step [s].
        state : BatchState, optional
            Of the four sensors, where every case begins; by default they have rested.

        Returns
        -------
        ndarray, shape (m, 4, n)
            Resistance [ohm]; not a number in cases that have failed.
        BatchState
            Of all sensors of all cases.
        """
        m, _, n = strain.shape
        failed = np.asarray(~np.isfinite(strain).all(axis=(1, 2)))
        signal = np.where(failed[:, None, None], self.parameters["rest_strain"][:, None], strain).reshape(-1, n)
        start = {name: np.tile(value, m) for name, value in self.parameters.items()} if state is None else {}
        run = self._batch.run(n, h, start, {"strain": signal}, state=None if state is None else repeated(state, m))
        resistance = run.results.reshape(m, N_SENSORS, n)
        resistance[failed] = np.nan
        return resistance, run.state


def repeated(state: BatchState, times: int) -> BatchState:
    """Return the cases of a state several times."""
    return BatchState(x=np.tile(state.x, (times, 1)), values=np.tile(state.values, (times, 1)), model=state.model)


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
