r"""Least squares for the onset of damage: some windows, simulated again from where the first of them began.

Symbols: ``s`` sensors, ``z`` zones; ``y`` readings; ``x`` onset [steps] and z damages [1]; ``h`` step [s].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Matrix, Rows, Vector
from .forward import side_by_side
from .least_squares import DAMAGE_STEP, MOST_DAMAGE, LeastSquares, Minimum, Quadratic, bounded_minimum, descend
from .simulation import Place, SensedForward
from .weights import RecordWeights
from .zone_sets import Box, drop_zones

ONSETS = 16  # onsets tried
SHARES = (0.4, 0.7, 1.0)  # of a step of Newton's method
BEST = 3  # onsets that are refined
SHIFTS = (-14.0, -7.0, 7.0, 14.0)  # of the best onset [steps]
ROUNDS = 4  # of them


@dataclass(frozen=True)
class JudgedWindow:
    """A window that has been judged.

    Attributes
    ----------
    time : float
        When it began [s].
    place : Place
        Where the simulation stood then.
    fine : Place or None
        Likewise on a finer mesh, if there is one.
    y : ndarray, shape (s, n)
        Readings; not a number where one is missing.
    loads : mapping of str to ndarray of shape (n,)
        Inputs at the readings.
    z : ndarray, shape (q,)
        Where the twin stood among the unknowns that last: the first of them, those of the membrane and its loads.
    lasting : ndarray, shape (p, s, n)
        What a unit of each of these unknowns changes of the readings.
    rest : ndarray, shape (k, s, n)
        Components of what all of these leave, each sensor's apart.
    left : ndarray, shape (s,)
        Root mean square of what is left of each sensor without damage, over its noise [1].
    """

    time: float
    place: Place
    fine: Place | None
    y: Matrix
    loads: Mapping[str, Vector]
    z: Vector
    lasting: Matrix
    rest: Matrix
    left: Vector = field(default_factory=lambda: np.zeros(0))

    def about(self, z: Vector, found: Vector) -> Matrix:
        """Return the readings, shape (s, n), if what lasts were as found, shape (p,), but for the first at z, shape (q,)."""
        return np.asarray(self.y - np.tensordot(counted_from(z, found), self.lasting, axes=1))


def counted_from(z: Vector, found: Vector) -> Vector:
    """Return unknowns that last, shape (p,), the first of them counted from z, shape (q,)."""
    return np.asarray(np.r_[found[: z.size] - z, found[z.size :]])


class OnsetProblem(LeastSquares):
    """Least squares for damages that begin within some windows.

    Unknowns: the onset [steps] and the z damages since then [1].

    Parameters
    ----------
    sensed : SensedForward
        Simulation.
    windows : sequence of JudgedWindow
        Windows one after the other.
    weights : RecordWeights
        What they are weighed by.
    before : ndarray, shape (z,)
        Damage until the onset [1].
    h : float
        Step [s].
    """

    def __init__(
        self, sensed: SensedForward, windows: Sequence[JudgedWindow], weights: RecordWeights, before: Vector, h: float
    ) -> None:
        self._sensed, self._windows, self._weights, self._before, self._h = sensed, windows, weights, before, h
        y = np.concatenate([seen.y for seen in windows], axis=1)
        self._length = y.shape[1]
        self.y = weights.weigh(np.nan_to_num(y)[None])[0]
        self.low, self.simulated = np.zeros(1 + before.size), 1 + before.size
        self.high = np.r_[y.shape[1] - 1.0, np.full(before.size, MOST_DAMAGE)]
        offsets = sum(int(np.isfinite(seen.y).any(axis=1).sum()) for seen in windows)  # of each sensor in each window
        self.values = weights.values - offsets
        self.prior = np.r_[float(self._length) ** -2, np.ones(before.size)]  # weak: any time, any damage
        self.steps = np.r_[1.0, np.full(before.size, DAMAGE_STEP)]
        self.loads = {name: np.concatenate([seen.loads[name] for seen in windows]) for name in windows[0].loads}

    def damages(self, x: Matrix) -> Matrix:
        """Return the histories of damage of rows of unknowns, shape (m, n, z) [1]."""
        share = np.clip(np.arange(1, self._length + 1) - x[:, :1], 0.0, 1.0)  # a step in which damage begins has a part
        return np.asarray(self._before + share[:, :, None] * (x[:, None, 1:] - self._before))

    def simulate(self, x: Matrix) -> tuple[Matrix, Place]:
        """Return readings for rows of unknowns, shape (m, s, n), and the places where they end."""
        begin = self._windows[0].place.take(np.zeros(len(x), dtype=int))
        readings, _, place = self._sensed.advance(begin, self.damages(x), self.loads, self._h)
        return readings, place

    def predict(self, x: Matrix) -> Matrix:
        """Simulate rows of unknowns, shape (m, 1 + z)."""
        return self.simulate(x)[0]

    def weigh(self, predicted: Matrix, x: Matrix) -> Matrix:  # noqa: ARG002
        """Weigh readings, shape (m, values)."""
        return self._weights.weigh(predicted)

    def first_guesses(self, earliest: float, latest: float) -> list[Vector]:
        """Return some onsets between two [steps], each with damages by one step of Newton's method, best first."""
        zones = np.arange(self.low.size) > 0
        onsets = np.linspace(earliest, latest, ONSETS, endpoint=False)
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

    def search(self, near: float, reach: int) -> Vector:
        """Return the likeliest onset and damages, shape (1 + z,), not farther from an onset [steps] than so many steps."""
        whole = np.ones(self.low.size, dtype=bool)
        found = self._deepest(self.first_guesses(max(0.0, near - reach), near + reach), whole)
        for _ in range(ROUNDS):  # chi2 has a valley for each period of the stiffer waves
            beside = [found.point.x + shift * np.eye(whole.size)[0] for shift in SHIFTS]
            better = self._deepest(beside, whole, most=4)
            if better.point.chi2 >= found.point.chi2:
                break
            found = better
        return found.point.x

    def settled(self, x: Vector) -> tuple[Vector, Vector, float]:
        """Return the likeliest onset and damages near some, their standard deviations, and chi2 per sample.

        Zones that explain little are dropped; the deviation of one is then what it would be beside those that are kept.
        """
        whole = np.ones(self.low.size, dtype=bool)
        found = descend(self, x, whole)
        relative = Quadratic(A=found.model.A, g=found.model.g, at=found.model.at - np.r_[0.0, self._before])
        box = Box(zones=np.arange(whole.size) > 0, low=self.low - found.model.at, high=self.high - found.model.at)
        stays, move = drop_zones(relative, box)
        found = descend(self, np.clip(found.model.at + move, self.low, self.high), stays)
        A = self.about(found.point, whole, self.derivatives(found.point, whole)).A
        kept = np.linalg.pinv(A[np.ix_(stays, stays)], hermitian=True)
        variance = np.empty(whole.size)
        variance[stays] = np.diag(kept)
        beside = A[np.ix_(~stays, stays)]
        variance[~stays] = 1.0 / (np.diag(A)[~stays] - np.einsum("ij,jk,ik->i", beside, kept, beside))
        return found.point.x, np.sqrt(variance), found.point.chi2 / (self.values - np.count_nonzero(stays))

    def _deepest(self, starts: list[Vector], free: Rows, most: int = 12) -> Minimum:
        """Descend from some starts, in parallel; return the minimum with the smallest chi2."""
        found = side_by_side(lambda start: descend(self, start, free, most), starts)
        return min(found, key=lambda each: each.point.chi2)
