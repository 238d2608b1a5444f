"""How good a detector is: errors, coverage, false calls and honesty over cases whose damage is known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Matrix

CALL = 0.05  # damage that counts as a call [1]
WRONG = 0.10  # error of a zone that a valid answer must not have [1]
BAND = 1.96  # standard deviations of a 95 % band
THESIS_ERROR = {"all zones": 0.104, "damaged zones": 0.214}  # Table 7.1, its 13 single-damage cases [% damage]


def mean_absolute_errors(actual: ArrayLike, predicted: ArrayLike) -> dict[str, float]:
    """Return the mean absolute error in % damage over all zones and over the damaged zones."""
    truth, estimate = np.asarray(actual, dtype=float), np.asarray(predicted, dtype=float)
    error = 100.0 * np.abs(estimate - truth)
    damaged = truth > 0.0
    return {
        "all zones": float(error.mean()),
        "damaged zones": float(error[damaged].mean()) if damaged.any() else 0.0,
    }


def summarize(truth: Matrix, judged: Mapping[str, Matrix]) -> dict[str, float]:
    """Compare judgements with the truth.

    Parameters
    ----------
    truth : ndarray, shape (n, 16)
        Damage [1].
    judged : mapping of ndarray
        From ``judge_records``.

    Returns
    -------
    dict
        ``all zones`` and ``damaged zones``: mean absolute errors [% damage]. ``in 95 % band``: share of the damaged zones
        within 1.96 standard deviations of the estimate. ``valid``: share of the records. ``false calls``: share of the
        records that are valid and name more than 5 % damage in a zone without any. ``wrong``: share of the records with an
        error above 10 % damage in some zone; ``wrong and valid``: share of these that are valid.
    """
    damage, deviation, valid = judged["damage"], judged["deviation"], judged["valid"] > 0.5
    damaged = truth > 0.0
    error = np.abs(damage - truth)
    wrong = error.max(axis=1) > WRONG
    false = ((damage > CALL) & ~damaged).any(axis=1)
    inside = error <= BAND * deviation
    return mean_absolute_errors(truth, damage) | {
        "in 95 % band": float(inside[damaged].mean()) if damaged.any() else 1.0,
        "valid": float(valid.mean()),
        "false calls": float((false & valid).mean()),
        "wrong": float(wrong.mean()),
        "wrong and valid": float(valid[wrong].mean()) if wrong.any() else 0.0,
    }
