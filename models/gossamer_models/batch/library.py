"""Compile kernels for this machine's processor; see ``compiler`` for where they stay."""

from __future__ import annotations

import functools
import hashlib
import platform
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from ..compiler import compile_shared, kept_library

# the numbers are the same on any processor, the instructions are not
OPTIONS = ("-march=native", "-mprefer-vector-width=512") if platform.machine() in ("x86_64", "AMD64") else ()
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


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
    CompilerError
        The compiler refused the sources.
    """
    what = f"the batch kernel of {what}"
    options = [*OPTIONS, *([] if sys.platform == "win32" else ["-lm"])]

    def compile_it() -> bytes:
        return compile_shared(write_sources(), "batch.c", f"kernel{SUFFIX}", options, what)

    return kept_library([key, *options, processor()], SUFFIX, compile_it, what)


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
