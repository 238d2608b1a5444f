"""Records that judges are asked about, with their truth: strain or resistance as sensors of some kind read it.

Symbols: ``n`` records, ``s`` sensors, ``T`` samples. What a case's number decides is which sensor is concerned.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from ..arrays import Matrix
from ..twin.lasting_error import random_errors

Numbers: TypeAlias = NDArray[np.int64]
Reading: TypeAlias = Callable[[Matrix, Matrix, Numbers], Matrix]  # of strain, noise, (n, s, T), and numbers, (n,)
GAIN = 0.95
MEMORY = 0.9  # correlation of neighbouring samples of coloured noise [1]
MOST_OFF = 0.2  # root mean square of the error of a sensor over the range of its strain [1]
OUTLIERS, FAR = 0.005, 10.0  # share of samples, and deviations of the noise that they are off


def as_it_is(strain: Matrix, noise: Matrix, numbers: Numbers) -> Matrix:  # noqa: ARG001
    """Read strain with its noise."""
    return strain + noise


def dead(strain: Matrix, noise: Matrix, numbers: Numbers) -> Matrix:
    """Let one sensor repeat its first reading."""
    found = strain + noise
    for row, sensor in zip(found, _sensor(numbers, found), strict=True):
        row[sensor] = row[sensor, 0]
    return found


def swapped(strain: Matrix, noise: Matrix, numbers: Numbers) -> Matrix:
    """Exchange two sensors."""
    found = strain + noise
    pairs = list(combinations(range(found.shape[1]), 2))
    for row, number in zip(found, numbers, strict=True):
        pair = list(pairs[int(number) % len(pairs)])
        row[pair] = row[pair[::-1]]
    return found


def one_gain(strain: Matrix, noise: Matrix, numbers: Numbers) -> Matrix:
    """Let one sensor read too little."""
    found = np.array(strain)
    for row, sensor in zip(found, _sensor(numbers, found), strict=True):
        row[sensor] *= GAIN
    return found + noise


def off(strain: Matrix, noise: Matrix, numbers: Numbers) -> Matrix:
    """Let every sensor have an error of its own, of up to ``MOST_OFF``: in shape, dependence on rate, memory and play."""
    found = strain + noise
    for row, felt, number in zip(found, strain, numbers, strict=True):
        random = np.random.default_rng((int(number), 1))
        row += MOST_OFF * random.random((len(row), 1)) * random_errors(felt, random)
    return found


def off_place(strain: Matrix, noise: Matrix, numbers: Numbers) -> Matrix:
    """Take one of the s sensors from another place, of the 3 s of ``truths.with_moved_sensors``."""
    s = strain.shape[1] // 3
    rows = np.tile(np.arange(s), (len(numbers), 1))
    for row, number in zip(rows, np.asarray(numbers, dtype=int), strict=True):
        row[number % s] += s * (1 + number // s % 2)
    return np.asarray(np.take_along_axis(strain + noise, rows[:, :, None], axis=1))


def late(samples: int, strain: Matrix, noise: Matrix, numbers: Numbers) -> Matrix:  # noqa: ARG001
    """Begin some samples late: what is said to be the start is rest."""
    rest = np.repeat(strain[:, :, :1], samples, axis=2)
    return np.concatenate([rest, strain[:, :, :-samples]], axis=2) + noise


def coloured(strain: Matrix, noise: Matrix, numbers: Numbers) -> Matrix:  # noqa: ARG001
    """Let noise of the same deviation remember its past: a first-order process."""
    mean = noise.mean(axis=2, keepdims=True)
    return np.asarray(strain + mean + lfilter([np.sqrt(1.0 - MEMORY**2)], [1.0, -MEMORY], noise - mean, axis=2))


def outliers(strain: Matrix, noise: Matrix, numbers: Numbers) -> Matrix:
    """Put a few samples far off."""
    size = FAR * noise.std(axis=2, keepdims=True)
    some = [np.random.default_rng(int(number)).random(noise.shape[1:]) < OUTLIERS for number in numbers]
    return np.asarray(strain + noise + size * np.array(some))


def _sensor(numbers: Numbers, histories: Matrix) -> list[int]:
    return [int(number) % histories.shape[1] for number in numbers]
