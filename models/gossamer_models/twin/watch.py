r"""Watch a running structure: an alarm soon after damage begins, then when it began and where.

Symbols: ``s`` sensors, ``z`` zones; ``y`` readings of a window; ``r`` residuals in units of the noise, the mean of each
sensor removed; ``J`` their derivatives by the damages; ``A`` = J^T J, ``g`` = J^T r; ``T`` score statistic; ``x`` onset
[steps] and z damages [1] that are fitted after an alarm; ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2 as chi2_distribution

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError, DataError, ParameterError
from ..membrane import Structure
from ..sensor import SensorArtifact
from .forward import WORKERS, Forward, forward_of
from .least_squares import DAMAGE_STEP, MOST_DAMAGE, LeastSquares, Minimum, Quadratic, bounded_minimum, descend
from .search import Box, drop_zones
from .simulation import Place, SensedForward

ONSETS = 16  # onsets tried
SHARES = (0.4, 0.7, 1.0)  # of a step of Newton's method
BEST = 3  # onsets that are refined
SHIFTS = (-14.0, -7.0, 7.0, 14.0)  # of the best onset [steps]
ROUNDS = 4


@dataclass(frozen=True)
class JudgedWindow:
    """A window that has been judged.

    Attributes
    ----------
    time : float
        When it began [s].
    place : Place
        Where the simulation stood then.
    y : ndarray, shape (s, n)
        Readings; not a number where one is missing.
    expected : ndarray, shape (s, n)
        Readings of the twin without new damage.
    loads : mapping of str to ndarray of shape (n,)
        Inputs at the readings.
    """

    time: float
    place: Place
    y: Matrix
    expected: Matrix
    loads: Mapping[str, Vector] = field(default_factory=dict)


class OnsetProblem(LeastSquares):
    """Least squares for damages that begin within some windows.

    Unknowns: the onset [steps] and the z damages since then [1].

    Parameters
    ----------
    sensed : SensedForward
        Simulation.
    windows : sequence of JudgedWindow
        Windows one after the other.
    sigma : ndarray, shape (s,)
        Noise.
    before : ndarray, shape (z,)
        Damage until the onset [1].
    h : float
        Step [s].
    """

    def __init__(
        self, sensed: SensedForward, windows: Sequence[JudgedWindow], sigma: Vector, before: Vector, h: float
    ) -> None:
        self._sensed, self._windows, self._sigma, self._before, self._h = sensed, windows, sigma, before, h
        y = np.concatenate([seen.y for seen in windows], axis=1)
        self._starts = np.cumsum([0, *(seen.y.shape[1] for seen in windows[:-1])])
        self._present, self._length = np.isfinite(y), y.shape[1]
        self.y = weigh(y[None], self._present, sigma)[0]
        self.low, self.simulated = np.zeros(1 + before.size), 1 + before.size
        self.high = np.r_[y.shape[1] - 1.0, np.full(before.size, MOST_DAMAGE)]
        self.values = int(self._present.sum()) - len(y)
        self.prior = np.r_[float(self._length) ** -2, np.ones(before.size)]  # weak: any time, any damage
        self.steps = np.r_[1.0, np.full(before.size, DAMAGE_STEP)]

    def simulate(self, x: Matrix) -> tuple[Matrix, Place]:
        """Return readings for rows of unknowns, shape (m, s, n), and the place where the first row ends.

        Windows that end before any onset are not simulated again.
        """
        first = int(np.searchsorted(self._starts, x[:, 0].min(), side="right")) - 1
        steps = np.arange(self._starts[first] + 1, self._length + 1)
        share = np.clip(steps - x[:, :1], 0.0, 1.0)  # a step in which damage begins has a part of it
        damage = self._before + share[:, :, None] * (x[:, None, 1:] - self._before)
        later = [seen.loads for seen in self._windows[first:]]
        loads = {name: np.concatenate([each[name] for each in later]) for name in later[0]}
        readings, place = self._sensed.advance(self._windows[first].place, damage, loads, self._h)
        expected = [np.repeat(seen.expected[None], len(x), axis=0) for seen in self._windows[:first]]
        return np.concatenate([*expected, readings], axis=2), place

    def predict(self, x: Matrix) -> Matrix:
        """Simulate rows of unknowns, shape (m, 1 + z)."""
        return self.simulate(x)[0]

    def weigh(self, predicted: Matrix, x: Matrix) -> Matrix:  # noqa: ARG002
        """Weigh readings, shape (m, s n)."""
        return weigh(predicted, self._present, self._sigma)

    def first_guesses(self, steps: int) -> list[Vector]:
        """Return some onsets within the first steps, each with damages by one step of Newton's method, best first."""
        zones = np.arange(self.low.size) > 0
        onsets = np.linspace(0.0, steps, ONSETS, endpoint=False)
        guesses = np.column_stack([onsets, np.repeat(self._before[None], ONSETS, axis=0)])
        for share in (SHARES, (1.0,)):
            trials = []
            for point in self.points(guesses):
                model = self.about(point, zones, self.derivatives(point, zones))
                d = bounded_minimum(model.A, model.g, -point.x[1:], self.high[1:] - point.x[1:])
                moves = [np.r_[0.0, part * d] for part in share]
                trials += [np.clip(point.x + move, self.low, self.high) for move in moves]
            points = sorted(self.points(np.array(trials)), key=lambda point: point.chi2)
            guesses = np.array([point.x for point in points[:BEST]])
        return list(guesses)


def weigh(rows: Matrix, present: Rows, sigma: Vector) -> Matrix:
    """Remove the mean of each sensor from rows, shape (m, s, n), and divide by the noise, shape (m, s n)."""
    count = np.maximum(present.sum(axis=1), 1)
    mean = np.where(present, rows, 0.0).sum(axis=2) / count
    return np.asarray((np.where(present, rows - mean[:, :, None], 0.0) / sigma[:, None]).reshape(len(rows), -1))


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
    The twin simulates each window from the state it has reached, and a neighbour with a little damage in one zone for each,
    all in lanes. Rao's score statistic :math:`T = g^T A^{-1} g` [1]_ has a chi2 distribution with a degree of freedom
    for each zone while nothing changes; a constant offset of a sensor does not count. Where the model is not exact, T is
    larger: it is divided by a scale, T/z of the first window, at least 1, that goes half way to every larger one. Only a
    sudden rise gives an alarm, and the first window never does. One window after an alarm, onset and damages are fitted to
    the windows before, at and after it; zones are dropped as in ``Twin``. The watch then goes on from the damages found.

    References
    ----------
    .. [1] C. R. Rao, Mathematical Proceedings of the Cambridge Philosophical Society 44(1), 50-57, 1948,
       doi:10.1017/S0305004100023987.
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
        self._place, self._time = self._sensed.begin(self._damage, {}, step), 0.0
        self._threshold = float(chi2_distribution.isf(false_alarms, zones)) / zones
        self._scale = 0.0  # nothing seen yet
        self._before: list[JudgedWindow] = []
        self._alarmed = False

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
        n = y.shape[1]
        damages = np.repeat(self._damage[None], 1 + zones, axis=0)
        signs = np.where(self._damage + DAMAGE_STEP > MOST_DAMAGE, -1.0, 1.0)
        damages[1:] += DAMAGE_STEP * np.diag(signs)
        loads = loads or {}
        found, place = self._sensed.advance(self._place, np.repeat(damages[:, None], n, axis=1), loads, self._h)
        if not np.isfinite(found).all():
            msg = f"the twin's membrane failed after t = {self._time:.6g} s. Check its load, damage and parameters."
            raise ConvergenceError(msg)
        rows = weigh(np.concatenate([(y - found[0])[None], found[1:] - found[0]]), np.isfinite(y), self._sigma)
        r, J = rows[0], rows[1:].T / (DAMAGE_STEP * signs)
        g = J.T @ r
        T = float(g @ np.linalg.pinv(J.T @ J, hermitian=True) @ g) / zones
        values = int(np.isfinite(y).sum()) - sensors
        first = self._scale == 0.0
        statistic = T / max(self._scale, 1.0)
        alarm = not first and not self._alarmed and statistic > self._threshold
        kept = self._before if self._alarmed else self._before[-1:]
        self._before = [*kept, JudgedWindow(self._time, self._place, y, found[0], loads)]
        self._time += n * self._h
        finding = None
        if self._alarmed:
            finding = self._find()
            self._alarmed, self._before = False, []
        else:
            self._place, self._alarmed = place, alarm
            if not alarm:
                self._scale = max(self._scale, T, 1.0) if first else max(self._scale, (self._scale + T) / 2.0)
        misfit = float(r @ r) / values
        return Window(time=self._time, statistic=statistic, alarm=alarm, misfit=misfit, finding=finding)

    def _find(self) -> DamageOnset:
        """Fit onset and damages to the windows since the one before the alarm, and go on from there."""
        problem = OnsetProblem(self._sensed, self._before, self._sigma, self._damage, self._h)
        whole = np.ones(problem.low.size, dtype=bool)
        possible = sum(seen.y.shape[1] for seen in self._before[:-1])
        found = _deepest(problem, problem.first_guesses(possible), whole)
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
        self._place = problem.simulate(found.point.x[None])[1]
        self._damage = found.point.x[1:].copy()
        return DamageOnset(
            zones=self.zones,
            onset=self._before[0].time + self._h * float(found.point.x[0]),
            onset_deviation=self._h * float(deviation[0]),
            damage=self._damage.copy(),
            deviation=deviation[1:],
            chi2_per_sample=found.point.chi2 / (problem.values - len(found.model.g)),
        )


def _deepest(problem: OnsetProblem, starts: list[Vector], free: Rows, most: int = 12) -> Minimum:
    """Descend from some starts, in parallel; return the minimum with the smallest chi2."""
    with ThreadPoolExecutor(WORKERS) as pool:
        return min(
            pool.map(lambda start: descend(problem, start, free, most), starts), key=lambda found: found.point.chi2
        )
