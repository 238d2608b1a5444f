"""Files: written whole, so that who reads one finds the old content or the new, and why one cannot be read.

Models, FMUs and orchestrator use it, which may not import each other. ``measured`` reads measured tables.
"""

from __future__ import annotations

import errno
import logging
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from glob import escape
from pathlib import Path
from types import FrameType
from typing import Any

from .errors import DataError as DataError
from .errors import GossamerError as GossamerError
from .errors import NotFiniteError as NotFiniteError
from .errors import exit_code as exit_code
from .inputs import check_outputs, followed, is_pipe
from .locks import lock

STALE = 3600.0  # [s] without a change: its writer was killed
logger = logging.getLogger(__name__)

PATIENCE = 100  # tries, ten a second, to be alone in a folder


MIXED = ".unfinished_build"  # in a folder of FMUs: names of those that a killed build may have left mixed


def digest(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal digits."""
    import hashlib  # with OpenSSL, which takes long to load

    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write a file under another name, which takes its place when the ``with`` block ends well, see ``replacing_all``."""
    with replacing_all([path]) as (unfinished,):
        yield unfinished


@contextmanager
def replacing_all(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Write files under other names, which take their places together when the ``with`` block ends well.

    Parameters
    ----------
    paths : sequence of Path
        The files; their folders are made if needed. A link is followed; a device is written to directly.

    Yields
    ------
    list of Path
        Where to write: the same folders and endings. A process that is killed leaves this file; it begins with a dot, and
        a later writer of the same file removes it.

    Raises
    ------
    OSError
        One cannot be written; what was there is still there.
    OverwriteError
        The command under way reads one of them.
    """
    check_outputs(paths)
    targets = [followed(path) for path in paths]
    unfinished = [_unfinished(target) for target in targets]
    waiting = [pair for pair in zip(unfinished, targets, strict=True) if pair[0] != pair[1]]
    try:
        yield unfinished
        for place, _ in waiting:
            with place.open("rb+") as file:
                os.fsync(file.fileno())
        for place, target in waiting:
            place.replace(target)
    except OSError as error:
        named = dict(zip(map(str, unfinished), map(str, paths), strict=True))
        if error.filename in named:
            error.filename = named[error.filename]
        raise
    finally:
        for place, _ in waiting:
            place.unlink(missing_ok=True)


def _unfinished(target: Path) -> Path:
    """Return where to write a file, whose folder is made, or the file itself where it is none: a device or a folder."""
    if target.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(target))
    if target.exists() and not target.is_file():
        return target
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(target))
    target.parent.mkdir(parents=True, exist_ok=True)
    for left in unfinished_of(target):
        with suppress(FileNotFoundError):  # another process removes it, too
            if time.time() - left.stat().st_mtime > STALE:
                left.unlink()
    return target.with_name(f".{_short(target)}.{os.urandom(4).hex()}.unfinished{target.suffix}")


def ending_signals() -> list[signal.Signals]:
    """List the signals of this system that ask this program to end.

    Under nohup SIGHUP does not. SIGINT does, though a shell lets what runs in its background ignore it.
    """
    there = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    return [number for number in there if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN]


@contextmanager
def uninterrupted(folder: Path) -> Iterator[None]:
    """Hold signals as ``holding_signals`` does, while files of a folder change together.

    Another command that changes this folder waits too, where file systems have locks, but no longer than ten seconds.
    """
    with _locked(folder), holding_signals():
        yield


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    folder.mkdir(parents=True, exist_ok=True)
    handle, left = None, PATIENCE if os.access(folder, os.R_OK) else 0  # else it may be written, but not locked
    while handle is None and left:
        try:
            handle = lock(folder)
        except BlockingIOError:
            time.sleep(0.1)
            left -= 1
            if not left:
                logger.warning("another command has kept %s for a while; this one goes on beside it.", folder)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


@contextmanager
def holding_signals() -> Iterator[None]:
    """Let a signal that asks for the end wait for that of the ``with`` block."""
    held: list[tuple[int, FrameType | None]] = []
    numbers = ending_signals() if threading.current_thread() is threading.main_thread() else []
    handlers = {number: handler for number in numbers if callable(handler := signal.getsignal(number))}
    try:
        for number in handlers:
            signal.signal(number, lambda *which: held.append(which))
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    for which, frame in held[:1]:
        handlers[signal.Signals(which)](which, frame)


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8 as ``replacing`` does."""
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def write_archive(path: Path, members: Mapping[str, bytes]) -> None:
    """Write files, given by name, as a ZIP archive that depends on nothing but its content, whole or not at all."""
    import zipfile  # slow to load

    with replacing(path) as unfinished, zipfile.ZipFile(unfinished, "w") as archive:
        for name, content in members.items():
            member = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            member.compress_type = zipfile.ZIP_STORED if name.endswith(".fmu") else zipfile.ZIP_DEFLATED
            member.external_attr = 0o644 << 16
            member.create_system = 3
            archive.writestr(member, content)


def as_json(value: Any, otherwise: Callable[[Any], Any] | None = None) -> Any:  # noqa: ANN401
    """Return a value as JSON can hold it: what is not finite is null, a data class is a mapping.

    ``otherwise`` is called with whatever else JSON does not know; by default arrays become lists, and paths texts.
    """
    if is_dataclass(value):
        value = {each.name: getattr(value, each.name) for each in fields(value)}
    if isinstance(value, Mapping):
        return {str(name): as_json(each, otherwise) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(each, otherwise) for each in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    if otherwise is not None:
        return otherwise(value)
    return as_json(value.tolist()) if hasattr(value, "tolist") else str(value)


def read_json(path: Path) -> Any:  # noqa: ANN401
    """Return the content of a JSON file in UTF-8, whose numbers are finite, or else raise ``NotFiniteError``."""
    import json

    def number(text: str) -> float:
        value = float(text.replace("Infinity", "inf"))
        if not math.isfinite(value):
            msg = f"it holds {text}, which is not finite"
            raise NotFiniteError(msg)
        return value

    if is_pipe(path):
        msg = "it is a pipe"
        raise OSError(msg)
    return json.loads(path.read_text(encoding="utf-8"), parse_constant=number, parse_float=number)


def unfinished_of(path: Path) -> list[Path]:
    """List what writers of a file are writing, or had written when they were killed."""
    return list(path.parent.glob(f".{escape(_short(path))}.*.unfinished{escape(path.suffix)}"))


def _short(path: Path) -> str:
    """Return the stem of a file, cut so that a name with 21 bytes more is no longer than file systems take."""
    return os.fsencode(path.stem)[: max(0, 233 - len(os.fsencode(path.suffix)))].decode(errors="ignore")


def reason(error: Exception) -> str:
    """Say in words why a file cannot be read."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror[0].lower() + error.strerror[1:]
    if isinstance(error, UnicodeDecodeError):
        return "it is no text in UTF-8"
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, KeyError):
        return f"it lacks {error}"
    return str(error) or type(error).__name__
