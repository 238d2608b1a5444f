"""The model of a sensor and its compensator, chosen within the training stretch.

The test stretch plays no part, but for the full scale: it is the largest strain of the whole record if it is not given.

Everything is fitted to the earlier part of the training stretch and judged on the later one, at two cuts, or, where there
are several records, to all but one and judged on that one: the sensor by its output, then the direct inverse and the
compensator by the strain they recover. The winners are fitted to the whole training stretch.
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Unpack

import numpy as np
from gossamer_files.options import option

from ..arrays import Rows, Vector
from ..errors import DataError
from ..fitting.records import Record, judging_cuts, strain_range, until_the_end_of_training
from ..replay import Recovered, recover_by_fit
from ..self_test import self_test
from ..sensor.artifact import DirectInverse, ErrorModel, Tracking
from ..sensor.fit import PreisachFit, PreisachSettings, fit_preisach
from ..sensor.fit.direct import fit_direct
from ..sensor.fit.preisach import with_direct
from ..sensor.fit.settings import Given
from .sensors import choose_delay, choose_sensors, nothing_fitted, sensor_name
from .trials import Bench, Trial, error_on, shortened

LEAST_ERROR = 3e-3  # [1]: below the spacing of the hypotheses an error would choose among them by chance
APART = 3  # samples over which a rate is taken
RESTING = 0.05  # of the root mean square rate
TURNING = 0.5  # of it: a larger change of rate is a turn
FEWEST, MOST_TURNS = 0.005, 0.05  # [per sample]
OPTIMISM = 1.4  # by which errors grow from the trials, of which the best wins, to records that lie further ahead
SHARED = 0.5  # of the squares of the errors that the constant part of the stated deviation explains
TAIL, WANDER = 4.0, 3.0  # of the filter; SURE and CALM trust its models more
SURE, CALM = 30.0, 1.0
NEAR = 1.1  # of methods whose errors are at most so many times the least one, that listed first wins: less is left to chance
FAILING = 1.5  # times the error: a compensator that fails on its own model is as good as one that is so much worse
BUDGET = 300.0  # [s], a stop: on an idle machine all settings are tried in a fifth of it
SHARES = (0.5, 0.9)  # of the budget that have passed when sensor and compensator are chosen
Progress = Callable[[float, str], None]


def too_short() -> DataError:
    """Return the refusal of a training stretch."""
    text = "the training stretch leaves too few samples to judge a compensator by."
    return DataError(f"{text} Name a longer one ({option('train')}).")


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
    while lag < longest and correlation(lag) > slow / math.e:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """A way to compensate a sensor.

    Attributes
    ----------
    sensor : PreisachSettings
        The sensor.
    name : {"inverse", "estimator", "filter"}
        Method of ``compensator_model``.
    direct : bool
        Whether the direct inverse is used: by itself or, by the filter, as a second measurement.
    tail, wander : float
        Of the filter: ``Tracking.tail``, and the factor of the wander that the records show [1].
    """

    sensor: PreisachSettings
    name: str
    direct: bool
    tail: float = TAIL
    wander: float = WANDER

    @property
    def text(self) -> str:
        """The method in words."""
        if self.name == "inverse" and self.direct:
            return "direct inverse"
        sensor = f"a sensor with {sensor_name(self.sensor)}"
        if self.name != "filter":
            return f"{'exact inverse' if self.name == 'inverse' else 'estimator'} of {sensor}"
        direct = "with" if self.direct else "without"
        trust = "more" if self.tail > TAIL else "less"
        return f"filter of {sensor}, {direct} direct inverse, trusting its models {trust}"

    def numbers(self, base: Tracking) -> Tracking:
        """Return the numbers of the filter from those of a sensor."""
        inverse = base.inverse if self.direct else None
        return replace(base, inverse=inverse, tail=self.tail, wander=base.wander * self.wander)


def choose_compensator(
    records: tuple[Record, ...],
    train: tuple[Rows, ...],
    sensors: Iterable[PreisachSettings],
    bench: Bench,
    inverse: Callable[[int], DirectInverse],
    **given: Unpack[Given],
) -> tuple[Method, Tracking]:
    """Return the compensator whose strain is best, and numbers for the filter with the same sensor.

    One that runs the sensor and does not recover what that sensor gives, see ``self_test``, must be better by ``FAILING``.

    Parameters
    ----------
    records, train : tuple of Record, tuple of ndarray of bool
        Training stretches in full, as the filter works sample by sample.
    sensors : iterable of PreisachSettings
        Sensors to compensate, the best first, with the settings of their direct inverse.
    inverse : callable
        Returns the direct inverse that is fitted to the k-th of ``judging_cuts``.
    bench, **given
        See ``choose_sensors``.

    Raises
    ------
    DataError
        No compensator could be run.
    """
    sensors = tuple(replace(settings, direct_inverse=True) for settings in sensors)

    parts = judging_cuts(train)

    @cache
    def tried(k: int, settings: PreisachSettings) -> tuple[PreisachFit, Tracking]:
        early, late = parts[k]
        fit = with_direct(fit_preisach(records, early, settings, inverse=False, **given), inverse(k))
        return fit, _numbers(fit, train, late)

    def ready(k: int, method: Method) -> PreisachFit:
        fit, base = tried(k, method.sensor)
        return equipped(fit, method, method.numbers(base))

    @cache
    def run(k: int, method: Method) -> tuple[Recovered, ...]:
        return tuple(recover_by_fit(ready(k, method), record, fill=False) for record in records)

    def judge(method: Method) -> float:
        """Return the geometric mean over the cuts: whoever is judged is judged by all, also when time is short."""
        errors = []
        for k, (_, late) in enumerate(parts):
            strains = (each.strain for each in run(k, method))
            errors.append(error_on(strains, (r.strain for r in records), late))
        return float(np.exp(np.mean(np.log(errors))))

    methods = [Method(sensor=sensors[0], name="inverse", direct=True)]
    methods += [Method(sensor=sensor, name="filter", direct=True) for sensor in sensors]
    methods += [Method(sensor=s, name="filter", direct=True, tail=SURE, wander=CALM) for s in sensors]
    plain = (replace(sensor, residual=0) for sensor in sensors if sensor.invertible)  # a network has no exact inverse
    methods += [Method(sensor=s, name=name, direct=False) for s in plain for name in ("inverse", "estimator")]
    found = bench.best("compensator", methods, lambda m: m.text, [judge], share=(0.5, 0.95), surely=2)

    if not found:
        raise nothing_fitted()

    @cache
    def handicap(method: Method) -> float:
        fit = ready(len(parts) - 1, method)
        holds = (method.name == "inverse" and method.direct) or not any(self_test(fit, each).reason for each in records)
        return 1.0 if holds else FAILING

    fair = sorted((error * handicap(m), methods.index(m)) for error, m in found if error <= FAILING * NEAR * found[0][0])
    best = methods[min(place for error, place in fair if error <= NEAR * fair[0][0])]
    # if another method has won, this filter serves whoever builds the FMU filter
    kept = best if best.name == "filter" else Method(sensor=best.sensor, name="filter", direct=best.direct)
    numbers = kept.numbers(tried(len(parts) - 1, best.sensor)[1])
    # what every cut predicts counts alike: one cut may end before what makes the errors large
    ahead = [
        ((found.strain - record.strain)[rows], np.asarray(found.deviation)[rows])
        for k, (_, late) in enumerate(parts)
        for record, found, rows in zip(records, run(k, kept), late, strict=True)
    ]
    errors, stated = (np.concatenate(each) / given["full_scale"] for each in zip(*ahead, strict=True))
    there = np.isfinite(errors)  # the last ones are not delivered before the trial ends
    if not there.any():
        raise too_short()
    return best, calibrated(numbers, errors[there], stated[there])


def equipped(fit: PreisachFit, method: Method, tracking: Tracking | None) -> PreisachFit:
    """Return a fit that has a direct inverse with a compensator; the inverse goes where the method does not use it."""
    artifact = replace(
        fit.artifact,
        inverse=fit.artifact.inverse if method.direct or not fit.artifact.exactly_invertible else None,
        compensator=method.name,
        tracking=tracking,
    )
    return replace(fit, artifact=artifact)


def _numbers(fit: PreisachFit, train: tuple[Rows, ...], late: tuple[Rows, ...]) -> Tracking:
    """Return the numbers of a filter, not yet calibrated."""
    records, full_scale = fit.records, fit.full_scale
    step = float(np.median(np.concatenate([np.diff(r.time) for r in records])))
    output = [(r.resistance - p) / fit.resistance_change for r, p in zip(records, fit.alone, strict=True)]
    strain = [(r.strain - recover_by_fit(fit, r, "inverse").present) / full_scale for r in records]
    times = [r.time[rows] for r, rows in zip(records, train, strict=True)]
    strains = [r.strain[rows] / full_scale for r, rows in zip(records, train, strict=True)]
    of_output, of_inverse = (
        error_model([e[held] for e, held in zip(each, late, strict=True)], step) for each in (output, strain)
    )
    return Tracking(output=of_output, inverse=of_inverse, **motion(times, strains, step))


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
        Time [s] after which nothing new is tried; the last fits take a few seconds more. Whoever tries all gives the same
        answer on a slow machine as on a fast one.
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
    given = Given(full_scale=full_scale, rest_resistance=rest_resistance)
    whole, rows = until_the_end_of_training(records, train)
    short, short_rows = shortened(whole, rows)
    bench = Bench(progress, ends[0])
    sensors = choose_sensors(short, short_rows, bench, **given)
    bench.until = ends[1]

    @cache
    def inverse(k: int, delay: int) -> DirectInverse:
        return fit_direct(whole, judging_cuts(rows)[k][0], full_scale, delay=delay, calibrated=False)

    delay = choose_delay(whole, rows, bench, full_scale, inverse)
    sensors = [replace(settings, delay=delay) for settings in sensors]
    method, tracking = choose_compensator(whole, rows, sensors, bench, lambda k: inverse(k, delay), **given)
    progress(0.95, "fitting the winner to the whole training stretch")
    fit = fit_preisach(records, train, method.sensor, **given)
    return Chosen(fit=equipped(fit, method, tracking), method=method, trials=tuple(bench.trials), untried=bench.untried)
