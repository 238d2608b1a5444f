"""Where a run stands, in memory that another process can read.

Ten integers. The process of a run writes them before it calls an FMU, so that whoever watches it can say which FMU was
called when the process died, or hangs. A write costs some 30 ns.
"""

from __future__ import annotations

import mmap
from collections.abc import Sequence
from pathlib import Path

TICK, PART, COMPONENT, CALL, ROWS, FIRST, DIVIDED, STOP, AT_ONCE, RETURNED = range(10)
"""Step under way; its part; number of the component whose FMU is called, -1 for none; what it is called for; rows recorded;
number of the first of them that waits in memory; steps that were divided; 1 if the run should stop; how many components from
that number on are called at once, 0 for one; how many of them have returned."""

INSTANTIATE, INITIALIZE, STEP, FREE = range(4)
_CALLS = ("when it was instantiated", "in its initialization", "in the step from", "when it was freed")
_SIZE = 80  # bytes

Position = memoryview  # of signed integers


def new_position() -> Position:
    """Return a position that only this process sees."""
    position = memoryview(bytearray(_SIZE)).cast("q")
    position[COMPONENT] = -1
    return position


def open_position(path: Path, *, new: bool = False) -> Position:
    """Open the position in a file, which may be made new."""
    if new:
        path.write_bytes(new_position().tobytes())
    with path.open("r+b") as file:
        return memoryview(mmap.mmap(file.fileno(), _SIZE)).cast("q")


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
