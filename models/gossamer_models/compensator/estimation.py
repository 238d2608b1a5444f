r"""What the estimator is made of: smoothing that keeps turning points, the leg that an output is on, the drift.

Smoothing: ``m`` half width of a window [samples], ``t`` place in it, -m..m, ``y`` signal [1], ``sigma`` deviation of its
white noise [1]; ``Q`` orthonormal parabolas, ``b`` their coefficients [1]; ``K`` unit kinks :math:`|t - \tau_i|` less
their part in the parabolas, ``c`` their coefficients [1], ``w`` their probabilities [1]. A mean, a parabola or a Kalman
filter cuts every peak on the same side; behind a hysteresis that accumulates, these errors add up. Here a window holds a
parabola with a kink at one of many places or with none, and the posterior probabilities of these cases weigh their
least-squares fits. The widest window whose residual looks like noise is used.

Leg, the motion since the last turning point: ``T`` output that the memory of the sensor does not explain [1]; ``d`` +1 or
-1, the direction of motion; ``v`` variance of the smoothed output [1]; ``M`` delay of the smoothing [samples].

Drift, a Kalman filter: ``e`` error of the strain [1]; ``theta`` relative correction of ``nu``, and so of eta [1]; ``ee``,
``et``, ``tt`` their covariances [1].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from ..variables import select

KINK_PROBABILITY = 0.05  # prior probability of a kink somewhere in a window
ACCEPTED = 2.0  # a window is accepted up to this many standard deviations of its residual's sum of squares
NO_NOISE = 1e-12  # [1]; stands for 0
AHEAD, BACK = 3.0, 4.0  # standard deviations that tell motion from noise, onward and backward
TREND = 2.5  # the same for the slope


@dataclass(frozen=True, slots=True)
class Smoothed:
    """Estimate of a signal at one sample of a buffer.

    Attributes
    ----------
    value, variance : casadi.MX, scalar
        Signal [1] and variance of its error [1].
    trend : casadi.MX, scalar
        Slope over the standard deviation of its error [1].
    turn : casadi.MX, scalar
        Expected signal at the turning point [1] if the window holds one up to this sample, else ``value``.
    sharp : casadi.MX, scalar
        Probability that the window holds a sharp turning point up to this sample [1].
    """

    value: ca.MX
    variance: ca.MX
    trend: ca.MX
    turn: ca.MX
    sharp: ca.MX


def smooth(y: ca.MX, sigma: ca.MX, half_widths: tuple[int, ...], place: int) -> Smoothed:
    r"""Estimate one sample of a buffer.

    Parameters
    ----------
    y : casadi.MX, shape (2 M + 1,)
        Samples [1], oldest first, equally spaced in time.
    sigma : casadi.MX, scalar
        Standard deviation of the noise [1]; 0 lets every sample pass.
    half_widths : tuple of int
        Half widths of the windows, increasing, from 3 to M.
    place : int
        Which sample: from M, the middle, to 2 M, the last.

    Returns
    -------
    Smoothed
        Value, variance, trend and turning point there.
    """
    last = y.numel() - 1
    sigma = ca.fmax(sigma, NO_NOISE)
    best = Smoothed(y[place], sigma**2, ca.MX(0.0), y[place], ca.MX(0.0))
    for m in half_widths:
        middle = min(place, last - m)
        smoothed, accepted = _smooth_window(y[middle - m : middle + m + 1], sigma, place - middle)
        best = select(accepted, smoothed, best)
    return best


def _smooth_window(y: ca.MX, sigma: ca.MX, at: int) -> tuple[Smoothed, ca.MX]:
    """Estimate the sample at time ``at`` from one window; return whether the residual looks like noise, too."""
    n = y.numel()
    m = n // 2
    Q, K, tau = _basis(m)

    centre = y[m]
    y = y - centre
    b, c = ca.mtimes(ca.DM(Q.T), y), ca.mtimes(ca.DM(K.T), y)
    # Bayes' rule; a further coefficient costs ln(n)/2, the large-sample penalty
    odds = KINK_PROBABILITY / (1.0 - KINK_PROBABILITY) / (tau.size * np.sqrt(n))
    gain = 0.5 * (c / sigma) ** 2
    top = ca.mmax(gain)
    w = odds * ca.exp(gain - top)
    w = w / (ca.exp(-top) + ca.sum1(w))

    dof = n - 4
    residual = ca.dot(y, y) - ca.dot(b, b) - ca.dot(w, c * c)
    accepted = residual <= sigma**2 * (dof + ACCEPTED * np.sqrt(2.0 * dof))

    here = at + m
    q, k = Q[here], K[here]
    bend = ca.dot(w, ca.DM(k) * c)
    value = centre + ca.dot(ca.DM(q), b) + bend
    spread = ca.dot(w, (ca.DM(k) * c) ** 2) - bend**2
    variance = sigma**2 * (float(q @ q) + ca.dot(w, ca.DM(k**2))) + ca.fmax(spread, 0.0)

    low, high = here - 1, min(here + 1, n - 1)
    dq, dk = Q[high] - Q[low], K[high] - K[low]
    slope = ca.dot(ca.DM(dq), b) + ca.dot(w, ca.DM(dk) * c)
    trend = slope / (sigma * ca.sqrt(float(dq @ dq) + ca.dot(w, ca.DM(dk**2))))

    # a kink is a turning point if the signal runs against itself on its two sides
    passed = np.flatnonzero(tau <= at)
    kinks, w, c = tau[passed] + m, w[passed.tolist()], c[passed.tolist()]

    def change(end: NDArray[np.int64] | int, start: NDArray[np.int64] | int) -> ca.MX:
        return ca.mtimes(ca.DM(Q[end] - Q[start]), b) + ca.DM(K[end, passed] - K[start, passed]) * c

    turns = change(kinks, kinks - 1) * change(kinks + 1, kinks) < 0.0
    turn = value + ca.dot(w, ca.if_else(turns, change(kinks, here), 0.0))
    return Smoothed(value, variance, trend, turn, ca.dot(w, turns)), accepted


def _basis(m: int) -> tuple[Vector, Vector, NDArray[np.int64]]:
    """Return Q, shape (2 m + 1, 3), K, shape (2 m + 1, n), and the times of its kinks [samples], shape (n,)."""
    t, tau = np.arange(-m, m + 1.0), np.arange(-m + 2, m - 1)
    Q = np.linalg.qr(np.vander(t / m, 3, increasing=True))[0]
    K = np.abs(t[:, None] - tau)
    K -= Q @ (Q.T @ K)
    return Q, K / np.linalg.norm(K, axis=0), tau


@dataclass(frozen=True, slots=True)
class Leg:
    """Motion of the output since the last turning point, counted from the output of the memory.

    Attributes
    ----------
    direction : casadi.MX, scalar
        +1 for rising, -1 for falling.
    extreme, variance : casadi.MX, scalar
        How far the leg has come [1] and the variance of its error [1].
    start_variance : casadi.MX, scalar
        Variance [1] of the turning point at which the leg began.
    advancing : casadi.MX, scalar
        1 while the leg runs on, 0 once it rests.
    """

    direction: ca.MX
    extreme: ca.MX
    variance: ca.MX
    start_variance: ca.MX
    advancing: ca.MX

    def follow(self, output: Smoothed, held: ca.MX, M: int) -> tuple[Leg, ca.MX, ca.MX]:
        """Follow the output by one sample.

        Parameters
        ----------
        output : Smoothed
            Smoothed output of the sample.
        held : casadi.MX, scalar
            Output of the memory [1] if the strain rests.
        M : int
            Delay of the smoothing [samples], over which errors are correlated.

        Returns
        -------
        leg : Leg
            With the new sample.
        turned : casadi.MX, scalar
            Whether the leg has ended.
        certain : casadi.MX, scalar
            Change of output [1] that will not be taken back: the turning point, or all but the noise.
        """
        d, v = self.direction, output.variance
        T, T_turn = output.value - held, output.turn - held
        width = ca.sqrt(v + self.variance)
        turned = (T - self.extreme) * d < -BACK * width
        onward = (T_turn - self.extreme) * d > 0.0
        moving = ca.logic_or(output.trend * d > TREND, (T - self.extreme) * d > AHEAD * width)
        advancing = ca.logic_or(moving, ca.logic_and(self.advancing, onward))
        resting = ca.logic_and(ca.fabs(output.trend) < TREND, ca.logic_not(advancing))
        gain = ca.if_else(resting, self.variance / (self.variance + M * v), 0.0)  # errors last for about M samples
        followed = ca.if_else(advancing, T_turn, self.extreme + gain * (T - self.extreme))
        extreme = ca.if_else(turned, self.extreme + d * ca.fmax((T_turn - self.extreme) * d, 0.0), followed)
        variance = ca.if_else(advancing, v, (1.0 - gain) * self.variance)
        certain = ca.if_else(turned, extreme, d * ca.fmax(extreme * d - BACK * width, 0.0))
        return replace(self, extreme=extreme, variance=variance, advancing=advancing), turned, certain

    def recount(self, turned: ca.MX, known: ca.MX, T: ca.MX, v: ca.MX, moved: ca.MX) -> Leg:
        """Count from a memory whose output has ``moved`` [1]; begin anew at a turning point or a known strain."""
        restart = ca.logic_or(turned, known)
        return replace(
            self,
            direction=ca.if_else(turned, -self.direction, self.direction),
            extreme=ca.if_else(restart, T, self.extreme - moved),
            variance=ca.if_else(restart, v, self.variance),
            start_variance=ca.if_else(turned, self.variance, self.start_variance),
        )


@dataclass(frozen=True, slots=True)
class Drift:
    """Gaussian estimate of the errors of strain and of eta.

    Attributes
    ----------
    theta : casadi.MX, scalar
        Relative correction of ``nu`` in use [1].
    ee, et, tt : casadi.MX, scalar
        Covariances of the errors of strain and of ``theta`` [1].
    rounding : casadi.MX, scalar
        Error of strain [1] if every turning point that did not look sharp was sharp; it grows with their number.
    """

    theta: ca.MX
    ee: ca.MX
    et: ca.MX
    tt: ca.MX
    rounding: ca.MX

    def fall(self, drop: ca.MX) -> Drift:
        """Let ``drop`` [1] of output switch down: an error of eta becomes an error of strain."""
        ee = self.ee + 2.0 * drop * self.et + drop**2 * self.tt
        return replace(self, ee=ee, et=self.et + drop * self.tt)

    def add(self, variance: ca.MX, rounding: ca.MX) -> Drift:
        """Add an independent error of strain by its variance [1], and one that rounding may have left [1]."""
        return replace(self, ee=self.ee + variance, rounding=self.rounding + rounding)

    def learn(self, error: ca.MX, variance: ca.MX, weight: ca.MX, least: ca.MX) -> Drift:
        """Update with a measured error of strain.

        Parameters
        ----------
        error, variance : casadi.MX, scalar
            Error of strain [1] and the variance of its measurement [1]; the strain itself is corrected elsewhere.
        weight : casadi.MX, scalar
            From 0, no measurement, to 1.
        least : casadi.MX, scalar
            Variance of ``theta`` [1] that always remains.
        """
        gain = weight / (self.ee + variance)
        left = 1.0 - gain * self.ee
        return Drift(
            theta=self.theta + self.et * error * (weight > 0.0) / (self.ee + variance),
            ee=left * self.ee,
            et=left * self.et,
            tt=ca.fmax(self.tt - gain * self.et**2, least),
            rounding=(1.0 - weight) * self.rounding,
        )

    @property
    def variance(self) -> ca.MX:
        """Variance of the error of strain [1]."""
        return self.ee + self.rounding**2
