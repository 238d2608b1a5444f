r"""What histories tell about damages.

Symbols: ``J`` derivatives of one gauge's history, ``sigma`` standard deviation of its noise [1], ``n`` samples, ``I`` Fisher
information of damages and nuisances, ``C`` covariance of the damages.

With white noise and an offset of each gauge whose prior has the deviation ``o``, one gauge gives

.. math:: I = J^T W J,\quad W = \frac{1}{\sigma^2}\Bigl(1 - \frac{o^2}{\sigma^2 + n\,o^2}\,1\,1^T\Bigr),

gauges add up, the nuisances add their prior, and the damages have the covariance
:math:`C = (I_{dd} - I_{dn} I_{nn}^{-1} I_{nd})^{-1}`, which no unbiased estimate is better than.
"""

from __future__ import annotations

import math

import numpy as np
from gossamer_files.options import option
from scipy.special import ndtri

from ..arrays import Matrix, Vector
from ..errors import ParameterError
from ..twin.least_squares import MOST_DAMAGE, PRIOR_DEVIATION
from ..twin.nuisances import OFFSET

FALSE_ALARMS, DETECTED = 0.05, 0.9
THRESHOLD = -float(ndtri(FALSE_ALARMS))  # 1.645 deviations
FACTOR = THRESHOLD + float(ndtri(DETECTED))  # 1.645 + 1.282 deviations
NOTHING_KNOWN = 1e4  # deviation of a damage [1]
STARTS = 24  # first candidates
STEEP = 8  # power of the deviations in the mean that stands for the worst
_BETTER = 1.0 - 1e-9


def weigh(y: Matrix, sigma: float) -> Matrix:
    """Turn histories, shape (..., n), into numbers of variance 1 whose products are those with W."""
    n = y.shape[-1]
    kept = sigma / math.sqrt(sigma**2 + n * OFFSET**2)  # of the mean
    return np.asarray((y - (1.0 - kept) * y.mean(axis=-1, keepdims=True)) / sigma)


def information(J: Matrix, sigma: float) -> Matrix:
    """Return the information that each gauge gives, shape (G, k, k), from derivatives, shape (k, G, n)."""
    weighed = weigh(J, sigma)
    return np.asarray(np.einsum("agn,bgn->gab", weighed, weighed, optimize=True))


def covariance(total: Matrix, zones: int, known: float = NOTHING_KNOWN) -> Matrix:
    """Return the covariance of the damages, shape (..., zones, zones).

    Parameters
    ----------
    total : ndarray, shape (..., k, k)
        Information of all gauges.
    zones : int
        Damages; the other unknowns are nuisances in units of their prior.
    known : float
        Deviation [1] of the damages beforehand.
    """
    prior = np.r_[np.full(zones, known**-2), np.ones(total.shape[-1] - zones)]
    full = total + np.diag(prior)
    scale = 1.0 / np.sqrt(np.einsum("...aa->...a", full))
    scaled = full * scale[..., None, :] * scale[..., :, None]
    inverse = np.linalg.inv(scaled) * scale[..., None, :] * scale[..., :, None]
    return np.asarray(inverse[..., :zones, :zones])  # the inverse of the Schur complement


def deviations(total: Matrix, zones: int, known: float = NOTHING_KNOWN) -> Vector:
    """Return the standard deviations of the damages [1], shape (..., zones); infinite where round-off hides them."""
    variance = np.einsum("...aa->...a", covariance(total, zones, known))
    return np.sqrt(np.where(variance > 0.0, variance, np.inf))


def smallest_damage(deviation: Vector) -> Vector:
    """Return the damage [1] that a one-sided test at 5 % false alarms finds in 90 % of cases, at most 0.95."""
    return np.asarray(np.minimum(FACTOR * deviation, MOST_DAMAGE))


def weakest(total: Matrix, zones: int) -> tuple[float, Vector]:
    """Return the combination of damages that is known least, its largest part 1, and the deviation of its size [1]."""
    variance, modes = np.linalg.eigh(covariance(total, zones, PRIOR_DEVIATION))
    v = modes[:, -1] / modes[np.argmax(np.abs(modes[:, -1])), -1]
    return float(np.sqrt(variance[-1] / (v @ v))), v


def choose(I: Matrix, zones: int, count: int, starts: int = STARTS) -> list[int]:
    """Choose candidates one by one, then exchange them one by one while the worst zone gains.

    Parameters
    ----------
    I : ndarray, shape (G, k, k)
        Information of each candidate.
    zones : int
        Damages among the unknowns.
    count : int
        How many to choose.
    starts : int
        How many first candidates are tried.

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
        advice = f"Change {option('count')} or {option('points')}."
        msg = f"choose 1 to {len(I)} sensors among {len(I)} candidates, not {count}. {advice}"
        raise ParameterError(msg)
    firsts = np.argsort(_mean(_with_each(I, [], zones)), kind="stable")[:starts]
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
