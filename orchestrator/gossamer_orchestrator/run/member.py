"""A component of a run: it fetches its inputs from the others, steps, and reads its outputs.

Symbols: ``u`` inputs, ``y`` values read from the FMU.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..fmi.instance import Instance, Port
from ..scenario.plan import ComponentPlan
from .channel import Channel


class Member:
    """A running component: its instance, its ports, and the sources of its inputs.

    Parameters
    ----------
    plan : ComponentPlan
        What it is.
    instance : Instance
        Its FMU.
    y : numpy.ndarray
        Where its outputs go, a view into the values of the whole run.
    arrived : numpy.ndarray
        Where its inputs come from, the values of the whole run as the receivers see them.
    places : dict
        Place of every ``(component, variable)`` in those values.
    """

    def __init__(
        self,
        plan: ComponentPlan,
        instance: Instance,
        y: NDArray[np.float64],
        arrived: NDArray[np.float64],
        places: dict[tuple[str, str], int],
    ) -> None:
        self.name = plan.name
        self.instance = instance
        self.sent: Port = instance.port(plan.sent, y[: len(plan.sent)])
        self.outputs: Port = instance.port([*plan.sent, *plan.recorded], y)
        self.channels = [(i, Channel(c)) for i, c in enumerate(plan.connections) if not c.is_plain]
        sources = np.array([places[c.sender, c.output] for c in plan.connections], dtype=np.intp)
        inputs = [connection.input for connection in plan.connections]
        side_by_side = bool((np.diff(sources) == 1).all())
        if inputs and side_by_side and not self.channels:  # the FMU reads them where they stand
            self.inputs: Port = instance.port(inputs, arrived[sources[0] : sources[0] + len(inputs)])
            self._gather: Callable[[], object] | None = None
        else:
            self.inputs = instance.port(inputs)
            self._gather = partial(arrived.take, sources, None, self.inputs.values, "clip") if inputs else None

    def receive(self, tick: int) -> None:
        """Fetch the inputs from what the others sent, and set them."""
        if self._gather is not None:
            self._gather()
            u = self.inputs.values
            for i, channel in self.channels:
                u[i] = channel(float(u[i]), tick)
        if self.inputs.size:
            self.instance.write(self.inputs)

    def advance(self, time: ctypes.c_double, size: ctypes.c_double, *, full: bool) -> bool:
        """Step and read outputs (all of them if ``full``); False if the FMU discarded the step."""
        if not self.instance.step(time, size):
            return False
        outputs = self.outputs if full else self.sent
        if outputs.size:
            self.instance.read(outputs)
        return True

    def read(self) -> None:
        """Read all outputs."""
        if self.outputs.size:
            self.instance.read(self.outputs)
