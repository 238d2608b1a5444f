"""A running FMU of FMI 3.0.

Arrays are exchanged as a whole. An FMU that has event mode is run with it, and may return early: its events are handled,
then the rest of the step is done.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

from ..errors import SimulationError
from .file import FmuFile
from .instance import Instance
from .ports import TypedPort
from .slave import DISCARD, WARNING
from .types import Value, parse

_EVENTS, _OVER, _EARLY = range(3)  # the flags that fmi3DoStep sets, in this order


class Instance3(Instance):
    """One instance of an FMU of FMI 3.0; see ``Instance``."""

    version = 3
    _FUNCTIONS: ClassVar = {
        "get": "fmi3GetFloat64",
        "set": "fmi3SetFloat64",
        "do_step": "fmi3DoStep",
        "get_state": "fmi3GetFMUState",
        "set_state": "fmi3SetFMUState",
        "free_state": "fmi3FreeFMUState",
        "terminate": "fmi3Terminate",
    }

    def __init__(self, fmu: FmuFile, name: str, time: float = 0.0) -> None:
        super().__init__(fmu, name, time)
        self._arrays: dict[str, dict[str, Value]] = {}
        self._written: dict[TypedPort, list[Value]] = {}
        self._flags = (ctypes.c_bool * 4)()
        self._any = ctypes.c_uint32.from_buffer(self._flags)
        self._last = ctypes.c_double(time)
        self._reached = time  # [s] after the last step
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
            self.write_typed(
                self.typed_port(kind, names), list(whole.values()), f"refused {array!r} = {[*whole.values()]}"
            )
        if in_events and self.leave_event_mode():
            self._end(self._reached, self._reached)

    def enter_initialization(self, stop: float) -> None:
        """Set the times of the run and enter the mode in which start values are set."""
        self._call("could not enter initialization", "enterInitializationMode", None, self.time, stop)

    def exit_initialization(self) -> None:
        """Leave the initialization mode; outputs can be read from here on."""
        super().exit_initialization()
        if self.event_mode and self.leave_event_mode():
            self._end(self._reached, self._reached)

    def write_inputs(self, port: TypedPort, values: Sequence[Value]) -> None:
        """Set inputs; with event mode that is an event, if one of them has changed."""
        if not (self.event_mode and self._initialized):
            self.write_typed(port, values)
        elif self._written.get(port) != values:
            self._written[port] = list(values)
            self.enter_event_mode()
            self.write_typed(port, values)
            if self.leave_event_mode():
                self._end(self._reached, self._reached)

    def restore_state(self, slot: int = 0) -> None:
        """Restore the state saved in a slot, with the inputs of then."""
        super().restore_state(slot)
        self._written.clear()

    def step(self, time: ctypes.c_double, size: ctypes.c_double) -> bool:
        """Advance by ``size`` [s] from ``time`` [s]; see ``Instance.step``."""
        self._time = time
        status = self._do_step(self._component, time, size, 0, *self._results)
        if status > WARNING:
            if status != DISCARD:
                self._check(status, "failed")
            return False
        self._reached = time.value + size.value
        return not self._any.value or self._go_on(self._reached)

    def _go_on(self, end: float) -> bool:
        """After a step with events, an early return or the end of the simulation: handle them, and do the rest."""
        before = -math.inf
        while True:
            events, over, early, _ = self._flags
            last = self._last.value if early or over else end
            if events and self.event_mode:
                self.enter_event_mode()
                over |= self.leave_event_mode()
            if over:
                return self._end(last, end)
            if not early or self._is_at(last, end):
                return True
            if last <= before:
                msg = (
                    f"component {self.name!r} returned early from its step to t = {end:.9g} s again and again, at t = "
                    f"{last:.9g} s.{self.log.tail()} Check it with 'gossamer verify'."
                )
                raise SimulationError(msg, component=self.name, time=self.time)
            before = last
            rest = ctypes.c_double(last), ctypes.c_double(end - last)
            status = self._do_step(self._component, *rest, 0, *self._results)
            if status > WARNING:
                if status != DISCARD:
                    self._check(status, "failed")
                return False
