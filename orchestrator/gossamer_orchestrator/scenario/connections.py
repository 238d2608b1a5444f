"""Check the connections of a scenario: their ends exist, have the right causality, and agree in their units."""

from __future__ import annotations

from collections.abc import Mapping

from ..fmi.file import FmuFile
from ..fmi.units import conversion, mismatch
from ..names import split_endpoint, suggest
from .schema import Connection, Scenario
from .source import Problems


def check_connections(
    scenario: Scenario, files: Mapping[str, FmuFile], problems: Problems
) -> tuple[list[Connection], set[str]]:
    """Return the right connections, and all inputs ``component.input`` that right or wrong ones are meant to feed."""
    right: list[Connection] = []
    fed: dict[str, int] = {}
    for i, connection in enumerate(scenario.connections):
        explained = {
            "from": _explain_endpoint(connection.origin, "output", files),
            "to": _explain_endpoint(connection.target, "input", files),
        }
        if all(explained.values()) and _is_swapped(connection, files):
            text = f"{connection.origin!r} is an input and {connection.target!r} an output. Swap from and to."
            problems.add(("connections", i, "from"), text)
            fed.setdefault(connection.origin, i)
            continue
        for key, problem in explained.items():
            if problem:
                problems.add(("connections", i, key), problem)
        if explained["to"]:
            continue
        if connection.target in fed:
            line = scenario.source.where(("connections", fed[connection.target], "to"))
            text = f"input {connection.target!r} is connected twice, first at {line}. Remove one of the connections."
            problems.add(("connections", i, "to"), text)
            continue
        fed[connection.target] = i
        if explained["from"]:
            continue
        _check_units(i, connection, files, problems)
        right.append(connection)
    return right, set(fed)


def _is_swapped(connection: Connection, files: Mapping[str, FmuFile]) -> bool:
    """Tell whether a connection would be right the other way round."""
    other_way = ((connection.target, "output"), (connection.origin, "input"))
    return not any(_explain_endpoint(endpoint, causality, files) for endpoint, causality in other_way)


def _explain_endpoint(endpoint: str, causality: str, files: Mapping[str, FmuFile]) -> str | None:
    """Say why an endpoint is not a Real output or input; None if it is one."""
    component, name = split_endpoint(endpoint)
    if component not in files:
        return f"there is no component {component!r} (in {endpoint!r}). {suggest(component, files)}"
    fmu = files[component]
    if name not in fmu.variables:
        return f"FMU {fmu.name!r} has no {causality} {name!r}. {suggest(name, fmu.names(causality))}"
    variable = fmu.variables[name]
    if variable.causality != causality or variable.type != "Real":
        return (
            f"{endpoint!r} is a {variable.type} {variable.causality}; a connection needs a Real {causality}. "
            f"{suggest(name, fmu.names(causality, kind='Real'))}"
        )
    return None


def _check_units(i: int, connection: Connection, files: Mapping[str, FmuFile], problems: Problems) -> None:
    sender, receiver = files[connection.sender], files[connection.receiver]
    a, b = sender.unit_definition(connection.output), receiver.unit_definition(connection.input)
    difference = mismatch(sender.unit(connection.output), a, receiver.unit(connection.input), b)
    converted = conversion(a, b)
    if difference is None or (converted and (connection.gain is not None or connection.bias is not None)):
        return
    advice = "Connect variables of one unit."
    if converted:
        gain, bias = converted
        advice = f"Convert with gain = {gain:g}{f', bias = {bias:g}' if bias else ''}."
    text = f"units of {connection.origin!r} and {connection.target!r}: {difference}. {advice}"
    problems.add(("connections", i, "to"), text)
