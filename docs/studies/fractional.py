"""Fits for chapter 3: the fractional models on the SYNTHETIC specimen, and what limits each of them.

Fitted to 0..200 s of Dataset-1 and to nothing else: restraint and signs are chosen by fitting the first cycle and
predicting the second, both of the fitted stretch. The model is then evaluated, as it stands, on the whole of Dataset-1
(to 400 s) and on Dataset-2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from gossamer_models.fractional import (
    FractionalArtifact,
    FractionalFit,
    FractionalSettings,
    UniformRecord,
    identify_fractional,
    integral,
    misfit,
)
from gossamer_models.fractional.artifact import MODELS, ModelName
from gossamer_models.measures import e1
from gossamer_models.specimen import dataset

from .specimen import uniform_record

THESIS = {  # error [%] on Dataset-1 and Dataset-2, Tables 3.1 and 3.2, by model and number of fractional terms
    ("model-1", 3): (1.4539, 5.1200),
    ("sub-model-1", 3): (0.9970, 19.1000),
    ("sub-model-2", 3): (0.7121, 4.1100),
    ("model-1", 5): (1.0190, 3.0141),
    ("sub-model-1", 5): (0.7110, 17.0019),
    ("sub-model-2", 5): (0.6101, 3.0100),
}
CANDIDATES = tuple(
    FractionalSettings(restraint=restraint, nonnegative=nonnegative)
    for nonnegative in (True, False)
    for restraint in (1e-2, 3e-2, 1e-1, 3e-1)
)


@dataclass(frozen=True, kw_only=True)
class TableRow:
    """One row of Table 3.1 or 3.2.

    Attributes
    ----------
    model : str
        Which fractional model.
    settings : FractionalSettings
        Of the fit, with the number of terms.
    fit : FractionalFit
        To 0..200 s of Dataset-1.
    errors : tuple of float
        E1 [%] on the whole of Dataset-1 and on Dataset-2.
    """

    model: ModelName
    settings: FractionalSettings
    fit: FractionalFit
    errors: tuple[float, float]

    @property
    def n_terms(self) -> int:
        """Number of fractional terms."""
        return self.settings.n_terms

    @property
    def thesis(self) -> tuple[float, float]:
        """E1 [%] of the thesis on Dataset-1 and Dataset-2, on measurements that are not published."""
        return THESIS[self.model, self.n_terms]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What no fit can go below, as E1 [%], with five terms of any sign and hardly any restraint.

    Attributes
    ----------
    noise : tuple of float
        Of the measurement noise alone, on Dataset-1 and Dataset-2.
    fitted : dict
        By model: fitted to 0..200 s of Dataset-1 and evaluated there.
    informed : dict
        By model: fitted to all of Dataset-1 and evaluated there.
    with_square : float
        On 0..200 s, of the terms of sub-model-1 as fitted there and one more, the square of strain: what the fitted
        error of the models that are linear in strain is made of.
    doubling : float
        Of Dataset-2 predicted as twice the noise-free Dataset-1: its strain is twice that of Dataset-1 up to 200 s,
        so this is what a model that is linear in strain and causal reaches if it is perfect on Dataset-1.
    model_1_informed : tuple of float
        Of model-1 fitted to all of Dataset-1 and Dataset-2 at once, each weighted by its range: what the family can do.
        The rest of its error on Dataset-2 is extrapolation from 7.5 % strain to 15 %.
    """

    noise: tuple[float, float]
    fitted: dict[str, float]
    informed: dict[str, float]
    with_square: float
    doubling: float
    model_1_informed: tuple[float, float]


def run_fractional() -> tuple[list[TableRow], dict[str, FractionalFit]]:
    """Return the rows of Tables 3.1 and 3.2 and, by model, the fits to Dataset-3."""
    record = uniform_record(1)
    rows = [
        fit_row(model, settings_by_hold_out(record, model, [replace(each, n_terms=n) for each in CANDIDATES]))
        for n in (3, 5)
        for model in MODELS
    ]
    return rows, repeat_on_dataset_3(rows)


def fit_row(model: ModelName, settings: FractionalSettings) -> TableRow:
    """Fit one model to 0..200 s of Dataset-1 and evaluate it on both datasets."""
    first, second = uniform_record(1), uniform_record(2)
    fit = identify_fractional([first], model, settings)
    errors = (misfit(fit.artifact, first).e1, misfit(fit.artifact, second).e1)
    return TableRow(model=model, settings=settings, fit=fit, errors=errors)


def settings_by_hold_out(
    record: UniformRecord, model: ModelName, candidates: Sequence[FractionalSettings]
) -> FractionalSettings:
    """Return the settings that predict the second half of the stretch for fitting best from its first half."""
    begin, end, _ = record.train.indices(record.strain.size)
    middle = (begin + end) // 2
    half = replace(record, train=slice(begin, middle))

    def held_out(settings: FractionalSettings) -> float:
        return misfit(identify_fractional([half], model, settings).artifact, record, slice(middle, end)).e1

    return min(candidates, key=held_out)


def repeat_on_dataset_3(rows: Sequence[TableRow]) -> dict[str, FractionalFit]:
    """Fit each model with its most terms, and the settings of its row, to two cycles of the SYNTHETIC Dataset-3."""
    most = max(row.n_terms for row in rows)
    record = uniform_record(3)
    return {row.model: identify_fractional([record], row.model, row.settings) for row in rows if row.n_terms == most}


def limits(starts: int = 4) -> Limits:
    """Return what limits the fractional models on the SYNTHETIC datasets, from fits with that many starts."""
    one, two = dataset(1), dataset(2)
    first = uniform_record(1)
    whole, other = (
        replace(each, train=slice(None), weight=float(np.ptp(each.resistance)) ** -2.0)
        for each in (first, uniform_record(2))
    )
    loose = FractionalSettings(restraint=1e-4, nonnegative=False, starts=starts)
    fitted = {model: identify_fractional([first], model, loose) for model in MODELS}
    n = two.time.size
    twice = 2.0 * (one.noise_free[:n] - one.rest_resistance)
    both = identify_fractional([whole, other], "model-1", replace(loose, restraint=1e-3)).train
    return Limits(
        noise=(
            e1(one.resistance, one.noise_free, rest=one.rest_resistance),
            e1(two.resistance, two.noise_free, rest=two.rest_resistance),
        ),
        fitted={model: fit.train[0].e1 for model, fit in fitted.items()},
        informed={model: identify_fractional([whole], model, loose).train[0].e1 for model in MODELS},
        with_square=_with_square(first, fitted["sub-model-1"].artifact),
        doubling=e1(two.noise_free, two.rest_resistance + twice, rest=two.rest_resistance),
        model_1_informed=(both[0].e1, both[1].e1),
    )


def _with_square(record: UniformRecord, artifact: FractionalArtifact) -> float:
    """Return what the terms of sub-model-1 leave where the square of strain joins them, E1 [%]."""
    s = record.strain / artifact.full_scale_strain
    terms = [integral(s, record.sampling_step, term.order) for term in artifact.terms]
    X = np.column_stack([s, *terms, s**2])[record.train]
    change = (record.resistance - artifact.rest_resistance)[record.train]
    return e1(change, X @ np.linalg.lstsq(X, change, rcond=None)[0], rest=0.0)
