r"""What the twin is fitted to: histories of strain or resistance.

Symbols: ``y`` values, one row per sensor; ``n`` samples; ``h`` step [s].
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ..arrays import Matrix, Rows, Vector
from ..errors import DataError, NotFiniteError, require

LEAST_SAMPLES = 60  # per sensor: fewer cannot tell the damages
DIFFERENCES = 6  # order of the differences that show noise
DEAD = 1e-9  # spread over magnitude of a sensor that does not move
STILL, LAST_STILL = 20, 4  # equal readings in a row of a sensor that has died while others move; of the last ones
MOST_WIRINGS = 6  # pairs of swapped sensors that are looked into, and wrong ones
PASSING = 3.0  # deviations of chi2 above the expected one: of a reading that fits, at most
ALIKE = 0.02  # of a misfit: readings that fit equally well, as mirrored ones do
SAME_STEP = 1e-6  # of a step
SAME_LOAD = 0.01  # of its size: how far the loads of a healthy record may be from those of another
LEAST_REPEATED = 8  # degrees of freedom of a noise that is estimated from repeated readings


@dataclass(frozen=True, kw_only=True)
class ResponseRecord:
    """Histories of the sensors, from the moment that the load sets in.

    Attributes
    ----------
    step : float
        Time between samples [s]; the first sample lies one step after the membrane's rest.
    values : ndarray, shape (sensors, n)
        Strain [1] or resistance [ohm]; not a number in gaps and for sensors that are left out.
    kind : {"strain", "resistance"}
        What the values are.
    noise : float, ndarray of shape (sensors,), or None
        Standard deviation of the noise, in the unit of the values; None to estimate it.
    correlation : float or ndarray of shape (sensors,)
        Of the noise in neighbouring samples [1], at least 0: over g samples it is its power g. Where the noise is not given,
        it is estimated too.
    least_noise : float or ndarray of shape (sensors,)
        Standard deviation that noise is never estimated below.
    inputs : mapping of str to ndarray of shape (n,)
        Loads and motions at the samples, by the names of the model's inputs, in its units.
    start : mapping of str to float
        Inputs in whose equilibrium the record begins; the others have the start values of the model.

    Raises
    ------
    DataError
        The values have another shape, are infinite or too few, or a number makes no sense.
    """

    step: float
    values: Matrix
    kind: Literal["strain", "resistance"] = "strain"
    noise: float | Vector | None = None
    correlation: float | Vector = 0.0
    least_noise: float | Vector = 0.0
    inputs: Mapping[str, Vector] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        values = np.asarray(self.values, dtype=float)
        object.__setattr__(self, "values", values)
        if values.ndim != 2:
            msg = f"a record needs one row for each sensor, shape (sensors, n), not {values.shape}"
            raise DataError(msg)
        if self.kind not in ("strain", "resistance"):
            msg = f"a record holds 'strain' or 'resistance', not {self.kind!r}"
            raise DataError(msg)
        if not (math.isfinite(self.step) and self.step > 0.0):
            msg = f"the step of a record is a positive time [s], not {self.step!r}"
            raise DataError(msg)
        if np.isinf(values).any():
            sensor, sample = np.argwhere(np.isinf(values))[0]
            msg = f"sensor {sensor + 1} is infinite at sample {sample + 1}. Write NaN where a value is missing."
            raise NotFiniteError(msg)
        if self.samples < self.least_samples:
            msg = f"the record has {self.samples} samples; the twin needs {self.least_samples} or more. Record longer."
            raise DataError(msg)
        wanted = (self.states,)
        for name, load in self.inputs.items():
            if np.shape(load) != wanted or not np.isfinite(load).all():
                msg = f"the load {name!r} needs finite numbers of shape {wanted}, one for each sample or state"
                raise DataError(msg)
        if self.noise is not None:
            noise = np.broadcast_to(np.asarray(self.noise, dtype=float), values.shape[:1])
            if not (np.isfinite(noise).all() and (noise > 0.0).all()):
                msg = f"the noise of a record is a positive deviation, not {self.noise!r}. Leave it out to estimate it."
                raise DataError(msg)
        msg = f"the noise of a record has a correlation from 0 to below 1, not {self.correlation!r}"
        require(((self.follows >= 0.0) & (self.follows < 1.0)).all(), msg, DataError)

    @property
    def least_samples(self) -> int:
        """How many samples of each sensor are needed."""
        return LEAST_SAMPLES

    @property
    def states(self) -> int:
        """How many loads there are of each kind: one for each sample."""
        return self.samples

    @property
    def samples(self) -> int:
        """Samples of each sensor, gaps included."""
        return int(self.values.shape[1])

    @property
    def follows(self) -> Vector:
        """Correlation of the noise of each sensor in neighbouring samples [1], shape (sensors,)."""
        return self._of_each(self.correlation)

    @property
    def present(self) -> Rows:
        """Where there are values, shape (sensors, n)."""
        return np.asarray(np.isfinite(self.values))

    @property
    def sensors(self) -> list[int]:
        """Sensors with values, from 0."""
        return np.flatnonzero(self.present.any(axis=1)).tolist()

    def without(self, sensors: Sequence[int]) -> ResponseRecord:
        """Return the record without some sensors, from 0."""
        values = self.values.copy()
        values[list(sensors)] = np.nan
        return replace(self, values=values)

    def first(self, samples: int) -> ResponseRecord:
        """Return the beginning of the record."""
        inputs = {name: load[:samples] for name, load in self.inputs.items()}
        return replace(self, values=self.values[:, :samples], inputs=inputs)

    def at(self, other: ResponseRecord) -> tuple[Matrix, Vector]:
        """Return the values at the samples of another record, and how many times the noise of each sensor counts there."""
        return self.values[:, : other.samples], np.ones(len(self.values))

    def ordered(self, order: Sequence[int]) -> ResponseRecord:
        """Return the record with its rows in another order, each with its noise."""
        rows = list(order)
        return replace(
            self,
            values=self.values[rows],
            noise=self.noise if self.noise is None else self._of_each(self.noise)[rows],
            correlation=self.follows[rows],
            least_noise=self._of_each(self.least_noise)[rows],
        )

    def _of_each(self, value: float | Vector) -> Vector:
        return np.broadcast_to(np.asarray(value, dtype=float), self.values.shape[:1])

    def noise_deviation(self, predicted: Matrix | float = 0.0) -> Vector:
        r"""Return the standard deviation of the noise of each sensor, shape (sensors,), not a number for sensors left out.

        Parameters
        ----------
        predicted : ndarray, shape (sensors, n)
            What the noise is added to, as far as it is known.

        Notes
        -----
        Where it is not given, from differences of order m = 6: those of a smooth history vanish, those of white noise
        have the variance :math:`\binom{2m}{m} \sigma^2`. It is never smaller than what a history of this step leaves.
        """
        if self.noise is None:
            return self._estimated_noise(predicted)
        given = np.broadcast_to(np.asarray(self.noise, dtype=float), self.values.shape[:1]).copy()
        given[~self.present.any(axis=1)] = np.nan
        return given

    def _estimated_noise(self, predicted: Matrix | float) -> Vector:
        found, left = np.full(len(self.values), np.nan), self.values - predicted
        least = np.broadcast_to(self.least_noise, len(found))
        for k in self.sensors:
            d = np.diff(left[k], DIFFERENCES)
            d = d[np.isfinite(d)]
            if d.size < LEAST_SAMPLES // 2:
                msg = f"sensor {k + 1} has too many gaps to estimate its noise. Give the noise, or leave the sensor out."
                raise DataError(msg)
            spread = float(np.nanmax(self.values[k]) - np.nanmin(self.values[k]))
            size = math.sqrt(float(np.mean(d**2)) / math.comb(2 * DIFFERENCES, DIFFERENCES))
            found[k] = max(size, 1e-7 * spread, least[k])
        return found


@dataclass(frozen=True, kw_only=True)
class StaticRecord(ResponseRecord):
    """Readings of the sensors at rest under some load states.

    Attributes
    ----------
    state : ndarray of int, shape (n,)
        Load state of each column of ``values``, from 0; a state may have several readings.
    names : tuple of str
        Names of the k states.
    inputs : mapping of str to ndarray of shape (k,)
        Loads and motions in each state.
    """

    step: float = 1.0
    state: NDArray[np.int64]
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        if self.kind != "strain":
            msg = "a table of load states holds strain: resistance depends on the history, which it lacks."
            raise DataError(msg)
        super().__post_init__()

    @property
    def least_samples(self) -> int:
        """How many readings of each sensor are needed."""
        return 1

    @property
    def states(self) -> int:
        """How many load states there are."""
        return len(self.names)

    def first(self, samples: int) -> StaticRecord:
        """Return the first readings, with all states."""
        return replace(self, values=self.values[:, :samples], state=self.state[:samples])

    def at(self, other: ResponseRecord) -> tuple[Matrix, Vector]:
        """Return the mean reading in the state of each reading of another record with the same states."""
        assert isinstance(other, StaticRecord)
        own, many = (each.present @ np.eye(each.states)[each.state] for each in (self, other))  # readings of each state
        read = np.where(own > 0.0, own, np.nan)
        means = np.nan_to_num(self.values) @ np.eye(self.states)[self.state] / read
        factor = np.sqrt((many / np.maximum(own, 1.0)).max(axis=1))  # a mean is the same for all readings of a state
        return means[:, other.state], factor

    def _estimated_noise(self, predicted: Matrix | float) -> Vector:  # noqa: ARG002 repeated readings need none
        found = np.full(len(self.values), np.nan)
        for k in self.sensors:
            rows = [self.values[k][(self.state == each) & self.present[k]] for each in range(self.states)]
            freedom = sum(max(0, row.size - 1) for row in rows)
            if freedom < LEAST_REPEATED:
                msg = f"sensor {k + 1} has too few repeated readings to estimate its noise. State the noise."
                raise DataError(msg)
            found[k] = math.sqrt(sum(float(np.sum((row - row.mean()) ** 2)) for row in rows if row.size) / freedom)
            if found[k] == 0.0:
                msg = f"sensor {k + 1} repeats its readings exactly, so its noise is not known. State the noise."
                raise DataError(msg)
        return found


def less_healthy(record: ResponseRecord, healthy: ResponseRecord, undamaged: Matrix) -> ResponseRecord:
    """Take what a healthy record has beside an undamaged model from a record under the same loads.

    Parameters
    ----------
    record, healthy : ResponseRecord
        Of one structure before and after damage; the mean of the healthy readings counts in each load state.
    undamaged : ndarray, shape (sensors, n)
        What the model says of the healthy structure under the loads of the record.

    Returns
    -------
    ResponseRecord
        With the noise of both; no longer than the shorter one.

    Raises
    ------
    DataError
        The records have other sensors, times, states or loads.
    """
    what = _unlike_of(record, healthy)
    if what:
        msg = f"the healthy record has {what}. Record both with the same sensors, under the same loads, from the same begin."
        raise DataError(msg)
    own = record.noise_deviation()
    there, factor = healthy.at(record)
    record = record.first(there.shape[1])
    values = record.values - there + undamaged[:, : record.samples]
    if record.noise is None and not isinstance(record, StaticRecord):  # that of both is estimated from their difference
        return replace(record, values=values)
    noise = np.hypot(own, factor * healthy.noise_deviation())
    return replace(record, values=values, noise=np.where(np.isfinite(noise), noise, 1.0))  # 1: of sensors that are left out


def _unlike_of(record: ResponseRecord, healthy: ResponseRecord) -> str:
    """Say in what a healthy record is not taken as another is; nothing if it is."""
    if (type(record), record.kind, len(record.values)) != (type(healthy), healthy.kind, len(healthy.values)):
        return "other sensors, another signal, or load states in place of times"
    if isinstance(record, StaticRecord) and isinstance(healthy, StaticRecord):
        if record.names != healthy.names:
            return "other load states"
    elif abs(record.step - healthy.step) > SAME_STEP * record.step:
        return f"a step of {healthy.step:g} s, not {record.step:g} s"
    n = min(record.states, healthy.states)
    for name in sorted({*record.inputs, *healthy.inputs}):
        one, other = (np.broadcast_to(each.inputs.get(name, np.nan), (each.states,))[:n] for each in (record, healthy))
        if not np.abs(one - other).max() <= SAME_LOAD * np.abs(one).max():
            return f"another load {name!r}"
    return ""


def dead_sensors(record: ResponseRecord) -> list[int]:
    """List the sensors, from 0, that have values but do not move, or have too few of them."""
    dead = []
    for k in record.sensors:
        row = record.values[k][record.present[k]]
        still = record.states > 1 and np.ptp(row) <= DEAD * max(1e-300, float(np.abs(row).max()))
        if row.size < record.least_samples or still:
            dead.append(k)
    return dead


def still_sensors(values: Matrix) -> Rows:
    """Return where sensors repeat one reading 20 times, or the last one 4 times, while others move, shape (sensors, n)."""
    found = np.zeros(values.shape, dtype=bool)
    for k, row in enumerate(values):
        lengths = np.diff(np.flatnonzero(np.r_[True, row[1:] != row[:-1], True]))  # gaps are no readings, and differ
        found[k] = np.repeat(lengths >= np.r_[np.full(lengths.size - 1, STILL), LAST_STILL], lengths)
    return np.asarray(found & ~(found | ~np.isfinite(values)).all(axis=0))


def without_still(record: ResponseRecord) -> ResponseRecord:
    """Leave out where sensors of a record in time repeat one reading while others move."""
    if isinstance(record, StaticRecord):
        return record
    return replace(record, values=np.where(still_sensors(record.values), np.nan, record.values))


@dataclass(frozen=True)
class Wiring:
    """Another reading of a record.

    Attributes
    ----------
    order : tuple of int
        Sensors, from 0, whose histories are taken for those of the first, the second, ...
    without : tuple of int
        Sensors that are left out.
    doubt : str
        What to say.
    """

    order: tuple[int, ...]
    without: tuple[int, ...]
    doubt: str = ""

    @property
    def moved(self) -> list[int]:
        """Sensors that stand in another place."""
        return [k for k, sensor in enumerate(self.order) if k != sensor]

    def applied(self, record: ResponseRecord) -> ResponseRecord:
        """Return the record read this way."""
        return record.ordered(self.order).without(self.without)


def other_wirings(record: ResponseRecord, predicted: Matrix) -> list[Wiring]:
    """List what else a record may be: two swapped sensors, the best order of all, and one wrong sensor.

    Parameters
    ----------
    record : ResponseRecord
        Record that does not fit as it is.
    predicted : ndarray, shape (sensors, n)
        What the sensors would read by the best fit; of many pairs those that it prefers are listed.
    """
    as_given, present = tuple(range(len(record.values))), record.sensors
    unlike = np.nanvar(record.values[present][:, None] - predicted[present], axis=2)
    own = np.diag(unlike)
    gain = own[:, None] + own - unlike - unlike.T
    pairs = sorted(combinations(range(len(present)), 2), key=lambda pair: -gain[pair])[:MOST_WIRINGS]
    orders = []
    for pair in sorted(pairs):
        i, j = (present[k] for k in pair)
        order = list(as_given)
        order[i], order[j] = j, i
        orders.append(tuple(order))
    best = list(as_given)
    for row, column in zip(*linear_sum_assignment(unlike), strict=True):
        best[present[column]] = present[row]
    if len(Wiring(tuple(best), ()).moved) > 2:
        orders.append(tuple(best))
    found = [Wiring(order, ()) for order in orders]
    if len(present) > 2:
        worst = [present[k] for k in np.argsort(-own)[:MOST_WIRINGS]]
        doubt = "sensor {} contradicts the others and is left out"
        found += [Wiring(as_given, (k,), doubt.format(k + 1)) for k in sorted(worst)]
    return found


def best_wiring(wirings: Sequence[Wiring], misfits: Sequence[float], most: float = PASSING) -> Wiring | None:
    """Return the reading with the smallest misfit, or None if none is below a bound.

    Parameters
    ----------
    wirings : sequence of Wiring
        Other readings of a record.
    misfits : sequence of float
        By how many standard deviations chi2 of each is above the expected one.
    most : float
        Their bound.
    """
    if not len(misfits) or not min(misfits) < most:
        return None
    alike = [wiring for wiring, misfit in zip(wirings, misfits, strict=True) if misfit < min(misfits) + ALIKE]
    best = alike[0]
    if best.moved:
        swapped = ", or ".join(" and ".join(str(k + 1) for k in wiring.moved) for wiring in alike if wiring.moved)
        doubt = f"the record fits with sensors swapped: {swapped}. Damage may be mirrored; check the wiring"
        return replace(best, doubt=doubt)
    return best
