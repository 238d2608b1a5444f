"""The errors of a co-simulation.

One root, ``OrchestratorError``; every leaf is also the built-in it resembles. A message names the file and line, the
component or the number at fault, says what a file is where another kind was expected, and ends in what to do next.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gossamer_files.inputs import is_pipe
from gossamer_files.options import option


class OrchestratorError(Exception):
    """Root of every error that the orchestrator raises on purpose."""


def require(condition: object, message: str, error: type[Exception] = OrchestratorError) -> None:
    """Raise an error unless a condition holds."""
    if not condition:
        raise error(message)


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
    discarded : bool
        True if the FMU discarded a call: a smaller step may help.
    """

    def __init__(self, message: str, *, component: str, time: float, fatal: bool = False, discarded: bool = False) -> None:
        super().__init__(message)
        self.component = component
        self.time = time
        self.fatal = fatal
        self.discarded = discarded


class ResultsError(OrchestratorError, ValueError):
    """A results file that is missing, truncated or of another program, or that lacks what a plot needs."""


def check_path(path: Path, kind: type[OrchestratorError] = OrchestratorError) -> None:
    """Raise an error of a kind for a path that no file can have, too long or with a NUL, and for a pipe with a name."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):  # said where it is read or written
        return
    except (OSError, ValueError) as error:
        text, why = str(path), getattr(error, "strerror", None) or error
        short = f"{text[:_NAMED]!r}{' ..' * (len(text) > _NAMED)}"
        msg = f"no file can be called {short}, {len(text)} characters: {why}. Name another."
        raise kind(msg) from None
    if is_pipe(path):
        msg = f"{path} is a pipe. Name a file, or a folder."
        raise kind(msg)


@contextmanager
def writing(path: Path, kind: type[OrchestratorError] = OrchestratorError, advice: str = "") -> Iterator[None]:
    """Raise an error of a kind, with what to do, if a file or folder cannot be written inside the ``with`` block."""
    try:
        yield
    except OSError as error:
        advice = advice or f"Name another place with {option('out')}."
        msg = f"cannot write {path}: {error.strerror or error}. {advice}"
        raise kind(msg) from error


_NAMED = 60  # characters of a path
_MEMBERS = {
    "modelDescription.xml": "It is an FMU: look at it with 'gossamer info' or 'gossamer verify'.",
    "SystemStructure.ssd": "It is an SSP: run it with 'gossamer run'.",
}
_HEADS = {
    b"PK": "It is an incomplete ZIP archive. Build or copy it again.",
    b"\x89PNG": "It is a picture (PNG).",
    b"\xff\xd8": "It is a picture (JPEG).",
    b"%PDF": "It is a PDF.",
    b"CDF": "It is a results file (netCDF): open it with xarray.",
    b"\x89HDF": "It is HDF5.",
    b"\xff\xfe": "It is text in UTF-16: save it as UTF-8.",
    b"\xfe\xff": "It is text in UTF-16: save it as UTF-8.",
    b"\x7fELF": "It is a Linux binary.",
}


def explain_file(path: Path) -> str:
    """Say what a file is and which command takes it, as a sentence."""
    if path.is_dir():
        return "It is a folder."
    import zipfile

    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                names = archive.namelist()
            return next((text for name, text in _MEMBERS.items() if name in names), "It is a ZIP archive of another kind.")
        with path.open("rb") as file:
            head = file.read(4096)
    except (OSError, zipfile.BadZipFile):
        return "It cannot be read; build or copy it again."
    kind = next((text for start, text in _HEADS.items() if head.startswith(start)), None)
    if kind is None and path.suffix == ".toml":
        return "It seems to be a scenario: run it with 'gossamer run'."
    return kind or ("It is empty." if not head else "It is some other data." if b"\0" in head else "It is text.")
