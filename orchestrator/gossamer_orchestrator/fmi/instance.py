"""A running FMU, through FMPy's low-level interface.

A step costs what the FMU costs. The arguments of a call are converted to C once per group of variables (``Port``), and the C
functions are called directly, since fmi2Discard is a normal result here, not an exception. ctypes converts no argument of a
function that declares no types, which halves the cost of a call; so every argument of those must be a ctypes object.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from ..errors import FmuError, SimulationError
from ..words import brief
from .file import FmuFile
from .slave import DISCARD, ERROR, FATAL, WARNING, Log, is_python, start_slave
from .types import Port, Value

MAX_UPDATES = 1000
_LAST_TIME, _TERMINATED = 2, 3  # of fmi2StatusKind
_ROUNDING = 1e-6  # of a value that an FMU keeps in another unit, or in single precision
_LABELS = ("ok", "warning", "discard", "error", "fatal", "pending")


def _same(value: Value, stated: Value) -> bool:
    if isinstance(value, float) and isinstance(stated, float):
        return math.isclose(value, stated, rel_tol=_ROUNDING) or repr(value) == repr(stated)
    return repr(value) == repr(stated)


class Instance:
    """One instance of an FMU of FMI 2.0.

    Parameters
    ----------
    fmu : FmuFile
        The file.
    name : str
        Component name, for messages.
    time : float
        Start of the run [s].

    Attributes
    ----------
    ended_at : float or None
        Time [s] at which the FMU itself ended the simulation.
    on_end : callable
        Called with this instance when that happens.
    restored : int
        How often its state was restored.

    Raises
    ------
    FmuError
        The FMU has no binary for this machine or cannot be instantiated.
    """

    version = 2
    _UPDATE, _LEAVE = "updateDiscreteStates", "enterStepMode"  # FMPy's methods that handle events, and leave their mode
    _STATE = "FMUstate"  # in the names of functions

    def __init__(self, fmu: FmuFile, name: str, time: float = 0.0) -> None:
        self.fmu = fmu
        self.name = name
        self.event_mode = self.version == 3 and bool(getattr(fmu.interface, "hasEventMode", False))
        self._time = ctypes.c_double(time)
        self.log = Log(lambda: self.time)
        self._states = (ctypes.c_void_p(), ctypes.c_void_p())
        self.ended_at: float | None = None
        self.on_end: Callable[[Instance], object] = lambda _: None
        self.restored = 0
        self._initialized = self._has_warned = False
        self._next_event = math.inf  # [s]
        self._reached = time  # [s]
        self._written: dict[Port, str] = {}  # inputs whose changes are events, as they were set last
        self._component: Any = None
        try:
            self._slave = start_slave(fmu.description, fmu.folder(), name, self.log, event_mode=self.event_mode)
        except Exception as error:
            # FMPy raises bare exceptions here
            self.log.close()
            msg = f"{name}: {fmu.path} cannot be started: {str(error).rstrip('. ')}.{self.log.tail()}"
            if not isinstance(error, FmuError):
                msg += " Check it with 'gossamer verify'."
            raise FmuError(msg) from error
        self._is_python = is_python(fmu.folder())
        # by subscript the library gives functions of its own, without FMPy's argument types
        dll, begin = self._slave.dll, f"fmi{self.version}"
        self._terminate = dll[f"{begin}Terminate"]
        self._get_state, self._set_state, self._free_state = (dll[begin + do + self._STATE] for do in ("Get", "Set", "Free"))
        self._do_step: Any = None if fmu.model_exchange else dll[f"{begin}DoStep"]
        self._component = ctypes.c_void_p(self._slave.component)
        self._state_arguments = [(self._component, ctypes.byref(state)) for state in self._states]

    @property
    def time(self) -> float:
        """Start of the last step [s]."""
        return self._time.value

    @property
    def _present(self) -> float:
        """Time of an error [s]: what is integrated has come further than the start of the step."""
        return self._reached if self.fmu.model_exchange else self.time

    def port(self, names: Sequence[str], kind: str = "Real", values: NDArray[np.float64] | None = None) -> Port:
        """Prepare the exchange of some variables of one type; ``values`` is a buffer for Reals."""
        values = np.zeros(len(names)) if values is None else values
        return Port(self._slave.dll, self._component, self.version, kind, self.fmu.references(names), values)

    def set_start(self, values: Mapping[str, Value]) -> None:
        """Set parameters and inputs of any type by name."""
        for name, value in values.items():
            self._write(self.port([name], self.fmu.variables[name].type).put([value]), f"refused {name!r} = {brief(value)}")

    def differing(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Return what the FMU has in place of values that were set, by name, as far as they can be read and differ."""
        found: dict[str, Value] = {}
        for name in dict.fromkeys(self.fmu.array_of(v) or v for v in self.fmu.whole(values)):
            names = self.fmu.arrays.get(name, [name])
            port = self.port(names, self.fmu.variables[names[0]].type)
            status = port.get_them(*port.arguments)
            if status == DISCARD:
                continue
            self._check(status, f"did not return {name!r}, which the scenario states")
            present = dict(zip(names, port.get(), strict=True))
            stated = dict(zip(names, port.put([values.get(v, present[v]) for v in names]).get(), strict=True))
            found |= {v: value for v, value in present.items() if not _same(value, stated[v])}
        return found

    def enter_initialization(self, stop: float) -> None:
        """Set the times of the run and enter the mode in which start values are set."""
        self._call("refused the run's times", "setupExperiment", None, self.time, stop)
        self._call("could not enter initialization", "enterInitializationMode")

    def exit_initialization(self) -> None:
        """Leave the initialization mode; outputs can be read from here on."""
        self._call("could not be initialized", "exitInitializationMode")
        self._initialized = True

    def _write(self, port: Port, failure: str = "refused its inputs") -> None:
        status = port.set_them(*port.arguments)
        if status:
            self._check(status, failure)
            self._worry(status, "setting its inputs or parameters")

    def write(self, port: Port) -> None:
        """Set the inputs of a port, at any step."""
        self._write(port)

    def write_events(self, port: Port) -> None:
        """Set inputs that may jump, between two steps or during initialization."""
        self.write(port)

    def read(self, port: Port) -> None:
        """Get the variables of a port."""
        status = port.get_them(*port.arguments)
        if status:
            self._check(status, "did not return its outputs")
            self._worry(status, "reading its outputs")

    def enter_event_mode(self) -> None:
        """Enter the mode in which inputs may jump."""
        self._call("could not enter its event mode", "enterEventMode")

    def leave_event_mode(self) -> bool:
        """Let the FMU handle its events and return to the mode before; True if it ends the simulation."""
        if self.update_events():
            return True
        self.resume()
        return False

    def resume(self) -> None:
        """Return from the event mode to the mode before."""
        self._call("could not leave its event mode", self._LEAVE)

    def update_events(self) -> bool:
        """Let the FMU handle its events, in event mode; True if it ends the simulation."""
        for _ in range(MAX_UPDATES):
            again, over, _, _, defined, event = self._call("could not handle its events", self._UPDATE)
            if over:
                return True
            if not again:
                break
        else:
            self._fail(f"still has events after {MAX_UPDATES} updates at t = {self._present:.9g} s", time=self._present)
        self._next_event = float(event) if defined else math.inf
        return False

    def _leave_events(self) -> bool:
        """Handle the present events; True, and it is noted, if the FMU ends the simulation."""
        over = self.leave_event_mode()
        if over:
            self._end(self._reached, self._reached)
        return over

    def _jump(self, write: Callable[[], None]) -> None:
        """Set inputs, which is an event once the FMU is initialized."""
        if self._initialized:
            self.enter_event_mode()
        write()
        if self._initialized:
            self._leave_events()

    def _write_changed(self, port: Port) -> None:
        """Set inputs, which is an event, if one of them has changed."""
        values = repr(port.get())  # in which a value that is no number equals itself
        if self._written.get(port) != values:
            self._written[port] = values
            self._jump(lambda: self._write(port))

    def step(self, time: ctypes.c_double, size: ctypes.c_double) -> bool:
        """Advance by ``size`` [s] from ``time`` [s].

        Returns
        -------
        bool
            False if the FMU discarded the step, or ended the simulation before the step's end.
        """
        self._time = time
        status = self._do_step(self._component, time, size, 0)
        if status <= WARNING:
            self._worry(status)
            return True
        if status == DISCARD:
            return self._has_ended(time.value + size.value)
        self._check(status, "failed")
        return False

    def _worry(self, status: int, what: str = "its step") -> None:
        """Note that a call returned a warning, unless the FMU has said of what."""
        if status == WARNING and not self._has_warned:
            self._has_warned = True
            self.log.add(0, WARNING, b"", f"{what} returned a warning without a message".encode())

    def _has_ended(self, end: float) -> bool:
        """After a discarded step: tell whether the FMU has ended the simulation at the step's end [s], not before.

        One that has come no further than the start of the step has refused it, whatever it says: our native FMUs say that
        they have ended, so that hosts which know nothing else do not repeat the step for ever.
        """
        if self._is_python:  # pythonfmu 0.7.0 says that of every discarded step
            return False
        over, last = ctypes.c_int(0), ctypes.c_double(end)
        dll = self._slave.dll
        try:
            is_over, last_time = dll["fmi2GetBooleanStatus"], dll["fmi2GetRealStatus"]
        except AttributeError:  # not every FMU has all functions of the standard
            return False
        if is_over(self._component, _TERMINATED, ctypes.byref(over)) > WARNING or not over:
            return False
        if last_time(self._component, _LAST_TIME, ctypes.byref(last)) > WARNING:
            last.value = end
        return last.value > self.time and self._end(last.value, end)

    def _end(self, last: float, end: float) -> bool:
        """Note that the FMU ended the simulation; tell whether that was at the end of the step [s]."""
        self.ended_at = last
        self.on_end(self)
        return self._is_at(last, end)

    def _is_at(self, time: float, end: float) -> bool:
        """Tell whether a time [s] is the end of the step, but for rounding."""
        return time >= end - 1e-9 * (abs(end) + abs(end - self.time))

    def save_state(self, slot: int = 0) -> None:
        """Save the present state in a slot, 0 or 1, in place of the one saved there before."""
        arguments = self._state_arguments[slot]
        if self._is_python and self._states[slot]:
            # FMI lets an FMU overwrite its old state; pythonfmu 0.7.0 makes a new one and loses the old
            self._check(self._free_state(*arguments), "did not free its state")
            self._states[slot].value = None
        status = self._get_state(*arguments)
        if status > WARNING:
            self._check(status, "did not save its state")

    def restore_state(self, slot: int = 0) -> None:
        """Restore the state saved in a slot, with the inputs of then."""
        self._check(self._set_state(self._component, self._states[slot]), "did not restore its saved state")
        self.ended_at = None
        self.restored += 1
        self._written.clear()

    def serialize(self) -> bytes:
        """Return the present state as bytes, which another process can continue from."""
        state = self._call("did not save its state", "getFMUState")
        data: bytes = self._call("did not serialize its state", "serializeFMUState", state)
        self._call("did not free its state", "freeFMUState", state)
        return data

    def deserialize(self, data: bytes) -> None:
        """Continue from a state that ``serialize`` returned."""
        state = self._call("did not read its serialized state", "deserializeFMUState", data)
        self._call("did not restore its serialized state", "setFMUState", state)
        self._call("did not free its state", "freeFMUState", state)

    def close(self) -> None:
        """Terminate and free it; after fmi2Fatal nothing may be called, so it stays in memory."""
        component, self._component = self._component, None
        if component is None:
            return
        if not self.fmu.corrupt:
            for state, arguments in zip(self._states, self._state_arguments, strict=True):
                if state:
                    self._free_state(*arguments)
            if self._initialized:
                self._terminate(component)
            if not self.fmu.corrupt:
                self._slave.freeInstance()
        self.log.close()

    def _call(self, what: str, method: str, *arguments: object) -> Any:  # noqa: ANN401
        """Call a method of FMPy's instance; ``what`` describes its failure."""
        try:
            return getattr(self._slave, method)(*arguments)
        except FMICallException as error:
            self._check(error.status, what)
            raise  # not reached: FMPy raises for what the check refuses

    def _check(self, status: int, what: str) -> None:
        """Raise ``SimulationError`` unless a call went well."""
        if status <= WARNING:
            return
        if status == FATAL:
            self.fmu.corrupt = True
        if status in (ERROR, FATAL):
            self._initialized = False  # fmi2Terminate is not allowed any more
        label = _LABELS[status] if 0 <= status < len(_LABELS) else str(status)
        where = f"at t = {self._present:.9g} s ({label})"
        self._fail(f"{what} {where}", "", self._present, fatal=status == FATAL, discarded=status == DISCARD)

    def _fail(
        self, what: str, advice: str = " Check it with 'gossamer verify'.", time: float | None = None, **kind: bool
    ) -> NoReturn:
        """Raise an error that names the component and ends in its log and advice; ``time`` [s] is that of the step."""
        msg = f"component {self.name!r} {what}.{self.log.tail()}{advice}"
        raise SimulationError(msg, component=self.name, time=self.time if time is None else time, **kind)
