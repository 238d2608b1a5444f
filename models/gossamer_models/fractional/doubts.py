r"""Doubts about a fit of a fractional model: parameters that the data do not determine, and assumptions.

Symbols: ``J`` Jacobian of the residuals by the thesis' parameters :math:`C_k, a_k, b_k, p_l, q_l`.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Matrix
from ..fitting.errors import Parameter, alike, covariance, rest_doubt
from ..fitting.records import Record, in_equal_steps
from .fit import FractionalFit

AT_BOUND = 1e-6  # of the width of the box
UNEVEN = 0.01  # of the median step: larger differences of steps are reported


def parameters(fit: FractionalFit) -> tuple[tuple[Parameter, ...], Matrix]:
    """Return the parameters by the thesis' names and their covariance, shape (n, n), for white residuals.

    ``C_0``, ``C_1``, ``a_1``, ``b_1``, ..., ``p_1``, ``q_1`` belong to the normalised model; ``R_0`` [ohm] is present
    if it was fitted. A term with a coefficient of zero is not determined and has no effect on the others.
    """
    artifact, model = fit.artifact, fit.artifact.model
    N, L = len(artifact.terms), len(artifact.fading)
    Phi, slopes, c = fit.problem.solve(fit.theta)
    by_theta = [slope @ c[columns] for columns, slope in slopes]
    residual = Phi @ c - fit.problem.y
    rows = [("C_0", artifact.direct, Phi[:, 0])]
    for k, term in enumerate(artifact.terms):
        angle = 0.5 * np.pi * term.phase
        cosine, sine = Phi[:, 1 + k], Phi[:, 1 + N + k] if model != "sub-model-1" else np.zeros(residual.size)
        rows += [
            (f"C_{k + 1}", term.coefficient, np.cos(angle) * cosine - np.sin(angle) * sine),
            (f"a_{k + 1}", term.order, by_theta[k]),
        ]
        if model != "sub-model-1":
            turned = np.sin(angle) * cosine + np.cos(angle) * sine
            rows.append((f"b_{k + 1}", term.phase, -0.5 * np.pi * term.coefficient * turned))
    for k, fading in enumerate(artifact.fading):
        rows += [
            (f"C_{N + k + 1}", fading.coefficient, Phi[:, 1 + 2 * N + k]),
            (f"p_{k + 1}", fading.rate, by_theta[N + k]),
            (f"q_{k + 1}", fading.exponent, by_theta[N + L + k]),
        ]
    if fit.rest_fitted:
        rows.append(("R_0", artifact.rest_resistance, Phi[:, -1] / artifact.resistance_change))
    J = np.column_stack(
        [np.zeros_like(slope) if name[0] == "C" and value == 0.0 else slope for name, value, slope in rows]
    )
    variance = float(residual @ residual) / max(residual.size - len(rows), 1)
    covariances, _ = covariance(J, np.empty((0, len(rows))), variance)
    deviations = np.sqrt(np.diag(covariances))
    return tuple(
        Parameter(name=name, value=float(value), deviation=float(deviation), determined=bool(deviation < abs(value)))
        for (name, value, _), deviation in zip(rows, deviations, strict=True)
    ), covariances


def doubts(fit: FractionalFit) -> tuple[str, ...]:
    """Return the assumptions and what the data do not determine, one sentence each."""
    sentences = [_uneven(record) for record in fit.records]
    if fit.rest_fitted:
        advice = "If the sensor was at rest, give the resistance at rest (--rest-resistance)."
        rest, full_scale = fit.rest_resistance, fit.artifact.full_scale_strain
        sentences += [rest_doubt(record, rest, full_scale, advice) for record in fit.records]
    known, covariances = parameters(fit)
    loose = [each.name for each in known if not each.determined]
    if loose:
        sentences.append(
            f"The data do not determine {', '.join(loose)}: standard errors exceed the values. "
            "The model's output is unaffected on records like these; take fewer terms if the numbers matter."
        )
    N, L = fit.settings.terms, fit.settings.n_fading
    names = [f"a_{k + 1}" for k in range(N)] + [f"{symbol}_{k + 1}" for symbol in "pq" for k in range(L)]
    low, high = fit.box
    at_bound = np.minimum(fit.theta - low, high - fit.theta) < AT_BOUND * (high - low)
    if at_bound.any():
        which = ", ".join(name for name, at in zip(names, at_bound, strict=True) if at)
        sentences.append(f"{which} ended at a bound: the data suggest a value beyond it.")
    sentences.append(alike(tuple(each.name for each in known), covariances, "Take fewer terms if the numbers matter."))
    if fit.settings.model != "sub-model-1":
        sentences.append(
            f"The fractional {fit.settings.model} needs the whole record and works offline only: no FMU can be built from "
            "it. For an FMU, identify fractional-sub-model-1."
        )
    return tuple(filter(None, sentences))


def _uneven(record: Record) -> str:
    """Return a sentence on the resampling in equal steps; empty if the record has equal steps."""
    steps = np.diff(record.time)
    if np.ptp(steps) <= UNEVEN * float(np.median(steps)):
        return ""
    even, _ = in_equal_steps(record, np.ones(record.time.size, dtype=bool))
    back = np.interp(record.time, even.time, even.strain)
    moved = 100.0 * float(np.abs(back - record.strain).max() / np.ptp(record.strain))
    return (
        f"{record.name}: samples {steps.min():.3g} to {steps.max():.3g} s apart were brought to steps of "
        f"{even.time[1] - even.time[0]:.3g} s, which moves the strain by up to {moved:.2g} % of its range."
    )
