"""Trials of settings by forward validation: fitted to the earlier part of the training stretch, judged on the later one.

The stretch is cut in time order; for many trial fits long records are thinned.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from ..arrays import Rows, Vector
from ..errors import GossamerError
from ..fitting.records import Record, thin

MOST_TRIED = 4000  # samples of all records of a trial fit
SEEDED = 5  # settings that every judge sees
Setting = TypeVar("Setting")


def shortened(records: Sequence[Record], train: Sequence[Rows]) -> tuple[tuple[Record, ...], tuple[Rows, ...]]:
    """Return records that have too many samples for many trial fits thinned, and their training samples."""
    short = thin(records, MOST_TRIED)
    return short, tuple(np.isin(s.lines, r.lines[rows]) for s, r, rows in zip(short, records, train, strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One setting that was tried.

    Attributes
    ----------
    stage : str
        What was chosen there: sensor, direct inverse or compensator.
    what : str
        The setting.
    error : float
        NRMSE [% of range] on the later part of the training stretch; not a number where the fit failed.
    seconds : float
        Time it took [s].
    final : bool
        Whether it was judged by every cut.
    """

    stage: str
    what: str
    error: float
    seconds: float
    final: bool = True


@dataclass
class Bench:
    """Where settings are tried, until the time is over.

    Attributes
    ----------
    progress : callable
        Called with the share of the work that is done [1] and a sentence.
    until : float
        Time of ``time.monotonic`` after which no further setting is tried.
    trials : list of Trial
        What was tried so far.
    untried : int
        Settings for which there was no time.
    """

    progress: Callable[[float, str], None]
    until: float
    trials: list[Trial] = field(default_factory=list)
    untried: int = 0

    def best(
        self,
        stage: str,
        settings: Iterable[Setting],
        name: Callable[[Setting], str],
        judges: Sequence[Callable[[Setting], float]],
        *,
        share: tuple[float, float],
        surely: int = 1,
    ) -> list[tuple[float, Setting]]:
        """Try settings and return errors [% of range] and settings that every judge saw, the best first.

        Parameters
        ----------
        stage, settings : str, iterable
            What is chosen, and what to try.
        name, judges : callable
            Name of a setting, and its errors [% of range] by one or more cuts of the training stretch. All settings face
            the first judge, the ``SEEDED`` best ones the others too; the geometric mean counts, so that no cut rules.
        share : tuple of float
            Progress [1] before and after.
        surely : int
            Number of the first settings that are tried however late it is.
        """
        waiting = list(settings)
        spent = dict.fromkeys(range(len(waiting)), 0.0)
        logs: dict[int, list[float]] = {}

        def ask(number: int, judge: Callable[[Setting], float]) -> None:
            begin = time.monotonic()
            with suppress(GossamerError):
                error = judge(waiting[number])
                logs.setdefault(number, []).append(float(np.log(error)))
            spent[number] += time.monotonic() - begin

        for number, setting in enumerate(waiting):
            if number >= surely and time.monotonic() > self.until and any(np.isfinite(log[0]) for log in logs.values()):
                self.untried += len(waiting) - number
                break
            self.progress(share[0] + (share[1] - share[0]) * number / len(waiting), f"{stage}: {name(setting)}")
            ask(number, judges[0])
        ranked = sorted((n for n, log in logs.items() if np.isfinite(log[0])), key=lambda n: logs[n][0])
        for judge in judges[1:]:
            for place, number in enumerate(ranked[:SEEDED]):
                if place and time.monotonic() > self.until and any(len(log) == len(judges) for log in logs.values()):
                    break
                ask(number, judge)
        full = [n for n in ranked if len(logs[n]) == len(judges) and np.isfinite(logs[n]).all()]
        full.sort(key=lambda n: float(np.mean(logs[n])))
        for number in spent:
            if number in logs or spent[number]:
                error = float(np.exp(np.mean(logs[number]))) if number in logs else float("nan")
                final = number in full
                self.trials.append(
                    Trial(stage=stage, what=name(waiting[number]), error=error, final=final, seconds=spent[number])
                )
        return [(float(np.exp(np.mean(logs[number]))), waiting[number]) for number in full]


def error_on(predicted: Iterable[Vector], measured: Iterable[Vector], rows: Iterable[Rows]) -> float:
    """Return the root mean square error [% of range] of some samples, but for those that are not a number.

    Every record counts by its own range, one at rest by the largest of the others.
    """
    three = list(zip(predicted, measured, rows, strict=True))
    largest = max(float(np.ptp(m)) for _, m, _ in three)
    squares = [((p - m)[held] / (np.ptp(m) or largest)) ** 2 for p, m, held in three]
    told = np.concatenate(squares)
    return 100.0 * float(np.sqrt(np.mean(told[np.isfinite(told)]))) if np.isfinite(told).any() else np.inf
