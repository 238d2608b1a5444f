"""The master algorithm: step every FMU from one communication point to the next.

Symbols: ``k`` tick (an integer), ``h`` communication step [s], ``y`` values read from an FMU.

Time is ``start + k * h`` and nothing is accumulated. Within step ``k`` it is ``start + (N k + j) * (h / N)``, which is exact
at ``j = 0`` because N = 2**20 is a power of two.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

from ..fmi.clocks import start_instance
from ..fmi.instance import Instance
from ..mounts import HELD, HUB, MOVING, matrix, too_light, with_edge
from ..scenario.connections import warn_of_apart
from ..scenario.plan import Plan
from ..words import brief, first_few
from . import position as at
from .joined import JoinedGroup
from .member import Member, SlowMember
from .position import COMPONENT, Position, deferred_interrupt, open_position
from .signals import Channel, Store
from .stages import IteratedGroup, Stage, side_by_side
from .steps import UNITS, ControlledSteps, Division

logger = logging.getLogger(__name__)


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
        End the run where a group does not converge or the step control misses its tolerance; by default these are warnings.
    threads : int
        How many components may step at once, where none of them receives what another has just computed.

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
    control : Division or ControlledSteps
        Divides the steps.
    ended : str
        Which FMU ended the simulation by itself, and when; empty if none did.
    ended_by : list of Instance
        FMUs that have done so.
    say : callable
        Observers say what the run waits for, where they take long, and an empty text when it goes on.
    """

    def __init__(self, plan: Plan, position: Position | None = None, *, strict: bool = False, threads: int = 1) -> None:
        self.plan = plan
        self.position = open_position() if position is None else position
        self.scenario = plan.scenario
        self.tick = 0
        self.divided = 0
        self.members: list[Member] = []
        self.groups: list[IteratedGroup] = []
        self._stages: list[Stage] = []  # in stepping order
        self._strict = strict
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None
        self.ended = ""
        self.ended_by: list[Instance] = []
        self.say: Callable[[str], None] = lambda _: None
        self._instances: list[Instance] = []
        self.store = Store(plan)
        self.places, self.values = self.store.places, self.store.values
        self._jacobi = plan.scenario.master == "jacobi"
        self._every = plan.scenario.record.every
        self._ticks = plan.scenario.ticks
        self._unit = plan.scenario.step / UNITS
        wanted = plan.scenario.step_control
        self.control = Division(self) if wanted is None else ControlledSteps(self, wanted, strict=strict)

    @property
    def over(self) -> bool:
        """Whether an FMU has ended the simulation."""
        return bool(self.ended_by)

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
        self.position[at.CALL] = at.FREE
        for number, instance in enumerate(self._instances):
            self.position[COMPONENT] = number
            instance.close()
        self.position[COMPONENT] = -1
        self._instances.clear()
        if self._pool is not None:
            self._pool.shutdown()
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
                while self.tick < self._ticks and not self.ended_by:
                    if not self.step():
                        break
                    for observer in observers:
                        observer.sample(self)
                    if position[at.STOP]:
                        raise KeyboardInterrupt
                if self.ended_by:
                    first = min(self.ended_by, key=lambda one: (one.ended_at, self._instances.index(one)))
                    self.ended = f"component {first.name!r} ended the simulation at t = {first.ended_at:.9g} s"
                    logger.warning("%s", self.ended)
            finally:
                for observer in observers:
                    observer.end(self)
                for group in self.groups:
                    group.conclude()
                self.control.conclude()
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
        position[at.TICK], position[at.PART], position[at.CALL] = self.tick, 0, at.STEP
        for name, values in self.plan.events.get(self.tick, ()):
            self.member(name).set(values)
        if self.ended_by:
            position[COMPONENT] = -1
            return False
        self.store.look_up(self.time)
        parts = self.control.advance()
        position[COMPONENT] = -1
        if not parts:
            return False
        if parts > 1:
            self.divided += 1
            position[at.DIVIDED] = self.divided
            logger.info("step %d (t = %g s) was done in %d parts", self.tick, self.time, parts)
        self.tick += 1
        return True

    def substep(self, begin: int, size: int, *, full: bool) -> Member | None:
        """Step every component once.

        Parameters
        ----------
        begin, size : int
            Where in the present communication step it begins, and its size, in parts of which that has ``UNITS``.
        full : bool
            Read what is recorded too.

        Returns
        -------
        Member or None
            Who refused the step; those that had stepped before it stand at the end of it.
        """
        tick, position = self.tick, self.position
        time = ctypes.c_double(self.scenario.start + (tick * UNITS + begin) * self._unit)
        length = ctypes.c_double(size * self._unit)
        last = begin + size == UNITS
        if self._jacobi:
            self.store.arrive()
        for stage in self._stages:
            if stage.every > 1 and not (last and (tick + 1) % stage.every == 0):
                continue
            stage.receive(tick + 1)
            if self.ended_by:  # by an input that has arrived
                return self.members[position[COMPONENT]]
            if not stage.advance(time, length, full=full):
                member = self.members[position[COMPONENT]]
                member.refused += not self.ended_by
                return member
        return None

    def is_recorded(self, tick: int) -> bool:
        """Tell whether what is recorded is read at a communication point."""
        return tick % self._every == 0 or tick == self._ticks

    def save(self) -> None:
        """Keep the present state of everything for ``restore``."""
        for member in self.members:
            member.call().save_state()
        self.store.save()
        self._held = [channel.held for channel in self.channels]
        self._peaks = [group.peaks.copy() for group in self.groups]

    def restore(self) -> None:
        """Go back to what was kept, as often as needed."""
        for member in self.members:
            member.call().restore_state()
        for channel, value in zip(self.channels, self._held, strict=True):
            channel.held = value
        for group, peaks in zip(self.groups, self._peaks, strict=True):
            group.peaks[:] = peaks
        self.store.restore()

    def _start(self) -> None:
        """Instantiate all FMUs and initialize each after those that feed it."""
        start, position = self.scenario.start, self.position
        position[at.CALL] = at.INSTANTIATE
        for number, component in enumerate(self.plan.components):
            position[COMPONENT] = number
            instance = start_instance(component.fmu, component.name, start)
            instance.on_end = self.ended_by.append
            self._instances.append(instance)
            kind = Member if component.every == 1 else SlowMember
            self.members.append(kind(component, instance, self.store, number, position))
        self._make_stages()
        self.store.look_up(start)
        position[at.CALL] = at.INITIALIZE
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
                if isinstance(group, JoinedGroup) and group.diverged:
                    self._split(group)
            for each in names:
                member = self.member(each)
                member.receive(0)
                member.instance.exit_initialization()
                self._check_start(member)
                member.read(full=True)
                self.store.arrive()
            if isinstance(group, JoinedGroup) and group in self.groups:
                group.begin()
            done.update(names)
        self._check_mounts()
        position[COMPONENT] = -1

    def _make_stages(self) -> None:
        """Put the components of each group together; they are neighbours in the stepping order."""
        homes = {name: group for group in self.scenario.groups for name in group.components}
        joined = {name: names for names in self.plan.joined for name in names}
        for member in self.members:
            group, names = homes.get(member.name), joined.get(member.name)
            if group is None and names is None:
                self._stages.append(member)
            elif not self.groups or member.name not in self.groups[-1].names:
                members = self.members[member.number : member.number + len(names or homes[member.name].components)]
                one = (
                    IteratedGroup(group, members, self.store, self.ended_by, strict=self._strict)
                    if group is not None
                    else JoinedGroup(members, self.store, self.ended_by)
                )
                self.groups.append(one)
                self._stages.append(one)
        if self._pool is not None:
            self._stages = side_by_side(self._stages, self.plan, self.position, self._pool)

    def _split(self, group: JoinedGroup) -> None:
        """Integrate components one by one after all."""
        warn_of_apart(self.scenario, group.names, group.diverged.rstrip("."))
        self.groups.remove(group)
        i = self._stages.index(group)
        self._stages[i : i + 1] = group.split()

    def _enter_initialization(self, name: str) -> None:
        """Set the start values of a component, and its inputs at the start.

        Some FMUs overwrite them when they enter their initialization; set again there, they hold.
        """
        member, start = self.member(name), self.plan.component(name).start
        instance = member.call()
        instance.set_start(start)
        instance.enter_initialization(self.scenario.stop)
        variables = self.plan.component(name).fmu.variables
        again = [v for v in instance.differing(start) if variables[v].causality != "structuralParameter"]
        instance.set_start({v: start[v] for v in again})
        for receiver, values in self.plan.events.get(0, ()):
            if receiver == name:
                member.set(values)

    def _check_start(self, member: Member) -> None:
        """Say which values that the scenario states an FMU does not keep over its initialization."""
        stated = dict(self.plan.component(member.name).start)
        for receiver, values in self.plan.events.get(0, ()):
            stated |= values if receiver == member.name else {}
        if differing := member.instance.differing(stated):
            few = first_few([f"{v} = {brief(value)} in place of {brief(stated[v])}" for v, value in differing.items()])
            text = "component %r does not keep what the scenario states: %s. It computes with its own; check it with %s"
            logger.warning(text, member.name, few, "'gossamer verify'")

    def _check_mounts(self) -> None:
        """Warn of bodies that are too light for the membrane whose extrapolated force they take."""
        for c in self.plan.connections:
            both = {c.sender: (*HELD, *MOVING), c.receiver: HUB}
            there = {name: self.plan.component(name).fmu.variables for name in both}
            if c.input != "force[1]" or any(each not in there[name] for name in both for each in both[name]):
                continue
            ports = [self.member(name).call().port(names) for name, names in both.items()]
            for name, port in zip(both, ports, strict=True):
                self.member(name).call().read(port)
            membrane, hub = (port.values for port in ports)
            body = with_edge(hub[0], hub[1:4], matrix(hub[4:10]), membrane[:10])
            if hub[10] and (light := too_light(*body, membrane)):
                text = "component %r: %s. Or put it and %r in a group with extrapolation = 0, as scenario light_hub does."
                logger.warning(text, c.sender, light, c.receiver)

    def read(self, *names: str) -> None:
        """Read all variables at the present communication point, of the components named or of all."""
        for member in self._called_each(names):
            member.read(full=True)

    def _called_each(self, names: Collection[str] = ()) -> Iterator[Member]:
        """Give the members, those named or all, that are about to be called one after another, and note that."""
        for member in self.members:
            if not names or member.name in names:
                self.position[COMPONENT] = member.number
                yield member
        self.position[COMPONENT] = -1

    @property
    def channels(self) -> list[Channel]:
        """Channels of all components."""
        return [channel for member in self.members for channel in member.all_channels]

    def serialize(self, *names: str) -> list[bytes]:
        """Return the states of FMUs at the present communication point, of the components named or of all."""
        return [member.instance.serialize() for member in self._called_each(names)]

    def deserialize(self, states: Sequence[bytes]) -> None:
        """Bring all FMUs to the states that ``serialize`` returned."""
        for member, state in zip(self._called_each(), states, strict=True):
            member.instance.deserialize(state)

    def member(self, name: str) -> Member:
        """Return a member by name."""
        return next(member for member in self.members if member.name == name)
