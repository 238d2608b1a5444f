"""The values of a run: what was read from the FMUs, and what of it has arrived at their receivers."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..fmi.types import EXCHANGED_EXACTLY, parse
from ..names import split_endpoint
from ..scenario.histories import FILE
from ..scenario.plan import Plan


class Store:
    """Every variable that is read, as a float; texts and wide integers also as they are.

    Parameters
    ----------
    plan : Plan
        Gives the variables, and the master.

    Attributes
    ----------
    places : dict
        Index by ``(component, variable)``.
    values : numpy.ndarray
        What was read last, by place; a truth value is 0 or 1, a text 0.
    exact : list
        The same of the types that floats do not hold, and None elsewhere; empty if there are none.
    arrived, exact_arrived : numpy.ndarray, list
        What receivers see: the same objects under Gauss-Seidel, those of the last communication point under Jacobi.
    """

    def __init__(self, plan: Plan) -> None:
        read = [(c.name, v, c.fmu.variables[v]) for c in plan.components for v in c.read]
        for target in plan.histories:
            component, name = split_endpoint(target)
            read.append((FILE, target, plan.component(component).fmu.variables[name]))
        self.places = {(component, name): i for i, (component, name, _) in enumerate(read)}
        starts = [0.0 if v.type != "Real" or v.start is None else float(v.start) for _, _, v in read]
        self.values = np.array(starts, dtype=np.float64)  # what an FMU sends until it is initialized
        self.exact: list[Any] = [parse(v.type, v.start) if v.type in EXCHANGED_EXACTLY else None for _, _, v in read]
        if not any(v.type in EXCHANGED_EXACTLY for _, _, v in read):
            self.exact.clear()
        jacobi = plan.scenario.master == "jacobi"
        self.arrived = self.values.copy() if jacobi else self.values
        self.exact_arrived = self.exact.copy() if jacobi else self.exact
        self._histories = [(self.places[FILE, target], history) for target, history in plan.histories.items()]
        self._before = self.values.copy()
        self._exact_before = self.exact.copy()

    def look_up(self, time: float) -> None:
        """Hand what files say of a time [s] to the receivers."""
        for place, history in self._histories:
            value = history(time)
            if self.exact and self.exact[place] is not None:
                self.exact[place] = self.exact_arrived[place] = value
            else:
                self.values[place] = self.arrived[place] = value

    def arrive(self) -> None:
        """Hand everything on to the receivers."""
        self.arrived[:] = self.values
        self.exact_arrived[:] = self.exact

    def save(self) -> None:
        """Keep everything for ``restore``."""
        self._before[:] = self.values
        if self.exact:
            self._exact_before[:] = self.exact

    def restore(self) -> None:
        """Go back to what was kept."""
        self.values[:] = self._before
        self.exact[:] = self._exact_before
