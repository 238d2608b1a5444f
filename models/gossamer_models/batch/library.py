"""Keep compiled kernels in the user's cache folder, so that a model is compiled once.

A file ``<key>.<digest>.so`` holds a library whose SHA-256 begins with its digest; a damaged one is compiled again. The key
is a digest of all that the library depends on. Files appear at once and whole, so several processes may compile at once.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from gossamer_files import replacing

from ..compiler import FLAGS, compile_shared, compiler_version

# the numbers are the same on any processor, the instructions are not
OPTIONS = ("-march=native", "-mprefer-vector-width=512") if platform.machine() in ("x86_64", "AMD64") else ()
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
_DIGITS = 16

log = logging.getLogger(__name__)


def library(key: str, write_sources: Callable[[], Mapping[str, bytes]], what: str) -> Path:
    """Return the file of a compiled kernel, from the cache or newly compiled.

    Parameters
    ----------
    key : str
        Digest of what the sources are written from.
    write_sources : callable
        Returns the C sources by file name; called if the cache does not have the library.
    what : str
        What is compiled, for the log.

    Raises
    ------
    RuntimeError
        The compiler refused the sources.
    """
    key = hashlib.sha256("\n".join([key, compiler_version(), *FLAGS, *OPTIONS, processor()]).encode()).hexdigest()
    name = key[:_DIGITS]
    folder = cache_folder()
    for file in folder.glob(f"{name}.*{SUFFIX}"):
        if is_whole(file):
            return file
        log.warning("%s is damaged: its SHA-256 is not the one in its name. It is compiled again.", file)
    log.info("compiling the batch kernel of %s; the result is kept in %s", what, folder)
    begin = time.perf_counter()
    options = [*OPTIONS, *([] if sys.platform == "win32" else ["-lm"])]
    # zig keeps files in the user's cache folder too, and waits for ever where it cannot
    own = {} if folder == _usual_folder() else {"ZIG_GLOBAL_CACHE_DIR": str(folder / "zig")}
    content = compile_shared(write_sources(), "batch.c", f"kernel{SUFFIX}", options, f"the batch kernel of {what}", own)
    log.info("compiled the batch kernel of %s in %.1f s", what, time.perf_counter() - begin)
    return _write(folder, f"{name}.{_digest(content)}{SUFFIX}", content)


def is_whole(file: Path) -> bool:
    """Return whether a library is there and has the SHA-256 that its name tells."""
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
        log.warning("compiled kernels cannot be kept in %s (%s); they go to %s", folder, error.strerror, temporary)
        return temporary


def _usual_folder() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gossamer"


@functools.cache
def processor() -> str:
    """Return what tells this processor's instructions from those of another."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    features = {line for line in lines if line.startswith(("flags", "Features", "cpu family", "model"))}
    names = [platform.system(), platform.machine(), platform.processor(), *sorted(features)]
    return hashlib.sha256("\n".join(names).encode()).hexdigest()


def _write(folder: Path, name: str, content: bytes) -> Path:
    """Write a file whole: another process sees all of it or nothing."""
    with replacing(folder / name) as unfinished:
        unfinished.write_bytes(content)
    return folder / name


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:_DIGITS]
