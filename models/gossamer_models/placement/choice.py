"""Choose gauges so that the worst zone is as well known as can be.

Symbols: ``I`` information of each candidate, shape (G, k, k).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Matrix, Vector
from ..errors import ParameterError
from ..twin.twin import PRIOR_DEVIATION
from .information import deviations

STARTS = 24  # first candidates
STEEP = 8  # power of the deviations in the mean that stands for the worst
_BETTER = 1.0 - 1e-9


def choose(I: Matrix, zones: int, count: int) -> list[int]:
    """Choose candidates one by one, then exchange them one by one while the worst zone gains.

    Parameters
    ----------
    I : ndarray, shape (G, k, k)
        Information of each candidate.
    zones : int
        Damages among the unknowns.
    count : int
        How many to choose.

    Returns
    -------
    list of int
        In the order of choice.

    Raises
    ------
    ParameterError
        There are fewer candidates.

    Notes
    -----
    A few gauges tell little of the worst zone wherever they are, so the first are chosen by a steep mean of all zones, with
    the prior that the twin has of a damage: any from 0 to 95 %. Exchanges go by the worst zone alone. They end where no
    single one helps, so the best of several ends is taken, each from another of the best first candidates.
    """
    if not 1 <= count <= len(I):
        msg = f"choose 1 to {len(I)} sensors among {len(I)} candidates, not {count}. Change --count or --points."
        raise ParameterError(msg)
    firsts = np.argsort(_mean(_with_each(I, [], zones)), kind="stable")[:STARTS]
    ends = [_exchanged(I, zones, _greedy(I, zones, int(first), count)) for first in firsts]
    return min(ends, key=lambda end: end[1])[0]


def _greedy(I: Matrix, zones: int, first: int, count: int) -> list[int]:
    kept = [first]
    while len(kept) < count:
        kept.append(int(np.argmin(_mean(_with_each(I, kept, zones)))))
    return kept


def _exchanged(I: Matrix, zones: int, kept: list[int]) -> tuple[list[int], float]:
    """Exchange candidates one by one while the worst zone gains; return them and the deviation of that zone."""
    worst = float(_with_each(I, kept[:-1], zones)[kept[-1]].max())
    gained = True
    while gained:
        gained = False
        for place in range(len(kept)):
            each = _with_each(I, kept[:place] + kept[place + 1 :], zones).max(axis=1)
            if each.min() < _BETTER * worst:
                kept[place], worst, gained = int(each.argmin()), float(each.min()), True
    return kept, worst


def _with_each(I: Matrix, kept: list[int], zones: int) -> Matrix:
    """Return the deviations with each candidate beside those kept, shape (G, zones); infinite for those kept."""
    found = deviations(I + I[kept].sum(axis=0), zones, PRIOR_DEVIATION)
    found[kept] = np.inf
    return found


def _mean(deviation: Matrix) -> Vector:
    return np.asarray(np.mean(deviation**STEEP, axis=1))
