"""Values that a scenario gives to an FMU's variables, by name or by pattern."""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Mapping
from typing import Any

from ..fmi.file import FmuFile
from ..names import is_pattern, matches, suggest
from .schema import Component, Value
from .source import Location, Problems

logger = logging.getLogger(__name__)


def start_values(
    name: str, component: Component, fmu: FmuFile, connected: set[str], fed: set[str], problems: Problems
) -> dict[str, Value]:
    """Return the parameters and unconnected inputs that a scenario sets of a component.

    Parameters
    ----------
    name, component, fmu : str, Component, FmuFile
        The component.
    connected, fed : set of str
        Inputs ``component.input`` that right connections feed, and that right or wrong ones are meant to feed.
    problems : Problems
        Receives the mistakes.

    Returns
    -------
    dict
        Values by name.
    """
    place: Location = ("components", name)
    parameters = expand(
        (*place, "parameters"), component.parameters, fmu, fmu.names("parameter"), "parameter", problems
    )
    for key in component.inputs:
        if f"{name}.{key}" in connected:
            text = f"input '{name}.{key}' is connected and given a value. Remove one of the two."
            problems.add((*place, "inputs", key), text)
    inputs = expand((*place, "inputs"), component.inputs, fmu, fmu.names("input"), "input", problems)
    missing = [v for v in fmu.names("input") if f"{name}.{v}" not in fed and v not in inputs]
    if missing:
        shown = ", ".join(missing[:6]) + (", ..." if len(missing) > 6 else "")
        starts = ", ".join(f'"{v}" = {fmu.variables[v].start}' for v in missing[:2])
        problems.add(
            place,
            f"component {name!r} has inputs that are neither connected nor given: {shown}. "
            f"Connect them or add inputs = {{ {starts} }}.",
        )
    return parameters | {v: value for v, value in inputs.items() if f"{name}.{v}" not in connected}


def expand(
    place: Location,
    given: Mapping[str, Value],
    fmu: FmuFile,
    candidates: list[str],
    kind: str,
    problems: Problems,
) -> dict[str, Value]:
    """Resolve names and patterns to values; a name beats a pattern, a later pattern an earlier one.

    Refused values are returned too, so that they are not reported as missing.
    """
    values: dict[str, Value] = {}
    for key, value in sorted(given.items(), key=lambda item: not is_pattern(item[0])):
        found = [v for v in candidates if (matches(key, v) if is_pattern(key) else key == v)]
        if not found:
            problems.add((*place, key), _explain_name(key, fmu, candidates, kind))
        if len({fmu.unit(name) for name in found}) > 1:
            where, names = problems.source.where((*place, key)), ", ".join(found)
            logger.warning("%s: %r sets variables of different units to %s: %s", where, key, value, names)
        values |= dict.fromkeys(found, value)
        complaints = ((name, _explain_value(fmu.variables[name], value, fmu.unit(name))) for name in found)
        for name, complaint in complaints:
            if complaint:
                problems.add((*place, key), f"{kind} {name!r} of FMU {fmu.name!r} {complaint}")
                break
    return values


def _explain_name(name: str, fmu: FmuFile, candidates: list[str], kind: str) -> str:
    """Say why there is no input or parameter of a name."""
    other = fmu.variables[name].causality if name in fmu.variables else None
    if other == "parameter":
        return f"{name!r} is a parameter, which is fixed during the run. Put it under parameters."
    if other == "input":
        return f"{name!r} is an input. Put it under inputs."
    return f"FMU {fmu.name!r} has no {kind} {name!r}. {suggest(name, candidates)}"


def _explain_value(variable: Any, value: Value, unit: str | None) -> str | None:  # noqa: ANN401
    """Say why a variable cannot have a value; None if it can."""
    kind = {"Boolean": bool, "String": str, "Integer": int, "Enumeration": int}.get(variable.type, int | float)
    if not isinstance(value, kind) or isinstance(value, bool) != (kind is bool):
        return f"is a {variable.type} and cannot be {value!r}."
    if isinstance(value, str | bool):
        return None
    largest = 2**31 - 1 if kind is int else sys.float_info.max
    if abs(value) > largest:
        return f"is a {variable.type} and cannot be larger than {largest:g}."
    low = -math.inf if variable.min is None else float(variable.min)
    high = math.inf if variable.max is None else float(variable.max)
    if low <= value <= high:
        return None
    unit = "" if unit in (None, "1") else f" {unit}"
    return f"must lie in {low:g} to {high:g}{unit}, not {value:g}."
