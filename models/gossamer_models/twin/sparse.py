r"""Which zones a record shows to be damaged.

Symbols: ``A``, ``g`` curvature and slope of half of chi2 over the unknowns, ``d`` moves from the point of the quadratic
model. A zone is dropped while chi2 rises by less than ``THRESHOLD``; where it rises by just that, the zone is as likely
damaged as not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Rows, Vector
from .least_squares import Quadratic
from .quadratic import bounded_minimum, change

THRESHOLD = 9.0


@dataclass(frozen=True)
class Box:
    """Unknowns of a quadratic model that are damages, and how far each may move.

    Attributes
    ----------
    zones : ndarray of bool, shape (n,)
        Which unknowns are damages.
    low, high : ndarray, shape (n,)
        Bounds of the moves.
    """

    zones: Rows
    low: Vector
    high: Vector


def smallest(model: Quadratic, box: Box, kept: Rows) -> tuple[float, Vector]:
    """Return the change of chi2 and the move if only the kept unknowns are not zero."""
    d = np.where(kept, 0.0, -model.at)
    g = model.g - model.A @ d
    d[kept] = bounded_minimum(model.A[np.ix_(kept, kept)], g[kept], box.low[kept], box.high[kept])
    return change(model.A, model.g, d), d


def drop_zones(model: Quadratic, box: Box) -> tuple[Rows, Vector]:
    """Drop the zone that raises chi2 least, again and again, while it rises by less than the threshold.

    Parameters
    ----------
    model : Quadratic
        Near the smallest chi2 of all zones.
    box : Box
        Damages and bounds.

    Returns
    -------
    ndarray of bool, shape (n,)
        Unknowns that stay; nuisances always do.
    ndarray, shape (n,)
        Move to the smallest chi2 with them.
    """
    kept = np.ones(len(model.g), dtype=bool)
    best, move = smallest(model, box, kept)
    while True:
        at_zero = kept & box.zones & (model.at + move <= 0.0)
        if at_zero.any():
            kept &= ~at_zero
            continue
        costs = {k: smallest(model, box, _without(kept, k)) for k in np.flatnonzero(kept & box.zones)}
        if not costs:
            return kept, move
        k = min(costs, key=lambda zone: costs[zone][0])
        if costs[k][0] - best >= THRESHOLD:
            return kept, move
        best, move = costs[k]
        kept[k] = False


def evidence(model: Quadratic, box: Box, kept: Rows) -> Vector:
    """Return by how much chi2 rises without each kept zone, or falls with each other one; 0 for nuisances, shape (n,)."""
    best, _ = smallest(model, box, kept)
    found = np.zeros(len(kept))
    for k in np.flatnonzero(box.zones):
        other, _ = smallest(model, box, _without(kept, k) if kept[k] else _with(kept, k))
        found[k] = abs(other - best)
    return found


def probability(rise: Vector) -> Vector:
    """Return how likely a zone is damaged, from the rise of chi2 without it: even at the threshold."""
    return np.asarray(1.0 / (1.0 + np.exp(np.clip((THRESHOLD - rise) / 2.0, -500.0, 500.0))))


def _without(kept: Rows, k: int | np.signedinteger) -> Rows:
    other = kept.copy()
    other[k] = False
    return other


def _with(kept: Rows, k: int | np.signedinteger) -> Rows:
    other = kept.copy()
    other[k] = True
    return other
