"""Record the shapes of membranes at some instants of a run, from the states of their FMUs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ResultsError, writing
from ..fmi.shape import Shape, read_shape
from ..results.netcdf import GrowingFile
from ..results.shapes import SHAPES, UNFINISHED_SHAPES, Frame, create_shapes, pack_frame, reopen_shapes
from ..scenario.plan import Plan

if TYPE_CHECKING:
    from .master import Simulation


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
            surfaces = {name: shape.surface(simulation.serialize_one(name)) for name, shape in self._shapes.items()}
            self._file = create_shapes(self._path, surfaces, simulation.time, frame)
        else:
            self._file.append(pack_frame(simulation.time, frame)[None])

    def end(self, simulation: Simulation) -> None:  # noqa: ARG002
        """Close the file."""
        if self._file is not None:
            self._file.close()

    def _frame(self, simulation: Simulation) -> Frame:
        return {name: shape.read(simulation.serialize_one(name)) for name, shape in self._shapes.items()}
