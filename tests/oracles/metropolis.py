"""A posterior by random steps alone: Metropolis' algorithm, many chains side by side.

Symbols: ``m`` chains, ``n`` unknowns.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ACCEPTED = 0.25  # share of the steps that a good jump has accepted in many dimensions
RENEWED = 25  # steps after which the size of the jump is corrected, while nothing is kept


def metropolis(
    chi2: Callable[[Array], Array], start: Array, jump: Array, low: Array, high: Array, steps: int, warm: int, seed: int = 0
) -> Array:
    """Draw from a density exp(-chi2 / 2) between bounds.

    Parameters
    ----------
    chi2 : callable
        Of rows of unknowns, shape (m, n), shape (m,); infinite where there is no density.
    start : ndarray, shape (m, n)
        Where the chains begin.
    jump : ndarray, shape (n, n)
        Covariance of the steps but for a factor, which is found while the chains warm up.
    low, high : ndarray, shape (n,)
        Bounds.
    steps, warm : int
        Steps that are kept, and steps before them that are not.
    seed : int
        Of the random numbers.

    Returns
    -------
    ndarray, shape (steps, m, n)
        Draws.

    References
    ----------
    .. [1] N. Metropolis et al., Journal of Chemical Physics 21(6), 1087-1092, 1953, doi:10.1063/1.1699114.
    """
    random, (m, n), L = np.random.default_rng(seed), start.shape, np.linalg.cholesky(jump)
    size, accepted, x, at = 2.4 / np.sqrt(n), 0, start.copy(), chi2(start)
    draws = np.empty((steps, m, n))
    for k in range(-warm, steps):
        new = x + size * random.standard_normal((m, n)) @ L.T
        inside = np.all((low <= new) & (new <= high), axis=1)
        there = np.where(inside, chi2(np.clip(new, low, high)), np.inf)
        better = np.log(random.random(m)) < (at - there) / 2.0
        x[better], at[better] = new[better], there[better]
        accepted += int(better.sum())
        if k >= 0:
            draws[k] = x
        elif k % RENEWED == 0:
            size *= np.exp(2.0 * (accepted / (m * RENEWED) - ACCEPTED))
            accepted = 0
    return draws
