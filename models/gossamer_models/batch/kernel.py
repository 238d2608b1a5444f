"""Compile a kernel for this machine's processor and call it: the Python side of ``batch.c``."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import platform
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Matrix
from ..compiler import compile_shared, is_whole, kept_library
from ..errors import StateError
from .cases import Cube

LANES = 8
# the numbers are the same on any processor, the instructions are not
_WIDE = ("-march=native", "-mprefer-vector-width=512") if platform.machine() in ("x86_64", "AMD64") else ()
# functions of thousands of lines, each with its own "if (res[0])", would take the optimiser three times as long
OPTIONS = (*_WIDE, "-mllvm", "-jump-threading-threshold=0")
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
_DOUBLES = ctypes.POINTER(ctypes.c_double)


class _Record(ctypes.Structure):
    _fields_ = (("input", ctypes.c_int64), ("stride", ctypes.c_int64), ("values", _DOUBLES))


class _Run(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int64) for name in ("cases", "steps", "every", "n_records", "starts")),
        ("h", ctypes.c_double),
        ("records", ctypes.POINTER(_Record)),
        *((name, _DOUBLES) for name in ("p", "u", "x", "y", "initial", "results")),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """The arrays of a run, one row per case, contiguous.

    Attributes
    ----------
    steps, every : int
        Number of steps, and how many make one column of ``results``.
    h : float
        Step [s].
    records : sequence of (int, ndarray, shape (1, steps) or (cases, steps))
        Place among the inputs, and values, of each input that varies.
    starts : bool
        Whether the cases begin with their initialization; else they go on from ``x`` and ``y``.
    p, u : ndarray, shape (cases, n)
        Parameters and inputs.
    x, y : ndarray, shape (cases, n)
        States, and recorded results and step limit; hold the end of the run afterwards, as ``u`` does.
    initial : ndarray, shape of y
        Filled with ``y`` before the first step.
    results : ndarray, shape (cases, number of results, steps // every)
        Filled with the recorded results.
    """

    steps: int
    every: int
    h: float
    records: Sequence[tuple[int, Matrix]]
    starts: bool
    p: Matrix
    u: Matrix
    x: Matrix
    y: Matrix
    initial: Matrix
    results: Cube


class Kernel:
    """A compiled kernel.

    Parameters
    ----------
    file : Path
        The library.
    compiled_for : str or None
        Processor, see ``processor``; None for this machine's.
    """

    def __init__(self, file: Path, compiled_for: str | None = None) -> None:
        self._file, self._processor = file, compiled_for or processor()
        if self._processor != processor() or not is_whole(file):
            advice = "Make the Batch on this machine."
            msg = f"the compiled kernel {file} is not on this machine, is damaged, or is for another processor. {advice}"
            raise StateError(msg)
        library = ctypes.CDLL(str(file))
        self._run_blocks, memory_size = library.run_blocks, library.memory_size
        self._run_blocks.argtypes = (ctypes.POINTER(_Run), ctypes.c_char_p, ctypes.c_int64, ctypes.c_int64)
        self._run_blocks.restype, memory_size.restype = None, ctypes.c_int64
        self._memory_size = memory_size()

    def __reduce__(self) -> tuple[type[Kernel], tuple[Path, str]]:
        return Kernel, (self._file, self._processor)

    def run(self, task: Task, workers: int) -> None:
        """Fill the arrays of a run, blocks of eight cases in parallel threads.

        An interrupt waits for one block each, a second one too: C must not write into arrays that nobody has any more.
        """
        cases = len(task.x)
        records = (_Record * len(task.records))(
            *(_Record(place, 0 if len(values) == 1 else task.steps, _at(values)) for place, values in task.records)
        )
        arrays = (_at(a) for a in (task.p, task.u, task.x, task.y, task.initial, task.results))
        run = _Run(cases, task.steps, task.every, len(task.records), task.starts, task.h, records, *arrays)
        blocks = iter(range(-(-cases // LANES)))

        def work(_held: object = (task, records)) -> None:  # while a thread works, wherever an interrupt has led its caller
            memory = ctypes.create_string_buffer(self._memory_size)
            for i in blocks:  # shared by the threads
                self._run_blocks(ctypes.byref(run), memory, i, i + 1)  # without the interpreter's lock

        threads = min(workers, len(range(0, cases, LANES)))
        if threads == 1:
            work()
            return
        interrupt = None
        with ThreadPoolExecutor(threads) as pool:
            working: list[Future[None]] = []
            while len(working) < threads or not all(each.done() for each in working):
                try:
                    while len(working) < threads:
                        working.append(pool.submit(work))
                    wait(working)
                except KeyboardInterrupt as error:
                    interrupt = error
                    for _ in blocks:  # leave the threads nothing to do
                        pass
        if interrupt is not None:
            raise interrupt
        for each in working:
            each.result()  # an error of its own


def _at(array: Cube) -> ctypes._Pointer[ctypes.c_double]:
    if not (array.flags.c_contiguous and array.dtype == np.float64):
        msg = "the arrays of a run must be contiguous doubles"
        raise TypeError(msg)
    return array.ctypes.data_as(_DOUBLES)


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
