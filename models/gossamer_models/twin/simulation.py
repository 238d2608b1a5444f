"""From damages and nuisances to what sensors read, in lanes: from the start of the load, or from any place on the way.

Symbols: ``s`` sensors, ``z`` zones, ``m`` cases, ``n`` samples, ``h`` step [s].
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Matrix, Vector
from ..batch import Batch
from ..batch.cases import BatchState
from ..errors import ParameterError
from ..membrane import Structure, membrane_model
from ..membrane.square import stretch
from ..sensor import SensorArtifact, sensor_model

WORKERS = os.cpu_count() or 1  # threads of a simulation of many cases


class SensorBank:
    """Sensors of one artifact, each with its parameters: strain in, resistance out.

    Parameters
    ----------
    artifact : SensorArtifact
        What they are.
    count : int
        How many.
    rest_strain : float
        At which they rest [1].
    parameters : mapping of str to float or array_like of shape (s,)
        Parameters that differ from their start values.

    Raises
    ------
    ParameterError
        A parameter has another shape.

    Attributes
    ----------
    parameters : dict of ndarray, shape (s,)
        All parameters.
    """

    def __init__(
        self,
        artifact: SensorArtifact,
        count: int,
        rest_strain: float,
        parameters: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        model = sensor_model(artifact)
        starts = {v.name: v.start for v in model.variables if v.causality == "parameter" and v.start is not None}
        known: dict[str, ArrayLike] = {**starts, "rest_strain": rest_strain, **(parameters or {})}
        for name, value in known.items():
            if np.shape(value) not in ((), (1,), (count,)):
                msg = (
                    f"sensor parameter {name!r} has shape {np.shape(value)}. Give one value, or one for each of {count} "
                    "sensors."
                )
                raise ParameterError(msg)
        self.parameters = {name: np.broadcast_to(value, (count,)) for name, value in known.items()}
        self._batch = Batch(model, ("resistance",), ("strain",))

    def rest(self, strain: Vector, h: float) -> BatchState:
        """Return the state of sensors that have rested under a strain, shape (s,) [1]."""
        start = {**self.parameters, "strain": strain}
        return self._batch.run(0, h, start, {"strain": np.zeros(0)}).state

    def read(self, strain: Matrix, h: float, state: BatchState | None = None) -> tuple[Matrix, BatchState]:
        """Return the resistance of sensors under strain, and their state.

        Parameters
        ----------
        strain : ndarray, shape (m, s, n)
            Strain [1]; not a number in cases that have failed.
        h : float
            Step [s].
        state : BatchState, optional
            Of the sensors, where every case begins; by default they have rested.

        Returns
        -------
        ndarray, shape (m, s, n)
            Resistance [ohm]; not a number in cases that have failed.
        BatchState
            Of all sensors of all cases.
        """
        m, count, n = strain.shape
        failed = np.asarray(~np.isfinite(strain).all(axis=(1, 2)))
        signal = np.where(failed[:, None, None], self.parameters["rest_strain"][:, None], strain).reshape(-1, n)
        start = {name: np.tile(value, m) for name, value in self.parameters.items()} if state is None else {}
        run = self._batch.run(n, h, start, {"strain": signal}, state=None if state is None else _repeated(state, m))
        resistance = run.results.reshape(m, count, n)
        resistance[failed] = np.nan
        return resistance, run.state


@dataclass(frozen=True)
class Place:
    """Where a simulation stands.

    Attributes
    ----------
    membrane : BatchState
        One case.
    sensors : BatchState or None
        A case for each of the s sensors; None where strain is read.
    """

    membrane: BatchState
    sensors: BatchState | None


class Forward:
    """The compiled membrane and, for resistance, the compiled sensor.

    Parameters
    ----------
    structure : Structure
        Membrane, with the start values of its load.
    sensor : SensorArtifact or None
        Sensor; None if records hold strain only.
    sensor_parameters : mapping of str to float or array_like of shape (s,)
        Parameters of the sensors that differ from their start values; they rest at the prestrain.

    Attributes
    ----------
    n_zones, n_sensors : int
        z and s.
    parameters : dict of float
        Start values of the membrane's parameters.
    sensors : SensorBank or None
        Sensors, if there are some.
    """

    def __init__(
        self,
        structure: Structure,
        sensor: SensorArtifact | None = None,
        sensor_parameters: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        self._model = model = membrane_model(structure)
        self._strains, self._damages = model.elements("strain"), model.elements("damage")
        self.n_zones, self.n_sensors = structure.n_zones, structure.n_sensors
        self.parameters = {v.name: v.start or 0.0 for v in model.variables if v.causality == "parameter"}
        self.sensors = None
        if sensor is not None:
            if "edge_displacement" not in self.parameters:
                msg = (
                    "resistance is fitted on the square alone, whose strain at rest is known. Give a record of strain."
                )
                raise ParameterError(msg)
            rest = stretch(SimpleNamespace(**self.parameters)) - 1.0
            self.sensors = SensorBank(sensor, self.n_sensors, rest, sensor_parameters)

    @cached_property
    def _steady(self) -> Batch:
        return Batch(self._model, self._strains)

    @cached_property
    def _pressed(self) -> Batch:
        return Batch(self._model, self._strains, ("pressure",))

    @cached_property
    def _changing(self) -> Batch:
        return Batch(self._model, self._strains, self._damages)

    def scale(self, kind: str) -> tuple[Matrix, Matrix]:
        """Return what sensors read that a gain leaves as it is, and what an offset is a fraction of, shape (s, 1).

        Raises
        ------
        ParameterError
            There are no sensors to read resistance.
        """
        if kind == "strain":
            return np.zeros((self.n_sensors, 1)), np.ones((self.n_sensors, 1))
        known = self.require_sensors().parameters
        return known["rest_resistance"][:, None], known["full_scale_resistance_change"][:, None]

    def strain(
        self, damage: Matrix, parameters: Mapping[str, Vector], pressure: Matrix | None, steps: int, h: float
    ) -> Matrix:
        """Simulate the strain [1] of the sensors, shape (m, s, steps); not a number where a case fails.

        Parameters
        ----------
        damage : ndarray, shape (m, z)
            Lost fraction of Young's modulus [1].
        parameters : mapping of str to ndarray of shape (m,)
            Parameters that differ from those of the twin.
        pressure : ndarray of shape (m, steps), or None
            Pressure [Pa] added to the built-in one.
        steps, h : int, float
            Samples and the time between them [s].
        """
        start = {**parameters, "damage": damage}
        if pressure is None:
            return self._steady.run(steps, h, start, workers=WORKERS).results
        return self._pressed.run(steps, h, start, {"pressure": pressure}, workers=WORKERS).results

    def resistance(self, strain: Matrix, h: float) -> Matrix:
        """Return the resistance [ohm] of sensors under strain, shape (m, s, n); not a number where a case failed."""
        return self.require_sensors().read(strain, h)[0]

    def require_sensors(self) -> SensorBank:
        """Return the sensors; raise ``ParameterError`` if there are none."""
        if self.sensors is None:
            msg = "the record holds resistance, but the twin has no sensor. Give it one: Twin(sensor=...)."
            raise ParameterError(msg)
        return self.sensors

    def begin(self, damage: Vector, h: float) -> Place:
        """Return the place of rest with a damage, shape (z,) [1]."""
        nothing = dict.fromkeys(self._damages, np.zeros(0))
        membrane = self._changing.run(0, h, {"damage": damage[None]}, nothing)
        return Place(membrane.state, None if self.sensors is None else self.sensors.rest(membrane.initial[0], h))

    def advance(self, place: Place, damage: Matrix, h: float) -> tuple[Matrix, Place]:
        """Go on from a place with many histories of damage.

        Parameters
        ----------
        place : Place
            Where all cases begin.
        damage : ndarray, shape (m, n, z)
            Damage [1] at the end of every step.
        h : float
            Step [s].

        Returns
        -------
        ndarray, shape (m, s, n)
            Strain [1] or resistance [ohm]; not a number where a case fails.
        Place
            Where the first case ends.
        """
        m, n, _ = damage.shape
        inputs = dict(zip(self._damages, np.moveaxis(damage, 2, 0), strict=True))
        run = self._changing.run(n, h, inputs=inputs, state=_repeated(place.membrane, m), workers=WORKERS)
        if self.sensors is None:
            return run.results, Place(_first(run.state, 1), None)
        resistance, state = self.sensors.read(run.results, h, place.sensors)
        return resistance, Place(_first(run.state, 1), _first(state, self.n_sensors))


def _first(state: BatchState, cases: int) -> BatchState:
    return BatchState(x=state.x[:cases], values=state.values[:cases], model=state.model)


def _repeated(state: BatchState, times: int) -> BatchState:
    return BatchState(x=np.tile(state.x, (times, 1)), values=np.tile(state.values, (times, 1)), model=state.model)
