r"""Which further record, or gauge, would tell the explanations of a record apart.

Symbols: ``a``, ``b`` the two likeliest explanations, ``D`` what they differ by in a record [noise], ``J`` derivatives of it
by the unknowns of b, ``A`` their curvature as the first record leaves it, ``n`` unknowns.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy

import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError
from ..membrane.candidates import candidates
from .forward import MembraneForward
from .least_squares import neighbours, require_finite
from .nuisances import LASTING, NUMBERS, Loads, number_of
from .problem import RecordProblem
from .record import StaticRecord
from .search import Fit

SECOND = 0.05  # probability of the second explanation from which on a further record is looked for
FACTORS = (0.5, 2.0)  # of loads and of the frequency
POINTS = 12  # of further gauges, four directions at each
TELLS = 10.0  # chi2 that is expected to lie between explanations that a record tells apart
FREQUENCY, AMPLITUDE = "pressure_frequency", "pressure_amplitude"


def further(fit: Fit) -> str:
    """Return a sentence on what would tell the two likeliest explanations of a record apart; nothing where one is likely.

    Notes
    -----
    If a is right, b misses a further record by :math:`D^T D - D^T J (J^T J + A)^{-1} J^T D` of chi2, after its own unknowns
    have taken what they can: those of the structure are as well known as before, load, clock and offsets of another record
    are unknown anew. Tried are half and twice the loads, and of the built-in load the frequency; and a gauge more in the
    record as it was.
    """
    problem, likely = fit.problem, fit.likely
    order = np.argsort(-likely.weight, kind="stable")[:2]
    if not isinstance(problem, RecordProblem) or len(order) < 2 or likely.weight[order[1]] < SECOND:
        return ""
    a, b = (fit.point.x + likely.move[k] for k in order)
    free = likely.kept[order[1]].copy()
    free[problem.zones :] = True
    records, gauges = (dict(each(fit, a, b, free)) for each in (_records, _gauges))
    found = records | gauges
    if not found:
        return ""
    what, most = max(found.items(), key=lambda each: each[1])
    if most < TELLS:
        tried = ["under half and twice the loads"] * bool(records) + ["with a gauge more"] * bool(gauges)
        return f"The two likeliest explanations stay alike {', and '.join(tried)}."
    return f"{what} would tell the two likeliest explanations apart: a chi2 of {most:.0f} is expected between them."


def _records(fit: Fit, a: Vector, b: Vector, free: Rows) -> Iterator[tuple[str, float]]:
    """Give what other records would tell, by what they are."""
    problem: RecordProblem = fit.problem
    own = np.zeros(problem.size, dtype=bool)
    own[problem.zones :] = [number_of(name) not in (*NUMBERS, *LASTING) for name in problem.nuisances.names]
    A = _known(fit.model.A, free, own)
    for what, loads in _loads(problem):
        other = problem.under_loads(loads)
        rows, steps = _around(other, np.where(own, 0.0, a), np.where(own, 0.0, b), free)
        try:
            y = other.weigh(require_finite(other.predict(rows)), rows)
        except ConvergenceError:
            continue
        yield what, _left(y, steps, A)


def _gauges(fit: Fit, a: Vector, b: Vector, free: Rows) -> Iterator[tuple[str, float]]:
    """Give what one gauge more in the same record would tell, by where it is."""
    problem: RecordProblem = fit.problem
    model, record = problem.model, problem.record
    if not isinstance(model, MembraneForward) or record.kind != "strain":
        return
    gauges, own = candidates(model.structure, POINTS, own=True), model.structure.n_sensors  # on which faults act
    other = copy(problem)
    other.model = MembraneForward(model.structure, {**model.parameters, **model.inputs}, gauges, model.faults)
    rows, steps = _around(problem, a, b, free)
    y = other.histories(rows, record.states, 0.0 if isinstance(record, StaticRecord) else record.step)
    y = (y - y.mean(axis=2, keepdims=True)) / float(np.nanmedian(problem.noise))
    A = fit.model.A[np.ix_(free, free)]
    for k, sensor in list(enumerate(gauges.sensors))[own:]:
        at, along = (", ".join(f"{value:.3g}" for value in each) for each in (sensor.point, sensor.direction))
        if np.isfinite(y[:, k]).all():
            yield f"A gauge at ({at}) m along ({along})", _left(y[:, k], steps, A)


def _loads(problem: RecordProblem) -> Iterator[tuple[str, Loads]]:
    """Give other loads, by what a record under them is called."""
    if not isinstance(problem.model, MembraneForward):
        return
    known, model = problem.nuisances.loads, problem.model
    numbers = {**model.parameters, **model.inputs, **known.start}
    built_in = numbers.get(AMPLITUDE, 0.0) > 0.0 and not isinstance(problem.record, StaticRecord)
    loads = [load.name for load in model.structure.setup.loads if load.name in model.inputs]
    acting = [name for name in loads if numbers[name] or np.any(known.histories.get(name, 0.0))]
    for name in (*[AMPLITUDE, FREQUENCY] * built_in, *acting):
        for factor in FACTORS:
            start = {**known.start, name: factor * numbers[name]}
            histories = {each: factor * load if each == name else load for each, load in known.histories.items()}
            yield f"A record with {factor:g} times the {name}", Loads(start, histories)


def _known(A: Matrix, free: Rows, own: Rows) -> Matrix:
    """Return the curvature over free unknowns for another record: that of the first one without its own, which have 1."""
    kept, left = free & ~own, free & own
    found = np.eye(A.shape[0])
    beside = A[np.ix_(kept, left)] @ np.linalg.pinv(A[np.ix_(left, left)], hermitian=True)
    found[np.ix_(kept, kept)] = A[np.ix_(kept, kept)] - beside @ A[np.ix_(left, kept)]
    return found[np.ix_(free, free)]


def _around(problem: RecordProblem, a: Vector, b: Vector, free: Rows) -> tuple[Matrix, Vector]:
    """Return rows of both explanations, then of b with each free unknown moved, and the moves."""
    at = np.flatnonzero(free)
    moved, steps = neighbours(b, at, problem.steps[at], problem.high)
    return np.vstack([a, b, moved]), steps


def _left(y: Matrix, steps: Vector, A: Matrix) -> float:
    """Return the chi2 between the first two rows that the unknowns of the others, of curvature A, do not take."""
    D, J = y[0] - y[1], ((y[2:] - y[1]) / steps[:, None]).T
    slope = J.T @ D
    return float(D @ D - slope @ np.linalg.lstsq(J.T @ J + A, slope)[0])
