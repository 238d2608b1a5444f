r"""Smoothing of a noisy signal that bends at unknown times, without blunting its turning points.

Symbols: ``m`` half width of a window [samples], ``t`` place in it, -m..m, ``y`` signal [1], ``sigma`` standard deviation of
its white noise [1]; ``Q`` orthonormal parabolas, ``b`` their coefficients [1]; ``K`` unit kinks :math:`|t - \tau_i|` less
their part in the parabolas, ``c`` their coefficients [1], ``w`` their probabilities [1].

A mean, a parabola or a Kalman filter cuts every peak on the same side; behind a hysteresis that accumulates, these
errors add up. Here a window holds a parabola with a kink at one of many places or with none, and the posterior
probabilities of these cases weigh their least-squares fits. The widest window whose residual looks like noise is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from ..variables import select

KINK_PROBABILITY = 0.05  # prior probability of a kink somewhere in a window
ACCEPTED = 2.0  # a window is accepted up to this many standard deviations of its residual's sum of squares
NO_NOISE = 1e-12  # [1]; stands for 0


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
