r"""Which zones are damaged: sets of zones weighed on a quadratic model of chi2.

Symbols: ``n`` unknowns, damages and nuisances; ``d`` moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Matrix, Rows, Vector
from .least_squares import Quadratic, bounded_minimum, change

THRESHOLD = 9.0  # of chi2: what a damaged zone must explain
LIKELY = 6.0  # of chi2 above the best set of zones: whose neighbours are weighed too
MOST_SETS = 16  # whose neighbours are weighed


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
        costs = {k: smallest(model, box, kept & (np.arange(len(kept)) != k)) for k in np.flatnonzero(kept & box.zones)}
        if not costs:
            return kept, move
        k = min(costs, key=lambda zone: costs[zone][0])
        if costs[k][0] - best >= THRESHOLD:
            return kept, move
        best, move = costs[k]
        kept[k] = False


@dataclass(frozen=True)
class Alternatives:
    """Sets of damaged zones that a record explains about as well as the one that was found.

    Attributes
    ----------
    weight : ndarray, shape (m,)
        How likely each set is [1].
    kept : ndarray of bool, shape (m, n)
        Unknowns that are not zero.
    move : ndarray, shape (m, n)
        Where chi2 is smallest with each set.
    """

    weight: Vector
    kept: Rows
    move: Matrix

    @property
    def probability(self) -> Vector:
        """How likely each unknown is not zero [1], shape (n,)."""
        return np.asarray(self.weight @ self.kept)

    @property
    def best(self) -> tuple[Rows, Vector]:
        """The likeliest set, shape (n,), and the move to its smallest chi2, shape (n,)."""
        k = int(np.argmax(self.weight))
        return self.kept[k], self.move[k]

    @property
    def spread(self) -> Matrix:
        """Mean products of the moves [1], shape (n, n): what not knowing the set adds to a covariance."""
        return np.asarray(self.move.T @ (self.weight[:, None] * self.move))


def alternatives(model: Quadratic, box: Box, kept: Rows) -> Alternatives:
    """Weigh the sets of zones around a set: with a zone more, with one less, or with another one in place of one.

    Parameters
    ----------
    model : Quadratic
        At the smallest chi2 of the set.
    box : Box
        Damages and bounds.
    kept : ndarray of bool, shape (n,)
        The set, and all nuisances.

    Notes
    -----
    A set is as likely as exp(-worth / 2), where its worth is the smallest chi2 plus the threshold for each zone: a zone is
    even at the threshold. The neighbours of likely sets follow, the likeliest first.
    """
    zones = np.flatnonzero(box.zones)

    def worth(kept: Rows) -> tuple[float, Rows, Vector]:
        chi2, move = smallest(model, box, kept)
        return chi2 + THRESHOLD * np.count_nonzero(kept & box.zones), kept, move

    found, waiting = {kept.tobytes(): worth(kept)}, {kept.tobytes()}
    for _ in range(MOST_SETS):
        best = min(each[0] for each in found.values())
        nearest = min(waiting, key=lambda key: found[key][0], default=None)
        if nearest is None or found[nearest][0] > best + LIKELY:
            break
        waiting.remove(nearest)
        around = found[nearest][1]
        for k in zones:
            for j in (k, *zones[(zones > k) & (around[zones] != around[k])]):
                other = around.copy()
                other[[j, k]] = ~around[[j, k]]
                if other.tobytes() in found:
                    continue
                each = worth(other)
                if np.all((model.at + each[2])[other & box.zones] > 0.0):  # else it is a smaller set
                    found[other.tobytes()] = each
                    waiting.add(other.tobytes())
    worths, sets, moves = (np.array(each) for each in zip(*found.values(), strict=True))
    weight = np.exp((worths.min() - worths) / 2.0)
    return Alternatives(weight=weight / weight.sum(), kept=sets, move=moves)
