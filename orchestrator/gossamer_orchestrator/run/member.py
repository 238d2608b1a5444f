"""A component of a run: it fetches its inputs from the others, steps, and reads its outputs.

Symbols: ``u`` inputs, ``y`` values read from the FMU.

Reals go from FMU to FMU through one array of floats, without a call of Python per value. Other types, and arrays that are
connected in part, go through ports of their own.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from ..errors import SimulationError
from ..fmi.instance import Instance
from ..fmi.types import EXCHANGED_EXACTLY, LARGEST_EXACT, TEXTS, Port, Value, cast, parse
from ..scenario.plan import ComponentPlan
from ..scenario.schema import Connection
from .position import COMPONENT, Position
from .signals import Channel, Store

logger = logging.getLogger(__name__)

Wire = tuple[Connection, Channel | None]


def set_by_value(plan: ComponentPlan, instance: Instance) -> set[str]:
    """Return which connected inputs are set by value: no Reals, in partly connected arrays, or only in an event."""
    events = instance.event_mode or plan.fmu.model_exchange
    found, of_arrays = set[str](), dict[str, list[str]]()
    for name in (c.input for c in plan.connections):
        variable, array = plan.fmu.variables[name], plan.fmu.array_of(name)
        if variable.type != "Real" or (events and variable.variability == "discrete") or plan.fmu.clocks_of(name):
            found.add(name)
        if array is not None:
            of_arrays.setdefault(array, []).append(name)
    for array, names in of_arrays.items():
        found.update(names if names != plan.fmu.arrays[array] else ())
    return found


class InputsOfType:
    """Inputs of one type, set together; elements of arrays that are not connected keep their values.

    Parameters
    ----------
    plan : ComponentPlan
        Whose inputs.
    kind : str
        Their type.
    instance : Instance
        Its FMU.
    store : Store
        Where their values arrive.
    wires : sequence of (Connection, Channel or None)
        What feeds them.
    """

    def __init__(self, plan: ComponentPlan, kind: str, instance: Instance, store: Store, wires: Sequence[Wire]) -> None:
        names = plan.fmu.whole(c.input for c, _ in wires)
        self._instance, self._store, self._kind = instance, store, kind
        self._port = instance.port(names, kind)
        free = plan.fmu.model_exchange and plan.fmu.is_continuous(names[0])
        self._write = instance.write if free else instance.write_events
        self._index = {name: i for i, name in enumerate(names)}
        self._values: list[Any] = [plan.start.get(v, parse(kind, plan.fmu.variables[v].start)) for v in names]
        self._sources = []
        for c, channel in wires:
            place = store.places[c.sender, c.output]
            exact = bool(store.exact) and store.exact[place] is not None and kind in EXCHANGED_EXACTLY and channel is None
            self._sources.append((self._index[c.input], place, channel, exact))
        self._last: list[Any] = []

    def keep(self, values: Mapping[str, Value]) -> None:
        """Take over new values of elements that nothing feeds."""
        for name, value in values.items():
            if name in self._index:
                self._values[self._index[name]] = value

    def receive(self, tick: int) -> None:
        """Fetch the values and set the inputs; in event mode only if one has changed."""
        floats, exact = self._store.arrived, self._store.exact_arrived
        for i, place, channel, exactly in self._sources:
            if exactly:
                self._values[i] = exact[place]
                continue
            value = float(floats[place])
            try:
                self._values[i] = cast(self._kind, value if channel is None else channel(value, tick))
            except ValueError as error:
                component, name = self._instance.name, list(self._index)[i]
                msg = f"{component}.{name} cannot receive its value: {error}. Correct 'gain' and 'bias' of its connection."
                raise SimulationError(msg, component=component, time=self._store.plan.scenario.seconds(tick)) from error
        self._write(self._port.put(self._values))


class OutputsOfType:
    """Outputs of one type, read together.

    Parameters
    ----------
    instance : Instance
        Whose outputs.
    names : sequence of str
        All of them, neighbours in the store.
    store : Store
        Where they go.
    begin : int
        Place of the first.
    sent : bool
        Whether other components receive them, so that they are read at every step.
    """

    def __init__(self, instance: Instance, names: Sequence[str], store: Store, begin: int, *, sent: bool) -> None:
        self.sent = sent
        self._instance, self._store, self._names = instance, store, names
        self._place = slice(begin, begin + len(names))
        self._kind = instance.fmu.variables[names[0]].type
        self._port = instance.port(names, self._kind)
        self._warned = False

    def read(self) -> None:
        """Read them into the store."""
        self._instance.read(self._port)
        values: list[Any] = self._port.get()
        if self._kind in EXCHANGED_EXACTLY:
            self._store.exact[self._place] = values
        if self._kind in TEXTS:
            return
        self._store.values[self._place] = values
        if not self._warned and self._kind in EXCHANGED_EXACTLY and max(map(abs, values)) > LARGEST_EXACT:
            self._warned = True
            name = f"{self._instance.name}.{self._names[0]}"
            logger.warning("%s is larger than 2^53: components receive it exactly, results hold the nearest float", name)


class Member:
    """A running component: its instance, its ports, and the sources of its inputs.

    Parameters
    ----------
    plan : ComponentPlan
        What it is.
    instance : Instance
        Its FMU.
    store : Store
        The values of the whole run; its own stand together there.
    number : int
        Its own, among the components in stepping order.
    position : Position
        Where it notes that its FMU is called.

    Attributes
    ----------
    every : int
        It steps at every n-th communication point.
    refused : int
        Steps, whole or parts, that its FMU has refused.
    """

    def __init__(self, plan: ComponentPlan, instance: Instance, store: Store, number: int, position: Position) -> None:
        self.name, self.number, self.every = plan.name, number, plan.every
        self.instance, self._store, self._position = instance, store, position
        self.refused = 0
        reals = {sent: names for kind, sent, names in plan.ports if kind == "Real" and not plan.fmu.clocks_of(names[0])}
        sent, recorded = reals.get(True, []), reals.get(False, [])
        begin = store.places[plan.name, plan.read[0]] if plan.read else 0
        y = store.values[begin : begin + len(sent) + len(recorded)]
        self.sent: Port = instance.port(sent, values=y[: len(sent)])
        self.outputs: Port = instance.port([*sent, *recorded], values=y)
        wires = [(c, None if c.is_plain else Channel(c)) for c in plan.connections]
        direct: list[Wire] = []
        by_type: dict[tuple[str, tuple[int, ...], bool], list[Wire]] = {}
        by_value = set_by_value(plan, instance)
        for wire in wires:
            name = wire[0].input
            continuous = plan.fmu.model_exchange and plan.fmu.is_continuous(name)
            kind = plan.fmu.variables[name].type, plan.fmu.clocks_of(name), continuous
            (by_type.setdefault(kind, []) if name in by_value else direct).append(wire)
        self.inputs_by_type = [InputsOfType(plan, kind, instance, store, group) for (kind, *_), group in by_type.items()]
        self.outputs_by_type = [
            OutputsOfType(instance, names, store, store.places[plan.name, names[0]], sent=sent)
            for kind, sent, names in plan.ports
            if names not in reals.values()
        ]
        self.channels = [(i, channel) for i, (_, channel) in enumerate(direct) if channel is not None]
        self.all_channels = [channel for _, channel in wires if channel is not None]
        sources = np.array([store.places[c.sender, c.output] for c, _ in direct], dtype=np.intp)
        inputs = [c.input for c, _ in direct]
        side_by_side = bool((np.diff(sources) == 1).all())
        if inputs and side_by_side and not self.channels:  # the FMU reads them where they stand
            self.inputs: Port = instance.port(inputs, values=store.arrived[sources[0] : sources[0] + len(inputs)])
            self._gather: Callable[[], object] | None = None
        else:
            self.inputs = instance.port(inputs)
            self._gather = partial(store.arrived.take, sources, None, self.inputs.values, "clip") if inputs else None

    def call(self) -> Instance:
        """Note that its FMU is about to be called, and return that."""
        self._position[COMPONENT] = self.number
        return self.instance

    def set(self, values: Mapping[str, Value]) -> None:
        """Set unconnected inputs."""
        self.call().set_start(values)
        for group in self.inputs_by_type:
            group.keep(values)

    def receive(self, tick: int) -> None:
        """Fetch the inputs from what the others sent, and set them."""
        self._position[COMPONENT] = self.number
        if self._gather is not None:
            self._gather()
            u = self.inputs.values
            for i, channel in self.channels:
                u[i] = channel(float(u[i]), tick)
        if self.inputs.size:
            self.instance.write(self.inputs)
        for group in self.inputs_by_type:
            group.receive(tick)

    def advance(self, time: ctypes.c_double, size: ctypes.c_double, *, full: bool) -> bool:
        """Step and read outputs (all of them if ``full``), maybe in a thread; False if the FMU discarded the step."""
        if not self.instance.step(time, size):
            return False
        self._read(full=full)
        return True

    def read(self, *, full: bool) -> None:
        """Read what others receive, or everything that is recorded too."""
        self.call()
        self._read(full=full)

    def _read(self, *, full: bool) -> None:
        outputs = self.outputs if full else self.sent
        if outputs.size:
            self.instance.read(outputs)
        for group in self.outputs_by_type:
            if full or group.sent:
                group.read()


class SlowMember(Member):
    """A component that steps at every n-th communication point, over the n steps that end there; see ``Member``.

    Its inputs are those of the last of these steps.
    """

    _tick = 0

    def receive(self, tick: int) -> None:
        """Fetch the inputs from what the others sent, and set them."""
        self._tick = tick
        super().receive(tick)

    def advance(self, time: ctypes.c_double, size: ctypes.c_double, *, full: bool) -> bool:  # noqa: ARG002
        """Step, in as many parts as the others do the last of the n steps, and read all outputs."""
        scenario = self._store.plan.scenario
        parts = round(scenario.step / size.value)
        length = ctypes.c_double(self.every * size.value)
        begin = scenario.seconds(self._tick - self.every)
        for part in range(parts):
            if not self.instance.step(ctypes.c_double(begin + part * length.value), length):
                return False
            if self.instance.ended_at is not None and part < parts - 1:
                return False
        self._read(full=True)
        return True
