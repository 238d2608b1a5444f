"""The one slave: runs any step model inside a pythonfmu FMU.

This file is a template. The builder copies it into every FMU under a name that carries the content's digest, and what it
imports from ``gossamer_models`` and ``pythonfmu`` into a package of that name, so that nothing in it can collide with
another FMU or with the host. pythonfmu loads it by name and then runs its text a second time, so nothing happens at import
but definitions.

An exception in a callback would be fatal to the host, so no method raises: a refused step is logged and discarded, a refused
value is logged and ignored.
"""

import sys
from functools import lru_cache
from pathlib import Path

from gossamer_models.errors import GossamerError
from gossamer_models.step_model import StepModel
from gossamer_models.stepper import Stepper
from pythonfmu.enums import Fmi2Status
from pythonfmu.fmi2slave import Fmi2Slave


@lru_cache(maxsize=1)
def load_model(folder: str) -> StepModel:
    """Read the model once per process."""
    return StepModel.load(Path(folder))


# pythonfmu 0.7.0 releases this module's globals once too often for every instance; each instance adds the one that is lost.
_references: list[object] = []


class GossamerSlave(Fmi2Slave):
    """A step model as an FMI 2.0 co-simulation slave; value references are places in its table of variables."""

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        _references.append(globals())
        while self.resources in sys.path:  # put there by pythonfmu, once per instance: must not shadow a host's modules
            sys.path.remove(self.resources)
        self.stepper = Stepper(load_model(self.resources))
        self.failed_start = ""

    def complain(self, error: object, status: Fmi2Status = Fmi2Status.error) -> None:
        """Log an error; the host treats the text as a printf format."""
        self.log(str(error).replace("%", "%%"), status)

    def setup_experiment(self, *args: object) -> None:
        """Ignore the times: the model is autonomous."""

    def exit_initialization_mode(self) -> None:
        try:
            self.stepper.initialize()
            self.failed_start = ""
        except GossamerError as error:
            self.failed_start = str(error)
            self.complain(error)

    def do_step(self, current_time: float, step_size: float) -> bool:
        try:
            if self.failed_start:
                self.complain(self.failed_start, Fmi2Status.discard)
                return False
            self.stepper.step(step_size)
        except GossamerError as error:
            self.complain(error, Fmi2Status.discard)
            return False
        return True

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        try:
            self.stepper.set_values(vrs, values)
        except GossamerError as error:
            self.complain(error)

    def get_real(self, vrs: list[int]) -> list[float]:
        try:
            return self.stepper.get_values(vrs)
        except GossamerError as error:
            self.complain(error)
            return [float("nan")] * len(vrs)

    def _not_real(self, vrs: list[int]) -> None:
        self.complain(
            f"model {self.stepper.model.name!r} has real variables only; {list(vrs)[:8]} cannot be of this type"
        )

    def get_integer(self, vrs: list[int]) -> list[int]:
        self._not_real(vrs)
        return [0] * len(vrs)

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        self._not_real(vrs)
        return [False] * len(vrs)

    def get_string(self, vrs: list[int]) -> list[str]:
        self._not_real(vrs)
        return [""] * len(vrs)

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._not_real(vrs)

    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._not_real(vrs)

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._not_real(vrs)

    def _get_fmu_state(self) -> bytes:
        return self.stepper.state

    def _set_fmu_state(self, state: bytes) -> None:
        try:
            self.stepper.state = state
            self.failed_start = ""
        except GossamerError as error:
            self.complain(error)

    @staticmethod
    def _fmu_state_to_bytes(state: bytes) -> bytes:
        return state

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> bytes:
        return state
