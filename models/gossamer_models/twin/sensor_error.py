r"""How far sensors are off their identified model, as unknown processes along what the model predicts.

Symbols: ``u`` predicted resistance over its range [1], ``v`` rate of the predicted strain [1/s]; ``F`` features [ohm] of one
sensor in some groups, ``t`` scale of each group [1], a share of the sensor's range; ``f`` features, ``s`` sensors,
``n`` samples, ``h`` step [s]. The error of a sensor is :math:`\sum_g t_g \sum_i c_{gi} F_{gi}` with unknown c of the
standard normal distribution.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import minimize

from ..arrays import Matrix, Rows, Vector
from ..sensor.fit.regression import switched
from .lasting_error import MEMORIES, POWERS, TINY, lasting_features, size_of
from .nuisances import spline_basis
from .simulation import SensorBank
from .weights import scale_evidence

DRIFTS, RESTS = 6, 80  # splines of what changes slowly, and of what is left
KNOTS = 5  # of a field on a table, along its lines and across them
# Groups of features, and the median of the prior of each one's scale, as a share of what the sensor's model misses.
GROUPS = dict.fromkeys(("offset", "shape", "drift", "rate", "memory", "play", "tables"), 1.0) | {"rest": 0.1}
MISSED = 0.03  # by a model, of the range, if its identification did not test it
BROAD = 3.0  # deviation of the logarithm of a scale
SMALLEST, LARGEST = 1e-6, 1.0  # scale
STEPS = 30  # of the search of the scales
OF_KIND = ("shape", "rate", "memory", "play", "tables")  # groups of what sensors of one kind may have in common
SHARED = 0.5  # correlation of these of two sensors: they are one identification, and each is another specimen
TRIED = 60  # scales of a group, for its mean square
Shares: TypeAlias = tuple[float | None, ...]
Weighing: TypeAlias = Mapping[int, Callable[[Matrix], Matrix]]


@dataclass(frozen=True, eq=False)
class SensorError:
    """Features of the error of each sensor, and their scales.

    Attributes
    ----------
    scales : ndarray, shape (s, groups)
        Of each group of ``GROUPS`` [1].
    resistance : ndarray, shape (s, n)
        The prediction that it lies along [ohm].
    features : ndarray, shape (f, s, n)
        Along it [ohm].
    group : ndarray of int, shape (f,)
        Group of each feature.
    prior : ndarray, shape (groups,)
        Median of each scale before a record [1]; that of offsets is a share of the change at full scale.
    """

    scales: Matrix
    resistance: Matrix
    features: Matrix
    group: NDArray[np.int64]
    prior: Vector

    @classmethod
    def along(
        cls, bank: SensorBank, strain: Matrix, resistance: Matrix, h: float, scales: Matrix | None = None
    ) -> SensorError:
        """Return the error along a prediction.

        Parameters
        ----------
        bank : SensorBank
            The sensors.
        strain, resistance : ndarray, shape (s, n)
            What they feel [1] and read [ohm] at h, 2 h, ...
        h : float
            Step [s].
        scales : ndarray, shape (s, groups), or None
            Of each group [1]; None for those that are likeliest before a record.
        """
        groups = _features(bank, strain, resistance, h)
        prior = np.clip((bank.artifact.error or MISSED) * np.array(list(GROUPS.values())), SMALLEST, LARGEST)
        return cls(
            np.tile(prior, (len(strain), 1)) if scales is None else scales,
            resistance,
            np.concatenate([groups[name] for name in GROUPS]),
            np.repeat(np.arange(len(GROUPS)), [len(groups[name]) for name in GROUPS]),
            prior,
        )

    @cached_property
    def components(self) -> Matrix:
        """Features times their scales [ohm], shape (f, s, n); the outer products of a sensor's add up to its covariance."""
        return np.asarray(self.features * self.scales.T[self.group][:, :, None])

    @property
    def shared(self) -> Matrix:
        """Components that all sensors share [ohm], shape (m, s, n): what the identification of their kind has missed."""
        return math.sqrt(SHARED) * self.components[self._of_kind]

    @property
    def own(self) -> Matrix:
        """Components that those of another sensor know nothing of [ohm], shape (f, s, n), beside the shared ones."""
        return np.where(self._of_kind, math.sqrt(1.0 - SHARED), 1.0)[:, None, None] * self.components

    @property
    def _of_kind(self) -> Rows:
        return np.isin(self.group, [k for k, name in enumerate(GROUPS) if name in OF_KIND])

    def told(self, values: Matrix, weigh: Weighing) -> SensorError:
        """Return the error with the scales that a record tells, sensor by sensor.

        Parameters
        ----------
        values : ndarray, shape (s, n)
            The record [ohm]; not a number where it has no value.
        weigh : mapping of int to callable
            Of each sensor that has values, from 0: turns rows of readings, shape (m, s, n), into independent numbers of
            variance 1, shape (m, values), as far as noise and an error of the mesh go.
        """
        scales = self.scales.copy()
        for k, each in weigh.items():
            r = each((values - self.resistance)[None])[0]
            scales[k] = mean_square_scales(each(self.features), r, self.group, scales[k], self.prior)
        return replace(self, scales=scales)

    def off(self, values: Matrix, reading: Matrix, weigh: Weighing) -> tuple[Shares, Shares]:
        """Return how far sensors are likeliest off what they should read, beside an offset, and this offset [1].

        Parameters
        ----------
        values, reading : ndarray, shape (s, n)
            The record, and what the sensors would read by their model [ohm].
        weigh : mapping of int to callable
            As of ``told``.

        Returns
        -------
        tuple of float or None, length s
            Root mean square, as a share of the range of what it should read [1]; None of a sensor without values.
        tuple of float or None, length s
            Mean, likewise.
        """
        errors: list[float | None] = [None] * len(values)
        offsets, components = errors.copy(), self.components
        for k, each in weigh.items():
            F, r = each(components), each((values - reading)[None])[0]
            error = components[:, k].T @ np.linalg.solve(F @ F.T + np.eye(len(F)), F @ r) / np.ptp(reading[k])
            errors[k], offsets[k] = float(error.std()), float(error.mean())
        return tuple(errors), tuple(offsets)


def mean_square_scales(F: Matrix, r: Vector, group: NDArray[np.int64], start: Vector, median: Vector) -> Vector:
    r"""Return the root mean square of the scale of each group of features, as residuals tell it.

    Parameters
    ----------
    F : ndarray, shape (f, n)
        Features in units of the noise.
    r : ndarray, shape (n,)
        Residuals in units of the noise.
    group : ndarray of int, shape (f,)
        Group of each feature.
    start, median : ndarray, shape (groups,)
        Scales to start from, and the medians of their priors.

    Notes
    -----
    First the largest marginal likelihood of :math:`r \sim N(0, I + F^T T^2 F)`, T the diagonal matrix of scales, times
    the priors of the scales (type II maximum likelihood [1]_). With :math:`S = (I + T F F^T T)^{-1}` and the means
    :math:`c = S T F r`, its derivative by :math:`\log t_i` is :math:`c_i^2 - 1 + S_{ii}`. Then the mean of
    :math:`t^2` of each group, the others at their likeliest: the covariance of what has an uncertain scale is that of its
    mean square, weighed by ``scale_evidence`` and the prior.

    References
    ----------
    .. [1] D. J. C. MacKay, Neural Computation 4(3), 415-447, 1992, doi:10.1162/neco.1992.4.3.415.
    """
    G, b, middle = F @ F.T, F @ r, np.log(median)

    def unlikely(log_scale: Vector) -> tuple[float, Vector]:
        t, away = np.exp(log_scale)[group], (log_scale - middle) / BROAD
        A = t[:, None] * G * t
        A[np.diag_indices_from(A)] += 1.0
        factor = scipy.linalg.cho_factor(A, lower=True)
        S = scipy.linalg.cho_solve(factor, np.eye(len(t)))
        c = S @ (t * b)
        value = np.log(np.diag(factor[0])).sum() - 0.5 * c @ (t * b) + 0.5 * away @ away
        return float(value), np.bincount(group, 1.0 - np.diag(S) - c**2, len(middle)) + away / BROAD

    limits = [(np.log(SMALLEST), np.log(LARGEST))] * len(middle)
    found = minimize(unlikely, np.log(start), jac=True, method="L-BFGS-B", bounds=limits, options={"maxiter": STEPS})
    t, tried = np.exp(found.x)[group], np.geomspace(SMALLEST, LARGEST, TRIED)
    mean_square = np.empty(len(middle))
    for k in range(len(middle)):
        own, rest = group == k, group != k
        beside = t[rest, None] * np.column_stack([G[rest][:, own], b[rest]])
        A = np.eye(rest.sum()) + t[rest, None] * G[np.ix_(rest, rest)] * t[rest]
        left = np.column_stack([G[own][:, own], b[own]]) - beside[:, :-1].T @ scipy.linalg.solve(A, beside, assume_a="pos")
        gain = scale_evidence(left[:, :-1], left[:, -1], tried) - ((np.log(tried) - middle[k]) / BROAD) ** 2
        weight = np.exp((gain - gain.max()) / 2.0)
        mean_square[k] = weight @ tried**2 / weight.sum()
    return np.asarray(np.sqrt(mean_square))


def _features(bank: SensorBank, strain: Matrix, resistance: Matrix, h: float) -> dict[str, Matrix]:
    """Return the features of each group, shape (f, s, n) [ohm]: those of a group have the size of the range together."""
    n = strain.shape[1]
    rise = bank.parameters["full_scale_resistance_change"][:, None]
    span = np.maximum(np.ptp(resistance, axis=1, keepdims=True), TINY * rise)
    u = (resistance - resistance.mean(axis=1, keepdims=True)) / span
    v = np.gradient(strain, h, axis=1)
    time = np.arange(1.0, n + 1.0)
    slow, fast = (spline_basis(time, float(n), max(4, min(count, n // 4))).T[:, None] for count in (DRIFTS, RESTS))
    powers = [u**p for p in range(POWERS + 1)]
    found = {
        **lasting_features(u, v / max(np.abs(v).max(), TINY), np.geomspace(10.0, max(20.0, n / 3.0), MEMORIES))[0],
        "drift": [spline * power for spline in slow for power in powers],
        "rest": np.broadcast_to(fast, (len(fast), *u.shape)),
        "tables": table_features(bank, strain),
    }
    sized = {name: np.asarray(each) for name, each in found.items()}
    for name, each in sized.items():
        sized[name] = each / size_of(each) * span
    return {"offset": np.broadcast_to(rise, (1, *u.shape)), **sized}


def fields_of(N: int, knots: int) -> Matrix:
    """Return smooth fields on the cells of a table of N lines, shape (cells, fields): products of hats, whose sum is 1."""
    hats = np.clip(1.0 - np.abs((np.arange(N)[:, None] + 0.5) / N * (knots - 1) - np.arange(knots)), 0.0, 1.0)
    i, k = np.triu_indices(N)
    return np.asarray((hats[k][:, :, None] * hats[i][:, None]).reshape(len(i), -1))


def table_features(bank: SensorBank, strain: Matrix, knots: int = KNOTS) -> Matrix:
    """Return what relative changes of the tables, smooth fields, add to the output along strain, shape (2 fields, s, n)."""
    N = bank.artifact.n_lines
    full, rest = (bank.parameters[name] for name in ("full_scale_strain", "rest_strain"))
    i, k = np.triu_indices(N)
    fields = fields_of(N, knots)
    up, down = (table[i, k][:, None] * fields for table in bank.artifact.tables())
    found = []
    for each in np.clip(np.column_stack([rest, strain]) / full[:, None], 0.0, 1.0):  # from rest
        risen, fallen = switched(each, N)
        found.append(np.hstack([risen[1:] @ up, -fallen[1:] @ down]).T)
    return np.stack(found, axis=1)
