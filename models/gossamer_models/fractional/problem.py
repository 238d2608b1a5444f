r"""The least squares problem of a fractional model on some records, and the meaning of its solution.

Symbols: :math:`\theta` orders, rates and exponents, ``c`` coefficients of the columns; ``A``, ``B`` coefficients of a term
on the strain and on its quadrature.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..errors import DataError
from ..fitting.records import Record, check_rest, in_equal_steps, strain_range
from ..fitting.separable import Derivative, SeparableProblem
from .artifact import FadingTerm, FractionalArtifact, FractionalTerm
from .columns import RecordColumns
from .settings import FractionalSettings


@dataclass(frozen=True)
class FractionalProblem:
    r"""A problem to solve.

    Attributes
    ----------
    settings : FractionalSettings
        Model and bounds; the range of times of the memory covers the records.
    separable : SeparableProblem
        Residuals over :math:`\theta`, with the coefficients eliminated.
    full_scale : float
        Strain [1] that the model's strain is measured in.
    scale : float
        Range [ohm] that residuals are measured in.
    rest_resistance : float
        Resistance [ohm] that changes are counted from.
    rest_fitted : bool
        Whether a constant among the columns corrects it.
    """

    settings: FractionalSettings
    separable: SeparableProblem
    full_scale: float
    scale: float
    rest_resistance: float
    rest_fitted: bool

    def artifact(self, theta: Vector) -> FractionalArtifact:
        """Return the model of a point with its best coefficients."""
        c, s = self.separable.coefficients(theta), self.settings
        return FractionalArtifact(
            model=s.model,
            direct=float(c[0]),
            terms=_terms(theta, c, s),
            fading=_fading_terms(theta, c[s.first_fading :], s),
            full_scale_strain=self.full_scale,
            resistance_change=self.scale,
            rest_resistance=self.rest_resistance + (self.scale * float(c[-1]) if self.rest_fitted else 0.0),
            shortest=s.shortest,
            longest=s.longest,
        )


def prepare(
    records: tuple[Record, ...],
    train: tuple[Rows, ...],
    settings: FractionalSettings,
    full_scale: float | None,
    rest_resistance: float | None,
) -> FractionalProblem:
    """Make records ready to be fitted; arguments as of ``fit_fractional``.

    Raises
    ------
    DataError
        The records cannot be fitted: too short, constant, or beyond full scale.
    """
    check_rest(rest_resistance)
    full_scale = strain_range(records, full_scale)
    even, rows = zip(*(in_equal_steps(*pair) for pair in zip(records, train, strict=True)), strict=True)
    steps = [float(r.time[1] - r.time[0]) for r in even]
    settings = replace(
        settings,
        shortest=min(settings.shortest, *steps),
        longest=max(settings.longest, *(h * r.time.size for h, r in zip(steps, even, strict=True))),
    )
    for record, kept in zip(even, rows, strict=True):
        _check(record, kept, settings)
    fitted = rest_resistance is None
    rest = float(even[0].resistance[0]) if rest_resistance is None else rest_resistance
    changes = [(r.resistance - rest)[kept] for r, kept in zip(even, rows, strict=True)]
    scale = max(float(np.ptp(change)) for change in changes)
    columns = [
        RecordColumns(r.strain / full_scale, h, kept, settings, rest_fitted=fitted)
        for r, h, kept in zip(even, steps, rows, strict=True)
    ]
    weights = np.concatenate([np.full(part.size, r.weight) for part, r in zip(changes, records, strict=True)])
    separable = _separable(columns, np.concatenate(changes) / scale, weights, settings, rest_fitted=fitted)
    return FractionalProblem(settings, separable, full_scale, scale, rest, fitted)


def _separable(
    columns: list[RecordColumns], y: Vector, weights: Vector, settings: FractionalSettings, *, rest_fitted: bool
) -> SeparableProblem:
    def evaluate(theta: Vector) -> tuple[Matrix, Callable[[], list[Derivative]]]:
        parts = [each.evaluate(theta) for each in columns]

        def derive() -> list[Derivative]:
            of_all = zip(*(derivatives for _, derivatives in parts), strict=True)
            return [(of_each[0][0], np.vstack([slope for _, slope in of_each])) for of_each in of_all]

        return np.vstack([Phi for Phi, _ in parts]), derive

    # with C_k >= 0, b_k in -1..1 leaves the sine parts free, and b_k in -2..0 the cosine parts
    nonnegative = np.full(columns[0].count, settings.nonnegative)
    if settings.model != "sub-model-1":
        first = 1 if settings.model == "model-1" else 1 + settings.terms
        nonnegative[first : first + settings.terms] = False
    restrained = np.ones(nonnegative.size, dtype=bool)
    if rest_fitted:
        nonnegative[-1] = restrained[-1] = False
    return SeparableProblem(
        evaluate,
        y,
        weights=weights,
        nonnegative=nonnegative,
        restraint=settings.restraint,
        restrained=restrained,
    )


def _terms(theta: Vector, c: Vector, settings: FractionalSettings) -> tuple[FractionalTerm, ...]:
    """Return coefficients and phases, the phases within the bounds of the model."""
    N = settings.terms
    A, B = c[1 : 1 + N], np.zeros(N) if settings.model == "sub-model-1" else c[1 + N : 1 + 2 * N]
    sign = np.where((B if settings.model == "model-1" else A) < 0.0, -1.0, 1.0)
    phases = 2.0 / np.pi * np.arctan2(-sign * B, sign * A) + 0.0  # no negative zero
    return tuple(
        FractionalTerm(coefficient=float(C), order=float(a), phase=float(b))
        for C, a, b in zip(sign * np.hypot(A, B), theta, phases, strict=False)
    )


def _fading_terms(theta: Vector, c: Vector, settings: FractionalSettings) -> tuple[FadingTerm, ...]:
    p, q = np.split(theta[settings.terms :], 2)
    return tuple(
        FadingTerm(coefficient=float(C), rate=float(rate), exponent=float(exponent))
        for C, rate, exponent in zip(c, p, q, strict=False)
    )


def _check(record: Record, rows: Rows, settings: FractionalSettings) -> None:
    strain, resistance = record.strain[rows], record.resistance[rows]
    n_parameters = 1 + 3 * (settings.terms + settings.n_fading)
    problem = None
    if strain.size < 2 * n_parameters:
        problem = f"{strain.size} samples are too few for up to {n_parameters} parameters: give twice as many"
    elif not (np.ptp(strain) > 0.0 and np.ptp(resistance) > 0.0):
        problem = "strain or resistance is constant in the training stretch"
    if problem is not None:
        msg = f"cannot fit {record.name!r}: {problem}."
        raise DataError(msg)
