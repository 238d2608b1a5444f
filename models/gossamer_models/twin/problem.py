r"""The least-squares problem of one record: what is unknown, what is predicted, how it is weighed.

Symbols: ``x`` unknowns, first the damages [1], then the nuisances in units of their priors; ``s`` sensors,
``n`` samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import replace
from itertools import compress
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Rows, Vector
from .discrepancy import Discrepancy, spline_matrix
from .forward import Forward
from .least_squares import PRIOR_DEVIATION, LeastSquares, Point, neighbours, require_finite
from .nuisances import MODULUS, SENSOR, SPARE, Loads, Nuisances
from .record import ResponseRecord, StaticRecord
from .sensor_error import SensorError
from .simulation import SensedForward
from .unknowns import Added, DamageUnknowns
from .weights import RecordWeights

SMALL = 1e-2  # of a cause, to weigh it where sensors bend it
KEPT = 64  # simulations: those of derivatives, which serve again under other weights
SMALL_STEP = 2e-5  # of damage: errors of differences would tell modulus, density, loads and equal damage apart


class RecordProblem(DamageUnknowns, LeastSquares):
    """Predictions, residuals and derivatives for one record.

    Parameters
    ----------
    sensed : SensedForward
        Simulation.
    record : ResponseRecord
        What is fitted.
    nuisances : Nuisances
        What is unknown beside the damages, and the loads.
    noise : ndarray, shape (s,)
        Standard deviation of the noise, in the unit of the record.
    discrepancy : Discrepancy or None
        Model error that is learned on splines; nothing faster is compared then.
    groups : ndarray of int, shape (zones,), or None
        Which unknown each zone's damage is, from 0; None for one each.
    error : ndarray, shape (k, s, n or more), or None
        Components of an error of the model without a discrepancy, in the record's unit, at the samples or in the states.
    report : callable, optional
        Called before each group of simulations with the length of the record [s] and the simulations that were made.

    Attributes
    ----------
    noise : ndarray, shape (s,)
        Standard deviation of the noise.
    components : ndarray, shape (k, s, n)
        Of the error of the model beside that of the sensors, in the record's unit.
    sensor_error : SensorError or None
        How far the sensors may be off their identified model, if that is a nuisance.
    added : Added or None
        What a finer mesh adds to the strain; None if none was simulated.
    learned_behind : bool
        Whether the error of the mesh was learned of what sensors read that keep to their model.
    """

    def __init__(
        self,
        sensed: SensedForward,
        record: ResponseRecord,
        nuisances: Nuisances,
        noise: Vector,
        discrepancy: Discrepancy | None,
        groups: NDArray[np.int64] | None = None,
        error: Matrix | None = None,
        report: Callable[[float, int], None] = lambda *_: None,
    ) -> None:
        super().__init__(sensed.forward, nuisances, groups)
        self.steps[: self.zones] = SMALL_STEP
        self.sensed, self.record = sensed, record
        self._zero, self._scale = sensed.scale(record.kind)
        self._made, self._report, self._counting = [0], report, Lock()  # simulations, those of all copies together
        self._known: dict[bytes, tuple[Matrix, Matrix]] = {}
        self._of_mesh: dict[bytes, Matrix] = {}
        self.noise, self._splines, self.sensor_error = noise, None, None
        self.added: Added | None = None
        self.components = self._causes = np.zeros((0, *record.values.shape))
        self.learned_behind = discrepancy is not None and discrepancy.kind == "resistance"
        if discrepancy is not None:
            self._splines = spline_matrix(record.samples, record.step, discrepancy.length)
            basis = discrepancy.basis(record.samples, record.step)
            self.components = basis if self.learned_behind else self.columns_as_read(basis, np.zeros(self.size))
        elif error is not None:
            self.components = self._of_record(error)
        if SENSOR in nuisances.kinds:
            strain, reading = self._simulated(np.zeros((1, self.size)))
            self.sensor_error = self._error_along(require_finite(strain), reading[0])
        self._weigh_anew()

    def like(self, other: RecordProblem) -> RecordProblem:
        """Return the problem with the errors of sensors and mesh of another one of this record, but for causes beside."""
        added = None if other.added is None else other.added.of(self._as_of(other))
        return self._with(sensor_error=other.sensor_error, components=other.components, added=added, _known={})

    def _as_of(self, other: RecordProblem) -> Matrix:
        """Return the matrix from these unknowns to those of a problem with finer groups or fewer nuisances."""
        found, names = np.zeros((other.size, self.size)), self.nuisances.names
        found[other.groups, self.groups] = 1.0
        for k, name in enumerate(other.nuisances.names):
            found[other.zones + k, self.zones + names.index(name)] = 1.0
        return found

    def under(self, noise: Vector, record: ResponseRecord | None = None) -> RecordProblem:
        """Return the problem with other noise, shape (s,), and that of a record of the same values where it is coloured."""
        return self._with(noise=noise, record=self.record if record is None else record.first(self.record.samples))

    def corrected(
        self, finer: Forward, point: Point, moving: NDArray[np.int64], needed: NDArray[np.int64], components: Matrix
    ) -> RecordProblem:
        """Return the problem with what a finer mesh adds to the strain about a point.

        Parameters
        ----------
        finer : Forward
            The same membrane on a finer mesh.
        point : Point
            Where it is simulated.
        moving : ndarray of int, shape (k,)
            Unknowns by which it is differentiated, of those that are simulated.
        needed : ndarray of int, shape (l,)
            Those of them without which derivatives that were taken nearby do not serve again.
        components : ndarray, shape (k, s, n or more)
            Of the error of the finer mesh, in place of those of this one; at the samples or in the states.

        Raises
        ------
        ConvergenceError
            The finer mesh fails there.
        """
        other = copy(self)
        other.model, other._of_mesh = finer, {}
        if self.added is not None and self.added.serves(point.x, needed):
            more = require_finite(other._on_mesh(point.x[None]) - self._on_mesh(point.x[None]))[0]
            added = replace(self.added, strain=more, x=point.x)
            return self._with(added=added, components=self._of_record(components), _known={})
        rows, steps = (np.concatenate(parts) for parts in zip(*self._ways(point.x, moving), strict=True))
        rows = np.vstack([point.x, rows])
        more = require_finite(other._on_mesh(rows) - self._on_mesh(rows))
        slopes = self._mean((more[1:] - more[0]) / steps[:, None, None], moving)
        added = Added(more[0], point.x, moving, slopes, point.x, self.zones)
        return self._with(added=added, components=self._of_record(components), _known={})

    def central(self, step: float) -> RecordProblem:
        """Return the problem with central differences by its nuisances, of a step in units of their priors."""
        steps = np.where(np.arange(self.size) < self.zones, self.steps, step)
        return self._with(steps=steps, is_central=True)

    def _ways(self, x: Vector, places: NDArray[np.int64]) -> list[tuple[Matrix, Vector]]:
        """Return rows with one unknown moved in each, and the moves; then backwards, where differences are central."""
        both = places[places >= self.zones] if self.is_central else places[:0]
        ways = ((places, self.steps[places]), (both, -self.steps[both]))
        return [neighbours(x, which, steps, self.high) for which, steps in ways]

    def _mean(self, slopes: Matrix, places: NDArray[np.int64]) -> Matrix:
        """Return derivatives by unknowns from those by differences of both ways, one after another."""
        found, backwards = slopes[: places.size].copy(), slopes[places.size :]
        own = slice(places.size - len(backwards), None)  # nuisances are the last ones
        found[own] = (found[own] + backwards) / 2.0
        return found

    def under_loads(self, loads: Loads) -> RecordProblem:
        """Return the problem of a record under other loads, of the same length and noise."""
        return self._with(nuisances=replace(self.nuisances, loads=loads), added=None, _known={}, _of_mesh={})

    def placed(self, slopes: Matrix) -> RecordProblem:
        """Return the problem with what places of sensors change, shape (2, s, n or more), see ``Nuisances``."""
        return self._with(nuisances=replace(self.nuisances, slopes=slopes))

    def without_mesh_error(self) -> RecordProblem:
        """Return the problem of a record that the mesh of the twin has made."""
        return self._with(components=self.components[:0])

    @property
    def mesh_over_noise(self) -> float:
        """How many times as large as the noise the error of the model is, root mean squares of what is compared [1]."""
        alone = self._weights_of(self.record.present, self.components[:0])
        return float(np.sqrt(np.sum(alone.weigh(self.components) ** 2) / max(alone.values, 1)))

    def told(self, point: Point, kept: Rows) -> RecordProblem:
        """Return the problem with the error of the sensors along what a point predicts, and with scales anew.

        ``kept`` are the unknowns that the point was fitted by, shape (size,): others have taken nothing from the scales.
        """
        before = self.sensor_error
        if before is None:
            return self
        error = self._error_along(self._simulated(point.x[None])[0], self.reading(point), before.scales)
        return self._with(sensor_error=error.told(self.record.values, self.weigh_alone(self.unknown(point)[kept])))

    def unknown(self, point: Point) -> Matrix:
        """Return what deviations of the unknowns about a point change of what the sensors read, shape (k, s, n)."""
        rows, steps = neighbours(point.x, np.arange(self.size), self.steps, self.high)
        slopes = (self._read(self.predict(rows), self.z(rows)) - self.reading(point)) / steps[:, None, None]
        spread = np.where(np.arange(self.size) < self.zones, PRIOR_DEVIATION, 1.0)
        return np.asarray(slopes * spread[:, None, None])

    def alone(self, sensor: int, noise: float, follows: float, beside: Matrix) -> RecordWeights:
        """Return weights of one sensor, shape (m, 1, n), under another noise and beside more components, shape (k, s, n)."""
        own = [] if self.sensor_error is None else [self.sensor_error.own]
        row, found = [sensor], np.concatenate([self._common, beside, *own])[:, [sensor]]
        moving = found.any(axis=(1, 2))
        return RecordWeights(self.record.present[row], np.array([noise]), found[moving], self._splines, follows=follows)

    def weigh_alone(self, unknown: Matrix | None = None) -> dict[int, Callable[[Matrix], Matrix]]:
        """Return what weighs the values of each sensor alone, without an error of its own, see ``SensorError.told``.

        What the unknowns may change, shape (k, s, n), is weighed like an error of the mesh: the scales of the sensors'
        errors would otherwise lack what the unknowns have taken from them.
        """
        sensors, present = np.arange(len(self.record.values)), self.record.present
        components = np.concatenate([self.components, self._causes, *([] if unknown is None else [unknown])])
        return {k: self._weights_of(present & (sensors == k)[:, None], components).weigh for k in self.record.sensors}

    @property
    def simulations(self) -> int:
        """How many cases were simulated for this problem, and for those with other errors of the record."""
        return self._made[0]

    @property
    def at_once(self) -> bool:
        """Whether some predictions cost little more than one."""
        return not isinstance(self.record, StaticRecord)

    @property
    def in_time(self) -> bool:
        """Whether the values of a sensor follow each other in time."""
        return self._splines is None and not isinstance(self.record, StaticRecord)

    @property
    def of_sensors(self) -> list[slice]:
        """Which values belong to each sensor."""
        return self._weights.of_sensors

    @property
    def log_determinant(self) -> float:
        """Of the covariance of the record beside the nuisances that are fitted."""
        sizes = np.array([part.stop - part.start for part in self.of_sensors])
        seen = sizes > 0  # the noise of sensors that are left out is no number
        return self._weights.log_determinant + 2.0 * float(sizes[seen] @ np.log(self.noise[seen]))

    before = None  # damages of a last inspection: those of ``JointProblem`` alone
    is_central = False  # differences by nuisances

    @property
    def parts(self) -> tuple[tuple[RecordProblem, slice, str], ...]:
        """The problem itself with all values and nothing to call it by, as in ``JointProblem``."""
        return ((self, slice(None), ""),)

    @property
    def modulus(self) -> int | None:
        """Which unknown is the factor on Young's modulus."""
        return self.zones + self.nuisances.simulated.index(MODULUS) if MODULUS in self.nuisances.simulated else None

    @property
    def _common(self) -> Matrix:
        """Components that all sensors share: of the error of the mesh, of causes beside it, and of what is their kind's."""
        kind = [] if self.sensor_error is None else [self.sensor_error.shared]
        return np.concatenate([self.components, self._causes, *kind])

    def _with(self, **changes: object) -> RecordProblem:
        """Return the problem with other attributes, weighed anew."""
        found = copy(self)
        vars(found).update(changes)
        found._weigh_anew()
        return found

    def _weigh_anew(self) -> None:
        own = None if self.sensor_error is None else self.sensor_error.own
        self._weights = self._weights_of(self.record.present, self._common, own)
        self.values = self._weights.values
        self.y = self._weights.weigh(np.where(self.record.present, self.record.values, 0.0)[None])[0]

    def _weights_of(self, present: Rows, components: Matrix, own: Matrix | None = None) -> RecordWeights:
        return RecordWeights(present, self.noise, components, self._splines, own, self.record.follows)

    def _error_along(self, strain: Matrix, resistance: Matrix, scales: Matrix | None = None) -> SensorError:
        bank, n = self.sensed.require_bank(), self.record.samples
        return SensorError.along(bank, strain[0, :, :n], resistance[:, :n], self.record.step, scales)

    def predict(self, x: Matrix) -> Matrix:
        """Return strain or resistance without gain, offset and delay, shape (m, s, n or more)."""
        return self._simulated(x)[1]

    def weigh(self, predicted: Matrix, x: Matrix) -> Matrix:
        """Weigh what sensors with gain, offset and delay read, shape (m, values)."""
        return self._weights.weigh(self._read(predicted, self.z(x)))

    def derivatives(self, point: Point, free: Rows) -> Matrix:
        """Return the derivatives of the weighed predictions; of equilibria by the damages from the tangent there."""
        if self.is_central:
            simulated = np.flatnonzero(free[: self.simulated])
            if simulated.size and not isinstance(self.record, StaticRecord):  # all at once
                self.predict(np.vstack([rows for rows, _ in self._ways(point.x, simulated)]))
            backward = copy(self)
            backward.steps, beside = -self.steps, free & (np.arange(self.size) >= self.zones)
            ways = [self._one_way(point, free), backward._one_way(point, beside)]
            return self._mean(np.hstack(ways).T, np.flatnonzero(free)).T
        return self._one_way(point, free)

    def _one_way(self, point: Point, free: Rows) -> Matrix:
        if not isinstance(self.record, StaticRecord):
            return super().derivatives(point, free)
        zones = np.flatnonzero(free[: self.zones])
        x = point.x[None]
        z = self.z(x)
        loads = {name: np.ravel(load) for name, load in self.nuisances.histories(z, np.zeros(self.record.states)).items()}
        given = {name: float(value[0]) for name, value in self.nuisances.moved(z).items()}
        slopes = self.model.state_slopes(self.damage(x)[0], given, loads)
        moves = np.array([slopes[self.groups == zone].sum(axis=0) for zone in zones]).reshape(-1, *slopes.shape[1:])
        read = moves[:, :, self.record.state] + (0.0 if self.added is None else self.added.along(zones))
        moved = self.weigh(point.predicted + read, np.repeat(x, len(zones), axis=0))
        by_damage = require_finite((moved - (self.y - point.r)).T)
        return np.hstack([by_damage, super().derivatives(point, free & (np.arange(self.size) >= self.zones))])

    def reading(self, point: Point) -> Matrix:
        """Return what the sensors read at a point, shape (s, n), in the unit of the record."""
        return np.asarray(self._read(point.predicted[None], self.z(point.x[None]))[0])

    def felt(self, point: Point) -> Matrix:
        """Return the strain [1] of the sensors at a point, shape (s, n), as late as the record is."""
        z = self.z(point.x[None])
        kinds = tuple(kind for kind in self.nuisances.kinds if kind == "clock")
        exact = replace(self.nuisances, kinds=kinds, spread=None, slopes=None)
        late = z[:, [name == "clock" for name in self.nuisances.names]]
        strain = point.predicted[None] if self.record.kind == "strain" else self._simulated(point.x[None])[0]
        strain = exact.read(strain, self._zero, self._scale, late)
        return np.asarray(strain[0, :, : self.record.samples])

    def weigh_columns(self, columns: Matrix, x: Vector) -> Matrix:
        """Weigh small changes of the strain [1] about unknowns, shape (k, s, n), shape (k, values)."""
        return self._weights.weigh(self.columns_as_read(SMALL * columns, x) / SMALL)

    def columns_as_read(self, columns: Matrix, x: Vector) -> Matrix:
        """Return small changes of the strain [1] about unknowns as changes of the record, shape (k, s, n)."""
        if self.record.kind == "strain":
            return columns
        strain = require_finite(self._simulated(x[None])[0])[:, :, : self.record.samples]
        both = self.sensed.resistance(np.concatenate([strain, strain + columns]), self.record.step)
        return both[1:] - both[:1]

    def beside(self, components: Matrix) -> RecordProblem:
        """Return the problem with more components of an error of the model, in the record's unit, shape (k, s, n)."""
        return self._with(_causes=np.concatenate([self._causes, components]))

    def _of_record(self, error: Matrix) -> Matrix:
        """Return an error of the model at the samples or in the states, shape (k, s, n or more), at the record's values."""
        return error[:, :, self.record.state if isinstance(self.record, StaticRecord) else slice(self.record.samples)]

    def _read(self, predicted: Matrix, z: Matrix) -> Matrix:
        return self.nuisances.read(predicted, self._zero, self._scale, z)[:, :, : self.record.samples]

    def _simulated(self, x: Matrix) -> tuple[Matrix, Matrix]:
        """Return the strain of rows of unknowns and what sensors read of it, shape (m, s, n); the last ones are kept."""

        def made(rows: Matrix) -> Iterable[tuple[Matrix, Matrix]]:
            strain = self._on_mesh(rows) if self.added is None else self._on_mesh(rows) + self.added.to(rows)
            return zip(strain, self.sensed.read(strain, self.record.kind, self.record.step), strict=True)

        strains, reads = zip(*self._kept("_known", x, made), strict=True)
        return np.stack(strains), np.stack(reads)

    def _on_mesh(self, x: Matrix) -> Matrix:
        """Return the strain of rows of unknowns without what a finer mesh adds, shape (m, s, n); the last ones are kept."""
        return np.stack(self._kept("_of_mesh", x, self._strain))

    def _kept(self, name: str, x: Matrix, made: Callable[[Matrix], Iterable[Any]]) -> list[Any]:
        """Return what is made of each row of unknowns, where it is not among the last ones."""
        keys = [row.tobytes() for row in x]
        with self._counting:  # starts run side by side
            found = {key: vars(self)[name][key] for key in keys if key in vars(self)[name]}
        new = np.array([key not in found for key in keys])
        if new.any():
            more = dict(zip(compress(keys, new), made(x[new]), strict=True))
            found |= more
            with self._counting:
                setattr(self, name, dict(list((vars(self)[name] | more).items())[-max(KEPT, len(x)) :]))
        return [found[key] for key in keys]

    def _strain(self, x: Matrix) -> Matrix:
        record = self.record
        with self._counting:
            self._report(record.samples * record.step, self.simulations)
            self._made[0] += len(x)
        if isinstance(record, StaticRecord):
            return self.histories(x, record.states, 0.0)[:, :, record.state]
        return self.histories(x, record.samples + SPARE, record.step)
