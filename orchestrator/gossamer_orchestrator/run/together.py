"""Components that step at the same time, each in a thread: a native FMU releases Python's lock while it steps."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from concurrent.futures import Executor, as_completed
from typing import Protocol

from ..scenario.plan import Plan
from .member import Member
from .position import AT_ONCE, COMPONENT, RETURNED, Position


class Stage(Protocol):
    """What a run steps at once: a component, or several.

    Attributes
    ----------
    number, every : int
        Number of its first component; it steps at every n-th communication point.
    """

    number: int
    every: int

    def receive(self, tick: int) -> None:
        """Fetch the inputs for a communication point, and set them."""

    def advance(self, time: ctypes.c_double, size: ctypes.c_double, *, full: bool) -> bool:
        """Step and read outputs (all of them if ``full``); False if an FMU discarded the step."""


class Together:
    """Components none of which receives what another of them has just computed; see ``Stage``.

    Parameters
    ----------
    members : sequence of Member
        Neighbours in the stepping order.
    position : Position
        Where to note which FMUs are called.
    pool : concurrent.futures.Executor
        Threads.
    """

    def __init__(self, members: Sequence[Member], position: Position, pool: Executor) -> None:
        self.number, self.every = members[0].number, 1
        self._members, self._position, self._pool = members, position, pool

    def receive(self, tick: int) -> None:
        """Fetch the inputs for a communication point, and set them."""
        for member in self._members:
            self._position[COMPONENT] = member.number
            member.receive(tick)

    def advance(self, time: ctypes.c_double, size: ctypes.c_double, *, full: bool) -> bool:
        """Step and read outputs (all of them if ``full``); False if an FMU discarded the step."""
        first, *others = self._members
        self._position[COMPONENT], self._position[AT_ONCE] = self.number, len(self._members)
        waiting = [self._pool.submit(member.advance, time, size, full=full) for member in others]
        try:
            done = [first.advance(time, size, full=full)]
        finally:
            for _ in as_completed(waiting):
                self._position[RETURNED] += 1  # the time limit is that of a call
            self._position[AT_ONCE] = self._position[RETURNED] = 0
        errors = [future.exception() for future in waiting]
        for error in errors:
            if error is not None:
                raise error
        done += [future.result() for future in waiting]
        if all(done):
            return True
        self._position[COMPONENT] = self._members[done.index(False)].number
        return False


def side_by_side(stages: Sequence[Stage], plan: Plan, position: Position, pool: Executor) -> list[Stage]:
    """Put neighbours together that may step at the same time; the results are the same to the last bit.

    Under Gauss-Seidel a component waits for those before it that feed it.
    """
    feeds = {(c.sender, c.receiver) for c in plan.connections} if plan.scenario.master != "jacobi" else set()
    batches: list[list[Member] | Stage] = []
    for stage in stages:
        last = batches[-1] if batches else None
        if not isinstance(stage, Member) or stage.every > 1:
            batches.append(stage)
        elif isinstance(last, list) and not any((other.name, stage.name) in feeds for other in last):
            last.append(stage)
        else:
            batches.append([stage])
    alone = [batch[0] if isinstance(batch, list) and len(batch) == 1 else batch for batch in batches]
    return [Together(batch, position, pool) if isinstance(batch, list) else batch for batch in alone]
