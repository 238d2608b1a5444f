r"""Least squares of several records of one structure together.

Symbols: ``x`` unknowns: first damages that all records share, or what has grown of them, then shared nuisances, then the
damages of the last inspection, in units of their deviations, then what each record has for itself; ``k`` records.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Rows, Vector
from .forward import Forward, side_by_side
from .least_squares import LeastSquares, Point
from .nuisances import BEYOND, LASTING, MODULUS, SCALES, number_of, root_of
from .problem import RecordProblem
from .sensor_error import SensorError
from .zone_sets import ODDS

STEP = 5e-3  # of central differences, in units of the priors: errors of others would tell what no record can


@dataclass(frozen=True)
class Before:
    """Damages as they were at the last inspection.

    Attributes
    ----------
    damage : ndarray, shape (zones,)
        The likeliest [1].
    root : ndarray, shape (zones, zones)
        Times its transpose, their covariance [1].
    """

    damage: Vector
    root: Matrix


class JointProblem(LeastSquares):
    """Least squares for records of one structure, with one damage of each zone.

    Parameters
    ----------
    problems : sequence of RecordProblem
        Of each record, every zone an unknown of its own.
    shared : sequence of str
        Nuisances that are the same in all records; one that no record has is as likely as its prior.
    groups : ndarray of int, shape (all zones,), or None
        Which unknown each zone's damage is, from 0; None for one each.
    before : Before or None
        Then the first unknowns are what has been added to these damages.

    Attributes
    ----------
    zones, whole, odds
        As of ``DamageUnknowns``.
    maps : list of tuple
        What turns unknowns into those of each record: start, shape (n,), and matrix, shape (n, size).
    parts : tuple of tuple
        Each record's problem, its values among all, and which record it is, in words.
    """

    sensor_error: SensorError | None = None  # those of the records are kept as they were fitted

    def __init__(
        self,
        problems: Sequence[RecordProblem],
        shared: Sequence[str],
        groups: NDArray[np.int64] | None = None,
        before: Before | None = None,
    ) -> None:
        self.problems, self.before = tuple(problem.central(STEP) for problem in problems), before
        self.model = problems[0].model
        self.shared = tuple(shared)
        all_zones = len(self.model.zones)
        self.groups = np.arange(all_zones) if groups is None else groups
        self.zones = int(self.groups.max()) + 1
        self.whole = self.zones - (problems[0].zones - problems[0].whole)
        size, places = self.zones + len(self.shared), {name: self.zones + k for k, name in enumerate(self.shared)}
        of_before = slice(size, size + (0 if before is None else all_zones))
        size, at = of_before.stop, list[list[int]]()
        for problem in problems:
            own = {name: size + k for k, name in enumerate(n for n in problem.nuisances.names if n not in self.shared)}
            at.append([(places | own)[name] for name in problem.nuisances.names])
            size += len(own)
        self.maps = []
        for problem, where in zip(problems, at, strict=True):
            start, matrix = np.zeros(problem.size), np.zeros((problem.size, size))
            matrix[np.arange(all_zones), self.groups] = 1.0
            matrix[all_zones + np.arange(len(where)), where] = 1.0
            self._mix(problem, places, matrix[all_zones:])
            if before is not None:
                start[:all_zones], matrix[:all_zones, of_before] = before.damage, before.root
            self.maps.append((start, matrix))
        self.size = self.simulated = size
        self.y = np.concatenate([problem.y for problem in problems])
        self.values = sum(problem.values for problem in problems)
        damages = np.arange(size) < self.zones
        self.low, self.high = np.where(damages, 0.0, -BEYOND), np.full(size, BEYOND)
        self.high[self.groups], self.odds = problems[0].high[:all_zones], np.full(size, ODDS)
        self.odds[self.groups] = problems[0].odds[:all_zones]
        self.prior = np.where(damages, 0.0, 1.0)
        self.prior[self.groups] = problems[0].prior[:all_zones]
        self.steps = np.full(size, STEP)
        ends = np.cumsum([problem.y.size for problem in problems]).tolist()
        self.parts = tuple(
            (problem, slice(end - problem.y.size, end), f" of record {k}")
            for k, (problem, end) in enumerate(zip(problems, ends, strict=True), 1)
        )

    def _mix(self, problem: RecordProblem, places: dict[str, int], matrix: Matrix) -> None:
        """Write how the factors of a record follow from those of all, where these are known together and it lacks some."""
        order = (*SCALES, *LASTING)  # of ``root_of`` in every record
        there = sorted((name for name in places if number_of(name) in order), key=lambda name: order.index(number_of(name)))
        own = [name for name in problem.nuisances.names if name in there]
        if own == there or problem.nuisances.spread is None:
            return
        rows = [problem.nuisances.names.index(name) for name in own]
        whole = root_of(there, problem.nuisances.spread)[[there.index(name) for name in own]]
        mixed = np.linalg.solve(root_of(own, problem.nuisances.spread), whole)
        matrix[np.ix_(rows, [places[name] for name in there])] = mixed

    @property
    def log_determinant(self) -> float:
        """Of the covariance of all records beside what is fitted."""
        return sum(problem.log_determinant for problem in self.problems)

    @property
    def at_once(self) -> bool:
        """Whether some predictions cost little more than one."""
        return any(problem.at_once for problem in self.problems)

    @property
    def modulus(self) -> int | None:
        """Which unknown is the factor on Young's modulus, where the first ones are whole damages."""
        return None if self.before or MODULUS not in self.shared else self.zones + self.shared.index(MODULUS)

    def z(self, x: Matrix) -> Matrix:
        """Return all unknowns but the first damages, in units of their priors."""
        return x[:, self.zones :]

    def rows(self, k: int, x: Matrix) -> Matrix:
        """Return the unknowns of one record, from 0, shape (m, n)."""
        start, matrix = self.maps[k]
        problem = self.problems[k]
        return np.asarray(np.clip(start + x @ matrix.T, problem.low, problem.high))

    def point(self, k: int, x: Vector) -> Point:
        """Simulate one record, from 0."""
        return self.problems[k].points(self.rows(k, x[None]))[0]

    def predict(self, x: Matrix) -> Matrix:
        """Return weighed predictions of all records, shape (m, 1, values)."""
        found = side_by_side(lambda k: self._weighed(k, x), range(len(self.problems)))
        return np.concatenate(found, axis=1)[:, None]

    def _weighed(self, k: int, x: Matrix) -> Matrix:
        problem, rows = self.problems[k], self.rows(k, x)
        return problem.weigh(problem.predict(rows), rows)

    def weigh(self, predicted: Matrix, x: Matrix) -> Matrix:  # noqa: ARG002
        """Return what was weighed, shape (m, values)."""
        return predicted[:, 0]

    def derivatives(self, point: Point, free: Rows) -> Matrix:
        """Return the derivatives of the weighed predictions; what a record has for itself changes no other."""
        found = []
        for k, problem in enumerate(self.problems):
            matrix = self.maps[k][1][:, free]
            moving = np.asarray(matrix.any(axis=1))
            found.append(problem.derivatives(self.point(k, point.x), moving) @ matrix[moving])
        return np.concatenate(found)

    def chi2_of_records(self, point: Point) -> list[float]:
        """Return chi2 of each record."""
        return [float(point.r[values] @ point.r[values]) for _, values, _ in self.parts]

    def placed(self, x: Vector, places: Callable[[RecordProblem, Vector], RecordProblem]) -> JointProblem:
        """Return the same with what places of sensors change at unknowns, as a function gives it for each record."""
        found = [places(problem, self.rows(k, x[None])[0]) for k, problem in enumerate(self.problems)]
        return JointProblem(found, self.shared, self.groups, self.before)

    def under(self, noise: Sequence[Vector]) -> JointProblem:
        """Return the same under other noise of each record, in its unit."""
        found = [problem.under(own) for problem, own in zip(self.problems, noise, strict=True)]
        return JointProblem(found, self.shared, self.groups, self.before)

    def corrected(
        self, x: Vector, moving: Rows, needed: Rows, finer: Sequence[tuple[Forward, Matrix] | None]
    ) -> JointProblem:
        """Return the same with what a finer mesh adds about unknowns.

        Parameters
        ----------
        x : ndarray, shape (size,)
            Where the finer mesh is simulated.
        moving : ndarray of bool, shape (size,)
            Unknowns by which it is differentiated.
        needed : ndarray of bool, shape (size,)
            Those of them without which derivatives that were taken nearby do not serve again.
        finer : sequence of tuple or None
            The finer mesh of each record, and components of the error that is left there; None if it has none.

        Raises
        ------
        ConvergenceError
            A finer mesh fails there.
        """
        found = []
        for k, (problem, mesh) in enumerate(zip(self.problems, finer, strict=True)):
            if mesh is None:
                found.append(problem)
                continue
            of_record = self.maps[k][1][: problem.simulated]
            by, own = (np.flatnonzero(of_record[:, each].any(axis=1)) for each in (moving, needed))
            found.append(problem.corrected(mesh[0], self.point(k, x), by, own, mesh[1]))
        return JointProblem(found, self.shared, self.groups, self.before)
