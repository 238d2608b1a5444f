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
from .records import LARGEST_STRAIN, Record
from .regressors import relaxed, switched
from .settings import FitSettings

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

LEAST_SAMPLES = 50
EARLIER_PER_DECADE = 2.0
LEAST_MOVE = 0.01  # of full scale
OPPOSED = 0.5  # correlation of strain and output below which, with a minus, they are of opposite sign


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
    unit = _check(records, train, full_scale)
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


def _check(records: tuple[Record, ...], train: tuple[NDArray[np.bool_], ...], full_scale: float) -> float:
    """Return the range of the fitted output; refuse training stretches that tell nothing of a sensor."""
    pairs = [(r, rows) for r, rows in zip(records, train, strict=True) if rows.any()]
    where = ", ".join(f"{r.name}, lines {r.lines[rows][0]} to {r.lines[rows][-1]}" for r, rows in pairs)
    count = sum(int(rows.sum()) for _, rows in pairs)
    if count < LEAST_SAMPLES:
        msg = f"{where or 'nowhere'}: {count} samples to fit, need {LEAST_SAMPLES} or more. Name a longer training stretch."
        raise DataError(msg)
    if not any(moves(r.strain[rows] / full_scale) for r, rows in pairs):
        msg = (
            f"{where}: in the training stretch the strain moves by less than {100.0 * LEAST_MOVE:g} % of full scale. "
            "Name one with loading."
        )
        raise DataError(msg)
    unit = float(np.ptp(np.concatenate([r.output[rows] for r, rows in pairs])))
    if not unit > 0.0:
        msg = f"{where}: the output stands still throughout the training stretch. Name one in which it changes."
        raise DataError(msg)
    strain = np.concatenate([r.strain[rows] - r.strain[rows].mean() for r, rows in pairs])
    output = np.concatenate([r.output[rows] - r.output[rows].mean() for r, rows in pairs])
    correlation = float(strain @ output) / float(np.linalg.norm(strain) * np.linalg.norm(output))
    if correlation < -OPPOSED:
        msg = (
            f"{where}: the output falls as strain rises, their correlation is {correlation:.2f}; the model's output rises. "
            "Give it with its sign changed."
        )
        raise DataError(msg)
    return unit


def moves(strain: Vector) -> bool:
    """Tell whether a normalised strain [1] moves enough to show anything of a sensor."""
    return strain.size > 0 and bool(np.ptp(strain) > LEAST_MOVE)


def strain_range(records: tuple[Record, ...], full_scale: float | None) -> float:
    """Return the full scale [1], the largest strain if none is given; refuse strain outside it."""
    if full_scale is None:
        return max(float(r.strain.max()) for r in records)
    if not 0.0 < full_scale <= LARGEST_STRAIN:
        msg = (
            f"the full scale is {full_scale:g}; give the strain at the end of the range as a ratio [1], 0.2 for 20 %, or "
            "none"
        )
        raise DataError(msg)
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


def check_rest(rest_output: float | None) -> None:
    """Refuse an output at rest that is none."""
    if rest_output is not None and not np.isfinite(rest_output):
        msg = f"the output at rest is {rest_output:g}; give a finite number, or none to fit it"
        raise DataError(msg)


def earlier_rates(spectrum: Spectrum) -> Vector:
    """Return the decay rates [1/s] of what may still relax when a record begins."""
    low, high = np.log10(spectrum.rates[[0, -1]])
    low, high = low + 1.2, high - 0.7
    return np.logspace(low, high, max(2, round((high - low) * EARLIER_PER_DECADE) + 1))


def earlier_output(settings: FitSettings, spectrum: Spectrum, stretch: Stretch, weights: Vector) -> Vector:
    """Return what relaxation from before its record adds to a stretch, shape (m,), by the weights of all columns."""
    first = settings.n_lines * (settings.n_lines + 1)
    if settings.relaxations:
        first += len(settings.drives) * spectrum.rates.size
    return np.asarray(stretch.A[:, first:-1] @ weights[first:-1], dtype=float)
