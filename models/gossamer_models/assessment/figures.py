"""Figures of merit of verdicts beside the truth.

Symbols: ``n`` records, ``z`` error in units of the stated deviation [1].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from ..arrays import Matrix, Rows, Vector
from ..detector.posterior import WRONG
from ..membrane.mesh import N_ZONES
from .judges import Verdicts
from .proportions import Share, share

CALL = 0.05  # [1] damage that counts as a call
NOMINAL = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)  # central intervals of the reliability diagram


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Figures of one judge under one condition. Not a number where they have no meaning.

    Attributes
    ----------
    records : int
        Records judged.
    error_all, error_damaged : float
        Mean absolute error over all zones and over damaged zones [% damage], invalid answers included.
    valid : Share
        Valid records.
    hits : Share
        Calls among zones damaged by ``CALL`` or more, of all records; a call is a valid estimate above ``CALL``.
    false_calls : Share
        Records with a call in an undamaged zone.
    wrong, wrong_and_invalid : Share
        Records with an error above ``WRONG`` in some zone, and those of them that are marked invalid.
    z_rms, damaged_z_rms : float
        Root mean square of z over all zones and over damaged zones of valid records [1].
    within_95, damaged_within_95 : float
        Share of true values in the stated 95 % interval, over all zones and over damaged zones of valid records [1].
    brier : float
        Mean square of P(damaged) minus truth, over all zones [1].
    """

    records: int
    error_all: float
    error_damaged: float
    valid: Share
    hits: Share
    false_calls: Share
    wrong: Share
    wrong_and_invalid: Share
    z_rms: float
    damaged_z_rms: float
    within_95: float
    damaged_within_95: float
    brier: float


def figures(damage: Matrix, verdicts: Verdicts) -> Figures:
    """Compare verdicts with the truth.

    Parameters
    ----------
    damage : ndarray, shape (n, 16)
        True damage [1].
    verdicts : Verdicts
        Of the same n records.
    """
    error = np.abs(verdicts.damage - damage)
    damaged = damage > 0.0
    called = verdicts.valid[:, None] & (verdicts.damage > CALL)
    wrong = error.max(axis=1) > WRONG
    z = np.abs(scaled_errors(damage, verdicts))
    damaged_z = z[damaged[verdicts.valid].ravel()] if z.size else z
    P = verdicts.probability
    return Figures(
        records=len(damage),
        error_all=100.0 * _mean(error),
        error_damaged=100.0 * _mean(error[damaged]),
        valid=share(verdicts.valid),
        hits=share(called[damage >= CALL]),
        false_calls=share((called & ~damaged).any(axis=1)),
        wrong=share(wrong),
        wrong_and_invalid=share(~verdicts.valid[wrong]),
        z_rms=math.sqrt(_mean(z**2)),
        damaged_z_rms=math.sqrt(_mean(damaged_z**2)),
        within_95=_mean(z <= norm.ppf(0.975)),
        damaged_within_95=_mean(damaged_z <= norm.ppf(0.975)),
        brier=math.nan if P is None else _mean((P - damaged) ** 2),
    )


def largest_calls(verdicts: Verdicts) -> Vector:
    """Return the largest estimate [1] of each record, shape (n,); 0 where it is not valid."""
    return np.asarray(np.where(verdicts.valid, verdicts.damage.max(axis=1), 0.0))


def scores(verdicts: Verdicts) -> Matrix:
    """Return what a call is decided by, shape (n, 16): P(damaged) where it is stated, else the estimate; 0 if not valid.

    An estimate is 0 below P = 1/2, where P still tells a small damage from none.
    """
    stated = verdicts.damage if verdicts.probability is None else verdicts.probability
    return np.asarray(np.where(verdicts.valid[:, None], stated, 0.0))


def scaled_errors(damage: Matrix, verdicts: Verdicts) -> Vector:
    """Return z of all zones of valid records, in a row; empty if no deviation is stated.

    A deviation of 0 gives 0 for the right value and infinity for a wrong one.
    """
    if verdicts.deviation is None:
        return np.empty(0)
    error, deviation = (a[verdicts.valid].ravel() for a in (verdicts.damage - damage, verdicts.deviation))
    return np.divide(error, deviation, out=np.where(error == 0.0, 0.0, np.inf), where=deviation > 0.0)


def reliability(damage: Matrix, verdicts: Verdicts) -> Vector:
    """Return how many damages of valid records lie in the stated central intervals of ``NOMINAL``, shape (11,) [1].

    Undamaged zones do not count: an estimate of 0 with next to no deviation is right in every interval.
    """
    z = np.abs(scaled_errors(damage, verdicts))
    z = z[(damage > 0.0)[verdicts.valid].ravel()] if z.size else z
    return np.array([_mean(z <= norm.ppf(0.5 + nominal / 2.0)) for nominal in NOMINAL])


def confusion(damage: Matrix, verdicts: Verdicts, threshold: float) -> Matrix:
    """Count which zone is called first where one zone is damaged.

    Parameters
    ----------
    damage : ndarray, shape (n, 16)
        True damage [1]; records with none or several damaged zones do not count.
    verdicts : Verdicts
        Of the same n records.
    threshold : float
        Of a call, in ``scores`` [1].

    Returns
    -------
    ndarray, shape (16, 17)
        Records by damaged zone (row) and zone with the largest score (column); the last column counts those without a
        call.
    """
    single = (damage > 0.0).sum(axis=1) == 1
    score = scores(verdicts)
    found = np.where(score.max(axis=1) > threshold, score.argmax(axis=1), N_ZONES)
    counts = np.zeros((N_ZONES, N_ZONES + 1))
    np.add.at(counts, (damage[single].argmax(axis=1), found[single]), 1.0)
    return counts


def _mean(values: Matrix | Vector | Rows) -> float:
    return float(np.mean(values)) if np.size(values) else math.nan
