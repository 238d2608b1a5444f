"""Running FMUs of FMI 3.0, and of either version for model exchange.

FMI 3.0: arrays are exchanged as a whole. An FMU that has event mode is run with it, and may return early: its events are
handled, then the rest of the step is done.

Model exchange: CVode of SUNDIALS integrates from one communication point to the next. Every input that changes is an event,
unless the FMU is joined with what feeds it. CVode starts anew after every event and where a step is taken back, so a step
that is repeated twice gives the same bits.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from fmpy.fmi1 import FMICallException

from ..errors import FmuError, SimulationError
from .file import FmuFile
from .instance import Instance
from .slave import DISCARD, WARNING
from .types import Port, Value, parse

if TYPE_CHECKING:
    from .integrator import Integrator


_EVENTS, _OVER, _EARLY = range(3)  # the flags that fmi3DoStep sets, in this order


class Instance3(Instance):
    """One instance of an FMU of FMI 3.0; see ``Instance``."""

    version = 3
    _STATE = "FMUState"
    _next_tick = math.inf  # of its clocks [s]

    def __init__(self, fmu: FmuFile, name: str, time: float = 0.0) -> None:
        super().__init__(fmu, name, time)
        self._arrays: dict[str, dict[str, Value]] = {}
        self._flags = (ctypes.c_bool * 4)()
        self._any = ctypes.c_uint32.from_buffer(self._flags)
        self._last = ctypes.c_double(time)
        flags = (ctypes.byref(self._flags, place) for place in (_EVENTS, _OVER, _EARLY))
        self._results = (*flags, ctypes.byref(self._last))

    def set_start(self, values: Mapping[str, Value]) -> None:
        """Set parameters and inputs of any type by name; structural parameters only before initialization."""
        variables = self.fmu.variables
        structural = {v: value for v, value in values.items() if variables[v].causality == "structuralParameter"}
        if structural and not self._initialized:
            self._call("refused to be configured", "enterConfigurationMode")
            super().set_start(structural)
            self._call("refused its structural parameters", "exitConfigurationMode")
        in_events = self.event_mode and self._initialized
        if in_events:
            self.enter_event_mode()
        super().set_start({v: value for v, value in values.items() if v not in structural and not self.fmu.array_of(v)})
        changed = {array for v in values if (array := self.fmu.array_of(v)) is not None}
        for array in sorted(changed):
            names = self.fmu.arrays[array]
            kind = variables[names[0]].type
            whole = self._arrays.setdefault(array, {v: parse(kind, variables[v].start) for v in names})
            whole |= {v: values[v] for v in names if v in values}
            self._write(self.port(names, kind).put([*whole.values()]), f"refused {array!r} = {[*whole.values()]}")
        if in_events:
            self._leave_events()

    def enter_initialization(self, stop: float) -> None:
        """Set the times of the run and enter the mode in which start values are set."""
        self._call("could not enter initialization", "enterInitializationMode", None, self.time, stop)

    def exit_initialization(self) -> None:
        """Leave the initialization mode; outputs can be read from here on."""
        super().exit_initialization()
        if self.event_mode:
            self._leave_events()

    def write_events(self, port: Port) -> None:
        """Set inputs that may jump; with event mode that is an event, if one of them has changed."""
        if self.event_mode and self._initialized:
            self._write_changed(port)
        else:
            self.write(port)

    def step(self, time: ctypes.c_double, size: ctypes.c_double) -> bool:
        """Advance by ``size`` [s] from ``time`` [s], with the events on the way; see ``Instance.step``."""
        self._time = time
        end, before = time.value + size.value, -math.inf
        while True:
            aim = end
            if self._next_tick < end and not self._is_at(self._next_tick, end):
                aim = self._next_tick
                size = ctypes.c_double(aim - time.value)
            status = self._do_step(self._component, time, size, 0, *self._results)
            if status > WARNING:
                if status != DISCARD:
                    self._check(status, "failed")
                return False
            self._worry(status)
            self._reached = aim
            if not self._any.value and aim < self._next_tick:
                return True
            events, over, early, _ = self._flags
            last = self._reached = self._last.value if early or over else aim
            if (events or self._is_at(last, self._next_tick)) and self.event_mode:
                self.enter_event_mode()
                over |= self.leave_event_mode()
            if over:
                return self._end(last, end)
            if self._is_at(last, end):
                return True
            if last <= before:
                self._fail(f"returned early from its step to t = {end:.9g} s again and again, at t = {last:.9g} s")
            before = last
            time, size = ctypes.c_double(last), ctypes.c_double(end - last)


TOLERANCE = 1e-6  # relative, of the integration, where the model description names none
_TIGHTER = 0.1  # of several as one system, none of which knows what the others add to its error
MAX_EVENTS = 10_000  # within one communication step
_SMALLER = " Use a smaller 'step', or correct its parameters."


class ModelExchange(Instance):
    """What both versions of FMI have in common; see ``Instance``.

    Attributes
    ----------
    joined : bool
        It is integrated together with what feeds it, so that what it receives may change at any time without an event.
    anew : bool
        The integration starts anew.
    jumps : int
        How often inputs were set in an event of its own.
    """

    _LEAVE = "enterContinuousTimeMode"

    def __init__(self, fmu: FmuFile, name: str, time: float = 0.0) -> None:
        _load_integrator(fmu)
        super().__init__(fmu, name, time)
        self.joined, self.anew, self.jumps = False, True, 0
        self._in_events = True
        self._saved = [(math.inf, time), (math.inf, time)]  # next event and time [s] of the saved states
        asked = getattr(self.fmu.description.defaultExperiment, "tolerance", None)
        self.tolerance = float(asked) if asked else TOLERANCE

    @cached_property
    def _alone(self) -> Integration:
        return Integration([self])

    def set_start(self, values: Mapping[str, Value]) -> None:
        """Set parameters and inputs of any type by name."""
        if values:
            self.jumps += 1
            self._jump(lambda: super(ModelExchange, self).set_start(values))

    def exit_initialization(self) -> None:
        """Leave the initialization mode and handle the first events; outputs can be read from here on."""
        super().exit_initialization()
        self._leave_events()

    def write(self, port: Port) -> None:
        """Set inputs that may change continuously, which is an event if one of them has changed and it is not joined."""
        if self.joined:
            self._write(port)
        else:
            self._write_changed(port)

    def write_events(self, port: Port) -> None:
        """Set inputs that change in events only, which is one if one of them has changed; joined, in events only."""
        if not self.joined:
            self._write_changed(port)
        elif self._in_events:
            self._write(port)

    def enter_event_mode(self) -> None:
        """Enter the mode in which inputs may jump, after which the integration starts anew."""
        self.anew = self._in_events = True
        super().enter_event_mode()

    def handle_events(self) -> bool:
        """Handle the present events; True, and it is noted, if it ends the simulation."""
        self.enter_event_mode()
        return self._leave_events()

    def note_end(self) -> None:
        """Note that it has ended the simulation in the present event."""
        self._end(self._reached, self._reached)

    def resume(self) -> None:
        """Return from the event mode to the mode before."""
        super().resume()
        self._in_events = False

    def save_state(self, slot: int = 0) -> None:
        """Save the present state in a slot, 0 or 1, in place of the one saved there before."""
        super().save_state(slot)
        self._saved[slot] = self._next_event, self._reached

    def restore_state(self, slot: int = 0) -> None:
        """Restore the state saved in a slot, with the inputs of then."""
        super().restore_state(slot)
        self._next_event, self._reached = self._saved[slot]
        self.anew = True

    def step(self, time: ctypes.c_double, size: ctypes.c_double) -> bool:
        """Integrate from ``time`` [s] over ``size`` [s], with the events on the way; see ``Instance.step``."""
        return self._alone.step(time, size)


class Integration:
    """Integrate instances for model exchange as one system, with the events of any of them.

    Parameters
    ----------
    parts : sequence of ModelExchange
        They.
    exchange : callable
        Brings their inputs to what they send each other.
    handle_events : callable, optional
        Handles the present events of all; True, and it is noted, if one ends the simulation. Needed for more than one.
    note : callable, optional
        Notes that an instance is about to be called, by its place among them.

    Attributes
    ----------
    part : ModelExchange
        The one that was called last.
    """

    def __init__(
        self,
        parts: Sequence[ModelExchange],
        exchange: Callable[[], object] = lambda: None,
        handle_events: Callable[[], bool] | None = None,
        note: Callable[[int], object] = lambda _: None,
    ) -> None:
        self._parts, self.part, self.exchange, self._note = parts, parts[0], exchange, note
        self._handle_events = handle_events or self.part.handle_events
        self._keep = not all(part.fmu.can_repeat for part in parts)  # else an earlier state may be restored

    @cached_property
    def _integrator(self) -> Integrator:
        descriptions, tolerance = [part.fmu.description for part in self._parts], min(part.tolerance for part in self._parts)
        if len(self._parts) > 1:
            tolerance *= _TIGHTER
        return _load_integrator(self.part.fmu)(self, descriptions, self.part.time, tolerance)

    def enter(self, part: int) -> Any:  # noqa: ANN401
        """Note that an instance is about to be called, and return FMPy's of it."""
        self._note(part)
        self.part = self._parts[part]
        return self.part._slave

    def step(self, time: ctypes.c_double, size: ctypes.c_double) -> bool:
        """Integrate from ``time`` [s] over ``size`` [s], with the events on the way; see ``Instance.step``."""
        parts, events, busy = self._parts, 0, self._parts
        now, end = time.value, time.value + size.value
        for part in parts:
            part._time = time
        while True:
            if events == MAX_EVENTS:
                others = f"(or {', '.join(repr(part.name) for part in busy[1:])}) " * (len(busy) > 1)
                what = f"{others}has had {events} events between t = {time.value:.9g} and {now:.9g} s, and more to come"
                busy[0]._fail(what, _SMALLER, now)
            due = min(part._next_event for part in parts)
            ended, asked = [], list[ModelExchange]()
            try:
                now, root = self._integrator.advance(now, min(end, due), anew=any(part.anew for part in parts))
                self.exchange()
                for i, part in enumerate(parts):
                    event, over = self.enter(i).completedIntegratorStep(self._keep)
                    ended += [part] if over else []
                    asked += [part] if event else []
            except FMICallException as error:
                if error.status == DISCARD:
                    return False
                self.part._check(error.status, "failed")
                raise
            except SimulationError as error:
                if error.discarded:
                    return False
                raise
            except ArithmeticError as error:
                self.part._fail(f"cannot be integrated from t = {now:.9g} s: {error}", _SMALLER, now)
            for part in parts:
                part._reached, part.anew = now, False
            if ended:
                at_end = [part._end(now, end) for part in ended]
                return all(at_end)
            if root or asked or now >= due:
                events += 1
                busy = [part for part in parts if part in asked or now >= part._next_event] or parts
                if self._handle_events():
                    return self.part._is_at(now, end)
            if now >= end:
                return True


def _load_integrator(fmu: FmuFile) -> type[Integrator]:
    """Load SUNDIALS, which only FMUs for model exchange need."""
    try:
        from .integrator import Integrator
    except (ImportError, OSError) as error:
        advice = "Export it for co-simulation."
        msg = f"{fmu.path} is for model exchange, and FMPy has no SUNDIALS for this machine: {error}. {advice}"
        raise FmuError(msg) from error
    return Integrator


class ModelExchange2(ModelExchange):
    """One instance of an FMU of FMI 2.0 for model exchange."""

    _UPDATE = "newDiscreteStates"


class ModelExchange3(ModelExchange, Instance3):
    """One instance of an FMU of FMI 3.0 for model exchange."""
