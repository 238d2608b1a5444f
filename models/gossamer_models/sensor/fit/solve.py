"""From a model and its records to the best parameters: all starts, one solver."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

from ...fitting.constrained import GaussNewton, Problem, Solution
from .regression import Regression
from .settings import PreisachSettings
from .weights import WeightFunction

Watch = Callable[[str, int, float], None]


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
                solver.minimize(
                    np.clip(start, problem.lower, problem.upper), most=settings.most_iterations, watch=report
                )
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
