"""Choice of the sensor's settings by its output, and of its direct inverse's by the strain it gives."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Unpack

from gossamer_files.options import option

from ..arrays import Rows
from ..errors import DataError, require
from ..fitting.records import Record, judging_cuts
from ..sensor import DirectInverse
from ..sensor.drives import EXTENSIONS
from ..sensor.fit import PreisachSettings, fit_preisach
from ..sensor.fit.direct import recovered
from ..sensor.fit.preisach import residual_steps
from ..sensor.fit.settings import Given
from .trials import Bench, error_on

FIRST_RIDGE, RIDGES = 3e-3, (3e-2, 1e-3, 3e-4, 5e-5)
DELAYS, WORTH = (0, 6, 24), 1.05  # of a direct inverse [samples]; times the least error: more delay is not worth less
SHORT = 0.1  # of the training samples of a record, by which a strain may be late
COMPARABLE = 1.25  # times the least error: a sensor that predicts worse is not taken for the sake of its compensator
KINDS = 2  # sensors of different extensions that go on to the choice of the compensator


def nothing_fitted() -> DataError:
    """Return the refusal of a training stretch to which no model could be fitted."""
    advice = f"Name a longer one ({option('train')}), or a model ({option('model')})."
    text = "no model could be fitted to the earlier part of the training stretch, so none can be chosen."
    return DataError(f"{text} {advice}")


def choose_sensors(
    records: tuple[Record, ...], train: tuple[Rows, ...], bench: Bench, **given: Unpack[Given]
) -> list[PreisachSettings]:
    """Return the settings of the sensor that predict best, and the best ones with another extension.

    Parameters
    ----------
    records, train : tuple of Record, tuple of ndarray of bool
        Training stretches, see ``trials.shortened``.
    bench : Bench
        Where settings are tried.
    **given
        See ``Given``.

    Raises
    ------
    DataError
        Nothing could be fitted.
    """

    def judge(part: tuple[tuple[Rows, ...], tuple[Rows, ...]], settings: PreisachSettings) -> float:
        early, late = part
        fit = fit_preisach(records, early, settings, inverse=False, **given)
        require(
            fit.settles, f"over many cycles the output of a sensor with {sensor_name(settings)} does not settle", DataError
        )
        return error_on(fit.predicted, (r.resistance for r in records), late)

    judges = [partial(judge, part) for part in judging_cuts(train)]
    ask = partial(bench.best, "sensor", name=sensor_name, judges=judges)
    kinds = product(reversed(EXTENSIONS), (True, False))
    found = ask([_hats(extension, earlier, FIRST_RIDGE) for extension, earlier in kinds], share=(0.0, 0.2))
    if not found:
        raise nothing_fitted()
    best = _of_different_kinds(found)
    found += ask([_hats(s.extension, s.earlier, ridge) for s in best for ridge in RIDGES], share=(0.2, 0.4))
    corrected: list[PreisachSettings] = []
    for sensor in _of_different_kinds(found):
        bench.progress(0.4, f"steps of a residual network of {sensor_name(sensor)}")
        if time.monotonic() < bench.until or not corrected:
            corrected.append(replace(sensor, residual=residual_steps(records, train, sensor, **given)))
    found += ask([sensor for sensor in corrected if sensor.residual], share=(0.4, 0.4))
    return _of_different_kinds(found)


def choose_delay(
    records: tuple[Record, ...],
    train: tuple[Rows, ...],
    bench: Bench,
    full_scale: float,
    fitted: Callable[[int, int], DirectInverse],
) -> int:
    """Return by how many samples the strain of the direct inverse is delayed: the fewest of those that are about as good.

    ``fitted`` returns the inverse of the k-th of ``judging_cuts`` with a delay; see ``choose_sensors``.
    """
    parts = judging_cuts(train)

    def judge(k: int, delay: int) -> float:
        strains = [full_scale * recovered(fitted(k, delay), record)[:, 0] for record in records]
        return error_on(strains, (r.strain for r in records), parts[k][1])

    judges = [partial(judge, k) for k in range(len(parts))]
    longest = SHORT * min(int(rows.sum()) for rows in train)
    delays = [delay for delay in DELAYS if delay <= longest]
    found = bench.best("direct inverse", delays, inverse_name, judges, share=(0.4, 0.5), surely=len(delays))
    return min((delay for error, delay in found if error <= WORTH * found[0][0]), default=0)


def sensor_name(s: PreisachSettings) -> str:
    """Return the settings of a sensor in words."""
    network = f", residual network of {s.residual} steps" if s.residual else ""
    return f"{_relaxation_name(s.extension, earlier=s.earlier)}, ridge {s.density_ridge:g}{network}"


def inverse_name(delay: int) -> str:
    """Return the settings of a direct inverse in words."""
    return f"strain delayed by {delay} samples"


def _relaxation_name(extension: str | None, *, earlier: bool | None) -> str:
    named = "no extension" if extension in (None, "none") else f"extension {extension}"
    return f"{named}, earlier relaxation" if earlier else named


def _of_different_kinds(found: list[tuple[float, PreisachSettings]]) -> list[PreisachSettings]:
    """Return the best settings, and the best ones of another extension if they predict almost as well."""
    best: dict[str, PreisachSettings] = {}
    ordered = sorted(found, key=lambda pair: pair[0])
    for error, settings in ordered:
        if error <= COMPARABLE * ordered[0][0]:
            best.setdefault(settings.extension, settings)
    return list(best.values())[:KINDS]


def _hats(extension: str, earlier: bool, ridge: float) -> PreisachSettings:
    return PreisachSettings.of("preisach-hats", extension=extension, earlier=earlier, ridge=ridge, starts=1)
