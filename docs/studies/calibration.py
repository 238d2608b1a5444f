"""Are the deviations, probabilities and bounds of the twin true? Calibration by simulation, and a posterior by random steps.

``python -m studies.calibration [CASES] [WORLD]`` from the folder ``docs`` draws damages and all that is not known from the
twin's own priors: each zone is damaged with odds of 1 to 10, by anything from 0 to 95 %; nuisances are normal numbers. It
simulates a record of each on the twin's own mesh, adds white noise, fits it, and prints how often stated bounds hold, how
large errors are in stated deviations, how often zones of a stated probability are damaged, and whether truths have uniform
ranks in the posterior. ``--picture`` writes docs/calibration.png.

``python -m studies.calibration --mcmc [RECORDS] [WORLD]`` compares the posterior of the zones that an answer kept, and of
all nuisances, with one by Metropolis' algorithm on the twin's own nonlinear model.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
from gossamer_models.membrane import square_structure
from gossamer_models.twin import Answer, ResponseRecord, Twin
from gossamer_models.twin.forward import LANES
from gossamer_models.twin.least_squares import MOST_DAMAGE
from gossamer_models.twin.problem import RecordProblem
from gossamer_models.twin.record import Wiring
from gossamer_models.twin.search import Fit
from gossamer_models.twin.zone_sets import ODDS, THRESHOLD
from numpy.typing import NDArray
from scipy.special import betaincinv, chdtrc, ndtr, ndtri
from threadpoolctl import threadpool_limits

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]
STEP = 3e-4  # [s]
NOISE = 0.02 / np.sqrt(12.0)  # of strain, the thesis' [1]
EDGES = (0.0, 1e-4, 1e-3, 0.01, 0.03, 0.1, 0.3, 0.7, 0.9, 0.99, 1.01)  # of stated probabilities
LEAST = 1e-3  # that is drawn
BINS = 10  # of ranks


@dataclass(frozen=True)
class World:
    """Elements per side and their order, samples, and noise [1]."""

    mesh: tuple[int, int]
    samples: int
    noise: float


WORLDS = {
    "small": World((4, 1), 600, NOISE),
    "small, 0.1 %": World((4, 1), 600, 1e-3),
    "bilinear": World((8, 1), 1000, NOISE),
}


class OpenTwin(Twin):
    """A twin that keeps its last fit."""

    last: Fit

    def _answer(self, fit: Fit, doubts: list[str], wiring: Wiring | None, unresolved: tuple[int, ...]) -> Answer:
        self.last = fit
        return super()._answer(fit, doubts, wiring, unresolved)


@dataclass(frozen=True)
class Case:
    """A truth, shape (n,), the problem of its record without what the twin found out about it, fit and answer."""

    truth: Array
    problem: RecordProblem
    fit: Fit
    answer: Answer


def cases(world: World, count: int, seed: int = 0) -> Iterator[Case]:
    """Draw truths from the prior and fit their records."""
    random, twin = np.random.default_rng(seed), OpenTwin(square_structure(*world.mesh))
    blank = ResponseRecord(step=STEP, values=np.ones((twin.sensors, world.samples)), noise=world.noise)
    problem = twin._problem(blank)
    for _ in range(count):
        damaged = random.random(twin.zones) < ODDS / (1.0 + ODDS)
        damage = np.where(damaged, random.uniform(0.0, MOST_DAMAGE, twin.zones), 0.0)
        truth = np.r_[damage, random.standard_normal(problem.size - twin.zones)]
        noise = world.noise * random.standard_normal(blank.values.shape)
        values = problem._read(problem.predict(truth[None]), problem.z(truth[None]))[0] + noise
        record = ResponseRecord(step=STEP, values=values, noise=world.noise)
        answer = twin.fit(record)
        yield Case(truth, twin._problem(record), twin.last, answer)


def ranks(case: Case) -> tuple[Array, Array]:
    """Return the ranks of a truth in the posterior: of damages, given that the zones are damaged, and of nuisances.

    The posterior is the mixture of normal distributions over sets of zones that the answer states, cut off at the bounds of
    each unknown. Nothing is returned of zones that are answered together.
    """
    fit, zones, size = case.fit, case.problem.zones, case.problem.size
    if fit.problem.size < size:
        return np.zeros(0), np.zeros(0)
    A, likely, damaged = fit.model.A, fit.likely, case.truth[:zones] > 0.0
    below, weight = np.zeros(size), np.zeros(size)
    vague = np.r_[np.broadcast_to(fit.vague, zones), np.zeros(size - zones)]

    def add(kept: Rows, move: Array, share: float, places: Rows) -> None:
        s = np.hypot(np.sqrt(np.diag(np.linalg.inv(A[np.ix_(kept, kept)]))), vague[kept])
        mean = (fit.point.x + move)[kept]
        low, at, high = (ndtr((x[kept] - mean) / s) for x in (case.problem.low, case.truth, case.problem.high))
        rank = np.clip((at - low) / np.maximum(high - low, 1e-300), 0.0, 1.0)
        below[places] += share * rank[places[kept]]
        weight[places] += share

    for share, kept, move in zip(likely.weight, likely.kept, likely.move, strict=True):
        add(kept, move, share, kept)
    for k in np.flatnonzero(damaged & (weight[:zones] == 0.0)):  # of no set: its damage would be negative
        alone = np.arange(size) == k
        kept, move = fit.kept | alone, np.zeros(size)
        move[kept] = np.linalg.solve(A[np.ix_(kept, kept)], fit.model.g[kept])
        add(kept, move, 1.0, alone)
    rank = below / weight.clip(1e-300)
    return rank[:zones][damaged], rank[zones:]


@dataclass(frozen=True)
class Found:
    """What the cases of a world show, of zones in rows.

    Attributes
    ----------
    truth, damage, deviation, probability : ndarray, shape (cases, zones)
        True and stated damages, stated deviations and probabilities.
    valid, missed : ndarray of bool, shape (cases,)
        Whether an answer is valid, and whether the search has not found the valley of the truth: its chi2, with 9 for each
        damaged zone, is above that of the truth by more than 9.
    determined : ndarray of bool, shape (cases, zones)
        Zones with a value.
    of_damages, of_nuisances : ndarray
        Ranks, shape (damaged zones,) and (cases, nuisances).
    seconds : float
        CPU time of a fit.
    """

    truth: Array
    damage: Array
    deviation: Array
    probability: Array
    valid: Rows
    missed: Rows
    determined: Rows
    of_damages: Array
    of_nuisances: Array
    seconds: float


def found(made: Sequence[Case], seconds: float) -> Found:
    """Gather what some cases show."""
    zones, rank = made[0].problem.zones, [ranks(case) for case in made]
    return Found(
        truth=np.array([case.truth[:zones] for case in made]),
        damage=np.array([case.answer.damage for case in made]),
        deviation=np.array([case.answer.deviation for case in made]),
        probability=np.array([case.answer.probability for case in made]),
        valid=np.array([case.answer.valid for case in made]),
        missed=np.array([missed(case) for case in made]),
        determined=np.array([case.answer.determined for case in made]),
        of_damages=np.concatenate([each for each, _ in rank]),
        of_nuisances=np.array([each for _, each in rank if each.size]),
        seconds=seconds,
    )


def missed(case: Case) -> bool:
    """Tell whether the search has not found the valley of the truth."""
    zones = case.problem.zones
    x = np.r_[case.answer.damage, case.fit.point.x[case.fit.problem.zones :]]
    truth, fit = (
        point.chi2 + THRESHOLD * np.count_nonzero(point.x[:zones])
        for point in case.problem.points(np.array([case.truth, x]))
    )
    return bool(fit > truth + THRESHOLD)


def coverage(some: Found, zones: Rows) -> str:
    """Return how often the bounds of some zones hold, and the size of their errors in stated deviations."""
    error, s = (some.damage - some.truth)[zones], some.deviation[zones]
    shares = []
    for width in (1.96, 0.6745):
        low, high = (np.clip(some.damage[zones] + way * width * s, 0.0, 1.0) for way in (-1.0, 1.0))
        shares.append(100.0 * np.mean((low - 1e-12 <= some.truth[zones]) & (some.truth[zones] <= high + 1e-12)))
    z = np.abs(error / s)
    return (
        f"{z.size:6d}  {shares[0]:5.1f} %  {shares[1]:5.1f} %  {np.sqrt(np.mean(z**2)):6.2f}  {np.median(z) / 0.6745:6.2f}"
    )


def reliability(some: Found) -> list[tuple[int, float, int]]:
    """Return of ranges of probabilities in valid answers the zones, the sum of what is stated, and how many are damaged."""
    bins = np.where(some.valid[:, None], np.digitize(some.probability, EDGES), 0)
    return [
        (int(here.sum()), float(some.probability[here].sum()), int((some.truth[here] > 0.0).sum()))
        for here in (bins == k for k in range(1, len(EDGES)))
    ]


def uniform(rank: Array) -> float:
    """Return the chance that uniform ranks are as uneven in ten bins, by chi2."""
    counts = np.histogram(rank, BINS, (0.0, 1.0))[0]
    expected = rank.size / BINS
    return float(chdtrc(BINS - 1, np.sum((counts - expected) ** 2) / expected))


def report(some: Found) -> None:
    """Print what the cases show."""
    damaged, count = some.truth > 0.0, len(some.truth)
    error = np.abs(some.damage - some.truth)
    wrong = some.valid[:, None] & some.determined & (error > 0.05) & (error > 3.0 * some.deviation)
    print(
        f"{count} cases, {some.seconds:.1f} s of CPU each: {some.valid.sum()} valid; the truth was missed in "
        f"{some.missed.sum()}, {(some.missed & some.valid).sum()} of them valid; wrong and valid: {wrong.any(axis=1).sum()}"
    )
    print(f"error [% damage], all / damaged zones: {100 * error.mean():.2f} / {100 * error[damaged].mean():.2f}")
    print("zones                    number  in 95 %  in 50 %   z rms  z median / 0.6745")
    for name, rows in (("all", np.ones(count, dtype=bool)), ("valid", some.valid), ("found", ~some.missed)):
        for what, zones in (("damaged", damaged), ("healthy", ~damaged)):
            if (here := zones & rows[:, None]).any():
                print(f"{name + ' answers, ' + what:24} {coverage(some, here)}")
    print("P(damaged), valid   zones  stated  damaged")
    for (low, high), (size, stated, true) in zip(pairwise(EDGES), reliability(some), strict=True):
        print(f"{low:7.4f} to {min(high, 1.0):6.4f} {size:7d} {stated:7.1f} {true:7d}")
    even = [uniform(rank) for rank in some.of_nuisances.T]
    print(
        f"ranks of damages {np.histogram(some.of_damages, BINS, (0, 1))[0].tolist()}, chance {uniform(some.of_damages):.3f}"
    )
    print(f"ranks of nuisances: {sum(p > 0.01 for p in even)} of {len(even)} uniform at 1 %, the worst {min(even):.4f}")


def draw(some: Found, folder: Path) -> None:
    """Draw probabilities, bounds and ranks beside what they should be."""
    from .style import BLUE, RED, panels, save

    figure, axes = panels(1, 3, (8.6, 2.7))
    sure, bounds, rank = axes[0]
    zones, stated, true = np.array([each for each in reliability(some) if each[0]]).T
    low, high = (betaincinv(true + 0.5, zones - true + 0.5, p) for p in (0.025, 0.975))
    sure.errorbar(
        stated / zones, true / zones, np.maximum([true / zones - low, high - true / zones], 0.0), fmt="o", color=BLUE, ms=3
    )
    sure.plot([LEAST, 1.0], [LEAST, 1.0], color="0.4", lw=0.8)
    sure.set(
        xscale="log",
        yscale="log",
        xlabel="stated P(damaged)",
        ylabel="share that is damaged",
        xlim=(LEAST, 1.3),
        ylim=(LEAST, 1.3),
    )
    level, z = np.linspace(0.01, 0.99, 50), np.abs((some.damage - some.truth) / some.deviation)
    for what, here, colour in (("all", some.truth > 0.0, RED), ("found", (some.truth > 0.0) & ~some.missed[:, None], BLUE)):
        bounds.plot(level, [np.mean(z[here] <= ndtri(0.5 + each / 2.0)) for each in level], color=colour, label=what)
    bounds.plot([0.0, 1.0], [0.0, 1.0], color="0.4", lw=0.8)
    bounds.set(xlabel="stated share within bounds", ylabel="share of damaged zones")
    bounds.legend()
    for values, colour, label in ((some.of_damages, BLUE, "damages"), (some.of_nuisances.ravel(), RED, "nuisances")):
        rank.hist(values, BINS, range=(0.0, 1.0), density=True, histtype="step", color=colour, label=label)
    rank.axhline(1.0, color="0.4", lw=0.8)
    rank.set(xlabel="rank of the truth in the posterior", ylabel="density", ylim=(0.0, None))
    rank.legend(loc="lower center")
    save(figure, folder, "calibration")


def posterior(case: Case, steps: int = 3000, seed: int = 0) -> tuple[Array, Array, Array]:
    """Draw the zones that an answer kept, and all nuisances, by random steps from their posterior given that set of zones.

    The chains run on the nonlinear model, one in each lane of its simulation, with the bounds and priors of the twin.

    Parameters
    ----------
    case : Case
        Whose answer it is.
    steps, seed : int
        Of each chain, after a fifth as many that do not count; of the random numbers.

    Returns
    -------
    mean, deviation, doubt : ndarray, shape (kept,)
        Of each unknown, damages first; and the standard error of the mean, from how the chains differ.
    """
    problem, kept, at = case.fit.problem, case.fit.kept, case.fit.point.x
    C, low, high = np.linalg.inv(case.fit.model.A[np.ix_(kept, kept)]), problem.low[kept], problem.high[kept]

    def chi2(x: Array) -> Array:
        rows = np.repeat(at[None], len(x), axis=0)
        rows[:, kept] = x
        return np.array([point.chi2 for point in problem.points(rows)])

    spread = np.random.default_rng(seed).standard_normal((LANES, len(C))) @ np.linalg.cholesky(C).T
    sys.path.append(str(Path(__file__).parents[2] / "tests"))
    sampler = import_module("oracles.metropolis")
    with threadpool_limits(1):
        draws = sampler.metropolis(chi2, np.clip(at[kept] + spread, low, high), C, low, high, steps, steps // 5, seed)
    doubt = draws.mean(axis=0).std(axis=0, ddof=1) / math.sqrt(LANES)
    return draws.mean(axis=(0, 1)), draws.std(axis=(0, 1)), doubt


def compare(world: World, count: int) -> None:
    """Print one line a record, and one for all."""
    print("record, valid; mean off in deviations / stated in true deviations: of each damage, of nuisances; sampling error")
    offs, ratios = (list[Array](), list[Array]()), (list[Array](), list[Array]())
    for k, case in enumerate(cases(world, count, seed=1), 1):
        mean, deviation, doubt = posterior(case)
        kept, zones = case.fit.kept, int(case.fit.kept[: case.fit.problem.zones].sum())
        off = (case.fit.point.x[kept] - mean) / deviation
        ratio = np.sqrt(np.diag(np.linalg.inv(case.fit.model.A[np.ix_(kept, kept)]))) / deviation
        for each, some in ((offs, off), (ratios, ratio)):
            each[0].append(some[:zones])
            each[1].append(some[zones:])
        text = " ".join(f"{a:+.2f}/{b:.2f}" for a, b in zip(off[:zones], ratio[:zones], strict=True))
        rest = f"({np.abs(off[zones:]).max():.2f}/{ratio[zones:].min():.2f} to {ratio[zones:].max():.2f})"
        print(f"{k:3d} {case.answer.valid!s:5} {text} {rest}  {(doubt / deviation).max():.2f}", flush=True)
    for what, some_offs, some_ratios in zip(("damages", "nuisances"), offs, ratios, strict=True):
        off, ratio = np.concatenate(some_offs), np.concatenate(some_ratios)
        print(
            f"{off.size} {what}: means off by {np.sqrt(np.mean(off**2)):.3f} deviations, at most {np.abs(off).max():.2f}, "
            f"{np.mean(np.abs(off) < 0.2):.0%} within 0.2; stated / true deviation {ratio.mean():.3f} +- {ratio.std():.3f}, "
            f"{ratio.min():.2f} to {ratio.max():.2f}, {np.mean(np.abs(ratio - 1.0) < 0.15):.0%} within 15 %"
        )


def main() -> None:
    """Print what is stated beside what is true."""
    options = {each for each in sys.argv[1:] if each.startswith("--")}
    given = [each for each in sys.argv[1:] if each not in options]
    world = WORLDS[given[1] if len(given) > 1 else "small"]
    if "--mcmc" in options:
        compare(world, int(given[0]) if given else 20)
        return
    clock = time.process_time()
    made = list(cases(world, int(given[0]) if given else 100))
    some = found(made, (time.process_time() - clock) / len(made))
    report(some)
    if "--picture" in options:
        draw(some, Path(__file__).parents[1])


if __name__ == "__main__":
    main()
