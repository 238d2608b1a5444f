r"""The least-squares problem of one record: what is unknown, what is predicted, how it is weighed.

Symbols: ``x`` unknowns, first the 16 damages [1], then the nuisances in units of their priors; ``r`` weighed residuals and
``J`` derivatives of the weighed predictions.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg

from ..arrays import Matrix, Rows, Vector
from ..membrane.mesh import N_ZONES
from .discrepancy import Discrepancy, spline_matrix
from .least_squares import (
    DAMAGE_STEP,
    MOST_DAMAGE,
    Point,
    check_derivatives,
    neighbours,
    points_at,
)
from .nuisances import BEYOND, Nuisances
from .record import N_SENSORS, ResponseRecord
from .simulation import Forward

NEGLIGIBLE = 1e-9  # of the largest eigenvalue: directions that gaps leave without values
NUISANCE_STEP = 0.02  # in units of the prior's deviation


class NoiseWeights:
    """Divide by the noise.

    Parameters
    ----------
    present : ndarray of bool, shape (4, n)
        Where the record has values.
    noise : ndarray, shape (4,)
        Standard deviations, in the unit of the record.
    """

    def __init__(self, present: Rows, noise: Vector) -> None:
        self._present = present
        self._sigma = np.repeat(noise[:, None], present.shape[1], axis=1)[present]
        self.values = int(present.sum())

    def weigh(self, y: Matrix) -> Matrix:
        """Turn rows of readings, shape (m, 4, n), into independent numbers of variance 1, shape (m, values)."""
        return np.asarray(y[:, self._present] / self._sigma)


class SplineWeights:
    """Project on splines in time, then weigh by the covariance of noise and model error.

    Parameters
    ----------
    present : ndarray of bool, shape (4, n)
        Where the record has values.
    noise : ndarray, shape (4,)
        Standard deviations, in the unit of the record.
    error : ndarray, shape (k, 4, n)
        Components of the model error, in the unit of the record.
    h, length : float
        Step of the record and time that the model error is known for [s].
    """

    def __init__(self, present: Rows, noise: Vector, error: Matrix, h: float, length: float) -> None:
        steps = present.shape[1]
        self._scale = np.where(present, 1.0 / np.where(present, noise[:, None], 1.0), 0.0)
        self._splines = spline_matrix(steps, h, length)
        self._splines = self._splines[:, self._splines.any(axis=0)]
        blocks = [self._splines.T @ (row[:, None] * self._splines) for row in present]
        projected = self._project(error)
        S = scipy.linalg.block_diag(*blocks) + projected.T @ projected
        e, V = np.linalg.eigh(S)
        good = e > NEGLIGIBLE * e[-1]
        self._whiten = V[:, good] / np.sqrt(e[good])
        self.values = int(good.sum())

    def weigh(self, y: Matrix) -> Matrix:
        """Turn rows of readings, shape (m, 4, n), into independent numbers of variance 1, shape (m, values)."""
        return np.asarray(self._project(y) @ self._whiten)

    def _project(self, y: Matrix) -> Matrix:
        scaled = np.where(self._scale > 0.0, y, 0.0) * self._scale
        return np.asarray((scaled @ self._splines).reshape(len(y), N_SENSORS * self._splines.shape[1]))


class RecordProblem:
    """Predictions, residuals and derivatives for one record.

    Parameters
    ----------
    forward : Forward
        Simulation.
    record : ResponseRecord
        What is fitted.
    nuisances : Nuisances
        Unknowns beside the damages.
    noise : ndarray, shape (4,)
        Standard deviation of the noise, in the unit of the record.
    discrepancy : Discrepancy or None
        Model error.
    about : ndarray, shape (n,), or None
        Unknowns near which sensors turn the model error of strain into that of resistance; None for none.
    report : callable, optional
        Called before each group of simulations with the length of the record [s] and the simulations that were made.
    """

    def __init__(
        self,
        forward: Forward,
        record: ResponseRecord,
        nuisances: Nuisances,
        noise: Vector,
        discrepancy: Discrepancy | None,
        about: Vector | None = None,
        report: Callable[[float, int], None] = lambda *_: None,
    ) -> None:
        self.forward, self.record, self.nuisances = forward, record, nuisances
        self.size = N_ZONES + len(nuisances.names)
        self.prior = np.r_[np.zeros(N_ZONES), np.ones(len(nuisances.names))]
        self._simulated = N_ZONES + len(nuisances.simulated)
        self.low = np.r_[np.zeros(N_ZONES), np.full(len(nuisances.names), -BEYOND)]
        self.high = np.r_[np.full(N_ZONES, MOST_DAMAGE), np.full(len(nuisances.names), BEYOND)]
        self._reading = forward.reading(record.kind)
        self.simulations, self._report = 0, report
        self._weights: NoiseWeights | SplineWeights
        if discrepancy is None:
            self._weights = NoiseWeights(record.present, noise)
        else:
            error = discrepancy.basis(record.samples, record.step)
            if record.kind == "resistance":
                strain = self._strain(np.zeros((1, self.size)) if about is None else about[None])
                both = forward.resistance(np.concatenate([strain, strain + error]), record.step)
                error = both[1:] - both[:1]
            self._weights = SplineWeights(record.present, noise, error, record.step, discrepancy.length)
        self._y = self._weights.weigh(np.where(record.present, record.values, 0.0)[None])[0]

    @property
    def values(self) -> int:
        """Independent values of the record."""
        return self._weights.values

    def points(self, x: Matrix) -> list[Point]:
        """Simulate rows of unknowns, shape (m, n)."""
        perfect = self._perfect(x)
        r = self._y - self._weights.weigh(self._read(perfect, x))
        return points_at(x, perfect, r, self.prior)

    def derivatives(self, point: Point, free: Rows) -> Matrix:
        """Return the derivatives of the weighed predictions by the free unknowns, shape (values, number of them).

        Raises
        ------
        ConvergenceError
            A simulation has failed.
        """
        x, places = point.x, np.flatnonzero(free)
        simulated, linear = places[places < self._simulated], places[places >= self._simulated]
        here = self._y - point.r
        J = np.empty((self.values, places.size))
        if simulated.size:
            steps = np.where(simulated < N_ZONES, DAMAGE_STEP, NUISANCE_STEP)
            rows, steps = neighbours(x, simulated, steps, self.high)
            weighed = self._weights.weigh(self._read(self._perfect(rows), rows))
            J[:, : simulated.size] = ((weighed - here) / steps[:, None]).T
        if linear.size:
            rows = np.repeat(x[None], linear.size, axis=0)
            rows[np.arange(linear.size), linear] += 1.0
            J[:, simulated.size :] = (self._weights.weigh(self._read(point.predicted[None], rows)) - here).T
        return check_derivatives(J)

    def reading(self, point: Point) -> Matrix:
        """Return what the sensors read at a point, shape (4, n), in the unit of the record."""
        return np.asarray(self._read(point.predicted[None], point.x[None])[0])

    def _read(self, y: Matrix, x: Matrix) -> Matrix:
        """Return what sensors with gain and offset read, shape (m, 4, n)."""
        return self.nuisances.read(y, self._reading.zero, self._reading.scale, x[:, N_ZONES:])

    def _perfect(self, x: Matrix) -> Matrix:
        """Return strain or resistance without gain and offset, shape (m, 4, n)."""
        strain = self._strain(x)
        return strain if self.record.kind == "strain" else self.forward.resistance(strain, self.record.step)

    def _strain(self, x: Matrix) -> Matrix:
        n, h, z = self.record.samples, self.record.step, x[:, N_ZONES:]
        pressure = self.nuisances.pressure(z, h * np.arange(1.0, n + 1.0))
        self._report(n * h, self.simulations)
        self.simulations += len(x)
        return self.forward.strain(x[:, :N_ZONES], self.nuisances.parameters(z), pressure, n, h)
