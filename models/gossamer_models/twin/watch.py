r"""Watch a running structure: an alarm soon after damage begins, then when it began and where.

Symbols: ``s`` sensors, ``z`` zones; ``y`` readings of a window; ``z`` also nuisances of the membrane and its loads, in
units of their priors' deviations, where the twin stands; ``x`` onset [steps] and z damages [1] that are fitted after an
alarm; ``h`` step [s].
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular
from scipy.special import chdtri
from threadpoolctl import threadpool_limits

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError, DataError, ParameterError
from ..membrane import Structure
from ..sensor import SensorArtifact
from .calibration import Calibration, spread_of
from .evidence import Evidence
from .forward import Forward, finer_of, forward_of
from .lasting_error import LastingError
from .least_squares import MOST_DAMAGE, require_finite
from .nuisances import BEYOND, FACTORS, GAIN, Loads, Nuisances, possible
from .onset import JudgedWindow, OnsetProblem, counted_from
from .record import STILL, still_sensors
from .simulation import Place, SensedForward
from .weights import RecordWeights, process_like
from .window import COARSE, DamageOnset, Window

BEGINNINGS = 2  # onsets in each window that the neighbours have
OLDEST = 16  # windows since the oldest of them
RECENT = 2  # windows all of whose onsets are kept
NEIGHBOUR, MOVED = 0.1, 1e-3  # damage of a neighbour; an unknown that lasts of one, in units of its prior's deviation
PRECISE = 1e-2  # of this deviation
SURE = 1.2816  # deviations of a score: nine of ten are above its mean less these
SETTLED = 3  # windows that the scale of the scores comes from
ROUNDS = 4
EXPLAINED = 1.5  # times the chi2 per sample of the first windows: up to there a finding explains the readings
CORRECTIONS = 2  # of a fit, by a finer mesh
TRIES = 3  # windows after an alarm in which damage is fitted until it does
OFF, REST = 0.1, 0.003  # deviations of what a group of the error of a sensor adds, and of what is left: shares of its range
ANY = 1e4  # of the noise: deviation of the offset of a sensor in a window
HALF = 0.5  # of what a finer mesh adds: mean, and deviation, of how much of it readings have
ALIKE = 0.1  # how far from its likeliest share that of the first window may be
LEFT = 0.5  # of it: what a still finer one adds to that, 0.3 to 0.55 on films and squares


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
    exact_mesh : bool
        Whether readings come from the mesh of the structure, so that no finer one is simulated beside it.
    calibration : Calibration or None
        As of ``Twin``.

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
    beside coefficients that last: a gain of each sensor, or the errors of ``LastingError``, and how much readings have of
    what finer elements would add (none of what the same mesh made, nearly all of a membrane's). What this leaves is a
    stationary process of each sensor. A constant offset of a sensor in a window does not count. After each window the twin
    moves to the nuisances that are likeliest then, as if it had begun with them. Where the model is not exact, scores are
    larger: they are divided by the largest of their means over the first three windows, or over all where the mesh is
    coarse, at least 1. The first window gives no alarm. One window after an alarm, onset and damages are fitted to the
    windows since the likeliest onset; zones are dropped as in ``Twin``. The watch then goes on from the damages found. Where
    they do not explain the readings, they are fitted again with the next window, up to three times; a sensor is left out at
    once if it alone is not explained without damage.
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
        exact_mesh: bool = False,
        calibration: Calibration | None = None,
    ) -> None:
        spread = spread_of(structure) if calibration is None else calibration.spread
        self._gains = np.array(spread.gains if spread is not None and spread.gains and sensor is None else [1.0])[:, None]
        if calibration is not None:
            structure, parameters = calibration.applied(structure, parameters)
        forward = forward_of(structure, parameters)
        self._sensed, self.zones = SensedForward(forward, sensor, sensor_parameters), forward.zones
        finer = None if exact_mesh else finer_of(forward)
        self._finer = None if finer is None else SensedForward(finer, sensor, sensor_parameters)
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
        factors = {*FACTORS, *(() if spread is None else spread.names)}
        numbers = {**forward.parameters, **forward.inputs}
        spread = None if spread is None else spread.of_structure
        kinds = tuple(kind for kind in possible(numbers, Loads(), spread) if kind in factors)
        self._nuisances = Nuisances(kinds, forward.parameters, forward.inputs, sensors, spread=spread)
        self._loads, self._z = tuple[str, ...](), np.zeros(0)
        self._evidence: Evidence | None = None
        self._place: Place | None = None  # of the twin, then its moved neighbours, then those with damage
        self._share = HALF  # of what a finer mesh adds, that readings have
        self._fine: Place | None = None  # of the twin and its moved neighbours on a finer mesh
        self._error: LastingError | None = None
        self._rounds = 0  # how often nuisances were corrected
        self._onsets = np.zeros((0, 2))  # of the neighbours with damage: window, and time [s]
        self._scores, self._usual = list[float](), 1.0  # means of the first windows, and their largest misfit
        self._before: list[JudgedWindow] = []
        self._suspected: float | None = None  # the likeliest onset of an alarm [s]
        self._tries = 0  # to explain it
        self._faulty = frozenset[int]()  # sensors that are left out for good

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
        with threadpool_limits(1):  # the same bits with any number of threads
            return self._judged(readings, loads)

    def _judged(self, readings: ArrayLike, loads: Mapping[str, Vector] | None) -> Window:
        y = np.array(readings, dtype=float)
        sensors, zones = len(self._sigma), len(self.zones)
        if y.ndim != 2 or y.shape[0] != sensors or y.shape[1] < zones + sensors:
            msg = (
                f"a window needs one row for each of {sensors} sensors and {zones + sensors} or more columns, not shape "
                f"{y.shape}"
            )
            raise DataError(msg)
        raw = np.hstack([self._last, y])
        y /= self._gains
        y[still := still_sensors(raw)[:, -y.shape[1] :]] = np.nan
        y[list(self._faulty)] = np.nan
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
        beside = {name: history[:common] for name, history in histories.items()}
        fine, fine_after = self._on_finer(self._fine, damage[:common], beside, found[:common])
        if not (np.isfinite(found).all() and np.isfinite(fine).all()):
            msg = f"the twin's membrane failed after t = {self._time:.6g} s. Check its load, damage and parameters."
            raise ConvergenceError(msg)
        self._onsets = onsets  # not before: a window that is refused leaves everything as it was

        present, slopes = np.isfinite(y), (found[1:] - found[0]) / steps[:, None, None]
        added = (fine[:1] - found[:1])[: self._finer is not None]
        slopes[: common - 1] += self._share * ((fine[1:] - fine[0]) / MOVED - slopes[: common - 1])
        lasting = np.concatenate([slopes[: common - 1], self._of_sensors(felt[0], found[0]), HALF * added])
        mesh = self._share * math.sqrt(np.var(added, axis=2).sum() / max(float(np.var(found[0], axis=1).sum()), 1e-300))
        rest = self._rest(added, n)
        weights = self._weights([present], [rest])
        rows = weights.weigh(np.concatenate([np.where(present, y - found[0], 0.0)[None], lasting, slopes[common - 1 :]]))
        if self._evidence is None:
            of_sensors = np.zeros(len(lasting) - len(self._z) - len(added))
            self._evidence = Evidence(np.r_[-self._z, of_sensors, np.ones(len(added))], zones)
        self._evidence.add(rows[0], rows[1:].T, stay)
        moves = self._evidence.lasting[: common - 1]
        share = HALF * float(np.clip(self._evidence.lasting[-1], 0.0, 2.0))
        far = np.abs(moves).max(initial=0.0) > PRECISE or (self._finer is not None and abs(share - self._share) > ALIKE)
        if self._place is None and far and self._rounds < ROUNDS:
            self._rounds, self._share = self._rounds + 1, share
            self._z = np.clip(self._z + moves, -BEYOND, BEYOND)
            self._onsets, self._evidence, self._error = self._onsets[:0], None, None
            return self._judged(readings, known)  # the first window again, with better nuisances
        scale = max(1.0, *self._scores) if self._scores else math.inf
        threshold = float(chdtri(1.0, self._false_alarms / self._evidence.scores.size))
        evidence = self._evidence.scores.max(axis=0) / scale / threshold
        needed = math.sqrt(scale) * (math.sqrt(threshold) + SURE)
        with np.errstate(divide="ignore"):
            sees = needed / np.sqrt(self._evidence.curvature.max(axis=0) if mesh <= COARSE else np.zeros(zones))
        alarm = self._suspected is None and bool((evidence > 1.0).any())
        if self._suspected is None and not alarm:  # damage would bend it
            self._found, self._precision = counted_from(-self._z, self._evidence.lasting), self._evidence.precision
            self._share = share
        fine_place = None if self._fine is None else self._fine.take(np.zeros(1, dtype=int))
        judged = JudgedWindow(self._time, place.take(np.zeros(1, dtype=int)), fine_place, y, loads, self._z, lasting, rest)
        off = weights.weigh(np.where(present, judged.about(self._z, self._found) - found[0], 0.0)[None])[0]
        counted = present.sum(axis=1) - present.any(axis=1)  # an offset of each
        squares = np.array([np.sum(off[values] ** 2) for values in weights.of_sensors])
        left = np.sqrt(squares / np.where(counted > 0, counted, np.nan))
        misfit = float(squares.sum()) / max(1, counted.sum())
        self._before = [*self._before[-OLDEST:], replace(judged, left=left)]
        self._time, self._last = self._time + n * self._h, raw[:, -STILL:]
        self._place, self._fine, self._window, finding = after, fine_after, self._window + 1, None
        innocent = self._faulty
        looking = self._suspected is not None
        if alarm or looking:
            self._suspected = float(self._onsets[self._evidence.scores.max(axis=1).argmax(), 1])
        if looking:
            finding = self._find(mesh)
        elif not alarm:
            if len(self._scores) < SETTLED or mesh > COARSE:  # the error of such a mesh is another one in each window
                self._scores = [*sorted(self._scores)[-SETTLED:], float(self._evidence.scores.mean())]
                self._usual = max(self._usual, misfit)
            self._z, self._place = self._z + moves, after.moved_along(moves / MOVED)
            self._fine = fine_after and fine_after.moved_along(moves / MOVED)
            self._evidence.recentre(moves)
        faulty = np.isin(np.arange(sensors), [*self._faulty])
        without = tuple((1 + np.flatnonzero(still.any(axis=1) | np.isnan(y).all(axis=1) | faulty)).tolist())
        return Window(
            time=self._time,
            evidence=evidence,
            sees=sees,
            alarm=alarm,
            misfit=misfit,
            mesh=mesh,
            left=left,
            finding=finding,
            blamed=tuple(sorted(1 + k for k in self._faulty - innocent)),
            without=without,
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

    def _rest(self, added: Matrix, n: int) -> Matrix:
        """Return components of what errors of sensors, and what a finer mesh adds, leave of a window, shape (k, s, n)."""
        of_sensors = [] if self._error is None else [self._error.rest(REST, n)]
        left = LEFT * min(1.0, self._share)  # nothing where the mesh of the twin made the readings
        of_meshes = [left * process_like(each) for each in added]
        return np.concatenate([np.zeros((0, len(self._sigma), n)), *of_sensors, *of_meshes])

    def _weights(self, present: Sequence[Rows], rest: Sequence[Matrix], beside: Matrix | None = None) -> RecordWeights:
        """Return what windows are weighed by: noise, in each of them any offset and what is left, and components beside."""
        whole = np.concatenate(present, axis=1)
        offset = np.broadcast_to(ANY * self._sigma[:, None], (1, *whole.shape))
        own, first = list[Matrix](), 0
        for each in rest:
            n = each.shape[2]
            rows = np.concatenate([offset[:, :, :n], each])
            own.append(np.pad(rows, ((0, 0), (0, 0), (first, whole.shape[1] - first - n))))
            first += n
        return RecordWeights(whole, self._sigma, offset[:0] if beside is None else beside, own=np.concatenate(own))

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
        places, fine = [], []
        for z in self._around():
            given = {name: float(value[0]) for name, value in self._nuisances.moved(z[None, :simulated]).items()}
            given |= {name: factor * forward.inputs[name] for name, factor in self._factors(z).items()}
            places.append(self._sensed.begin(self._damage, given, self._h))
            if self._finer is not None:
                fine.append(self._finer.begin(self._damage, given, self._h))
        self._fine = Place.joined(fine) if fine else None
        return Place.joined(places)

    def _on_finer(
        self, place: Place | None, damage: Matrix, loads: Mapping[str, Vector], found: Matrix
    ) -> tuple[Matrix, Place | None]:
        """Return readings on a finer mesh, shape (m, s, n), and where they end; without one, those that are found."""
        if self._finer is None or place is None:
            return found, None
        read, _, after = self._finer.advance(place, damage, loads, self._h)
        return read, after

    def _find(self, mesh: float) -> DamageOnset | None:
        """Fit onset and damages to the windows since the one before the likeliest onset; None if a sensor is to blame.

        From damages that explain the readings the watch goes on. Where none do, a sensor is to blame if it alone is not
        explained without damage: it is left out from then on. Else the fit is tried again with the next windows.
        """
        suspected, times = self._suspected or 0.0, [seen.time for seen in self._before]
        before = self._before[max(0, int(np.searchsorted(times, suspected, side="right")) - 2) :]
        z = before[0].z
        windows = [replace(seen, y=seen.about(z, self._found)) for seen in before]
        problem = self._onset_problem(windows)
        x = problem.search((suspected - before[0].time) / self._h, windows[-1].y.shape[1])
        x, deviation, chi2_per_sample = problem.settled(x)
        for _ in range(CORRECTIONS if self._finer is not None else 0):
            try:
                problem = self._onset_problem(self._corrected(before, problem, x))
            except ConvergenceError:  # of the finer mesh, with so much damage
                break
            x, deviation, chi2_per_sample = problem.settled(x)
        deviation *= math.sqrt(max(1.0, *self._scores))
        found = DamageOnset(
            zones=self.zones,
            onset=before[0].time + self._h * float(x[0]),
            onset_deviation=self._h * float(deviation[0]),
            damage=x[1:].copy(),
            deviation=deviation[1:],
            chi2_per_sample=chi2_per_sample,
            chi2_bound=EXPLAINED * self._usual,
            mesh=mesh,
        )
        left = np.fmax.reduce([seen.left for seen in before])
        bad = np.flatnonzero(left**2 > EXPLAINED * self._usual) if np.isfinite(left).sum() > 1 else np.zeros(0, dtype=int)
        self._tries += 1
        if not found.explains and bad.size != 1 and self._tries < TRIES:
            return found
        assert self._place is not None  # since windows were judged
        assert self._evidence is not None
        self._place = self._place.take(np.arange(1 + len(self._z)))
        if found.valid:
            self._place = self._place.moved(problem.simulate(x[None])[1]).moved_along((self._z - z) / MOVED)
            self._damage = found.damage.copy()
            fine = self._on_finer(before[0].fine, problem.damages(x[None]), problem.loads, x)[1]
            self._fine = self._fine and fine and self._fine.moved(fine).moved_along((self._z - z) / MOVED)
        self._suspected, self._tries, self._before, self._onsets, self._scores = None, 0, [], self._onsets[:0], []
        self._evidence.forget(counted_from(self._z, self._found))
        if found.explains or bad.size != 1:
            return found
        self._faulty = self._faulty | {int(bad[0])}
        return None

    def _onset_problem(self, windows: list[JudgedWindow]) -> OnsetProblem:
        """Return the least squares of some windows, beside what is not known of what lasts."""
        lasting = np.concatenate([seen.lasting for seen in windows], axis=2)
        L = np.linalg.cholesky(self._precision)
        unknown = solve_triangular(L, lasting.reshape(len(L), -1), lower=True).reshape(lasting.shape)
        weights = self._weights([np.isfinite(seen.y) for seen in windows], [seen.rest for seen in windows], unknown)
        return OnsetProblem(self._sensed, windows, weights, self._damage, self._h)

    def _corrected(self, before: list[JudgedWindow], problem: OnsetProblem, x: Vector) -> list[JudgedWindow]:
        """Return windows less what a finer mesh adds at an onset and damages, in place of what it adds without."""
        z, found, own = before[0].z, np.r_[self._found[:-1], 0.0], problem.predict(x[None])
        more = require_finite(self._on_finer(before[0].fine, problem.damages(x[None]), problem.loads, own)[0] - own)
        parts = np.split(more, np.cumsum([seen.y.shape[1] for seen in before])[:-1], axis=2)
        return [
            replace(seen, y=seen.about(z, found) - HALF * self._found[-1] * part[0], rest=self._rest(part, part.shape[2]))
            for seen, part in zip(before, parts, strict=True)
        ]
