"""The errors of a co-simulation.

One root, ``OrchestratorError``; every leaf is also the built-in it resembles. A message names the file and line, the
component or the number at fault and ends in what to do next.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class OrchestratorError(Exception):
    """Root of every error that the orchestrator raises on purpose."""


class ScenarioError(OrchestratorError, ValueError):
    """A scenario that is incomplete or wrong, or that does not fit its FMUs."""


class FmuError(OrchestratorError, ValueError):
    """A file that is not a usable FMI 2.0 co-simulation FMU."""


class SimulationError(OrchestratorError, RuntimeError):
    """A run that an FMU ended.

    Attributes
    ----------
    component : str
        Name of the component whose FMU refused or failed.
    time : float
        Start of the step it refused [s].
    fatal : bool
        True if the FMU must not be called any more.
    """

    def __init__(self, message: str, *, component: str, time: float, fatal: bool = False) -> None:
        super().__init__(message)
        self.component = component
        self.time = time
        self.fatal = fatal


class ResultsError(OrchestratorError, ValueError):
    """A results file that is missing, truncated or of another program, or that lacks what a plot needs."""


@contextmanager
def writing(path: Path, kind: type[OrchestratorError] = OrchestratorError) -> Iterator[None]:
    """Raise an error of a kind if a file or folder cannot be written inside the ``with`` block."""
    try:
        yield
    except OSError as error:
        msg = f"cannot write {path}: {error.strerror or error}. Name another place with --out."
        raise kind(msg) from error
