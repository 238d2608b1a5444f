"""Keep what takes long to make, compiled code above all, in the user's cache folder, so that it is made once.

A file ``<key>.<digest><suffix>`` holds content whose SHA-256 begins with its digest; a damaged one is made again. The key is
a digest of all that the content depends on. Files appear at once and whole, so several processes may make the same one. The
folder may be removed at any time.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import os
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

from gossamer_files import replacing

_DIGITS = 16

log = logging.getLogger(__name__)


def kept(depends_on: Iterable[str | bytes], suffix: str, make: Callable[[], bytes]) -> Path:
    """Return the file of some content, from the cache or newly made.

    Parameters
    ----------
    depends_on : iterable of str or bytes
        All that the content depends on.
    suffix : str
        Of the file.
    make : callable
        Returns the content; called if the cache does not have it.
    """
    key = hashlib.sha256()
    for part in depends_on:
        data = part.encode() if isinstance(part, str) else part
        key.update(len(data).to_bytes(8, "little") + data)
    name = key.hexdigest()[:_DIGITS]
    for file in cache_folder().glob(f"{name}.*{suffix}"):
        if is_whole(file):
            return file
        log.warning("%s is damaged: its SHA-256 is not the one in its name. It is made again.", file)
    content = make()
    path = cache_folder() / f"{name}.{_digest(content)}{suffix}"
    with replacing(path) as unfinished:  # another process sees all of it or nothing
        unfinished.write_bytes(content)
    return path


def is_whole(file: Path) -> bool:
    """Return whether a file is there and has the SHA-256 that its name tells."""
    try:
        return file.name.split(".")[1] == _digest(file.read_bytes())
    except OSError:
        return False


@functools.cache
def cache_folder() -> Path:
    """Return the folder of the cache, or a temporary one where that cannot be written."""
    folder = _usual_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        temporary = Path(tempfile.mkdtemp(prefix="gossamer-"))
        log.warning("compiled code cannot be kept in %s (%s); it goes to %s", folder, error.strerror, temporary)
        return temporary


def is_usual() -> bool:
    """Return whether the cache is in its usual folder."""
    return cache_folder() == _usual_folder()


def _usual_folder() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gossamer"


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:_DIGITS]
