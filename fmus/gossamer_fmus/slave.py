"""The one slave: runs any step model inside a pythonfmu FMU.

The builder copies this file into every FMU, together with what it imports from ``gossamer_models`` and ``pythonfmu``, as a
package whose name carries the content's digest, so that nothing in it can collide with another FMU or with the host.

An exception that leaves a callback crashes the host, so no callback raises one: it logs and discards a refused step,
and logs and ignores a refused value.
"""

import atexit
import ctypes
import os
import sys
import weakref
from collections.abc import Callable
from contextlib import suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

from gossamer_models.step_model import StepModel
from gossamer_models.stepper import Stepper
from pythonfmu.enums import Fmi2Status
from pythonfmu.fmi2slave import Fmi2Slave

P = ParamSpec("P")
T = TypeVar("T")


@lru_cache(maxsize=1)
def load_model(folder: str) -> StepModel:
    """Read the model once per process."""
    return StepModel.load(Path(folder))


@cache
def finalize_before_exit(folder: str) -> None:
    """Let pythonfmu's library release its state in time.

    On Linux the destructors of pythonfmu 0.7.0 release that state twice, first with the library's static objects; now and
    then the host aborts at its very end ("corrupted double-linked list"). After an earlier release, both do nothing.
    """
    if sys.platform != "linux":
        return
    for library in Path(folder).parent.glob("binaries/linux*/*.so"):
        with suppress(OSError, AttributeError):  # not the library that is loaded, or a version without the function
            atexit.register(ctypes.CDLL(str(library), mode=os.RTLD_NOLOAD | os.RTLD_NOW).finalizePythonInterpreter)


def never_raises(
    fallback: Callable[P, T], status: Fmi2Status = Fmi2Status.error
) -> Callable[[Callable[Concatenate["GossamerSlave", P], T]], Callable[Concatenate["GossamerSlave", P], T]]:
    """Make a callback log every exception and return the result of ``fallback``, called with the same arguments."""

    def decorate(method: Callable[Concatenate["GossamerSlave", P], T]) -> Callable[Concatenate["GossamerSlave", P], T]:
        def callback(self: "GossamerSlave", /, *args: P.args, **kwargs: P.kwargs) -> T:
            try:
                return method(self, *args, **kwargs)
            except BaseException as error:
                self.complain(error, status)
                return fallback(*args, **kwargs)

        return callback

    return decorate


class GossamerSlave(Fmi2Slave):
    """A step model as an FMI 2.0 co-simulation slave; value references are places in its table of variables."""

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        while self.resources in sys.path:  # put there by pythonfmu, once per instance: must not shadow a host's modules
            sys.path.remove(self.resources)
        finalize_before_exit(self.resources)
        self.stepper = Stepper(load_model(self.resources))
        own = weakref.proxy(self)  # no circle: an instance that is reset or freed gives its memory back at once
        self.stepper.warn = lambda text: own.complain(text, Fmi2Status.warning)
        self.values = self.stepper.values.data  # read in place: three times faster than get_values
        self.first_result = self.stepper.model.slices()[2].start
        self.initializing = False
        self.results_known = False
        self.failed_start = ""
        self.interruption = ""

    def complain(self, error: object, status: Fmi2Status = Fmi2Status.error) -> None:
        """Log an error; the host treats the text as a printf format."""
        if isinstance(error, KeyboardInterrupt):
            error = self.interruption = "interrupted: every step is refused from here on. Reset the FMU to go on."
        text = str(error) or type(error).__name__
        self.log(text.replace("%", "%%").replace("\0", ""), status)

    def setup_experiment(self, *args: object) -> None:
        """Ignore the times: the model is autonomous."""

    def enter_initialization_mode(self) -> None:
        self.initializing = True

    def exit_initialization_mode(self) -> None:
        self.initializing = False
        try:
            self.stepper.initialize()
            self.failed_start = ""
        except BaseException as error:
            self.complain(error)
            if not self.stepper.initialized:
                self.failed_start = str(error) or type(error).__name__

    @never_raises(lambda current_time, step_size: False, Fmi2Status.discard)  # noqa: ARG005
    def do_step(self, current_time: float, step_size: float) -> bool:
        if self.interruption or self.failed_start:
            self.complain(self.interruption or self.failed_start, Fmi2Status.discard)
            return False
        self.stepper.step(step_size)
        return True

    @never_raises(lambda *_: None)
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        self.results_known = False
        self.stepper.set_values(vrs, values)

    @never_raises(lambda vrs: [float("nan")] * len(vrs))
    def get_real(self, vrs: list[int]) -> list[float]:
        if self.initializing and not self.results_known and max(vrs, default=0) >= self.first_result:
            self._compute_initial_results()
        if vrs and min(vrs) >= 0 and max(vrs) < len(self.values):
            return [self.values[i] for i in vrs]
        return self.stepper.get_values(vrs)

    def _compute_initial_results(self) -> None:
        """Let a host read results in initialization mode, where it may still change what they depend on."""
        if not self.stepper.initialized:
            self.stepper.initialize()
            self.stepper.initialized = False
            self.results_known = True

    @never_raises(lambda *_: None)
    def _not_real(self, vrs: list[int], *_: object) -> None:
        self.complain(f"model {self.stepper.model.name!r} has real variables only; {vrs[:8]} cannot be of this type")

    def get_integer(self, vrs: list[int]) -> list[int]:
        self._not_real(vrs)
        return [0] * len(vrs)

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        self._not_real(vrs)
        return [False] * len(vrs)

    def get_string(self, vrs: list[int]) -> list[str]:
        self._not_real(vrs)
        return [""] * len(vrs)

    set_integer = set_boolean = set_string = _not_real

    def _get_fmu_state(self) -> bytes:
        return self.stepper.state

    @never_raises(lambda *_: None)
    def _set_fmu_state(self, state: bytes) -> None:
        self.stepper.state = state
        self.results_known = False
        self.failed_start = ""

    @staticmethod
    def _fmu_state_to_bytes(state: bytes) -> bytes:
        return state

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> bytes:
        return state
