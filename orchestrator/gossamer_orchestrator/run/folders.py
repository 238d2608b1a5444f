"""Folders that one run has for itself: that of its results, and a temporary one that nothing is left of.

The locks are the operating system's: they end with the process, however it ends. A temporary folder has a mark, so that only
what is one, and has no lock any more, is removed.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gossamer_files import unfinished_of
from gossamer_files.locks import lock
from gossamer_files.options import option

from ..errors import ResultsError
from ..results.files import CSV, NETCDF, RESUME

_PREFIX, _MARK = "gossamer-run-", ".gossamer-scratch"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Have a folder of results for the ``with`` block, and remove what a killed run left half written.

    Raises
    ------
    ResultsError
        Another run has it.
    """
    try:
        handle = lock(folder)
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
            handle = lock(folder)
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
                handle = lock(folder, needed=True)
                shutil.rmtree(folder, ignore_errors=True)
                os.close(handle)
