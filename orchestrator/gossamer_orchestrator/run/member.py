"""A component of a run: it fetches its inputs from the others, steps, and reads its outputs.

Symbols: ``u`` inputs, ``y`` values read from the FMU.

Reals go from FMU to FMU through one array of floats, without a call of Python per value. The other types go through ports of
their own (``typed``).
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from ..fmi.instance import Instance
from ..fmi.ports import Port
from ..fmi.types import Value
from ..scenario.plan import ComponentPlan
from ..scenario.schema import Scenario
from .channel import Channel
from .store import Store
from .typed import TypedInputs, TypedOutputs, needs_values, typed_inputs, typed_outputs


class Member:
    """A running component: its instance, its ports, and the sources of its inputs.

    Parameters
    ----------
    plan : ComponentPlan
        What it is.
    instance : Instance
        Its FMU.
    store : Store
        The values of the whole run; its own stand together there, from ``begin`` on.
    begin : int
        Place of its first value.
    number : int
        Its own, among the components in stepping order.

    Attributes
    ----------
    every : int
        It steps at every n-th communication point.
    """

    def __init__(self, plan: ComponentPlan, instance: Instance, store: Store, begin: int, number: int) -> None:
        self.name, self.number, self.every = plan.name, number, plan.every
        self.instance = instance
        sent, recorded = plan.sent_reals, plan.recorded_reals
        y = store.values[begin : begin + len(sent) + len(recorded)]
        self.sent: Port = instance.port(sent, y[: len(sent)])
        self.outputs: Port = instance.port([*sent, *recorded], y)
        wires = [(c, None if c.is_plain else Channel(c)) for c in plan.connections]
        self.typed_inputs: list[TypedInputs] = typed_inputs(plan, instance, store, wires)
        self.typed_outputs: list[TypedOutputs] = typed_outputs(plan, instance, store)
        direct = [(c, channel) for c, channel in wires if not needs_values(plan, instance, c.input)]
        self.channels = [(i, channel) for i, (_, channel) in enumerate(direct) if channel is not None]
        self.all_channels = [channel for _, channel in wires if channel is not None]
        sources = np.array([store.places[c.sender, c.output] for c, _ in direct], dtype=np.intp)
        inputs = [c.input for c, _ in direct]
        side_by_side = bool((np.diff(sources) == 1).all())
        if inputs and side_by_side and not self.channels:  # the FMU reads them where they stand
            self.inputs: Port = instance.port(inputs, store.arrived[sources[0] : sources[0] + len(inputs)])
            self._gather: Callable[[], object] | None = None
        else:
            self.inputs = instance.port(inputs)
            self._gather = partial(store.arrived.take, sources, None, self.inputs.values, "clip") if inputs else None

    def set(self, values: Mapping[str, Value]) -> None:
        """Set unconnected inputs."""
        self.instance.set_start(values)
        for group in self.typed_inputs:
            group.keep(values)

    def receive(self, tick: int) -> None:
        """Fetch the inputs from what the others sent, and set them."""
        if self._gather is not None:
            self._gather()
            u = self.inputs.values
            for i, channel in self.channels:
                u[i] = channel(float(u[i]), tick)
        if self.inputs.size:
            self.instance.write(self.inputs)
        for group in self.typed_inputs:
            group.receive(tick)

    def advance(self, time: ctypes.c_double, size: ctypes.c_double, *, full: bool) -> bool:
        """Step and read outputs (all of them if ``full``); False if the FMU discarded the step."""
        if not self.instance.step(time, size):
            return False
        self.read(full=full)
        return True

    def read(self, *, full: bool) -> None:
        """Read what others receive, or everything that is recorded too."""
        outputs = self.outputs if full else self.sent
        if outputs.size:
            self.instance.read(outputs)
        for group in self.typed_outputs:
            if full or group.sent:
                group.read()


class SlowMember(Member):
    """A component that steps at every n-th communication point, over the n steps that end there; see ``Member``.

    Its inputs are those of the last of these steps.
    """

    def __init__(
        self, plan: ComponentPlan, instance: Instance, store: Store, begin: int, number: int, scenario: Scenario
    ) -> None:
        super().__init__(plan, instance, store, begin, number)
        self._scenario = scenario
        self._tick = 0

    def receive(self, tick: int) -> None:
        """Fetch the inputs from what the others sent, and set them."""
        self._tick = tick
        super().receive(tick)

    def advance(self, time: ctypes.c_double, size: ctypes.c_double, *, full: bool) -> bool:  # noqa: ARG002
        """Step, in as many parts as the others do the last of the n steps, and read all outputs."""
        scenario = self._scenario
        parts = round(scenario.step / size.value)
        length = ctypes.c_double(self.every * size.value)
        begin = scenario.seconds(self._tick - self.every)
        for part in range(parts):
            if not self.instance.step(ctypes.c_double(begin + part * length.value), length):
                return False
            if self.instance.ended_at is not None and part < parts - 1:
                return False
        self.read(full=True)
        return True
