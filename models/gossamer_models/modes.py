r"""Banks of exponential modes: responses to a record, and the kernels of the sensor as sums of exponentials.

Symbols: ``u`` record, :math:`\Delta` its change over a step, ``h`` step [s], :math:`\lambda_q` decay rate [1/s] of mode q,
:math:`x = \lambda h` [1], ``r`` size of the excitation over a step,

.. math:: z(t + h) = e^{-x} z(t) + r\,\varphi_1(x) \quad\text{or}\quad
          z(t + h) = e^{-x} z(t) + r\,[u\,\varphi_1(x) + \Delta\,\varphi_2(x)].

Excitation is of power 0 or 1 in the record, and ``responses`` is exact for records linear between samples. With
:math:`r = \max(\Delta, 0)` these are the relaxation modes of a sensor, Eq. (4.13) of the thesis; with :math:`r = \Delta`,
power 0, the modes of a fractional derivative, and with :math:`r = h`, power 1, those of a fractional integral.

Fractional operators: :math:`a` order [1], 0 < a < 1; :math:`g_q` weight [s**(a - 1)] of mode q; :math:`c` mass [s**a] of
the part of the kernel that decays within any step; spacing of the logarithms x of the rates [1]. For :math:`t` from
``shortest`` to ``longest``,

.. math:: \frac{t^{a-1}}{\Gamma(a)} = \frac{\sin \pi a}{\pi} \int_{-\infty}^{\infty} e^{(1-a)x}\,e^{-e^x t}\,dx
          \approx \sum_q g_q(a)\,e^{-\lambda_q t}, \qquad \lambda_q = e^{x_q},

the kernel of Eqs. (3.1) and (3.2) of the thesis. The rates do not depend on the order: all terms of a model share one
bank of modes, and whatever is linear in the weights is differentiable in the order.

Stretched exponentials: :math:`e^{-b t^c} = e^{-(t/\tau)^c} \approx \sum_q g_q e^{-\lambda_q t}`, :math:`b = \tau^{-c}`
[s**-c], c [1]: the decay of Eq. (4.12) of the thesis. For 0 < c <= 1 the function is completely monotone, so positive sums
exist to any accuracy, and the cost of a step does not grow with the record. A fit moves :math:`\tau` and c, so it expands
all kernels on fixed rates, linearly: ``StretchedKernels``. A sensor carries the few rates that its own kernel needs:
``exponential_sum``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from .arrays import Matrix, Vector
from .errors import ConvergenceError, ParameterError, require
from .fitting.separable import Derivative, SeparableProblem

SERIES_BELOW = 0.5
SERIES_TERMS = 14
SPACING = 0.55  # of the logarithms of the rates: the trapezoidal rule errs by about exp(-pi**2 / SPACING)
SLOWEST = 0.006  # slowest rate times longest time: the sum of all slower modes is a straight line up to there
FASTEST = 20.0  # least product of fastest rate and shortest time: faster modes decay within one step
STANDING = 1e-9  # rate times longest time of the mode that represents a constant
RATES_PER_DECADE = 3.5
MOST_TERMS = 30
MOST_ITERATIONS = 60
PATIENCE = 6  # iterations in which the error must fall by a tenth


def phi_1(x: ca.MX) -> ca.MX:
    r"""Return :math:`\varphi_1(x) = (1 - e^{-x})/x` for x > 0: a series where the difference would cancel."""
    small = ca.fmin(x, SERIES_BELOW)
    return ca.if_else(x < SERIES_BELOW, 1.0 - 0.5 * small * _series(small), (1.0 - ca.exp(-x)) / x)


def phi_2(x: ca.MX) -> ca.MX:
    r"""Return :math:`\varphi_2(x) = (x - 1 + e^{-x})/x^2` for x > 0: a series where the difference would cancel."""
    return ca.if_else(x < SERIES_BELOW, 0.5 * _series(ca.fmin(x, SERIES_BELOW)), (1.0 - phi_1(x)) / x)


def _series(x: ca.MX) -> ca.MX:
    r"""Return :math:`2 \varphi_2(x)` for small x."""
    series = 1.0
    for k in reversed(range(SERIES_TERMS - 1)):
        series = 1.0 - x / (k + 3) * series
    return series


def responses(
    steps: ArrayLike, u: Vector, rates: Vector, excitations: Sequence[tuple[ArrayLike, int]], *, fading: float = 0.0
) -> Matrix:
    r"""Return the modes of a record at its samples; all are zero at the first one.

    Parameters
    ----------
    steps : array_like, shape (m - 1,) or scalar
        Steps between samples [s]; a scalar for equal ones, which cost less.
    u : ndarray, shape (m,)
        Record.
    rates : ndarray, shape (n,)
        Decay rates [1/s].
    excitations : sequence of (array_like, {0, 1}), length d
        Sizes :math:`r` over each step, shape (m - 1,) or scalar, and power of the record.
    fading : float
        :math:`\kappa`: a change of the record lets the modes decay by :math:`x = \lambda h + \kappa\,|\Delta|`.

    Returns
    -------
    ndarray, shape (m, d n)
        All rates of the first excitation first.
    """
    x = np.asarray(steps, dtype=float).reshape(-1, 1) * rates
    if fading:
        x = x + fading * np.abs(np.diff(u))[:, None]
    kernels = [phi_1(ca.DM(x)).full()]
    if any(power for _, power in excitations):
        kernels.append(u[:-1, None] * kernels[0] + np.diff(u)[:, None] * phi_2(ca.DM(x)).full())
    sizes = [np.broadcast_to(size, (u.size - 1,))[:, None] for size, _ in excitations]
    gained = np.hstack([np.empty((u.size - 1, 0)), *(r * kernels[p] for r, (_, p) in zip(sizes, excitations, strict=True))])
    left = np.tile(np.exp(-x), len(excitations))
    Z = np.zeros((u.size, gained.shape[1]))
    if len(left) == 1:
        from scipy.signal import lfilter  # slow to import

        for q in range(Z.shape[1]):
            Z[1:, q] = lfilter([1.0], [1.0, -left[0, q]], gained[:, q])
    else:
        for k in range(u.size - 1):
            Z[k + 1] = left[k] * Z[k] + gained[k]
    return Z


@dataclass(frozen=True)
class PowerLawKernels:
    """Fixed decay rates that represent the kernels of all orders.

    Attributes
    ----------
    shortest, longest : float
        Range of times [s] in which the relative error of the kernel is at most 1e-6. ``shortest`` is also the shortest
        ramp of an input that the memory resolves; it smooths shorter ones.
    """

    shortest: float
    longest: float

    def __post_init__(self) -> None:
        if not (0.0 < self.shortest < self.longest < np.inf):
            msg = f"a memory cannot run from {self.shortest:g} s to {self.longest:g} s: need 0 < shortest < longest"
            raise ParameterError(msg)

    @cached_property
    def rates(self) -> Vector:
        """Decay rates [1/s], increasing; the first one represents zero."""
        low, high = np.log(SLOWEST / self.longest), np.log(FASTEST / self.shortest)
        n = int(np.ceil((high - low) / SPACING))
        return np.concatenate([[STANDING / self.longest], np.exp(high - SPACING * np.arange(n, -1, -1))])

    @cached_property
    def weights(self) -> ca.Function:
        r"""Weights of the modes as a function of the order, ``a -> g``, differentiable.

        The result has one element more than ``rates``: the last is the mass :math:`c`. All are positive.

        Notes
        -----
        Trapezoidal rule in :math:`x = \ln\lambda`, spectrally accurate [1]_. Modes faster than the grid are lumped
        into its fastest mode and a mass, which keeps the integral and the first moment of the kernel: the response to
        an input that is linear over ``shortest`` or longer stays correct. Modes slower than the grid are lumped into
        its slowest mode and a constant, which keeps value and slope. Both sums are geometric series.

        References
        ----------
        .. [1] G. Beylkin, L. Monzón, Applied and Computational Harmonic Analysis 28(2), 131-149, 2010,
           doi:10.1016/j.acha.2009.08.011.
        """
        a = ca.SX.sym("a")
        slow, fast = float(self.rates[1]), float(self.rates[-1])

        def tail(rate: float, power: ca.SX) -> ca.SX:
            """Sum of rate**power over a grid that begins at ``rate`` and runs to where the power vanishes."""
            return rate**power / (1.0 - ca.exp(-SPACING * ca.fabs(power)))

        value, slope = tail(slow, 1.0 - a), tail(slow, 2.0 - a)
        mass, moment = tail(fast, -a), tail(fast, -1.0 - a)
        g = ca.vertcat(
            value - slope / slow, slope / slow, ca.DM(self.rates[2:-1]) ** (1.0 - a), moment * fast**2, mass - moment * fast
        )
        return ca.Function("weights", [a], [SPACING * ca.sin(np.pi * a) / np.pi * g])

    def at_order(self, order: float) -> Vector:
        """Return the weights [s**(order - 1)] of the kernel of one order and, last, its mass [s**order], shape (n + 1,).

        Raises
        ------
        ParameterError
            The order is outside 0..1.
        """
        check_order(order)
        return np.array(self.weights(order)).ravel()


def check_order(order: float) -> None:
    """Raise ``ParameterError`` unless 0 < order < 1."""
    require(0.0 < order < 1.0, f"the order is {order:g}; a fractional operator needs 0 < order < 1")


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
    advice = "Allow a larger error or a shorter range of times."
    msg = f"{MOST_TERMS} exponentials reach {worst:.2e} > {tolerance:.2e} for exp(-{rate:g} t**{exponent:g}). {advice}"
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
