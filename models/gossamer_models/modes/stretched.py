r"""Stretched exponentials as sums of exponentials.

Symbols: :math:`e^{-b t^c} = e^{-(t/\tau)^c} \approx \sum_q g_q e^{-\lambda_q t}`, :math:`b = \tau^{-c}` [s**-c], c [1]: the
decay of Eq. (4.12) of the thesis. For 0 < c <= 1 the function is completely monotone, so positive sums exist to any
accuracy. With them the memory of the dynamic operators is a fixed number of modes and the cost of a step does not grow with
the record.

A fit moves :math:`\tau` and c, so it expands all kernels on fixed rates, linearly: ``StretchedKernels``. A sensor carries
the few rates that its own kernel needs: ``exponential_sum``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..arrays import Matrix, Vector
from ..errors import ConvergenceError, ParameterError
from ..fitting.separable import Derivative, SeparableProblem

RATES_PER_DECADE = 3.5
MOST_TERMS = 30
MOST_ITERATIONS = 60
PATIENCE = 6  # iterations in which the error must fall by a tenth


@dataclass(frozen=True, slots=True)
class StretchedKernels:
    r"""Fixed decay rates on which stretched exponentials are expanded.

    Attributes
    ----------
    rates : ndarray, shape (R,)
        :math:`\lambda` [1/s], evenly spaced in the logarithm.
    times : ndarray, shape (T,)
        Times [s] at which the expansion is fitted.
    expand : ndarray, shape (R, T)
        Weights [1] of the rates for a kernel given at ``times``: regularised least squares, so linear in the kernel.
    """

    rates: Vector
    times: Vector
    expand: Matrix

    @classmethod
    def between(cls, shortest: float, longest: float) -> StretchedKernels:
        """Return rates for kernels between two times [s]."""
        low, high = np.log10(0.1 / longest), np.log10(5.0 / shortest)
        rates = np.logspace(low, high, int(np.ceil(RATES_PER_DECADE * (high - low))) + 1)
        times = np.concatenate([[0.0], np.geomspace(0.1 * shortest, 2.0 * longest, 100)])
        E = np.exp(-np.outer(times, rates))
        E = np.vstack([E, 1e-5 * np.eye(rates.size)])
        return cls(rates, times, np.linalg.pinv(E)[:, : times.size])

    def weights(self, log_tau: ca.MX, c: ca.MX) -> ca.MX:
        r"""Return the weights [1] of :math:`e^{-(t/\tau_j)^{c_j}}`, shape (R, P), for times and exponents of shape (P,)."""
        log_t = ca.DM(np.log(np.maximum(self.times, 1e-12 * self.times[1])))
        power = ca.mtimes(log_t, c.T) - ca.repmat((c * log_tau).T, log_t.numel(), 1)
        return ca.mtimes(ca.DM(self.expand), ca.exp(-ca.exp(power)))


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
        An argument is out of range.
    ConvergenceError
        The tolerance was not met.

    Notes
    -----
    Rates spaced evenly in the logarithm, the nearest moved to :math:`b^{1/c}`, non-negative least squares for the weights,
    then a search for the logarithms of the rates with the weights eliminated, with one more rate until the tolerance is met.
    Before ``shortest`` the sum is bounded and monotone but not the stretched exponential, whose slope at t = 0 is
    infinite for c < 1.
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

    def columns(logarithms: Vector) -> tuple[Matrix, Callable[[], list[Derivative]]]:
        powers = -np.outer(times, np.exp(logarithms))
        Phi = np.exp(powers)
        return Phi, lambda: [(np.array([q]), powers[:, [q]] * Phi[:, [q]]) for q in range(logarithms.size)]

    problem = SeparableProblem(columns, np.exp(-rate * times**exponent))
    last = min(longest, (-np.log(tolerance) / rate) ** (1.0 / exponent))  # past it the function is zero
    # close to c = 1 most of the weight is at this rate, and a start beside it does not reach it
    own = np.log(rate) / exponent
    worst, searched = np.inf, 0
    for n in range(3, MOST_TERMS + 1):
        start = np.linspace(np.log(0.3 / last), np.log(10.0 / shortest), n)
        start[np.argmin(np.abs(start - own))] = own
        start = start[problem.coefficients(start) > 0.0]
        if start.size <= searched:  # a search with as many rates has failed already
            continue
        searched = start.size
        logarithms = _search(problem, start)
        error = float(np.abs(problem.residual(logarithms)).max())
        worst = min(worst, error)
        if error <= 0.8 * tolerance:  # the rest is for times between the samples
            logarithms = np.sort(logarithms)
            weights = problem.coefficients(logarithms)
            return np.exp(logarithms[weights > 0.0]), weights[weights > 0.0]
    msg = (
        f"{MOST_TERMS} exponentials reach {worst:.2e} > {tolerance:.2e} for exp(-{rate:g} t**{exponent:g}). "
        "Allow a larger error or a shorter range of times."
    )
    raise ConvergenceError(msg)


def _search(problem: SeparableProblem, logarithms: Vector) -> Vector:
    """Return better logarithms of the rates: damped Gauss-Newton that stops early, in a fraction of SciPy's time."""
    error, J, damping, sizes = problem.residual(logarithms), None, 1e-4, [np.inf] * PATIENCE
    for _ in range(MOST_ITERATIONS):
        size = float(np.linalg.norm(error))
        if size > 0.9 * sizes[-PATIENCE] or damping > 1e6:
            break
        sizes.append(size)
        J = problem.jacobian(logarithms, released=True) if J is None else J
        scale = np.linalg.norm(J, axis=0) + 1e-14
        system = np.vstack([J, np.sqrt(damping) * np.diag(scale)])
        change = np.linalg.lstsq(system, np.concatenate([-error, np.zeros(scale.size)]), rcond=None)[0]
        trial = logarithms + np.clip(change, -0.5, 0.5)
        found = problem.residual(trial)
        if found @ found < error @ error:
            logarithms, error, J = trial, found, None
            damping *= 0.3
        else:
            damping *= 5.0
    return logarithms
