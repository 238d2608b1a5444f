"""A direct inverse with given numbers, and its equations written again, sample by sample."""

from itertools import pairwise

import numpy as np
from gossamer_models.sensor import DirectInverse
from gossamer_models.sensor.artifact import SmallNetwork

WIDTHS, TIMES = (0.05, 0.3), (0.2, 3.0)


def network(features, seed):
    """Return a network of four units with random weights, whose features were between -1 and 1 in training."""
    rng = np.random.default_rng(seed)
    return SmallNetwork(
        lowest=(-1.0,) * features,
        highest=(1.0,) * features,
        hidden=tuple(map(tuple, rng.normal(size=(4, features)).tolist())),
        bias=tuple(rng.normal(size=4).tolist()),
        out=tuple((0.6 * rng.normal(size=4)).tolist()),
        bound=1.0,
    )


def direct_inverse(ahead=(), step=0.0, **changed):
    """Return a direct inverse with two networks of each kind."""
    now, later = (tuple(network(count, seed) for seed in (1, 2)) for count in (5, 5 + len(ahead)))
    numbers = {"factor": 1.5, "floor": 0.01, **changed}
    return DirectInverse(
        lowest=0.1,
        highest=0.9,
        widths=WIDTHS,
        times=TIMES,
        networks=now,
        ahead=ahead,
        step=step,
        later=later if ahead else (),
        **numbers,
    )


def features(y, h):
    """Return what the networks of the present strain see, shape (n, 5), of outputs from rest at the first, ``h`` [s] apart.

    The low-passes are integrated in ten thousand steps of a sample.
    """
    u = (np.asarray(y) - 0.1) / 0.8
    plays, low = np.full(2, u[0]), np.full(2, u[0])
    rows = [np.concatenate([[u[0]], u[0] - low, plays - u[0]])]
    for before, now in pairwise(u):
        for part in np.linspace(before, now, 10_001)[1:] - 0.5 * (now - before) / 10_000:
            low = low + h / 10_000 / np.array(TIMES) * (part - low)
        plays = np.maximum(now - np.array(WIDTHS), np.minimum(now + np.array(WIDTHS), plays))
        rows.append(np.concatenate([[now], now - low, plays - now]))
    return np.array(rows)


def read(networks, rows):
    """Return strain and deviation [1], shape (n,), that networks tell from features, shape (n, F)."""
    within = np.clip(rows, -1.0, 1.0)
    values = [np.tanh(np.tanh(within @ np.array(n.hidden).T + n.bias) @ n.out) for n in networks]
    strain, scatter = 0.5 + np.mean(values, axis=0), np.std(values, axis=0)
    outside = np.linalg.norm(rows - within, axis=1)
    return np.clip(strain, 0.0, 1.0), 1.5 * np.sqrt(scatter**2 + 0.01**2 + (0.2 * outside) ** 2)
