"""Choice of the sensor's settings by its output, and of its direct inverse's by the strain it gives."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Unpack

import numpy as np
from gossamer_files.options import option

from ..arrays import Rows, Vector
from ..errors import DataError, require
from ..fitting.records import Record
from ..sensor.drives import EXTENSIONS
from ..sensor.fit import PreisachSettings, fit_preisach
from ..sensor.fit.preisach import inverse_settings, residual_steps, turn
from ..sensor.fit.regression import prepare
from ..sensor.fit.settings import Given, InverseSettings
from .trials import FITTED, Bench, cut, error_on

FIRST_RIDGE, RIDGES = 3e-3, (3e-2, 1e-3, 3e-4, 5e-5)
INVERSE_RIDGES, MORE_INVERSE_RIDGES = (1e-1, 1e-3), (3e-1, 1e-2, 1e-4, 1e-5)
INVERSE_KNOTS = (4, 9)
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
        Training stretches, see ``split.shortened``.
    bench : Bench
        Where settings are tried.
    **given
        See ``Given``.

    Raises
    ------
    DataError
        Nothing could be fitted.
    """

    def judge(share: float, settings: PreisachSettings) -> float:
        early, late = cut(train, share)
        fit = fit_preisach(records, early, settings, inverse=False, **given)
        require(
            fit.settles, f"over many cycles the output of a sensor with {sensor_name(settings)} does not settle", DataError
        )
        return error_on(fit.predicted, (r.resistance for r in records), late)

    judges = [partial(judge, share) for share in FITTED]
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


def choose_inverse(records: tuple[Record, ...], train: tuple[Rows, ...], bench: Bench, full_scale: float) -> InverseSettings:
    """Return the settings of a direct inverse that gives the best strain; see ``choose_sensors``.

    Notes
    -----
    What was still relaxing when a record began is fitted, but not counted when the strain is judged: the inverse that runs
    later cannot know it.
    """
    sensor = _hats("none", earlier=False, ridge=FIRST_RIDGE)

    def judge(share: float, how: InverseSettings) -> float:
        early, late = cut(train, share)
        turned = turn(prepare(records, early, sensor, full_scale).stretches, 0.0, 1.0)
        settings = inverse_settings(turned, replace(sensor, inverse=how))
        fit = fit_preisach(turned.records, turned.train, settings, full_scale=1.0)
        strains: list[Vector] = [np.clip(strain * full_scale, 0.0, full_scale) for strain in fit.alone]
        return error_on(strains, (r.strain for r in records), late)

    ask: Callable[..., list[tuple[float, InverseSettings]]] = partial(
        bench.best, "direct inverse", name=inverse_name, judges=[partial(judge, share) for share in FITTED]
    )
    # where time is short only the first is tried: without earlier relaxation, the safer one on the measured records
    kinds = product(("reversing", "falling"), (False, True), INVERSE_RIDGES)
    found = ask([InverseSettings(extension=x, earlier=e, ridge=r) for x, e, r in kinds], share=(0.4, 0.5))
    for changes, share in (
        ([{"ridge": ridge} for ridge in MORE_INVERSE_RIDGES], (0.5, 0.6)),
        ([{"knots": knots} for knots in INVERSE_KNOTS], (0.6, 0.7)),
    ):
        if not found:
            return InverseSettings()
        found += ask([replace(found[0][1], **change) for change in changes], share=share)
        found.sort(key=lambda pair: pair[0])
    return found[0][1]


def sensor_name(s: PreisachSettings) -> str:
    """Return the settings of a sensor in words."""
    network = f", residual network of {s.residual} steps" if s.residual else ""
    return f"{_relaxation_name(s.extension, earlier=s.earlier)}, ridge {s.density_ridge:g}{network}"


def inverse_name(how: InverseSettings) -> str:
    """Return the settings of a direct inverse in words."""
    return f"{_relaxation_name(how.extension, earlier=how.earlier)}, {how.knots} knots, ridge {how.ridge:g}"


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
