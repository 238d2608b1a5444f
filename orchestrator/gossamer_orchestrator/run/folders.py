"""Folders that one run has for itself: that of its results, and a temporary one that nothing is left of.

The locks are the operating system's: they end with the process, however it ends. A temporary folder has a mark, so that only
what is one, and has no lock any more, is removed.
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

_PREFIX, _MARK = "gossamer-run-", ".gossamer-scratch"

if sys.platform == "win32":
    import msvcrt

    def _lock(folder: Path, *, needed: bool = False) -> int:  # noqa: ARG001 every file system there has locks
        """Lock a folder by a file that disappears when it is closed; raise ``BlockingIOError`` if another process has it."""
        try:
            handle = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT | os.O_TEMPORARY)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except PermissionError as error:
            raise BlockingIOError from error
        return handle

else:
    import fcntl

    def _lock(folder: Path, *, needed: bool = False) -> int:
        """Lock a folder; raise ``BlockingIOError`` if another process has it, or may have it where the lock is needed."""
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW * needed)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if isinstance(error, BlockingIOError) or needed:
                os.close(handle)
                raise BlockingIOError from error
        return handle  # without a lock on a file system that has none


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
        except (FileNotFoundError, BlockingIOError):  # of an earlier version, which has just swept it
            continue
        (folder / _MARK).touch()
        break
    try:
        yield folder
    finally:
        os.close(handle)
        shutil.rmtree(folder, ignore_errors=True)


def _sweep() -> None:
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with suppress(OSError):
            if (folder / _MARK).is_file():
                handle = _lock(folder, needed=True)
                shutil.rmtree(folder, ignore_errors=True)
                os.close(handle)
