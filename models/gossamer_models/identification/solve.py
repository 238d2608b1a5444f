"""From a model and stretches to its best parameters: all starts, one solver."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

from .least_squares import GaussNewton, Problem, Solution
from .model import PreisachModel
from .settings import FitSettings
from .stretches import Stretch

Watch = Callable[[str, int, float], None]


def solve(
    model: PreisachModel, stretches: tuple[Stretch, ...], settings: FitSettings, watch: Watch | None = None
) -> tuple[GaussNewton, tuple[Solution, ...]]:
    """Fit a model to the training samples of some stretches, from every start; the best solution comes first."""
    with threadpool_limits(
        1
    ):  # matrices of a hundred columns: waking other threads for them costs many times their work
        problem = _problem(model, stretches)
        solver = GaussNewton(problem)
        rows = sum(int(s.train.sum()) for s in stretches)
        rng = np.random.default_rng(settings.seed)
        solutions = []
        for k in range(settings.starts):
            start = np.concatenate([b.start + (k > 0) * b.spread * rng.normal(size=b.size) for b in model.blocks])
            report = None
            if watch is not None:
                name = f"start {k + 1} of {settings.starts}"
                report = lambda i, cost, name=name: watch(name, i, 100.0 * np.sqrt(2.0 * cost / rows))  # noqa: E731
            solutions.append(
                solver.minimize(
                    np.clip(start, problem.lower, problem.upper), most=settings.most_iterations, watch=report
                )
            )
    return solver, tuple(sorted(solutions, key=lambda s: s.cost))


def _problem(model: PreisachModel, stretches: tuple[Stretch, ...]) -> Problem:
    rows = [(s.A[s.train], s.output[s.train], np.sqrt(s.record.weight)) for s in stretches]
    return Problem(
        A=np.vstack([A @ model.basis * w for A, _, w in rows]),
        b=np.concatenate([b * w for _, b, w in rows]),
        model=model.function,
        linear=np.concatenate([np.full(b.size, b.linear) for b in model.blocks]),
        lower=np.concatenate([b.lower for b in model.blocks]),
        upper=np.concatenate([b.upper for b in model.blocks]),
    )
