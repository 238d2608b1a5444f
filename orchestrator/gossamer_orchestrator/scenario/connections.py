"""The connections of a scenario: their ends and units, the loops that they close, and the order in which components step.

Groups that are iterated, and the steps of components, are checked here too.
"""

from __future__ import annotations

import logging
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import TypeVar

from ..fmi.file import FmuFile
from ..fmi.types import FLOATS, NUMBERS, conversion, holds, mismatch
from ..names import split_endpoint, split_indices, suggest
from .schema import Connection, Scenario
from .source import Problems

logger = logging.getLogger(__name__)
_PAIRS = 10_000  # of inputs and outputs that depend on each other, up to which each is an edge of the graph


@dataclass(frozen=True)
class Draft:
    """A scenario with the FMUs of its components, by name, that is checked: mistakes go to ``problems``."""

    scenario: Scenario
    files: Mapping[str, FmuFile]
    problems: Problems


def check_connections(draft: Draft) -> tuple[list[Connection], dict[str, int]]:
    """Check the connections.

    Returns
    -------
    right : list of Connection
        The right ones, one per scalar: arrays are connected element by element, and units are converted.
    fed : dict of str to int
        By input ``component.input``, the number of the right or wrong connection that is meant to feed it.
    """
    right: list[Connection] = []
    fed: dict[str, int] = {}
    for i, whole in enumerate(draft.scenario.connections):
        each = _elements(draft, i, whole, fed)
        right += [_convert(draft, i, connection) for connection in each if _check_ends(draft, i, connection, fed)]
    return right, fed


def _elements(draft: Draft, i: int, whole: Connection, fed: dict[str, int]) -> list[Connection]:
    """Return a connection of scalars as it is, and one of arrays as one per element."""
    shapes, lists = [], []
    for component, name in ((whole.sender, whole.output), (whole.receiver, whole.input)):
        fmu = draft.files.get(component)
        found = fmu.elements(name) if fmu is not None and name not in fmu.variables else []
        lists.append(found)
        shapes.append(split_indices(found[-1])[1] if found else ())
    if not any(lists):
        return [whole]
    if shapes[0] != shapes[1] or len(lists[0]) != len(lists[1]):
        sizes = [f"an array of {' x '.join(map(str, shape))} elements" if shape else "a scalar" for shape in shapes]
        element = next(names[0] for names in lists if names)
        text = (
            f"{whole.origin!r} is {sizes[0]} and {whole.target!r} is {sizes[1]}. "
            f"Connect arrays of one size, or one element, such as {element!r}."
        )
        draft.problems.add(("connections", i, "to"), text)
        for name in lists[1] or [whole.input]:
            fed.setdefault(f"{whole.receiver}.{name}", i)
        return []
    return [
        whole.model_copy(update={"origin": f"{whole.sender}.{a}", "target": f"{whole.receiver}.{b}"})
        for a, b in zip(*lists, strict=True)
    ]


def _check_ends(draft: Draft, i: int, connection: Connection, fed: dict[str, int]) -> bool:
    """Tell whether both ends are there and fit each other, and note what they feed."""
    files, problems = draft.files, draft.problems
    explained = {
        "from": _explain_endpoint(connection.origin, "output", files),
        "to": _explain_endpoint(connection.target, "input", files),
    }
    if all(explained.values()) and _is_swapped(connection, files):
        text = f"{connection.origin!r} is an input and {connection.target!r} an output. Swap from and to."
        problems.add(("connections", i, "from"), text)
        fed.setdefault(connection.origin, i)
        return False
    for key, problem in explained.items():
        if problem:
            problems.add(("connections", i, key), problem)
    if explained["to"]:
        return False
    if connection.target in fed:
        line = problems.source.where(("connections", fed[connection.target], "to"))
        text = f"input {connection.target!r} is connected twice, first at {line}. Remove one of the connections."
        problems.add(("connections", i, "to"), text)
        return False
    fed[connection.target] = i
    if explained["from"]:
        return False
    sent = files[connection.sender].variables[connection.output].type
    received = files[connection.receiver].variables[connection.input].type
    kinds = f"{connection.origin!r} is of type {sent} and {connection.target!r} of type {received}"
    numbers = {sent, received} <= set(NUMBERS)
    if not holds(received, sent) and not (numbers and connection.gain is not None):
        advice = "State a 'gain' if values are to be rounded" if numbers else "Connect variables of one type"
        problems.add(("connections", i, "to"), f"{kinds}, which does not hold all its values. {advice}.")
        return False
    if sent != received:
        logger.info("%s: values are converted", kinds)
    if received not in FLOATS:
        for key in ("noise", "dropout") if sent != received else ("gain", "bias", "noise", "dropout"):
            if getattr(connection, key) is not None:
                text = f"{connection.target!r} is of type {received}, and only a Real can have a {key}. Remove it."
                problems.add(("connections", i, key), text)
    return True


def _is_swapped(connection: Connection, files: Mapping[str, FmuFile]) -> bool:
    """Tell whether a connection would be right the other way round."""
    other_way = ((connection.target, "output"), (connection.origin, "input"))
    return not any(_explain_endpoint(endpoint, causality, files) for endpoint, causality in other_way)


def _explain_endpoint(endpoint: str, causality: str, files: Mapping[str, FmuFile]) -> str | None:
    """Say why an endpoint is not an output or input; None if it is one."""
    component, name = split_endpoint(endpoint)
    if component not in files:
        return f"there is no component {component!r} (in {endpoint!r}). {suggest(component, files)}"
    fmu = files[component]
    if name not in fmu.variables:
        return f"FMU {fmu.name!r} has no {causality} {name!r}. {suggest(name, fmu.names(causality))}"
    variable = fmu.variables[name]
    if variable.causality != causality:
        return (
            f"{endpoint!r} is a {variable.type} {variable.causality}; a connection needs a {variable.type} {causality}. "
            f"{suggest(name, fmu.names(causality, kind=variable.type))}"
        )
    return None


def _convert(draft: Draft, i: int, connection: Connection) -> Connection:
    """Return a connection that converts units, if both ends have one and the scenario does not convert them itself."""
    sender, receiver = draft.files[connection.sender], draft.files[connection.receiver]
    a, b = sender.unit_definition(connection.output), receiver.unit_definition(connection.input)
    difference = mismatch(sender.unit(connection.output), a, receiver.unit(connection.input), b)
    if difference is None:
        return connection
    converted = conversion(a, b)
    if converted is None:
        text = f"units of {connection.origin!r} and {connection.target!r}: {difference}. Connect variables of one unit."
        draft.problems.add(("connections", i, "to"), text)
        return connection
    if connection.gain is not None or connection.bias is not None:
        return connection
    gain, bias = converted
    logger.info("%s to %s: units are converted: %s", connection.origin, connection.target, difference)
    return connection.model_copy(update={"gain": gain, "bias": bias or None})


Node = TypeVar("Node", bound=Hashable)


def find_cycle(edges: Mapping[Node, Iterable[Node]]) -> list[Node]:
    """Find a cycle of a directed graph.

    Parameters
    ----------
    edges : mapping of node to its successors
        Nodes that only appear as successors need no entry.

    Returns
    -------
    list of node
        The nodes along a cycle, the first one repeated at the end; empty if there is none.
    """
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        cycle: list[Node] = error.args[1]
        return cycle[::-1]  # the sorter takes successors for predecessors
    return []


def sort_components(names: Iterable[str], edges: Mapping[str, Iterable[str]]) -> list[str]:
    """Order components so that each stands after those that feed it; ties keep the order of ``names``.

    Within a cycle the first component of ``names`` goes first.
    """
    waiting = list(names)
    order: list[str] = []
    while waiting:
        fed = {target for name in waiting for target in edges.get(name, ()) if target != name}
        ready = next((name for name in waiting if name not in fed), None) or _first_of_a_cycle(waiting, edges)
        order.append(ready)
        waiting.remove(ready)
    return order


def _first_of_a_cycle(names: list[str], edges: Mapping[str, Iterable[str]]) -> str:
    """Return the first component that only those of its own cycle feed."""
    before = {name: _upstream(name, names, edges) for name in names}
    return next(name for name in names if all(name in before[other] for other in before[name]))


def _upstream(name: str, names: Iterable[str], edges: Mapping[str, Iterable[str]]) -> set[str]:
    """Find all that feed a component through others of ``names``."""
    found: set[str] = set()
    new = {name}
    while new:
        new = {other for other in names if not new.isdisjoint(edges.get(other, ()))} - found
        found |= new
    return found


def sort_grouped(names: Iterable[str], edges: Mapping[str, Iterable[str]], groups: Iterable[list[str]]) -> list[str]:
    """Order components like ``sort_components``, with those of each group side by side."""
    inside = {group[0]: group for group in groups}
    home = {name: first for first, group in inside.items() for name in group}
    outer: dict[str, list[str]] = {}
    for name, targets in edges.items():
        outer.setdefault(home.get(name, name), []).extend(home.get(target, target) for target in targets)
    order = sort_components(dict.fromkeys(home.get(name, name) for name in names), outer)
    return [member for name in order for member in sort_components(inside.get(name, [name]), edges)]


def order_components(
    draft: Draft, connections: Iterable[Connection], fed: Mapping[str, int], joined: Iterable[list[str]] = ()
) -> tuple[list[str], list[str]]:
    """Return the orders of initialization and of stepping, and report orders that are not possible.

    Under Gauss-Seidel a connection from a later to an earlier component delays by one step. That is said where the
    scenario does not state the order, or where it breaks an algebraic loop. Under Jacobi every connection delays. Within a
    group nothing delays.
    """
    scenario, files, problems = draft.scenario, draft.files, draft.problems
    groups = [group.components for group in scenario.groups if set(group.components) <= set(files)] + [*joined]
    pairs = {(connection.sender, connection.receiver) for connection in connections if not connection.delayed}
    feeds = {name: [other for other in files if (name, other) in pairs] for name in files}
    start_order = sort_grouped(files, feeds, groups)
    if scenario.order is not None:
        _check_stated_order(draft, scenario.order, feeds)
    order = scenario.order or start_order
    place = {name: i for i, name in enumerate(order)}
    iterated = {c.target for c in connections if any({c.sender, c.receiver} <= set(group) for group in groups)}
    for c in connections if scenario.master == "gauss-seidel" else ():
        early = place.get(c.sender, len(place)) < place.get(c.receiver, -1)
        if c.delayed and (early or c.target in iterated):
            inside, before = ("both ends are in a group, where nothing delays", f"{c.sender!r} steps before {c.receiver!r}")
            text = f"the connection {c.origin} -> {c.target} does not delay: {inside if c.target in iterated else before}."
            problems.add(("connections", fed[c.target], "delayed"), f"{text} Remove 'delayed', or change the order.")
    connections = [c for c in connections if not c.delayed]
    late = {c.target: c for c in connections if place.get(c.sender, -1) >= place.get(c.receiver, len(order))}
    delayed = [c for target, c in late.items() if target not in iterated]
    loop = _find_loop(files, [c for c in connections if c.target not in late.keys() & iterated])
    if scenario.master == "gauss-seidel" and (loop or scenario.order is None):
        why = f"algebraic loop {' -> '.join('.'.join(node) for node in loop)}" if loop else "components feed each other"
        for connection in delayed:
            where = scenario.source.where(("connections", fed[connection.target]))
            between = _lies_between(connection, feeds, groups)
            advice = "Choose a smaller 'step'" if between else "State another 'order', a smaller 'step', or a group"
            text = "%s: %s: the connection %s -> %s delays by one step. %s"
            logger.warning(text, where, between or why, connection.origin, connection.target, advice)
    return start_order, order


def _lies_between(c: Connection, feeds: Mapping[str, list[str]], groups: Iterable[list[str]]) -> str:
    """Say which components step as one, if only that delays a connection: apart from them its receiver feeds no sender."""
    for group in groups:
        fed = {name: [other for other in feeds if name in feeds[other]] for name in feeds}
        others = [name for name in feeds if name not in group]
        before, after = (set[str]().union(*(_upstream(name, feeds, edges) for name in group)) for edges in (feeds, fed))
        between = [name for name in (c.sender, c.receiver) if name in others]
        circle = c.receiver in {c.sender} | _upstream(c.sender, others, feeds)
        if between and not circle and {*between} <= before & after:
            return f"{', '.join(group)} step as one, and {between[0]!r} lies between them"
    return ""


def _find_loop(files: Mapping[str, FmuFile], connections: Iterable[Connection]) -> list[tuple[str, str]]:
    """Find a circle of signals in which every value depends on itself at the same instant."""
    signals: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for c in connections:
        signals.setdefault((c.sender, c.output), []).append((c.receiver, c.input))
    for name, fmu in files.items():
        for k, (outputs, inputs) in enumerate(fmu.feedthrough()):
            ends = [(name, output) for output in outputs]
            if len(inputs) * len(outputs) > _PAIRS:
                hub = ("", f"{name} {k}")  # all go through one node
                signals[hub], ends = ends, [hub]
            for source in inputs:
                signals.setdefault((name, source), []).extend(ends)
    loop = [node for node in find_cycle(signals)[1:] if node[0]]
    return [*loop[-1:], *loop]


def _check_stated_order(draft: Draft, order: list[str], feeds: Mapping[str, list[str]]) -> None:
    scenario, problems = draft.scenario, draft.problems
    if scenario.master == "jacobi":
        problems.add(("order",), "'order' has no meaning for master = \"jacobi\". Remove it.")
    for name in order:
        if name not in feeds:
            problems.add(("order",), f"'order' names a component {name!r} that is not there. {suggest(name, feeds)}")
    if sorted(order) != sorted(feeds):
        missing = [name for name in feeds if name not in order]
        what = f"; missing: {', '.join(missing)}" if missing else ""
        problems.add(("order",), f"'order' must name every component once{what}.")
        return
    for group in scenario.groups:
        places = [order.index(name) for name in group.components]
        if max(places) - min(places) >= len(places):
            text = f"the components of the group {', '.join(group.components)} must stand side by side in 'order'."
            problems.add(("order",), text)


def check_groups(draft: Draft, connections: Iterable[Connection]) -> None:
    """Report groups that cannot be iterated; the connections are those that are right."""
    scenario, files, problems = draft.scenario, draft.files, draft.problems
    if scenario.groups and scenario.master == "jacobi":
        text = 'a group is stepped one component after another, which master = "jacobi" is not. Remove one of the two.'
        problems.add(("groups",), text)
    homes: dict[str, int] = {}
    for i, group in enumerate(scenario.groups):
        place = ("groups", i, "components")
        for name in group.components:
            if name not in files:
                problems.add(place, f"there is no component {name!r}. {suggest(name, files)}")
                continue
            if name in homes:
                where = "twice in this group" if homes[name] == i else "in another group, too"
                problems.add(place, f"component {name!r} stands {where}. Name it once.")
                continue
            homes[name] = i
            if not files[name].interface.canGetAndSetFMUstate:
                text = f"FMU {files[name].name!r} of component {name!r} cannot restore its state (canGetAndSetFMUstate)"
                problems.add(place, f"{text}, so its step cannot be repeated. Remove it from the group.")
        names = set(group.components)
        if names <= set(files) and not any({c.sender, c.receiver} <= names for c in connections):
            problems.add(place, "the group's components are not connected to each other. Remove the group.")


def join_exchange(draft: Draft, connections: Iterable[Connection]) -> list[list[str]]:
    """List the FMUs for model exchange that are integrated as one system, because they feed each other.

    Those that cannot be are integrated one by one, to first order in the step, which a warning says.
    """
    files = draft.files
    inside = [c for c in connections if files[c.sender].model_exchange and files[c.receiver].model_exchange]
    systems: list[set[str]] = []
    for c in inside:
        ends = {c.sender, c.receiver}
        touched = [system for system in systems if system & ends]
        systems = [system for system in systems if system not in touched] + [ends.union(*touched)]
    joined = []
    for system in systems:
        names = [name for name in files if name in system]
        why = _why_apart(draft, names, [c for c in inside if c.sender in system])
        if why:
            warn_of_apart(draft.scenario, names, why)
        else:
            joined.append(names)
    return joined


def _why_apart(draft: Draft, names: list[str], inside: Iterable[Connection]) -> str:
    """Say why FMUs for model exchange that feed each other are not integrated as one system; empty if they are."""
    scenario, files = draft.scenario, draft.files
    if scenario.master == "jacobi":
        return 'master = "jacobi" delays every connection'
    grouped = {name for group in scenario.groups for name in group.components}
    for name in names:
        if name in grouped:
            return f"{name} is in a group"
        if scenario.components[name].every > 1:
            return f"{name} does not take every step"
        if files[name].clocks:
            return f"{name} has clocks"
    places = [scenario.order.index(name) for name in names if name in scenario.order] if scenario.order else []
    if places and max(places) - min(places) >= len(names):
        return "they do not stand side by side in 'order'"
    for c in inside:
        for key in ("noise", "dropout", "delayed"):
            if getattr(c, key):
                return f"{c.origin} -> {c.target} has {key!r}"
        if files[c.sender].is_continuous(c.output) and not files[c.receiver].is_continuous(c.input):
            return f"{c.target} may change in events only, and {c.origin} changes at any time"
    return ""


def warn_of_apart(scenario: Scenario, names: Iterable[str], why: str) -> None:
    """Say that FMUs for model exchange which feed each other are integrated one by one, so to first order in the step."""
    logger.warning(
        "%s: %s are for model exchange and connected, but %s: each is integrated by itself, with inputs held over a step, "
        "so results are of first order in 'step'. Halve it to see what that changes, or export them as one FMU",
        scenario.source.where(("step",)),
        ", ".join(names),
        why,
    )


def check_steps(draft: Draft) -> None:
    """Report steps of components that do not fit the run, and FMUs that the step control cannot take back."""
    scenario, files, problems = draft.scenario, draft.files, draft.problems
    grouped = {name for group in scenario.groups for name in group.components}
    for name, component in scenario.components.items():
        place = ("components", name, "every")
        if scenario.ticks % component.every:
            text = f"the run has {scenario.ticks} steps, which {component.every} does not divide"
            problems.add(place, f"{text}. Choose another 'every', 'step' or 'stop'.")
        if component.every > 1 and name in grouped:
            problems.add(place, f"component {name!r} is in a group, whose components step together. Remove one of the two.")
    unable = sorted({file.name for file in files.values() if not file.can_repeat})
    if scenario.step_control is not None and unable:
        text = f"{', '.join(unable)} cannot restore its state or vary its step, so its steps cannot be controlled"
        problems.add(("step_control",), f"{text}. Remove the table, or use a smaller 'step'.")
