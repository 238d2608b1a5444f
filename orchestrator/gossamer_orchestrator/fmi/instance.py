"""A running FMU, through FMPy's low-level interface.

A step costs what the FMU costs. The arguments of a call are converted to C once per group of variables (``Port``), and the C
functions are called directly, since fmi2Discard is a normal result here, not an exception. ctypes converts no argument of a
function that declares no types, which halves the cost of a call; so every argument of those must be a ctypes object.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from ..errors import FmuError, SimulationError
from .file import FmuFile
from .slave import DISCARD, ERROR, FATAL, WARNING, Log, is_python, start_slave

_LABELS = ("ok", "warning", "discard", "error", "fatal", "pending")


class Port:
    """Real variables of one instance that are read or written together.

    Attributes
    ----------
    values : numpy.ndarray
        Their buffer, contiguous; may be a view into a larger array.
    arguments : tuple
        What fmi2GetReal and fmi2SetReal are called with.
    """

    __slots__ = ("arguments", "size", "values")

    def __init__(self, component: ctypes.c_void_p, references: Sequence[int], values: NDArray[np.float64]) -> None:
        self.size = len(references)
        self.values = values
        self.arguments = (
            component,
            (fmi2.fmi2ValueReference * self.size)(*references),
            ctypes.c_size_t(self.size),
            values.ctypes.data_as(ctypes.c_void_p),
        )


class Instance:
    """One instance of an FMU.

    Parameters
    ----------
    fmu : FmuFile
        The file.
    name : str
        Component name, for messages.
    time : float
        Start of the run [s].

    Raises
    ------
    FmuError
        The FMU has no binary for this machine or cannot be instantiated.
    """

    def __init__(self, fmu: FmuFile, name: str, time: float = 0.0) -> None:
        self.fmu = fmu
        self.name = name
        self._time = ctypes.c_double(time)
        self.log = Log(lambda: self.time)
        self._state = fmi2.fmi2FMUstate()
        self._initialized = False
        self._component: Any = None
        try:
            self._slave = start_slave(fmu.description, fmu.folder(), name, self.log)
        except Exception as error:
            # FMPy raises bare exceptions here
            self.log.close()
            msg = f"{name}: {fmu.path} cannot be started: {error}{self.log.tail()}"
            if not isinstance(error, FmuError):
                msg += " Check it with 'gossamer verify'."
            raise FmuError(msg) from error
        self._is_python = is_python(fmu.folder())
        dll = self._slave.dll  # by subscript it gives functions of its own, without FMPy's argument types
        self._get, self._set, self._do_step = dll["fmi2GetReal"], dll["fmi2SetReal"], dll["fmi2DoStep"]
        self._get_state, self._set_state = dll["fmi2GetFMUstate"], dll["fmi2SetFMUstate"]
        self._free_state = dll["fmi2FreeFMUstate"]
        self._component = ctypes.c_void_p(self._slave.component)
        self._state_arguments = (self._component, ctypes.byref(self._state))

    @property
    def time(self) -> float:
        """Start of the last step [s]."""
        return self._time.value

    def port(self, names: Sequence[str], values: NDArray[np.float64] | None = None) -> Port:
        """Prepare the exchange of some Real variables."""
        references = [self.fmu.variables[name].valueReference for name in names]
        return Port(self._component, references, np.zeros(len(references)) if values is None else values)

    def set_start(self, values: Mapping[str, float | str]) -> None:
        """Set parameters and inputs of any type by name."""
        for name, value in values.items():
            variable = self.fmu.variables[name]
            kind = "Integer" if variable.type == "Enumeration" else variable.type
            self._call(f"refused {name!r} = {value}", f"set{kind}", [variable.valueReference], [value])

    def enter_initialization(self, stop: float) -> None:
        """Set the times of the run and enter the mode in which start values are set."""
        self._call("refused the run's times", "setupExperiment", None, self.time, stop)
        self._call("could not enter initialization", "enterInitializationMode")

    def exit_initialization(self) -> None:
        """Leave the initialization mode; outputs can be read from here on."""
        self._call("could not be initialized", "exitInitializationMode")
        self._initialized = True

    def write(self, port: Port) -> None:
        """Set the variables of a port."""
        status = self._set(*port.arguments)
        if status > WARNING:
            self._check(status, "refused its inputs")

    def read(self, port: Port) -> None:
        """Get the variables of a port."""
        status = self._get(*port.arguments)
        if status > WARNING:
            self._check(status, "did not return its outputs")

    def step(self, time: ctypes.c_double, size: ctypes.c_double) -> bool:
        """Advance by ``size`` [s] from ``time`` [s]; False if the FMU discarded the step."""
        self._time = time
        status = self._do_step(self._component, time, size, 0)
        if status <= WARNING:
            return True
        if status == DISCARD:
            return False
        self._check(status, "failed")
        return False

    def save_state(self) -> None:
        """Save the present state in place of the one saved before."""
        if self._is_python and self._state:
            # FMI lets an FMU overwrite its old state; pythonfmu 0.7.0 makes a new one and loses the old
            self._check(self._free_state(*self._state_arguments), "did not free its state")
            self._state.value = None
        status = self._get_state(*self._state_arguments)
        if status > WARNING:
            self._check(status, "did not save its state")

    def restore_state(self) -> None:
        """Restore the saved state."""
        self._check(self._set_state(self._component, self._state), "did not restore its saved state")

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
            dll = self._slave.dll
            if self._state:
                self._free_state(*self._state_arguments)
            if self._initialized:
                dll.fmi2Terminate(component)
            if not self.fmu.corrupt:
                self._slave.freeInstance()
        self.log.close()

    def _call(self, what: str, method: str, *arguments: object) -> Any:  # noqa: ANN401
        """Call a method of FMPy's instance; ``what`` describes its failure."""
        try:
            return getattr(self._slave, method)(*arguments)
        except FMICallException as error:
            self._check(error.status, what)

    def _check(self, status: int, what: str) -> None:
        """Raise ``SimulationError`` unless a call went well."""
        if status <= WARNING:
            return
        if status == FATAL:
            self.fmu.corrupt = True
        if status in (ERROR, FATAL):
            self._initialized = False  # fmi2Terminate is not allowed any more
        label = _LABELS[status] if 0 <= status < len(_LABELS) else str(status)
        msg = f"component {self.name!r} {what} at t = {self.time:.9g} s ({label}).{self.log.tail()}"
        raise SimulationError(msg, component=self.name, time=self.time, fatal=status == FATAL)
