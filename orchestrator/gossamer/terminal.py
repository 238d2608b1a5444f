"""What is said while a command works: progress on stderr, and sentences that the command line alone prints."""

from __future__ import annotations

import logging
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gossamer_orchestrator import ProgressBar
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
