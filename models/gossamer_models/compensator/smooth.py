r"""Smoothing of a noisy signal that bends at unknown times, without blunting its turning points.

Symbols: ``m`` half width of a window [samples], ``t`` place in it, -m..m, ``y`` signal [1], ``sigma`` standard deviation of
its white noise [1]; ``Q`` orthonormal parabolas; ``K`` unit kinks :math:`|t - \tau_i|` less their part in the parabolas,
``c`` their coefficients [1], ``w`` their probabilities [1].

A mean, a parabola or a Kalman filter cuts every peak on the same side; behind a hysteresis that accumulates, these
errors add up. Here a window holds a parabola with a kink at one of many places or with none, and the posterior
probabilities of these cases weigh their least-squares fits. The widest window whose residual looks like noise is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

KINK_PROBABILITY = 0.05  # of a kink somewhere in a window, before looking
ACCEPTED = 2.0  # a window is accepted up to this many standard deviations of its residual's sum of squares
NO_NOISE = 1e-12  # [1]; stands for 0


@dataclass(frozen=True, slots=True)
class Fit:
    """What a buffer tells of the signal at one sample.

    Attributes
    ----------
    value, variance : casadi.MX, scalar
        The signal there [1] and the variance of its error [1].
    trend : casadi.MX, scalar
        Slope there in standard deviations of its error [1].
    turn : casadi.MX, scalar
        Expected signal at the turning point [1] if one was passed within the window, else ``value``.
    sharp : casadi.MX, scalar
        Probability that a sharp turning point was passed within the window [1]; a round one or none is the rest.
    """

    value: ca.MX
    variance: ca.MX
    trend: ca.MX
    turn: ca.MX
    sharp: ca.MX

    @classmethod
    def choose(cls, condition: ca.MX, yes: Fit, no: Fit) -> Fit:
        """Return one of two."""
        pairs = ((getattr(yes, name), getattr(no, name)) for name in cls.__slots__)
        return cls(*(ca.if_else(condition, *pair) for pair in pairs))


def smooth(y: ca.MX, sigma: ca.MX, half_widths: tuple[int, ...], place: int) -> Fit:
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
    Fit
        Value, variance, trend and turning point there.
    """
    last = y.numel() - 1
    sigma = ca.fmax(sigma, NO_NOISE)
    best = Fit(y[place], sigma**2, ca.MX(0.0), y[place], ca.MX(0.0))
    for m in half_widths:
        middle = min(place, last - m)
        fit, good = _fit(y[middle - m : middle + m + 1], sigma, place - middle)
        best = Fit.choose(good, fit, best)
    return best


def _fit(y: ca.MX, sigma: ca.MX, at: int) -> tuple[Fit, ca.MX]:
    """Fit one window; return what it tells of time ``at``, and whether the residual looks like noise."""
    n = y.numel()
    m = n // 2
    t = np.arange(-m, m + 1.0)
    tau = np.arange(-m + 2, m - 1)
    Q = np.linalg.qr(np.vander(t / m, 3, increasing=True))[0]
    K = np.abs(t[:, None] - tau)
    K -= Q @ (Q.T @ K)
    K /= np.linalg.norm(K, axis=0)

    y0 = y[m]
    y = y - y0
    b, c = ca.mtimes(ca.DM(Q.T), y), ca.mtimes(ca.DM(K.T), y)
    # Bayes' rule; a further coefficient costs ln(n)/2, the large-sample penalty
    odds = KINK_PROBABILITY / (1.0 - KINK_PROBABILITY) / (tau.size * np.sqrt(n))
    gain = 0.5 * (c / sigma) ** 2
    top = ca.mmax(gain)
    w = odds * ca.exp(gain - top)
    w = w / (ca.exp(-top) + ca.sum1(w))

    dof = n - 4
    residual = ca.dot(y, y) - ca.dot(b, b) - ca.dot(w, c * c)

    here = at + m
    q, k = Q[here], K[here]
    bend = ca.dot(w, ca.DM(k) * c)
    value = y0 + ca.dot(ca.DM(q), b) + bend
    spread = ca.dot(w, (ca.DM(k) * c) ** 2) - bend**2
    variance = sigma**2 * (float(q @ q) + ca.dot(w, ca.DM(k**2))) + ca.fmax(spread, 0.0)

    low, high = here - 1, min(here + 1, n - 1)
    dq, dk = Q[high] - Q[low], K[high] - K[low]
    slope = ca.dot(ca.DM(dq), b) + ca.dot(w, ca.DM(dk) * c)
    trend = slope / (sigma * ca.sqrt(float(dq @ dq) + ca.dot(w, ca.DM(dk**2))))

    # a kink is a turning point if the signal runs against itself on its two sides
    passed = np.flatnonzero(tau <= at)
    row, w, c = tau[passed] + m, w[passed.tolist()], c[passed.tolist()]

    def change(a: np.ndarray | int, b_: np.ndarray | int) -> ca.MX:
        return ca.mtimes(ca.DM(Q[a] - Q[b_]), b) + ca.DM(K[a, passed] - K[b_, passed]) * c

    turns = change(row, row - 1) * change(row + 1, row) < 0.0
    turn = value + ca.dot(w, ca.if_else(turns, change(row, here), 0.0))

    return Fit(value, variance, trend, turn, ca.dot(w, turns)), residual <= sigma**2 * (
        dof + ACCEPTED * np.sqrt(2.0 * dof)
    )
