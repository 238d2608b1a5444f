r"""Stretched exponentials as positive sums of exponentials.

Symbols: :math:`e^{-b t^c} \approx \sum_q g_q e^{-\lambda_q t}` with :math:`\lambda_q, g_q > 0`. For 0 < c <= 1 the function is
completely monotone, so such sums exist to any accuracy. With them the memory of the dynamic operators is a fixed number
of modes and the cost of a step does not grow with the record.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from ..errors import ConvergenceError, ParameterError

Vector = NDArray[np.float64]
MOST_TERMS = 24


def exponential_sum(
    rate: float, exponent: float, *, shortest: float = 0.01, longest: float = 1e4, tolerance: float = 1e-6
) -> tuple[Vector, Vector]:
    r"""Fit :math:`e^{-b t^c}` on [shortest, longest] and at t = 0 by a positive sum of exponentials.

    Parameters
    ----------
    rate, exponent : float
        :math:`b` [s**-c], positive, and :math:`c` [1], 0 < c <= 1.
    shortest, longest : float
        Range of times [s].
    tolerance : float
        Largest absolute error allowed [1].

    Returns
    -------
    decay_rates : ndarray, shape (n,)
        :math:`\lambda_q` [1/s], increasing.
    weights : ndarray, shape (n,)
        :math:`g_q` [1], positive.

    Raises
    ------
    ParameterError
        An argument outside its meaning.
    ConvergenceError
        The tolerance was not met.

    Notes
    -----
    Rates spaced evenly in the logarithm, non-negative least squares for the weights, then Gauss-Newton on the logarithms
    of both, with one more rate until the tolerance is met. Before ``shortest`` the sum is bounded and monotone but not
    the stretched exponential, whose slope at t = 0 is infinite for c < 1.
    """
    if not (rate > 0.0 and 0.0 < exponent <= 1.0 and 0.0 < shortest < longest and tolerance > 0.0):
        msg = (
            f"cannot fit exp(-b t**c) with b = {rate:g}, c = {exponent:g} on [{shortest:g}, {longest:g}] s to "
            f"{tolerance:g}: need b > 0, 0 < c <= 1, 0 < shortest < longest and a positive tolerance"
        )
        raise ParameterError(msg)
    if exponent == 1.0:
        return np.array([rate]), np.array([1.0])
    times = np.concatenate([[0.0], np.geomspace(shortest, longest, 400)])
    target = np.exp(-rate * times**exponent)
    # outside these times the function is 1 or 0 to the tolerance, and rates there would be idle
    first = max(shortest, (tolerance / rate) ** (1.0 / exponent))
    last = min(longest, (-np.log(tolerance) / rate) ** (1.0 / exponent))
    worst = np.inf
    for n in range(3, MOST_TERMS + 1):
        rates = np.geomspace(0.3 / last, 3.0 / first, n)
        weights, _ = nnls(np.exp(-np.outer(times, rates)), target, maxiter=100 * n)
        used = weights > 0.1 * tolerance
        rates, weights = _polish(times, target, rates[used], weights[used])
        worst = min(worst, error := float(np.abs(np.exp(-np.outer(times, rates)) @ weights - target).max()))
        if error <= tolerance:
            order = np.argsort(rates)
            return rates[order], weights[order]
    msg = (
        f"{MOST_TERMS} exponentials reach {worst:.2e} > {tolerance:.2e} for exp(-{rate:g} t**{exponent:g}). "
        "Allow a larger error or a shorter range of times."
    )
    raise ConvergenceError(msg)


def _polish(times: Vector, target: Vector, rates: Vector, weights: Vector) -> tuple[Vector, Vector]:
    """Improve rates [1/s] and weights [1] together by Levenberg-Marquardt steps on their logarithms."""
    n = rates.size

    def error(logarithms: Vector) -> Vector:
        decay, weight = np.exp(logarithms).reshape(2, n)
        return np.asarray(np.exp(-np.outer(times, decay)) @ weight - target)

    def jacobian(logarithms: Vector) -> Vector:
        decay, weight = np.exp(logarithms).reshape(2, n)
        terms = np.exp(-np.outer(times, decay)) * weight
        return np.hstack([-terms * np.outer(times, decay), terms])

    start = np.log(np.concatenate([rates, weights]))
    bounds = (start - 5.0, start + 5.0)
    fit = least_squares(error, start, jac=jacobian, bounds=bounds, xtol=1e-12, ftol=1e-12, gtol=1e-14, max_nfev=100)
    decay, weight = np.exp(fit.x).reshape(2, n)
    return decay, weight
