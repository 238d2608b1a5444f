r"""The least-squares problem of one record: what is unknown, what is predicted, how it is weighed.

Symbols: ``x`` unknowns, first the damages [1], then the nuisances in units of their priors; ``s`` sensors,
``n`` samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from threading import Lock
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Rows, Vector
from .discrepancy import Discrepancy, spline_matrix
from .forward import LANES, WORKERS, Forward
from .least_squares import DAMAGE_STEP, MOST_DAMAGE, LeastSquares, Point, neighbours, require_finite
from .nuisances import BEYOND, Nuisances
from .record import ResponseRecord, StaticRecord
from .simulation import SensedForward

NEGLIGIBLE = 1e-9  # of the largest eigenvalue: directions that gaps leave without values; of the noise's variance
ROUNDED = 1e-14  # of the largest eigenvalue: what round-off leaves of it
NEAR = 0.03  # of damage, by which columns hardly change
BENT = 0.5  # of a column, at most, by which it changes where its nuisance moves by the prior's deviation
NUISANCE_STEP = 1e-4  # in units of the prior's deviation
SMALL_STEP = 2e-5  # of damage: errors of differences would tell modulus, density, loads and equal damage apart
Report: TypeAlias = Callable[[int, int], None]  # how many simulations of how many


class RecordWeights:
    """Weigh by the covariance of white noise and of components beside it.

    Parameters
    ----------
    present : ndarray of bool, shape (s, n)
        Where the record has values.
    noise : ndarray, shape (s,)
        Standard deviations, in the unit of the record.
    components : ndarray, shape (k, s, n)
        What is unknown beside the noise, in the unit of the record, each times its standard deviation: nuisances that enter
        linearly, and an error of the model. Their outer products add up to their covariance.
    splines : ndarray, shape (n, splines), or None
        Functions of time on which alone the record is compared; None to compare all of it.
    """

    def __init__(self, present: Rows, noise: Vector, components: Matrix, splines: Matrix | None = None) -> None:
        self._present, self._bases = present, list[Matrix]()
        self._scale = np.where(present, 1.0 / np.where(present, noise[:, None], 1.0), 0.0)
        for row in present if splines is not None else ():
            seen = splines * row[:, None]
            e, V = np.linalg.eigh(seen.T @ seen)
            good = e > max(NEGLIGIBLE * e[-1], 1e-300)
            self._bases.append(seen @ (V[:, good] / np.sqrt(e[good])))
        self.values = sum(basis.shape[1] for basis in self._bases) if self._bases else int(present.sum())
        scaled = self._project(components)
        square, modes = np.linalg.eigh(scaled @ scaled.T)  # there are fewer components than values
        seen = square > max(NEGLIGIBLE, ROUNDED * square.max(initial=0.0))
        self._along = (modes[:, seen] / np.sqrt(square[seen])).T @ scaled
        self._less = 1.0 - 1.0 / np.sqrt(1.0 + square[seen])

    def weigh(self, y: Matrix) -> Matrix:
        """Turn rows of readings, shape (m, s, n), into independent numbers of variance 1, shape (m, values)."""
        scaled = self._project(y)
        return np.asarray(scaled - (scaled @ self._along.T * self._less) @ self._along)

    def _project(self, y: Matrix) -> Matrix:
        scaled = np.where(self._present, y, 0.0) * self._scale
        if not self._bases:
            return scaled[:, self._present]
        return np.concatenate([scaled[:, k] @ basis for k, basis in enumerate(self._bases)], axis=1)


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
    linear : sequence of str
        Kinds of nuisances that are not among the unknowns: they stay at ``z0``.

    Attributes
    ----------
    zones : int
        Damages among the unknowns.
    size : int
        Number of unknowns.
    fitted, linear : ndarray of int
        Nuisances that are among the unknowns, and that are not, as indices.
    z0 : ndarray, shape (number of nuisances,)
        Where the linear ones stay, in units of their priors; 0 for the others.
    """

    def __init__(
        self,
        forward: Forward,
        nuisances: Nuisances,
        groups: NDArray[np.int64] | None = None,
        linear: Sequence[str] = (),
    ) -> None:
        self.model, self.nuisances = forward, nuisances
        self.groups = np.arange(len(forward.zones)) if groups is None else groups
        self.linear_kinds = tuple(linear)
        beside = np.array([name.partition("[")[0] in linear for name in nuisances.names], dtype=bool)
        self.fitted, self.linear, self.z0 = np.flatnonzero(~beside), np.flatnonzero(beside), np.zeros(beside.size)
        self.zones = int(self.groups.max()) + 1
        self.size = self.zones + self.fitted.size
        self.simulated = self.zones + int(np.searchsorted(self.fitted, len(nuisances.simulated)))
        ones = np.ones(self.fitted.size)
        self.prior = np.r_[np.zeros(self.zones), ones]
        self.low = np.r_[np.zeros(self.zones), -BEYOND * ones]
        self.high = np.r_[np.full(self.zones, MOST_DAMAGE), BEYOND * ones]
        self.steps = np.r_[np.full(self.zones, DAMAGE_STEP), NUISANCE_STEP * ones]

    def z(self, x: Matrix) -> Matrix:
        """Return all nuisances of rows of unknowns, in units of their priors, shape (m, number of nuisances)."""
        found = np.tile(self.z0, (len(x), 1))
        found[:, self.fitted] = x[:, self.zones :]
        return found

    def damage(self, x: Matrix) -> Matrix:
        """Return the damage of all zones [1] of rows of unknowns, shape (m, all zones)."""
        return np.asarray(x[:, : self.zones][:, self.groups])

    def histories(self, x: Matrix, samples: int, h: float) -> Matrix:
        """Simulate the strain [1] of rows of unknowns, shape (m, s, samples)."""
        return self.simulate(self.damage(x), self.z(x), samples, h)

    def simulate(self, damage: Matrix, z: Matrix, samples: int, h: float) -> Matrix:
        """Simulate the strain [1] of rows of damages of all zones and of nuisances, shape (m, s, samples)."""
        loads = self.nuisances.histories(z, h * np.arange(1.0, samples + 1.0))
        return self.model.strain(damage, self.nuisances.moved(z), loads, samples, h)

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
        """Return how much differences of the strain by two steps of damage differ [1]: next to nothing if it is smooth.

        Raises
        ------
        ConvergenceError
            A case fails.
        """
        along = np.zeros(self.size)
        along[: self.zones] = np.random.default_rng(0).uniform(0.5, 1.0, self.zones)
        steps = DAMAGE_STEP * np.array([0.1, 1.0])
        y = require_finite(self.histories(np.vstack([0.0 * along, steps[:, None] * along]), samples, h))
        short, long = (y[1:] - y[0]) / steps[:, None, None]
        return float(np.linalg.norm(short - long)) / max(float(np.linalg.norm(long)), 1e-300)


class RecordProblem(DamageUnknowns, LeastSquares):
    r"""Predictions, residuals and derivatives for one record.

    Parameters
    ----------
    sensed : SensedForward
        Simulation.
    record : ResponseRecord
        What is fitted.
    nuisances : Nuisances
        What is unknown beside the damages, and the loads.
    noise : ndarray, shape (s,)
        Standard deviation of the noise, in the unit of the record.
    discrepancy : Discrepancy or None
        Model error that is learned on splines; nothing faster is compared then.
    groups : ndarray of int, shape (zones,), or None
        Which unknown each zone's damage is, from 0; None for one each.
    linear : sequence of str
        Kinds of nuisances that enter linearly.
    error : ndarray, shape (k, s, n or more), or None
        Components of an error of the model, strain [1] at the samples, or in the states of a static record.
    report : callable, optional
        Called before each group of simulations with the length of the record [s] and the simulations that were made.

    Notes
    -----
    With the columns C, derivatives of the readings by the linear nuisances at the damages d and the nuisances
    :math:`z_0`, the readings are :math:`y = f(d, z_0) + C (z - z_0) + e`; z has a standard normal distribution. They are
    marginalised: :math:`y + C z_0` has the mean f and the covariance :math:`C C^T` beside that of e.
    """

    def __init__(
        self,
        sensed: SensedForward,
        record: ResponseRecord,
        nuisances: Nuisances,
        noise: Vector,
        discrepancy: Discrepancy | None,
        groups: NDArray[np.int64] | None = None,
        linear: Sequence[str] = (),
        error: Matrix | None = None,
        report: Callable[[float, int], None] = lambda *_: None,
    ) -> None:
        super().__init__(sensed.forward, nuisances, groups, linear)
        self.steps[: self.zones] = SMALL_STEP
        self.sensed, self.record, self.noise, self._discrepancy = sensed, record, noise, discrepancy
        self._zero, self._scale = sensed.scale(record.kind)
        self._simulations, self._report, self._counting = [0], report, Lock()
        if discrepancy is not None:
            error = discrepancy.basis(record.samples, record.step)
        self._error = np.zeros((0, *record.values.shape)) if error is None else self._as_read(error)
        self._linearise(np.zeros(self.size))

    @property
    def simulations(self) -> int:
        """How many cases were simulated, for this problem and those that were made of it."""
        return self._simulations[0]

    def linear_values(self, point: Point) -> Vector:
        """Return the means of the linear nuisances at a point, in units of their priors."""
        return np.asarray(self.columns @ point.r)

    def likeliest(self, point: Point) -> Vector:
        """Return all nuisances at a point, in units of their priors, the linear ones where they are likeliest."""
        z: Vector = self.z(point.x[None])[0]
        z[self.linear] = np.clip(self.linear_values(point), -BEYOND, BEYOND)
        return z

    def linear_deviations(self, J: Matrix, covariance: Matrix) -> Vector:
        """Return the deviations of the linear nuisances, from the derivatives by unknowns and the covariance of those."""
        moved = self.columns @ J
        alone = np.maximum(1.0 - np.sum(self.columns**2, axis=1), 0.0)  # round-off
        return np.asarray(np.sqrt(alone + np.einsum("ki,ij,kj->k", moved, covariance, moved)))

    def stale(self, x: Vector, z: Vector) -> bool:
        """Tell whether unknowns x and linear nuisances z are far from where the nuisances were linearised."""
        move = z - self.z0[self.linear]
        bent = BENT * np.abs(move).max(initial=0.0) * np.linalg.norm(move @ self.columns) > 1.0
        return bool(self.linear.size) and bool(bent or np.abs(x - self._at)[: self.zones].max() > NEAR)

    def renewed(self, x: Vector, z: Vector) -> RecordProblem:
        """Return the problem with the nuisances linearised about unknowns x and linear nuisances z."""
        if not self.linear.size:
            return self
        found = copy(self)
        found.z0 = self.z0.copy()
        found.z0[self.linear] = np.clip(z, -BEYOND, BEYOND)
        found._linearise(x)
        return found

    def predict(self, x: Matrix) -> Matrix:
        """Return strain or resistance without gain, offset and delay, shape (m, s, n or more)."""
        return self._predict(self.damage(x), self.z(x))

    def weigh(self, predicted: Matrix, x: Matrix) -> Matrix:
        """Weigh what sensors with gain, offset and delay read, shape (m, values)."""
        return self._weights.weigh(self._read(predicted, self.z(x)))

    def derivatives(self, point: Point, free: Rows) -> Matrix:
        """Return the derivatives of the weighed predictions; of equilibria by the damages from the tangent there."""
        if not isinstance(self.record, StaticRecord):
            return super().derivatives(point, free)
        zones = np.flatnonzero(free[: self.zones])
        x = point.x[None]
        z = self.z(x)
        loads = {name: np.ravel(load) for name, load in self.nuisances.histories(z, np.zeros(self.record.states)).items()}
        given = {name: float(value[0]) for name, value in self.nuisances.moved(z).items()}
        slopes = self.model.state_slopes(self.damage(x)[0], given, loads)
        moves = np.array([slopes[self.groups == zone].sum(axis=0) for zone in zones]).reshape(-1, *slopes.shape[1:])
        moved = self.weigh(point.predicted + moves[:, :, self.record.state], np.repeat(x, len(zones), axis=0))
        by_damage = require_finite((moved - (self.y - point.r)).T)
        return np.hstack([by_damage, super().derivatives(point, free & (np.arange(self.size) >= self.zones))])

    def reading(self, point: Point) -> Matrix:
        """Return what the sensors read at a point, shape (s, n), in the unit of the record."""
        move = self.linear_values(point) - self.z0[self.linear]
        read = self._read(point.predicted[None], self.z(point.x[None]))[0]
        return np.asarray(read + np.tensordot(move, self._columns, axes=1))

    def _linearise(self, x: Vector) -> None:
        """Find what the linear nuisances change of the readings about unknowns, and weigh the record with that."""
        self._at = x
        z = np.tile(self.z(x[None]), (1 + self.linear.size, 1))
        z[np.arange(1, len(z)), self.linear] += NUISANCE_STEP
        again = 1 + int(np.searchsorted(self.linear, len(self.nuisances.simulated)))
        damage = np.repeat(self.damage(x[None]), again, axis=0)
        if self.linear.size:
            found = require_finite(self._predict(damage, z[:again]))
            read = self._read(np.concatenate([found, np.repeat(found[:1], len(z) - again, axis=0)]), z)
            self._columns = (read[1:] - read[0]) / NUISANCE_STEP
        else:
            self._columns = np.zeros((0, *self.record.values.shape))
        self._weigh_anew()

    def _weigh_anew(self) -> None:
        record, splines = self.record, None
        if self._discrepancy is not None:
            splines = spline_matrix(record.samples, record.step, self._discrepancy.length)
        components = np.concatenate([self._columns, self._error])
        self._weights = RecordWeights(record.present, self.noise, components, splines)
        self.values = self._weights.values
        self.columns = self._weights.weigh(self._columns)
        known = np.where(record.present, record.values, 0.0)[None]
        self.y = self._weights.weigh(known)[0] + self.z0[self.linear] @ self.columns

    def _as_read(self, error: Matrix) -> Matrix:
        """Return components of an error of strain in the unit of the record, at its samples."""
        record = self.record
        if isinstance(record, StaticRecord):
            return error[:, :, record.state]
        error = error[:, :, : record.samples]
        if record.kind == "strain":
            return error
        nothing = np.zeros((1, len(self.groups))), np.zeros((1, self.z0.size))
        strain = self._strain(*nothing)[:, :, : record.samples]
        both = self.sensed.resistance(np.concatenate([strain, strain + error]), record.step)
        return both[1:] - both[:1]

    def _read(self, predicted: Matrix, z: Matrix) -> Matrix:
        return self.nuisances.read(predicted, self._zero, self._scale, z)[:, :, : self.record.samples]

    def _predict(self, damage: Matrix, z: Matrix) -> Matrix:
        strain = self._strain(damage, z)
        return strain if self.record.kind == "strain" else self.sensed.resistance(strain, self.record.step)

    def _strain(self, damage: Matrix, z: Matrix) -> Matrix:
        record = self.record
        with self._counting:  # starts run side by side
            self._report(record.samples * record.step, self._simulations[0])
            self._simulations[0] += len(z)
        if isinstance(record, StaticRecord):
            loads = self.nuisances.histories(z, np.zeros(record.states))
            return self.model.states(damage, self.nuisances.moved(z), loads)[:, :, record.state]
        return self.simulate(damage, z, record.samples + self.nuisances.spare, record.step)
