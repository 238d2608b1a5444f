r"""Watch a running structure: an alarm soon after damage begins, then when it began and where.

Symbols: ``s`` sensors, ``z`` zones; ``y`` readings of a window; ``r`` residuals in units of the noise, the mean of each
sensor removed; ``x`` onset [steps] and z damages [1] that are fitted after an alarm; ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from ..arrays import Rows, Vector
from ..errors import ConvergenceError, DataError, ParameterError
from ..membrane import Structure
from ..sensor import SensorArtifact
from .evidence import Evidence
from .forward import WORKERS, Forward, forward_of
from .least_squares import MOST_DAMAGE, Minimum, Quadratic, descend
from .onset import JudgedWindow, OnsetProblem, weigh
from .simulation import Place, SensedForward
from .zone_sets import Box, drop_zones

MEMORY = 3  # windows that are judged together
BEGINNINGS = 2  # onsets in each window that the neighbours have
NEIGHBOUR = 0.1  # damage of a neighbour
LOAD, LOAD_DEVIATION, LOAD_STEP = "pressure_amplitude", 0.1, 0.01  # the load that is built in; a factor, and its step
PRECISE = 1e-3  # of a factor
SHIFTS = (-14.0, -7.0, 7.0, 14.0)  # of the best onset [steps]
ROUNDS = 4
EXPLAINED = 2.0  # chi2 per sample up to which a finding explains the readings


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
    statistic : float
        Score statistic over its mean without new damage: 1 on average, large if damage has begun.
    alarm : bool
        Whether new damage is certain.
    misfit : float
        Chi2 per sample of the readings about the twin's prediction.
    finding : DamageOnset or None
        Onset and damages, at the end of the window after an alarm.
    """

    time: float
    statistic: float
    alarm: bool
    misfit: float
    finding: DamageOnset | None = None


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
    Neighbours of the twin are simulated beside it in lanes, from window to window: one with a little more of each load, and
    one with damage in one zone for each of six onsets, two in each of the last three windows. A stiff film rings for many
    periods after damage, and what it adds to a later window depends on when it began. ``Evidence`` sums what they explain of
    the readings over these windows; a constant offset of a sensor does not count. Where the model is not exact, the score is
    larger: it is divided by its mean over earlier windows, less the last three, at least 1, so that damage is seen before it
    counts as usual. The first window never gives an alarm; it corrects the loads until their factors are within 0.1 %. One
    window after an alarm, onset and damages are fitted to the windows since three before it; zones are dropped as in
    ``Twin``. The watch then goes on from the damages found.
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
        self._time, self._false_alarms = 0.0, false_alarms
        self._place: Place | None = None  # of the twin, then its neighbours with other loads, then those with damage
        self._factors: dict[str, float] = {}  # of the loads
        self._rounds = 0  # how often they were corrected
        self._onsets: list[float] = []  # of the neighbours with damage [s]
        self._scores: list[float] = []  # of earlier windows
        self._before: list[JudgedWindow] = []
        self._suspected: float | None = None  # the likeliest onset of an alarm [s]

    def advance(self, readings: ArrayLike, loads: Mapping[str, Vector] | None = None) -> Window:
        """Judge the next window of readings.

        Parameters
        ----------
        readings : array_like, shape (sensors, n)
            Strain [1] or resistance [ohm], a column per step; n may differ from window to window. Not a number where a
            reading is missing.
        loads : mapping of str to ndarray of shape (n,)
            Inputs of the membrane at the readings, by name; the same in every window.

        Returns
        -------
        Window

        Raises
        ------
        DataError
            The readings have another shape, or fewer columns than zones and sensors.
        ConvergenceError
            The simulation has failed.
        """
        y = np.asarray(readings, dtype=float)
        sensors, zones = len(self._sigma), len(self.zones)
        if y.ndim != 2 or y.shape[0] != sensors or y.shape[1] < zones + sensors:
            msg = (
                f"a window needs one row for each of {sensors} sensors and {zones + sensors} or more columns, not shape "
                f"{y.shape}"
            )
            raise DataError(msg)
        known, n = loads or {}, y.shape[1]
        place = self._place or self._begin(known)
        loads = {name: self._factors[name] * load for name, load in known.items()}
        kept = self._onsets[-(MEMORY - 1) * BEGINNINGS :]
        begins = np.arange(BEGINNINGS) * n // BEGINNINGS  # of new neighbours [steps]
        self._onsets = [*kept, *(self._time + self._h * begins)]
        common, cases = 1 + len(self._loads), 1 + len(self._loads) + zones * len(self._onsets)
        count = len(place.membrane.x)
        stay = np.r_[:common, count - zones * len(kept) : count]
        place = place.take(np.pad(stay, (0, cases - stay.size)))  # new neighbours begin where the twin stands

        signs = np.where(self._damage + NEIGHBOUR > MOST_DAMAGE, -NEIGHBOUR, NEIGHBOUR)
        steps = np.r_[np.full(len(self._loads), LOAD_STEP), np.tile(signs, len(self._onsets))]
        since = np.repeat(np.r_[np.zeros(len(kept)), begins], zones)
        damage = np.broadcast_to(self._damage, (cases, n, zones)).copy()
        which = np.tile(np.diag(signs), (len(self._onsets), 1))
        damage[common:] += np.where(np.arange(n) >= since[:, None], 1.0, 0.0)[:, :, None] * which[:, None]
        histories = {name: np.repeat(load[None], cases, axis=0) for name, load in loads.items()}
        for case, name in enumerate(self._loads, start=1):
            if name in histories:
                histories[name][case] *= 1.0 + LOAD_STEP
        found, after = self._sensed.advance(place, damage, histories, self._h)
        if not np.isfinite(found).all():
            msg = f"the twin's membrane failed after t = {self._time:.6g} s. Check its load, damage and parameters."
            raise ConvergenceError(msg)

        present, slopes = np.isfinite(y), (found[1:] - found[0]) / steps[:, None, None]
        rows = weigh(np.concatenate([(y - found[0])[None], slopes]), present, self._sigma)
        self._evidence.add(rows[0], rows[1:].T, len(kept))
        factors, freedom = self._evidence.factors, self._evidence.freedom
        if self._place is None and np.abs(factors).max(initial=0.0) > PRECISE and self._rounds < ROUNDS:
            self._rounds += 1
            for name, move in zip(self._loads, factors, strict=True):
                self._factors[name] *= 1.0 + float(np.clip(move, -LOAD_DEVIATION, LOAD_DEVIATION))
            self._onsets = []
            return self.advance(readings, known)  # the first window again, with better loads
        threshold = float(chdtri(freedom, self._false_alarms)) / freedom
        before = self._scores[: max(1, len(self._scores) - MEMORY)]
        statistic = self._evidence.score / max(1.0, float(np.mean(before))) if before else 0.0
        alarm = self._suspected is None and statistic > threshold
        if not alarm and self._suspected is None:
            self._trusted = factors  # damage would bend them
        y = y - np.tensordot(self._trusted, slopes[: factors.size], axes=1)  # as if the loads were the twin's
        misfit = float(np.sum(weigh((y - found[0])[None], present, self._sigma) ** 2)) / (present.sum() - sensors)
        windows = self._before[-MEMORY:] if self._suspected is None else self._before
        self._before = [*windows, JudgedWindow(self._time, place.take(np.zeros(1, dtype=int)), y, found[0], loads)]
        self._time += n * self._h
        self._place, finding = after, None
        if self._suspected is not None:
            finding = self._find(self._suspected)
        elif alarm:
            self._suspected = self._onsets[self._evidence.likeliest()]
        else:
            self._scores.append(self._evidence.score)
        return Window(time=self._time, statistic=statistic, alarm=alarm, misfit=misfit, finding=finding)

    def _begin(self, loads: Mapping[str, Vector]) -> Place:
        """Return where the twin rests, and its neighbours with a little more of each load."""
        forward = self._sensed.forward
        known = {**forward.parameters, **forward.inputs}
        self._loads = [*([LOAD] if known.get(LOAD) else []), *loads]
        self._factors = self._factors or dict.fromkeys(self._loads, 1.0)
        self._evidence = Evidence(len(self._loads), len(self.zones), LOAD_DEVIATION)
        begin = {name: factor * known[name] for name, factor in self._factors.items()}
        more = [begin, *({**begin, name: (1.0 + LOAD_STEP) * begin[name]} for name in self._loads)]
        return Place.joined([self._sensed.begin(self._damage, each, self._h) for each in more])

    def _find(self, suspected: float) -> DamageOnset:
        """Fit onset and damages to the windows since the one before the alarm, and go on from there."""
        problem = OnsetProblem(self._sensed, self._before, self._sigma, self._damage, self._h)
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
        self._place = self._place.take(np.arange(1 + len(self._loads))).moved(problem.simulate(found.point.x[None])[1])
        self._damage = found.point.x[1:].copy()
        onset = self._before[0].time + self._h * float(found.point.x[0])
        self._suspected, self._before, self._onsets = None, [], []
        self._evidence.forget(self._trusted)
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
