"""Fit a fractional model of Chapter 3 to records as they are read: samples may be uneven, rest and range unknown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..fractional import FractionalFit, FractionalSettings, UniformRecord, identify_fractional, predict
from ..fractional.artifact import ModelName
from .quality import alike
from .records import Record
from .stretches import check_rest, strain_range

Vector = NDArray[np.float64]

REST = 0.01  # of full scale and of the output's range: what counts as unstrained and as another output at rest
UNEVEN = 0.01  # of the median step: steps that differ by more are worth a remark


@dataclass(frozen=True, kw_only=True)
class FractionalChoice:
    """A fractional model and how to fit it.

    Attributes
    ----------
    model : {"model-1", "sub-model-1", "sub-model-2"}
        See ``FractionalArtifact``.
    settings : FractionalSettings
        The range of times of its memory is widened to what the records need.
    """

    model: ModelName
    settings: FractionalSettings


def fit_fractional(
    records: Sequence[Record],
    train: Sequence[NDArray[np.bool_]],
    choice: FractionalChoice,
    *,
    full_scale: float | None = None,
    rest_output: float | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[FractionalFit, tuple[Vector, ...], tuple[str, ...]]:
    """Fit one sensor to one or several records; arguments as of ``fit_preisach``.

    Returns
    -------
    fit : FractionalFit
        Model, parameters and covariance.
    predicted : tuple of ndarray
        Output at the times of every record.
    doubts : tuple of str
        What was assumed and what the data do not determine, one sentence each.

    Raises
    ------
    DataError
        The records cannot be fitted: too short, constant, or beyond full scale.
    """
    check_rest(rest_output)
    scale = strain_range(tuple(records), full_scale)
    even = [_even(record, rows, rest_output) for record, rows in zip(records, train, strict=True)]
    settings = replace(
        choice.settings,
        shortest=min(choice.settings.shortest, *(each.sampling_step for each in even)),
        longest=max(choice.settings.longest, *(each.sampling_step * each.strain.size for each in even)),
    )
    fit = identify_fractional(even, choice.model, settings, progress, full_scale=scale)
    predicted = tuple(
        np.interp(
            record.time,
            each.sampling_step * np.arange(each.strain.size),
            predict(fit.artifact, each.strain, each.sampling_step),
        )
        for record, each in zip(records, even, strict=True)
    )
    doubts = [_uneven(record, each) for record, each in zip(records, even, strict=True)]
    if rest_output is None:
        doubts += [_rest(record, fit.artifact.rest_resistance, scale) for record in records]
    doubts += [*fit.warnings, alike(tuple(fit.parameters), fit.covariance, "Take fewer terms if the numbers matter.")]
    if choice.model != "sub-model-1":
        doubts.append(
            f"The fractional {choice.model} needs the whole record and serves offline only: no FMU can be built from it. "
            "Identify fractional-sub-model-1 for one."
        )
    return fit, predicted, tuple(filter(None, doubts))


def _even(record: Record, rows: NDArray[np.bool_], rest_output: float | None) -> UniformRecord:
    fitted = record.time[rows]
    return UniformRecord.resampled(
        record.time,
        record.strain,
        record.output,
        train=(float(fitted[0]), float(fitted[-1])),
        rest_resistance=rest_output,
        weight=record.weight,
        name=record.name,
    )


def _rest(record: Record, fitted: float, full_scale: float) -> str:
    """Say where the fitted output at rest and an unstrained first sample disagree; empty where they do not."""
    first = float(record.output[0])
    if record.strain[0] > REST * full_scale or abs(first - fitted) <= REST * float(np.ptp(record.output)):
        return ""
    return (
        f"{record.name} begins unstrained with an output of {first:.6g}, the fit puts the output at rest at {fitted:.6g}. "
        "If the sensor had rested, give the resistance at rest."
    )


def _uneven(record: Record, even: UniformRecord) -> str:
    """Say what equal steps cost; empty where the record has them."""
    steps = np.diff(record.time)
    if np.ptp(steps) <= UNEVEN * float(np.median(steps)):
        return ""
    back = np.interp(record.time, even.sampling_step * np.arange(even.strain.size), even.strain)
    moved = 100.0 * float(np.abs(back - record.strain).max() / np.ptp(record.strain))
    return (
        f"{record.name}: samples {steps.min():.3g} to {steps.max():.3g} s apart were brought to steps of "
        f"{even.sampling_step:.3g} s, which moves the strain by up to {moved:.2g} % of its range."
    )
