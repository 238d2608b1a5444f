r"""Make records ready to be fitted: normalised, in the range of the model, each with its matrix.

Symbols: ``s`` strain over full scale [1]; ``A`` the matrix of ``regressors.py`` for all coefficients of ``model.py``:
cells switched up, cells switched down, modes per drive, what was relaxing before each record began, offset.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import DataError
from .densities import Spectrum
from .records import Record
from .regressors import relaxed, switched
from .settings import FitSettings

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

LEAST_SAMPLES = 50
EARLIER_PER_DECADE = 2.0


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A record made ready: normalised, with its matrix and the samples to fit.

    Attributes
    ----------
    record : Record
        As read.
    strain, output : ndarray, shape (m,)
        Strain over full scale [1]; output over the range of what is fitted [1].
    A : ndarray, shape (m, K)
        Matrix of ``f``.
    train : ndarray of bool, shape (m,)
        Samples to fit.
    """

    record: Record
    strain: Vector
    output: Vector
    A: Matrix
    train: NDArray[np.bool_]


def prepare(
    records: tuple[Record, ...], train: tuple[NDArray[np.bool_], ...], settings: FitSettings, full_scale: float
) -> tuple[float, Spectrum, tuple[Stretch, ...]]:
    """Return the range of the fitted output, the decay rates of the relaxation and the records made ready."""
    fitted = [r.output[rows] for r, rows in zip(records, train, strict=True)]
    count = sum(part.size for part in fitted)
    unit = float(np.ptp(np.concatenate(fitted))) if count else 0.0
    if count < LEAST_SAMPLES or not unit > 0.0:
        msg = f"{count} samples to fit, output range {unit:g}: need {LEAST_SAMPLES} or more of a changing output"
        raise DataError(msg)
    shortest = min(float(np.median(np.diff(r.time))) for r in records)
    longest = max(float(np.ptp(r.time[rows])) for r, rows in zip(records, train, strict=True) if rows.any())
    spectrum = Spectrum.over(shortest, longest)
    stretches = []
    for k, (r, rows) in enumerate(zip(records, train, strict=True)):
        s = np.clip(r.strain / full_scale, 0.0, 1.0)
        up, down = switched(s, settings.n_lines)
        columns = [up, -down]
        if settings.relaxations:
            columns.append(relaxed(r.time, s, spectrum.rates, settings.drives))
        if settings.earlier:
            decays = np.exp(-np.outer(r.time - r.time[0], earlier_rates(spectrum)))
            columns += [decays * (k == j) for j in range(len(records)) if train[j].any()]
        columns.append(np.ones((s.size, 1)))
        stretches.append(Stretch(record=r, strain=s, output=r.output / unit, A=np.hstack(columns), train=rows))
    return unit, spectrum, tuple(stretches)


def strain_range(records: tuple[Record, ...], full_scale: float | None) -> float:
    """Return the full scale [1], the largest strain if none is given; refuse strain outside it."""
    largest = max(float(r.strain.max()) for r in records)
    if full_scale is None:
        return largest
    for r in records:
        beyond = np.flatnonzero((r.strain > full_scale) | (r.strain < 0.0))
        if beyond.size:
            k = int(beyond[0])
            msg = (
                f"{r.name}, line {r.lines[k]}: strain {r.strain[k]:g} is outside 0 to full scale {full_scale:g}. Raise the "
                "full scale or leave the samples out."
            )
            raise DataError(msg)
    return full_scale


def earlier_rates(spectrum: Spectrum) -> Vector:
    """Return the decay rates [1/s] of what may still relax when a record begins."""
    low, high = np.log10(spectrum.rates[[0, -1]])
    low, high = low + 1.2, high - 0.7
    return np.logspace(low, high, max(2, round((high - low) * EARLIER_PER_DECADE) + 1))
