"""Running FMUs of FMI 3.0, and of either version for model exchange.

FMI 3.0: arrays are exchanged as a whole. An FMU that has event mode is run with it, and may return early: its events are
handled, then the rest of the step is done.

Model exchange: CVode of SUNDIALS integrates from one communication point to the next. Every input that changes is an event.
CVode starts anew after every event and where a step is taken back, so a step that is repeated twice gives the same bits.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING

from fmpy.fmi1 import FMICallException

from ..errors import FmuError
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
MAX_EVENTS = 10_000  # within one communication step
_SMALLER = " Use a smaller 'step', or correct its parameters."


class ModelExchange(Instance):
    """What both versions of FMI have in common; see ``Instance``."""

    _LEAVE = "enterContinuousTimeMode"

    def __init__(self, fmu: FmuFile, name: str, time: float = 0.0) -> None:
        self._integrator_class = _load_integrator(fmu)
        super().__init__(fmu, name, time)
        self._anew = True  # whether the integration starts anew
        self._saved = [(math.inf, time), (math.inf, time)]  # next event and time [s] of the saved states
        asked = getattr(self.fmu.description.defaultExperiment, "tolerance", None)
        self.tolerance = float(asked) if asked else TOLERANCE

    @cached_property
    def _integrator(self) -> Integrator:
        return self._integrator_class(self._slave, self.fmu.description, self.time, self.tolerance)

    def set_start(self, values: Mapping[str, Value]) -> None:
        """Set parameters and inputs of any type by name."""
        if values:
            self._jump(lambda: super(ModelExchange, self).set_start(values))

    def exit_initialization(self) -> None:
        """Leave the initialization mode and handle the first events; outputs can be read from here on."""
        super().exit_initialization()
        self._leave_events()

    def write(self, port: Port) -> None:
        """Set inputs, which is an event if one of them has changed."""
        self._write_changed(port)

    def enter_event_mode(self) -> None:
        """Enter the mode in which inputs may jump, after which the integration starts anew."""
        self._anew = True
        super().enter_event_mode()

    def save_state(self, slot: int = 0) -> None:
        """Save the present state in a slot, 0 or 1, in place of the one saved there before."""
        super().save_state(slot)
        self._saved[slot] = self._next_event, self._reached

    def restore_state(self, slot: int = 0) -> None:
        """Restore the state saved in a slot, with the inputs of then."""
        super().restore_state(slot)
        self._next_event, self._reached = self._saved[slot]
        self._anew = True

    def step(self, time: ctypes.c_double, size: ctypes.c_double) -> bool:
        """Integrate from ``time`` [s] over ``size`` [s], with the events on the way; see ``Instance.step``."""
        self._time = time
        now, end, events = time.value, time.value + size.value, 0
        while True:
            if events == MAX_EVENTS:
                what = f"has had {events} events between t = {time.value:.9g} and {now:.9g} s, and more to come"
                self._fail(what, _SMALLER, now)
            try:
                now, root = self._integrator.advance(now, min(end, self._next_event), anew=self._anew)
                # an earlier state may be restored, if the FMU can do that at all
                step_event, over = self._slave.completedIntegratorStep(not self.fmu.can_repeat)
            except FMICallException as error:
                if error.status == DISCARD:
                    return False
                self._check(error.status, "failed")
                raise
            except ArithmeticError as error:
                self._fail(f"cannot be integrated from t = {now:.9g} s: {error}", _SMALLER, now)
            self._reached, self._anew = now, False
            if over:
                return self._end(now, end)
            if root or step_event or now >= self._next_event:
                events += 1
                self.enter_event_mode()
                if self._leave_events():
                    return self._is_at(now, end)
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
