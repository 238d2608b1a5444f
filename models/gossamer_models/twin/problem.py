r"""The least-squares problem of one record: what is unknown, what is predicted, how it is weighed.

Symbols: ``x`` unknowns, first the 16 damages [1], then the nuisances in units of their priors; ``r`` weighed residuals and
``J`` derivatives of the weighed predictions; ``A``, ``g`` curvature and slope of half of chi2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError
from ..membrane.mesh import N_ZONES
from .discrepancy import Discrepancy
from .forward import Forward
from .nuisances import BEYOND, Nuisances
from .record import Record
from .weights import NoiseWeights, SplineWeights

MOST_DAMAGE = 0.95
DAMAGE_STEP = 2e-3  # of finite differences
NUISANCE_STEP = 0.02  # in units of the prior's deviation


@dataclass(frozen=True)
class Quadratic:
    """Quadratic model of chi2 about a point: chi2 - 2 g d + d A d.

    Attributes
    ----------
    A, g : ndarray, shape (n, n) and (n,)
        Curvature and slope; ``A`` includes the priors.
    at : ndarray, shape (n,)
        The point.
    """

    A: Matrix
    g: Vector
    at: Vector


@dataclass(frozen=True)
class Point:
    """Unknowns and what they predict.

    Attributes
    ----------
    x : ndarray, shape (n,)
        Unknowns.
    perfect : ndarray, shape (4, samples)
        Strain or resistance that sensors without gain and offset read.
    r : ndarray, shape (values,)
        Weighed residuals.
    chi2 : float
        Chi2 with the priors; infinite where the simulation failed.
    """

    x: Vector
    perfect: Matrix
    r: Vector
    chi2: float


class Problem:
    """Predictions, residuals and derivatives for one record.

    Parameters
    ----------
    forward : Forward
        Simulation.
    record : Record
        What is fitted.
    nuisances : Nuisances
        Unknowns beside the damages.
    noise : ndarray, shape (4,)
        Standard deviation of the noise, in the unit of the record.
    discrepancy : Discrepancy or None
        Model error.
    about : ndarray, shape (n,), or None
        Unknowns near which sensors turn the model error of strain into that of resistance; None for none.
    """

    def __init__(
        self,
        forward: Forward,
        record: Record,
        nuisances: Nuisances,
        noise: Vector,
        discrepancy: Discrepancy | None,
        about: Vector | None = None,
    ) -> None:
        self.forward, self.record, self.nuisances = forward, record, nuisances
        self.size = N_ZONES + len(nuisances.names)
        self._simulated = N_ZONES + len(nuisances.simulated)
        self.low = np.r_[np.zeros(N_ZONES), np.full(len(nuisances.names), -BEYOND)]
        self.high = np.r_[np.full(N_ZONES, MOST_DAMAGE), np.full(len(nuisances.names), BEYOND)]
        self._reading = forward.reading(record.kind)
        self.simulations = 0
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
        chi2 = np.einsum("ij,ij->i", r, r) + np.sum(x[:, N_ZONES:] ** 2, axis=1)
        return [Point(*row) for row in zip(x, perfect, r, np.where(np.isfinite(chi2), chi2, np.inf), strict=True)]

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
            steps = np.where(x[simulated] + steps > self.high[simulated], -steps, steps)
            rows = np.repeat(x[None], simulated.size, axis=0)
            rows[np.arange(simulated.size), simulated] += steps
            weighed = self._weights.weigh(self._read(self._perfect(rows), rows))
            J[:, : simulated.size] = ((weighed - here) / steps[:, None]).T
        if linear.size:
            rows = np.repeat(x[None], linear.size, axis=0)
            rows[np.arange(linear.size), linear] += 1.0
            J[:, simulated.size :] = (self._weights.weigh(self._read(point.perfect[None], rows)) - here).T
        if not np.isfinite(J).all():
            msg = "the twin's membrane failed near its present damages. Check the load and the parameters of the twin."
            raise ConvergenceError(msg)
        return J

    def quadratic(self, point: Point, free: Rows, J: Matrix) -> Quadratic:
        """Return the quadratic model of chi2 at a point over the free unknowns, from their derivatives."""
        places = np.flatnonzero(free)
        at, prior = point.x[places], (places >= N_ZONES).astype(float)
        return Quadratic(A=J.T @ J + np.diag(prior), g=J.T @ point.r - prior * at, at=at)

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
        self.simulations += len(x)
        return self.forward.strain(x[:, :N_ZONES], self.nuisances.parameters(z), pressure, n, h)
