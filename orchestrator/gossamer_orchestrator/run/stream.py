"""Write the rows of a run to the disk as they come, and the state to resume from.

Rows wait in memory that another process can read: when an FMU ends the process of a run, whoever watches it writes those
that wait. They wait half a second, or until they fill that memory.
"""

from __future__ import annotations

import logging
import mmap
import os
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from gossamer_files.options import option
from numpy.typing import NDArray

from ..errors import ResultsError, writing
from ..results.columns import attributes, plan_columns
from ..results.files import NETCDF, RESUME, UNFINISHED_NETCDF, has_rows
from ..results.netcdf import GrowingFile, Layout, make_file
from ..scenario.plan import Plan
from . import checkpoint
from .position import DIVIDED, FIRST, ROWS
from .recorder import Recorder

if TYPE_CHECKING:
    from .master import Simulation

logger = logging.getLogger(__name__)

WAIT = 0.5  # [s] that a row waits at most
_SHARE = 50  # a state is saved after so many times the time that saving it takes
_BYTES = 1_000_000  # of the rows that wait


class Shared(NamedTuple):
    """What another process needs to write the rows that wait: the file's layout, and the shape of their table."""

    layout: Layout
    shape: tuple[int, int]


def open_rows(path: Path, shape: tuple[int, int], *, new: bool = False) -> NDArray[np.float64]:
    """Map the table of the rows that wait, which is a file."""
    size = 8 * shape[0] * shape[1]
    if new:
        with writing(path, ResultsError):
            path.write_bytes(bytes(size))
    with path.open("r+b") as file:
        return np.frombuffer(mmap.mmap(file.fileno(), size), dtype=np.float64).reshape(shape)


def check_space(plan: Plan, folder: Path) -> None:
    """Raise ``ResultsError`` if the results of a plan do not fit on the disk of a folder."""
    scenario = plan.scenario
    rows = scenario.ticks // scenario.record.every + 1
    size, free = 8 * rows * (len(plan.columns) + 1), shutil.disk_usage(folder).free
    if size > free:
        msg = (
            f"{scenario.source.where(('record',))}: {len(plan.columns)} scalars at {rows} points take {size / 1e9:.3g} "
            f"GB, and {folder} has {free / 1e9:.3g} GB free. Record fewer variables, or fewer points with 'every', or name "
            f"another place with {option('out')}."
        )
        raise ResultsError(msg)


class Stream:
    """Observer that records to ``unfinished.nc`` in a folder.

    Parameters
    ----------
    plan : Plan
        What is run.
    folder : Path
        Where results go.
    waiting : Path
        File for the rows that wait.
    announce : callable
        Called with ``Shared`` when the file is there.
    resumed : dict or None
        Card of the checkpoint that the run continues from.
    """

    def __init__(
        self,
        plan: Plan,
        folder: Path,
        waiting: Path,
        announce: Callable[[Shared], None],
        resumed: dict[str, Any] | None = None,
    ) -> None:
        self._plan, self._folder, self._announce, self._resumed = plan, folder, announce, resumed
        width = 1 + len(plan.columns)
        self._shape = (max(1, _BYTES // (8 * width)), width)
        self._rows = open_rows(waiting, self._shape, new=True)
        self._recorder = Recorder(plan, self._rows)
        self._digests = {} if checkpoint.unable(plan) else checkpoint.digests(plan)
        self._cost, self._saved = 0.0, time.perf_counter()
        self._process = os.getpid()
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._failure: ResultsError | None = None
        self._writer = threading.Thread(target=self._write_regularly, daemon=True)

    def begin(self, simulation: Simulation) -> None:
        """Start the file, or open it again."""
        header, layout = make_file(plan_columns(self._plan), attributes(self._plan))
        path = self._folder / UNFINISHED_NETCDF
        if self._resumed is None:
            if (self._folder / RESUME).is_file() or (path.is_file() and has_rows(path)):
                text = f"the unfinished run in %s is replaced by this one. {option('resume', True)} continues a run"
                logger.warning(text, self._folder)
            (self._folder / RESUME).unlink(missing_ok=True)
            self._file = GrowingFile.create(path, header, layout)
        else:
            moved = not path.exists()
            if moved:
                (self._folder / NETCDF).replace(path)
            try:
                self._file = GrowingFile.reopen(path, header, layout, self._resumed["rows"])
            except ResultsError:
                if moved:
                    path.replace(self._folder / NETCDF)
                raise
        self._position = simulation.position
        self._position[ROWS] = self._position[FIRST] = self._file.count
        self._position[DIVIDED] = simulation.divided
        self._recorder.begin(simulation)
        self._announce(Shared(layout, self._shape))
        self._writer.start()

    def sample(self, simulation: Simulation) -> None:
        """Record, and write what has waited.

        Raises
        ------
        ResultsError
            The disk is full.
        """
        if os.getpid() != self._process:
            os._exit(0)  # a copy of this process that an FMU has made in its step
        with self._lock:
            self._recorder.sample(simulation)
            self._position[ROWS] = self._file.count + self._recorder.count
            if self._recorder.count == self._shape[0]:
                self._write()
        if self._failure is not None:
            raise self._failure
        if time.perf_counter() - self._saved > WAIT + _SHARE * self._cost:
            self.save(simulation)

    def end(self, simulation: Simulation) -> None:  # noqa: ARG002
        """Write the rest."""
        self._ended.set()
        self._writer.join()
        try:
            self._write()
        finally:
            self._file.close()

    def save(self, simulation: Simulation) -> None:
        """Save the state to resume from, if the FMUs can; the run goes on if the disk cannot."""
        if not self._digests:
            return
        path, begun = self._folder / RESUME, time.perf_counter()
        with self._lock:
            if not self._ended.is_set():
                self._write()
        try:
            checkpoint.save(path, simulation, self._file.count, self._digests)
        except ResultsError as error:
            logger.warning("no state to resume from at t = %.9g s: %s", simulation.time, error)
        self._saved = time.perf_counter()
        self._cost = self._saved - begun

    def _write(self) -> None:
        self._file.append(self._recorder.rows)
        self._recorder.clear()
        self._position[FIRST] = self._file.count

    def _write_regularly(self) -> None:
        """Write what waits, however long an FMU takes for its step."""
        while not self._ended.wait(WAIT):
            with self._lock:
                try:
                    self._write()
                except ResultsError as error:
                    self._failure = error
                    return


def write_waiting(path: Path, waiting: Path, shared: Shared, position: memoryview) -> GrowingFile:
    """Open the results of a process that died, and write the rows that waited as far as the disk takes them."""
    file = GrowingFile(path, shared.layout)
    if waiting.is_file():
        rows = open_rows(waiting, shared.shape)
        first = position[FIRST]
        file.append(rows[max(file.count - first, 0) : position[ROWS] - first])
    return file
