r"""Stretched exponentials as positive sums of exponentials.

Symbols: :math:`e^{-b t^c} \approx \sum_q g_q e^{-\lambda_q t}` with :math:`\lambda_q, g_q > 0`. For 0 < c <= 1 the
function is completely monotone, so such sums exist to any accuracy. With them the memory of the dynamic operators is a
fixed number of modes and the cost of a step does not grow with the record.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from ..errors import ConvergenceError, ParameterError

Vector = NDArray[np.float64]
MOST_TERMS = 30
MOST_ITERATIONS = 60
PATIENCE = 6  # iterations in which the error must fall by a tenth


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
    Rates spaced evenly in the logarithm, the nearest moved to :math:`b^{1/c}`, non-negative least squares for the weights,
    then Gauss-Newton on the logarithms of the rates with the weights eliminated (variable projection [1]_), with one more
    rate until the tolerance is met.
    Before ``shortest`` the sum is bounded and monotone but not the stretched exponential, whose slope at t = 0 is
    infinite for c < 1.

    References
    ----------
    .. [1] G. H. Golub, V. Pereyra, SIAM Journal on Numerical Analysis 10(2), 413-432, 1973, doi:10.1137/0710036.
    """
    if not (rate > 0.0 and 0.0 < exponent <= 1.0 and 0.0 < shortest < longest and tolerance > 0.0):
        msg = (
            f"cannot fit exp(-b t**c) with b = {rate:g}, c = {exponent:g} on [{shortest:g}, {longest:g}] s to "
            f"{tolerance:g}: need b > 0, 0 < c <= 1, 0 < shortest < longest and a positive tolerance"
        )
        raise ParameterError(msg)
    if exponent == 1.0:
        return np.array([rate]), np.array([1.0])
    times = np.concatenate([[0.0], np.geomspace(shortest, longest, 300)])
    target = np.exp(-rate * times**exponent)
    last = min(longest, (-np.log(tolerance) / rate) ** (1.0 / exponent))  # past it the function is zero
    own = (
        np.log(rate) / exponent
    )  # close to c = 1 most of the weight is there, and a start beside it is not polished away
    worst, polished = np.inf, 0
    for n in range(3, MOST_TERMS + 1):
        start = np.linspace(np.log(0.3 / last), np.log(10.0 / shortest), n)
        start[np.argmin(np.abs(start - own))] = own
        start = start[_project(times, target, start)[1] > 0.0]
        if start.size <= polished:  # so many rates have been polished, and were too few
            continue
        polished = start.size
        logarithms, weights, error = _polish(times, target, start)
        worst = min(worst, error)
        if error <= 0.8 * tolerance:  # the rest is for times between the samples
            kept = weights > 0.0
            return np.exp(logarithms[kept]), weights[kept]
    msg = (
        f"{MOST_TERMS} exponentials reach {worst:.2e} > {tolerance:.2e} for exp(-{rate:g} t**{exponent:g}). "
        "Allow a larger error or a shorter range of times."
    )
    raise ConvergenceError(msg)


def _polish(times: Vector, target: Vector, logarithms: Vector) -> tuple[Vector, Vector, float]:
    """Improve the logarithms of the rates; return them, their best weights [1] and the largest error [1]."""
    terms, weights, error = _project(times, target, logarithms)
    damping, sizes = 1e-4, [np.inf] * PATIENCE
    for _ in range(MOST_ITERATIONS):
        size = float(np.linalg.norm(error))
        if size > 0.9 * sizes[-PATIENCE] or damping > 1e6:
            break
        sizes.append(size)
        slopes = -terms * np.outer(times, np.exp(logarithms)) * weights
        basis, _ = np.linalg.qr(terms)
        J = slopes - basis @ (basis.T @ slopes)
        scale = np.linalg.norm(J, axis=0) + 1e-14
        system = np.vstack([J, np.sqrt(damping) * np.diag(scale)])
        change = np.linalg.lstsq(system, np.concatenate([-error, np.zeros(scale.size)]), rcond=None)[0]
        trial = logarithms + np.clip(change, -0.5, 0.5)
        found = _project(times, target, trial)
        if found[2] @ found[2] < error @ error:
            logarithms, (terms, weights, error) = trial, found
            damping *= 0.3
        else:
            damping *= 5.0
    order = np.argsort(logarithms)
    return logarithms[order], weights[order], float(np.abs(error).max())


def _project(times: Vector, target: Vector, logarithms: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the terms, their best weights [1] and the error [1]."""
    terms = np.exp(-np.outer(times, np.exp(logarithms)))
    weights, _ = nnls(terms, target, maxiter=100 * logarithms.size)
    return terms, weights, terms @ weights - target
