"""Start instances of an unpacked FMU through FMPy, FMI 2.0 or 3.0; keep what they log, and what other tools say of it."""

from __future__ import annotations

import ctypes
import logging
import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import Any

from fmpy import fmi2, fmi3
from fmpy.logging import addLoggerProxy
from fmpy.model_description import ModelDescription

from ..errors import FmuError
from .file import explain_platforms, interface, library_path

OK, WARNING, DISCARD, ERROR, FATAL = range(5)

# FMPy's proxy, which expands printf formats, calls the function installed last, whoever logs. So there is one function for
# all instances of FMI 2.0, and the environment pointer tells their logs apart.
_logs: dict[int, Log] = {}


class Log:
    """The latest messages of one or more instances.

    Parameters
    ----------
    clock : callable
        Returns the present time [s].

    Attributes
    ----------
    messages : deque of (int, str)
        Status and text of each.
    first_warning : str
        Time and text of the first message that is a warning; empty without any.
    """

    def __init__(self, clock: Callable[[], float] = lambda: 0.0) -> None:
        self._clock = clock
        self.messages: deque[tuple[int, str]] = deque(maxlen=1000)
        self.first_warning = ""
        _logs[id(self)] = self

    def add(self, _environment: int, status: int, _category: bytes, message: bytes) -> None:
        """Append a message; has the signature of FMI 3.0's callback."""
        text = (message or b"").decode("utf-8", "replace").replace("%%", "%")
        self.messages.append((status, text))
        if status == WARNING and not self.first_warning:
            self.first_warning = f"at t = {self._clock():.9g} s: {' '.join(text.split())}"

    def tail(self) -> str:
        """Return the last two different messages that are no plain OK, as the end of a sentence; empty without any."""
        texts = dict.fromkeys(" ".join(text.split()) for status, text in self.messages if status != OK)
        latest = [text for text in texts if text][-2:]
        return f" Its log ends with: {' | '.join(latest)}" if latest else ""

    def close(self) -> None:
        """Take no more messages from FMI 2.0."""
        _logs.pop(id(self), None)


def _add2(environment: int, _name: bytes, status: int, category: bytes, message: bytes) -> None:
    if environment in _logs:
        _logs[environment].add(environment, status, category, message)


_LOGGER = fmi2.fmi2CallbackLoggerTYPE(_add2)


def is_python(folder: Path) -> bool:
    """Tell whether pythonfmu made an unpacked FMU; its log texts are no printf formats."""
    return (folder / "resources/slavemodule.txt").exists()


def slave_class(description: ModelDescription) -> type[Any]:
    """Return FMPy's class for a version of FMI, for co-simulation if the FMU has that."""
    module, version = (fmi2, 2) if description.fmiVersion.startswith("2") else (fmi3, 3)
    found: type[Any] = getattr(module, f"FMU{version}{'Model' if description.coSimulation is None else 'Slave'}")
    return found


def start_slave(
    description: Any,  # noqa: ANN401
    folder: Path,
    name: str,
    log: Log,
    *,
    token: str | None = None,
    event_mode: bool = False,
) -> Any:  # noqa: ANN401
    """Instantiate an unpacked FMU.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
        As read by FMPy.
    folder : Path
        Where the FMU is unpacked.
    name : str
        Name of the instance.
    log : Log
        Receives its messages.
    token : str, optional
        Guid or instantiation token in place of the FMU's own.
    event_mode : bool
        Run an FMU of FMI 3.0 with event mode, and let it return early from a step.

    Returns
    -------
    FMU2Slave, FMU2Model, FMU3Slave or FMU3Model of FMPy
        The instance, for co-simulation if the FMU has that. FMPy raises bare exceptions if there is none.

    Raises
    ------
    FmuError
        The FMU has no binary for this machine.
    """
    library = library_path(folder, description)
    if not library.is_file():
        raise FmuError(explain_platforms(folder, library))
    two = description.fmiVersion.startswith("2")
    slave = slave_class(description)(
        guid=token or description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=interface(description).modelIdentifier,
        instanceName=name,
    )
    try:
        if two:
            options = {"callbacks": _callbacks(log, proxy=not is_python(folder))}
        else:
            modes = () if description.coSimulation is None else ("eventModeUsed", "earlyReturnAllowed")
            options = {"logMessage": log.add} | dict.fromkeys(modes, event_mode)
        slave.instantiate(loggingOn=True, **options)
    except Exception:
        slave.freeLibrary()  # pythonfmu 0.7.0 may abort the process at its end if it is still loaded
        raise
    return slave


def _callbacks(log: Log, *, proxy: bool) -> Any:  # noqa: ANN401
    own = fmi2.defaultCallbacks
    callbacks = fmi2.fmi2CallbackFunctions(_LOGGER, own.allocateMemory, own.freeMemory, componentEnvironment=id(log))
    if proxy:
        addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


@contextmanager
def collect_errors() -> Iterator[list[str]]:
    """Collect what they log as errors inside the ``with`` block, and show nothing; the list is filled at its end."""
    logger, handler = logging.getLogger("fmu_manipulation_toolbox"), BufferingHandler(sys.maxsize)
    handler.setLevel(logging.ERROR)
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    errors: list[str] = []
    try:
        yield errors
    finally:
        errors += [record.getMessage() for record in handler.buffer]
        logger.removeHandler(handler)
        logger.propagate = propagate
