"""Observers of every run: the rows of its table, values that are no numbers, and the shapes of membranes.

A row is written at every n-th communication point, the last one, and the ends of the windows of detectors, where judgements
are made.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from gossamer_files.options import option
from numpy.typing import NDArray

from ..errors import ResultsError, SimulationError, writing
from ..fmi.shape import Shape, read_shape
from ..names import split_indices
from ..results.dataset import DETECTOR, WATCHED
from ..results.netcdf import GrowingFile
from ..results.shapes import SHAPES, UNFINISHED_SHAPES, Frame, create_shapes, pack_frame, reopen_shapes
from ..scenario.plan import Plan
from .master import Simulation
from .position import NOT_FINITE

_ROWS = 1024


class Recorder:
    """Observer that fills a table.

    Parameters
    ----------
    plan : Plan
        Gives the variables to record, and how often.
    rows : numpy.ndarray or None
        Where to write, time and the columns; whoever gives it calls ``clear`` before it is full. None makes a table that
        grows.

    Attributes
    ----------
    columns : tuple of (component, variable)
        Names of the columns.
    count : int
        Rows written since the last ``clear``.
    """

    def __init__(self, plan: Plan, rows: NDArray[np.float64] | None = None) -> None:
        self.columns = plan.columns
        self.count = 0
        self._rows = np.zeros((_ROWS, 1 + len(plan.columns))) if rows is None else rows
        scenario = plan.scenario
        self._start, self._step = scenario.start, scenario.step
        self._every, self._ticks = scenario.record.every, scenario.ticks
        self._places: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
        self._detectors: list[_Windows] = []

    def begin(self, simulation: Simulation) -> None:
        """Look up where the columns stand among the values of the run."""
        self._places = np.array([simulation.places[column] for column in self.columns], dtype=np.intp)
        if self._every > 1:
            components = [c for c in simulation.plan.components if c.fmu.description.modelName == DETECTOR]
            self._detectors = [_Windows(simulation, component.name) for component in components]

    def sample(self, simulation: Simulation) -> None:
        """Write a row if this communication point is recorded."""
        tick = simulation.tick
        ended = [detector.ended() for detector in self._detectors]
        if tick % self._every and tick != self._ticks and not simulation.over:
            if not any(ended):
                return
            simulation.read()
        if self.count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        row = self._rows[self.count]
        row[0] = self._start + tick * self._step
        simulation.values.take(self._places, None, row[1:], "clip")
        self.count += 1

    def end(self, simulation: Simulation) -> None:
        """Do nothing: what was recorded stays valid however the run ended."""

    def clear(self, keep: int = 0) -> None:
        """Forget the rows written so far, but the last few."""
        self._rows[:keep] = self._rows[self.count - keep : self.count]
        self.count = keep

    @property
    def rows(self) -> NDArray[np.float64]:
        """Rows written since the last ``clear``: time and the columns."""
        return self._rows[: self.count]

    @property
    def time(self) -> NDArray[np.float64]:
        """Time [s] of those rows."""
        return self._rows[: self.count, 0]

    @property
    def table(self) -> NDArray[np.float64]:
        """Those rows without their time."""
        return self._rows[: self.count, 1:]


class _Windows:
    """Tell when a window of a detector ends, which its outputs show by a change."""

    def __init__(self, simulation: Simulation, name: str) -> None:
        self._simulation, self._name = simulation, name
        places = [i for (c, v), i in simulation.places.items() if c == name and split_indices(v)[0] in WATCHED]
        self._values, self._places = simulation.values, np.array(places, dtype=np.intp)
        self._last = self._values[self._places]

    def ended(self) -> bool:
        """Read the outputs and compare them with those of the last call."""
        self._simulation.read(self._name)
        last, self._last = self._last, self._values[self._places]
        return not np.array_equal(last, self._last, equal_nan=True)


logger = logging.getLogger(__name__)


class FiniteCheck:
    """Observer that names the first variable of each component that is not finite, and its time.

    Parameters
    ----------
    strict : bool
        Raise ``SimulationError`` instead of a warning.
    """

    def __init__(self, *, strict: bool = False) -> None:
        self._strict = strict
        self._names: list[tuple[str, str]] = []

    def begin(self, simulation: Simulation) -> None:
        """Look up whose values are whose."""
        self._names = list(simulation.places)
        self._zeros = np.zeros(len(self._names))
        self._fresh = np.ones(len(self._names), dtype=bool)

    def sample(self, simulation: Simulation) -> None:
        """Look for the first value that is not finite; a sum of products with zero is zero if all are."""
        if simulation.values.dot(self._zeros) == 0.0:
            return
        for place in np.flatnonzero(self._fresh & ~np.isfinite(simulation.values)):
            component, variable = self._names[place]
            if self._fresh[place]:
                self._fresh[[name[0] == component for name in self._names]] = False
                simulation.position[NOT_FINITE] += 1
                value = float(simulation.values[place])
                text = f"component {component!r} returned {variable} = {value} at t = {simulation.time:.9g} s."
                if self._strict:
                    msg = f"{text} Correct its inputs or parameters, or run without {option('strict', True)}."
                    raise SimulationError(msg, component=component, time=simulation.time)
                logger.warning("%s What follows from it means nothing; %s ends the run there.", text, option("strict", True))

    def end(self, simulation: Simulation) -> None:
        """Look once more: who is refused a step may have been given what is not finite."""
        self._strict = False
        if self._names:
            self.sample(simulation)


class ShapeRecorder:
    """Observer that writes ``unfinished_shapes.nc`` into a folder, if an FMU of the run can be drawn.

    Parameters
    ----------
    plan : Plan
        What is run; ``[record] frames`` of its scenario is how many instants, evenly spread from the first to the last.
    folder : Path
        Where results go.
    """

    def __init__(self, plan: Plan, folder: Path) -> None:
        scenario = plan.scenario
        self._path, self._earlier = folder / UNFINISHED_SHAPES, folder / SHAPES
        frames, every = scenario.record.frames, scenario.record.every
        spread = every * np.linspace(0, scenario.ticks // every, frames).round().astype(int)  # as in results.nc
        self._ticks = {*spread[:-1].tolist(), scenario.ticks} if frames else set()
        self._shapes: dict[str, Shape] = {}
        self._file: GrowingFile | None = None

    def begin(self, simulation: Simulation) -> None:
        """Find the FMUs that can be drawn; open the file again if the run is resumed."""
        found = {c.name: read_shape(c.fmu) for c in simulation.plan.components} if self._ticks else {}
        self._shapes = {name: shape for name, shape in found.items() if shape is not None}
        if simulation.tick == 0:
            with writing(self._path, ResultsError):
                self._path.unlink(missing_ok=True)
            return
        if not self._path.is_file() and self._earlier.is_file():  # the run had ended early
            self._earlier.replace(self._path)
        before = sum(tick < simulation.tick for tick in self._ticks)
        if self._shapes and before:
            self._file = reopen_shapes(self._path, pack_frame(0.0, self._frame(simulation)).size, before)
        self.sample(simulation)

    def sample(self, simulation: Simulation) -> None:
        """Record the shapes if it is their instant."""
        if not self._shapes or simulation.tick not in self._ticks or simulation.over:
            return
        frame = self._frame(simulation)
        if self._file is None:
            surfaces = {name: shape.surface(simulation.serialize(name)[0]) for name, shape in self._shapes.items()}
            self._file = create_shapes(self._path, surfaces, simulation.time, frame)
        else:
            self._file.append(pack_frame(simulation.time, frame)[None])

    def end(self, simulation: Simulation) -> None:
        """Do nothing: the file is whole at any time."""

    def _frame(self, simulation: Simulation) -> Frame:
        return {name: shape.read(simulation.serialize(name)[0]) for name, shape in self._shapes.items()}
