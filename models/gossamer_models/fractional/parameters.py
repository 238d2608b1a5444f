r"""The parameters of a fitted fractional model by the thesis' names, and how well they are known.

Symbols: ``J`` Jacobian of the residuals by :math:`C_k, a_k, b_k, p_l, q_l`.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Matrix, Vector
from ..fitting.uncertainty import Parameter, covariance
from .problem import FractionalProblem


def parameters(problem: FractionalProblem, theta: Vector) -> tuple[tuple[Parameter, ...], Matrix]:
    """Return the parameters by the thesis' names and their covariance, shape (n, n), for white residuals.

    ``C_0``, ``C_1``, ``a_1``, ``b_1``, ..., ``p_1``, ``q_1`` belong to the normalised model; ``R_0`` [ohm] is present
    if it was fitted. A term with a coefficient of zero is not determined and has no effect on the others.
    """
    artifact, model = problem.artifact(theta), problem.settings.model
    N, L = len(artifact.terms), len(artifact.fading)
    Phi, c = problem.separable.solve(theta)
    by_theta = [slope @ c[columns] for columns, slope in problem.separable.derivatives(theta)]
    residual = Phi @ c - problem.separable.y
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
            (f"C_{N + k + 1}", fading.coefficient, Phi[:, problem.settings.first_fading + k]),
            (f"p_{k + 1}", fading.rate, by_theta[N + k]),
            (f"q_{k + 1}", fading.exponent, by_theta[N + L + k]),
        ]
    if problem.rest_fitted:
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
