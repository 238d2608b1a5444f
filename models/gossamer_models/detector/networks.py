"""Training of the sixteen networks of one window.

Symbols: ``I`` logarithms of the damage feature indices, ``D`` distances, ``S`` similarities, ``T`` target memberships,
``W1`` distance weights, ``W2`` rule weights.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from ..arrays import Vector
from ..errors import DataError
from .artifact import ZONES
from .neurofuzzy import triangular_memberships

PEAKS = (0.0, 0.2, 0.4)
SCALES = np.logspace(-3.0, 1.0, 13)
BIASES = (-4.0, -2.0, 0.0, 2.0, 4.0)
RIDGES = (1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1)


class Networks(NamedTuple):
    """The sixteen networks of one window.

    Attributes
    ----------
    weights : ndarray, shape (n, 16)
        Distance weights W1_ij.
    bias : float
        Bias of the similarity.
    rules : ndarray, shape (k, n, 16)
        Rule weights W2.
    leave_one_out : float
        Root mean square error of the memberships [1] of each case from networks that are trained on all others.
    """

    weights: Vector
    bias: float
    rules: Vector
    leave_one_out: float


def train_networks(I: Vector, damages: Vector, levels: int, peaks: ArrayLike = PEAKS) -> Networks:
    """Train the sixteen networks of one window; the training cases are the references.

    Parameters
    ----------
    I : ndarray, shape (n, 16)
        Logarithms of the damage feature indices of the training cases: the undamaged one, some levels of damage in each
        zone alone, zone by zone, then any others.
    damages : ndarray, shape (n, 16)
        Their damages [1].
    levels : int
        Levels in each zone.
    peaks : array_like, shape (k,)
        Peaks of the fuzzy sets [1].

    Returns
    -------
    Networks
        With the least leave-one-out error.

    Notes
    -----
    W1_ij = scale / (r_j^2 d_i): r_j is how far index j strays from linear between neighbouring cases of the same zone, so
    that rough indices count less; d_i is the distance of reference i from its two nearest neighbours, so that every
    reference reaches just its surroundings. The output layer, Section 6.3 of the thesis, is a ridge regression on the
    triangular memberships. Scale, bias and ridge minimize the leave-one-out error: a residual over one minus the diagonal
    of the hat matrix, which one singular value decomposition of S gives for every ridge. The sixteen networks share the
    similarity layer; each has its own output layer.

    Raises
    ------
    DataError
        Fewer than two levels per zone, or indices without any roughness.
    """
    n = len(I)
    alone = 1 + levels * ZONES
    if levels < 2 or n < alone:
        msg = (
            f"there are {n} training cases; training needs the undamaged one and two or more levels in each of {ZONES} "
            "zones"
        )
        raise DataError(msg)
    paths = np.concatenate([np.repeat(I[None, :1], ZONES, axis=0), I[1:alone].reshape(ZONES, levels, -1)], axis=1)
    roughness = np.sqrt(np.mean((paths[:, 1:-1] - 0.5 * (paths[:, :-2] + paths[:, 2:])) ** 2, axis=(0, 1)))
    if roughness.min() <= 0.0 or not np.isfinite(roughness).all():
        msg = (
            f"index {int(roughness.argmin()) + 1} is not finite, or linear in damage to the last bit. Check the strains it "
            "comes from."
        )
        raise DataError(msg)
    D = ((I[:, None] - I[None]) ** 2) @ roughness**-2
    reach = np.sort(D + np.diag(np.full(n, np.inf)), axis=0)[:2].mean(axis=0)
    T = triangular_memberships(damages, peaks)
    targets = T.transpose(0, 2, 1).reshape(n, -1)

    best = (np.inf, 0.0, 0.0, np.empty(0))
    with threadpool_limits(1):  # small matrices: waking other threads for them costs many times their work
        for scale, bias in itertools.product(SCALES, BIASES):
            S = 1.0 / (1.0 + np.exp(np.minimum(D * scale / reach - bias, 700.0)))
            Q, singular, Vt = np.linalg.svd(S)
            projected = Q.T @ targets
            for ridge in RIDGES:
                inverse = singular / (singular**2 + ridge**2)
                leverage = 1.0 - Q**2 @ (singular * inverse)
                if leverage.min() < 1e-9:
                    continue
                residual = targets - Q @ ((singular * inverse)[:, None] * projected)
                error = float(np.sqrt(np.mean((residual / leverage[:, None]) ** 2)))
                if error < best[0]:
                    best = (error, scale, bias, Vt.T @ (inverse[:, None] * projected))
    error, scale, bias, W2 = best
    rules = W2.reshape(n, T.shape[-1], ZONES).transpose(1, 0, 2)
    return Networks(scale / (roughness**2 * reach[:, None]), bias, rules, error)
