"""Signals that ask a run to end: they wait for the end of the present step."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from .position import STOP, Position


def ending_signals() -> list[signal.Signals]:
    """List the signals of this system that ask this program to end.

    Under nohup SIGHUP does not. SIGINT does, though a shell lets what runs in its background ignore it.
    """
    there = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    return [number for number in there if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN]


@contextmanager
def deferred_interrupt(position: Position) -> Iterator[None]:
    """Let Ctrl-C and the signals that ask for the end stop the run after the present step; a second one acts at once."""
    previous = {number: signal.getsignal(number) for number in ending_signals()}

    def remember(_signal: int, _frame: FrameType | None) -> None:
        position[STOP] = 1
        restore()

    def restore() -> None:
        for number, handler in previous.items():
            with suppress(TypeError, ValueError):
                signal.signal(number, handler)

    with suppress(ValueError):  # only the main thread can handle signals
        for number in previous:
            signal.signal(number, remember)
    try:
        yield
    finally:
        restore()
