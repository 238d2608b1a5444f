r"""One model on some records: a separable problem, and what its solution means.

Symbols: ``A``, ``B`` linear coefficients of a term on the strain and on its quadrature, :math:`A = C\cos(\pi b/2)`,
:math:`B = -C\sin(\pi b/2)`; ``J`` Jacobian of the residuals by the thesis' parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .artifact import FadingTerm, FractionalArtifact, FractionalTerm, ModelName
from .columns import Columns
from .kernels import ModeGrid
from .problem import SeparableProblem
from .records import UniformRecord
from .settings import FractionalSettings

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
LEAST_SINGULAR = 1e-12  # of a Jacobian with columns of unit length: below, a direction counts as not determined
AT_BOUND = 1e-6  # of the width of the box


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One fitted number: value, standard error, and whether the data determine it."""

    value: float
    standard_error: float
    determined: bool


class ModelFit:
    """One model on some records: the problem to solve, and what its solution means."""

    def __init__(
        self,
        records: Sequence[UniformRecord],
        model: ModelName,
        settings: FractionalSettings,
        full_scale: float | None = None,
    ) -> None:
        self._model, self._settings = model, settings
        largest = max(float(np.abs(record.strain).max()) for record in records)
        self.full_scale = largest if full_scale is None else full_scale
        known = records[0].rest_resistance
        self._offset, self._rest = known is None, float(records[0].resistance[0]) if known is None else known
        rests = [self._rest if record.rest_resistance is None else record.rest_resistance for record in records]
        changes = [(record.resistance - rest)[record.train] for record, rest in zip(records, rests, strict=True)]
        self.scale = max(float(np.ptp(change)) for change in changes)
        N, L = settings.n_terms, settings.n_fading if model == "model-1" else 0
        grid = ModeGrid(settings.shortest, settings.longest)
        columns = [
            Columns(
                record.strain / self.full_scale,
                record.sampling_step,
                record.train,
                model,
                N,
                L,
                grid,
                offset=self._offset,
            )
            for record in records
        ]
        self._first_fading = columns[0].first_fading
        box = [settings.orders] * N + [settings.rates] * L + [settings.exponents] * L
        self.box = np.array([low for low, _ in box]), np.array([high for _, high in box])
        # With C_k >= 0, b_k in -1..1 leaves the sine parts free, and b_k in -2..0 the cosine parts.
        nonnegative = np.full(columns[0].n_columns, settings.nonnegative)
        if model != "sub-model-1":
            first = 1 if model == "model-1" else 1 + N
            nonnegative[first : first + N] = False
        restrained = np.ones(nonnegative.size, dtype=bool)
        if self._offset:
            nonnegative[-1] = restrained[-1] = False
        self.problem = SeparableProblem(
            columns,
            [change / self.scale for change in changes],
            [record.weight for record in records],
            nonnegative,
            settings.restraint,
            restrained,
        )

    def artifact(self, theta: Vector) -> FractionalArtifact:
        """Return the model of a point, with its best coefficients; terms by order, fading integrals by rate."""
        N = self._settings.n_terms
        _, _, c = self.problem.solve(theta)
        A, B = c[1 : 1 + N], np.zeros(N) if self._model == "sub-model-1" else c[1 + N : 1 + 2 * N]
        terms = [_term(self._model, *numbers) for numbers in zip(A, B, theta[:N], strict=True)]
        p, q = np.split(theta[N:], 2)
        fading = [
            FadingTerm(coefficient=float(C), rate=float(rate), exponent=float(exponent))
            for C, rate, exponent in zip(c[self._first_fading :][: p.size], p, q, strict=True)
        ]
        return FractionalArtifact(
            model=self._model,
            direct=float(c[0]),
            terms=tuple(sorted(terms, key=lambda term: term.order)),
            fading=tuple(sorted(fading, key=lambda term: term.rate)),
            full_scale_strain=self.full_scale,
            resistance_change=self.scale,
            rest_resistance=self._rest + self.scale * float(c[-1]) if self._offset else self._rest,
            shortest=self._settings.shortest,
            longest=self._settings.longest,
        )

    def certainty(
        self, theta: Vector, artifact: FractionalArtifact
    ) -> tuple[dict[str, Parameter], Matrix, tuple[str, ...]]:
        """Return the parameters with standard errors, their covariance, and what is not determined.

        A term that the fit has left out, with a coefficient of zero, is not determined and takes no part in the rest.
        """
        N, L = len(artifact.terms), len(artifact.fading)
        theta = np.array(
            [t.order for t in artifact.terms]
            + [t.rate for t in artifact.fading]
            + [t.exponent for t in artifact.fading]
        )
        Phi, slopes, c = self.problem.solve(theta)
        residual = Phi @ c - self.problem.y
        names, values, J = ["C_0"], [artifact.direct], [Phi[:, 0]]
        for k, term in enumerate(artifact.terms):
            angle = 0.5 * np.pi * term.phase
            cosine, sine = Phi[:, 1 + k], Phi[:, 1 + N + k] if self._model != "sub-model-1" else np.zeros(residual.size)
            names += [f"C_{k + 1}", f"a_{k + 1}"]
            values += [term.coefficient, term.order]
            J += [np.cos(angle) * cosine - np.sin(angle) * sine, slopes[k] @ c]
            if self._model != "sub-model-1":
                names.append(f"b_{k + 1}")
                values.append(term.phase)
                J.append(-0.5 * np.pi * term.coefficient * (np.sin(angle) * cosine + np.cos(angle) * sine))
        for k, fading in enumerate(artifact.fading):
            names += [f"C_{N + k + 1}", f"p_{k + 1}", f"q_{k + 1}"]
            values += [fading.coefficient, fading.rate, fading.exponent]
            J += [Phi[:, self._first_fading + k], slopes[N + k] @ c, slopes[N + L + k] @ c]
        if self._offset:
            names.append("R_0")
            values.append(artifact.rest_resistance)
            J.append(Phi[:, -1] / self.scale)
        dropped = [name.startswith("C_") and value == 0.0 for name, value in zip(names, values, strict=True)]
        covariance = _covariance(np.where(dropped, 0.0, np.column_stack(J)), residual)
        errors = np.sqrt(np.diag(covariance))
        parameters = {
            name: Parameter(value=float(value), standard_error=float(error), determined=bool(error < abs(value)))
            for name, value, error in zip(names, values, errors, strict=True)
        }
        warnings = []
        loose = [name for name, parameter in parameters.items() if not parameter.determined]
        if loose:
            warnings.append(
                f"The data do not determine {', '.join(loose)}: standard errors exceed the values. "
                "The model's output is unaffected on records like these; take fewer terms if the numbers matter."
            )
        at_bound = [
            name
            for name, value, low, high in zip(
                [f"a_{k + 1}" for k in range(N)] + [f"{s}_{k + 1}" for s in "pq" for k in range(L)],
                theta,
                *self.box,
                strict=True,
            )
            if min(value - low, high - value) < AT_BOUND * (high - low)
        ]
        if at_bound:
            warnings.append(f"{', '.join(at_bound)} ended at a bound: the data ask for a value outside the model.")
        return parameters, covariance, tuple(warnings)


def _term(model: ModelName, A: float, B: float, order: float) -> FractionalTerm:
    """Turn a cosine and a sine coefficient into coefficient and phase, the phase within the bounds of the model."""
    if model == "sub-model-1":
        return FractionalTerm(coefficient=float(A), order=float(order))
    leading = B if model == "model-1" else A
    sign = -1.0 if leading < 0.0 else 1.0
    phase = 2.0 / np.pi * np.arctan2(-sign * B, sign * A)
    return FractionalTerm(coefficient=float(sign * np.hypot(A, B)), order=float(order), phase=float(phase))


def _covariance(J: Matrix, residual: Vector) -> Matrix:
    """Return the covariance of a least squares estimate from its Jacobian, for residuals that are white."""
    size = np.linalg.norm(J, axis=0)
    acting = size > 0.0
    covariance = np.diag(np.where(acting, 0.0, np.inf))
    _, s, V = np.linalg.svd(J[:, acting] / size[acting], full_matrices=False)
    half = V.T / np.maximum(s, LEAST_SINGULAR) / size[acting, None]
    spread = residual @ residual / max(residual.size - size.size, 1)
    covariance[np.ix_(acting, acting)] = spread * half @ half.T
    return np.asarray(covariance)
