"""When damage began and where, from the windows about an alarm: a least-squares problem of its own.

Symbols: ``x`` unknowns, the onset [steps] and 16 damages [1]; ``y`` readings; ``r`` residuals in units of the noise, the
mean of each sensor removed; ``J`` derivatives; ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..membrane.mesh import N_ZONES
from .least_squares import (
    DAMAGE_STEP,
    MOST_DAMAGE,
    Point,
    bounded_minimum,
    check_derivatives,
    neighbours,
    points_at,
    quadratic_about,
)
from .record import N_SENSORS
from .simulation import Place, Running

ONSETS = 16  # onsets tried
SHARES = (0.4, 0.7, 1.0)  # of a step of Newton's method
BEST = 3  # onsets that are refined


@dataclass(frozen=True)
class JudgedWindow:
    """A window that has been judged.

    Attributes
    ----------
    time : float
        When it began [s].
    place : Place
        Where the simulation stood then.
    y : ndarray, shape (4, n)
        Readings; not a number where one is missing.
    expected : ndarray, shape (4, n)
        Readings of the twin without new damage.
    """

    time: float
    place: Place
    y: Matrix
    expected: Matrix


class OnsetProblem:
    """Least squares for damages that begin within some windows, as ``descend`` takes it.

    Unknowns: the onset [steps] and the 16 damages since then [1].

    Parameters
    ----------
    running : Running
        Simulation.
    windows : sequence of JudgedWindow
        Windows one after the other.
    sigma : ndarray, shape (4,)
        Noise.
    before : ndarray, shape (16,)
        Damage until the onset [1].
    h : float
        Step [s].
    """

    def __init__(
        self, running: Running, windows: Sequence[JudgedWindow], sigma: Vector, before: Vector, h: float
    ) -> None:
        self._running, self._windows, self._sigma, self._before, self._h = running, windows, sigma, before, h
        y = np.concatenate([seen.y for seen in windows], axis=1)
        self._starts = np.cumsum([0, *(seen.y.shape[1] for seen in windows[:-1])])
        self._present, self._steps = np.isfinite(y), y.shape[1]
        self._y = weigh(y[None], self._present, sigma)[0]
        self.low = np.zeros(1 + N_ZONES)
        self.high = np.r_[y.shape[1] - 1.0, np.full(N_ZONES, MOST_DAMAGE)]
        self.values = int(self._present.sum()) - N_SENSORS
        self.prior = np.r_[float(self._steps) ** -2, np.ones(N_ZONES)]  # weak: any time, any damage

    def simulate(self, x: Matrix) -> tuple[Matrix, Place]:
        """Return readings for rows of unknowns, shape (m, 4, n), and the place where the first row ends.

        Windows that end before any onset are not simulated again.
        """
        first = int(np.searchsorted(self._starts, x[:, 0].min(), side="right")) - 1
        steps = np.arange(self._starts[first] + 1, self._steps + 1)
        share = np.clip(steps - x[:, :1], 0.0, 1.0)  # a step in which damage begins has a part of it
        damage = self._before + share[:, :, None] * (x[:, None, 1:] - self._before)
        readings, place = self._running.advance(self._windows[first].place, damage, self._h)
        expected = [np.repeat(seen.expected[None], len(x), axis=0) for seen in self._windows[:first]]
        return np.concatenate([*expected, readings], axis=2), place

    def points(self, x: Matrix) -> list[Point]:
        """Simulate rows of unknowns, shape (m, 17)."""
        readings = self.simulate(x)[0]
        r = self._y - weigh(readings, self._present, self._sigma)
        return points_at(x, readings, r, self.prior)

    def derivatives(self, point: Point, free: Rows) -> Matrix:
        """Return the derivatives of the weighed readings by the free unknowns, shape (4 n, number of them).

        Raises
        ------
        ConvergenceError
            A simulation has failed.
        """
        places = np.flatnonzero(free)
        rows, steps = neighbours(point.x, places, np.where(places == 0, 1.0, DAMAGE_STEP), self.high)
        weighed = weigh(self.simulate(rows)[0], self._present, self._sigma)
        return check_derivatives((weighed - (self._y - point.r)).T / steps)

    def first_guesses(self, steps: int) -> list[Vector]:
        """Return some onsets within the first steps, each with damages by one step of Newton's method, best first."""
        zones = np.arange(1 + N_ZONES) > 0
        onsets = np.linspace(0.0, steps, ONSETS, endpoint=False)
        guesses = np.column_stack([onsets, np.repeat(self._before[None], ONSETS, axis=0)])
        for share in (SHARES, (1.0,)):
            trials = []
            for point in self.points(guesses):
                model = quadratic_about(point, zones, self.derivatives(point, zones), self.prior)
                d = bounded_minimum(model.A, model.g, -point.x[1:], self.high[1:] - point.x[1:])
                moves = [np.r_[0.0, part * d] for part in share]
                trials += [np.clip(point.x + move, self.low, self.high) for move in moves]
            points = sorted(self.points(np.array(trials)), key=lambda point: point.chi2)
            guesses = np.array([point.x for point in points[:BEST]])
        return list(guesses)


def weigh(rows: Matrix, present: Rows, sigma: Vector) -> Matrix:
    """Remove the mean of each sensor from rows, shape (m, 4, n), and divide by the noise, shape (m, 4 n)."""
    count = np.maximum(present.sum(axis=1), 1)
    mean = np.where(present, rows, 0.0).sum(axis=2) / count
    return np.asarray((np.where(present, rows - mean[:, :, None], 0.0) / sigma[:, None]).reshape(len(rows), -1))
