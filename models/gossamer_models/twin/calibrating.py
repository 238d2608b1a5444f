r"""Calibrate a structure on its healthy records: least squares of all records together, without damage.

Symbols: ``s`` factors on numbers of the structure, which all records share; ``x`` these, in units of their priors, then what
each record has for itself: clock, load, gains and offsets of sensors; ``z`` zones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri
from threadpoolctl import threadpool_limits

from ..arrays import Matrix, Rows, Vector
from ..errors import DataError, ParameterError, require
from ..membrane import Structure, square_structure
from ..sensor import SensorArtifact
from .calibration import Calibration, drawing_of, with_factors
from .least_squares import LeastSquares, Minimum, Point, descend
from .mesh_error import MeshErrors
from .nuisances import BEYOND, OF_BUILT_IN, SCALES, scaled_by
from .oddities import chi2_bound
from .problem import RecordProblem
from .record import ResponseRecord
from .twin import Twin

OWN = OF_BUILT_IN  # factors that each record has for itself
NUMBERS = tuple(name for name in SCALES if name not in OWN)
PRIORS = {name: SCALES[name][1] for name in NUMBERS} | {"modulus": 0.05}  # deviations of logarithms
ROUNDS = 3  # of simulations on a finer mesh
UNTOLD = 0.5  # of the prior's variance: a combination of numbers with more left is not decided
NAMED = 0.3  # share of such a combination that is named
HEALTHY = 1e-4  # chance that some zone of healthy records seems damaged
NEAR_BOUND = 0.99
STEP = 5e-3  # of central differences, in units of the priors: errors of others would tell what no record can


def calibrate(
    structure: Structure | None,
    records: Sequence[ResponseRecord],
    *,
    parameters: Mapping[str, float] | None = None,
    priors: Mapping[str, float] | None = None,
    sensor: SensorArtifact | None = None,
    sensor_parameters: Mapping[str, ArrayLike] | None = None,
    mesh_error: bool = True,
    report: Callable[[str], None] = lambda _: None,
) -> Calibration:
    """Fit the numbers of a structure to records of it without damage, all records together.

    Parameters
    ----------
    structure : Structure or None
        As drawn; None for the square of the thesis.
    records : sequence of ResponseRecord
        Healthy records.
    parameters : mapping of str to float
        Parameters of the membrane that differ from its start values.
    priors : mapping of str to float
        How far numbers may be off [1], one standard deviation, by their names in ``PRIORS``; 0 for what is known. Of the
        others that the structure has, the deviations there.
    sensor, sensor_parameters
        As of ``Twin``, for records of resistance.
    mesh_error : bool
        Whether the mesh of the structure errs: then finer elements are simulated too.
    report : callable
        Called with what is done.

    Returns
    -------
    Calibration

    Raises
    ------
    DataError
        There are no records, or one of them cannot be used.
    ParameterError
        There is no such number, or nothing is left to fit.

    Notes
    -----
    Bounded least squares without damage: what is a number of the structure is shared, load, clock and sensors are those of
    each record. Whether a record is healthy is tested by Rao's score of damage in each zone, beside all that was fitted.
    """
    require(records, "a calibration needs a healthy record or more.", DataError)
    structure = structure or square_structure()
    structure = with_factors(structure, structure.setup.scalable)
    given = dict(priors or {})
    if unknown := [name for name in given if name not in NUMBERS]:
        msg = f"there is no number {unknown[0]!r} to calibrate. Choose from {', '.join(NUMBERS)}."
        raise ParameterError(msg)
    if bad := [name for name, value in given.items() if not 0.0 <= value <= 2.0]:
        msg = f"the prior of {bad[0]!r} is {given[bad[0]]:g}. Write a standard deviation as a share, 0.05 for 5 %."
        raise ParameterError(msg)
    of_mesh = mesh_error and not structure.starts_in_plane  # the error of the square is known
    known: dict[str, Any] = {"parameters": parameters, "sensor": sensor, "sensor_parameters": sensor_parameters}
    known |= {"mesh_error": MeshErrors(structure, parameters)} if of_mesh else {}
    known |= {} if mesh_error else {"discrepancy": None}
    there = Twin(structure, **known)
    if lacking := [name for name, value in given.items() if value > 0.0 and not there.has(name)]:
        msg = f"the structure has no {lacking[0]!r} to calibrate. Leave its prior out."
        raise ParameterError(msg)
    names = tuple(name for name in NUMBERS if given.get(name, 1.0) > 0.0 and there.has(name))
    require(names, "all numbers of the structure are known: nothing is left to calibrate.", ParameterError)
    prior = np.array([given.get(name, PRIORS[name]) for name in names])
    before = Calibration(
        names=names,
        factors=np.ones(len(names)),
        covariance=np.diag(prior**2),
        prior=prior,
        parameters={},
        drawing=drawing_of(structure),
        chi2_per_sample=(),
        chi2_bound=(),
    )
    twin = Twin(structure, **known, known=[name for name in NUMBERS if name not in names], calibration=before)
    with threadpool_limits(1):
        problems = []
        for k, record in enumerate(records, 1):
            report(f"record {k} of {len(records)}")
            problems.append(twin.least_squares(record))
        report("fitting")
        joint = JointRecords(problems, names)
        found = descend(joint, np.zeros(joint.size), joint.free)
        for k in range(ROUNDS):
            report(f"fitting, finer mesh {k + 1} of {ROUNDS}")
            finer = joint.corrected(found.point.x, twin)
            if finer is None:
                break
            joint = finer
            found = descend(joint, found.point.x, joint.free)
        coarse = [k for k, problem in enumerate(joint.problems, 1) if problem.added is None] if mesh_error else []
        text = "no finer elements were simulated for record {}: what they would change is not known, or nothing"
        return _told(joint, found, before, twin, [text.format(k) for k in coarse])


def _told(
    joint: JointRecords, found: Minimum, before: Calibration, twin: Twin, unrefined: Sequence[str] = ()
) -> Calibration:
    """Return what a fit says, with sentences on records whose finer mesh was not simulated."""
    names, s = before.names, len(before.names)
    C = np.asarray(np.linalg.inv(found.model.A))[:s, :s]
    L = np.diag(before.prior)
    logs, covariance = L @ found.point.x[:s], L @ C @ L
    parts = joint.parts(found.point)
    per_sample = [chi2 / problem.values for chi2, problem in zip(parts, joint.problems, strict=True)]
    bounds = [chi2_bound(problem) for problem in joint.problems]
    doubts = [
        f"record {k} is not explained: chi2 per sample is {chi2:.3g}, its bound {bound:.3g}"
        for k, (chi2, bound) in enumerate(zip(per_sample, bounds, strict=True), 1)
        if chi2 > bound
    ]
    far = [name for name, at in zip(names, found.point.x[:s], strict=True) if abs(at) > NEAR_BOUND * BEYOND]
    bound = f"runs into its bound, {BEYOND:g} deviations of its prior from the setup. Check the setup, or widen the prior"
    doubts += [f"the {name} {bound}" for name in far]
    doubts += joint.damaged(found.point, twin.names)
    known = {
        p: twin.parameters[p] * math.exp(log)
        for name, log in zip(names, logs, strict=True)
        for p in scaled_by(name, twin.parameters)
    }
    return replace(
        before,
        factors=np.exp(logs),
        covariance=covariance,
        parameters=known,
        chi2_per_sample=tuple(map(float, per_sample)),
        chi2_bound=tuple(map(float, bounds)),
        doubts=tuple(doubts),
        untold=(*_combinations(names, C), *unrefined),
    )


def _combinations(names: Sequence[str], C: Matrix) -> list[str]:
    """Say which combinations of numbers are not decided, from their covariance in units of the priors."""
    variance, modes = np.linalg.eigh(C)
    said = []
    for left, mode in zip(variance.tolist(), modes.T, strict=True):
        if left < UNTOLD:
            continue
        mode = mode * np.sign(mode[np.argmax(np.abs(mode))])
        parts = [
            f"{name} {'up' if share > 0.0 else 'down'}"
            for name, share in sorted(zip(names, mode.tolist(), strict=True), key=lambda each: -abs(each[1]))
            if abs(share) > NAMED
        ]
        what = f"{' and '.join(parts)} together" if len(parts) > 1 else parts[0].rpartition(" ")[0]
        said.append(f"the records do not decide {what}: {100.0 * math.sqrt(left):.0f} % of the prior's deviation is left")
    return said


class JointRecords(LeastSquares):
    """Least squares for records of one structure without damage.

    Parameters
    ----------
    problems : sequence of RecordProblem
        Of each record.
    shared : sequence of str
        Nuisances that are the same in all records; they come first among the unknowns.
    """

    def __init__(self, problems: Sequence[RecordProblem], shared: Sequence[str]) -> None:
        self.problems, self._shared = list(problems), tuple(shared)
        self._at: list[NDArray[np.int64]] = []  # place of each nuisance of a record among the unknowns
        size = len(self._shared)
        for problem in problems:
            names = problem.nuisances.names
            own = [name for name in names if name not in self._shared]
            places = {**{name: k for k, name in enumerate(self._shared)}, **{name: size + k for k, name in enumerate(own)}}
            self._at.append(np.array([places[name] for name in names]))
            size += len(own)
        self.size = self.simulated = size
        self.y = np.concatenate([problem.y for problem in problems])
        self.high, self.prior = np.full(size, BEYOND), np.ones(size)
        self.low, self.free = -self.high, np.ones(size, dtype=bool)
        self.steps = np.zeros(size)
        for problem, at in zip(problems, self._at, strict=True):
            self.steps[at] = problem.steps[problem.zones :]

    def rows(self, k: int, x: Matrix) -> Matrix:
        """Return rows of unknowns of one record, without damage."""
        return np.hstack([np.zeros((len(x), self.problems[k].zones)), x[:, self._at[k]]])

    def predict(self, x: Matrix) -> Matrix:
        """Return weighed predictions of all records, shape (m, 1, values)."""
        found = []
        for k, problem in enumerate(self.problems):
            rows = self.rows(k, x)
            found.append(problem.weigh(problem.predict(rows), rows))
        return np.concatenate(found, axis=1)[:, None]

    def weigh(self, predicted: Matrix, x: Matrix) -> Matrix:  # noqa: ARG002
        """Return what was weighed, shape (m, values)."""
        return predicted[:, 0]

    def derivatives(self, point: Point, free: Rows) -> Matrix:
        """Return the derivatives of the weighed predictions; what a record has for itself changes no other."""
        whole, first = np.zeros((self.y.size, self.size)), 0
        for k, (problem, at) in enumerate(zip(self.problems, self._at, strict=True)):
            mine = problem.points(self.rows(k, point.x[None]))[0]
            of_record = np.arange(problem.size) >= problem.zones
            both = [stepped.derivatives(mine, of_record) for stepped in _both_ways(problem)]
            whole[first : first + problem.y.size, at] = (both[0] + both[1]) / 2.0
            first += problem.y.size
        return whole[:, free]

    def parts(self, point: Point) -> list[float]:
        """Return chi2 of each record."""
        ends = np.cumsum([problem.y.size for problem in self.problems])[:-1]
        return [float(part @ part) for part in np.split(point.r, ends)]

    def corrected(self, x: Vector, twin: Twin) -> JointRecords | None:
        """Return the same with what a finer mesh adds about unknowns; None where no record has one."""
        found, any_finer = [], False
        for k, problem in enumerate(self.problems):
            finer = twin.finer(problem)
            if finer is None:
                found.append(problem)
                continue
            mine = problem.points(self.rows(k, x[None]))[0]
            moving = np.arange(problem.zones, problem.simulated)
            one, other = (stepped.corrected(finer[0], mine, moving, finer[1]) for stepped in _both_ways(problem))
            found.append(one.averaged(other))
            any_finer = True
        return JointRecords(found, self._shared) if any_finer else None

    def damaged(self, point: Point, zones: Sequence[str]) -> list[str]:
        """Say in which record which zone seems damaged, and how sure that is: by its score beside all that is fitted."""
        said, threshold = [], float(chdtri(1.0, HEALTHY / sum(problem.zones for problem in self.problems)))
        for k, problem in enumerate(self.problems):
            mine = problem.points(self.rows(k, point.x[None]))[0]
            z, free = problem.zones, np.ones(problem.size, dtype=bool)
            model = problem.about(mine, free, problem.derivatives(mine, free))
            beside = model.A[:z, z:] @ np.linalg.inv(model.A[z:, z:])
            size = np.diag(model.A)[:z] - np.einsum("ij,ij->i", beside, model.A[:z, z:])
            slope = model.g[:z] - beside @ model.g[z:]
            score = np.where(size > 0.0, slope**2 / np.maximum(size, 1e-300), 0.0)
            worst = int(np.argmax(np.where(slope > 0.0, score, 0.0)))
            if slope[worst] > 0.0 and score[worst] > threshold:
                damage, deviation = (100.0 * each for each in (slope[worst] / size[worst], 1.0 / math.sqrt(size[worst])))
                by = f"{damage:.2g} +- {deviation:.1g} %"
                said.append(f"record {k + 1} is not healthy: zone {zones[worst]} seems damaged by {by}")
        return said


def _both_ways(problem: RecordProblem) -> list[RecordProblem]:
    """Return a problem with differences by its nuisances forwards, and backwards."""
    found = [copy(problem), copy(problem)]
    for each, step in zip(found, (STEP, -STEP), strict=True):
        each.steps = np.where(np.arange(problem.size) < problem.zones, problem.steps, step)
    return found
