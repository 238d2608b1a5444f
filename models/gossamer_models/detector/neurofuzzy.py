"""Similarity-based neuro-fuzzy networks, one per zone.

Symbols, as in Chapter 6 of [1]_: ``I`` input (damage feature index), ``X`` reference inputs, ``D`` distance, ``S``
similarity, ``w1`` distance weights, ``b`` bias, ``w2`` rule weights, ``O`` memberships of the damage in the fuzzy sets,
``peaks`` damage at which each set has membership one.

Correction of the source: similarity falls with distance, so Eq. (6.3) must read S = 1 / (1 + exp(-(b - D))).

References
----------
.. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
   Sensors, dissertation, Virginia Tech, 2010, Chapters 6 and 7.
"""

from __future__ import annotations

import functools
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Vector

Defuzzification = Literal["centroid", "mom", "som", "lom"]


def similarity(I: ca.MX, X: ca.MX, w1: ca.MX, b: float) -> ca.MX:
    """Return the similarity of an input with every reference input, Eqs. (6.1) and (6.3).

    Parameters
    ----------
    I : shape (m, 1)
        Input [1].
    X : shape (n, m)
        Reference inputs [1].
    w1 : shape (n, m)
        Weights of the squared differences, not negative.
    b : float
        Bias: the distance at which the similarity is one half.

    Returns
    -------
    shape (n, 1)
        Similarities between 0 and 1.
    """
    rows = ca.mtimes(ca.DM.ones(X.shape[0], 1), I.T)  # one loop of C; repmat would be one per row
    D = ca.sum2(w1 * (X - rows) ** 2)
    return 1.0 / (1.0 + ca.exp(D - b))


def triangular_memberships(damage: ArrayLike, peaks: ArrayLike) -> Vector:
    """Return the memberships of damages in triangular fuzzy sets that share their feet with the neighbours' peaks.

    Parameters
    ----------
    damage : array_like, shape (...)
        Damage [1]; beyond the last peak the last membership stays one.
    peaks : array_like, shape (k,)
        Increasing peaks [1].

    Returns
    -------
    ndarray, shape (..., k)
        Memberships; they add up to one.
    """
    p, x = np.asarray(peaks, dtype=float), np.asarray(damage, dtype=float)
    identity = np.eye(p.size)
    return np.stack([np.interp(x, p, row) for row in identity], axis=-1)


def defuzzify(O: ca.MX, peaks: ca.DM, method: Defuzzification = "centroid", least: float = 1e-300) -> ca.MX:
    """Turn memberships into crisp values.

    Parameters
    ----------
    O : shape (k, z)
        Memberships in k fuzzy sets, one column per network; negative ones count as zero.
    peaks : casadi.DM, shape (k, 1)
        Increasing values at which each set has membership one.
    method : {"centroid", "mom", "som", "lom"}
        Centroidal matching, Eq. (6.4), or the middle, smallest or largest of the sets of largest membership.
    least : float
        Added to the sum of the memberships that the centroid is divided by.

    Returns
    -------
    shape (1, z)
        Crisp values; 0 where no set has a membership.
    """
    sets = [ca.fmax(row, 0.0) for row in ca.vertsplit(O)]
    values = [float(peak) for peak in peaks.full().ravel()]
    if method == "centroid":
        moment = sum(membership * value for membership, value in zip(sets, values, strict=True))
        return moment / (sum(sets) + least)
    largest = functools.reduce(ca.fmax, sets)
    smallest_peak, largest_peak = values[-1], values[0]
    for membership, value in zip(sets, values, strict=True):
        largest_peak = ca.if_else(membership >= largest, value, largest_peak)
    for membership, value in zip(reversed(sets), reversed(values), strict=True):
        smallest_peak = ca.if_else(membership >= largest, value, smallest_peak)
    crisp = {"som": smallest_peak, "lom": largest_peak, "mom": 0.5 * (smallest_peak + largest_peak)}[method]
    return ca.if_else(largest > 0.0, crisp, 0.0)
