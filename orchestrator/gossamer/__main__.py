"""The program ``gossamer``: the command line, its streams, and how the signals that ask for its end do end it.

They all do what Ctrl-C does: a command is interrupted, says so, and leaves whole files. After that nothing holds it up, such
as a thread that is still at work. A stream that is closed, or at whose end nobody reads any more, takes no result away.
"""

import io
import os
import signal
import sys
from contextlib import suppress
from types import FrameType
from typing import TextIO

from gossamer_files import ending_signals

INTERRUPTED = 130  # exit code
LATER = 0.003  # [s]
LOST = 60.0  # [s] after which a command that goes on is interrupted once more: C may pass over exceptions


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


def passed_over(what: "sys.UnraisableHookArgs") -> None:
    """Interrupt again where Python passes over exceptions, as in destructors, and say nothing; others are said."""
    if isinstance(what.exc_value, KeyboardInterrupt):
        interrupt_in(LATER)
    else:
        sys.__unraisablehook__(what)


def interrupt_in(seconds: float) -> None:
    """Interrupt later, but not where signals wait for the end of a block, see ``gossamer_files.holding_signals``."""

    def once_more(number: int, frame: FrameType | None) -> None:
        if signal.getsignal(signal.SIGINT) is interrupt:
            interrupt(number, frame)
        else:
            interrupt_in(LATER)

    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, once_more)
        signal.setitimer(signal.ITIMER_REAL, seconds)


class ErrorStream(io.TextIOWrapper):
    """What is told; where nobody can read it any more, as on a terminal that was closed, it goes nowhere."""

    def write(self, text: str, /) -> int:
        """Write a text, or let it and all that follows go."""
        try:
            return super().write(text)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            return len(text)


def open_streams() -> None:
    """Open the standard streams that are closed, before a file takes their numbers, and let none of stderr's errors out."""
    for number in range(3):
        with suppress(OSError):
            os.fstat(number)
            continue
        os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # it gets the least number that is free
    streams: list[TextIO | None] = [sys.stdin, sys.stdout, sys.stderr]
    if streams[0] is None:
        sys.stdin = os.fdopen(0, encoding="utf-8")
    if streams[1] is None:
        sys.stdout = os.fdopen(1, "w", encoding="utf-8")
    coding = "utf-8" if streams[2] is None else streams[2].encoding
    sys.stderr = ErrorStream(io.FileIO(2, "wb", closefd=False), coding, "backslashreplace", write_through=True)


def main() -> None:
    """Run the command line; exit with its code."""
    open_streams()
    sys.unraisablehook = passed_over
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
    except BaseException as error:
        ignore(numbers)
        if not is_interrupt(error):  # or before the command began, or again while it ended
            raise
        print("Interrupted.", file=sys.stderr)
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):
            stream.flush()
    os._exit(INTERRUPTED)


def is_interrupt(error: BaseException | None) -> bool:
    """Tell whether an interrupt ended the program, maybe as the cause of another error, as where Python makes a class."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None


def ignore(numbers: list[signal.Signals]) -> None:
    """Take no more signals: the command has ended."""
    for number in (*numbers, *([signal.SIGALRM] if hasattr(signal, "SIGALRM") else [])):
        signal.signal(number, signal.SIG_IGN)


if __name__ == "__main__":
    main()
