r"""One damage of each zone for several records, and what has grown since the last inspection.

Symbols: ``x`` unknowns of all records, see ``JointProblem``; ``k`` records, ``z`` zones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Any, cast

import numpy as np
from gossamer_files import read_json
from gossamer_files.options import option
from threadpoolctl import threadpool_limits

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError, DataError, require
from .answer import Answer, ZonesFound, covariance_over, names_of, of_record, order_of, together_with, untold_zones
from .correction import SAME_NOISE, SETTLED, differentiated, moved, noise_left
from .forward import side_by_side
from .groups import groups_of
from .joint import Before, JointProblem
from .least_squares import Quadratic, bounded_minimum
from .nuisances import LASTING, NUMBERS, number_of
from .oddities import chi2_bound
from .problem import RecordProblem
from .record import ResponseRecord
from .search import Begun, Fit, again, box, ended, in_groups, with_rivals
from .twin import Alone, Twin
from .zone_sets import drop_zones

HEALED = 4.0  # deviations by which a zone that a record finds less damaged than the last inspection is named
OF_ALL = (*NUMBERS, *LASTING)  # nuisances that are the same in all records
ROUNDS = 6  # of a finer mesh
UNSEEN = 1e-9  # of curvature: of what no record tells


@dataclass(frozen=True, kw_only=True)
class Earlier:
    """What the last inspection said.

    Attributes
    ----------
    zones : tuple of str
        Their names.
    damage, probability : ndarray, shape (z,)
        Damage [1], and how likely there is some.
    covariance : ndarray, shape (z, z)
        Of the damages.
    """

    zones: tuple[str, ...]
    damage: Vector
    probability: Vector
    covariance: Matrix

    @classmethod
    def read(cls, path: Path) -> Earlier:
        """Read the answer of a twin.

        Raises
        ------
        DataError
            It is none, or it is not valid.
        """
        try:
            content: dict[str, Any] = read_json(path)
            valid, zones = bool(content["valid"]), tuple(map(str, content["zones"]))
            names = ("estimate", "probability", "covariance")
            arrays = {name: np.array(content[name], dtype=float) for name in names} if valid else {}
            together = content.get("together_with") or ()
        except (OSError, KeyError, TypeError, ValueError) as error:
            msg = f"{path} is no answer of a twin: {error}. Write one with 'gossamer twin'."
            raise DataError(msg) from error
        msg = f"{path} is not valid, so nothing can be said since then. Take an inspection that is, or inspect without it."
        require(valid, msg, DataError)
        damage, covariance = arrays["estimate"], arrays["covariance"]
        covariance = covariance + _within(zones, together, damage, covariance)
        return cls(zones=zones, damage=damage, probability=arrays["probability"], covariance=covariance)

    @classmethod
    def of(cls, answer: Answer) -> Earlier:
        """Take an answer that is valid."""
        require(answer.valid, "the last answer is not valid, so nothing can be said since then. Leave it out.", DataError)
        more = _within(answer.zones, answer.together_with, answer.damage, answer.covariance)
        return cls(
            zones=answer.zones, damage=answer.damage, probability=answer.probability, covariance=answer.covariance + more
        )

    def before(self, zones: Sequence[str], repaired: Sequence[str], faults: int = 0) -> Before:
        """Return the damages that what has grown since is added to: none in zones that were repaired or whole, no faults.

        Raises
        ------
        DataError
            It is of other zones, or a repaired zone is none of them.
        """
        if self.zones != tuple(zones):
            msg = f"the last inspection has the zones {', '.join(self.zones)}, the structure has {', '.join(zones)}"
            raise DataError(msg)
        for name in repaired:
            require(name in zones, f"there is no zone {name!r} to be repaired. Choose from {', '.join(zones)}.", DataError)
        stays = np.array([name not in repaired for name in zones]) & (self.damage > 0.0)
        variance, modes = np.linalg.eigh(self.covariance * np.outer(stays, stays))
        root = modes * np.sqrt(np.maximum(variance, 0.0))
        return Before(np.pad(self.damage * stays, (0, faults)), np.pad(root, (0, faults)))


def _within(zones: Sequence[str], together: Sequence[Sequence[str]], damage: Vector, covariance: Matrix) -> Matrix:
    """Return the covariance of damages that were answered together about their mean, which is all that is known of them."""
    found = np.zeros_like(covariance)
    for group in {tuple(sorted({name, *others})) for name, others in zip(zones, together, strict=True) if others}:
        at = [list(zones).index(name) for name in group]
        size = max(float(damage[at].mean()), math.sqrt(covariance[at[0], at[0]]))
        found[np.ix_(at, at)] = size**2 * (np.eye(len(at)) - 1.0 / len(at))
    return found


def inspect(
    twin: Twin,
    records: Sequence[ResponseRecord],
    *,
    since: Earlier | Answer | None = None,
    repaired: Sequence[str] = (),
    report: Callable[[float, int], None] = lambda *_: None,
) -> Answer:
    """Find the one damage of each zone that explains several records.

    Parameters
    ----------
    twin : Twin
        Of the structure.
    records : sequence of ResponseRecord
        Each with loads of its own; a single one is answered as by ``Twin.fit`` unless ``since`` is given.
    since : Earlier, Answer or None
        The last inspection. Damage does not heal, so that what has grown since is at least 0.
    repaired : sequence of str
        Names of zones that were repaired since: they begin without damage.
    report : callable
        As of ``Twin.fit``, for each record by itself; by one thread at a time.

    Returns
    -------
    Answer
        With ``records``, what it says of each; of the structure's numbers in ``nuisances``; and with what has grown.

    Raises
    ------
    DataError
        There are no records, one cannot be used, or the last inspection is not of this structure.

    Notes
    -----
    Each record is searched by itself first. Damages, numbers of the structure and gains of sensors are then those of all
    records; loads, clock, offsets and noise are those of each. The damages of the last inspection are unknowns with its
    covariance as prior, and a zone has grown only if that explains the records better, by the same price as damage.
    """
    require(records, "an inspection needs a record or more.", DataError)
    require(since is not None or not repaired, "zones are repaired since an inspection. Name that too.", DataError)
    if len(records) == 1 and since is None:
        return twin.fit(records[0], report)
    earlier = Earlier.of(since) if isinstance(since, Answer) else since
    before = None if earlier is None else earlier.before(twin.names, repaired, len(twin.faults))
    telling = Lock()

    def told(length: float, simulations: int) -> None:
        with telling:
            report(length, simulations)

    with threadpool_limits(1):
        alone = side_by_side(lambda record: twin.alone(record, told, corrects=False), records)
        fit = _together(twin, alone, before)
        unresolved = untold_zones(fit)
        if before is None:
            fit = _in_groups(fit, sparse=twin.sparse)
        return _answer(twin, fit, alone, earlier, unresolved)


def _together(twin: Twin, alone: Sequence[Alone], before: Before | None) -> Fit:
    """Fit all records from what they say by themselves, then with finer meshes where they need them."""
    problems, sparse = [each.fit.problem for each in alone], twin.sparse
    there = dict.fromkeys(name for problem in problems for name in problem.nuisances.names)
    joint = JointProblem(problems, [name for name in there if number_of(name) in OF_ALL], before=before)
    whole = cast(RecordProblem, joint)  # it has all that a search needs of one
    middle, kept = _between(whole, joint, [each.fit for each in alone])
    sets = {kept[: joint.zones].tobytes(), *(each.fit.kept[: joint.zones].tobytes() for each in alone)}
    starts = []
    for each in sorted(sets):
        stays = np.r_[np.frombuffer(each, dtype=bool), np.ones(joint.size - joint.zones, dtype=bool)]
        starts.append(Begun(np.where(stays, middle, 0.0), kept=stays))
    ends = [end for start in starts if (end := ended(whole, start, sparse=sparse, rivals=False)) is not None]
    if not ends:
        msg = "the twin's membrane fails where it should explain all records. Check their loads."
        raise ConvergenceError(msg)
    fit = min(ends, key=lambda end: (not end.passes, end.worth))
    move, finer, noise = np.zeros(joint.zones), [each.finer for each in alone], [each.noise for each in alone]
    for _ in range(ROUNDS if any(finer) else 0):
        moving, needed = (np.isin(np.arange(joint.size), which) for which in differentiated(fit))
        try:
            joint = joint.under(noise).corrected(fit.point.x, moving, needed, finer)
        except ConvergenceError:
            fit = fit if fit.problem is not whole else again(fit, cast(RecordProblem, joint.under(noise)), sparse=sparse)
            break
        last, fit = fit, again(fit, cast(RecordProblem, joint), sparse=sparse, rivals=False)
        if fit is last:  # it failed
            break
        noise = [
            problem.noise if mesh is None else noise_left(problem, joint.point(k, fit.point.x))
            for k, (problem, mesh) in enumerate(zip(joint.problems, finer, strict=True))
        ]
        same = all(np.nanmin(new / problem.noise) >= SAME_NOISE for new, problem in zip(noise, joint.problems, strict=True))
        move = np.abs(fit.point.x - last.point.x)[: joint.zones]
        if same and moved(last, fit) < SETTLED:
            move = np.zeros(joint.zones)
            break
    fit = replace(fit, vague=move)
    return with_rivals(fit) if sparse and fit.passes else fit


def _between(whole: RecordProblem, joint: JointProblem, fits: Sequence[Fit]) -> tuple[Vector, Rows]:
    """Return where the quadratic models of chi2 of all records are smallest together, and which unknowns are kept there."""
    A, g = np.diag(np.maximum(joint.prior, UNSEEN)), np.zeros(joint.size)
    for (start, matrix), fit in zip(joint.maps, fits, strict=True):
        x, prior = fit.point.x, fit.problem.prior
        own = fit.model.A - np.diag(prior)
        g += matrix.T @ (fit.model.g + prior * x + own @ (x - start))
        A += matrix.T @ own @ matrix
    x = bounded_minimum(A, g, joint.low, joint.high)
    kept, move = drop_zones(Quadratic(A=A, g=g - A @ x, at=x), box(whole, x))
    return np.where(kept, x + move, 0.0), kept


def _in_groups(fit: Fit, *, sparse: bool) -> Fit:
    """Return the fit with one damage for zones that the records together do not tell apart, where that explains them."""
    joint = cast(JointProblem, fit.problem)
    groups = groups_of(fit.model.A, joint.zones, joint.whole)
    if not fit.passes or groups.max() + 1 == joint.zones:
        return fit
    whole = cast(RecordProblem, JointProblem(joint.problems, joint.shared, groups))
    together = in_groups(fit, whole, sparse=sparse)
    return together if together is not None and together.passes else fit


def _healed(alone: Sequence[Alone], before: Before, *, sparse: bool) -> list[str]:
    """Name zones that records by themselves find less damaged than the last inspection did."""
    said = dict[str, str]()
    for k, each in enumerate(alone, 1):
        found, zones = ZonesFound.of(each.fit, sparse=sparse), names_of(each.fit)
        deviation = np.hypot(found.unknowns[: found.damage.size], np.linalg.norm(before.root, axis=1))
        less = (before.damage - found.damage > HEALED * deviation)[: len(zones)]
        for z in np.flatnonzero(less & each.fit.passes).tolist():
            was, now = 100.0 * before.damage[z], 100.0 * found.damage[z]
            text = f"{zones[z]} was damaged by {was:.2g} % at the last inspection, and record {k} finds {now:.2g} %"
            said.setdefault(zones[z], f"{text}. If it was repaired, say so: {option('repaired', zones[z])}")
    return list(said.values())


def _answer(twin: Twin, fit: Fit, alone: Sequence[Alone], earlier: Earlier | None, unresolved: tuple[int, ...]) -> Answer:
    joint, found = cast(JointProblem, fit.problem), ZonesFound.of(fit, sparse=twin.sparse)
    fields, z = found.as_fields(fit), joint.whole
    healed = list[str]()
    if joint.before is not None and earlier is not None:
        healed = _healed(alone, joint.before, sparse=twin.sparse)
        grown = {name: fields[name] for name in ("damage", "deviation", "probability")}
        fields |= {f"growth_{name}" if name != "damage" else "growth": value for name, value in grown.items()}
        at = joint.maps[0][1][:z]  # from all unknowns to the damages
        covariance = np.array(at @ found.covariance @ at.T)
        unhurt = ~fit.kept[:z] & (joint.before.damage[:z] == 0.0)
        for k in np.flatnonzero(unhurt).tolist():  # what it would be, if they were damaged now
            also = fit.kept | (np.arange(joint.size) == k)
            covariance[k, k] = at[k] @ covariance_over(fit.model.A, also) @ at[k]
        np.fill_diagonal(covariance, np.diag(covariance) + np.broadcast_to(fit.vague, joint.zones)[:z] ** 2)
        fields["covariance"], fields["deviation"] = covariance, np.sqrt(np.diag(covariance))
        stays = np.where(joint.before.damage[:z] > 0.0, earlier.probability, 0.0)
        fields["probability"] = 1.0 - (1.0 - stays) * (1.0 - grown["probability"])
        now = np.maximum(joint.maps[0][0][:z] + at @ fit.point.x, 0.0)
        fields["damage"] = np.where(fields["probability"] < 0.5, 0.0, now)  # as in zones that were dropped
    said, valid, records = healed, fit.passes and not healed, list[Answer]()
    common: dict[str, Any] = {"zones": names_of(fit), "unresolved": unresolved, "together_with": together_with(fit)}
    chi2 = joint.chi2_of_records(fit.point)
    for k, (problem, each) in enumerate(zip(joint.problems, alone, strict=True)):
        deviation = np.sqrt(joint.maps[k][1] ** 2 @ found.unknowns**2)
        point = joint.point(k, fit.point.x)
        more, hidden = twin.of_mesh(problem)
        of_this, doubts, reads = of_record(problem, point, deviation[problem.zones :])
        mine = [*each.doubts, *doubts, *more]
        explained = chi2[k] / problem.values <= chi2_bound(problem)
        if not explained:
            mine.insert(0, "it is not explained with the others: its own damage, load or sensors differ")
        if not each.fit.passes:
            mine.insert(0, "the twin does not explain it by itself. Leave it out, or fit it alone to see why")
        wired = each.wiring is not None and each.wiring.moved
        good = explained and reads and not hidden and not wired
        valid = valid and good
        said += [f"record {k + 1}: {text}" for text in mine]
        records.append(
            Answer(
                **common,
                **fields,
                **of_this,
                chi2_per_sample=chi2[k] / problem.values,
                chi2_bound=chi2_bound(problem),
                valid=good,
                order=order_of(each.wiring, joint.model.sensors),
                doubts=tuple(mine),
            )
        )
    said[:0] = [fit.oddity] * bool(fit.oddity)
    shared = {name: value for each in records for name, value in each.nuisances.items() if name in joint.shared}
    whole: dict[str, Any] = {
        "chi2_per_sample": fit.per_sample,
        "chi2_bound": fit.chi2_bound,
        "valid": valid,
        "doubts": tuple(said),
    }
    samples, simulations = joint.values, sum(record.simulations for record in records)
    return replace(records[0], **whole, nuisances=shared, samples=samples, simulations=simulations, records=tuple(records))
