"""Steps of a size that an error demands: each is done once whole and once in two halves, and the halves are kept.

Symbols: ``y`` values that are sent, after the halves; ``e`` their difference from those after the whole step, over
``tolerance`` and their nominal value, or where the FMU declares none their largest value so far, at least ``FLOOR``.

A step of an explicit master has an error of order two, so halving it divides ``e`` by four. Steps are the communication step
over a power of two, and end at communication points, where results are recorded.
"""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from ..errors import SimulationError
from ..fmi.types import FLOATS
from ..scenario import schema
from .division import UNITS, Steps, refusal
from .group import nominal
from .member import Member
from .position import PART, STOP

logger = logging.getLogger(__name__)

FLOOR = (
    1.0  # least size of a value whose nominal value is not declared, in its unit, as FMI assumes: it may begin at zero
)
ENOUGH = 0.1  # where e is less, the next step is twice as large: e is then expected below 0.4


class StepControl:
    """The steps of a run.

    Parameters
    ----------
    simulation : Steps
        The run.
    wanted : schema.StepControl
        Tolerance and most parts.
    strict : bool
        Raise ``SimulationError`` where the smallest step misses the tolerance.

    Attributes
    ----------
    size : int
        Size of the next step, in ``UNITS``.
    peaks : numpy.ndarray
        Nominal value, or largest magnitude so far, of each value that is compared.
    """

    def __init__(self, simulation: Steps, wanted: schema.StepControl, *, strict: bool) -> None:
        self._simulation, self._strict = simulation, strict
        self._tolerance, self._smallest = wanted.tolerance, UNITS // wanted.parts
        plan, places = simulation.plan, simulation.places
        sent = [
            (places[c.name, v], c.fmu.variables[v])
            for c in plan.components
            for v in c.sent
            if c.fmu.variables[v].type in FLOATS
        ]
        self._places = np.array([place for place, _ in sent], dtype=np.intp)
        self.peaks: NDArray[np.float64] = np.array([nominal(variable) for _, variable in sent])
        self._declared = self.peaks > 0.0
        self.size = UNITS
        self._misses = 0

    def advance(self) -> int:
        """Do the present communication step; return in how many steps, 0 if an FMU has ended before its end.

        Raises
        ------
        SimulationError
            An FMU refused the smallest step.
        """
        simulation, at, steps = self._simulation, 0, 0
        while at < UNITS:
            if simulation.position[STOP]:
                raise KeyboardInterrupt
            size, small = self.size, self.size <= self._smallest
            for group in simulation.groups:
                group.may_refuse = not small
            simulation.save()
            refused, error, peaks = self._compare(at, size)
            if simulation.over:
                if refused is not None or at + size < UNITS:
                    return 0
                simulation.read()  # this is the last point
                return steps + 1
            if refused is not None and small:
                raise refusal(simulation, refused, UNITS // size)
            if refused is not None or (error > 1.0 and not small):
                simulation.restore()
                self.size = size // 2
                continue
            if error > 1.0:
                self._miss(error)
            self.peaks, at, steps = peaks, at + size, steps + 1
            if error < ENOUGH and at % (2 * size) == 0 and size < UNITS:
                self.size = 2 * size
        if simulation.is_recorded(simulation.tick + 1):
            simulation.read()
        return steps

    def conclude(self) -> None:
        """Say how often it missed the tolerance, if more than the once that has been said."""
        if self._misses > 1:
            logger.warning("the step control missed its tolerance in %d steps", self._misses)

    def _compare(self, at: int, size: int) -> tuple[Member | None, float, NDArray[np.float64]]:
        """Do a step whole, take it back, and do it in halves.

        Returns
        -------
        (Member or None, float, numpy.ndarray)
            Who refused the step, or ended before its end; ``e``; and what ``peaks`` are if the halves are kept.
        """
        simulation, half = self._simulation, size // 2
        simulation.position[PART] = at
        refused = simulation.substep(at, size, full=False)
        if refused is not None and not simulation.over:
            return refused, 0.0, self.peaks
        whole = simulation.values[self._places]
        simulation.ended_by.clear()
        simulation.restore()
        for begin in (at, at + half):
            refused = simulation.substep(begin, half, full=False)
            if simulation.over and begin == at:
                refused = next(member for member in simulation.members if member.instance in simulation.ended_by)
            if refused is not None:
                return refused, 0.0, self.peaks
        y = simulation.values[self._places]
        with np.errstate(all="ignore"):
            peaks = np.where(self._declared, self.peaks, np.fmax(self.peaks, abs(y)))
            scale = np.where(self._declared, peaks, np.fmax(peaks, FLOOR))
            error = float(np.max(abs(y - whole) / scale, initial=0.0)) / self._tolerance
        return None, error if np.isfinite(error) else np.inf, peaks

    def _miss(self, error: float) -> None:
        """Say that the smallest step misses the tolerance, the first time; with ``strict`` raise it."""
        self._misses += 1
        simulation = self._simulation
        text = (
            f"the smallest step of the step control, {simulation.plan.scenario.step * self._smallest / UNITS:.3g} s, has "
            f"{error:.3g} times the error of 'tolerance' = {self._tolerance:g} after t = {simulation.time:.9g} s."
        )
        advice = "Allow more 'parts', or use a larger 'tolerance'."
        if self._strict:
            msg = f"{text} {advice}"
            raise SimulationError(msg, component="", time=simulation.time)
        if self._misses == 1:
            logger.warning("%s The run goes on; --strict ends it there. %s", text, advice)
