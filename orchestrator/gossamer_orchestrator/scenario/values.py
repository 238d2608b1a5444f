"""Values that a scenario gives to an FMU's variables, by name or by pattern, and those that replace them.

``membrane.damage[1]=0.3`` replaces a value without another file.
"""

from __future__ import annotations

import json
import logging
import sys
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from textwrap import shorten
from typing import Any

from gossamer_files.options import option

from ..errors import ScenarioError, check_path
from ..fmi.file import FmuFile
from ..fmi.types import FLOATS, RANGES, parse
from ..names import is_pattern, matches, split_endpoint, split_indices, suggest
from ..words import first_few
from .connections import Draft
from .schema import Component, Given, Scenario, Value
from .source import Location, Problems

logger = logging.getLogger(__name__)


def start_values(draft: Draft, name: str, connected: set[str], fed: set[str]) -> dict[str, Value]:
    """Return the parameters and unconnected inputs that a scenario sets of a component.

    Parameters
    ----------
    draft : Draft
        Receives the mistakes.
    name : str
        The component.
    connected, fed : set of str
        Inputs ``component.input`` that right connections feed, and that right or wrong ones are meant to feed.

    Returns
    -------
    dict
        Values by name.
    """
    component, fmu, problems = draft.scenario.components[name], draft.files[name], draft.problems
    place: Location = ("components", name)
    settable = fmu.names("parameter", "structuralParameter")
    parameters = expand((*place, "parameters"), component.parameters, fmu, settable, "parameter", problems)
    for key in component.inputs:
        if any(f"{name}.{v}" in connected for v in (key, *fmu.elements(key))):
            text = f"input '{name}.{key}' is connected and given a value. Remove one of the two."
            problems.add((*place, "inputs", key), text)
    inputs = expand((*place, "inputs"), component.inputs, fmu, fmu.names("input"), "input", problems)
    fixed = [v for v in fmu.names("input") if f"{name}.{v}" not in fed and v not in inputs]
    missing = [v for v in fixed if not fmu.is_optional(v)]
    if missing:
        shown = ", ".join(missing[:6]) + (", ..." if len(missing) > 6 else "")
        starts = ", ".join(f'"{v}" = {_toml(fmu.variables[v])}' for v in missing[:2])
        problems.add(
            place,
            f"component {name!r} has inputs that are neither connected nor given: {shown}. "
            f"Connect them or add inputs = {{ {starts} }}.",
        )
    return parameters | {v: value for v, value in inputs.items() if f"{name}.{v}" not in connected}


def expand(
    place: Location, given: Mapping[str, Given], fmu: FmuFile, candidates: list[str], kind: str, problems: Problems
) -> dict[str, Any]:
    """Resolve names and patterns to values; a name beats a pattern, a later pattern an earlier one.

    An array is given whole, row by row. Refused values are returned too, so that they are not reported as missing.
    """
    values: dict[str, Any] = {}
    there = set(candidates)
    for key, value in sorted(given.items(), key=lambda item: not is_pattern(item[0])):
        found = [v for v in candidates if matches(key, v)] if is_pattern(key) else [key] if key in there else []
        if isinstance(value, list):
            elements = [] if is_pattern(key) else fmu.elements(key)
            found = [v for v in elements if v in there]
            each = _flat(value)
            if found and (complaint := _explain_shape(found, value, each)):
                problems.add((*place, key), f"{kind} {key!r} of FMU {fmu.name!r} {complaint}")
            pairs = dict(zip(found, each, strict=False))
        else:
            pairs = dict.fromkeys(found, value)
        if not found:
            problems.add((*place, key), _explain_name(key, fmu, candidates, kind))
        if len({fmu.unit(name) for name in found}) > 1:
            where, names = problems.source.where((*place, key)), ", ".join(found)
            logger.warning("%s: %r sets variables of different units to %s: %s", where, key, value, names)
        for name, one in pairs.items():
            if complaint := _explain_value(fmu, name, one):
                problems.add((*place, key), f"{kind} {name!r} of FMU {fmu.name!r} {complaint}")
                break
        values |= dict.fromkeys(found, 0) | {v: _convert(fmu.variables[v].type, one) for v, one in pairs.items()}
    return values


def _flat(value: list[Any]) -> list[Any]:
    """List the elements of an array, row by row."""
    return [x for row in value for x in (row if isinstance(row, list) else [row])]


def _explain_shape(elements: list[str], value: list[Any], each: list[Any]) -> str | None:
    """Say why an array cannot have a value; None if it can."""
    shape = split_indices(elements[-1])[1]
    rows = [len(row) for row in value if isinstance(row, list)]
    if len(each) == len(elements) and (not rows or rows == [shape[-1]] * (len(elements) // shape[-1])):
        return None
    return f"is an array of {' x '.join(map(str, shape))} elements, and {len(each)} are given. Give each element once."


def _convert(kind: str, value: Any) -> Any:  # noqa: ANN401
    """Turn a value as a scenario writes it into what the FMU is given; a wrong one stays as it is."""
    if kind == "Binary":
        with suppress(TypeError, ValueError):
            return bytes.fromhex(value)
    return float(value) if kind in FLOATS and isinstance(value, int) and abs(value) < sys.float_info.max else value


def _toml(variable: Any) -> str:  # noqa: ANN401
    """Write a variable's start value as a scenario does."""
    value = parse(variable.type, variable.start)
    if isinstance(value, bytes):
        return json.dumps(value.hex())
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def _explain_name(name: str, fmu: FmuFile, candidates: list[str], kind: str) -> str:
    """Say why there is no input or parameter of a name."""
    names = [name] if name in fmu.variables else fmu.elements(name)
    other = fmu.variables[names[0]].causality if names and names[0] not in candidates else None
    if other in ("parameter", "structuralParameter"):
        return f"{name!r} is a parameter, which is fixed during the run. Put it under parameters."
    if other == "input":
        return f"{name!r} is an input. Put it under inputs."
    return f"FMU {fmu.name!r} has no {kind} {name!r}. {suggest(name, candidates)}"


def _explain_value(fmu: FmuFile, name: str, value: Any) -> str | None:  # noqa: ANN401
    """Say why a variable cannot have a value; None if it can."""
    kind = fmu.variables[name].type
    python = float if kind in FLOATS else int if kind in RANGES else bool if kind == "Boolean" else str
    if not isinstance(value, int | float if python is float else python) or isinstance(value, bool) != (python is bool):
        return f"is of type {kind} and cannot be {value!r}."
    if kind == "Binary":
        try:
            bytes.fromhex(str(value))
        except ValueError:
            return f"is of type Binary, written as hexadecimal digits, and cannot be {value!r}."
    if isinstance(value, str | bool):
        return None
    smallest, largest = RANGES.get(kind, (-sys.float_info.max, sys.float_info.max))
    if value > largest or (kind in FLOATS and value < smallest):
        return f"is of type {kind} and cannot be larger than {largest:g}."
    if value < smallest:
        return f"is of type {kind} and cannot be smaller than {smallest:g}."
    low, high = fmu.limits(name)
    if low <= value <= high:
        items = fmu.items(name)
        if not items or value in items:
            return None
        return f"is none of {first_few([f'{one} ({text})' for one, text in items.items()])}, but {value}."
    unit = "" if fmu.unit(name) in (None, "1") else f" {fmu.unit(name)}"
    return f"must lie in {low:g} to {high:g}{unit}, not {value:g}."


OPTIONS = ("step", "stop", "master")  # of a scenario, with options of the command of their own
SEED = "seed"
LONGEST_TITLE = 100  # characters, where values are changed


def read_changes(texts: Iterable[str]) -> dict[str, Given]:
    """Read ``NAME=VALUE``, with the value as in a scenario; what is no TOML value is a text.

    Raises
    ------
    ScenarioError
        There is no name or no value.
    """
    changes: dict[str, Given] = {}
    for text in texts:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not (name and sign and value):
            msg = f"{text!r} sets nothing. Write NAME=VALUE, such as membrane.damage[1]=0.3."
            raise ScenarioError(msg)
        try:
            changes[name] = tomllib.loads(f"it = {value}")["it"]
        except tomllib.TOMLDecodeError:
            changes[name] = value
    return changes


def changed(scenario: Scenario, changes: Mapping[str, Given], fmus: Path) -> Scenario:
    """Return a scenario with other values.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    changes : mapping of str to value
        Values by ``component.variable``, a parameter or an unconnected input, also by patterns such as ``sensor?.noise``;
        ``seed`` is that of all noise and dropouts.
    fmus : Path
        Folder in which FMUs are looked up by name.

    Raises
    ------
    ScenarioError
        There is no such component or variable. Values are checked with the plan.
    FmuError
        An FMU cannot be read.
    """
    components, options = dict(scenario.components), dict(scenario.source.options)
    files: dict[Path, FmuFile] = {}
    for name, value in changes.items():
        if name == SEED:
            scenario = _seeded(scenario, value)
            continue
        pattern, variable = split_endpoint(name)
        found = [component for component in components if matches(pattern, component)]
        if not variable or not found:
            what = f"there is no component {pattern!r}" if variable else f"{name!r} is no component.variable"
            other = f"Use {option(name)}." if name in OPTIONS else suggest(pattern, [*components, SEED])
            msg = f"{option('set', name)}: {what}. {other}"
            raise ScenarioError(msg)
        for component in found:
            path = scenario.fmu_path(component, fmus)
            check_path(path, ScenarioError)
            if path.is_file():  # otherwise the plan says so
                files[path] = files[path] if path in files else FmuFile(path, validate=False)
                file = files[path].resized(components[component].parameters, validate=False)
                keys = _keys(file, variable, name)
                components[component] = _with_value(components[component], keys, value)
                places: list[Location] = [("components", component, table, key) for table in keys for key in keys[table]]
                options |= dict.fromkeys(places, option("set", name))
    title = _title(scenario, changes)
    scenario = scenario.model_copy(update={"components": components, "title": title})
    return scenario.with_source(replace(scenario.source, options=options))


def _title(scenario: Scenario, changes: Mapping[str, Given]) -> str:
    """Return the title; where values are changed, the name and the changes, for the file's title may tell its own values."""
    written = {name: f"{value:.6g}" if isinstance(value, float) else f"{value}" for name, value in changes.items()}
    new = ", ".join(f"{name} = {value}" for name, value in written.items() if name != SEED)
    return shorten(f"{scenario.name}, with {new}", LONGEST_TITLE) if scenario.title and new else scenario.title


def _with_value(component: Component, keys: Mapping[str, list[str]], value: Given) -> Component:
    """Put a value last among the parameters or inputs, where it beats all others."""
    update = {}
    for table, new in keys.items():
        given = {key: old for key, old in getattr(component, table).items() if key not in new}
        update[table] = given | dict.fromkeys(new, value)
    return component.model_copy(update=update)


def _keys(fmu: FmuFile, variable: str, name: str) -> dict[str, list[str]]:
    """List the parameters and inputs that a name or pattern means, by their tables."""
    both = {"parameters": fmu.names("parameter", "structuralParameter"), "inputs": fmu.names("input")}
    found = {}
    for table, names in both.items():
        keys = [variable] if set(fmu.elements(variable)) & set(names) else [v for v in names if matches(variable, v)]
        if keys:
            found[table] = keys
    if not found:
        near = suggest(variable, [*both["parameters"], *both["inputs"]])
        msg = f"{option('set', name)}: FMU {fmu.name!r} has no parameter and no input {variable!r}. {near}"
        raise ScenarioError(msg)
    return found


def _seeded(scenario: Scenario, seed: Given) -> Scenario:
    """Give all noise and dropouts a seed."""
    if type(seed) is not int or seed < 0:
        msg = f"{option('set', 'seed')}: the seed is a whole number from 0 on, not {seed!r}."
        raise ScenarioError(msg)
    connections = [
        connection.model_copy(
            update={
                key: given.model_copy(update={"seed": seed})
                for key in ("noise", "dropout")
                if (given := getattr(connection, key)) is not None
            }
        )
        for connection in scenario.connections
    ]
    return scenario.model_copy(update={"connections": connections})
