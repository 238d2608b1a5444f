r"""Which zones are damaged: sets of zones weighed on a quadratic model of chi2.

Symbols: ``n`` unknowns, damages and nuisances; ``d`` moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Matrix, Rows, Vector
from .least_squares import MOST_DAMAGE, Quadratic, bounded_minimum, change

THRESHOLD = 9.0  # of chi2: what a damaged zone must explain in the search
ODDS = 0.1  # of damage in a zone beforehand
EVEN = MOST_DAMAGE / np.sqrt(2.0 * np.pi)  # deviation of a normal density that at its peak is that of any damage
LIKELY = 6.0  # above the worth of the best set of zones: whose neighbours are weighed too
MOST_SETS = 16  # whose neighbours are weighed
NEAR = 25.0  # above it: what the quadratic model may be wrong by where one zone takes the place of another
MOST_RIVALS = 4


@dataclass(frozen=True)
class Box:
    """Unknowns of a quadratic model that are damages, and how far each may move.

    Attributes
    ----------
    zones : ndarray of bool, shape (n,)
        Which unknowns are damages.
    low, high : ndarray, shape (n,)
        Bounds of the moves.
    odds : float or ndarray, shape (n,)
        How likely each damage is beforehand [1].
    """

    zones: Rows
    low: Vector
    high: Vector
    odds: float | Vector = ODDS


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
    worth : ndarray, shape (m,)
        Minus twice the logarithm of the evidence of each set, but for a constant.
    kept : ndarray of bool, shape (m, n)
        Unknowns that are not zero.
    move : ndarray, shape (m, n)
        Where chi2 is smallest with each set.
    """

    worth: Vector
    kept: Rows
    move: Matrix

    @property
    def weight(self) -> Vector:
        """How likely each set is [1], shape (m,)."""
        weight = np.exp((self.worth.min() - self.worth) / 2.0)
        return np.asarray(weight / weight.sum())

    def rivals(self, kept: Rows, box: Box) -> list[int]:
        """Return which sets to look at more closely: no larger than one, and as good as the model can tell; best first."""
        fewer = (self.kept & box.zones).sum(axis=1) <= np.count_nonzero(kept & box.zones)
        near = fewer & (self.worth <= self.worth.min() + NEAR) & (self.kept != kept).any(axis=1)
        order = np.argsort(self.worth, kind="stable")
        return [int(k) for k in order if near[k]][:MOST_RIVALS]

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


def price(model: Quadratic, box: Box, kept: Rows) -> float:
    """Return what a set costs beside its chi2: minus twice the logarithm of its odds and of the share of them that is left.

    By Laplace's approximation, with any damage as likely as any other: a zone that is told to 1 % costs 12, one that is told
    to 10 % costs 7.
    """
    zones = kept & box.zones
    S = model.A[np.ix_(kept, kept)] + np.diag(zones[kept] * EVEN**-2)
    even = ((box.high - box.low) / np.sqrt(2.0 * np.pi) / np.broadcast_to(box.odds, zones.shape))[zones]
    return float(np.linalg.slogdet(S)[1] + 2.0 * np.log(even).sum())


def alternatives(model: Quadratic, box: Box, kept: Rows, known: Sequence[tuple[Rows, float, Vector]] = ()) -> Alternatives:
    """Weigh the sets of zones around a set: with a zone more, with one less, or with another one in place of one.

    Parameters
    ----------
    model : Quadratic
        At the smallest chi2 of the set.
    box : Box
        Damages and bounds.
    kept : ndarray of bool, shape (n,)
        The set, and all nuisances.
    known : sequence of tuple
        Sets whose change of chi2 and move are known better than by the model.

    Notes
    -----
    A set is as likely as exp(-worth / 2), where its worth is the smallest chi2 plus its price. The neighbours of likely sets
    follow, the likeliest first.
    """
    zones, better = np.flatnonzero(box.zones), {each.tobytes(): (chi2, move) for each, chi2, move in known}

    def worth(kept: Rows) -> tuple[float, Rows, Vector]:
        chi2, move = better.get(kept.tobytes()) or smallest(model, box, kept)
        return chi2 + price(model, box, kept), kept, move

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
    return Alternatives(worth=worths, kept=sets, move=moves)
