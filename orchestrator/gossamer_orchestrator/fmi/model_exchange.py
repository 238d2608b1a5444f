"""A running FMU for model exchange: CVode of SUNDIALS integrates it from one communication point to the next.

Every input that changes is an event. CVode starts anew after every event and where a step is taken back, so a step that is
repeated twice gives the same bits.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from fmpy.fmi1 import FMICallException

from ..errors import FmuError, SimulationError
from .file import FmuFile
from .instance import Instance
from .instance3 import Instance3
from .ports import Port, TypedPort
from .slave import DISCARD
from .types import Value

if TYPE_CHECKING:
    from .integrator import Integrator

TOLERANCE = 1e-6  # relative, of the integration, where the model description names none
MAX_EVENTS = 10_000  # within one communication step


class ModelExchange(Instance):
    """What both versions of FMI have in common; see ``Instance``."""

    _LEAVE = "enterContinuousTimeMode"

    def __init__(self, fmu: FmuFile, name: str, time: float = 0.0) -> None:
        self._integrator_class = _load_integrator(fmu)
        super().__init__(fmu, name, time)
        self._inputs: dict[Port | TypedPort, Any] = {}  # as they were set last
        self._now = time  # [s] reached so far
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
        """Set the variables of a port."""
        if not np.array_equal(self._inputs.get(port, ()), port.values, equal_nan=True):
            self._inputs[port] = port.values.copy()
            self._jump(lambda: super(ModelExchange, self).write(port))

    def write_inputs(self, port: TypedPort, values: Sequence[Value]) -> None:
        """Set inputs of any type."""
        if self._inputs.get(port) != values:
            self._inputs[port] = list(values)
            self._jump(lambda: self.write_typed(port, values))

    def _jump(self, write: Callable[[], None]) -> None:
        """Set inputs, which is an event once the FMU is initialized."""
        if self._initialized:
            self.enter_event_mode()
        write()
        if self._initialized:
            self._leave_events()

    def save_state(self, slot: int = 0) -> None:
        """Save the present state in a slot, 0 or 1, in place of the one saved there before."""
        super().save_state(slot)
        self._saved[slot] = self._next_event, self._now

    def restore_state(self, slot: int = 0) -> None:
        """Restore the state saved in a slot, with the inputs of then."""
        super().restore_state(slot)
        self._next_event, self._now = self._saved[slot]
        self._inputs.clear()
        self._anew = True

    def step(self, time: ctypes.c_double, size: ctypes.c_double) -> bool:
        """Integrate from ``time`` [s] over ``size`` [s], with the events on the way; see ``Instance.step``."""
        self._time = time
        now, end, events = time.value, time.value + size.value, 0
        while events < MAX_EVENTS:
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
                msg = (
                    f"component {self.name!r} cannot be integrated from t = {now:.9g} s: {error}.{self.log.tail()} Use a "
                    "smaller 'step', or correct its parameters."
                )
                raise SimulationError(msg, component=self.name, time=now) from error
            self._now, self._anew = now, False
            if over:
                return self._end(now, end)
            if root or step_event or now >= self._next_event:
                events += 1
                self.enter_event_mode()
                if self._leave_events():
                    return self._is_at(now, end)
            if now >= end:
                return True
        msg = (
            f"component {self.name!r} has had {MAX_EVENTS} events between t = {time.value:.9g} and {now:.9g} s, and more to "
            f"come.{self.log.tail()} Use a smaller 'step', or correct its parameters."
        )
        raise SimulationError(msg, component=self.name, time=now)

    def _leave_events(self) -> bool:
        """Handle the present events; True, and it is noted, if the FMU ends the simulation."""
        self._anew = True
        over = self.leave_event_mode()
        if over:
            self._end(self._now, self._now)
        return over


def _load_integrator(fmu: FmuFile) -> type[Integrator]:
    """Load SUNDIALS, which only FMUs for model exchange need."""
    try:
        from .integrator import Integrator
    except (ImportError, OSError) as error:
        msg = (
            f"{fmu.path} is for model exchange, and FMPy has no SUNDIALS for this machine: {error}. Export it for "
            "co-simulation."
        )
        raise FmuError(msg) from error
    return Integrator


class ModelExchange2(ModelExchange):
    """One instance of an FMU of FMI 2.0 for model exchange."""

    _FUNCTIONS: ClassVar = {name: symbol for name, symbol in Instance._FUNCTIONS.items() if name != "do_step"}
    _UPDATE = "newDiscreteStates"


class ModelExchange3(ModelExchange, Instance3):
    """One instance of an FMU of FMI 3.0 for model exchange."""

    _FUNCTIONS: ClassVar = {name: symbol for name, symbol in Instance3._FUNCTIONS.items() if name != "do_step"}
