r"""Shares of records with exact confidence bounds, and thresholds of calls."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binomtest

CONFIDENCE = 0.95


class Share(NamedTuple):
    """How many of how many, with a two-sided 95 % confidence interval.

    Attributes
    ----------
    number, total : int
        Of records or zones.
    low, high : float
        Bounds of the share [1]; 0 and 1 if there are none.
    """

    number: int
    total: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """The share [1]; not a number if there are none."""
        return self.number / self.total if self.total else math.nan


def share(which: ArrayLike) -> Share:
    """Count what is true, with the interval of Clopper and Pearson.

    Parameters
    ----------
    which : array_like of bool
        Of any shape.

    Returns
    -------
    Share

    Notes
    -----
    Biometrika 26(4), 404-413, 1934, doi:10.1093/biomet/26.4.404: exact, never too narrow.
    """
    flags = np.asarray(which, dtype=bool)
    number, total = int(flags.sum()), flags.size
    if not total:
        return Share(0, 0, 0.0, 1.0)
    interval = binomtest(number, total).proportion_ci(CONFIDENCE, method="exact")
    return Share(number, total, float(interval.low), float(interval.high))


def threshold_for(largest: ArrayLike, false_calls: float = 0.01) -> float:
    """Return the smallest threshold that few healthy records exceed.

    Parameters
    ----------
    largest : array_like, shape (n,)
        Largest estimate of each healthy record [1], 0 where there is no call whatever the threshold.
    false_calls : float
        Share of records that may exceed it [1].

    Returns
    -------
    float
        A value of ``largest``: at most the share of them is larger.
    """
    ordered = np.sort(np.asarray(largest, dtype=float))
    return float(ordered[len(ordered) - 1 - math.floor(false_calls * len(ordered))])


def size_by_counts(size: ArrayLike, hit: ArrayLike, detected: float = 0.9) -> float:
    """Return the smallest size from which on so many were hit that 95 % confidence needs no model.

    Parameters
    ----------
    size : array_like, shape (n,)
        Sizes.
    hit : array_like of bool, shape (n,)
        Which of them were detected.
    detected : float
        Probability of detection to show [1].

    Returns
    -------
    float
        Infinite if there is none: 29 hits of 29 show 0.9 (0.9^29 < 0.05), 45 of 46, 59 of 61, and fewer do not.

    Notes
    -----
    The lower one-sided bound of Clopper and Pearson of the hits among all sizes from this one on; sizes are added from the
    largest down until it falls again. The probability is that of
    these sizes together; at the smallest of them it may be less. See Appendix G of MIL-HDBK-1823A on what 29 of 29 means.
    """
    a, y = np.asarray(size, dtype=float), np.asarray(hit, dtype=bool)
    found = math.inf
    for smallest in np.unique(a)[::-1]:
        among = y[a >= smallest]
        test = binomtest(int(among.sum()), among.size, detected, alternative="greater")
        if test.pvalue <= 1.0 - CONFIDENCE:
            found = float(smallest)
        elif math.isfinite(found):
            break
    return found
