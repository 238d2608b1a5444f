"""Choose how small densities and amplitudes are preferred to be: by predicting the training stretch's later parts.

Test stretches are not looked at. Every training stretch is cut into ``PARTS``; from the first half on, each part is
predicted by a fit to all parts before it, as the test stretch will be by a fit to the whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import DataError
from .model import preisach_model
from .records import Record
from .settings import FitSettings
from .solve import Watch, solve
from .stretches import Stretch, moves, prepare, strain_range

RIDGES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
PARTS = 4

Rows = tuple[NDArray[np.bool_], ...]


def choose_ridge(
    records: tuple[Record, ...],
    train: Rows,
    settings: FitSettings,
    *,
    full_scale: float | None = None,
    rest_output: float | None = None,
    watch: Watch | None = None,
) -> FitSettings:
    """Return settings with the ridge that predicts best, the same for densities and relaxation.

    Parameters
    ----------
    records, train, settings, full_scale, rest_output, watch
        See ``fit_preisach``; only training samples are used. Every trial fit has one start.

    Returns
    -------
    FitSettings
        ``ridge`` and ``relaxation_ridge`` chosen among ``RIDGES``; nothing else is changed.

    Raises
    ------
    DataError
        A training stretch is too short to be cut, or its first half never moves.
    """
    once = replace(settings, starts=1, auto_ridge=False)
    unit, spectrum, stretches = prepare(records, train, once, strain_range(records, full_scale))
    rest = None if rest_output is None else rest_output / unit
    errors = []
    for number, ridge in enumerate(RIDGES):
        trial = replace(once, ridge=ridge, relaxation_ridge=ridge)
        squares: list[float] = []
        for fitted, held in _forward(train):
            if not any(moves(s.strain[rows]) for s, rows in zip(stretches, fitted, strict=True)):
                msg = "the strain rests in the first half of the training stretch, so no ridge can be chosen. Give one."
                raise DataError(msg)
            parts = tuple(replace(s, train=rows) for s, rows in zip(stretches, fitted, strict=True))
            model = preisach_model(trial, spectrum, parts, rest)
            weights = model.weights(solve(model, parts, trial)[1][0].x)
            squares += [float(e) for s, rows in zip(parts, held, strict=True) for e in _off(s, weights, rows) ** 2]
        errors.append(float(np.mean(squares)))
        if watch is not None:
            watch(f"ridge {ridge:g}, predicted within the training stretch", number + 1, 100.0 * np.sqrt(errors[-1]))
    best = RIDGES[int(np.argmin(errors))]
    return replace(settings, ridge=best, relaxation_ridge=best, auto_ridge=False)


def _off(stretch: Stretch, weights: NDArray[np.float64], rows: NDArray[np.bool_]) -> NDArray[np.float64]:
    return np.asarray(stretch.A[rows] @ weights - stretch.output[rows], dtype=float)


def _forward(train: Rows) -> Iterator[tuple[Rows, Rows]]:
    """Cut the training samples of every record in time order; return what to fit and what to predict."""
    for k in range(PARTS // 2, PARTS):
        pairs = [_cut(rows, k) for rows in train]
        yield tuple(fit for fit, _ in pairs), tuple(held for _, held in pairs)


def _cut(rows: NDArray[np.bool_], k: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    ends = np.array_split(np.flatnonzero(rows), PARTS)
    fitted, held = np.zeros_like(rows), np.zeros_like(rows)
    fitted[np.concatenate(ends[:k])] = True
    held[ends[k]] = True
    return fitted, held
