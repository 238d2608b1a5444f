"""How a communication step is divided: where an FMU discards it, or where an error demands it.

Without step control a step that an FMU discards is repeated in 2, 4, .. 64 equal parts, from the state at its start. With
it each step is done once whole and once in two halves, and the halves are kept.

Symbols: ``y`` values that are sent, after the halves; ``e`` their difference from those after the whole step, over
``tolerance`` and their nominal value, or where the FMU declares none their largest value so far, at least ``FLOOR``.

A step of an explicit master has an error of order two, so halving it divides ``e`` by four. Steps are the communication step
over a power of two, and end at communication points, where results are recorded.
"""

from __future__ import annotations

import logging
from typing import Protocol

import numpy as np
from gossamer_files.options import option
from numpy.typing import NDArray

from ..errors import SimulationError
from ..fmi.instance import Instance
from ..fmi.types import FLOATS
from ..scenario import schema
from ..scenario.plan import Plan
from .member import Member
from .position import PART, STOP, Position
from .stages import IteratedGroup, nominal

UNITS = 2**20  # parts of a communication step, in which those of it are counted
MAX_PARTS = 64


class Steps(Protocol):
    """What a division of steps needs of a ``Simulation``, which describes it."""

    plan: Plan
    position: Position
    tick: int
    values: NDArray[np.float64]
    places: dict[tuple[str, str], int]
    members: list[Member]
    ended_by: list[Instance]
    groups: list[IteratedGroup]

    @property
    def over(self) -> bool:
        """Whether an FMU has ended the simulation."""

    @property
    def time(self) -> float:
        """Present communication point [s]."""

    def save(self) -> None:
        """Keep the present state of everything for ``restore``."""

    def restore(self) -> None:
        """Go back to what was kept, as often as needed."""

    def substep(self, begin: int, size: int, *, full: bool) -> Member | None:
        """Step every component once; return who refused."""

    def is_recorded(self, tick: int) -> bool:
        """Tell whether what is recorded is read at a communication point."""

    def read(self) -> None:
        """Read all variables at the present communication point."""


class Division:
    """Do each communication step of a run whole, if no FMU refuses it.

    Parameters
    ----------
    simulation : Steps
        The run.
    """

    def __init__(self, simulation: Steps) -> None:
        self._simulation = simulation
        self._can_repeat = all(file.can_repeat for file in simulation.plan.files)

    def advance(self) -> int:
        """Do the present communication step; return in how many parts, 0 if an FMU has ended before its end.

        Raises
        ------
        SimulationError
            An FMU refused it, even in the smallest parts.
        """
        simulation = self._simulation
        if self._can_repeat:
            simulation.save()
        full, parts = simulation.is_recorded(simulation.tick + 1), 1
        while True:
            size, refused, part = UNITS // parts, None, 0
            for part in range(parts):
                simulation.position[PART] = part
                refused = simulation.substep(part * size, size, full=full and part == parts - 1)
                if refused is not None or simulation.over:
                    break
            if simulation.over:
                if refused is not None or part < parts - 1:
                    return 0
                simulation.read()  # this is the last point
                return parts
            if refused is None:
                return parts
            if not self._can_repeat or parts == MAX_PARTS:
                raise refusal(simulation, refused, parts)
            parts *= 2
            simulation.restore()

    def conclude(self) -> None:
        """Say nothing at the end of the run."""


def refusal(simulation: Steps, member: Member, parts: int) -> SimulationError:
    """Explain which component refused the present step in so many parts, and what it logged."""
    step, unable = simulation.plan.scenario.step, [file.name for file in simulation.plan.files if not file.can_repeat]
    if unable:
        why = f"{', '.join(unable)} cannot restore its state or vary its step"
        how = f"and the step cannot be repeated in parts, because {why}"
        advice = "Use a smaller 'step'."
    else:
        how = f"even in {parts} parts of {step / parts:.3g} s"
        advice = "Correct its inputs or parameters, or start from smaller loads."
    msg = (
        f"component {member.name!r} refused the step of {step:g} s at t = {simulation.time:.9g} s, {how}."
        f"{member.instance.log.tail()} {advice}"
    )
    return SimulationError(msg, component=member.name, time=simulation.time)


logger = logging.getLogger(__name__)

FLOOR = 1.0  # least size of a value whose nominal value is not declared, in its unit, as FMI assumes: it may begin at zero
ENOUGH = 0.1  # where e is less, the next step is twice as large: e is then expected below 0.4


class ControlledSteps:
    """The steps of a run.

    Parameters
    ----------
    simulation : Steps
        The run.
    wanted : schema.StepControl
        Tolerance and most parts.
    strict : bool
        Raise ``SimulationError`` where the smallest step misses the tolerance.

    Attributes
    ----------
    size : int
        Size of the next step, in ``UNITS``.
    peaks : numpy.ndarray
        Nominal value, or largest magnitude so far, of each value that is compared.
    """

    def __init__(self, simulation: Steps, wanted: schema.StepControl, *, strict: bool) -> None:
        self._simulation, self._strict = simulation, strict
        self._tolerance, self._smallest = wanted.tolerance, UNITS // wanted.parts
        plan, places = simulation.plan, simulation.places
        sent = [
            (places[c.name, v], c.fmu.variables[v])
            for c in plan.components
            for v in c.sent
            if c.fmu.variables[v].type in FLOATS
        ]
        self._places = np.array([place for place, _ in sent], dtype=np.intp)
        self.peaks: NDArray[np.float64] = np.array([nominal(variable) for _, variable in sent])
        self._declared = self.peaks > 0.0
        self.size = UNITS
        self._misses = 0

    def advance(self) -> int:
        """Do the present communication step; return in how many steps, 0 if an FMU has ended before its end.

        Raises
        ------
        SimulationError
            An FMU refused the smallest step.
        """
        simulation, at, steps = self._simulation, 0, 0
        while at < UNITS:
            if simulation.position[STOP]:
                raise KeyboardInterrupt
            size, small = self.size, self.size <= self._smallest
            for group in simulation.groups:
                group.may_refuse = not small
            simulation.save()
            refused, error, peaks = self._compare(at, size)
            if simulation.over:
                if refused is not None or at + size < UNITS:
                    return 0
                simulation.read()  # this is the last point
                return steps + 1
            if refused is not None and small:
                raise refusal(simulation, refused, UNITS // size)
            if refused is not None or (error > 1.0 and not small):
                simulation.restore()
                self.size = size // 2
                continue
            if error > 1.0:
                self._miss(error)
            self.peaks, at, steps = peaks, at + size, steps + 1
            if error < ENOUGH and at % (2 * size) == 0 and size < UNITS:
                self.size = 2 * size
        if simulation.is_recorded(simulation.tick + 1):
            simulation.read()
        return steps

    def conclude(self) -> None:
        """Say how often it missed the tolerance, if more than the once that has been said."""
        if self._misses > 1:
            logger.warning("the step control missed its tolerance in %d steps", self._misses)

    def _compare(self, at: int, size: int) -> tuple[Member | None, float, NDArray[np.float64]]:
        """Do a step whole, take it back, and do it in halves.

        Returns
        -------
        (Member or None, float, numpy.ndarray)
            Who refused the step, or ended before its end; ``e``; and what ``peaks`` are if the halves are kept.
        """
        simulation, half = self._simulation, size // 2
        simulation.position[PART] = at
        refused = simulation.substep(at, size, full=False)
        if refused is not None and not simulation.over:
            return refused, 0.0, self.peaks
        whole = simulation.values[self._places]
        simulation.ended_by.clear()
        simulation.restore()
        for begin in (at, at + half):
            refused = simulation.substep(begin, half, full=False)
            if simulation.over and begin == at:
                refused = next(member for member in simulation.members if member.instance in simulation.ended_by)
            if refused is not None:
                return refused, 0.0, self.peaks
        y = simulation.values[self._places]
        with np.errstate(all="ignore"):
            peaks = np.where(self._declared, self.peaks, np.fmax(self.peaks, abs(y)))
            scale = np.where(self._declared, peaks, np.fmax(peaks, FLOOR))
            error = float(np.max(abs(y - whole) / scale, initial=0.0)) / self._tolerance
        return None, error if np.isfinite(error) else np.inf, peaks

    def _miss(self, error: float) -> None:
        """Say that the smallest step misses the tolerance, the first time; with ``strict`` raise it."""
        self._misses += 1
        simulation = self._simulation
        text = (
            f"the smallest step of the step control, {simulation.plan.scenario.step * self._smallest / UNITS:.3g} s, has "
            f"{error:.3g} times the error of 'tolerance' = {self._tolerance:g} after t = {simulation.time:.9g} s."
        )
        advice = "Allow more 'parts', or use a larger 'tolerance'."
        if self._strict:
            msg = f"{text} {advice}"
            raise SimulationError(msg, component="", time=simulation.time)
        if self._misses == 1:
            logger.warning("%s The run goes on; %s ends it there. %s", text, option("strict", True), advice)
