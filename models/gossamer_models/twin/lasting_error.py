r"""Errors of sensors that are a property of the sensor: along what they read, with coefficients that last.

Symbols: ``u`` what a sensor reads over its range [1], about 0, ``v`` rate of what it feels over the largest [1]; ``f``
features, ``s`` sensors, ``n`` samples.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ..arrays import Matrix, Vector
from ..sensor.fit.regression import fronts
from .nuisances import spline_basis

POWERS = 3  # of the resistance
MEMORIES = 4  # time constants, from ten steps to a third of the record
RATES = (0.01, 0.1, 1.0)  # of the largest rate: where a dependence on the rate bends
PLAYS = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5)  # half-widths, of the range of the resistance
SPACING = 12  # samples between splines of what is left in a window
TINY = 1e-12
Memory: TypeAlias = tuple[Matrix, Matrix]  # of filters, shape (2 MEMORIES, s, 1), and of fronts, shape (s, plays)


def lasting_features(
    u: Matrix, v: Matrix, constants: Vector, before: Memory | None = None
) -> tuple[dict[str, list[Matrix]], Memory]:
    """Return features of groups whose coefficients last, each (s, n), and what they remember at the end.

    Parameters
    ----------
    u, v : ndarray, shape (s, n)
        Resistance over its range, about 0, and rate of the strain over the largest [1].
    constants : ndarray, shape (MEMORIES,)
        Time constants of what fades [steps].
    before : tuple or None
        What they remember of earlier samples; None for nothing.
    """
    from scipy.signal import lfilter  # slow to import

    half = np.array(PLAYS)
    fading, fronts_before = before or (np.zeros((2 * MEMORIES, len(u), 1)), np.broadcast_to(half, (len(u), half.size)))
    pairs = [(T, sign) for T in constants for sign in (1.0, -1.0)]
    filtered = [
        lfilter([1.0], [1.0, -np.exp(-1.0 / T)], np.maximum(sign * v, 0.0), zi=rest)
        for (T, sign), rest in zip(pairs, fading, strict=True)
    ]
    rates = [np.arcsinh(v / share) for share in RATES]
    moved = fronts(u, 2.0 * half, fronts_before)
    found = {
        "shape": [u**p for p in range(1, POWERS + 1)],
        "rate": [each for rate in rates for each in (rate, rate * u, np.abs(rate), np.abs(rate) * u)],
        "memory": [each for faded, _ in filtered for each in (faded, faded * u)],
        "play": [each for play in np.moveaxis(moved - half, -1, 0) for each in (play, play**2, play * u)],
    }
    return found, (np.array([rest for _, rest in filtered]), moved[:, -1])


def random_errors(strain: Matrix, random: np.random.Generator) -> Matrix:
    """Draw errors of sensors along what they feel [1], shape (s, n): of its shape, dependence on rate, memory and play.

    Parameters
    ----------
    strain : ndarray, shape (s, n)
        What they feel [1], any number of sensors.
    random : numpy.random.Generator
        Source of all coefficients, which are normal; every group of features counts as much as another.

    Notes
    -----
    Without their mean, a root mean square of 1 over the range of the strain.
    """
    span = np.maximum(np.ptp(strain, axis=1, keepdims=True), TINY)
    u, v = (strain - strain.mean(axis=1, keepdims=True)) / span, np.gradient(strain, axis=1)
    v /= np.maximum(np.abs(v).max(axis=1, keepdims=True), TINY)
    n, error = strain.shape[1], np.zeros(strain.shape)
    for group in lasting_features(u, v, np.geomspace(10.0, max(20.0, n / 3.0), MEMORIES))[0].values():
        features = np.array(group)
        error += np.einsum("fs,fsn->sn", random.standard_normal(features.shape[:2]), features / size_of(features))
    error -= error.mean(axis=1, keepdims=True)
    return np.asarray(span * error / np.maximum(error.std(axis=1, keepdims=True), TINY))


class LastingError:
    """The error of sensors that are read window by window, along what is predicted: with coefficients that last.

    Of the groups that a record by itself is allowed, those that are a property of the sensor. Its offset is not one of them.

    Parameters
    ----------
    strain, resistance : ndarray, shape (s, n)
        What the sensors are predicted to feel [1] and read [ohm] in the first window, in whose ranges all is measured.
    share : float
        Deviation of what each group adds, as a share of this range [1].
    """

    def __init__(self, strain: Matrix, resistance: Matrix, share: float) -> None:
        self._span = np.maximum(np.ptp(resistance, axis=1, keepdims=True), TINY)
        self._middle = resistance.mean(axis=1, keepdims=True)
        self._fastest = max(float(np.abs(np.gradient(strain, axis=1)).max()), TINY)
        self._constants = np.geomspace(10.0, 2.0 * resistance.shape[1], MEMORIES)
        self._before: Memory | None = None
        first, _ = self._features(strain, resistance)
        self._scale = share * self._span / np.concatenate([size_of(np.array(each)) for each in first.values()])

    def along(self, strain: Matrix, resistance: Matrix) -> Matrix:
        """Return the features [ohm] along the next window, shape (f, s, n), whose coefficients have the variance 1."""
        found, self._before = self._features(strain, resistance)
        return np.asarray(np.concatenate([*found.values()]) * self._scale)

    def rest(self, share: float, n: int) -> Matrix:
        """Return splines along a window [ohm], shape (f, s, n), of a share of the range: what is left, anew in each."""
        splines = spline_basis(np.arange(1.0, n + 1.0), float(n), max(4, n // SPACING)).T[:, None]
        return np.asarray(share * self._span * splines / np.sqrt((splines**2).sum(axis=0).mean()))

    def _features(self, strain: Matrix, resistance: Matrix) -> tuple[dict[str, list[Matrix]], Memory]:
        u, v = (resistance - self._middle) / self._span, np.gradient(strain, axis=1) / self._fastest
        return lasting_features(u, v, self._constants, self._before)


def size_of(features: Matrix) -> Matrix:
    """Return the root mean square of a sum of features with random coefficients, shape (f, s, 1): feature by feature."""
    return np.asarray(np.sqrt(len(features) * (features**2).mean(axis=2, keepdims=True) + TINY**2))
