r"""Calibrate a structure on its healthy records: least squares of all records together, without damage.

Symbols: ``s`` factors on numbers of the structure, which all records share; ``x`` these, in units of their priors, then what
each record has for itself: clock, load, offsets of sensors; ``z`` zones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri
from threadpoolctl import threadpool_limits

from ..arrays import Matrix
from ..errors import DataError, ParameterError, require
from ..membrane import Structure, square_structure
from ..sensor import SensorArtifact
from .calibration import Calibration, drawing_of, with_factors
from .joint import JointProblem
from .least_squares import Minimum, Point, descend
from .mesh_error import MeshErrors
from .nuisances import BEYOND, GAIN, GAINS, LASTING, NUMBERS, PLACES, SCALES, number_of, scaled_by
from .oddities import chi2_bound
from .record import ResponseRecord
from .twin import Twin

PRIORS = {name: SCALES[name][1] for name in NUMBERS} | {"modulus": 0.05, GAINS: GAIN}  # deviations of logarithms, of gains
PLACE, MISPLACED, MOST_MISPLACED = "place", 0.002, 0.05  # of sensors: deviation by default, and at most, shares of the size
ROUNDS, SETTLED = 8, 0.1  # of simulations on a finer mesh; a round that moves less, in chi2, is the last
UNTOLD = 0.5  # of the prior's variance: a combination of numbers with more left is not decided
NAMED = 0.3  # share of such a combination that is named
HEALTHY = 1e-4  # chance that some zone of healthy records seems damaged
NEAR_BOUND = 0.99


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
        How far numbers may be off [1], one standard deviation, by their names in ``PRIORS``, and ``place`` for how far
        gauges may be from their points along their directions, and across [m]; 0 for what is known. Of the others that the
        structure has, what its setup says, else the deviations there, and 0.2 % of the size for places.
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
    Bounded least squares without damage: what is a number of the structure, or gain or place of a gauge, is shared; load,
    clock and offsets are those of each record. Places are found of records of strain, not of the square, whose error of the
    mesh is known at its sensors alone; what they change is linear, with slopes that are simulated again at what is found.
    Whether a record is healthy is tested by Rao's score of damage in each zone, beside all
    that was fitted.
    """
    require(records, "a calibration needs a healthy record or more.", DataError)
    structure = structure or square_structure()
    require(structure.setup.calibration is None, "the setup is calibrated. Begin with the drawing.", ParameterError)
    structure = with_factors(structure, structure.setup.scalable)
    given = {**structure.setup.priors, **(priors or {})}
    if unknown := [name for name in given if name not in (*PRIORS, PLACE)]:
        msg = f"there is no number {unknown[0]!r} to calibrate. Choose from {', '.join((*PRIORS, PLACE))}."
        raise ParameterError(msg)
    place = given.pop(PLACE, 0.0 if structure.starts_in_plane else MISPLACED * structure.mesh.size)
    if not 0.0 <= place <= (most := MOST_MISPLACED * structure.mesh.size):
        msg = f"the prior of {PLACE!r} is {place:g} m. Write a standard deviation up to {most:.3g} m, 0.002 for 2 mm."
        raise ParameterError(msg)
    if place and structure.starts_in_plane:
        msg = f"on the square places are not calibrated: its mesh error is known at its own sensors. Leave {PLACE!r} out."
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
    numbers = [name for name in PRIORS if name != GAINS or records[0].kind == "strain"]
    names = tuple(
        part for name in numbers if given.get(name, 1.0) > 0.0 and there.has(name) for part in _parts(name, structure)
    )
    if place and records[0].kind == "strain":
        names += tuple(part for name in PLACES for part in _parts(name, structure))
    require(names, "all numbers of the structure are known: nothing is left to calibrate.", ParameterError)
    priors = {**PRIORS, **given, **dict.fromkeys(PLACES, place)}
    prior = np.array([priors[number_of(name)] for name in names])
    before = Calibration(
        names=names,
        factors=np.array([number_of(name) not in PLACES for name in names], dtype=float),
        covariance=np.diag(prior**2),
        prior=prior,
        parameters={},
        drawing=drawing_of(structure),
        chi2_per_sample=(),
        chi2_bound=(),
    )
    exact = [name for name in numbers if name not in map(number_of, names)]
    twin = Twin(structure, **known, known=exact, calibration=before)
    with threadpool_limits(1):
        problems = []
        for k, record in enumerate(records, 1):
            report(f"record {k} of {len(records)}")
            problems.append(twin.least_squares(record))
        report("fitting")
        joint = JointProblem(problems, names)
        healthy = np.arange(joint.size) >= joint.zones
        found = descend(joint, np.zeros(joint.size), healthy)
        if PLACES[0] in map(number_of, names):
            joint = joint.placed(found.point.x, twin.placed)
            found = descend(joint, found.point.x, healthy)
        finer = [twin.finer(problem) for problem in joint.problems]
        settled = not any(finer)
        for k in range(0 if settled else ROUNDS):
            report(f"fitting, finer mesh {k + 1} of {ROUNDS}")
            joint, before_it = joint.corrected(found.point.x, healthy, healthy, finer), found.point.x[healthy]
            found = descend(joint, found.point.x, healthy)
            moved = found.point.x[healthy] - before_it
            settled = bool(moved @ found.model.A @ moved < SETTLED)
            if settled:
                break
        said = f"the numbers still move after {ROUNDS} rounds with finer elements. Refine the mesh"
        unsettled = [] if settled else [said]
        coarse = [k for k, problem in enumerate(joint.problems, 1) if problem.added is None] if mesh_error else []
        text = "no finer elements were simulated for record {}: what they would change is not known, or nothing"
        done = _told(joint, found, before, twin, [text.format(k) for k in coarse])
        return replace(done, doubts=(*done.doubts, *unsettled))


def _told(
    joint: JointProblem, found: Minimum, before: Calibration, twin: Twin, unrefined: Sequence[str] = ()
) -> Calibration:
    """Return what a fit says, with sentences on records whose finer mesh was not simulated."""
    names, s = before.names, len(before.names)
    C = np.asarray(np.linalg.inv(found.model.A))[:s, :s]
    L, x = np.diag(before.prior), found.point.x[joint.zones :][:s]
    logs, covariance = L @ x, L @ C @ L
    parts = joint.chi2_of_records(found.point)
    per_sample = [chi2 / problem.values for chi2, problem in zip(parts, joint.problems, strict=True)]
    bounds = [chi2_bound(problem) for problem in joint.problems]
    doubts = [
        f"record {k} is not explained: chi2 per sample is {chi2:.3g}, its bound {bound:.3g}"
        for k, (chi2, bound) in enumerate(zip(per_sample, bounds, strict=True), 1)
        if chi2 > bound
    ]
    kinds = np.array([number_of(name) for name in names])
    far = [name for name, at in zip(names, x, strict=True) if abs(at) > NEAR_BOUND * BEYOND]
    bound = f"runs into its bound, {BEYOND:g} deviations of its prior from the setup. Check the setup, or widen the prior"
    doubts += [f"the {name} {bound}" for name in far]
    doubts += _damaged(joint, found.point, twin.names)
    known = {
        p: twin.numbers[p] * math.exp(log)
        for name, log in zip(names, logs, strict=True)
        if number_of(name) in SCALES
        for p in scaled_by(name, twin.numbers)
    }
    return replace(
        before,
        factors=np.where(np.isin(kinds, LASTING), (kinds == GAINS) + logs, np.exp(logs)),
        covariance=covariance,
        parameters=known,
        chi2_per_sample=tuple(map(float, per_sample)),
        chi2_bound=tuple(map(float, bounds)),
        doubts=tuple(doubts),
        untold=(*_combinations(names, C), *unrefined),
    )


def _parts(name: str, structure: Structure) -> list[str]:
    """Return a number of a structure, or one for each sensor, region or support where it has several."""
    setup = structure.setup
    several = {"modulus": len(setup.regions), "support": len(setup.springs), **dict.fromkeys(LASTING, structure.n_sensors)}
    parts = several.get(name, 1)
    return [name] if parts < 2 and name not in LASTING else [f"{name}[{k}]" for k in range(1, parts + 1)]


def _combinations(names: Sequence[str], C: Matrix) -> list[str]:
    """Say which combinations of numbers, and which places, are not decided, from their covariance in units of the priors."""
    places = np.array([number_of(name) in PLACES for name in names])
    vague = [name for name, place in zip(names, places & (np.diag(C) > UNTOLD), strict=True) if place]
    names = [name for name, place in zip(names, places, strict=True) if not place]
    variance, modes = np.linalg.eigh(C[np.ix_(~places, ~places)])
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
    for kind, way in zip(PLACES, ("along", "across"), strict=True):
        if at := [name.removeprefix(f"{kind}[")[:-1] for name in vague if number_of(name) == kind]:
            which = f"sensor {at[0]} is" if len(at) == 1 else f"sensors {', '.join(at)} are"
            said.append(f"the records hardly tell how far {which} off {way} the direction")
    return said


def _damaged(joint: JointProblem, point: Point, zones: Sequence[str]) -> list[str]:
    """Say in which record which zone seems damaged, and how sure that is: by its score beside all that is fitted."""
    said, threshold = [], float(chdtri(1.0, HEALTHY / sum(problem.zones for problem in joint.problems)))
    for k, problem in enumerate(joint.problems):
        z, free, mine = problem.zones, np.ones(problem.size, dtype=bool), joint.point(k, point.x)
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
