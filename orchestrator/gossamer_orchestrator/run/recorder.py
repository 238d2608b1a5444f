"""Record a run in a table: a row per recorded communication point.

Recorded are every n-th point, the last one, and the ends of the windows of detectors, where judgements are made.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..names import split_indices
from ..results.columns import DETECTOR, WATCHED
from ..scenario.plan import Plan

if TYPE_CHECKING:
    from .master import Simulation

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
        self._take(simulation, self._rows[self.count])
        self.count += 1

    def end(self, simulation: Simulation) -> None:
        """Do nothing: what was recorded stays valid however the run ended."""

    def clear(self, keep: int = 0) -> None:
        """Forget the rows written so far, but the last few."""
        self._rows[:keep] = self._rows[self.count - keep : self.count]
        self.count = keep

    def _take(self, simulation: Simulation, row: NDArray[np.float64]) -> None:
        """Fill a row with the present time and values."""
        row[0] = self._start + simulation.tick * self._step
        simulation.values.take(self._places, None, row[1:], "clip")

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
