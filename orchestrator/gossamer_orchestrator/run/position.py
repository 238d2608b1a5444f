"""Where a run stands, in memory that another process can read, and the signals that ask it to end.

Eleven integers. The process of a run writes them before it calls an FMU, so that whoever watches it can say which FMU was
called when the process died, or hangs. A write costs some 30 ns. A signal waits for the end of the present step.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from gossamer_files import ending_signals

from ..processes import shared_memory

TICK, PART, COMPONENT, CALL, ROWS, FIRST, DIVIDED, STOP, AT_ONCE, RETURNED, NOT_FINITE = range(11)
"""Step under way; its part; number of the component whose FMU is called, -1 for none; what it is called for; rows recorded;
number of the first of them that waits in memory; steps that were divided; 1 if the run should stop; how many components from
that number on are called at once, 0 for one; how many of them have returned; how many had values that are not finite."""

INSTANTIATE, INITIALIZE, STEP, FREE = range(4)
_CALLS = ("when it was instantiated", "in its initialization", "in the step from", "when it was freed")
_SIZE = 88  # bytes

Position = memoryview  # of signed integers


def open_position(path: Path | None = None, *, new: bool = False) -> Position:
    """Open the position in a file, which may be made new; without a file return one that only this process sees."""
    position = memoryview(bytearray(_SIZE) if path is None else shared_memory(path, _SIZE, new=new)).cast("q")
    if new or path is None:
        position[COMPONENT] = -1
    return position


def describe(position: Position, seconds: float, names: Sequence[str]) -> tuple[str, str]:
    """Return the component that is called, and for what; "" and "" for none.

    Parameters
    ----------
    position : Position
        Where the run stands.
    seconds : float
        Time of the step under way [s].
    names : sequence of str
        Names of the components by number.
    """
    number, call = position[COMPONENT], position[CALL]
    if not 0 <= number < len(names):
        return "", ""
    called = " or ".join(names[number : number + max(position[AT_ONCE], 1)])
    return called, f"{_CALLS[call]}{f' t = {seconds:.9g} s' if call == STEP else ''}"


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
