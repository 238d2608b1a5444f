r"""Watch a running structure: an alarm soon after damage begins, then when it began and where.

Symbols: ``s`` sensors, ``z`` zones; ``y`` readings of a window; ``z`` also nuisances of the membrane and its loads, in
units of their priors' deviations, where the twin stands; ``x`` onset [steps] and z damages [1] that are fitted after an
alarm; ``h`` step [s].
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError, DataError, ParameterError
from ..membrane import Structure
from ..sensor import SensorArtifact
from .evidence import Evidence
from .forward import WORKERS, Forward, forward_of
from .least_squares import MOST_DAMAGE, Minimum, Quadratic, descend
from .nuisances import BEYOND, FACTORS, GAIN, Loads, Nuisances, possible
from .onset import JudgedWindow, OnsetProblem, counted_from
from .record import STILL, still_sensors
from .sensor_error import LastingError
from .simulation import Place, SensedForward
from .weights import RecordWeights
from .zone_sets import Box, drop_zones

BEGINNINGS = 2  # onsets in each window that the neighbours have
OLDEST = 16  # windows since the oldest of them
RECENT = 2  # windows all of whose onsets are kept
NEIGHBOUR, MOVED = 0.1, 1e-3  # damage of a neighbour; an unknown that lasts of one, in units of its prior's deviation
PRECISE = 1e-2  # of this deviation
SURE = 1.2816  # deviations of a score: nine of ten are above its mean less these
SETTLED = 3  # windows that the scale of the scores comes from
SHIFTS = (-14.0, -7.0, 7.0, 14.0)  # of the best onset [steps]
ROUNDS = 4
EXPLAINED = 2.0  # chi2 per sample up to which a finding explains the readings
OFF, REST = 0.1, 0.003  # deviations of what a group of the error of a sensor adds, and of what is left: shares of its range
ANY = 1e4  # of the noise: deviation of the offset of a sensor in a window


@dataclass(frozen=True, kw_only=True)
class DamageOnset:
    """Damage that began while watched.

    Attributes
    ----------
    zones : tuple of str
        Names of the zones.
    onset, onset_deviation : float
        When it began, and its standard deviation [s].
    damage, deviation : ndarray, shape (zones,)
        Damage of every zone since then, and its standard deviation [1].
    chi2_per_sample : float
        Near 1 if this damage explains the readings.
    """

    zones: tuple[str, ...]
    onset: float
    onset_deviation: float
    damage: Vector
    deviation: Vector
    chi2_per_sample: float

    @property
    def valid(self) -> bool:
        """Whether this damage explains the readings; else neither its zones nor its onset can be used."""
        return self.chi2_per_sample <= EXPLAINED


@dataclass(frozen=True, kw_only=True)
class Window:
    """What one window of readings says.

    Attributes
    ----------
    time : float
        End of the window [s].
    evidence : ndarray, shape (zones,)
        Largest score of new damage in each zone, over what raises an alarm [1].
    sees : ndarray, shape (zones,)
        Damage of each zone that would raise an alarm in nine of ten cases if it began in the last windows [1]; infinite in
        the first window, and where all of its effect could be something else.
    alarm : bool
        Whether new damage is certain.
    misfit : float
        Chi2 per sample of the readings about the twin's prediction.
    finding : DamageOnset or None
        Onset and damages, at the end of the window after an alarm.
    without : tuple of int
        Sensors, from 1, without readings, or that repeat one reading while others move: these readings are left out.
    """

    time: float
    evidence: Vector
    sees: Vector
    alarm: bool
    misfit: float
    finding: DamageOnset | None = None
    without: tuple[int, ...] = ()

    @property
    def statistic(self) -> float:
        """Largest score of new damage in one zone, over what raises an alarm [1]."""
        return float(self.evidence.max())


class Watch:
    r"""The twin beside a running structure, fed window by window.

    Parameters
    ----------
    noise : float or array_like, shape (sensors,)
        Standard deviation of the noise of each sensor, in the unit of the readings.
    structure : Structure, Forward or None
        Membrane, with the start values of its load, or another forward model; None for the square of the thesis.
    parameters : mapping of str to float
        Parameters of the membrane, and inputs in whose equilibrium it begins, that differ from their start values.
    damage : array_like, shape (zones,)
        Damage when the load sets in [1].
    sensor : SensorArtifact or None
        Sensors, if readings are resistances.
    sensor_parameters : mapping of str to float or array_like of shape (sensors,)
        Parameters of the sensors that differ from their start values.
    step : float
        Time between readings [s].
    false_alarms : float
        Share of the windows that may raise a false alarm.

    Attributes
    ----------
    zones : tuple of str
        Names of the zones.

    Raises
    ------
    ParameterError
        A number makes no sense.

    Notes
    -----
    Neighbours of the twin are simulated beside it in lanes, from window to window: one moved along each nuisance of the
    membrane and its loads, and one with damage in one zone for each of some onsets, two in each of the last two windows and
    one in every second, fourth and eighth before, up to 16 windows. ``Evidence`` sums what they explain of the readings,
    beside coefficients that last: a gain of each sensor, or the errors of ``LastingError``. A constant offset of a sensor
    in a window does not count. After each window the twin moves to the nuisances that are likeliest then, as if it had begun
    with them. Where the model is not exact, scores are larger: they are divided by their mean over the first three windows,
    at least 1. The first window gives no alarm. One window after an alarm, onset and damages are fitted to the windows since
    the likeliest onset; zones are dropped as in ``Twin``. The watch then goes on from the damages found.
    """

    def __init__(
        self,
        noise: ArrayLike,
        structure: Structure | Forward | None = None,
        *,
        parameters: Mapping[str, float] | None = None,
        damage: ArrayLike = 0.0,
        sensor: SensorArtifact | None = None,
        sensor_parameters: Mapping[str, ArrayLike] | None = None,
        step: float = 3e-4,
        false_alarms: float = 1e-5,
    ) -> None:
        forward = forward_of(structure, parameters)
        self._sensed, self.zones = SensedForward(forward, sensor, sensor_parameters), forward.zones
        sensors, zones = forward.sensors, len(forward.zones)
        self._sigma = np.broadcast_to(np.asarray(noise, dtype=float), (sensors,)).copy()
        if not (np.isfinite(self._sigma).all() and (self._sigma > 0.0).all()):
            msg = f"the noise of the sensors is a positive standard deviation, not {noise!r}"
            raise ParameterError(msg)
        if not (0.0 < false_alarms < 1.0 and step > 0.0):
            msg = f"need 0 < false_alarms < 1 and a positive step [s], not {false_alarms:g} and {step:g}"
            raise ParameterError(msg)
        self._damage, self._h = np.broadcast_to(np.asarray(damage, dtype=float), (zones,)).copy(), step
        self._time, self._window, self._false_alarms = 0.0, 0, false_alarms
        self._last = np.zeros((sensors, 0))  # readings as they came
        kinds = tuple(kind for kind in possible(forward.parameters, Loads()) if kind in FACTORS)
        self._nuisances = Nuisances(kinds, forward.parameters, forward.inputs, sensors)
        self._loads, self._z = tuple[str, ...](), np.zeros(0)
        self._evidence: Evidence | None = None
        self._place: Place | None = None  # of the twin, then its moved neighbours, then those with damage
        self._error: LastingError | None = None
        self._rounds = 0  # how often nuisances were corrected
        self._onsets = np.zeros((0, 2))  # of the neighbours with damage: window, and time [s]
        self._scores: list[float] = []  # means of the first windows
        self._before: list[JudgedWindow] = []
        self._suspected: float | None = None  # the likeliest onset of an alarm [s]

    def advance(self, readings: ArrayLike, loads: Mapping[str, Vector] | None = None) -> Window:
        """Judge the next window of readings.

        Parameters
        ----------
        readings : array_like, shape (sensors, n)
            Strain [1] or resistance [ohm], a column per step; n may differ from window to window. Not a number where a
            reading is missing. A sensor that repeats one reading while others move is left out there.
        loads : mapping of str to ndarray of shape (n,)
            Inputs of the membrane at the readings, by name; the same in every window.

        Returns
        -------
        Window

        Raises
        ------
        DataError
            The readings have another shape, or fewer columns than zones and sensors; or there are other loads than in the
            first window, or one that is no input of the membrane.
        ConvergenceError
            The simulation has failed.
        """
        y = np.array(readings, dtype=float)
        sensors, zones = len(self._sigma), len(self.zones)
        if y.ndim != 2 or y.shape[0] != sensors or y.shape[1] < zones + sensors:
            msg = (
                f"a window needs one row for each of {sensors} sensors and {zones + sensors} or more columns, not shape "
                f"{y.shape}"
            )
            raise DataError(msg)
        raw = np.hstack([self._last, y])
        y[still := still_sensors(raw)[:, -y.shape[1] :]] = np.nan
        without = tuple((1 + np.flatnonzero(still.any(axis=1) | np.isnan(y).all(axis=1))).tolist())
        known, n = loads or {}, y.shape[1]
        wanted = self._loads if self._place else tuple(name for name in known if name in self._sensed.forward.inputs)
        if set(known) != set(wanted):
            msg = (
                f"a window has the loads {', '.join(known) or 'none'}, and the watch knows {', '.join(wanted) or 'none'}. "
                "Give the same inputs of the membrane in every window."
            )
            raise DataError(msg)
        place = self._place or self._begin(known)
        loads = {name: factor * known[name] for name, factor in self._factors(self._z).items()}
        stay = np.flatnonzero(self._kept())
        begins = np.arange(BEGINNINGS) * n // BEGINNINGS  # of new neighbours [steps]
        new = np.column_stack([np.full(BEGINNINGS, self._window), self._time + self._h * begins])
        onsets = np.vstack([self._onsets[stay], new])
        common = 1 + len(self._z)
        cases = common + zones * len(onsets)
        old = np.r_[:common, (common + zones * stay[:, None] + np.arange(zones)).ravel()]
        place = place.take(np.pad(old, (0, cases - old.size)))  # new neighbours begin where the twin stands

        signs = np.where(self._damage + NEIGHBOUR > MOST_DAMAGE, -NEIGHBOUR, NEIGHBOUR)
        steps = np.r_[np.full(len(self._z), MOVED), np.tile(signs, len(onsets))]
        since = np.repeat(np.r_[np.zeros(len(stay)), begins], zones)
        damage = np.broadcast_to(self._damage, (cases, n, zones)).copy()
        which = np.tile(np.diag(signs), (len(onsets), 1))
        damage[common:] += np.where(np.arange(n) >= since[:, None], 1.0, 0.0)[:, :, None] * which[:, None]
        histories = {name: np.repeat(load[None], cases, axis=0) for name, load in loads.items()}
        for case, z in enumerate(self._around()):
            for name, factor in self._factors(z).items():
                histories[name][case] = factor * known[name]
        found, felt, after = self._sensed.advance(place, damage, histories, self._h)
        if not np.isfinite(found).all():
            msg = f"the twin's membrane failed after t = {self._time:.6g} s. Check its load, damage and parameters."
            raise ConvergenceError(msg)
        self._onsets = onsets  # not before: a window that is refused leaves everything as it was

        present, slopes = np.isfinite(y), (found[1:] - found[0]) / steps[:, None, None]
        lasting = np.concatenate([slopes[: common - 1], self._of_sensors(felt[0], found[0])])
        weigh = self._weights(present).weigh
        rows = weigh(np.concatenate([np.where(present, y - found[0], 0.0)[None], lasting, slopes[common - 1 :]]))
        self._evidence = self._evidence or Evidence(np.r_[-self._z, np.zeros(len(lasting) - len(self._z))], zones)
        self._evidence.add(rows[0], rows[1:].T, stay)
        moves = self._evidence.lasting[: common - 1]
        if self._place is None and np.abs(moves).max(initial=0.0) > PRECISE and self._rounds < ROUNDS:
            self._rounds += 1
            self._z = np.clip(self._z + moves, -BEYOND, BEYOND)
            self._onsets, self._evidence, self._error = self._onsets[:0], None, None
            return self.advance(readings, known)  # the first window again, with better nuisances
        scale = max(1.0, *self._scores) if self._scores else math.inf
        threshold = float(chdtri(1.0, self._false_alarms / self._evidence.scores.size))
        evidence = self._evidence.scores.max(axis=0) / scale / threshold
        needed = math.sqrt(scale) * (math.sqrt(threshold) + SURE)
        with np.errstate(divide="ignore"):
            sees = needed / np.sqrt(self._evidence.curvature.max(axis=0))
        alarm = self._suspected is None and bool((evidence > 1.0).any())
        if self._suspected is None and not alarm:  # damage would bend it
            self._found = counted_from(-self._z, self._evidence.lasting)
        judged = JudgedWindow(self._time, place.take(np.zeros(1, dtype=int)), y, loads, self._z, lasting)
        off = weigh(np.where(present, judged.about(self._z, self._found) - found[0], 0.0)[None])
        misfit = float(np.sum(off**2)) / max(1, present.sum() - present.any(axis=1).sum())
        self._before = [*self._before[-OLDEST:], judged]
        self._time, self._last = self._time + n * self._h, raw[:, -STILL:]
        self._place, self._window, finding = after, self._window + 1, None
        if self._suspected is not None:
            finding = self._find(self._suspected)
        elif alarm:
            self._suspected = float(self._onsets[self._evidence.likeliest(), 1])
        else:
            self._scores += [float(self._evidence.scores.mean())] * (len(self._scores) < SETTLED)
            self._z, self._place = self._z + moves, after.moved_along(moves / MOVED)
            self._evidence.recentre(moves)
        return Window(
            time=self._time, evidence=evidence, sees=sees, alarm=alarm, misfit=misfit, finding=finding, without=without
        )

    def _kept(self) -> Rows:
        """Tell which onsets are kept: all of the last windows, and the first of one in 2, 4, 8 earlier ones."""
        window = self._onsets[:, 0].astype(int)
        age, first = self._window - window, np.diff(window, prepend=-1) > 0
        longest = np.where(window > 0, 2 * (window & -window), OLDEST)  # twice the largest power of 2 that divides it
        return np.asarray((age < RECENT) | (first & (age < np.minimum(longest, OLDEST))))

    def _factors(self, z: Vector) -> dict[str, float]:
        """Return the factors of the loads that are known."""
        of_loads = z[len(self._nuisances.simulated) :].tolist()
        return {name: math.exp(FACTORS["amplitude"][1] * at) for name, at in zip(self._loads, of_loads, strict=True)}

    def _of_sensors(self, strain: Matrix, reading: Matrix) -> Matrix:
        """Return what the sensors may be off along a prediction, shape (k, s, n): a gain, or the errors of resistance."""
        if self._sensed.bank is None:
            each = GAIN * reading[None]
        else:
            self._error = self._error or LastingError(strain, reading, OFF)
            each = self._error.along(strain, reading)
        return (each[:, None] * np.eye(len(reading))[:, :, None]).reshape(-1, *reading.shape)

    def _weights(self, *present: Rows) -> RecordWeights:
        """Return what windows are weighed by: noise, and in each of them any offset and what the errors of sensors leave."""
        whole = np.concatenate(present, axis=1)
        offset = np.broadcast_to(ANY * self._sigma[:, None], (1, *whole.shape))
        own, first = list[Matrix](), 0
        for n in (each.shape[1] for each in present):
            rest = [] if self._error is None else [self._error.rest(REST, n)]
            rows = np.concatenate([offset[:, :, :n], *rest])
            own.append(np.pad(rows, ((0, 0), (0, 0), (first, whole.shape[1] - first - n))))
            first += n
        return RecordWeights(whole, self._sigma, offset[:0], own=np.concatenate(own))

    def _around(self) -> Matrix:
        """Return where the twin and its moved neighbours stand, shape (1 + q, q)."""
        return np.vstack([self._z, self._z + MOVED * np.eye(len(self._z))])

    def _begin(self, loads: Mapping[str, Vector]) -> Place:
        """Return where the twin rests, and its neighbours that are moved along each nuisance."""
        forward = self._sensed.forward
        self._loads = tuple(loads)
        simulated = len(self._nuisances.simulated)
        if not self._rounds:
            self._z = np.zeros(simulated + len(loads))
        places = []
        for z in self._around():
            given = {name: float(value[0]) for name, value in self._nuisances.moved(z[None, :simulated]).items()}
            given |= {name: factor * forward.inputs[name] for name, factor in self._factors(z).items()}
            places.append(self._sensed.begin(self._damage, given, self._h))
        return Place.joined(places)

    def _find(self, suspected: float) -> DamageOnset:
        """Fit onset and damages to the windows since the one before the likeliest onset, and go on from there."""
        length = self._h * self._before[-1].y.shape[1]
        self._before = [seen for seen in self._before if seen.time > suspected - 2.0 * length] or self._before[-1:]
        z = self._before[0].z
        windows = [replace(seen, y=seen.about(z, self._found)) for seen in self._before]
        weights = self._weights(*(np.isfinite(seen.y) for seen in windows))
        problem = OnsetProblem(self._sensed, windows, weights, self._damage, self._h)
        whole = np.ones(problem.low.size, dtype=bool)
        near = (suspected - self._before[0].time) / self._h
        n = self._before[-1].y.shape[1]
        found = _deepest(problem, problem.first_guesses(max(0.0, near - n), near + n), whole)
        for _ in range(ROUNDS):  # chi2 has a valley for each period of the stiffer waves
            beside = [found.point.x + shift * np.eye(whole.size)[0] for shift in SHIFTS]
            better = _deepest(problem, beside, whole, most=4)
            if better.point.chi2 >= found.point.chi2:
                break
            found = better
        relative = Quadratic(A=found.model.A, g=found.model.g, at=found.model.at - np.r_[0.0, self._damage])
        box = Box(zones=np.arange(whole.size) > 0, low=problem.low - found.model.at, high=problem.high - found.model.at)
        stays, move = drop_zones(relative, box)
        found = descend(problem, np.clip(found.model.at + move, problem.low, problem.high), stays)
        deviation = np.zeros(whole.size)
        deviation[stays] = np.sqrt(np.diag(np.linalg.pinv(found.model.A, hermitian=True)))
        assert self._place is not None  # since windows were judged
        lasting = self._place.take(np.arange(1 + len(self._z))).moved(problem.simulate(found.point.x[None])[1])
        self._place = lasting.moved_along((self._z - z) / MOVED)
        self._damage = found.point.x[1:].copy()
        onset = self._before[0].time + self._h * float(found.point.x[0])
        assert self._evidence is not None
        self._suspected, self._before, self._onsets, self._scores = None, [], self._onsets[:0], []
        self._evidence.forget(counted_from(self._z, self._found))
        return DamageOnset(
            zones=self.zones,
            onset=onset,
            onset_deviation=self._h * float(deviation[0]),
            damage=self._damage.copy(),
            deviation=deviation[1:],
            chi2_per_sample=found.point.chi2 / (problem.values - len(found.model.g)),
        )


def _deepest(problem: OnsetProblem, starts: list[Vector], free: Rows, most: int = 12) -> Minimum:
    """Descend from some starts, in parallel; return the minimum with the smallest chi2."""
    with ThreadPoolExecutor(WORKERS) as pool:
        return min(pool.map(lambda start: descend(problem, start, free, most), starts), key=lambda found: found.point.chi2)
