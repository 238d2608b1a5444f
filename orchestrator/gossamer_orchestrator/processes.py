"""Processes in which FMUs run: what an FMU starts in one of them is found again and ends with it.

Memory that such a process shares with the one that watches it tells where it was when it died, or hangs.
"""

from __future__ import annotations

import mmap
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

_TEMPORARY = ("TMPDIR", "TEMP", "TMP")
_ROUNDS = 100


def start(
    program: Callable[..., object],
    *arguments: str,
    mark: Path | None = None,
    **options: Any,  # noqa: ANN401
) -> subprocess.Popen[Any]:
    """Start a function of a module as a program, in a session of its own: Ctrl-C in a terminal is for this process.

    Parameters
    ----------
    program : callable
        Called with the arguments, and nothing after it.
    *arguments : str
        What it is called with.
    mark : Path or None
        Its folder for temporary files, of one process only, which marks all its descendants.
    **options
        Of ``subprocess.Popen``.
    """
    module, name = program.__module__, program.__qualname__
    code = f"import sys; from {module} import {name}; {name}(*sys.argv[1:])"
    paths = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    marks = {} if mark is None else dict.fromkeys(_TEMPORARY, str(mark))
    return subprocess.Popen(
        [sys.executable, "-P", "-c", code, *arguments], env=os.environ | paths | marks, start_new_session=True, **options
    )


def end_all(process: subprocess.Popen[Any], mark: Path) -> int:
    """End a process, if it still runs, and everything that it has started.

    Parameters
    ----------
    process : subprocess.Popen
        As ``start`` gave it, the leader of its group.
    mark : Path
        Its mark: a daemon has left the group.

    Returns
    -------
    int
        Number of the others that were ended; 0 where the system does not list them.
    """
    if sys.platform == "win32":  # while it lives, its own processes are known there
        subprocess.run(["taskkill", "/T", "/F", "/PID", str(process.pid)], capture_output=True, check=False)
    process.kill()
    process.wait()
    if sys.platform == "win32":
        return 0
    ended: set[int] = set()
    entry = f"{_TEMPORARY[0]}={mark}".encode()
    for _ in range(_ROUNDS):  # one may start another meanwhile
        found = set()
        for file in Path("/proc").glob("[0-9]*/environ"):
            with suppress(OSError):
                if entry in file.read_bytes().split(b"\0"):
                    found.add(int(file.parent.name))
        with suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
        if not found:
            break
        for other in found:
            with suppress(OSError):
                os.kill(other, signal.SIGKILL)
        ended |= found
    return len(ended)


def signal_name(code: int) -> str:
    """Name the signal that ended a process with an exit code below 0."""
    return next((each.name for each in signal.Signals if each == -code), f"signal {-code}")  # some have no name


def shared_memory(path: Path, size: int, *, new: bool = False) -> mmap.mmap:
    """Map a file of so many bytes, which may be made new, of zeros."""
    if new:
        path.write_bytes(bytes(size))
    with path.open("r+b", buffering=0) as file:
        file.seek(size)  # Python keeps it open, and an FMU may write to every open file
        return mmap.mmap(file.fileno(), size)
