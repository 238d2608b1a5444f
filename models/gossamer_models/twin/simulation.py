"""A forward model and the sensors on it: strain or resistance, from the start of the load, or from any place on the way.

Symbols: ``s`` sensors, ``z`` zones, ``m`` cases, ``n`` samples, ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Matrix, Vector
from ..batch import Batch
from ..batch.cases import BatchState
from ..errors import ParameterError
from ..sensor import SensorArtifact, sensor_model
from .forward import Forward


class SensorBank:
    """Sensors of one artifact, each with its parameters: strain in, resistance out.

    Parameters
    ----------
    artifact : SensorArtifact
        What they are.
    count : int
        How many.
    rest_strain : array_like, scalar or shape (s,)
        At which they rest [1].
    parameters : mapping of str to float or array_like of shape (s,)
        Parameters that differ from their start values.

    Raises
    ------
    ParameterError
        A parameter has another shape.

    Attributes
    ----------
    artifact : SensorArtifact
        What they are.
    parameters : dict of ndarray, shape (s,)
        All parameters.
    """

    def __init__(
        self, artifact: SensorArtifact, count: int, rest_strain: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None
    ) -> None:
        self.artifact, model = artifact, sensor_model(artifact)
        starts = {v.name: v.start for v in model.variables if v.causality == "parameter" and v.start is not None}
        known: dict[str, ArrayLike] = {**starts, "rest_strain": rest_strain, **(parameters or {})}
        for name, value in known.items():
            if np.shape(value) not in ((), (1,), (count,)):
                advice = f"Give one value, or one for each of {count} sensors."
                msg = f"sensor parameter {name!r} has shape {np.shape(value)}. {advice}"
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
            Of all sensors of all cases, where they begin; by default they have rested.

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
        run = self._batch.run(n, h, start, {"strain": signal}, state=state)
        resistance = run.results.reshape(m, count, n)
        resistance[failed] = np.nan
        return resistance, run.state


@dataclass(frozen=True)
class Place:
    """Where the simulations of m cases stand.

    Attributes
    ----------
    membrane : BatchState
        Of the m cases.
    sensors : BatchState or None
        Of the m s sensors, case by case; None where strain is read.
    """

    membrane: BatchState
    sensors: BatchState | None

    def take(self, cases: NDArray[np.int64]) -> Place:
        """Return where some cases stand, from 0; a case may be taken many times."""

        def rows(state: BatchState) -> BatchState:
            each = np.arange(len(state.x)).reshape(len(self.membrane.x), -1)[cases].ravel()
            return replace(state, x=state.x[each], values=state.values[each])

        return Place(rows(self.membrane), None if self.sensors is None else rows(self.sensors))

    def moved(self, first: Place) -> Place:
        """Return all cases moved by the same, so that the first case stands at a place."""
        return self._shifted(lambda rows, to: to - rows[0], first)

    def moved_along(self, moves: Vector) -> Place:
        """Return all cases moved along each of the cases after the first, by multiples of its distance from the first."""
        return self._shifted(lambda rows, _: np.tensordot(moves, rows[1 : 1 + moves.size] - rows[0], axes=1), self)

    def _shifted(self, by: Callable[[Matrix, Matrix], Matrix], to: Place) -> Place:
        def shifted(state: BatchState, to: BatchState) -> BatchState:
            moved = {}
            for name in ("x", "values"):
                rows, other = getattr(state, name), getattr(to, name)
                cases = rows.reshape(len(self.membrane.x), -1)
                moved[name] = (cases + by(cases, other.reshape(-1, cases.shape[1])[0])).reshape(rows.shape)
            return replace(state, **moved)

        sensors = None if self.sensors is None or to.sensors is None else shifted(self.sensors, to.sensors)
        return Place(shifted(self.membrane, to.membrane), sensors)

    @staticmethod
    def joined(places: Sequence[Place]) -> Place:
        """Return the cases of some places as those of one."""

        def together(states: Sequence[BatchState]) -> BatchState:
            x, values = (np.concatenate([getattr(state, name) for state in states]) for name in ("x", "values"))
            return replace(states[0], x=x, values=values)

        sensors = [place.sensors for place in places if place.sensors is not None]
        return Place(together([place.membrane for place in places]), together(sensors) if sensors else None)


class SensedForward:
    """A forward model and, for resistance, the compiled sensors.

    Parameters
    ----------
    forward : Forward
        From damage to strain.
    sensor : SensorArtifact or None
        Sensor; None if records hold strain only.
    sensor_parameters : mapping of str to float or array_like of shape (s,)
        Parameters of the sensors that differ from their start values; they rest at the strain of the undamaged structure in
        equilibrium.

    Attributes
    ----------
    forward : Forward
        From damage to strain.
    bank : SensorBank or None
        Sensors, if there are some.
    """

    def __init__(
        self,
        forward: Forward,
        sensor: SensorArtifact | None = None,
        sensor_parameters: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        self.forward, self.bank = forward, None
        if sensor is not None:
            _, rest = forward.begin(np.zeros(len(forward.zones)), {})
            self.bank = SensorBank(sensor, forward.sensors, rest, sensor_parameters)

    def scale(self, kind: str) -> tuple[Matrix, Matrix]:
        """Return what sensors read that a gain leaves as it is, and what an offset is a fraction of, shape (s, 1).

        Raises
        ------
        ParameterError
            There are no sensors to read resistance.
        """
        if kind == "strain":
            return np.zeros((self.forward.sensors, 1)), np.ones((self.forward.sensors, 1))
        known = self.require_bank().parameters
        return known["rest_resistance"][:, None], known["full_scale_resistance_change"][:, None]

    def read(self, strain: Matrix, kind: str, h: float) -> Matrix:
        """Return what sensors read of strain, shape (m, s, n), in the unit of a kind of record."""
        return strain if kind == "strain" else self.resistance(strain, h)

    def resistance(self, strain: Matrix, h: float) -> Matrix:
        """Return the resistance [ohm] of sensors under strain, shape (m, s, n); not a number where a case failed."""
        return self.require_bank().read(strain, h)[0]

    def require_bank(self) -> SensorBank:
        """Return the sensors; raise ``ParameterError`` if there are none."""
        if self.bank is None:
            msg = "the record holds resistance, but the twin has no sensor. Give it one: Twin(sensor=...)."
            raise ParameterError(msg)
        return self.bank

    def begin(self, damage: Vector, parameters: Mapping[str, float], h: float) -> Place:
        """Return the place of rest with a damage, shape (z,) [1], and with parameters and inputs."""
        membrane, strain = self.forward.begin(damage, parameters)
        return Place(membrane, None if self.bank is None else self.bank.rest(strain, h))

    def advance(
        self, place: Place, damage: Matrix, histories: Mapping[str, Matrix], h: float
    ) -> tuple[Matrix, Matrix, Place]:
        """Go on from the places of some cases with histories of damage.

        Parameters
        ----------
        place : Place
            Where the m cases begin.
        damage : ndarray, shape (m, n, z)
            Damage [1] at the end of every step.
        histories : mapping of str to ndarray of shape (n,)
            Loads at the end of every step.
        h : float
            Step [s].

        Returns
        -------
        ndarray, shape (m, s, n)
            Strain [1] or resistance [ohm] that is read; not a number where a case fails.
        ndarray, shape (m, s, n)
            Strain [1].
        Place
            Where they end.
        """
        strain, membrane = self.forward.advance(place.membrane, damage, histories, h)
        if self.bank is None:
            return strain, strain, Place(membrane, None)
        resistance, sensors = self.bank.read(strain, h, place.sensors)
        return resistance, strain, Place(membrane, sensors)
