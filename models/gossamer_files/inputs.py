"""The one rule of all commands: what a command reads, it does not write over, under whatever name.

A file is known by its device and number, so a link, a detour and another spelling are the same file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from os import PathLike
from os.path import realpath
from pathlib import Path

from .errors import GossamerError
from .options import option

AnyPath = str | PathLike[str]
STORE = ".zarr"  # a folder that is read as one file

_read: ContextVar[dict[tuple[int, int], Path] | None] = ContextVar("_read", default=None)  # None: nothing is kept


class OverwriteError(GossamerError, ValueError):
    """An output is an input of the same command."""


@contextmanager
def keeping(*paths: AnyPath) -> Iterator[None]:
    """Keep the files that are read in the ``with`` block, these from its beginning on, from being written over in it."""
    before = _read.set(dict(_read.get() or {}))
    try:
        keep(*paths)
        yield
    finally:
        _read.reset(before)


def keep(*paths: AnyPath) -> None:
    """Register files, or stores, as read by the command under way; what is neither, or not there, is passed over."""
    read = _read.get()
    if read is not None:
        read |= {
            number: path
            for path in map(Path, paths)
            if (number := _number(path)) and (path.is_file() or path.suffix == STORE)
        }


def followed(path: AnyPath) -> Path:
    """Return what a path names, absolute and without links; of links in a circle, which opening refuses, one of them."""
    return Path(realpath(path))


def is_pipe(path: AnyPath) -> bool:
    """Tell whether a path is a pipe with a name, which waits for whoever writes into it, maybe for ever.

    Those that a shell makes are below ``/dev``. What cannot be looked at is none.
    """
    path = Path(path)
    try:
        return not path.is_relative_to("/dev") and path.is_fifo()
    except OSError:
        return False


def _number(path: Path) -> tuple[int, int] | None:
    """Return device and number of a file or a folder; None if it is not there."""
    try:
        found = path.stat()
    except (FileNotFoundError, NotADirectoryError, PermissionError, ValueError):  # what no system has is an error
        return None
    return found.st_dev, found.st_ino


def check_outputs(outputs: Iterable[AnyPath | None]) -> None:
    """Refuse files and folders to write that are read, or lie in what is read; None is passed over.

    Raises
    ------
    OverwriteError
        An output is an input.
    """
    read = _read.get() or {}
    for output in [Path(each) for each in outputs if each is not None] if read else ():
        for place in (output, *followed(output).parents):
            if given := read.get(_number(place) or (0, 0)):
                msg = f"{output} would overwrite {given}, which is an input. Name another place with {option('out')}."
                raise OverwriteError(msg)
