"""Wall time of a whole Preisach fit beside ``scipy.optimize.least_squares`` on the same residual."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np
from gossamer_models.sensor.fit import PreisachFit, PreisachSettings, fit_preisach
from numpy.typing import NDArray
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from .metrics import Metric
from .specimen import specimen_record

Vector = NDArray[np.float64]


def run_speed(neighbours: int = 4, evaluations: int = 1000) -> list[Metric]:
    """Compare the fit M = P = 7 with ``scipy.optimize.least_squares``: same residual, same start, finite differences.

    The peer gets the bounds but not the constraints on densities, which it does not support. It runs with its default
    settings, and with the scaling by columns that helps it most. Its time is that of its iterations on the residual
    function of the fit. Ours is that of the iterations, or of the whole fit with preparation and artifact. How often the
    peer evaluates depends on rounding (2700 to 20000 times from starts 1e-9 apart), so one run shows little: it runs from
    the same start and from ``neighbours`` of it, in at most ``evaluations`` iterations, and the median counts.
    """
    record = specimen_record(1)
    settings = PreisachSettings.of("preisach", starts=1)
    full_scale = float(record.strain.max())

    def whole() -> PreisachFit:
        return fit_preisach((record,), (record.time < 200.0,), settings, full_scale=full_scale, rest_resistance=0.0)

    fit = whole()
    solver, problem = fit.solver, fit.solver.problem
    free = problem.lower < problem.upper
    bounds = problem.lower[free], problem.upper[free]
    start = np.clip(np.concatenate([b.start for b in fit.blocks]), problem.lower, problem.upper)
    rng = np.random.default_rng(0)
    starts = [start[free], *(np.clip(start[free] + 1e-9 * rng.normal(size=free.sum()), *bounds) for _ in range(neighbours))]

    def residual(q: Vector) -> Vector:
        x = start.copy()
        x[free] = q
        return solver.stacked(x)

    def peer(q: Vector, scale: float | str) -> float:
        return _seconds(partial(least_squares, residual, q, bounds=bounds, x_scale=scale, max_nfev=evaluations))

    with threadpool_limits(1):  # as the fit does; the peer is faster so, too
        runs = [(_seconds(whole), _seconds(partial(solver.minimize, start)), peer(q, 1.0), peer(q, "jac")) for q in starts]
    seconds, iterating, plain, scaled = np.transpose(runs)
    ours, alone = float(np.median(seconds)), float(np.median(iterating))
    metrics = [
        Metric(what="fit M = P = 7, 400 samples, reading to artifact", unit="s", value=ours, target=10.0),
        Metric(what="its iterations alone", unit="s", value=alone),
    ]
    for name, times, target in (("", plain, 20.0), (" with scaled columns", scaled, None)):
        median = float(np.median(times))
        faster = f"whole fit faster than least_squares{name} by"
        metrics += [
            Metric(what=f"least_squares{name}, from the same start", unit="s", value=float(times[0])),
            Metric(what=f"least_squares{name}, least of five", unit="s", value=float(times.min())),
            Metric(what=f"least_squares{name}, median of five", unit="s", value=median),
            Metric(what=f"iterations faster than least_squares{name} by", unit="times", value=median / alone),
            Metric(what=faster, unit="times", value=median / ours, target=target, more_is_better=True),
        ]
    return metrics


def _seconds(call: Callable[[], object]) -> float:
    begun = time.perf_counter()
    call()
    return time.perf_counter() - begun
