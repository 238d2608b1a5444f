r"""Probability of detection against size, from hits and misses.

Symbols: ``a`` sizes, ``x`` sizes or their logarithms, ``y`` 1 for a hit and 0 for a miss, ``b0 + b1 x`` logit of the
probability of detection, ``l`` logarithm of the likelihood, ``D`` deviance from its maximum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import expit, logit
from scipy.stats import chi2

from ..arrays import Rows, Vector
from ..errors import DataError
from .proportions import CONFIDENCE, size_by_counts

DETECTED = 0.9  # probability of detection of a90
CRITICAL = float(chi2.ppf(2.0 * CONFIDENCE - 1.0, 2))  # 4.605: one side of a band around the whole curve
FAR = 12.0  # ranges of size beyond the largest, where a bound is no bound any more
STEEPEST = 1e3  # logits from the smallest to the largest size: a step
ALL_HIT, NONE_HIT = "every size was hit", "nothing was hit"
APART = "all hits are larger than all misses"


@dataclass(frozen=True, kw_only=True)
class Pod:
    """Probability of detection against size.

    Attributes
    ----------
    size : ndarray, shape (n,)
        Sizes, in any unit.
    hit : ndarray of bool, shape (n,)
        Which of them were detected.
    scale : {"log", "linear"}
        Whether the logit is linear in the logarithm of size or in size.
    intercept, slope : float
        Of the logit; not a number if the likelihood has no maximum.
    log_likelihood : float
        Its largest value; 0 if hits and misses do not overlap.
    a50, a90 : float
        Sizes detected with probability 1/2 and 0.9; not a number if the likelihood has no maximum.
    a90_95 : float
        Upper 95 % confidence bound of a90; infinite if the data set none.
    by_counts : float
        Size from which on enough were hit to say the same without a model; see ``size_by_counts``.
    remark : str
        What is unusual about the data; empty if nothing is.
    """

    size: Vector
    hit: Rows
    scale: Literal["log", "linear"]
    intercept: float
    slope: float
    log_likelihood: float
    a50: float
    a90: float
    a90_95: float
    by_counts: float
    remark: str

    def probability(self, size: ArrayLike) -> Vector:
        """Return the most likely probability of detection at some sizes."""
        return np.asarray(expit(self.intercept + self.slope * _abscissa(size, self.scale)))

    def lower_bound(self, size: ArrayLike) -> Vector:
        """Return the lower 95 % confidence bound of the probability of detection at some sizes."""
        x = _abscissa(self.size, self.scale)
        return np.array(
            [_lower(x, self.hit, self.log_likelihood, at) for at in np.atleast_1d(_abscissa(size, self.scale))]
        )


def fit_pod(size: ArrayLike, hit: ArrayLike, scale: Literal["log", "linear"] = "log") -> Pod:
    r"""Fit the probability of detection to hits and misses.

    Parameters
    ----------
    size : array_like, shape (n,)
        Sizes, positive if ``scale`` is "log".
    hit : array_like of bool, shape (n,)
        Which of them were detected.
    scale : {"log", "linear"}
        Whether the logit is linear in the logarithm of size or in size.

    Returns
    -------
    Pod

    Raises
    ------
    DataError
        There are no sizes, or they are not finite, not positive or not as many as the hits.

    Notes
    -----
    Appendix G of [1]_ for hit/miss data: a generalized linear model with logit link, fitted by maximum likelihood, with
    confidence bounds from the ratio of likelihoods. The bound at one size is the lowest of all curves with

    .. math:: D = 2 (l_{max} - l) \le \chi^2_{2; 0.90} = 4.605,

    which is the one-sided 95 % band of [2]_ and [3]_ for large samples; a90/95 is the size at which it reaches 0.9. With one
    degree of freedom, 2.706, the bound holds at one size only, and in simulated samples of 60 sizes it covers a90 in 90 %.

    There is a maximum if, and only if, some miss is larger than some hit and some hit larger than some miss [4]_. If all
    hits are larger than all misses, or there is no miss, ``remark`` says so. Then a90/95 is the larger of ``by_counts``,
    which needs no model, and the bound by D with l_max = 0, the supremum. If nothing was hit, or size does not matter (D of
    a constant is below 4.605), there is no bound.

    References
    ----------
    .. [1] MIL-HDBK-1823A, Nondestructive Evaluation System Reliability Assessment, U.S. Department of Defense, 2009.
    .. [2] R. C. H. Cheng, T. C. Iles, Technometrics 25(1), 77-86, 1983.
    .. [3] A. P. Berens, NDE Reliability Data Analysis, Metals Handbook, 9th ed., vol. 17, ASM International, 1989, 689-701.
    .. [4] A. Albert, J. A. Anderson, Biometrika 71(1), 1-10, 1984, doi:10.1093/biomet/71.1.1.
    """
    a, y = np.asarray(size, dtype=float), np.asarray(hit, dtype=bool)
    if a.ndim != 1 or a.size == 0 or a.shape != y.shape or not np.isfinite(a).all():
        msg = f"a probability of detection needs finite sizes and as many hits, not shapes {a.shape} and {y.shape}"
        raise DataError(msg)
    if scale == "log" and a.min() <= 0.0:
        msg = f"a size is {a.min():g}, which has no logarithm. Leave undamaged records out, or use the linear scale."
        raise DataError(msg)
    x = _abscissa(a, scale)
    remark = _remark(x, y)
    b0, b1, l = (math.nan, math.nan, 0.0) if remark else _fit(x, y)
    bounded, far = remark in ("", ALL_HIT, APART), x.max() + FAR * max(float(np.ptp(x)), 1e-9)
    if not remark and b1 <= 0.0:
        bounded, remark = False, "detection does not rise with size"
    x90 = math.nan if remark else (logit(DETECTED) - b0) / b1
    bound = _bound(x, y, l, x90 if math.isfinite(x90) else float(x[y].min()), far) if bounded else math.inf
    if bounded and math.isinf(bound):
        remark = "the data do not show that detection rises with size"
    back = np.exp if scale == "log" else np.asarray
    by_counts = size_by_counts(a, y, DETECTED)
    bound = float(back(bound))
    return Pod(
        size=a,
        hit=y,
        scale=scale,
        intercept=b0,
        slope=b1,
        log_likelihood=l,
        a50=math.nan if math.isnan(x90) else float(back(-b0 / b1)),
        a90=float(back(x90)),
        a90_95=max(bound, by_counts) if remark else bound,
        by_counts=by_counts,
        remark=remark,
    )


def _abscissa(size: ArrayLike, scale: str) -> Vector:
    a = np.asarray(size, dtype=float)
    return np.asarray(np.log(a)) if scale == "log" else a


def _remark(x: Vector, y: Rows) -> str:
    """Say why the likelihood has no maximum; nothing if it has one."""
    if y.all():
        return ALL_HIT
    if not y.any():
        return NONE_HIT
    if x[~y].max() <= x[y].min():
        return APART
    if x[y].max() <= x[~y].min():
        return "all hits are smaller than all misses"
    return ""


def _log_likelihood(x: Vector, y: Rows, b0: float, b1: float) -> float:
    z = b0 + b1 * x
    return float(-np.logaddexp(0.0, np.where(y, -z, z)).sum())


def _fit(x: Vector, y: Rows) -> tuple[float, float, float]:
    """Return intercept, slope and log-likelihood at the maximum: Newton steps, halved until the likelihood rises."""
    X = np.column_stack([np.ones_like(x), (x - x.mean()) / x.std()])
    b = np.array([logit(y.mean()), 0.0])
    l = _log_likelihood(X[:, 1], y, *b)
    for _ in range(100):
        p = expit(X @ b)
        step = np.linalg.solve((X.T * (p * (1.0 - p))) @ X, X.T @ (y - p))
        while (new := _log_likelihood(X[:, 1], y, *(b + step))) < l - 1e-12 * abs(l):
            step /= 2.0
        b, l = b + step, new
        if np.abs(step).max() < 1e-10:
            break
    slope = float(b[1] / x.std())
    return float(b[0] - slope * x.mean()), slope, l


def _profile(x: Vector, y: Rows, at: float, eta: float) -> float:
    """Return the largest log-likelihood of all curves with a logit ``eta`` at a place: guarded Newton steps."""
    d = x - at
    low, high = (sign * STEEPEST / max(float(np.ptp(x)), 1e-9) for sign in (-1.0, 1.0))
    b = 0.0
    for _ in range(200):
        p = expit(eta + b * d)
        slope, curvature = d @ (y - p), (d**2) @ (p * (1.0 - p))
        low, high = (b, high) if slope > 0.0 else (low, b)
        new = b + slope / curvature if curvature > 0.0 else math.inf
        new = new if low < new < high else 0.5 * (low + high)
        if abs(new - b) <= 1e-9 * (1e-3 + abs(b)):
            break
        b = new
    return _log_likelihood(d, y, eta, b)


def _bound(x: Vector, y: Rows, l: float, x90: float, far: float) -> float:
    """Return where the lower bound of the curve reaches 0.9, beyond x90; infinity if it does not."""

    def excess(at: float) -> float:
        return 2.0 * (l - _profile(x, y, at, float(logit(DETECTED)))) - CRITICAL

    begin, reach = x90, max(0.05 * float(np.ptp(x)), 1e-6)
    while (
        excess(begin + reach) <= 0.0
    ):  # step over what is steep in a small sample, never beyond the first crossing by much
        begin += reach
        reach *= 1.3
        if begin > far:
            return math.inf
    return float(brentq(excess, begin, begin + reach, xtol=1e-10 * max(1.0, abs(begin))))


def _lower(x: Vector, y: Rows, l: float, at: float) -> float:
    """Return the lower bound of the probability at a place: where D reaches its critical value below the best curve."""

    def excess(eta: float) -> float:
        return 2.0 * (l - _profile(x, y, at, eta)) - CRITICAL

    best = _best_logit(x, y, at)
    if best <= -STEEPEST:
        return 0.0
    lowest = best - 1.0
    while excess(lowest) <= 0.0:
        lowest -= 2.0 * (best - lowest)
        if lowest < -STEEPEST:
            return 0.0
    return float(expit(brentq(excess, lowest, best, xtol=1e-9)))


def _best_logit(x: Vector, y: Rows, at: float) -> float:
    """Return the most likely logit at a place; one of a step where hits and misses do not overlap."""
    if not _remark(x, y):
        b0, b1, _ = _fit(x, y)
        return b0 + b1 * at
    if _remark(x, y) not in (ALL_HIT, APART):
        return -STEEPEST
    if y.all():
        return 30.0
    above = STEEPEST / float(np.ptp(x)) * (at - x[~y].max())  # of the steepest curve, beyond the last miss
    return min(30.0, 0.5 * above) if above > 0.0 else -STEEPEST
