r"""Watch a running structure: an alarm soon after damage begins, then when it began and where.

Symbols: ``y`` readings of a window, shape (4, n); ``r`` residuals in units of the noise, the mean of each sensor removed;
``J`` their derivatives by the damages; ``A`` = J^T J, ``g`` = J^T r; ``T`` score statistic; ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2 as chi2_distribution

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError, DataError, ParameterError
from ..membrane import MembraneParams
from ..membrane.mesh import N_ZONES
from ..sensor import SensorArtifact
from .descent import Minimum, descend
from .problem import DAMAGE_STEP, MOST_DAMAGE, Point, Quadratic
from .quadratic import bounded_minimum
from .record import N_SENSORS
from .running import Place, Running
from .sparse import Box, drop_zones

ONSETS = 16  # onsets tried
SHARES = (0.4, 0.7, 1.0)  # of a step of Newton's method
BEST = 3  # onsets that are refined
SHIFTS = (-14.0, -7.0, 7.0, 14.0)  # of the best onset [steps]
ROUNDS = 4


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Damage that began while watched.

    Attributes
    ----------
    onset, onset_deviation : float
        When it began, and its standard deviation [s].
    damage, deviation : ndarray, shape (16,)
        Damage of every zone since then, and its standard deviation [1].
    chi2_per_sample : float
        Near 1 if this damage explains the readings.
    """

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
    finding : Finding or None
        Onset and damages, at the end of the window after an alarm.
    """

    time: float
    statistic: float
    alarm: bool
    misfit: float
    finding: Finding | None = None


@dataclass(frozen=True)
class _Seen:
    """A window that has been judged: the place and time it began at, and its readings."""

    time: float
    place: Place
    y: Matrix


class Watch:
    r"""The twin beside a running structure, fed window by window.

    Parameters
    ----------
    noise : float or array_like, shape (4,)
        Standard deviation of the noise of each sensor, in the unit of the readings.
    elements_per_side, order : int
        Mesh, as in ``membrane_model``.
    params : MembraneParams or None
        Membrane and load; None for the default.
    damage : array_like, shape (16,)
        Damage when the load sets in [1].
    sensor : SensorArtifact or None
        Sensors, if readings are resistances.
    sensor_parameters : mapping of str to float or array_like of shape (4,)
        Parameters of the sensors that differ from their start values.
    step : float
        Time between readings [s].
    false_alarms : float
        Share of the windows that may raise a false alarm.

    Raises
    ------
    ParameterError
        A number makes no sense.

    Notes
    -----
    The twin simulates each window from the state it has reached, and 16 neighbours with a little damage in one zone each,
    all in lanes. Rao's score statistic :math:`T = g^T A^{-1} g` [1]_ has a chi2 distribution with 16 degrees of freedom
    while nothing changes; a constant offset of a sensor does not count. Where the model is not exact, T is larger: it is
    divided by the largest mean of T/16 over the windows before, at least 1, so that only a rise gives an alarm, and the
    first window never does. One window after an alarm, onset and damages are fitted to the windows before, at and after it;
    zones are dropped as in ``Twin``. The watch then goes on from the damages that it has found.

    References
    ----------
    .. [1] C. R. Rao, Mathematical Proceedings of the Cambridge Philosophical Society 44(1), 50-57, 1948,
       doi:10.1017/S0305004100023987.
    """

    def __init__(
        self,
        noise: ArrayLike,
        elements_per_side: int = 4,
        order: int = 4,
        params: MembraneParams | None = None,
        *,
        damage: ArrayLike = 0.0,
        sensor: SensorArtifact | None = None,
        sensor_parameters: Mapping[str, ArrayLike] | None = None,
        step: float = 3e-4,
        false_alarms: float = 1e-5,
    ) -> None:
        self._sigma = np.broadcast_to(np.asarray(noise, dtype=float), (N_SENSORS,)).copy()
        if not (np.isfinite(self._sigma).all() and (self._sigma > 0.0).all()):
            msg = f"the noise of the sensors is a positive standard deviation, not {noise!r}"
            raise ParameterError(msg)
        if not (0.0 < false_alarms < 1.0 and step > 0.0):
            msg = f"need 0 < false_alarms < 1 and a positive step [s], not {false_alarms:g} and {step:g}"
            raise ParameterError(msg)
        self._running = Running(elements_per_side, order, params or MembraneParams(), sensor, sensor_parameters)
        self._damage, self._h = np.broadcast_to(np.asarray(damage, dtype=float), (N_ZONES,)).copy(), step
        self._place, self._time = self._running.begin(self._damage, step), 0.0
        self._threshold = float(chi2_distribution.isf(false_alarms, N_ZONES)) / N_ZONES
        self._scale = 0.0  # nothing seen yet
        self._before: list[_Seen] = []
        self._alarmed = False

    def advance(self, readings: ArrayLike) -> Window:
        """Judge the next window of readings.

        Parameters
        ----------
        readings : array_like, shape (4, n)
            Strain [1] or resistance [ohm], a column per step; n may differ from window to window. Not a number where a
            reading is missing.

        Returns
        -------
        Window

        Raises
        ------
        DataError
            The readings have another shape, or fewer than 20 columns.
        ConvergenceError
            The simulation has failed.
        """
        y = np.asarray(readings, dtype=float)
        if y.ndim != 2 or y.shape[0] != N_SENSORS or y.shape[1] < N_ZONES + N_SENSORS:
            msg = f"a window needs one row for each of {N_SENSORS} sensors and 20 or more columns, not shape {y.shape}"
            raise DataError(msg)
        n = y.shape[1]
        damages = np.repeat(self._damage[None], 1 + N_ZONES, axis=0)
        signs = np.where(self._damage + DAMAGE_STEP > MOST_DAMAGE, -1.0, 1.0)
        damages[1:] += DAMAGE_STEP * np.diag(signs)
        found, place = self._running.advance(self._place, np.repeat(damages[:, None], n, axis=1), self._h)
        if not np.isfinite(found).all():
            msg = f"the twin's membrane failed after t = {self._time:.6g} s. Check its load, damage and parameters."
            raise ConvergenceError(msg)
        rows = weigh(np.concatenate([(y - found[0])[None], found[1:] - found[0]]), np.isfinite(y), self._sigma)
        r, J = rows[0], rows[1:].T / (DAMAGE_STEP * signs)
        g = J.T @ r
        T = float(g @ np.linalg.pinv(J.T @ J, hermitian=True) @ g) / N_ZONES
        values = int(np.isfinite(y).sum()) - N_SENSORS
        first = self._scale == 0.0
        statistic = T / max(self._scale, 1.0)
        alarm = not first and not self._alarmed and statistic > self._threshold
        kept = self._before if self._alarmed else self._before[-1:]
        self._before = [*kept, _Seen(self._time, self._place, y)]
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

    def _find(self) -> Finding:
        """Fit onset and damages to the windows since the one before the alarm, and go on from there."""
        start, y = self._before[0], np.concatenate([seen.y for seen in self._before], axis=1)
        problem = OnsetProblem(self._running, start.place, y, self._sigma, self._damage, self._h)
        whole = np.ones(1 + N_ZONES, dtype=bool)
        possible = sum(seen.y.shape[1] for seen in self._before[:-1])
        found = min((descend(problem, guess, whole) for guess in problem.first_guesses(possible)), key=_chi2)
        for _ in range(ROUNDS):  # chi2 has a valley for each period of the stiffer waves
            beside = [found.point.x + shift * np.eye(1 + N_ZONES)[0] for shift in SHIFTS]
            better = min((descend(problem, x, whole, most=4) for x in beside), key=_chi2)
            if better.point.chi2 >= found.point.chi2:
                break
            found = better
        relative = Quadratic(A=found.model.A, g=found.model.g, at=found.model.at - np.r_[0.0, self._damage])
        box = Box(
            zones=np.arange(1 + N_ZONES) > 0, low=problem.low - found.model.at, high=problem.high - found.model.at
        )
        stays, move = drop_zones(relative, box)
        found = descend(problem, np.clip(found.model.at + move, problem.low, problem.high), stays)
        deviation = np.zeros(1 + N_ZONES)
        deviation[stays] = np.sqrt(np.diag(np.linalg.pinv(found.model.A, hermitian=True)))
        self._place = self._running.advance(start.place, problem.history(found.point.x[None]), self._h)[1]
        self._damage = found.point.x[1:].copy()
        return Finding(
            onset=start.time + self._h * float(found.point.x[0]),
            onset_deviation=self._h * float(deviation[0]),
            damage=self._damage.copy(),
            deviation=deviation[1:],
            chi2_per_sample=found.point.chi2 / (problem.values - len(found.model.g)),
        )


class OnsetProblem:
    """Least squares for damages that begin within some windows, as ``descend`` takes it.

    Unknowns: the onset [steps] and the 16 damages since then [1].

    Parameters
    ----------
    running : Running
        Simulation.
    place : Place
        Where it stands before the first reading.
    y : ndarray, shape (4, n)
        Readings; not a number where one is missing.
    sigma : ndarray, shape (4,)
        Noise.
    before : ndarray, shape (16,)
        Damage until the onset [1].
    h : float
        Step [s].
    """

    def __init__(self, running: Running, place: Place, y: Matrix, sigma: Vector, before: Vector, h: float) -> None:
        self._running, self._place, self._sigma, self._before, self._h = running, place, sigma, before, h
        self._present, self._steps = np.isfinite(y), y.shape[1]
        self._y = weigh(y[None], self._present, sigma)[0]
        self.low = np.zeros(1 + N_ZONES)
        self.high = np.r_[y.shape[1] - 1.0, np.full(N_ZONES, MOST_DAMAGE)]
        self.values = int(self._present.sum()) - N_SENSORS
        self._prior = np.r_[float(self._steps) ** -2, np.ones(N_ZONES)]  # weak: any time, any damage

    def history(self, x: Matrix) -> Matrix:
        """Return damage at the end of every step, shape (m, n, 16); a step in which it begins has a part of it."""
        share = np.clip(np.arange(1, self._steps + 1) - x[:, :1], 0.0, 1.0)
        return np.asarray(self._before + share[:, :, None] * (x[:, None, 1:] - self._before))

    def points(self, x: Matrix) -> list[Point]:
        """Simulate rows of unknowns, shape (m, 17)."""
        readings = self._readings(x)
        r = self._y - weigh(readings, self._present, self._sigma)
        chi2 = np.einsum("ij,ij->i", r, r) + np.sum(self._prior * x**2, axis=1)
        return [Point(*row) for row in zip(x, readings, r, np.where(np.isfinite(chi2), chi2, np.inf), strict=True)]

    def derivatives(self, point: Point, free: Rows) -> Matrix:
        """Return the derivatives of the weighed readings by the free unknowns, shape (4 n, number of them).

        Raises
        ------
        ConvergenceError
            A simulation has failed.
        """
        places = np.flatnonzero(free)
        steps = np.where(places == 0, 1.0, DAMAGE_STEP)
        steps = np.where(point.x[places] + steps > self.high[places], -steps, steps)
        rows = np.repeat(point.x[None], places.size, axis=0)
        rows[np.arange(places.size), places] += steps
        change_of_r = self._y - weigh(self._readings(rows), self._present, self._sigma) - point.r
        if not np.isfinite(change_of_r).all():
            msg = "the twin's membrane failed near its present damages. Check its load and parameters."
            raise ConvergenceError(msg)
        return np.asarray(-change_of_r.T / steps)

    def quadratic(self, point: Point, free: Rows, J: Matrix) -> Quadratic:
        """Return the quadratic model of chi2 at a point over the free unknowns."""
        at, prior = point.x[free], self._prior[free]
        return Quadratic(A=J.T @ J + np.diag(prior), g=J.T @ point.r - prior * at, at=at)

    def first_guesses(self, steps: int) -> list[Vector]:
        """Return some onsets within the first steps, each with damages by one step of Newton's method, best first."""
        zones = np.arange(1 + N_ZONES) > 0
        onsets = np.linspace(0.0, steps, ONSETS, endpoint=False)
        guesses = np.column_stack([onsets, np.repeat(self._before[None], ONSETS, axis=0)])
        for share in (SHARES, (1.0,)):
            trials = []
            for point in self.points(guesses):
                model = self.quadratic(point, zones, self.derivatives(point, zones))
                d = bounded_minimum(model.A, model.g, -point.x[1:], self.high[1:] - point.x[1:])
                moves = [np.r_[0.0, part * d] for part in share]
                trials += [np.clip(point.x + move, self.low, self.high) for move in moves]
            points = sorted(self.points(np.array(trials)), key=lambda point: point.chi2)
            guesses = np.array([point.x for point in points[:BEST]])
        return list(guesses)

    def _readings(self, x: Matrix) -> Matrix:
        return self._running.advance(self._place, self.history(x), self._h)[0]


def _chi2(minimum: Minimum) -> float:
    return minimum.point.chi2


def weigh(rows: Matrix, present: Rows, sigma: Vector) -> Matrix:
    """Remove the mean of each sensor from rows, shape (m, 4, n), and divide by the noise, shape (m, 4 n)."""
    count = np.maximum(present.sum(axis=1), 1)
    mean = np.where(present, rows, 0.0).sum(axis=2) / count
    return np.asarray((np.where(present, rows - mean[:, :, None], 0.0) / sigma[:, None]).reshape(len(rows), -1))
