"""Probability of detection by a general optimiser: a second implementation of ``gossamer_models.assessment.pod``."""

import numpy as np
from scipy.optimize import minimize, minimize_scalar


def log_likelihood(b, x, y):
    """Of hits ``y`` at ``x``, with the logit b[0] + b[1] x."""
    p = 1.0 / (1.0 + np.exp(-(b[0] + b[1] * x)))
    return np.sum(np.log(np.where(y, p, 1.0 - p)))


def penalised(b, x, y):
    """Of Firth's likelihood: with half the logarithm of the determinant of the information."""
    p = 1.0 / (1.0 + np.exp(-(b[0] + b[1] * x)))
    X = np.column_stack([np.ones_like(x), x])
    return log_likelihood(b, x, y) + 0.5 * np.linalg.slogdet(X.T @ np.diag(p * (1.0 - p)) @ X)[1]


def fit(x, y, of=log_likelihood):
    """Return intercept, slope and log-likelihood at its maximum."""
    found = minimize(lambda b: -of(b, x, y), [0.0, 1.0], method="Nelder-Mead", options=TIGHT)
    return *found.x, -found.fun


def largest_at(x, y, at, eta):
    """Return the largest of Firth's log-likelihood of the curves with a logit ``eta`` at a place."""
    found = minimize_scalar(lambda b: -penalised([eta - b * at, b], x, y), (1.0, 2.0), tol=1e-12)
    return -found.fun


TIGHT = {"xatol": 1e-10, "fatol": 1e-12, "maxiter": 10_000, "maxfev": 10_000}
