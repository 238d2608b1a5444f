"""Inputs and outputs that do not go straight through the array of floats: other types, and partly connected arrays."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..fmi.instance import Instance
from ..fmi.types import EXCHANGED_EXACTLY, LARGEST_EXACT, TEXTS, Value, cast, parse
from ..scenario.plan import ComponentPlan
from ..scenario.schema import Connection
from .channel import Channel
from .store import Store

logger = logging.getLogger(__name__)

Wire = tuple[Connection, Channel | None]


def needs_values(plan: ComponentPlan, instance: Instance, name: str) -> bool:
    """Tell whether a connected input is set by value: no Real, in a partly connected array, or only in event mode."""
    variable, array = plan.fmu.variables[name], plan.fmu.array_of(name)
    if variable.type != "Real" or (instance.event_mode and variable.variability == "discrete"):
        return True
    return (
        array is not None
        and [c.input for c in plan.connections if plan.fmu.array_of(c.input) == array] != (plan.fmu.arrays[array])
    )


class TypedInputs:
    """Inputs of one type, set together; elements of arrays that are not connected keep their values.

    Parameters
    ----------
    instance : Instance
        Whose inputs.
    kind : str
        Their type.
    names : sequence of str
        All of them, whole arrays.
    store : Store
        Where their values arrive.
    wires : iterable of (Connection, Channel or None)
        What feeds them.
    start : mapping
        Values of those that nothing feeds.
    """

    def __init__(
        self,
        instance: Instance,
        kind: str,
        names: Sequence[str],
        store: Store,
        wires: Iterable[Wire],
        start: Mapping[str, Value],
    ) -> None:
        self._instance, self._store, self._kind = instance, store, kind
        self._port = instance.typed_port(kind, names)
        self._index = {name: i for i, name in enumerate(names)}
        variables = instance.fmu.variables
        self._values: list[Any] = [start.get(name, parse(kind, variables[name].start)) for name in names]
        self._sources = [(self._index[c.input], store.places[c.sender, c.output], channel) for c, channel in wires]
        self._exact = kind in EXCHANGED_EXACTLY
        self._last: list[Any] = []

    def keep(self, values: Mapping[str, Value]) -> None:
        """Take over new values of elements that nothing feeds."""
        for name, value in values.items():
            if name in self._index:
                self._values[self._index[name]] = value

    def receive(self, tick: int) -> None:
        """Fetch the values and set the inputs; in event mode only if one has changed."""
        floats, exact = self._store.arrived, self._store.exact_arrived
        for i, place, channel in self._sources:
            if self._exact:
                self._values[i] = exact[place]
            else:
                value = float(floats[place])
                self._values[i] = cast(self._kind, value if channel is None else channel(value, tick))
        self._instance.write_inputs(self._port, self._values)


class TypedOutputs:
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
        self._port = instance.typed_port(self._kind, names)
        self._told = False

    def read(self) -> None:
        """Read them into the store."""
        values: list[Any] = self._instance.read_typed(self._port)
        if self._kind in EXCHANGED_EXACTLY:
            self._store.exact[self._place] = values
        if self._kind in TEXTS:
            return
        self._store.values[self._place] = values
        if not self._told and self._kind in EXCHANGED_EXACTLY and max(map(abs, values)) > LARGEST_EXACT:
            self._told = True
            name = f"{self._instance.name}.{self._names[0]}"
            logger.warning(
                "%s is larger than 2^53: components receive it exactly, results hold the nearest float", name
            )


def typed_inputs(plan: ComponentPlan, instance: Instance, store: Store, wires: Sequence[Wire]) -> list[TypedInputs]:
    """Group those inputs of a component that are set by value by their types."""
    groups: dict[str, list[Wire]] = {}
    for wire in wires:
        if needs_values(plan, instance, wire[0].input):
            groups.setdefault(plan.fmu.variables[wire[0].input].type, []).append(wire)
    return [
        TypedInputs(instance, kind, plan.fmu.whole([c.input for c, _ in group]), store, group, plan.start)
        for kind, group in groups.items()
    ]


def typed_outputs(plan: ComponentPlan, instance: Instance, store: Store) -> list[TypedOutputs]:
    """Group what is read of a component besides Reals: neighbours in the store of one type, sent or only recorded."""
    groups: list[TypedOutputs] = []
    for names, sent in ((plan.sent, True), (plan.recorded, False)):
        by_type: dict[str, list[str]] = {}
        for name in names:
            by_type.setdefault(plan.fmu.variables[name].type, []).append(name)
        by_type.pop("Real", None)
        groups += [
            TypedOutputs(instance, group, store, store.places[plan.name, group[0]], sent=sent)
            for group in by_type.values()
        ]
    return groups
