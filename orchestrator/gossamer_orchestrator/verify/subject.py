"""The FMU under test, with the same methods for FMI 2.0 and 3.0."""

from __future__ import annotations

import ctypes
import hashlib
import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property, partial
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeAlias, TypeVar
from xml.etree import ElementTree

import fmpy
import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from ..fmi.file import interface, library_path
from ..fmi.slave import DISCARD, FATAL, OK, Log, is_python, start_slave
from ..fmi.types import TEXTS
from ..processes import shared_memory

P = ParamSpec("P")
R = TypeVar("R")
REALS = ("Real", "Float64", "Float32")
STEPS = 100
LONG = 1000  # characters of a text that is kept
Vector: TypeAlias = NDArray[np.float64]
Trajectory = list[list[Any]]  # outputs after each step


class Calls:
    """Count the calls of an FMU in shared memory: the count is odd during one.

    Parameters
    ----------
    path : Path
        File that another process maps too, to see whether a call is late.
    """

    def __init__(self, path: Path) -> None:
        self._counter = memoryview(shared_memory(path, 8)).cast("Q")
        self._process = os.getpid()

    def make(self, function: Callable[P, R], *arguments: P.args, **options: P.kwargs) -> R:
        """Return the result of a call of the FMU; a copy of this process that it has made ends after the call."""
        self._counter[0] += 1
        try:
            return function(*arguments, **options)
        finally:
            if os.getpid() != self._process:
                os._exit(0)
            self._counter[0] += 1


class Subject:
    """An FMU for co-simulation.

    Attributes
    ----------
    path, folder : Path
        The file, and where it is unpacked.
    log : Log
        What all its instances log.
    description : fmpy.model_description.ModelDescription
        As read by FMPy, not validated.
    version : int
        2 or 3.
    variables : list
        All but clocks and what belongs to them, which can be read in an event only.
    inputs, parameters, outputs : list
        Real inputs and parameters, and outputs of every type.
    calls : Calls
        Through which all its functions are called.
    start, size : float
        Start [s] of its runs and their step size [s]: those of its default experiment if there are any.
    steps, ends : int, bool
        Steps of a run, and whether its default experiment ends after them.
    fatal : bool
        An instance returned Fatal: no function of any instance may be called any more.
    can : fmpy.model_description.CoSimulation
        Its capabilities; ``differentiates`` is one that FMPy does not read.
    """

    def __init__(self, path: Path, folder: Path, log: Log, calls: Calls) -> None:
        self.path = path
        self.calls = calls
        self.folder = folder
        self.log = log
        self.description: Any = fmpy.read_model_description(str(folder), validate=False)
        self.version = int(self.description.fmiVersion[0])
        self.variables = [v for v in self.description.modelVariables if v.type != "Clock" and not v.clocks]
        reals = [v for v in self.variables if v.type in REALS]
        self.inputs = [v for v in reals if v.causality == "input"]
        self.parameters = [v for v in reals if v.causality == "parameter"]
        self.outputs = [v for v in self.variables if v.causality == "output"]
        experiment = self.description.defaultExperiment
        start, stop, size = (_finite(experiment, key) for key in ("startTime", "stopTime", "stepSize"))
        self.start = start or 0.0
        stop = None if stop is None or stop <= self.start else stop
        self.size = size if size and size > 0.0 else (self.start + 1.0 if stop is None else stop - self.start) / STEPS
        whole = STEPS if stop is None else max(int((stop - self.start) / self.size + 1e-6), 1)
        self.steps, self.ends = min(whole, STEPS), stop is not None
        self.fatal = False
        self.can: Any = interface(self.description)
        self.exchange = self.description.coSimulation is None
        capabilities = ElementTree.parse(folder / "modelDescription.xml").find("CoSimulation")
        names = "providesDirectionalDerivative", "providesDirectionalDerivatives"  # FMPy reads the first, of FMI 2.0
        self.differentiates = any(capabilities.get(name) in ("true", "1") for name in names if capabilities is not None)

    @cached_property
    def swings(self) -> list[tuple[str, list[int], Vector, Range]]:
        """Inputs of each type: their value references, a number for each element, and their values."""
        found = []
        for kind in REALS:
            inputs = [(i, v, _range(v)) for i, v in enumerate(self.inputs) if v.type == kind]
            if inputs:
                numbers = np.concatenate([np.full(len(one.start), float(i)) for i, _, one in inputs])
                values = Range(*map(np.concatenate, zip(*(one for *_, one in inputs), strict=True)))
                found.append((kind, [v.valueReference for _, v, _ in inputs], numbers, values))
        return found

    @property
    def half(self) -> int:
        """Half the steps of a run."""
        return self.steps // 2

    @property
    def library(self) -> Path:
        """The binary for this machine."""
        return library_path(self.folder, self.description)

    @contextmanager
    def instance(self, *, initialize: bool = True, token: str | None = None) -> Iterator[InstanceUnderTest]:
        """Start an instance, and free it unless it must not be called any more."""
        one = InstanceUnderTest(self, token)
        try:
            if initialize:
                one.initialize()
            yield one
        except FMICallException as error:
            self.fatal |= error.status == FATAL
            raise
        finally:
            if not self.fatal:
                one.slave.freeInstance()


class InstanceUnderTest:
    """An instance of the FMU under test; a status worse than a warning is an ``FMICallException``.

    Attributes
    ----------
    ended : bool
        The FMU has ended the simulation, and no step may follow.
    """

    def __init__(self, subject: Subject, token: str | None) -> None:
        self.subject = subject
        self.ended = self._ended_when_saved = False
        slave = subject.calls.make(start_slave, subject.description, subject.folder, "verified", subject.log, token=token)
        self.slave: Any = _Counted(slave, subject.calls)

    def initialize(self, inside: Callable[[], object] = lambda: None, start: float | None = None) -> None:
        """Go through the initialization, with what is to be done inside it, from a time [s]; None for the default one."""
        start = self.subject.start if start is None else start
        if self.subject.version == 2:
            self.slave.setupExperiment(startTime=start)
            self.slave.enterInitializationMode()
        else:
            self.slave.enterInitializationMode(startTime=start)
        inside()
        self.slave.exitInitializationMode()

    def get(self, *variables: Any) -> list[Any]:  # noqa: ANN401
        """Read one variable of any type, or several of the same."""
        two, kind = self.subject.version == 2, variables[0].type
        integer = "Integer" if two else "Int64"
        get = getattr(self.slave, f"get{integer if kind == 'Enumeration' else kind}")
        count = [] if two else [sum(map(length, variables))]
        return [_short(value) for value in get([v.valueReference for v in variables], *count)]

    def set(self, variable: Any, values: Sequence[float]) -> None:  # noqa: ANN401
        """Set one Real variable."""
        getattr(self.slave, f"set{variable.type}")([variable.valueReference], values)

    def read(self, variables: Iterable[Any]) -> list[Any]:
        """Read several variables."""
        values = []
        for kind, alike in groupby(variables, attrgetter("type")):
            for some in [list(alike)] if kind not in TEXTS else ([one] for one in alike):
                values += self.get(*some)
        return values

    def not_finite(self) -> list[str]:
        """Return the names of the Real outputs that are not finite."""
        reals = [variable for variable in self.subject.outputs if variable.type in REALS]
        return [variable.name for variable in reals if not np.all(np.isfinite(self.get(variable)))]

    def step(self, k: int) -> None:
        """Do the k-th step, which may end the simulation."""
        self.advance(self.subject.start + k * self.subject.size, self.subject.size)

    def advance(self, time: float, size: float) -> None:
        """Do a step from a time [s], which may end the simulation."""
        subject = self.subject
        try:
            flags = self.slave.doStep(time, size, False)
        except FMICallException as error:
            if error.status != DISCARD or subject.version != 2 or not self._has_terminated():
                raise
            self.ended = True
        else:
            self.ended = flags is not None and bool(flags[1])  # terminateSimulation of FMI 3.0

    def _has_terminated(self) -> bool:
        """Ask why a step of FMI 2.0 was discarded; pythonfmu 0.7.0 says so of every one."""
        if is_python(self.subject.folder):
            return False
        try:
            return bool(self.slave.getBooleanStatus(fmi2.fmi2Terminated))
        except FMICallException:
            return False

    def rewind(self) -> None:
        """Begin again."""
        self.slave.reset()
        self.ended = False
        self.initialize()

    def excite(self, begin: int, end: int, phase: float = 0.0) -> Trajectory:
        """Do steps with inputs that swing by 1 % about their start values; return the outputs after each.

        It ends early if the FMU ends the simulation.
        """
        trajectory: Trajectory = []
        for k in range(begin, end):
            if self.ended:
                break
            for kind, references, numbers, values in self.subject.swings:
                moved = values.moved(np.sin(0.3 * k + numbers + phase))
                getattr(self.slave, f"set{kind}")(references, moved)
            self.step(k)
            trajectory.append(self.read(self.subject.outputs))
        return trajectory

    def save(self, over: ctypes.c_void_p | None = None) -> ctypes.c_void_p:
        """Copy the state, over an older copy if one is given."""
        state = ctypes.c_void_p() if over is None else over
        get = self.slave.fmi2GetFMUstate if self.subject.version == 2 else self.slave.fmi3GetFMUState
        get(self.slave.component, ctypes.byref(state))
        self._ended_when_saved = self.ended
        return state

    def restore(self, state: ctypes.c_void_p) -> None:
        """Go back to a state, and free it."""
        self.slave.setFMUState(state)
        self.slave.freeFMUState(state)
        self.ended = self._ended_when_saved

    def attempt(self, function: Any, *arguments: object) -> int:  # noqa: ANN401
        """Return the status of a call that may fail."""
        try:
            function(*arguments)
        except FMICallException as error:
            self.subject.fatal |= error.status == FATAL
            return int(error.status)
        return OK

    def derivative(self, output: Any, known: Any, seed: Sequence[float]) -> list[float]:  # noqa: ANN401
        """Differentiate an output in a direction of an input."""
        count = [] if self.subject.version == 2 else [length(output)]
        return list(self.slave.getDirectionalDerivative([output.valueReference], [known.valueReference], seed, *count))


class _Counted:
    """Make every call of an instance's methods through ``Calls``."""

    def __init__(self, slave: Any, calls: Calls) -> None:  # noqa: ANN401
        self._slave, self._calls = slave, calls

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        value = getattr(self._slave, name)
        return partial(self._calls.make, value) if callable(value) else value


def length(variable: Any) -> int:  # noqa: ANN401
    """Return the number of elements of a variable."""
    return int(np.prod(variable.shape)) if variable.shape else 1


class Range(NamedTuple):
    """Start values of Real variables, by how much they are to change, and their limits; an item each for every element."""

    start: Vector
    size: Vector
    low: Vector
    high: Vector

    def moved(self, by: float | Vector) -> list[float]:
        """Return values near the start values and within the limits, for ``by`` from -1 to 1."""
        change = self.size * by
        inside = (self.low <= self.start + change) & (self.start + change <= self.high)
        moved: list[float] = np.where(inside, self.start + change, self.start - change).tolist()
        return moved


def swing(variable: Any, by: float) -> list[float]:  # noqa: ANN401
    """Return values near the start values of a Real variable and in its range, for ``by`` from -1 to 1."""
    return _range(variable).moved(by)


def _range(variable: Any) -> Range:  # noqa: ANN401
    texts = str(variable.start if variable.start is not None else 0.0).split()
    start = [float(text) for text in (texts if len(texts) == length(variable) else texts[:1] * length(variable))]
    low = -math.inf if variable.min is None else float(variable.min)
    high = math.inf if variable.max is None else float(variable.max)
    nominal = 1.0 if variable.nominal is None else float(variable.nominal)
    alike = np.ones(len(start))
    return Range(np.array(start), 0.01 * min(abs(nominal), high - low) * alike, low * alike, high * alike)


def _finite(experiment: Any, key: str) -> float | None:  # noqa: ANN401
    """Return a number [s] of a default experiment; None if it is not there or not finite."""
    text = getattr(experiment, key, None)
    return float(text) if text is not None and math.isfinite(float(text)) else None


def _short(value: Any) -> Any:  # noqa: ANN401
    """Return a value, or what tells a long text from others: outputs of every step are kept."""
    if not isinstance(value, str | bytes) or len(value) <= LONG:
        return value
    data = value.encode() if isinstance(value, str) else value
    return f"{len(value)} characters, SHA-256 {hashlib.sha256(data).hexdigest()}"
