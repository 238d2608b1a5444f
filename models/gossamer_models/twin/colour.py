r"""Noise that follows itself: a first-order process of each sensor, as likely as can be by what a fit leaves of a record.

Symbols: ``s`` deviation and ``tau`` correlation time [s] of the noise; ``phi`` its correlation in neighbouring samples [1],
phi^g over g samples; ``h`` step [s]; ``D`` coefficients of differences of order m = 6.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.linalg import toeplitz
from scipy.optimize import minimize

from ..arrays import Matrix, Vector
from .oddities import NOISE_DOUBT
from .problem import RecordProblem
from .record import DIFFERENCES, ResponseRecord
from .search import Fit

CERTAIN = 9.0  # of twice the logarithm of the likelihood: what colour explains of a sensor
STARTS = (1.0, 5.0, 20.0)  # correlation times [samples]
FASTEST = 0.2  # correlation time [samples]
SLOWEST = 0.25  # first periods of a correlation time: what is slower is no noise
ROUNDS = 5  # of noise and fit
SETTLED = 0.1  # of deviation and correlation: what changes less stays
CLOSE = 0.01  # to the likeliest logarithms of deviation and correlation time
D = np.array([(-1.0) ** k * math.comb(DIFFERENCES, k) for k in range(DIFFERENCES + 1)])


def in_colour(
    record: ResponseRecord,
    fit: Fit,
    period: float,
    anew: Callable[[ResponseRecord], tuple[Fit, list[Fit]]],
    weighed: Callable[[ResponseRecord, Vector, Fit], Fit],
) -> tuple[ResponseRecord, Fit, list[Fit]]:
    """Fit a record with the noise of what a fit leaves of it, again and again until the noise stays.

    Parameters
    ----------
    record : ResponseRecord
        Whose noise is not given.
    fit : Fit
        Of it, as if its noise were white.
    period : float
        First period [s] of the structure.
    anew : callable
        Searches a record; returns what ``search`` does.
    weighed : callable
        Fits a record, with the noise of each sensor, from where another fit ended.

    Returns
    -------
    tuple
        The record with its noise, its fit, and other minima; as before where the noise is white, or too slow to be noise.
    """
    white, known, minima, before = fit, record, list[Fit](), np.zeros((2, len(record.values)))
    for _ in range(ROUNDS):
        found = coloured(record, fit, SLOWEST * period)
        now = np.array([found.noise, found.follows])
        if not (now[1].any() or before[1].any()) or np.allclose(now, before, rtol=SETTLED, atol=0.0):
            break
        known, before = found if now[1].any() else record, now
        if fit.passes:
            fit = weighed(known, now[0], fit)
        else:
            fit, minima = anew(known)
    too_slow = known.follows.max() > math.exp(-record.step / (SLOWEST * period) / (1.0 - SETTLED))
    return (record, white, []) if too_slow else (known, fit, minima)


def of_noise(record: ResponseRecord) -> list[str]:
    """Say of each sensor whose noise is coloured how large and how slow it is."""
    factor, unit = (100.0, "%") if record.kind == "strain" else (1.0, "ohm")
    time = [-1e3 * record.step / math.log(phi) if phi else 0.0 for phi in record.follows]
    return [
        f"the noise of sensor {k} is coloured: {factor * size:.2g} {unit}, correlation time {ms:.2g} ms"
        for k, (size, ms) in enumerate(zip(record.noise_deviation(), time, strict=True), 1)
        if ms
    ]


def coloured(record: ResponseRecord, fit: Fit, slowest: float) -> ResponseRecord:
    """Return a record with the noise that is likeliest beside a fit, coloured of each sensor where that is certain.

    Parameters
    ----------
    record : ResponseRecord
        Whose noise is not given.
    fit : Fit
        Of what is compared of it.
    slowest : float
        Longest correlation time [s]: what is slower is no noise.
    """
    problem, compared = fit.problem, record.first(fit.problem.record.samples)
    reading, unknown = problem.reading(fit.point), problem.unknown(fit.point)
    rough = replace(compared, least_noise=0.0).noise_deviation(reading)
    noise, follows = np.fmin(record.noise_deviation(), compared.noise_deviation(reading)), np.zeros(len(rough))
    least = np.broadcast_to(record.least_noise, len(rough))
    for k in compared.sensors:
        left = np.nan_to_num(compared.values[[k]] - reading[[k]])
        unlikely = _unlikelihood(problem, k, left, unknown, rough[k])
        sizes = np.log([rough[k], max(rough[k], np.sqrt(np.mean(left**2)))]).tolist()
        limits = [(sizes[0] - 1.0, sizes[1] + 3.0), (math.log(FASTEST * record.step), math.log(slowest))]
        taus = np.log(np.multiply(STARTS, record.step)).tolist()
        ends = [
            minimize(
                unlikely,
                min(starts, key=unlikely),
                method="Nelder-Mead",
                bounds=limits[: len(starts[0])],
                options={"xatol": CLOSE, "fatol": CLOSE},
            )
            for starts in ([(size,) for size in sizes], list(product(sizes, taus)))
        ]
        if ends[1].fun < ends[0].fun - CERTAIN:
            noise[k], follows[k] = max(math.exp(ends[1].x[0]), least[k]), math.exp(-record.step / math.exp(ends[1].x[1]))
    return replace(record, noise=np.where(np.isfinite(noise), noise, 1.0), correlation=follows)  # 1: of those left out


def _unlikelihood(
    problem: RecordProblem, sensor: int, left: Matrix, unknown: Matrix, rough: float
) -> Callable[[Vector | tuple[float, ...]], float]:
    r"""Return minus twice the logarithm of the likelihood of what is left of a sensor, by those of s and, if coloured, tau.

    Notes
    -----
    Unknowns and errors of the model are marginalised. Where splines alone are compared, most of the noise is faster, and the
    differences of what is left count too: their variance is :math:`s^2 \sum_{ij} D_i D_j \varphi^{|i-j|}`.
    """
    freedom = 2.0 * problem.record.present[sensor].sum() / NOISE_DOUBT**2

    def unlikely(x: Vector | tuple[float, ...]) -> float:
        phi = math.exp(-problem.record.step / math.exp(x[1])) if len(x) > 1 else 0.0
        weights = problem.alone(sensor, math.exp(x[0]), phi, unknown)
        r = weights.weigh(left[None])[0]
        value = float(r @ r) + weights.log_determinant + 2.0 * weights.values * x[0]
        if problem.in_time:
            return value
        share = (rough / math.exp(x[0])) ** 2 * (D @ D) / (D @ toeplitz(phi ** np.arange(D.size)) @ D)
        return float(value + freedom * (share - math.log(share)))

    return unlikely
