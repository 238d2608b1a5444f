"""Write the rows of a run to the disk as they come, and the state to resume from.

Rows wait in memory that another process can read: when an FMU ends the process of a run, whoever watches it writes those
that wait. They wait a second, or until they fill that memory.
"""

from __future__ import annotations

import logging
import mmap
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ResultsError, writing
from ..results.columns import attributes, plan_columns
from ..results.files import NETCDF, RESUME, UNFINISHED_NETCDF
from ..results.netcdf import GrowingFile, Layout, make_file
from ..scenario.plan import Plan
from . import checkpoint
from .position import DIVIDED, FIRST, ROWS
from .recorder import Recorder

if TYPE_CHECKING:
    from .master import Simulation

logger = logging.getLogger(__name__)

WAIT = 1.0  # [s] that a row waits at most
_SHARE = 20  # a state is saved after so many times the time that saving it takes
_BYTES = 1_000_000  # of the rows that wait


class Shared(NamedTuple):
    """What another process needs to write the rows that wait: the file's layout, and the shape of their table."""

    layout: Layout
    shape: tuple[int, int]


def open_rows(path: Path, shape: tuple[int, int], *, new: bool = False) -> NDArray[np.float64]:
    """Map the table of the rows that wait, which is a file."""
    size = 8 * shape[0] * shape[1]
    if new:
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
            f"{scenario.source.where(('record',))}: {len(plan.columns)} variables at {rows} points take {size / 1e9:.3g} "
            f"GB, and {folder} has {free / 1e9:.3g} GB free. Record fewer variables, or fewer points with 'every', or name "
            "another place with --out."
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
        self._cost = 0.0
        self._saved = self._written = time.perf_counter()

    def begin(self, simulation: Simulation) -> None:
        """Start the file, or open it again."""
        header, layout = make_file(plan_columns(self._plan), attributes(self._plan))
        path = self._folder / UNFINISHED_NETCDF
        if self._resumed is None:
            (self._folder / RESUME).unlink(missing_ok=True)
            self._file = GrowingFile.create(path, header, layout)
        else:
            if not path.exists():
                (self._folder / NETCDF).replace(path)
            self._file = GrowingFile.reopen(path, header, layout, self._resumed["rows"])
        position = simulation.position
        position[ROWS] = position[FIRST] = self._file.count
        position[DIVIDED] = simulation.divided
        self._recorder.begin(simulation)
        self._announce(Shared(layout, self._shape))

    def sample(self, simulation: Simulation) -> None:
        """Record, and write what has waited."""
        recorder = self._recorder
        recorder.sample(simulation)
        simulation.position[ROWS] = self._file.count + recorder.count
        now = time.perf_counter()
        if recorder.count == self._shape[0]:
            self._write(simulation)
        if now - self._written > WAIT:
            self._written = now
            self._write(simulation)
            if now - self._saved > _SHARE * self._cost:
                self._save(simulation)

    def end(self, simulation: Simulation) -> None:
        """Write the rest."""
        self._write(simulation)
        self._file.close()

    def save(self, simulation: Simulation) -> None:
        """Write the state of a run that was interrupted between two steps."""
        self._save(simulation)

    def _write(self, simulation: Simulation) -> None:
        self._file.append(self._recorder.rows)
        self._recorder.clear()
        simulation.position[FIRST] = self._file.count

    def _save(self, simulation: Simulation) -> None:
        """Save the state to resume from, if the FMUs can; the run goes on if the disk cannot."""
        if not self._digests:
            return
        path, begun = self._folder / RESUME, time.perf_counter()
        try:
            with writing(path, ResultsError):
                checkpoint.save(path, simulation, self._file.count, self._digests)
        except ResultsError as error:
            logger.warning("no state to resume from at t = %.9g s: %s", simulation.time, error)
        self._saved = time.perf_counter()
        self._cost = self._saved - begun


def write_waiting(path: Path, waiting: Path, shared: Shared, position: memoryview) -> GrowingFile:
    """Open the results of a process that died, and write the rows that waited as far as the disk takes them."""
    file = GrowingFile(path, shared.layout)
    if waiting.is_file():
        rows = open_rows(waiting, shared.shape)
        first = position[FIRST]
        file.append(rows[max(file.count - first, 0) : position[ROWS] - first])
    return file
