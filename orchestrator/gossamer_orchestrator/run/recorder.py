"""Record a run in one preallocated table, a row per recorded communication point."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError
from ..scenario.plan import Plan

if TYPE_CHECKING:
    from .master import Simulation

MAX_BYTES = 2_000_000_000


class Recorder:
    """Observer that fills a table.

    Parameters
    ----------
    plan : Plan
        Gives the variables to record, and how often.

    Attributes
    ----------
    columns : tuple of (component, variable)
        Names of the columns.

    Raises
    ------
    ScenarioError
        The table would be absurdly large.
    """

    def __init__(self, plan: Plan) -> None:
        self.columns = plan.columns
        scenario = plan.scenario
        self._every = scenario.record.every
        rows = scenario.ticks // self._every + 1
        size = 8 * rows * (len(self.columns) + 1)
        if size > MAX_BYTES:
            msg = (
                f"{scenario.source.where(('record',))}: {len(self.columns)} variables at {rows} points take "
                f"{size / 1e9:.1f} GB, more than {MAX_BYTES / 1e9:g}. Record fewer variables, or fewer points with "
                f"'every' = {self._every * math.ceil(size / MAX_BYTES)}."
            )
            raise ScenarioError(msg)
        ticks = np.arange(0, scenario.ticks + 1, self._every)
        self._time = np.asarray(scenario.start + ticks * scenario.step, dtype=np.float64)
        self._table = np.zeros((rows, len(self.columns)))
        self._rows = 0
        self._places: NDArray[np.intp] = np.zeros(0, dtype=np.intp)

    def begin(self, simulation: Simulation) -> None:
        """Look up where the columns stand among the values of the run."""
        self._places = np.array([simulation.places[column] for column in self.columns], dtype=np.intp)

    def sample(self, simulation: Simulation) -> None:
        """Write a row, at every n-th communication point."""
        if simulation.tick % self._every:
            return
        simulation.values.take(self._places, None, self._table[self._rows], "clip")
        self._rows += 1

    def end(self, simulation: Simulation) -> None:
        """Do nothing: what was recorded stays valid however the run ended."""

    @property
    def time(self) -> NDArray[np.float64]:
        """Time [s] of the rows written so far."""
        return self._time[: self._rows]

    @property
    def table(self) -> NDArray[np.float64]:
        """Rows written so far, a column per recorded variable."""
        return self._table[: self._rows]
