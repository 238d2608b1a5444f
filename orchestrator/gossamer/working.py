"""What commands share while they work: what they say, and what they write: the page comes last."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError

if TYPE_CHECKING:
    from gossamer_orchestrator import ProgressBar
    from gossamer_orchestrator.pages import Page
    from rich.console import Console

NO_TERMINAL = 160  # columns

logger = logging.getLogger(__name__)


@dataclass
class Terminal:
    """How much this program prints.

    Attributes
    ----------
    quiet : bool
        Whether the user wants nothing but the answer and errors.
    talks : bool
        Whether sentences are printed, as the command line does; in Python they are messages of the log.
    typed : sequence of str or None
        Arguments of the command line; None in Python.
    """

    quiet: bool = False
    talks: bool = False
    typed: Sequence[str] | None = None


TERMINAL = Terminal()


def stderr() -> Console:
    """Return a console for progress, as wide as the terminal; it prints nothing if the user wants quiet."""
    from rich.console import Console

    return Console(stderr=True, quiet=TERMINAL.quiet, width=None if sys.stderr.isatty() else NO_TERMINAL)


def progress_bar(label: str, *, remaining: bool = True) -> ProgressBar:
    """Return a bar on that console."""
    from gossamer_orchestrator import ProgressBar

    return ProgressBar(label, stderr(), remaining=remaining)


def talk() -> Console:
    """Return a console for what is told while a command works; in Python it prints nothing."""
    console = stderr()
    console.quiet = TERMINAL.quiet or not TERMINAL.talks
    return console


def say(text: str, level: int = logging.INFO) -> None:
    """Print a sentence on the command line; in Python it is a message of the log."""
    if not TERMINAL.talks:
        logger.log(level, "%s", text)
    elif not TERMINAL.quiet:
        print(text, file=sys.stderr)


def need_setup(**given: object) -> None:
    """Refuse options that only a setup gives a meaning, because there is none; those that are None are not given."""
    for name, value in given.items():
        if value is not None:
            called = option(name, True if value is True else None)
            msg = f"{called} needs a setup of material and supports. Name its file with {option('setup')}."
            raise OrchestratorError(msg)


def json_file(out: str | PathLike[str]) -> Path:
    """Return the file that was named for an answer, with an ending: its page is in the folder of its name without it.

    Raises
    ------
    OrchestratorError
        The name is that of a folder, or the page would replace that of a run.
    """
    from gossamer_orchestrator.results.files import RECORDED

    path = Path(out)
    if path.name in ("", ".."):
        msg = f"cannot write {path}: it is a folder. Name a file in it with {option('out')}."
        raise OrchestratorError(msg)
    folder = path.with_suffix("")
    if any((folder / name).is_file() for name in RECORDED):
        msg = f"the page of {path} would replace that of the run in {folder}. Name another file with {option('out')}."
        raise OrchestratorError(msg)
    return path if path.suffix else path.with_name(f"{path.name}.json")


def save_page(describe: Callable[[], Page], folder: Path) -> list[Path]:
    """Write a page into a folder, the last of what a command writes; return its path.

    Results are on the disk by then. Whatever goes wrong is a warning, and nothing is returned.
    """
    from gossamer_orchestrator.pages import PAGE, write_page

    try:
        return [write_page(describe(), folder / PAGE)]
    except Exception as error:
        logger.warning("%s was not written: %s: %s", folder / PAGE, type(error).__name__, error)
        logger.debug("where it was raised", exc_info=True)
        return []


def kinds_of(paths: Sequence[Path]) -> str:
    """Say what FMUs run in and on which platforms."""
    from gossamer_orchestrator.fmi.archive import describe_fmu

    kinds: dict[str, list[str]] = {}
    for path in dict.fromkeys(paths):
        kinds.setdefault(describe_fmu(path), []).append(path.stem)
    return "; ".join(f"{', '.join(names)} ({kind})" for kind, names in kinds.items())
