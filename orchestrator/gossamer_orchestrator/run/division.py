"""A communication step that an FMU discards is repeated in 2, 4, .. 64 equal parts, from the state at its start."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import SimulationError
from ..fmi.instance import Instance
from ..scenario.plan import Plan
from .group import IteratedGroup
from .member import Member
from .position import PART, Position

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
