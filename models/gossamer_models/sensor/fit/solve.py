"""From a model and its records to the best parameters: all starts, one solver; and the choice of the regularisation.

The ridge is chosen by predicting the later parts of the training stretch; test stretches play no part. Every training
stretch is cut into ``PARTS``; after the first half, each part is predicted by a fit to all parts before it, just as a fit
to the whole training stretch predicts the test stretch.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from gossamer_files.options import option
from threadpoolctl import threadpool_limits

from ...arrays import Rows, Vector
from ...errors import DataError
from ...fitting.constrained import GaussNewton, Problem, Solution
from ...fitting.records import Record, forward_cuts
from .regression import Regression, moves, prepare
from .settings import PreisachSettings
from .weights import WeightFunction, weight_function

Watch = Callable[[str, int, float], None]
RIDGES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
EQUALLY_GOOD = 0.1  # excess of an error over the smallest that says little


def solve(
    weights: WeightFunction, regression: Regression, settings: PreisachSettings, watch: Watch | None = None
) -> tuple[GaussNewton, tuple[Solution, ...]]:
    """Fit a model to the training samples of its records, from every start; the best solution comes first."""
    # matrices of a hundred columns: waking other threads for them costs many times their work
    with threadpool_limits(1):
        problem = _problem(weights, regression)
        solver = GaussNewton(problem)
        rng = np.random.default_rng(settings.seed)
        solutions = []
        for k in range(settings.starts):
            start = np.concatenate([b.start + (k > 0) * b.spread * rng.normal(size=b.size) for b in weights.blocks])
            report = None
            if watch is not None:
                name = f"start {k + 1} of {settings.starts}"
                report = lambda i, cost, name=name: watch(name, i, 100.0 * np.sqrt(2.0 * cost / regression.samples))  # noqa: E731
            solutions.append(
                solver.minimize(np.clip(start, problem.lower, problem.upper), most=settings.most_iterations, watch=report)
            )
    return solver, tuple(sorted(solutions, key=lambda s: s.cost))


def _problem(weights: WeightFunction, regression: Regression) -> Problem:
    rows = [(s.columns[s.train], s.y[s.train], np.sqrt(s.record.weight)) for s in regression.stretches]
    return Problem(
        A=np.vstack([A @ weights.basis * w for A, _, w in rows]),
        b=np.concatenate([y * w for _, y, w in rows]),
        model=weights.evaluate,
        linear=np.concatenate([np.full(b.size, b.linear) for b in weights.blocks]),
        lower=np.concatenate([b.lower for b in weights.blocks]),
        upper=np.concatenate([b.upper for b in weights.blocks]),
    )


def choose_ridge(
    records: tuple[Record, ...],
    train: tuple[Rows, ...],
    settings: PreisachSettings,
    *,
    full_scale: float,
    rest_resistance: float | None = None,
    watch: Watch | None = None,
) -> PreisachSettings:
    """Return settings with the ridge that predicts best, the same for densities and relaxation.

    Parameters
    ----------
    records, train, settings, full_scale, rest_resistance, watch
        See ``fit_preisach``; only training samples are used. Every trial fit has one start.

    Returns
    -------
    PreisachSettings
        ``ridge`` is within ``RIDGES``; nothing else is changed.

    Raises
    ------
    DataError
        A training stretch is too short to be cut, or its first half never moves.
    """
    regression = prepare(records, train, settings, full_scale)
    errors = []
    for number, ridge in enumerate(RIDGES):
        trial = replace(settings, starts=1, ridge=ridge)
        squares: list[float] = []
        for fitted, held in forward_cuts(train):
            parts = tuple(replace(s, train=rows) for s, rows in zip(regression.stretches, fitted, strict=True))
            if not any(moves(s.strain[s.train]) for s in parts):
                advice = f"Give a number ({option('ridge')})."
                msg = f"the strain rests in the first half of the training stretch, so no ridge can be chosen. {advice}"
                raise DataError(msg)
            part = replace(regression, stretches=parts)
            function = weight_function(trial, part, rest_resistance)
            weights = function(solve(function, part, trial)[1][0].x)
            for s, rows in zip(parts, held, strict=True):
                squares += ((s.response(weights) - s.y)[rows] ** 2).tolist()
        errors.append(float(np.sqrt(np.mean(squares))))
        if watch is not None:
            watch(f"ridge {ridge:g}, predicted within the training stretch", number + 1, 100.0 * errors[-1])
    return replace(settings, ridge=between(RIDGES, np.array(errors)))


def between(ridges: Sequence[float], errors: Vector) -> float:
    """Return a mean of ridges, on a logarithmic scale, weighted by how close each comes to the smallest error.

    Parameters
    ----------
    ridges : sequence of float, length n
        Ridges that were tried.
    errors : ndarray, shape (n,)
        Root mean square error of each.

    Notes
    -----
    Ridges often predict equally well. The best one alone would hang on single samples: without two of 700, the choice moved
    by a factor of three and the error of the test stretch by a fifth. The mean is a smooth function of the errors.
    """
    weights = np.exp(-(errors / errors.min() - 1.0) / EQUALLY_GOOD)
    return float(f"{np.exp(np.average(np.log(ridges), weights=weights)):.3g}")
