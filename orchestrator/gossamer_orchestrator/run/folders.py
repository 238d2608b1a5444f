"""Folders that one run has for itself: that of its results, and a temporary one that nothing is left of.

The locks are the operating system's: they end with the process, however it ends.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gossamer_files import unfinished_of
from gossamer_files.options import option

from ..errors import ResultsError
from ..results.files import CSV, NETCDF, RESUME

_PREFIX = "gossamer-run-"

if sys.platform == "win32":
    import msvcrt

    def _lock(folder: Path) -> int:
        """Lock a folder by a file that disappears when it is closed; raise ``BlockingIOError`` if another process has it."""
        try:
            handle = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT | os.O_TEMPORARY)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except PermissionError as error:
            raise BlockingIOError from error
        return handle

else:
    import fcntl

    def _lock(folder: Path) -> int:
        """Lock a folder; raise ``BlockingIOError`` if another process has it."""
        handle = os.open(folder, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            raise
        except OSError:  # a file system without locks
            pass
        return handle


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Have a folder of results for the ``with`` block, and remove what a killed run left half written.

    Raises
    ------
    ResultsError
        Another run has it.
    """
    try:
        handle = _lock(folder)
    except BlockingIOError:
        msg = f"another run writes to {folder}. Wait for its end, or name another place with {option('out')}."
        raise ResultsError(msg) from None
    try:
        for name in (NETCDF, CSV, RESUME):
            for left in unfinished_of(folder / name):
                left.unlink(missing_ok=True)
        yield
    finally:
        os.close(handle)


@contextmanager
def scratch() -> Iterator[Path]:
    """Make a temporary folder for the ``with`` block, and remove those that killed runs left."""
    _sweep()
    while True:
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
        try:
            handle = _lock(folder)
        except OSError:  # another process has just swept it
            continue
        break
    try:
        yield folder
    finally:
        os.close(handle)
        shutil.rmtree(folder, ignore_errors=True)


def _sweep() -> None:
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with suppress(OSError):
            handle = _lock(folder)
            shutil.rmtree(folder, ignore_errors=True)
            os.close(handle)
