r"""Fits to simulated noisy records, beside what the information predicts of them.

Symbols: ``x`` unknowns, ``C`` predicted covariance of the damages, ``L`` its Cholesky factor, ``e`` errors of the fits, so
that :math:`L^{-1} e` are independent numbers of variance 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..twin.least_squares import LeastSquares, Point, descend, require_finite
from ..twin.unknowns import DamageUnknowns, Report
from .information import FACTOR, THRESHOLD, covariance, weigh

DAMAGE = 0.3  # of every zone [1]: so far from zero that the bounds of a fit do not hold it back


@dataclass(frozen=True, kw_only=True)
class MonteCarloCheck:
    """How deviations that were predicted compare with those of fits.

    Attributes
    ----------
    records : int
        Fits.
    predicted, observed : ndarray, shape (Z,)
        Deviations of the damages [1]: predicted there, and root of the mean square of the errors.
    spread : float
        Mean square of the errors in units of the predicted covariance [1], all zones together: 1 if it is right.
    spread_error : float
        Standard deviation of ``spread`` from the number of records.
    false_alarms, found : float
        Shares of all zones of all records [1]: above the threshold without damage beside that of the truth, and with a90
        beside it. Each fit serves for both, since damage only moves its estimate.
    """

    records: int
    predicted: Vector
    observed: Vector
    spread: float
    spread_error: float
    false_alarms: float
    found: float

    @property
    def agrees(self) -> bool:
        """Whether ``spread`` is within three of its deviations of 1."""
        return abs(self.spread - 1.0) <= 3.0 * self.spread_error


class _Records(DamageUnknowns, LeastSquares):
    """The least-squares problem of the twin with unknown offsets; one record at a time."""

    def __init__(self, problem: DamageUnknowns, sigma: float, truth: Vector, samples: int, h: float) -> None:
        super().__init__(problem.model, problem.nuisances)
        self._sigma, self._truth, self._samples, self._h = sigma, truth, samples, h
        self.history, J = self.linearised(truth, samples, h)
        self.J = self._weighed(J).T
        self.y = self._weighed(self.history[None])[0]

    def read(self, history: Matrix) -> None:
        """Take the next record, shape (gauges, samples)."""
        self.y = self._weighed(history[None])[0]

    def predict(self, x: Matrix) -> Matrix:
        """Simulate rows of unknowns."""
        at_truth = len(x) == 1 and np.array_equal(x[0], self._truth)  # where every fit starts
        return self.history[None] if at_truth else self.histories(x, self._samples, self._h)

    def weigh(self, predicted: Matrix, x: Matrix) -> Matrix:  # noqa: ARG002
        """Weigh histories with unknown offsets."""
        return self._weighed(predicted)

    def derivatives(self, point: Point, free: Rows) -> Matrix:
        """Return the derivatives of the weighed predictions by the free unknowns."""
        if np.array_equal(point.x, self._truth):
            return self.J[:, free]
        _, J = self.linearised(point.x, self._samples, self._h)
        return require_finite(self._weighed(J).T[:, free])

    def _weighed(self, histories: Matrix) -> Matrix:
        return weigh(histories, self._sigma).reshape(len(histories), -1)


def check(
    problem: DamageUnknowns, sigma: float, samples: int, h: float, records: int, *, seed: int = 1, report: Report
) -> MonteCarloCheck:
    """Fit damages to records of a damaged membrane with noise.

    Parameters
    ----------
    problem : DamageUnknowns
        Membrane, its sensors, and the load.
    sigma : float
        Standard deviation of the noise [1], which is uniform and not negative, as in the thesis.
    samples, h : int, float
        Samples of a record and the time between them [s].
    records : int
        How many.
    seed : int
        Of the noise.
    report : callable
        Called with how many records of how many.

    Returns
    -------
    MonteCarloCheck

    Notes
    -----
    The search is that of the twin, over damages and nuisances together. It starts at the truth, so it tells how far noise
    moves the minimum, not whether a search from elsewhere finds it. The true nuisances are at the middle of their prior;
    that makes errors smaller than predicted only where a record tells less of them than the prior does.
    """
    zones = problem.zones
    truth = np.where(np.arange(problem.size) < zones, DAMAGE, 0.0)
    fitted = _Records(problem, sigma, truth, samples, h)
    C = covariance(fitted.J.T @ fitted.J, zones)
    random = np.random.default_rng(seed)
    free = np.ones(len(truth), dtype=bool)
    errors = np.empty((records, zones))
    for k in range(records):
        noise = random.random(fitted.history.shape) * sigma * math.sqrt(12.0)
        fitted.read(fitted.history + noise)
        errors[k] = descend(fitted, truth, free).point.x[:zones] - truth[:zones]
        report(k + 1, records)
    predicted = np.sqrt(np.diag(C))
    whitened = np.linalg.solve(np.linalg.cholesky(C), errors.T)
    return MonteCarloCheck(
        records=records,
        predicted=predicted,
        observed=np.sqrt(np.mean(errors**2, axis=0)),
        spread=float(np.mean(whitened**2)),
        spread_error=math.sqrt(2.0 / whitened.size),
        false_alarms=float(np.mean(errors > THRESHOLD * predicted)),
        found=float(np.mean(errors + FACTOR * predicted > THRESHOLD * predicted)),
    )
