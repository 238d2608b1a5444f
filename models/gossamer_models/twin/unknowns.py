r"""Damages and nuisances as unknowns of a forward model, and the strain that it predicts of them.

Symbols: ``x`` unknowns, first the damages [1], then the nuisances in units of their priors; ``s`` sensors,
``n`` samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from .forward import LANES, WORKERS, Forward, faults_of
from .least_squares import DAMAGE_STEP, MOST_DAMAGE, neighbours, require_finite
from .nuisances import BEYOND, Nuisances
from .zone_sets import EVEN, ODDS

NUISANCE_STEP = 1e-4  # in units of the prior's deviation
NEAR, NEAR_OF_PRIOR = 0.05, 0.5  # damage, and deviations of priors, up to which what a finer mesh adds changes alike
Report: TypeAlias = Callable[[int, int], None]  # how many simulations of how many


class DamageUnknowns:
    """Damages and nuisances as unknowns of a forward model, and the strain that it predicts of them.

    Parameters
    ----------
    forward : Forward
        From damage to strain.
    nuisances : Nuisances
        Unknowns beside the damages, and the loads.
    groups : ndarray of int, shape (all zones,), or None
        Which unknown each zone's damage is, from 0; None for one each.

    Attributes
    ----------
    zones, whole : int
        Damages among the unknowns, with shares of faults at their end, and without these.
    odds : ndarray, shape (size,)
        How likely a damage or fault is beforehand [1].
    size : int
        Number of unknowns.
    """

    def __init__(self, forward: Forward, nuisances: Nuisances, groups: NDArray[np.int64] | None = None) -> None:
        self.model, self.nuisances = forward, nuisances
        self.groups = np.arange(len(forward.zones)) if groups is None else groups
        self.zones = int(self.groups.max()) + 1
        ones, faults = np.ones(len(nuisances.names)), faults_of(forward)
        self.size = self.zones + ones.size
        self.simulated = self.zones + len(nuisances.simulated)
        self.prior = np.r_[np.zeros(self.zones), ones]
        self.low = np.r_[np.zeros(self.zones), -BEYOND * ones]
        self.high = np.r_[np.full(self.zones, MOST_DAMAGE), BEYOND * ones]
        self.odds = np.full(self.size, ODDS)
        self.whole = self.zones - len(faults)
        at_faults = slice(self.whole, self.zones)
        self.prior[at_faults] = EVEN**-2  # a record at rest tells nothing of masses
        self.high[at_faults] = [fault.most for fault in faults]
        self.odds[at_faults] = [fault.probability / (1.0 - fault.probability) for fault in faults]
        self.steps = np.r_[np.full(self.zones, DAMAGE_STEP), NUISANCE_STEP * ones]

    def z(self, x: Matrix) -> Matrix:
        """Return the nuisances of rows of unknowns, in units of their priors, shape (m, number of nuisances)."""
        return x[:, self.zones :]

    def damage(self, x: Matrix) -> Matrix:
        """Return the damage of all zones [1] of rows of unknowns, shape (m, all zones)."""
        return np.asarray(x[:, : self.zones][:, self.groups])

    def histories(self, x: Matrix, samples: int, h: float) -> Matrix:
        """Simulate the strain [1] of rows of unknowns, shape (m, s, samples); in as many states of rest for a step of 0."""
        z = self.z(x)
        if not h:
            return self.model.states(self.damage(x), self.nuisances.moved(z), self.nuisances.histories(z, np.zeros(samples)))
        loads = self.nuisances.histories(z, h * np.arange(1.0, samples + 1.0))
        return self.model.strain(self.damage(x), self.nuisances.moved(z), loads, samples, h)

    def linearised(self, x: Vector, samples: int, h: float, report: Report = lambda *_: None) -> tuple[Matrix, Matrix]:
        """Return the strain [1] at unknowns, shape (s, samples), and its differences by all, shape (size, s, samples).

        Raises
        ------
        ConvergenceError
            A case fails.
        """
        rows, steps = neighbours(x, np.arange(self.size), self.steps, self.high)
        rows, found = np.vstack([x, rows]), []
        for first in range(0, len(rows), LANES * WORKERS):
            found.append(self.histories(rows[first : first + LANES * WORKERS], samples, h))
            report(min(first + LANES * WORKERS, len(rows)), len(rows))
        y = require_finite(np.concatenate(found))
        return y[0], (y[1:] - y[0]) / steps[:, None, None]

    def roughness(self, samples: int, h: float) -> float:
        """Return how far differences of the strain by three steps of damage are from a parabola [1].

        Next to nothing if the response is smooth, however much it bends; more than 1 where a slack film flaps.

        Raises
        ------
        ConvergenceError
            A case fails.
        """
        along = np.zeros(self.size)
        along[: self.zones] = np.random.default_rng(0).uniform(0.5, 1.0, self.zones)
        steps = DAMAGE_STEP * np.array([0.25, 0.5, 1.0])
        y = require_finite(self.histories(np.vstack([0.0 * along, steps[:, None] * along]), samples, h))
        short, middle, long = (y[1:] - y[0]) / steps[:, None, None]
        bent = (long - middle) / 2.0 - (middle - short)
        return float(np.linalg.norm(bent)) / max(float(np.linalg.norm(long)), 1e-300)


@dataclass(frozen=True)
class Added:
    """What a finer mesh adds to the strain, to first order in some unknowns.

    Attributes
    ----------
    strain : ndarray, shape (s, n)
        Added where it was simulated [1].
    x : ndarray, shape (size,)
        Unknowns there.
    moving : ndarray of int, shape (k,)
        Unknowns with derivatives.
    slopes : ndarray, shape (k, s, n)
        By these.
    sloped : ndarray, shape (size,)
        Unknowns where they were taken.
    zones : int
        How many of the unknowns are damages.
    """

    strain: Matrix
    x: Vector
    moving: NDArray[np.int64]
    slopes: Matrix
    sloped: Vector
    zones: int

    def serves(self, x: Vector, needed: NDArray[np.int64]) -> bool:
        """Tell whether the derivatives serve at other unknowns too: they are by all that is needed, and were taken near."""
        away, of_damage = np.abs(x - self.sloped)[self.moving], self.moving < self.zones
        near = np.all(away <= np.where(of_damage, NEAR, NEAR_OF_PRIOR))
        return bool(near and np.isin(needed, self.moving).all())

    def to(self, x: Matrix) -> Matrix:
        """Return what is added at rows of unknowns, shape (m, s, n)."""
        return self.strain + np.tensordot(x[:, self.moving] - self.x[self.moving], self.slopes, 1)

    def along(self, unknowns: NDArray[np.int64]) -> Matrix:
        """Return the derivatives by some unknowns, shape (m, s, n); 0 where there are none."""
        found = np.zeros((unknowns.size, *self.strain.shape))
        _, rows, moving = np.intersect1d(unknowns, self.moving, return_indices=True)
        found[rows] = self.slopes[moving]
        return found

    def of(self, others: Matrix) -> Added:
        """Return what is added as a function of other unknowns x', where these are ``others`` x', shape (size, others)."""
        moves = others[self.moving]
        moving = np.flatnonzero(moves.any(axis=0))
        start = self.strain - np.tensordot(self.x[self.moving], self.slopes, 1)
        nowhere = np.full(others.shape[1], np.inf)
        slopes = np.tensordot(moves[:, moving].T, self.slopes, 1)
        return Added(start, np.zeros(others.shape[1]), moving, slopes, nowhere, 0)
