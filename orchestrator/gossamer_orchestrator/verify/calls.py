"""When calls of the FMU begin and end, as another process sees it.

The time limit holds for the FMU, not for the checks, so what is timed is a call. A counter in shared memory is odd during
one. The process that watches it needs nothing from this one, so it also ends a C function that hangs while it holds
Python's lock, or a process that has stopped itself.
"""

from __future__ import annotations

import mmap
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

PATIENCE = 600.0  # [s] between calls: XML of any size has been checked by then


class Calls:
    """Count the calls of an FMU.

    Parameters
    ----------
    path : Path
        File that both processes map; zero bytes to begin with, see ``Watch``.
    """

    def __init__(self, path: Path) -> None:
        with path.open("r+b") as file:
            self._counter = memoryview(mmap.mmap(file.fileno(), 8)).cast("Q")
        self._process = os.getpid()

    def make(self, function: Callable[P, R], *arguments: P.args, **options: P.kwargs) -> R:
        """Return the result of a call of the FMU; a copy of this process that it has made ends after the call."""
        self._counter[0] += 1
        try:
            return function(*arguments, **options)
        finally:
            if os.getpid() != self._process:
                os._exit(0)
            self._counter[0] += 1


class Watch:
    """Judge whether another process still makes progress.

    Parameters
    ----------
    path : Path
        File to make for its ``Calls``.
    limit : float
        Time that a call may take [s].
    """

    def __init__(self, path: Path, limit: float) -> None:
        path.write_bytes(bytes(8))
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), 8)
        self._limit = limit
        self._seen, self._since = 0, time.monotonic()

    def in_call(self) -> bool:
        """Tell whether a call has begun and not ended."""
        return int.from_bytes(self._map[:8], "little") % 2 == 1

    def is_late(self) -> bool:
        """Tell whether a call, or the pause between two, has taken too long."""
        count = int.from_bytes(self._map[:8], "little")
        if count != self._seen:
            self._seen, self._since = count, time.monotonic()
        return time.monotonic() - self._since > (self._limit if count % 2 else PATIENCE)

    def close(self) -> None:
        """Release the file."""
        self._map.close()
