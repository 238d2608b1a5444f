"""Numbers of the filter of strain from records: how strain moves, and how far predictions within training are off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from gossamer_files.options import option

from ..arrays import Rows, Vector
from ..errors import DataError
from ..sensor.tracking import ErrorModel, Tracking

LEAST_ERROR = 3e-3  # [1]: below the spacing of the hypotheses an error would choose among them by chance
APART = 3  # samples over which a rate is taken
RESTING = 0.05  # of the root mean square rate
TURNING = 0.5  # of it: a larger change of rate is a turn
FEWEST, MOST_TURNS = 0.005, 0.05  # [per sample]


def too_short() -> DataError:
    """Return the refusal of a training stretch."""
    text = "the training stretch leaves too few samples to judge a compensator by."
    return DataError(f"{text} Name a longer one ({option('train')}).")


OPTIMISM = 1.4  # by which errors grow from the trials, of which the best wins, to records that lie further ahead
SHARED = 0.5  # of the squares of the errors that the constant part of the stated deviation explains


def error_model(errors: Sequence[Vector], step: float) -> ErrorModel:
    """Return the error model of successive errors [1] of some stretches, samples ``step`` [s] apart.

    Raises
    ------
    DataError
        There are too few samples.

    Notes
    -----
    The difference of neighbours gives the white part, what remains of the mean square the slow part, and the lag at which
    the autocorrelation has fallen to 1/e its time.
    """
    errors = [e for e in errors if e.size > 2 * APART]
    if not errors:
        raise too_short()
    count = sum(e.size for e in errors)

    def correlation(lag: int) -> float:
        return sum(float(e[lag:] @ e[: e.size - lag]) for e in errors if e.size > lag) / count

    white = sum(float(np.sum(np.diff(e) ** 2)) for e in errors) / (2.0 * count)
    slow = max(correlation(0) - white, LEAST_ERROR**2)
    lag, longest = 1, max(e.size for e in errors) // 3
    while lag < longest and correlation(lag) > slow / np.e:
        lag += max(1, lag // 10)
    return ErrorModel(white=max(float(np.sqrt(white)), LEAST_ERROR), slow=float(np.sqrt(slow)), time=lag * step)


def motion(times: Sequence[Vector], strains: Sequence[Vector], step: float) -> dict[str, float]:
    """Return rate, hold, turns and wander of ``Tracking`` from normalised strains [1], shape (m,), at times [s]."""
    rates = [(s[APART:] - s[:-APART]) / (t[APART:] - t[:-APART]) for t, s in zip(times, strains, strict=True)]
    changes = [np.abs(v[APART:] - v[:-APART]) / np.sqrt(APART) for v in rates]
    v, change = np.concatenate(rates), np.concatenate(changes)
    typical = float(np.sqrt(np.mean(v**2)))
    moving = np.abs(v) > RESTING * typical
    turns = float(np.mean(np.concatenate([np.diff((c > TURNING * typical).astype(int)) > 0 for c in changes])))
    calm = np.where(change > TURNING * typical, 0.0, change)
    wander = max(float(np.sqrt(np.mean(calm**2))), 0.01 * typical)
    return {
        "rate": float(np.median(np.abs(v[moving]))),
        "hold": min(1.0 - float(moving.mean()), 0.98),
        "turns": min(max(turns, FEWEST), MOST_TURNS) / step,
        "wander": wander / float(np.sqrt(step)),
    }


def calibrated(tracking: Tracking, errors: Vector, stated: Vector) -> Tracking:
    """Return the numbers with a deviation that suits the errors [1] of strain in trials; ``stated`` was it before [1].

    Notes
    -----
    It is ``OPTIMISM`` times as large as these errors; the factor was chosen on four of the measured records. Half of the
    mean square goes to the constant part, half to the scatter of the hypotheses.
    """
    squares = max(float(np.mean(errors**2)), 1e-10) * OPTIMISM**2
    scatter = np.maximum(stated**2 - tracking.floor**2, 1e-12) / tracking.factor**2
    factor = float(np.sqrt((1.0 - SHARED) * squares / np.mean(scatter)))
    return replace(tracking, factor=factor, floor=float(np.sqrt(SHARED * squares)))


def held_errors(errors: Sequence[Vector], rows: Sequence[Rows]) -> list[Vector]:
    """Return the errors on some samples of every record."""
    return [e[held] for e, held in zip(errors, rows, strict=True) if held.any()]
