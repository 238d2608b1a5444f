"""Lock a folder, so that one command at a time changes its files."""

from __future__ import annotations

import os
import sys
from pathlib import Path

if sys.platform == "win32":
    import msvcrt

    def lock(folder: Path, *, needed: bool = False) -> int:  # noqa: ARG001 every file system there has locks
        """Lock a folder by a file that disappears when it is closed; raise ``BlockingIOError`` if another process has it."""
        handle = None
        try:
            handle = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT | os.O_TEMPORARY)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except PermissionError as error:
            if handle is not None:
                os.close(handle)
            raise BlockingIOError from error
        return handle

else:
    import fcntl

    def lock(folder: Path, *, needed: bool = False) -> int:
        """Lock a folder; raise ``BlockingIOError`` if another process has it, or may have it where the lock is needed."""
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW * needed)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if isinstance(error, BlockingIOError) or needed:
                os.close(handle)
                raise BlockingIOError from error
        return handle  # without a lock on a file system that has none
