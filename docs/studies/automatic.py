"""Measured records with the defaults: what `gossamer identify` chooses, beside its rivals."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gossamer_models.automatic import choose
from gossamer_models.automatic.compare import cubic, networks, regression
from gossamer_models.fitting import Record, e1, nrmse
from gossamer_models.replay import predict_resistance, recover_by_fit
from gossamer_models.sensor.fit import PreisachFit, PreisachSettings, fit_preisach
from numpy.typing import NDArray

from .measured import measured_records
from .preisach import THESIS
from .specimen import specimen_record

# record, part that is fitted [1], NRMSE targets [% of range] of output and recovered strain on the rest
PLANS: tuple[tuple[str, float, float | None, float | None], ...] = (
    ("strain_sin_20", 0.5, 1.5, 1.2),
    ("strain_sin_30", 0.5, None, None),
    ("strain_triangular", 0.5, None, None),
    ("strain_mixed_15_25", 0.5, None, None),
    ("velocity_profile_7_5wt", 0.6, 0.5, 1.4),
    ("velocity_profile_10wt", 0.6, None, None),
    ("random_sawtooth_7_5wt", 0.6, 3.5, 13.0),
)


@dataclass(frozen=True, kw_only=True)
class DefaultRow:
    """Errors of the defaults and of their rivals on the test stretch of one record.

    Attributes
    ----------
    name, chosen : str
        Of the record; compensator and sensor that were chosen.
    forward, strain : dict of str to float
        NRMSE [% of range] of output and strain by model; the first one is ours.
    ratio : float or None
        Root mean square error over the root mean square of the stated deviation [1]; None if none is stated.
    seconds : float
        Time of the choice [s].
    forward_target, strain_target : float or None
        Targets [% of range].
    """

    name: str
    chosen: str
    forward: dict[str, float]
    strain: dict[str, float]
    ratio: float | None
    seconds: float
    forward_target: float | None = None
    strain_target: float | None = None


@dataclass(frozen=True, kw_only=True)
class SpecimenRow:
    """E1 [%] of one way to identify the SYNTHETIC specimen from 0..200 s of its Dataset-1; time [s].

    Attributes
    ----------
    name : str
        The way.
    first, second : float
        On Dataset-1 and, at twice the strain and rate, on Dataset-2.
    target : float or None
        The thesis' error on its Dataset-2.
    seconds : float
        Time of the fit.
    """

    name: str
    first: float
    second: float
    target: float | None
    seconds: float


def run_on_specimen() -> list[SpecimenRow]:
    """Identify the specimen with the thesis' model, with the residual network on it, and by the automatic choice."""
    first, second = specimen_record(1), specimen_record(2)
    given: dict[str, Any] = {"full_scale": float(second.strain.max()), "rest_resistance": 0.0}
    ways: dict[str, tuple[Callable[[], PreisachFit], float | None]] = {}
    for M in (5, 7):
        for residual in (0, "auto"):
            settings = PreisachSettings.of("preisach", modes=M, relaxations=M, residual=residual)
            name = f"M = P = {M}{', residual network' if residual else ''}"
            ways[name] = partial(fit_preisach, (first,), (first.time < 200.0,), settings, **given), THESIS[M][1]
    ways["auto"] = (lambda: choose((first,), (first.time < 200.0,), **given).fit), None
    rows = []
    for name, (identify, target) in ways.items():
        begin = time.monotonic()
        fit = identify()
        seconds = time.monotonic() - begin
        errors = [e1(r.resistance, predict_resistance(fit, r), rest=0.0) for r in (first, second)]
        rows.append(SpecimenRow(name=name, first=errors[0], second=errors[1], target=target, seconds=seconds))
    return rows


def run_automatic(data: Path) -> list[DefaultRow]:
    """Choose a sensor for every measured record, and fit the rivals to the same stretch."""
    records = measured_records(data)
    return [default_row(records[name], part, *targets) for name, part, *targets in PLANS]


def default_row(
    record: Record, part: float, forward_target: float | None = None, strain_target: float | None = None
) -> DefaultRow:
    """Choose a sensor for the beginning of a record."""
    train = np.arange(record.time.size) < round(part * record.time.size)
    begin = time.monotonic()
    chosen = choose((record,), (train,), full_scale=1.0 if record.strain.max() > 0.9 else None)
    seconds = time.monotonic() - begin
    found = recover_by_fit(chosen.fit, record)
    R, strain, test = record.resistance, record.strain, ~train
    ratio = None
    if found.deviation is not None:
        ratio = float(np.sqrt(np.mean((found.strain - strain)[test] ** 2) / np.mean(found.deviation[test] ** 2)))

    def errors(ours: NDArray[np.float64], u: NDArray[np.float64], y: NDArray[np.float64]) -> dict[str, float]:
        of = (record,), (u,), (y,), (train,)
        delay = found.late(record) if y is strain else 0
        (static,), (moving,) = networks(*of, delay)
        models = {"defaults": ours, "cubic": cubic(*of[1:])[0], "ridge on lags": regression(*of, delay)[0]}
        models |= {"perceptron 32-16": static, "recurrent network of 12": moving}
        return {name: nrmse(y[test], values[test], float(np.ptp(y))) for name, values in models.items()}

    return DefaultRow(
        name=Path(record.name).stem,
        chosen=chosen.method.text,
        forward=errors(chosen.fit.predicted[0], strain, R),
        strain=errors(found.strain, R, strain),
        ratio=ratio,
        seconds=seconds,
        forward_target=forward_target,
        strain_target=strain_target,
    )
