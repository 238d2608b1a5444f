"""Probability of detection by a general optimiser: a second implementation of ``gossamer_models.assessment.pod``."""

import numpy as np
from scipy.optimize import minimize, minimize_scalar


def log_likelihood(b, x, y):
    """Of hits ``y`` at ``x``, with the logit b[0] + b[1] x."""
    p = 1.0 / (1.0 + np.exp(-(b[0] + b[1] * x)))
    return np.sum(np.log(np.where(y, p, 1.0 - p)))


def fit(x, y):
    """Return intercept, slope and log-likelihood at its maximum."""
    found = minimize(lambda b: -log_likelihood(b, x, y), [0.0, 0.0], method="Nelder-Mead", options=TIGHT)
    return *found.x, -found.fun


def largest_at(x, y, at, eta):
    """Return the largest log-likelihood of the curves with a logit ``eta`` at a place."""
    found = minimize_scalar(lambda b: -log_likelihood([eta - b * at, b], x, y), (0.0, 1.0), tol=1e-12)
    return -found.fun


TIGHT = {"xatol": 1e-10, "fatol": 1e-12, "maxiter": 10_000, "maxfev": 10_000}
