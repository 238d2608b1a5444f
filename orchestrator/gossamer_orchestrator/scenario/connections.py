"""Check the connections of a scenario: their ends exist, have the right causality, and agree in their units."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from ..fmi.file import FmuFile
from ..fmi.types import FLOATS
from ..fmi.units import conversion, mismatch
from ..names import split_endpoint, split_indices, suggest
from .schema import Connection, Scenario
from .source import Problems

logger = logging.getLogger(__name__)


def check_connections(
    scenario: Scenario, files: Mapping[str, FmuFile], problems: Problems
) -> tuple[list[Connection], dict[str, int]]:
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
    for i, whole in enumerate(scenario.connections):
        right += [
            _convert(i, connection, files, problems)
            for connection in _elements(i, whole, fed, files, problems)
            if _check_ends(i, connection, fed, scenario, files, problems)
        ]
    return right, fed


def _elements(
    i: int, whole: Connection, fed: dict[str, int], files: Mapping[str, FmuFile], problems: Problems
) -> list[Connection]:
    """Return a connection of scalars as it is, and one of arrays as one per element."""
    shapes, lists = [], []
    for component, name in ((whole.sender, whole.output), (whole.receiver, whole.input)):
        fmu = files.get(component)
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
        problems.add(("connections", i, "to"), text)
        for name in lists[1] or [whole.input]:
            fed.setdefault(f"{whole.receiver}.{name}", i)
        return []
    return [
        whole.model_copy(update={"origin": f"{whole.sender}.{a}", "target": f"{whole.receiver}.{b}"})
        for a, b in zip(*lists, strict=True)
    ]


def _check_ends(
    i: int,
    connection: Connection,
    fed: dict[str, int],
    scenario: Scenario,
    files: Mapping[str, FmuFile],
    problems: Problems,
) -> bool:
    """Tell whether both ends are there and fit each other, and note what they feed."""
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
        line = scenario.source.where(("connections", fed[connection.target], "to"))
        text = f"input {connection.target!r} is connected twice, first at {line}. Remove one of the connections."
        problems.add(("connections", i, "to"), text)
        return False
    fed[connection.target] = i
    if explained["from"]:
        return False
    sent = files[connection.sender].variables[connection.output].type
    received = files[connection.receiver].variables[connection.input].type
    if sent != received and not (sent in FLOATS and received in FLOATS):
        kinds = f"{connection.origin!r} is of type {sent} and {connection.target!r} of type {received}"
        text = f"{kinds}. Connect variables of one type."
        problems.add(("connections", i, "to"), text)
        return False
    if received not in FLOATS:
        for key in ("gain", "bias", "noise", "dropout"):
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


def _convert(i: int, connection: Connection, files: Mapping[str, FmuFile], problems: Problems) -> Connection:
    """Return a connection that converts units, if both ends have one and the scenario does not convert them itself."""
    sender, receiver = files[connection.sender], files[connection.receiver]
    a, b = sender.unit_definition(connection.output), receiver.unit_definition(connection.input)
    difference = mismatch(sender.unit(connection.output), a, receiver.unit(connection.input), b)
    if difference is None:
        return connection
    converted = conversion(a, b)
    if converted is None:
        text = f"units of {connection.origin!r} and {connection.target!r}: {difference}. Connect variables of one unit."
        problems.add(("connections", i, "to"), text)
        return connection
    if connection.gain is not None or connection.bias is not None:
        return connection
    gain, bias = converted
    logger.info("%s to %s: units are converted: %s", connection.origin, connection.target, difference)
    return connection.model_copy(update={"gain": gain, "bias": bias or None})
