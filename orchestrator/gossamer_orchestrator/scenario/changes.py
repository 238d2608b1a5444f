"""Values that replace those of a scenario, such as ``membrane.damage[1]`` = 0.3, without another file."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from textwrap import shorten

from ..errors import ScenarioError
from ..fmi.file import FmuFile
from ..names import matches, split_endpoint, suggest
from .schema import Component, Given, Scenario
from .source import Location

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
            other = f"Use --{name}." if name in OPTIONS else suggest(pattern, [*components, SEED])
            msg = f"--set {name}: {what}. {other}"
            raise ScenarioError(msg)
        for component in found:
            path = scenario.fmu_path(component, fmus)
            if path.is_file():  # otherwise the plan says so
                files[path] = files[path] if path in files else FmuFile(path, validate=False)
                file = files[path].resized(components[component].parameters, validate=False)
                keys = _keys(file, variable, name)
                components[component] = _with_value(components[component], keys, value)
                places: list[Location] = [
                    ("components", component, table, key) for table in keys for key in keys[table]
                ]
                options |= dict.fromkeys(places, f"--set {name}")
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
        msg = f"--set {name}: FMU {fmu.name!r} has no parameter and no input {variable!r}. {near}"
        raise ScenarioError(msg)
    return found


def _seeded(scenario: Scenario, seed: Given) -> Scenario:
    """Give all noise and dropouts a seed."""
    if type(seed) is not int or seed < 0:
        msg = f"--set seed: the seed is a whole number from 0 on, not {seed!r}."
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
