"""FMUs for model exchange that feed each other, integrated as one system.

One CVode has the states of all of them. Wherever it evaluates derivatives or event indicators, they exchange what they send
each other first: in stepping order, and again until what is fed back agrees, so a loop through direct feedthrough is solved
there too. What comes from elsewhere is that of the communication step. An event of one of them is one of all: they update,
exchange, and update again until nothing changes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import cast

from ..errors import SimulationError
from ..fmi.instance import MAX_UPDATES, Instance
from ..fmi.instances import Integration, ModelExchange
from ..scenario import schema
from .member import Member
from .signals import Store
from .stages import IteratedGroup, Vector

TOLERANCE = 1e-10  # relative, to which a loop is solved: well below that of the integration
SWEEPS = 50


class JoinedGroup(IteratedGroup):
    """The members of a joined group; see ``IteratedGroup``.

    Parameters
    ----------
    members : sequence of Member
        Its components, in stepping order, which are for model exchange.
    store : Store
        The values of the run.
    over : list of Instance
        FMUs that have ended the simulation.

    Attributes
    ----------
    diverged : str
        What does not converge; empty if everything does.
    """

    def __init__(self, members: Sequence[Member], store: Store, over: list[Instance]) -> None:
        names = [member.name for member in members]
        wanted = schema.Group(components=names, tolerance=TOLERANCE, sweeps=SWEEPS)
        super().__init__(wanted, members, store, over, strict=False)
        self.diverged = ""
        self._declared[:] = False  # a nominal value is the first peak only: the tolerance is relative
        self._instances = [cast("ModelExchange", member.instance) for member in members]
        self._integration = Integration(self._instances, self._exchange, self._handle_events, lambda i: members[i].call())
        connections = [c for member in members for c in store.plan.component(member.name).connections]
        inside = [c for c in connections if c.sender in names]
        outside = [c for c in connections if c.sender not in names]
        fed_back = {c.sender for c in inside if names.index(c.sender) >= names.index(c.receiver)}
        self._fed_back = [member for member in members if member.name in fed_back]
        self._inside = sorted({store.places[c.sender, c.output] for c in inside})
        self._outside = [store.places[c.sender, c.output] for c in outside]
        self._disturbed = any(c.noise or c.dropout for c in outside)
        self._before: object = None
        for instance in self._instances:
            instance.joined = True

    def split(self) -> Sequence[Member]:
        """Return the members, which are integrated one by one from here on, and from their start values."""
        self._store.values[self._places] = self._guesses[0]
        for instance in self._instances:
            instance.joined = False
        return self._members

    def begin(self) -> None:
        """Exchange values once all are initialized, and read everything."""
        self._handle_events()
        for member in self._members:
            member.read(full=True)

    def receive(self, tick: int) -> None:
        """Fetch what comes from outside for a communication point; if any of it has changed, that is an event."""
        self._tick = tick
        store = self._store
        exact = [store.exact_arrived[place] for place in self._outside] if store.exact else []
        calls = [(instance.restored, instance.jumps) for instance in self._instances]
        now = store.arrived[self._outside].tobytes(), exact, calls, self._disturbed and tick
        if now != self._before:
            self._before = now
            self._handle_events()

    def advance(self, time: ctypes.c_double, size: ctypes.c_double, *, full: bool) -> bool:
        """Integrate over a step and read the outputs (all of them if ``full``); False if an FMU discarded the step."""
        if not self._integration.step(time, size):
            return False
        for member in self._members if full else ():
            member.read(full=True)
        return True

    def _exchange(self) -> None:
        """Bring the inputs to what the members send each other, at their present time and states."""
        for member in self._fed_back:  # with the inputs of before: the first guess
            member.read(full=False)
        self.may_refuse = False  # a smaller step solves no loop
        time = self._instances[0]._reached
        self._iterate(self._sweep, time)
        if self.diverged:
            msg = f"{self.diverged} Break the loop with a delay, or put the components in a group."
            raise SimulationError(msg, component=self.names[0], time=time)

    def _handle_events(self) -> bool:
        """Handle the present events of all; True, and it is noted, if one ends the simulation."""
        for member in self._members:
            member.call().enter_event_mode()
        for _ in range(MAX_UPDATES):
            self._exchange()
            before = self._sent()
            ended = []
            for member, instance in zip(self._members, self._instances, strict=True):
                member.call()
                if instance.update_events():
                    ended.append(instance)
            for instance in ended:
                instance.note_end()
            if ended:
                return True
            for member in self._members:
                member.read(full=False)
            if self._sent() == before:
                break
        else:
            text = f"{', '.join(self.names)} still send each other new values after {MAX_UPDATES} updates"
            time = self._instances[0]._reached
            msg = f"{text} at t = {time:.9g} s. Correct their parameters."
            raise SimulationError(msg, component=self.names[0], time=time)
        for member in self._members:
            member.call().resume()
        return False

    def _sent(self) -> object:
        """Return what the members send each other."""
        store = self._store
        return store.values[self._inside].tobytes(), [store.exact[place] for place in self._inside] if store.exact else []

    def _give_up(self, time: float, residuals: Vector) -> None:
        """Note that a loop does not converge; it is said where something else can be done, or is an error."""
        source = ".".join(self._worst(residuals)[0])
        self.diverged = (
            f"the algebraic loop through {source} does not converge at t = {time:.9g} s, after {self.sweeps} sweeps."
        )
