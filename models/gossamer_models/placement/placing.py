"""Choose sensors for a membrane, and compare them with those it has."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from gossamer_files import replacing
from gossamer_files.options import option

from ..arrays import Matrix, Vector
from ..errors import ParameterError, require
from ..membrane import Sensor, Structure
from ..membrane.candidates import candidates
from ..twin.forward import MembraneForward
from ..twin.groups import UNRESOLVED
from ..twin.least_squares import PRIOR_DEVIATION
from ..twin.nuisances import OF_MOTION, Loads, LoadTable, Nuisances, possible
from ..twin.unknowns import DamageUnknowns
from .check import MonteCarloCheck, check
from .information import choose, deviations, information, smallest_damage, weakest

NOISE = 0.02 / math.sqrt(12.0)  # of the thesis: uniform from 0 to 0.02 of strain
GAUGE_NOISE = 1e-4  # of strain, where a structure is not the thesis'
STEP = 3e-4  # [s] of the square, as the twin compares its records
STOP = 0.3  # [s]
PERIODS, PER_PERIOD, CYCLES = 6.0, 150.0, 2.0  # of a record: longest periods, samples in each, periods of the load
STILL = 1e-12  # change of strain [1] that is none
UNKNOWN = ("amplitude", "damping")  # beside damage and offsets, where they act
COUNTS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)  # of sensors, of which the curve is made
TRIED = 3  # first candidates of each of them
TARGET = 0.02  # deviation [1] of the worst zone that a count is looked for with
ENOUGH = 1.2  # times the deviation of the most sensors: as many are taken where none reach the target
ROUGH = 0.2  # a response that is further from a parabola in the damage is not smooth
COMMON = 0.3  # smallest part over the largest of a damage that all zones share
PART = 0.5  # of the largest: zones that make up a combination
Report: TypeAlias = Callable[[str, int, int], None]  # what is done, how many of how many; 0 of 0 where it is one piece


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Sensors, and what they let be found.

    Attributes
    ----------
    sensors : tuple of Sensor
        Where they are.
    deviation : ndarray, shape (zones,)
        Standard deviation of each zone's damage [1] with all other zones, load, damping and offsets unknown.
    check : MonteCarloCheck or None
        Fits to simulated records.
    """

    sensors: tuple[Sensor, ...]
    deviation: Vector
    check: MonteCarloCheck | None = None

    @property
    def a90(self) -> Vector:
        """Damage [1] of each zone that is detected in 90 % of cases at 5 % false alarms, shape (zones,)."""
        return smallest_damage(self.deviation)


@dataclass(frozen=True, kw_only=True)
class Placing:
    """What ``place_sensors`` found.

    Attributes
    ----------
    structure : Structure
        The membrane.
    own : Placement or None
        Its own sensors.
    chosen : Placement
        Those chosen.
    candidates : int
        How many gauges there were to choose from.
    noise : float
        Standard deviation [1] of each sample.
    samples, step : int, float
        Of a record, and the time between them [s]; 0 for states of rest.
    simulations : int
        Cases that were simulated.
    target : float
        Deviation of the worst zone [1] that was wanted.
    curve : tuple of tuple
        Numbers of sensors with the deviation of the worst zone [1]; none where the number was given.
    unseen : tuple of str
        Sentences on what neither the chosen sensors nor all candidates tell.
    """

    structure: Structure
    own: Placement | None
    chosen: Placement
    candidates: int
    noise: float
    samples: int
    step: float
    simulations: int
    target: float = TARGET
    curve: tuple[tuple[int, float], ...] = ()
    unseen: tuple[str, ...] = ()

    @property
    def placements(self) -> dict[str, Placement]:
        """The membrane's own sensors, if they are known, and the chosen ones."""
        return {name: p for name, p in (("own", self.own), ("chosen", self.chosen)) if p is not None}

    @property
    def record(self) -> str:
        """What a record is."""
        return f"{self.samples} samples, one each {self.step:.4g} s" if self.step else f"{self.samples} states of rest"


def place_sensors(
    structure: Structure,
    load: Mapping[str, float],
    count: int | None = 4,
    *,
    loads: LoadTable | None = None,
    known: Collection[str] = (),
    target: float = TARGET,
    noise: float = NOISE,
    points: int = 64,
    step: float | None = None,
    stop: float | None = None,
    gauge_length: float = 0.0,
    records: int = 0,
    report: Report = lambda *_: None,
) -> Placing:
    """Choose points and directions of sensors by what their histories tell about the damage of every zone.

    Parameters
    ----------
    structure : Structure
        The membrane, with zones; its own sensors are among the candidates.
    load : mapping of str to float
        Parameters and inputs that differ from their start values.
    count : int or None
        Sensors to choose; None for as many as reach the target, or tell nearly as much as 64.
    loads : LoadTable or None
        What moves the structure, or brings it to some states of rest; None for the built-in pressure alone.
    known : collection of str
        Of amplitude and damping, which are unknown beside damage and offsets.
    target : float
        Deviation of the worst zone [1].
    noise : float
        Standard deviation [1] of the white noise of each sample.
    points : int
        Most points among the candidates, four directions at each.
    step, stop : float or None
        Time between samples, and length of a record from the moment that the load sets in [s]; by default a 150th of the
        longest period, and six of them, or two periods of the load if they are longer. States have neither.
    gauge_length : float
        Of the candidates [m].
    records : int
        Records to check each placement with; 0 for none.
    report : callable
        Called with what is done, and how many of how many.

    Returns
    -------
    Placing

    Raises
    ------
    ParameterError
        A number makes no sense, nothing moves, or the response to damage is not smooth.
    ConvergenceError
        A simulation fails.

    Notes
    -----
    All is linear about the undamaged membrane. The model is taken to be exact: what a finer mesh would add is left out.
    """
    if unheard := {*known} - {*UNKNOWN}:
        msg = f"{', '.join(sorted(unheard))} cannot be {option('known')}; {' and '.join(UNKNOWN)} can."
        raise ParameterError(msg)
    report("laying out the candidates", 0, 0)
    every = candidates(structure, points, gauge_length, own=True)
    forward = MembraneForward(structure, load, every)
    parameters, zones = forward.parameters, len(forward.zones)
    if loads is not None and loads.states:
        samples, step = loads.states, 0.0
        if stop is not None or not 0.0 < noise < math.inf:
            msg = f"{option('noise')} is a positive number, and states have no {option('stop')}. Correct them."
            raise ParameterError(msg)
    else:
        if stop is None:
            f = parameters["pressure_frequency"] if parameters["pressure_amplitude"] > 0.0 else 0.0
            cycles = CYCLES / f if f else 0.0 if loads is None else loads.length
            stop = float(f"{max(PERIODS * forward.period, cycles):.2g}")
        if step is None:
            step = float(f"{forward.period / PER_PERIOD:.2g}")
        samples = _samples(noise, step, stop)
    acting = Loads() if loads is None else loads.loads(samples, step)
    left_out = {*known} if step else {*known, *OF_MOTION}
    unknown = tuple(name for name in possible(parameters, acting) if name in UNKNOWN and name not in left_out)
    nuisances = Nuisances(unknown, parameters, forward.inputs, forward.sensors, acting)
    problem, simulations = DamageUnknowns(forward, nuisances), 1 + zones + len(nuisances.simulated)
    report(f"compiling the membrane and simulating {simulations} cases", 0, 0)
    strain, J = problem.linearised(np.zeros(problem.size), samples, step, lambda *each: report("simulations", *each))
    if np.ptp(strain, axis=1).max() <= STILL:
        msg = (
            "no strain changes while it is recorded, so it tells nothing. Let the built-in pressure act, for instance "
            f"{option('set', 'pressure_amplitude=100')} {option('set', 'pressure_frequency=5')}, on a setup with a load "
            f"of kind 'pressure'; or name a table of loads over time, or of states of rest, with {option('load')}."
        )
        raise ParameterError(msg)
    report("checking that the response is smooth", 0, 0)
    if (rough := problem.roughness(samples, step)) > ROUGH:
        msg = (
            f"the response to damage is not smooth: differences by three steps are {100.0 * rough:.2g} % off a parabola, "
            "as of a slack film that flaps, so histories tell nothing of damage. Pull it taut, damp it, or record load "
            "states at rest."
        )
        raise ParameterError(msg)
    report("choosing sensors", 0, 0)
    I = information(J, noise)
    curve: list[tuple[int, float]] = []
    for many in COUNTS if count is None else ():
        if many <= len(I) and (not curve or curve[-1][1] > target):
            curve.append((many, float(deviations(I[choose(I, zones, many, TRIED)].sum(axis=0), zones).max())))
    if count is None:
        count = next(many for many, worst in curve if worst <= max(target, ENOUGH * curve[-1][1]))

    def placement(which: list[int], name: str) -> Placement:
        gauges = every.only(which)

        def show(done: int, total: int) -> None:
            report(f"fits, {name} sensors", done, total)

        read = DamageUnknowns(forward.reading(gauges), nuisances)
        found = check(read, noise, samples, step, records, report=show) if records else None
        return Placement(sensors=gauges.sensors, deviation=deviations(I[which].sum(axis=0), zones), check=found)

    kept = choose(I, zones, count)
    return Placing(
        structure=structure,
        own=placement(list(range(structure.n_sensors)), "own") if structure.n_sensors else None,
        chosen=placement(kept, "chosen"),
        candidates=len(every.sensors),
        noise=noise,
        samples=samples,
        step=step,
        simulations=simulations,
        target=target,
        curve=tuple(curve),
        unseen=tuple(_unseen(structure, I, kept, every.sensors)),
    )


def _unseen(structure: Structure, I: Matrix, kept: list[int], sensors: tuple[Sensor, ...]) -> Iterator[str]:
    """Say which damages are known by no more than that they are between 0 and 95 %."""
    zones, names = structure.n_zones, structure.zone_names
    lost = _lacked(I, zones)
    if not lost and not _lacked(I[kept], zones):
        return
    _, v = weakest((I if lost else I[kept]).sum(axis=0), zones)
    which = [f"{k + 1} ({names[k]})" for k in np.flatnonzero(np.abs(v) >= PART)]
    if v.min() > COMMON:
        yield (
            "Damage common to all zones is not in this record: prescribed motion alone does not show it. Add a known load, "
            "for instance a pressure."
        )
        return
    more = [deviations(I[kept].sum(axis=0) + each, zones, PRIOR_DEVIATION)[np.abs(v) >= PART].max() for each in I]
    at = ", ".join(f"{x:.3g}" for x in sensors[int(np.argmin(more))].point)
    cure = "merge them, or load it in another way" if lost else f"merge them, or add a sensor at ({at}) m"
    what = "can only be told together" if len(which) > 1 else "is not told"
    where = "wherever sensors are" if lost else "by the chosen sensors"
    yield f"Zone{'s' * (len(which) > 1)} {', '.join(which)} {what} {where}: {cure}."


def _lacked(I: Matrix, zones: int) -> bool:
    """Tell whether a combination of damages is known by little more than that each is between 0 and 95 %."""
    deviation, v = weakest(I.sum(axis=0), zones)
    return bool(deviation * np.linalg.norm(v) > UNRESOLVED * PRIOR_DEVIATION)


def _samples(noise: float, step: float, stop: float) -> int:
    for name, value in (("noise", noise), ("step", step), ("stop", stop)):
        require(0.0 < value < math.inf, f"{option(name)} is {value:g}. Write a positive number.")
    samples = math.floor(stop / step * (1.0 + 1e-12))
    if not 2 <= samples <= 1_000_000:
        msg = f"a record of {stop:g} s at steps of {step:g} s has {samples} samples. Choose 2 to 1000000 of them."
        raise ParameterError(msg)
    return samples


def write_csv(found: Placing, path: Path) -> None:
    """Write a row for each zone: number and name, and for each placement the deviation and a90 of its damage [1]."""
    with replacing(path) as unfinished, unfinished.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(
            ["zone", "name", *(f"{name} {what} [1]" for name in found.placements for what in ("deviation", "a90"))]
        )
        for k, name in enumerate(found.structure.zone_names):
            numbers = [f"{v:.6g}" for p in found.placements.values() for v in (p.deviation[k], p.a90[k])]
            rows.writerow([k + 1, name, *numbers])


def sensors_text(found: Placing) -> str:
    """Return the chosen sensors as they stand in ``setup.toml``."""
    tables = []
    for sensor in found.chosen.sensors:
        rows = [f"point = {_vector(sensor.point)}", f"direction = {_vector(sensor.direction)}"]
        if sensor.gauge_length:
            rows.append(f"gauge_length = {sensor.gauge_length!r}")
        tables.append("\n".join(["[[sensors]]", *rows]))
    return "\n\n".join(tables) + "\n"


def _vector(values: tuple[float, float, float]) -> str:
    return f"[{', '.join(repr(float(f'{value:.12g}')) for value in values)}]"
