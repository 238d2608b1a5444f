r"""The search of one record: several starts, first its beginning, then all of it, then without the zones it does not need.

Symbols: ``x`` unknowns, first the damages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError
from .forward import side_by_side
from .groups import UNRESOLVED
from .least_squares import MOST_DAMAGE, NEGLIGIBLE, PRIOR_DEVIATION, Minimum, Point, Quadratic, change, descend
from .nuisances import BEYOND, FACTORS, MODULUS
from .oddities import chi2_bound, oddity
from .problem import RecordProblem
from .zone_sets import MOST_RIVALS, THRESHOLD, Alternatives, Box, alternatives, drop_zones, price

ROUGH = 1.0  # of chi2: where a stage may stop that another follows
MOST_CHANGES = 4  # of the zones that are kept
MOST_STARTS = 4  # after the first
FEW_STARTS = 2  # without early stages
DOUBTFUL = 1.0  # deviations of chi2 above the expected one, of a fit that passes
FEW_SENSORS = 1.5  # zones for each: with more zones there may be several minima that pass
HOPELESS = 5.0  # deviations of chi2 above the expected one
MOST_STEPS = 12  # of one descent
FEW_STEPS = 2  # where it is hopeless
ROUNDS = 4  # of the scales of the errors of the sensors
RIVAL_STEPS = 4  # of the descent of another set of zones
APART = 1.0  # deviations of its prior by which a nuisance is off
TORN = 0.01  # damage that is so close to the largest one is at it
ALIKE = 0.8  # cosine of the derivatives by two zones of which one is tried in place of the other


@dataclass(frozen=True)
class Fit:
    """A finished search from one start.

    Attributes
    ----------
    problem : RecordProblem
        What was fitted.
    point : Point
        Smallest chi2 over the kept unknowns.
    model : Quadratic
        Quadratic model over all unknowns there.
    kept : ndarray of bool, shape (n,)
        Unknowns that are not dropped.
    early_chi2 : float
        Smallest chi2 of the last early stage that was followed; infinite without one.
    J : ndarray, shape (values, n)
        Derivatives by all unknowns there.
    rivals : tuple of tuple
        Other sets of zones that were fitted: unknowns that are not dropped, chi2, and where it is smallest.
    vague : float or ndarray, shape (zones,)
        Deviations of damages [1] that do not come from the record, beside those that do.
    """

    problem: RecordProblem
    point: Point
    model: Quadratic
    kept: Rows
    early_chi2: float
    J: Matrix
    rivals: tuple[tuple[Rows, float, Vector], ...] = ()
    vague: float | Vector = 0.0

    @property
    def likely(self) -> Alternatives:
        """Sets of zones that explain the record about as well."""
        at, chi2 = self.point.x, self.point.chi2
        known = [(kept, reached - chi2, x - at) for kept, reached, x in self.rivals]
        return alternatives(self.model, box(self.problem, at), self.kept, known)

    @property
    def end(self) -> Begun:
        """Where the search of the same record with other weights starts."""
        return Begun(self.point.x, self.early_chi2, kept=self.kept)

    @property
    def per_sample(self) -> float:
        """Chi2 per sample."""
        return self.point.chi2 / self.problem.values

    @property
    def chi2_bound(self) -> float:
        """Bound on chi2 per sample."""
        return chi2_bound(self.problem, int(self.kept[: self.problem.zones].sum()))

    @property
    def unlikely(self) -> float:
        """Minus twice the logarithm of the record's likelihood, but for a constant."""
        return self.point.chi2 + self.problem.log_determinant

    @property
    def worth(self) -> float:
        """Minus twice the logarithm of the evidence of the kept unknowns and of the scales of sensors' errors."""
        return self.unlikely + price(self.model, box(self.problem, self.point.x), self.kept)

    @property
    def passes(self) -> bool:
        """Whether chi2 per sample is below its bound, and no nuisance as far from its prior as the search goes."""
        return bool(self.per_sample <= self.chi2_bound and self.off < BEYOND and not self.oddity)

    @property
    def off(self) -> float:
        """By how many deviations of its prior a nuisance is off, at most."""
        return float(np.abs(self.problem.z(self.point.x[None])).max(initial=0.0))

    @property
    def zone_groups(self) -> NDArray[np.int64]:
        """Which unknown the damage of each zone is, from 0, faults left out."""
        faults = self.problem.zones - self.problem.whole
        return self.problem.groups[: self.problem.groups.size - faults]

    @property
    def at_bound(self) -> Rows:
        """Which unknowns are as large as they may be, shape (n,)."""
        return np.asarray(self.point.x > self.problem.high - TORN)

    @cached_property
    def oddity(self) -> str:
        """What the fit shows that one of a right model does not; empty if nothing."""
        told = np.zeros(self.kept.size, dtype=bool)  # others reach their bounds by noise
        covariance = np.linalg.pinv(self.model.A[np.ix_(self.kept, self.kept)], hermitian=True)
        told[self.kept] = np.sqrt(np.diag(covariance)) < UNRESOLVED * PRIOR_DEVIATION
        torn = np.flatnonzero((told & self.at_bound)[self.zone_groups])
        if torn.size:
            zone = self.problem.model.zones[torn[0]]
            return f"damage of {zone} is as large as the twin goes, {100.0 * MOST_DAMAGE:g} %, as in a false minimum"
        return oddity(self.problem, self.point.r, self.J[:, self.kept], self.model.A[np.ix_(self.kept, self.kept)])


def search(stages: Sequence[RecordProblem], *, sparse: bool, one_valley: bool = True) -> tuple[Fit, list[Fit]]:
    """Return the first fit that passes, or else the best of all starts; and other minima that were found.

    Parameters
    ----------
    stages : sequence of RecordProblem
        Longer and longer beginnings of the record; the last is all of it.
    sparse : bool
        Whether to drop zones.
    one_valley : bool
        Whether the first stage is so short that chi2 has one valley.

    Raises
    ------
    ConvergenceError
        The simulation fails from every start.

    Notes
    -----
    The first start is no damage. One whose early stages end above the bound of chi2 waits for the other starts; if all do,
    one is followed for a few steps. Where the first stage has one valley, and its bottom is hopeless from no damage, no
    others are tried. Where nothing passes that has no damage at its bound, the zones to begin with are chosen by the model
    about no damage, without early stages: where little tells them, all together wander far off. Then other starts are
    tried, side by side, and followed where their early stages end below those of the best fit before: that is what finds
    false minima. Where there are few sensors, both are tried too if chi2 of what passes is above the expected one, or
    without early stages, which have fewer valleys.
    """
    whole, ends, going = stages[-1], list[Fit](), list[Begun]()
    start, follow = partial(begun, stages[:-1], one_valley=one_valley), partial(ended, whole, sparse=sparse)
    few, healthy = FEW_SENSORS * len(whole.record.sensors) < whole.zones, np.zeros(whole.size)

    def doubtful() -> bool:
        passes = [misfit(whole, fit.point) for fit in ends if fit.passes and not fit.at_bound.any()]
        return not passes or (few and (not stages[:-1] or min(passes) > DOUBTFUL))

    first = start(healthy)
    hopeless = first is not None and first.hopeless
    if first is not None and first.far and not hopeless:
        going.append(first)
    elif first is not None:
        ends += filter(None, [follow(first)])
    followed = bool(ends)
    if sparse and not hopeless and doubtful():
        ends += filter(None, [follow(Begun(healthy, kept=np.arange(whole.size) >= whole.zones))])
    if not hopeless and doubtful():
        others = _others(stages[0])[: MOST_STARTS if stages[:-1] else FEW_STARTS]
        going += filter(None, side_by_side(start, others))
        reached = min((fit.early_chi2 for fit in ends), default=np.inf) - THRESHOLD
        lowest = min((each.reached for each in going), default=np.inf) + THRESHOLD
        lower = [each for each in going if each.reached <= min(reached, lowest)]
        if not followed and all(each.far for each in going):
            lower = [replace(each, hopeless=True) for each in lower[:1]]
        ends += filter(None, side_by_side(follow, lower))
    if not ends:
        msg = "the twin's membrane fails from every start. Check its parameters and the load."
        raise ConvergenceError(msg)
    best = min(ends, key=lambda fit: (not fit.passes, fit.worth))
    return best, [fit for fit in ends if fit is not best and elsewhere(fit, best)]


@dataclass(frozen=True)
class Begun:
    """Where the early stages have led.

    Attributes
    ----------
    x : ndarray, shape (n,)
        Unknowns.
    reached, misfit : float
        Smallest chi2 of the last stage, and by how many deviations it is above the expected one; infinite without stages.
    far, hopeless : bool
        Whether it is above its bound, and whether the first stage is far above it.
    kept : ndarray of bool, shape (n,), or None
        Unknowns that are not dropped, where that is known already.
    """

    x: Vector
    reached: float = math.inf
    misfit: float = math.inf
    far: bool = False
    hopeless: bool = False
    kept: Rows | None = None


def begun(stages: Sequence[RecordProblem], x: Vector, *, one_valley: bool, most: float = math.inf) -> Begun | None:
    """Follow a start through early stages, no further than one that is hopeless; None if the simulation fails.

    None follows a stage whose misfit is above ``most`` either.
    """
    found = Begun(x)
    try:
        for k, stage in enumerate(stages):
            free = np.ones(stage.size, dtype=bool)
            if k == 0:  # else damages take the place of what is off beside them
                beside = np.arange(stage.size) >= stage.zones
                found = Begun(descend(stage, x, beside, MOST_STEPS, enough=ROUGH).point.x)
            point = descend(stage, found.x, free, MOST_STEPS, enough=ROUGH).point
            if stage.sensor_error is not None:
                stage = stage.told(point, free)
                point = descend(stage, point.x, free, MOST_STEPS, enough=ROUGH).point
            off, far = misfit(stage, point), point.chi2 > chi2_bound(stage) * stage.values
            found = Begun(point.x, point.chi2, off, far, one_valley and k == 0 and off > HOPELESS)
            if found.hopeless or off > most:
                break
    except ConvergenceError:
        return None
    return found


def ended(whole: RecordProblem, start: Begun, *, sparse: bool, rounds: int = ROUNDS, rivals: bool = True) -> Fit | None:
    """Return the fit of the whole record from there, or None if the simulation fails.

    With as many rounds of scales, and with sets of zones that may be as good, if asked.
    """
    try:
        fit = _finish(whole, start, sparse=sparse)
        for _ in range(0 if whole.sensor_error is None or start.hopeless else rounds):
            told = _finish(fit.problem.told(fit.point, fit.kept), fit.end, sparse=sparse)
            if told.worth > fit.worth - ROUGH:
                break
            fit = told
        return with_rivals(fit) if rivals and sparse and fit.passes else fit
    except ConvergenceError:
        return None


def again(
    fit: Fit, problem: RecordProblem, *, sparse: bool, rounds: int = ROUNDS, hopeless: bool = False, rivals: bool = True
) -> Fit:
    """Return the fit of a problem with other weights or corrections, from where another one ended; that one if it fails.

    Of one that is hopeless a few steps are followed.
    """
    end = ended(problem, replace(fit.end, hopeless=hopeless), sparse=sparse, rounds=rounds, rivals=rivals)
    return fit if end is None else replace(end, vague=fit.vague)


def in_groups(fit: Fit, problem: RecordProblem, *, sparse: bool) -> Fit | None:
    """Return the fit of a problem whose groups of zones have one damage, from the means of another fit; None if it fails."""
    groups, zones = problem.groups, fit.problem.zones
    means = np.bincount(groups, fit.point.x[:zones]) / np.bincount(groups)
    end = ended(problem, Begun(np.concatenate([means, fit.point.x[zones:]]), fit.early_chi2), sparse=sparse)
    if end is None:
        return None
    vague = np.broadcast_to(fit.vague, zones)
    return replace(end, vague=np.array([vague[groups == group].max() for group in range(problem.zones)]))


def from_priors(fit: Fit, *, sparse: bool) -> list[Fit]:
    """Return the fit that begins with the damages of one whose nuisances are off, and with nuisances that are not.

    Where little is recorded, a beginning with nuisances alone leads into a valley of theirs that damages do not leave: a
    modulus, a density and gains that are off together do much of what damage does. None where nothing is off, or where it
    ends in the same valley.
    """
    zones = fit.problem.zones
    if not fit.passes or fit.off < APART:
        return []
    other = ended(fit.problem, Begun(_unknowns(fit.problem, fit.point.x[:zones]), fit.early_chi2), sparse=sparse)
    return [] if other is None or not elsewhere(other, fit) else [other]


def elsewhere(fit: Fit, best: Fit) -> bool:
    """Tell whether two fits are different minima: further apart than the curvature of the better one lets through."""
    d = fit.point.x - best.point.x
    return bool(d @ best.model.A @ d > THRESHOLD * max(1, int(best.kept.sum())))


def misfit(problem: RecordProblem, point: Point) -> float:
    """Return by how many deviations chi2 is above the expected one."""
    return (point.chi2 - problem.values) / math.sqrt(2.0 * problem.values)


def box(problem: RecordProblem, at: Vector) -> Box:
    """Return the bounds of moves from a point, shape (n,)."""
    zones = np.arange(problem.size) < problem.zones
    return Box(zones=zones, low=problem.low - at, high=problem.high - at, odds=problem.odds)


def _others(problem: RecordProblem) -> list[Vector]:
    """Return unknowns to start from after none: those of one zone and random ones, best first."""
    zones = problem.zones
    random = np.random.default_rng(zones)
    few = (random.random((32, zones)) < 0.2) & (np.arange(zones) < problem.whole)  # no two faults: they slacken a film
    many = np.vstack([0.4 * np.eye(zones), 0.6 * few * random.random((32, zones))])
    points = problem.points(np.array([_unknowns(problem, damage) for damage in many]))
    return [point.x for point in sorted(points, key=lambda point: point.chi2)]


def _unknowns(problem: RecordProblem, damage: Vector) -> Vector:
    return np.concatenate([damage, np.zeros(problem.size - problem.zones)])


def _finish(whole: RecordProblem, start: Begun, *, sparse: bool) -> Fit:
    """Go on with the whole record, drop zones, and think again where they stand after that."""
    most, changes = (FEW_STEPS, 1) if start.hopeless else (MOST_STEPS, MOST_CHANGES)
    free, x, kept = np.ones(whole.size, dtype=bool), start.x, start.kept
    if not sparse:
        found = descend(whole, x, free, most)
        return Fit(whole, found.point, found.model, free, start.reached, found.J)
    if kept is None:
        found = descend(whole, x, free, most, enough=ROUGH)
        model = found.model
        if whole.modulus is not None:
            model = whole.about(whole.points(_common_as_modulus(whole, found.point.x)[None])[0], free, found.J)
        kept, move = drop_zones(model, box(whole, model.at))
        x = _moved(whole, model.at, move, kept)
    best, worth = None, np.inf
    for _ in range(changes):
        found = descend(whole, x, kept, most)
        reached = found.point.chi2 + THRESHOLD * kept[: whole.zones].sum()
        if best is not None and reached >= worth:
            break
        full, J = _over_all(whole, found, kept)
        best, worth = Fit(whole, found.point, full, kept, start.reached, J), reached
        likely = alternatives(full, box(whole, full.at), drop_zones(full, box(whole, full.at))[0])
        other, move = likely.best
        promised = found.point.chi2 + change(full.A, full.g, move) + THRESHOLD * other[: whole.zones].sum()
        if promised > worth - ROUGH:
            break
        kept, x = other, _moved(whole, full.at, move, other)
    assert best is not None
    return best


def _over_all(problem: RecordProblem, found: Minimum, kept: Rows) -> tuple[Quadratic, Matrix]:
    """Return the quadratic model and the derivatives over all unknowns, at a minimum over the kept ones."""
    J = np.empty((problem.values, problem.size))
    J[:, kept], J[:, ~kept] = found.J, problem.derivatives(found.point, ~kept)
    return problem.about(found.point, np.ones(problem.size, dtype=bool), J), J


def with_rivals(fit: Fit) -> Fit:
    """Fit the sets of zones that may be as good by themselves; return the best fit, with the others as its rivals.

    Where another zone takes the place of one, damages move far, and the quadratic model of chi2 is wrong by some tens; where
    a zone reads much like a damaged one, chi2 may have a valley for each, so that it is tried with all of the damage.
    """
    whole, likely = fit.problem, fit.likely
    limits, ends = box(whole, fit.point.x), {fit.kept.tobytes(): (fit.kept, fit.point.chi2, fit.point.x)}
    moved = [(likely.kept[k], likely.move[k]) for k in likely.rivals(fit.kept, limits)]
    starts = [(kept, _moved(whole, fit.point.x, move, kept)) for kept, move in moved]
    for kept, x in [*starts, *_exchanged(fit)]:
        try:
            point = descend(whole, x, kept, RIVAL_STEPS, enough=ROUGH).point
        except ConvergenceError:  # no reason to lose the fit
            continue
        key, end = kept.tobytes(), (kept, point.chi2, point.x)
        ends[key] = min(ends.get(key, end), end, key=lambda each: each[1])
    best = min(ends.values(), key=lambda end: end[1] + price(fit.model, limits, end[0]))
    rivals, (kept, _, x) = tuple(end for end in ends.values() if end is not best), best
    if kept is fit.kept:
        return replace(fit, rivals=rivals)
    try:
        found = descend(whole, x, kept)
        model, J = _over_all(whole, found, kept)
    except ConvergenceError:
        return replace(fit, rivals=tuple(end for end in ends.values() if end[0] is not fit.kept))
    return replace(fit, point=found.point, model=model, J=J, kept=kept, rivals=rivals)


def _exchanged(fit: Fit) -> list[tuple[Rows, Vector]]:
    """Return sets and unknowns in which a zone has the damage of one that reads much like it, the most alike first."""
    J, kept = fit.J[:, : fit.problem.zones], fit.kept[: fit.problem.zones]
    J = J / np.maximum(np.linalg.norm(J, axis=0), NEGLIGIBLE)
    alike = np.where(kept[:, None] & ~kept, J.T @ J, 0.0)
    starts = []
    for k in np.argsort(-alike, axis=None)[: min(MOST_RIVALS, np.count_nonzero(alike > ALIKE))]:
        order = np.arange(fit.kept.size)
        pair = np.array(np.unravel_index(k, alike.shape))
        order[pair] = pair[::-1]
        starts.append((fit.kept[order], fit.point.x[order]))
    return starts


def _common_as_modulus(problem: RecordProblem, x: Vector) -> Vector:
    """Return unknowns that make the same membrane, but for clipping, and whose damages lie about zero.

    Damage and modulus enter as E (1 - d) alone, so that what half of the zones have in common may be the modulus.
    """
    zones = problem.whole
    found, common = x.copy(), float(np.median(x[:zones]))
    found[:zones] = 1.0 - (1.0 - x[:zones]) / (1.0 - common)
    found[problem.modulus] += math.log(1.0 - common) / FACTORS[MODULUS][1]
    return np.clip(found, problem.low, problem.high)


def _moved(problem: RecordProblem, x: Vector, move: Vector, kept: Rows) -> Vector:
    return np.where(kept, np.clip(x + move, problem.low, problem.high), 0.0)
