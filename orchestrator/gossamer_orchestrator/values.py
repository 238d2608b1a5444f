"""Values that a scenario gives to an FMU's variables, by name or by pattern."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .fmu import FmuFile
from .names import is_pattern, matches, suggest
from .scenario import Value
from .source import Location, Problems


def expand(
    place: Location,
    given: Mapping[str, Value],
    fmu: FmuFile,
    candidates: list[str],
    kind: str,
    problems: Problems,
) -> dict[str, Value]:
    """Resolve names and patterns to values; a name beats a pattern, a later pattern an earlier one."""
    values: dict[str, Value] = {}
    for key, value in sorted(given.items(), key=lambda item: not is_pattern(item[0])):
        found = [v for v in candidates if (matches(key, v) if is_pattern(key) else key == v)]
        if not found:
            problems.add((*place, key), f"FMU {fmu.name!r} has no {kind} {key!r}. {suggest(key, candidates)}")
        for name in found:
            complaint = _explain_value(fmu.variables[name], value, fmu.unit(name))
            if complaint:
                problems.add((*place, key), f"{kind} {name!r} of FMU {fmu.name!r} {complaint}")
                break
            values[name] = value
    return values


def _explain_value(variable: Any, value: Value, unit: str | None) -> str | None:  # noqa: ANN401
    """Say why a variable cannot have a value; None if it can."""
    kinds = {"Boolean": bool, "String": str, "Integer": int, "Enumeration": int}
    kind = kinds.get(variable.type, float)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    fits = number if kind is float else isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
    if not fits:
        return f"is a {variable.type} and cannot be {value!r}."
    if isinstance(value, str | bool):
        return None
    low = -math.inf if variable.min is None else float(variable.min)
    high = math.inf if variable.max is None else float(variable.max)
    if low <= value <= high:
        return None
    unit = "" if unit in (None, "1") else f" {unit}"
    return f"must lie in {low:g} to {high:g}{unit}, not {value:g}."
