"""Write the rows of a run to the disk as they come, and the state that ``gossamer run --resume`` continues from.

Rows wait in memory that another process can read: when an FMU ends the process of a run, whoever watches it writes those
that wait. They wait half a second, or until they fill that memory.

The state at a communication point, a checkpoint, is an NPZ file: the serialized state of every FMU, the values that were
exchanged last, the last sample that arrived over each channel, the largest values of each group, and a JSON card. Noise and
dropouts are functions of their seeds and the step, events of the time, so nothing of them is kept.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np
from gossamer_files import digest, replacing
from gossamer_files.options import option
from numpy.typing import NDArray

from ..errors import ResultsError, ScenarioError, require, writing
from ..processes import shared_memory
from ..results.dataset import attributes, plan_columns
from ..results.files import NETCDF, RESUME, UNFINISHED_NETCDF, UNFINISHED_WATCH, has_rows
from ..results.netcdf import GrowingFile, Layout, make_file
from ..scenario.plan import Plan
from .master import Simulation
from .position import DIVIDED, FIRST, NOT_FINITE, ROWS
from .recorder import Recorder
from .steps import ControlledSteps

SCHEMA, VERSION = "gossamer.checkpoint", 1


def digests(plan: Plan) -> dict[str, str]:
    """Return a digest of the scenario and of every FMU and file of inputs, by what they are called in a message."""
    scenario = plan.scenario
    found = {"the scenario": hashlib.sha256((scenario.source.text + scenario.model_dump_json()).encode()).hexdigest()}
    paths = {f"FMU {file.name!r}": file.path for file in plan.files}
    paths |= {f"file {given.file!r}": scenario.folder / given.file for given in scenario.inputs}
    for name, path in paths.items():
        found[name] = digest(path)
    return found


def unable(plan: Plan) -> list[str]:
    """List the FMUs whose runs cannot be resumed: they cannot serialize their state, or have events of their own."""
    return [
        file.name
        for file in plan.files
        if not file.interface.canSerializeFMUstate
        or file.model_exchange  # its state does not include its next event
        or getattr(file.interface, "hasEventMode", False)
    ]


def save_checkpoint(path: Path, simulation: Simulation, rows: int, digest: dict[str, str]) -> None:
    """Write the present state of a run of which ``rows`` rows are on the disk; raise ``ResultsError`` if it cannot."""
    card = {
        "schema": SCHEMA,
        "version": VERSION,
        "digest": digest,
        "tick": simulation.tick,
        "rows": rows,
        "divided": simulation.divided,
        "not_finite": int(simulation.position[NOT_FINITE]),
        "exact": [value.hex() if isinstance(value, bytes) else value for value in simulation.store.exact],
    }
    arrays: dict[str, Any] = {"card": np.array(json.dumps(card)), "values": simulation.values}
    arrays["held"] = np.array([channel.held for channel in simulation.channels])
    if isinstance(simulation.control, ControlledSteps):
        arrays |= {"size": np.array(simulation.control.size), "peaks": simulation.control.peaks}
    arrays |= {f"peaks_{i}": group.peaks for i, group in enumerate(simulation.groups)}
    arrays |= {f"state_{i}": np.frombuffer(state, np.uint8) for i, state in enumerate(simulation.serialize())}
    with writing(path, ResultsError), replacing(path) as new, new.open("wb") as file:
        np.savez(file, **arrays)


def load_checkpoint(path: Path, plan: Plan) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read the card and the arrays of the unfinished run of a plan.

    Raises
    ------
    ResultsError
        There is no unfinished run, or it cannot be read.
    ScenarioError
        An FMU cannot serialize its state, or the unfinished run had another scenario or other FMUs.
    """
    again = f"Run it from its start, without {option('resume', True)}."
    if names := unable(plan):
        msg = (
            f"{', '.join(names)} cannot serialize {'its' if len(names) == 1 else 'their'} state (canSerializeFMUstate), or "
            f"has events of its own (event mode, model exchange), so this run cannot be resumed. {again}"
        )
        raise ScenarioError(msg)
    require(path.is_file(), f"there is no unfinished run in {path.parent} to resume. {again}", ResultsError)
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        card: dict[str, Any] = json.loads(str(arrays.pop("card")))
        known = (card["schema"], card["version"])
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        msg = f"cannot read {path}: {error}. {again}"
        raise ResultsError(msg) from error
    if known != (SCHEMA, VERSION):
        msg = f"{path} holds {known[0]!r} version {known[1]}, this program reads {SCHEMA!r} version {VERSION}."
        raise ResultsError(msg)
    present, earlier = digests(plan), card["digest"]
    changed = [name for name in present | earlier if present.get(name) != earlier.get(name)]
    if changed:
        msg = (
            f"{', '.join(changed)} differ{'s' * (len(changed) == 1)} from the unfinished run in {path.parent}. "
            f"Give it what it had, also {option('step')}, {option('stop')}, {option('set')} and {option('master')}, or run "
            f"it from its start, without {option('resume', True)}."
        )
        raise ScenarioError(msg)
    return card, arrays


def restore_checkpoint(simulation: Simulation, card: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Bring a simulation that has just started to the state of ``load_checkpoint``."""
    for tick in sorted(simulation.plan.events):
        for name, values in simulation.plan.events[tick] if 0 < tick < card["tick"] else ():
            simulation.member(name).set(values)  # arrays keep the elements that nothing feeds
    simulation.deserialize([arrays[f"state_{i}"].tobytes() for i in range(len(simulation.members))])
    simulation.values[:] = arrays["values"]
    simulation.store.exact[:] = [
        bytes.fromhex(value) if isinstance(old, bytes) else value
        for value, old in zip(card["exact"], simulation.store.exact, strict=True)
    ]
    for channel, value in zip(simulation.channels, arrays["held"].tolist(), strict=True):
        channel.held = value
    for i, group in enumerate(simulation.groups):
        group.peaks[:] = arrays[f"peaks_{i}"]
    if isinstance(simulation.control, ControlledSteps):
        simulation.control.size = int(arrays["size"])
        simulation.control.peaks = arrays["peaks"]
    simulation.tick, simulation.divided = card["tick"], card["divided"]
    simulation.position[NOT_FINITE] = card["not_finite"]


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
    with writing(path, ResultsError):
        return np.frombuffer(shared_memory(path, size, new=new), dtype=np.float64).reshape(shape)


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
        self._digests = {} if unable(plan) else digests(plan)
        self._cost = 0.0
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
            for name in (RESUME, UNFINISHED_WATCH):
                (self._folder / name).unlink(missing_ok=True)
            with writing(path, ResultsError):
                path.write_bytes(header)
            self._file = GrowingFile(path, layout)
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
        self._saved = time.perf_counter()
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
        self._write()

    def save(self, simulation: Simulation) -> None:
        """Save the state to resume from, if the FMUs can; the run goes on if the disk cannot."""
        if not self._digests:
            return
        path, begun = self._folder / RESUME, time.perf_counter()
        with self._lock:
            if not self._ended.is_set():
                self._write()
        try:
            save_checkpoint(path, simulation, self._file.count, self._digests)
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
