"""Values that a scenario gives to an FMU's variables, by name or by pattern."""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Mapping
from typing import Any

from ..fmi.file import FmuFile
from ..names import is_pattern, matches, suggest
from .schema import Value
from .source import Location, Problems

logger = logging.getLogger(__name__)


def expand(
    place: Location,
    given: Mapping[str, Value],
    fmu: FmuFile,
    candidates: list[str],
    kind: str,
    problems: Problems,
) -> dict[str, Value]:
    """Resolve names and patterns to values; a name beats a pattern, a later pattern an earlier one.

    What is refused is among the values too, so that nobody reports it as missing.
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
        return f"{name!r} is a parameter: put it under parameters; it is fixed during the run."
    if other == "input":
        return f"{name!r} is an input: put it under inputs."
    return f"FMU {fmu.name!r} has no {kind} {name!r}. {suggest(name, candidates)}"


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
    largest = sys.float_info.max if kind is float else 2**31 - 1
    if abs(value) > largest:
        return f"is a {variable.type} and cannot be larger than {largest:g}."
    low = -math.inf if variable.min is None else float(variable.min)
    high = math.inf if variable.max is None else float(variable.max)
    if low <= value <= high:
        return None
    unit = "" if unit in (None, "1") else f" {unit}"
    return f"must lie in {low:g} to {high:g}{unit}, not {value:g}."
