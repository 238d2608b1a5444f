"""Run zig, the C compiler of every platform.

One compiler for all platforms keeps the numbers the same: IEEE arithmetic in the order of the expressions, no contraction
to fused multiply-adds, no reordering. Only functions such as ``sin`` come from the C library of each platform.

What was compiled is kept in the user's cache folder, so that it is made once. A file ``<key>.<digest><suffix>`` holds
content whose SHA-256 begins with its digest; a damaged one is made again. The key is a digest of all that the content
depends on. Files appear at once and whole, so several processes may make the same one. The folder may be removed.
"""

import functools
import hashlib
import logging
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from threading import Lock

from gossamer_files import replacing

from .errors import CompilerError

PACKAGE = "ziglang==0.17.0"  # as in pyproject.toml
FLAGS = (
    "-std=c11",
    "-O2",
    "-fPIC",
    "-fvisibility=hidden",
    "-ffp-contract=off",
    "-fno-math-errno",  # inline square roots; no code reads errno
)

_DIGITS = 16

log = logging.getLogger(__name__)
_making: dict[str, Lock] = {}


def has_compiler() -> bool:
    """Return whether the compiler is installed."""
    return find_spec("ziglang") is not None


def require_compiler(what: str) -> None:
    """Raise ``ModuleNotFoundError`` if the compiler that ``what`` (plural) need is not installed."""
    if not has_compiler():
        msg = f"{what} need the compiler ziglang. Install it with: pip install {PACKAGE}"
        raise ModuleNotFoundError(msg)


def kept_library(depends_on: Iterable[str | bytes], suffix: str, compile_it: Callable[[], bytes], what: str) -> Path:
    """Return the file of a library, from the cache or newly compiled.

    Parameters
    ----------
    depends_on : iterable of str or bytes
        All that the library depends on beside ``FLAGS`` and the compiler.
    suffix : str
        Of the file.
    compile_it : callable
        Returns the library; called if the cache does not have it.
    what : str
        What is compiled, for the log.
    """
    key = hashlib.sha256()
    for part in [version("ziglang") if has_compiler() else "", *FLAGS, *depends_on]:
        data = part.encode() if isinstance(part, str) else part
        key.update(len(data).to_bytes(8, "little") + data)
    name = key.hexdigest()[:_DIGITS]
    with _making.setdefault(name, Lock()):  # threads that want the same wait for the first
        return _kept(name, suffix, compile_it, what)


def _kept(name: str, suffix: str, compile_it: Callable[[], bytes], what: str) -> Path:
    for file in cache_folder().glob(f"{name}.*{suffix}"):
        if is_whole(file):
            return file
        log.warning("%s is damaged: its SHA-256 is not the one in its name. It is made again.", file)
    log.info("compiling %s; the result is kept in %s", what, cache_folder())
    begin = time.perf_counter()
    content = compile_it()
    log.info("compiled %s in %.1f s", what, time.perf_counter() - begin)
    path = cache_folder() / f"{name}.{_digest(content)}{suffix}"
    with replacing(path) as unfinished:  # another process sees all of it or nothing
        unfinished.write_bytes(content)
    return path


def compile_shared(files: Mapping[str, bytes], source: str, library: str, options: Sequence[str], what: str) -> bytes:
    """Compile C sources to a shared library.

    Parameters
    ----------
    files : mapping
        Sources and headers by file name.
    source : str
        The file to compile, which includes the others.
    library : str
        File name of the library, which Windows stores in it.
    options : sequence of str
        Options of the compiler beside ``FLAGS``.
    what : str
        What is compiled, or for what, for the message.

    Returns
    -------
    bytes
        The library; the same sources, options and compiler give the same bytes.

    Raises
    ------
    CompilerError
        The compiler is not installed or refused the sources; its message is quoted.
    """
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name, content in files.items():
            (folder / name).write_bytes(content)
        compiler = [sys.executable, "-m", "ziglang", "cc", *FLAGS, *options]
        # zig keeps files in the user's cache folder too, and waits for ever where it cannot
        own = {} if cache_folder() == _usual_folder() else {"ZIG_GLOBAL_CACHE_DIR": str(cache_folder() / "zig")}
        command = [*compiler, "-g0", "-s", "-shared", "-o", library, source]
        done = subprocess.run(command, cwd=folder, env={**os.environ, **own}, capture_output=True, text=True, check=False)
        if done.returncode:
            how = done.stderr[-2000:].strip() or f"it ended with code {done.returncode}; the disk may be full"
            msg = f"the compiler failed for {what}:\n{how}"
            raise CompilerError(msg)
        return (folder / library).read_bytes()


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


def _usual_folder() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gossamer"


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:_DIGITS]
