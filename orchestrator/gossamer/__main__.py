"""The program ``gossamer``: the command line, and how the signals that ask for its end do end it.

They all do what Ctrl-C does: a command is interrupted, says so, and leaves whole files. After that nothing holds it up, such
as a thread that is still at work.
"""

import os
import signal
import sys
from contextlib import suppress
from types import FrameType

from gossamer_files import ending_signals

INTERRUPTED = 130  # exit code
LATER = 0.003  # [s]
LOST = 60.0  # [s] after which a command that goes on is interrupted once more: destructors pass over exceptions


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise ``KeyboardInterrupt``, but later inside CasADi: its C++ calls Python, and loses exceptions, or crashes."""
    there = frame
    while there is not None and hasattr(signal, "setitimer"):
        if there.f_code.co_filename.endswith("casadi.py"):
            interrupt_in(LATER)
            return
        there = there.f_back
    if number in ending_signals():  # not by the clock
        interrupt_in(LOST)
    signal.default_int_handler(number, frame)


def interrupt_in(seconds: float) -> None:
    """Interrupt later, but not where signals wait for the end of a block, see ``gossamer_files.uninterrupted``."""

    def once_more(number: int, frame: FrameType | None) -> None:
        if signal.getsignal(signal.SIGINT) is interrupt:
            interrupt(number, frame)
        else:
            interrupt_in(LATER)

    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, once_more)
        signal.setitimer(signal.ITIMER_REAL, seconds)


def main() -> None:
    """Run the command line; exit with its code."""
    numbers = ending_signals()
    for number in numbers:
        signal.signal(number, interrupt)
    try:
        from .cli import main as command_line

        command_line()
    except SystemExit as end:
        ignore(numbers)
        if end.code != INTERRUPTED:
            raise
    except KeyboardInterrupt:  # before the command began, or again while it ended
        ignore(numbers)
        print("Interrupted.", file=sys.stderr)
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):
            stream.flush()
    os._exit(INTERRUPTED)


def ignore(numbers: list[signal.Signals]) -> None:
    """Take no more signals: the command has ended."""
    for number in (*numbers, *([signal.SIGALRM] if hasattr(signal, "SIGALRM") else [])):
        signal.signal(number, signal.SIG_IGN)


if __name__ == "__main__":
    main()
