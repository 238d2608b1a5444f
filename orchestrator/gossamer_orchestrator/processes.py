"""Processes in which FMUs run: what an FMU starts in one of them is found again and ends with it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

_TEMPORARY = ("TMPDIR", "TEMP", "TMP")
_ROUNDS = 100


def marked(folder: Path) -> dict[str, str]:
    """Return an environment whose folder for temporary files, of one process only, marks all its descendants."""
    return os.environ | dict.fromkeys(_TEMPORARY, str(folder))


def end_all(process: subprocess.Popen[bytes], folder: Path) -> int:
    """End a process that leads its group, if it still runs, and everything that it has started.

    Parameters
    ----------
    process : subprocess.Popen
        Started with ``marked(folder)`` in a session of its own.
    folder : Path
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
    mark = f"{_TEMPORARY[0]}={folder}".encode()
    for _ in range(_ROUNDS):  # one may start another meanwhile
        found = set()
        for file in Path("/proc").glob("[0-9]*/environ"):
            with suppress(OSError):
                if mark in file.read_bytes().split(b"\0"):
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
