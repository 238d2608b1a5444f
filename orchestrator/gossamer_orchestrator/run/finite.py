"""Say when a value that an FMU returns is no number for the first time."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from ..errors import SimulationError

if TYPE_CHECKING:
    from .master import Simulation

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
                value = float(simulation.values[place])
                text = f"component {component!r} returned {variable} = {value} at t = {simulation.time:.9g} s."
                if self._strict:
                    msg = f"{text} Correct its inputs or parameters, or run without --strict."
                    raise SimulationError(msg, component=component, time=simulation.time)
                logger.warning("%s What follows from it means nothing; --strict ends the run there.", text)

    def end(self, simulation: Simulation) -> None:
        """Do nothing."""
