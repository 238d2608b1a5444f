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
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Protocol

from ..errors import SimulationError
from ..fmi.instance import Instance
from ..fmi.instance3 import start_instance
from ..scenario.plan import Plan
from .member import Member
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
    ended : str
        Which FMU ended the simulation by itself, and when; empty if none did.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.scenario = plan.scenario
        self.tick = 0
        self.divided = 0
        self.members: list[Member] = []
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
        for instance in self._instances:
            instance.close()
        self._instances.clear()
        self.plan.close()

    def run(self, observers: Sequence[Observer] = ()) -> None:
        """Simulate to the end.

        At the end the first warning of every FMU is logged.

        Raises
        ------
        SimulationError
            An FMU failed, or refused a step even in the smallest parts. Every observer's ``end`` has been called.
        KeyboardInterrupt
            Ctrl-C, delivered between two steps: inside an FMU written in Python it would be fatal to the FMU.
        """
        with _deferred_interrupt() as interrupted:
            try:
                for observer in observers:
                    observer.begin(self)
                for observer in observers:
                    observer.sample(self)
                while self.tick < self._ticks and not self._over:
                    if not self.step():
                        break
                    for observer in observers:
                        observer.sample(self)
                    if interrupted.is_set():
                        raise KeyboardInterrupt
                if self._over:
                    first = self._over[0]
                    self.ended = f"component {first.name!r} ended the simulation at t = {first.ended_at:.9g} s"
                    logger.warning("%s", self.ended)
            finally:
                for observer in observers:
                    observer.end(self)
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
        for name, values in self.plan.events.get(self.tick, ()):
            self._member(name).set(values)
        self.store.look_up(self.time)
        if self._can_repeat:
            for member in self.members:
                member.instance.save_state()
            self.store.save()
        channels = [channel for member in self.members for channel in member.all_channels]
        held = [channel.held for channel in channels]
        parts = 1
        while (refused := self._try(parts)) is not None:
            if self._over:
                return False
            if not self._can_repeat or parts == MAX_PARTS:
                raise self._refusal(refused, parts)
            parts *= 2
            for member in self.members:
                member.instance.restore_state()
            for channel, value in zip(channels, held, strict=True):
                channel.held = value
            self.store.restore()
        if parts > 1:
            self.divided += 1
            logger.info("step %d (t = %g s) was done in %d parts", self.tick, self.time, parts)
        self.tick += 1
        return True

    def _start(self) -> None:
        """Instantiate all FMUs and initialize each after those that feed it."""
        scenario, start = self.scenario, self.scenario.start
        begin = 0
        for component in self.plan.components:
            instance = start_instance(component.fmu, component.name, start)
            instance.on_end = self._over.append
            self._instances.append(instance)
            self.members.append(Member(component, instance, self.store, begin, scenario.ticks))
            begin += len(component.read)
        self.store.look_up(start)
        for name in self.plan.start_order:
            member = self._member(name)
            instance = member.instance
            instance.set_start(self.plan.component(name).start)
            instance.enter_initialization(scenario.stop)
            for receiver, values in self.plan.events.get(0, ()):
                if receiver == name:
                    member.set(values)
            member.receive(0)
            instance.exit_initialization()
            member.read(full=True)
            self.store.arrive()

    def _try(self, parts: int) -> Member | None:
        """Do the present step in equal parts; return the member that refused one, if any."""
        tick = self.tick
        full = (tick + 1) % self._every == 0 or tick + 1 == self._ticks
        stride = MAX_PARTS // parts
        size = ctypes.c_double(self.scenario.step / parts)
        for part in range(parts):
            time = ctypes.c_double(self.scenario.start + (tick * MAX_PARTS + part * stride) * self._unit)
            last = full and part == parts - 1
            if self._jacobi:
                self.store.arrive()
            for member in self.members:
                member.receive(tick + 1)
                if not member.advance(time, size, full=last):
                    return member
            if self._over:
                if part < parts - 1:
                    return member
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

    def _member(self, name: str) -> Member:
        return next(member for member in self.members if member.name == name)


@contextmanager
def _deferred_interrupt() -> Iterator[threading.Event]:
    """Turn Ctrl-C into a flag; a second Ctrl-C acts at once."""
    interrupted = threading.Event()

    def remember(_signal: int, _frame: FrameType | None) -> None:
        interrupted.set()
        signal.signal(signal.SIGINT, previous)

    previous = signal.getsignal(signal.SIGINT)
    with suppress(ValueError):  # only the main thread can handle signals
        signal.signal(signal.SIGINT, remember)
    try:
        yield interrupted
    finally:
        with suppress(TypeError, ValueError):
            signal.signal(signal.SIGINT, previous)
