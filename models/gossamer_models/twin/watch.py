r"""Watch a running structure: an alarm soon after damage begins, then when it began and where.

Symbols: ``y`` readings of a window; ``r`` residuals in units of the noise, the mean of each sensor removed;
``J`` their derivatives by the damages; ``A`` = J^T J, ``g`` = J^T r; ``T`` score statistic; ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2 as chi2_distribution

from ..arrays import Rows, Vector
from ..errors import ConvergenceError, DataError, ParameterError
from ..membrane import MembraneParams, membrane_model, square_structure
from ..sensor import SensorArtifact
from .least_squares import DAMAGE_STEP, MOST_DAMAGE, Minimum, Quadratic, descend
from .onset import JudgedWindow, OnsetProblem, weigh
from .search import Box, drop_zones
from .simulation import WORKERS, Forward

SHIFTS = (-14.0, -7.0, 7.0, 14.0)  # of the best onset [steps]
ROUNDS = 4


@dataclass(frozen=True, kw_only=True)
class DamageOnset:
    """Damage that began while watched.

    Attributes
    ----------
    onset, onset_deviation : float
        When it began, and its standard deviation [s].
    damage, deviation : ndarray, shape (zones,)
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
    elements_per_side, order : int
        Mesh, as in ``membrane_model``.
    params : MembraneParams or None
        Membrane and load; None for the default.
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

    Raises
    ------
    ParameterError
        A number makes no sense.

    Notes
    -----
    The twin simulates each window from the state it has reached, and a neighbour with a little damage in one zone for each,
    all in lanes. Rao's score statistic :math:`T = g^T A^{-1} g` [1]_ has a chi2 distribution with 16 degrees of freedom
    while nothing changes; a constant offset of a sensor does not count. Where the model is not exact, T is larger: it is
    divided by a scale, T/16 of the first window, at least 1, that goes half way to every larger one. Only a sudden rise
    gives an alarm, and the first window never does. One window after an alarm, onset and damages are fitted to the windows
    before, at and after it; zones are dropped as in ``Twin``. The watch then goes on from the damages that it has found.

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
        model = membrane_model(square_structure(elements_per_side, order))
        self._forward = Forward(model, params or MembraneParams(), sensor, sensor_parameters)
        sensors, zones = self._forward.n_sensors, self._forward.n_zones
        self._sigma = np.broadcast_to(np.asarray(noise, dtype=float), (sensors,)).copy()
        if not (np.isfinite(self._sigma).all() and (self._sigma > 0.0).all()):
            msg = f"the noise of the sensors is a positive standard deviation, not {noise!r}"
            raise ParameterError(msg)
        if not (0.0 < false_alarms < 1.0 and step > 0.0):
            msg = f"need 0 < false_alarms < 1 and a positive step [s], not {false_alarms:g} and {step:g}"
            raise ParameterError(msg)
        self._damage, self._h = np.broadcast_to(np.asarray(damage, dtype=float), (zones,)).copy(), step
        self._place, self._time = self._forward.begin(self._damage, step), 0.0
        self._threshold = float(chi2_distribution.isf(false_alarms, zones)) / zones
        self._scale = 0.0  # nothing seen yet
        self._before: list[JudgedWindow] = []
        self._alarmed = False

    @property
    def zones(self) -> int:
        """Number of zones."""
        return self._forward.n_zones

    def advance(self, readings: ArrayLike) -> Window:
        """Judge the next window of readings.

        Parameters
        ----------
        readings : array_like, shape (sensors, n)
            Strain [1] or resistance [ohm], a column per step; n may differ from window to window. Not a number where a
            reading is missing.

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
        sensors, zones = self._forward.n_sensors, self._forward.n_zones
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
        found, place = self._forward.advance(self._place, np.repeat(damages[:, None], n, axis=1), self._h)
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
        self._before = [*kept, JudgedWindow(self._time, self._place, y, found[0])]
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
        problem = OnsetProblem(self._forward, self._before, self._sigma, self._damage, self._h)
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
