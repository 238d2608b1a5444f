"""Tables 3.1 and 3.2 of the thesis beside the same models on the SYNTHETIC specimen, and what limits each of them.

Fitted to 0..200 s of Dataset-1 and to nothing else: restraint and signs are chosen by fitting the first cycle and
judging the second, both of the fitted stretch. Then judged, as the model stands, on the whole of Dataset-1 (to 400 s)
and on Dataset-2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..measures import e1
from ..specimen import Dataset, dataset
from .artifact import MODELS, FractionalArtifact, ModelName
from .identify import FractionalFit, identify_fractional
from .operators import integral
from .records import Misfit, UniformRecord, misfit
from .settings import FractionalSettings

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
class AssessmentRow:
    """One model with one number of terms.

    Attributes
    ----------
    model, n_terms : str, int
        Which one.
    thesis : tuple of float
        Its errors on Dataset-1 and Dataset-2 [%], on measurements that are not published.
    fitted, dataset_1, dataset_2 : Misfit
        On 0..200 s and 0..400 s of Dataset-1, and on Dataset-2.
    fit : FractionalFit
        Model, parameters, covariance, wall time.
    settings : FractionalSettings
        What the hold-out chose.
    """

    model: ModelName
    n_terms: int
    thesis: tuple[float, float]
    fitted: Misfit
    dataset_1: Misfit
    dataset_2: Misfit
    fit: FractionalFit
    settings: FractionalSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What no fit can go below, as E1 [%] (see ``Misfit``), with five terms of any sign and hardly any restraint.

    Attributes
    ----------
    noise : tuple of float
        Of the measurement noise alone, on Dataset-1 and Dataset-2.
    fitted : dict
        Model to what it comes to on 0..200 s of Dataset-1, fitted to that and judged on that.
    informed : dict
        Model to what it comes to on all of Dataset-1, fitted to all of it.
    with_square : float
        On 0..200 s, of the terms of sub-model-1 as fitted there and one more, the square of strain: what the fitted
        error of the models that are linear in strain is made of.
    doubling : float
        Of Dataset-2 predicted as twice the noise-free Dataset-1: its strain is twice that of Dataset-1 up to 200 s,
        so this is what a model that is linear in strain and causal reaches if it is perfect on Dataset-1.
    model_1_informed : tuple of float
        Of model-1 fitted to all of Dataset-1 and Dataset-2 at once, each weighed by its range: what the family can do.
        The rest of its error on Dataset-2 is extrapolation from 7.5 % strain to 15 %.
    """

    noise: tuple[float, float]
    fitted: dict[str, float]
    informed: dict[str, float]
    with_square: float
    doubling: float
    model_1_informed: tuple[float, float]


def record_of(data: Dataset) -> UniformRecord:
    """Return a SYNTHETIC dataset as a record with its stretch for fitting."""
    return UniformRecord(
        strain=data.strain,
        resistance=data.resistance,
        sampling_step=float(data.time[1] - data.time[0]),
        rest_resistance=data.rest_resistance,
        train=data.train,
        name=data.name,
    )


def assess_fractional(
    n_terms: tuple[int, ...] = (3, 5), progress: Callable[[str], None] = lambda _: None
) -> tuple[AssessmentRow, ...]:
    """Fit and judge all three models.

    Parameters
    ----------
    n_terms : tuple of int
        Numbers of fractional terms, of 3 (Table 3.1) and 5 (Table 3.2).
    progress : callable
        Told what is being fitted.

    Returns
    -------
    tuple of AssessmentRow
        In the order of the tables.
    """
    first, second = record_of(dataset(1)), record_of(dataset(2))
    rows = []
    for n in n_terms:
        for model in MODELS:
            settings = choose(first, model, tuple(replace(each, n_terms=n) for each in CANDIDATES))
            fit = identify_fractional([first], model, settings)
            progress(f"{model}, {n} terms: {fit.train[0].e1:.2f} % fitted, {fit.seconds:.1f} s")
            rows.append(
                AssessmentRow(
                    model=model,
                    n_terms=n,
                    thesis=THESIS[model, n],
                    fitted=fit.train[0],
                    dataset_1=misfit(fit.artifact, first),
                    dataset_2=misfit(fit.artifact, second),
                    fit=fit,
                    settings=settings,
                )
            )
    return tuple(rows)


def choose(record: UniformRecord, model: ModelName, candidates: tuple[FractionalSettings, ...]) -> FractionalSettings:
    """Return the settings that predict the second half of the stretch for fitting best from its first half."""
    begin, end, _ = record.train.indices(record.strain.size)
    middle = (begin + end) // 2
    half = replace(record, train=slice(begin, middle))

    def held_out(settings: FractionalSettings) -> float:
        return misfit(identify_fractional([half], model, settings).artifact, record, slice(middle, end)).e1

    return min(candidates, key=held_out)


def limits(starts: int = 4) -> Limits:
    """Return what limits the fractional models on the SYNTHETIC datasets, from fits with that many starts."""
    one, two = dataset(1), dataset(2)
    first = record_of(one)
    whole, other = (
        replace(each, train=slice(None), weight=float(np.ptp(each.resistance)) ** -2.0)
        for each in (first, record_of(two))
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
