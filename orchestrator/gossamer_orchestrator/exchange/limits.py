"""What other formats cannot express of a scenario, and how they define its units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pyssp_standard.unit import BaseUnit, Unit

from ..fmi.units import scale
from ..scenario.schema import Scenario
from ..scenario.source import Problems


def inexpressible(scenario: Scenario, what: str, keys: Mapping[str, float | None], advice: str) -> Problems:
    """List what a format does not have of the steps, the events and the keys of connections.

    Parameters
    ----------
    scenario : Scenario
        What is to be expressed.
    what : str
        The format, for messages.
    keys : mapping of str to float or None
        Keys that it does not have, with the value that changes nothing.
    advice : str
        What to do about an event, besides removing it.
    """
    problems = Problems(scenario.source)
    for i, _ in enumerate(scenario.events):
        problems.add(("events", i), f"{what} has no events. Remove it, {advice}.")
    for i, _ in enumerate(scenario.inputs):
        problems.add(("inputs", i), f"{what} has no inputs from files. Remove it, {advice}.")
    for name, component in scenario.components.items():
        if component.every > 1:
            text = f"{what} steps all components at once, so it has no 'every'. Remove it."
            problems.add(("components", name, "every"), text)
    if scenario.step_control is not None:
        problems.add(("step_control",), f"{what} has no step control. Remove the table.")
    for i, connection in enumerate(scenario.connections):
        for key, neutral in keys.items():
            if getattr(connection, key) not in (None, neutral):
                problems.add(("connections", i, key), f"{what} has no {key} in its connections. Remove it.")
    return problems


def declare_unit(units: Any, name: str, base: Any) -> bool:  # noqa: ANN401
    """Define a unit by FMPy's ``BaseUnit`` or None among pyssp-standard's; False if the name has another meaning there."""
    try:
        units.add_unit(Unit(name, None if base is None else BaseUnit(scale(base))))
    except ValueError:
        return False
    return True
