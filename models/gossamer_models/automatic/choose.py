"""The model of a sensor and its compensator, chosen within the training stretch.

The test stretch plays no part, but for the full scale: it is the largest strain of the whole record if it is not given.

Everything is fitted to the earlier part of the training stretch and judged on the later one, at two cuts: the sensor by its
output, then the direct inverse and the compensator by the strain they recover. The winners are fitted to the whole
training stretch.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Rows
from ..fitting.records import Record, strain_range
from ..sensor.fit import PreisachFit, fit_preisach
from .compensators import Method, choose_compensator, equipped
from .sensors import choose_inverse, choose_sensors, sensor_name
from .trials import Bench, Trial, shortened

BUDGET = 60.0  # [s]
SHARES = (0.4, 0.6, 0.9)  # of the budget that have passed when sensor, direct inverse and compensator are chosen

Progress = Callable[[float, str], None]


@dataclass(frozen=True, kw_only=True)
class Chosen:
    """What won, fitted to the whole training stretch.

    Attributes
    ----------
    fit : PreisachFit
        Sensor with its compensator.
    method : Method
        How it compensates.
    trials : tuple of Trial
        Everything that was tried.
    untried : int
        Settings for which there was no time.
    """

    fit: PreisachFit
    method: Method
    trials: tuple[Trial, ...]
    untried: int = 0

    @property
    def text(self) -> str:
        """What won, in words, and by how much."""
        words = []
        for stage, own in (("sensor", sensor_name(self.fit.settings)), ("compensator", self.method.text)):
            here = [trial for trial in self.trials if trial.stage == stage and trial.final]
            error = next((trial.error for trial in here if trial.what == own), float("nan"))
            least = min(trial.error for trial in here)
            of = f"the least of {len(here)} finalists" if len(here) > 1 else "the only finalist"
            rank = of if error <= least else f"{of} is {least:.2f} %"
            words.append(f"{stage}: {own}, with an error of {error:.2f} % of range, {rank}")
        return "; ".join(words)


def choose(
    records: tuple[Record, ...],
    train: tuple[Rows, ...],
    *,
    full_scale: float | None = None,
    rest_resistance: float | None = None,
    budget: float = BUDGET,
    progress: Progress = lambda _share, _text: None,
) -> Chosen:
    """Choose extension, ridge, earlier history, direct inverse and compensator of a sensor, and fit it.

    Parameters
    ----------
    records, train, full_scale, rest_resistance
        See ``fit_preisach``.
    budget : float
        Time [s] after which nothing new is tried; the last fits take a few seconds more.
    progress : callable
        Called with the share of the work that is done [1] and a sentence.

    Returns
    -------
    Chosen
        Sensor, compensator and what was tried.

    Raises
    ------
    DataError
        Nothing could be fitted to the earlier part of the training stretch.
    """
    begin = time.monotonic()
    ends = [begin + share * budget for share in SHARES]
    full_scale = strain_range(records, full_scale)
    given: dict[str, Any] = {"full_scale": full_scale, "rest_resistance": rest_resistance}
    used = [k for k, rows in enumerate(train) if rows.any()]
    whole, rows = _until_the_end_of_training([records[k] for k in used], [train[k] for k in used])
    short, short_rows = shortened(whole, rows)
    bench = Bench(progress)
    sensors = choose_sensors(short, short_rows, bench, until=ends[0], **given)
    inverse = choose_inverse(short, short_rows, bench, until=ends[1], full_scale=full_scale)
    sensors = [replace(settings, inverse=inverse) for settings in sensors]
    method, tracking = choose_compensator(whole, rows, sensors, bench, until=ends[2], **given)
    progress(0.95, "fitting the winner to the whole training stretch")
    fit = fit_preisach(records, train, method.sensor, **given)
    return Chosen(fit=equipped(fit, method, tracking), method=method, trials=tuple(bench.trials), untried=bench.untried)


def _until_the_end_of_training(records: list[Record], train: list[Rows]) -> tuple[tuple[Record, ...], tuple[Rows, ...]]:
    """Return the records up to their last training samples: no trial sees what comes later."""
    ends = [int(np.flatnonzero(rows)[-1]) + 1 for rows in train]
    cropped = tuple(r.at(np.arange(end)) for r, end in zip(records, ends, strict=True))
    return cropped, tuple(rows[:end] for rows, end in zip(train, ends, strict=True))
