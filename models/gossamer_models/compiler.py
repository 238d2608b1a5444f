"""Run zig, the C compiler of every platform.

One compiler for all platforms keeps the numbers the same: IEEE arithmetic in the order of the expressions, no contraction
to fused multiply-adds, no reordering. Only functions such as ``sin`` come from the C library of each platform.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from .errors import CompilerError
from .kept import cache_folder, is_usual, kept

PACKAGE = "ziglang==0.17.0"  # as in pyproject.toml
FLAGS = (
    "-std=c11",
    "-O2",
    "-fPIC",
    "-fvisibility=hidden",
    "-ffp-contract=off",
    "-fno-math-errno",  # inline square roots; no code reads errno
)

log = logging.getLogger(__name__)


def has_compiler() -> bool:
    """Return whether the compiler is installed."""
    return find_spec("ziglang") is not None


def require_compiler(what: str) -> None:
    """Raise ``ModuleNotFoundError`` if the compiler that ``what`` (plural) need is not installed."""
    if not has_compiler():
        msg = f"{what} need the compiler ziglang. Install it with: pip install {PACKAGE}"
        raise ModuleNotFoundError(msg)


def compiler_version() -> str:
    """Return the version of the compiler, for example 0.17.0."""
    return version("ziglang")


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

    def make() -> bytes:
        log.info("compiling %s; the result is kept in %s", what, cache_folder())
        begin = time.perf_counter()
        content = compile_it()
        log.info("compiled %s in %.1f s", what, time.perf_counter() - begin)
        return content

    return kept([compiler_version(), *FLAGS, *depends_on], suffix, make)


def compile_shared(
    files: Mapping[str, bytes],
    source: str,
    library: str,
    options: Sequence[str],
    what: str,
) -> bytes:
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
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name, content in files.items():
            (folder / name).write_bytes(content)
        compiler = [sys.executable, "-m", "ziglang", "cc", *FLAGS, *options]
        # zig keeps files in the user's cache folder too, and waits for ever where it cannot
        own = {} if is_usual() else {"ZIG_GLOBAL_CACHE_DIR": str(cache_folder() / "zig")}
        command = [*compiler, "-g0", "-s", "-shared", "-o", library, source]
        done = subprocess.run(
            command,
            cwd=folder,
            env={**os.environ, **own},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            how = done.stderr[-2000:].strip() or f"it ended with code {done.returncode}; the disk may be full"
            msg = f"the compiler failed for {what}:\n{how}"
            raise CompilerError(msg)
        return (folder / library).read_bytes()
