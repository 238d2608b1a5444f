r"""Zones that a record cannot tell apart: which are answered together.

Symbols: ``A`` curvature of chi2 over the damages, all else taken out; ``M`` which zones a group holds; ``C`` covariance of
the groups' damages.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix
from .least_squares import PRIOR_DEVIATION

UNRESOLVED = 0.5  # of the prior's deviation
ALIKE = 0.7  # cosine between what two groups do to the record, at least
GAIN = 0.8  # of the smaller deviation of two groups: theirs together is below it


def without_nuisances(A: Matrix, zones: int) -> Matrix:
    """Return the curvature over the damages, the first unknowns, with all others at their best, shape (zones, zones)."""
    if len(A) == zones:
        return A
    beside = np.linalg.pinv(A[zones:, zones:], hermitian=True)
    e, V = np.linalg.eigh(A[:zones, :zones] - A[:zones, zones:] @ beside @ A[zones:, :zones])
    return np.asarray(V * np.maximum(e, 0.0) @ V.T)  # round-off leaves negative ones


def groups_of(A: Matrix, zones: int, whole: int) -> NDArray[np.int64]:
    """Return ``alike`` of the zones that come first among the damages of a curvature; every fault after them for itself.

    Parameters
    ----------
    A : ndarray, shape (n, n)
        Curvature over all unknowns.
    zones, whole : int
        As of ``DamageUnknowns``.
    """
    groups = alike(without_nuisances(A, zones)[:whole, :whole])
    return np.concatenate([groups, groups.max() + 1 + np.arange(zones - whole)])


def alike(A: Matrix) -> NDArray[np.int64]:
    """Gather zones that the record cannot tell one by one, and can tell together.

    Parameters
    ----------
    A : ndarray, shape (zones, zones)
        Curvature of half of chi2 over the damages, without a prior of theirs.

    Returns
    -------
    ndarray of int, shape (zones,)
        Group of each zone, from 0, in the order of their first zones.

    Notes
    -----
    Two groups become one while both are not told, they act alike on the record, and their common damage is known better
    than that of each; the pair that acts most alike first.
    """
    groups: NDArray[np.int64] = np.arange(len(A))
    while True:
        M = np.eye(groups.max() + 1)[groups]
        B, C = M.T @ A @ M, _covariance(M.T @ A @ M)
        deviation, size = np.sqrt(np.diag(C)), np.sqrt(np.maximum(np.diag(B), 1e-300))
        weak = np.flatnonzero(deviation > UNRESOLVED * PRIOR_DEVIATION)
        cosine = B / np.outer(size, size)
        pairs = [(cosine[i, j], i, j) for i, j in combinations(weak.tolist(), 2) if cosine[i, j] > ALIKE]
        for _, i, j in sorted(pairs, reverse=True):
            joined = np.where(groups == j, i, groups)
            joined = np.unique(joined, return_inverse=True)[1]
            N = np.eye(joined.max() + 1)[joined]
            together = _covariance(N.T @ A @ N)[i, i]
            if together < (GAIN * min(deviation[i], deviation[j])) ** 2:
                groups = joined
                break
        else:
            return groups


def untold(A: Matrix, names: Sequence[str]) -> list[str]:
    """Say which zones a record cannot tell, one sentence for each group that acts alike and for each zone that hardly acts.

    Parameters
    ----------
    A : ndarray, shape (zones, zones)
        As of ``alike``.
    names : sequence of str
        Of the zones.
    """
    groups = alike(A)
    M = np.eye(groups.max() + 1)[groups]
    lost = np.sqrt(np.diag(_covariance(M.T @ A @ M))) > UNRESOLVED * PRIOR_DEVIATION
    found = []
    for group in range(groups.max() + 1):
        which = [name for name, each in zip(names, groups.tolist(), strict=True) if each == group]
        listed = " and ".join([", ".join(which[:-1]), which[-1]] if which[1:] else which)
        if which[1:]:
            found.append(f"{listed} act alike on the sensors: the record tells them only together. Add a sensor there.")
        elif lost[group]:
            found.append(f"Damage of {listed} hardly moves the sensors: the record does not tell it. Add a sensor there.")
    return found


def _covariance(A: Matrix) -> Matrix:
    """Return the covariance of damages that may be anything beforehand."""
    return np.asarray(np.linalg.inv(A + np.eye(len(A)) / PRIOR_DEVIATION**2))
