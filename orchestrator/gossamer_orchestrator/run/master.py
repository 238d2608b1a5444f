"""The master algorithm: step every FMU from one communication point to the next.

Symbols: ``k`` tick (an integer), ``h`` communication step [s], ``y`` values read from an FMU.

Time is ``start + k * h`` and nothing is accumulated. A step that an FMU discards is repeated in 2, 4, .. 64 equal parts
from the state at its start; within step ``k`` time is ``start + (64 k + j) * (h / 64)``, which is exact at ``j = 0``
because 64 is a power of two.
"""

from __future__ import annotations

import ctypes
import logging
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Protocol

from ..errors import SimulationError
from ..fmi.instance import Instance
from ..fmi.model_exchange import start_instance
from ..scenario.plan import Plan
from .channel import Channel
from .group import IteratedGroup
from .member import Member
from .position import (
    CALL,
    COMPONENT,
    DIVIDED,
    FREE,
    INITIALIZE,
    INSTANTIATE,
    PART,
    STEP,
    STOP,
    TICK,
    Position,
    new_position,
)
from .store import Store

logger = logging.getLogger(__name__)

MAX_PARTS = 64


class Observer(Protocol):
    """Something that watches a run."""

    def begin(self, simulation: Simulation) -> None:
        """Prepare; the FMUs are initialized and the run stands at its first communication point."""

    def sample(self, simulation: Simulation) -> None:
        """Look at ``simulation.tick``, ``time`` and ``values``; called at every communication point."""

    def end(self, simulation: Simulation) -> None:
        """Finish; also called when the run fails."""


class Simulation:
    """A running plan. Use it as a context manager: it frees the FMUs however the run ends.

    Parameters
    ----------
    plan : Plan
        What to run.
    position : Position or None
        Where to write which FMU is called; None is memory of its own.
    strict : bool
        End the run where a group does not converge; by default that is a warning.

    Attributes
    ----------
    tick : int
        Communication steps done.
    values : numpy.ndarray
        Variables read from the FMUs; ``places`` gives their positions. A variable that no component receives is read
        only at recorded points.
    places : dict
        Index in ``values`` by ``(component, variable)``.
    divided : int
        Steps that had to be repeated in parts.
    groups : list of IteratedGroup
        Components that are stepped together.
    ended : str
        Which FMU ended the simulation by itself, and when; empty if none did.
    """

    def __init__(self, plan: Plan, position: Position | None = None, *, strict: bool = False) -> None:
        self.plan = plan
        self.position = new_position() if position is None else position
        self.scenario = plan.scenario
        self.tick = 0
        self.divided = 0
        self.members: list[Member] = []
        self.groups: list[IteratedGroup] = []
        self._stages: list[tuple[int, Member | IteratedGroup]] = []  # in stepping order, with the first's number
        self._strict = strict
        self.ended = ""
        self._instances: list[Instance] = []
        self._over: list[Instance] = []
        self.store = Store(plan)
        self.places, self.values = self.store.places, self.store.values
        self._jacobi = plan.scenario.master == "jacobi"
        self._every = plan.scenario.record.every
        self._ticks = plan.scenario.ticks
        self._unit = plan.scenario.step / MAX_PARTS
        self._can_repeat = all(file.can_repeat for file in plan.files)

    @property
    def over(self) -> bool:
        """Whether an FMU has ended the simulation."""
        return bool(self._over)

    @property
    def time(self) -> float:
        """Present communication point [s]."""
        return self.scenario.seconds(self.tick)

    def __enter__(self) -> Simulation:
        try:
            self._start()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Terminate and free every FMU and remove the unpacked files; may be called twice."""
        self.position[CALL] = FREE
        for number, instance in enumerate(self._instances):
            self.position[COMPONENT] = number
            instance.close()
        self.position[COMPONENT] = -1
        self._instances.clear()
        self.plan.close()

    def run(self, observers: Sequence[Observer] = ()) -> None:
        """Simulate to the end, from the start or the state that was restored.

        At the end the first warning of every FMU is logged.

        Raises
        ------
        SimulationError
            An FMU failed, or refused a step even in the smallest parts. Every observer's ``end`` has been called.
        KeyboardInterrupt
            Ctrl-C, or a signal that asks for the end, delivered between two steps: inside an FMU written in Python it would
            be fatal to the FMU.
        """
        position = self.position
        with deferred_interrupt(position):
            try:
                for observer in observers:
                    observer.begin(self)
                for observer in observers if self.tick == 0 else ():
                    observer.sample(self)
                while self.tick < self._ticks and not self._over:
                    if not self.step():
                        break
                    for observer in observers:
                        observer.sample(self)
                    if position[STOP]:
                        raise KeyboardInterrupt
                if self._over:
                    first = self._over[0]
                    self.ended = f"component {first.name!r} ended the simulation at t = {first.ended_at:.9g} s"
                    logger.warning("%s", self.ended)
            finally:
                for observer in observers:
                    observer.end(self)
                for group in self.groups:
                    group.conclude()
                for member in self.members:
                    if warning := member.instance.log.first_warning:
                        logger.warning("component %r %s", member.name, warning)

    def step(self) -> bool:
        """Advance by one communication step; False if an FMU has ended the simulation before the end of it.

        Raises
        ------
        SimulationError
            See ``run``.
        """
        position = self.position
        position[TICK], position[PART], position[CALL] = self.tick, 0, STEP
        for name, values in self.plan.events.get(self.tick, ()):
            self._called(name).set(values)
        if self._over:
            position[COMPONENT] = -1
            return False
        self.store.look_up(self.time)
        if self._can_repeat:
            for number, member in enumerate(self.members):
                position[COMPONENT] = number
                member.instance.save_state()
            self.store.save()
        channels = self.channels
        held = [channel.held for channel in channels]
        parts = 1
        while (refused := self._try(parts)) is not None:
            if self._over:
                position[COMPONENT] = -1
                return False
            if not self._can_repeat or parts == MAX_PARTS:
                raise self._refusal(refused, parts)
            parts *= 2
            for member in self.members:
                member.instance.restore_state()
            for channel, value in zip(channels, held, strict=True):
                channel.held = value
            self.store.restore()
        position[COMPONENT] = -1
        if parts > 1:
            self.divided += 1
            position[DIVIDED] = self.divided
            logger.info("step %d (t = %g s) was done in %d parts", self.tick, self.time, parts)
        self.tick += 1
        return True

    def _start(self) -> None:
        """Instantiate all FMUs and initialize each after those that feed it."""
        start, position = self.scenario.start, self.position
        begin = 0
        position[CALL] = INSTANTIATE
        for component in self.plan.components:
            position[COMPONENT] += 1
            instance = start_instance(component.fmu, component.name, start)
            instance.on_end = self._over.append
            self._instances.append(instance)
            self.members.append(Member(component, instance, self.store, begin))
            begin += len(component.read)
        self._make_stages()
        self.store.look_up(start)
        position[CALL] = INITIALIZE
        done: set[str] = set()
        for name in self.plan.start_order:
            if name in done:
                continue
            group = next((group for group in self.groups if name in group.names), None)
            names = [name] if group is None else group.names
            for each in names:
                self._enter_initialization(each)
            if group is not None:
                group.initialize(start)
            for each in names:
                member = self._called(each)
                member.receive(0)
                member.instance.exit_initialization()
                member.read(full=True)
                self.store.arrive()
            done.update(names)
        position[COMPONENT] = -1

    def _make_stages(self) -> None:
        """Put the components of each group together; they are neighbours in the stepping order."""
        homes = {name: group for group in self.scenario.groups for name in group.components}
        for number, member in enumerate(self.members):
            group = homes.get(member.name)
            if group is None:
                self._stages.append((number, member))
            elif not self.groups or member.name not in self.groups[-1].names:
                members = list(enumerate(self.members))[number : number + len(group.components)]
                one = IteratedGroup(
                    group, members, self.plan, self.store, self.position, self._over, strict=self._strict
                )
                self.groups.append(one)
                self._stages.append((number, one))

    def _called(self, name: str) -> Member:
        """Return a member that is about to be called, and note that."""
        member = self.member(name)
        self.position[COMPONENT] = self.members.index(member)
        return member

    def _enter_initialization(self, name: str) -> None:
        """Set the start values of a component, and its inputs at the start."""
        member = self._called(name)
        member.instance.set_start(self.plan.component(name).start)
        member.instance.enter_initialization(self.scenario.stop)
        for receiver, values in self.plan.events.get(0, ()):
            if receiver == name:
                member.set(values)

    def _try(self, parts: int) -> Member | None:
        """Do the present step in equal parts; return the member that refused one, if any."""
        tick, position = self.tick, self.position
        full = (tick + 1) % self._every == 0 or tick + 1 == self._ticks
        stride = MAX_PARTS // parts
        size = ctypes.c_double(self.scenario.step / parts)
        for part in range(parts):
            time = ctypes.c_double(self.scenario.start + (tick * MAX_PARTS + part * stride) * self._unit)
            last = full and part == parts - 1
            position[PART] = part
            if self._jacobi:
                self.store.arrive()
            for number, stage in self._stages:
                position[COMPONENT] = number
                stage.receive(tick + 1)
                if not stage.advance(time, size, full=last):
                    return self.members[position[COMPONENT]]
            if self._over:
                if part < parts - 1:
                    return self.members[position[COMPONENT]]
                for each in self.members:
                    each.read(full=True)  # this is the last point
        return None

    def _refusal(self, member: Member, parts: int) -> SimulationError:
        """Explain which component refused which step, and what it logged."""
        if self._can_repeat:
            how = f"even in {parts} parts of {self.scenario.step / parts:.3g} s"
            advice = "Correct its inputs or parameters, or start from smaller loads."
        else:
            unable = [file.name for file in self.plan.files if not file.can_repeat]
            why = f"{', '.join(unable)} cannot restore its state or vary its step"
            how = f"and the step cannot be repeated in parts, because {why}"
            advice = "Use a smaller 'step'."
        msg = (
            f"component {member.name!r} refused the step of {self.scenario.step:g} s at t = {self.time:.9g} s, {how}."
            f"{member.instance.log.tail()} {advice}"
        )
        return SimulationError(msg, component=member.name, time=self.time)

    def read(self, *names: str) -> None:
        """Read all variables at the present communication point, of the components named or of all."""
        for number, member in enumerate(self.members):
            if not names or member.name in names:
                self.position[COMPONENT] = number
                member.read(full=True)
        self.position[COMPONENT] = -1

    @property
    def channels(self) -> list[Channel]:
        """Channels of all components."""
        return [channel for member in self.members for channel in member.all_channels]

    def serialize(self) -> list[bytes]:
        """Return the states of all FMUs at the present communication point."""
        states = []
        for number, member in enumerate(self.members):
            self.position[COMPONENT] = number
            states.append(member.instance.serialize())
        self.position[COMPONENT] = -1
        return states

    def deserialize(self, states: Sequence[bytes]) -> None:
        """Bring all FMUs to the states that ``serialize`` returned."""
        for number, (member, state) in enumerate(zip(self.members, states, strict=True)):
            self.position[COMPONENT] = number
            member.instance.deserialize(state)
        self.position[COMPONENT] = -1

    def member(self, name: str) -> Member:
        """Return a member by name."""
        return next(member for member in self.members if member.name == name)


def ending_signals() -> list[signal.Signals]:
    """List the signals of this system that ask this program to end.

    Under nohup SIGHUP does not. SIGINT does, though a shell lets what runs in its background ignore it.
    """
    there = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    return [number for number in there if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN]


@contextmanager
def deferred_interrupt(position: Position) -> Iterator[None]:
    """Let Ctrl-C and the signals that ask for the end stop the run after the present step; a second one acts at once."""
    previous = {number: signal.getsignal(number) for number in ending_signals()}

    def remember(_signal: int, _frame: FrameType | None) -> None:
        position[STOP] = 1
        restore()

    def restore() -> None:
        for number, handler in previous.items():
            with suppress(TypeError, ValueError):
                signal.signal(number, handler)

    with suppress(ValueError):  # only the main thread can handle signals
        for number in previous:
            signal.signal(number, remember)
    try:
        yield
    finally:
        restore()
