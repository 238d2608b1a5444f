"""Checks of the steps of components, and of the control of steps."""

from __future__ import annotations

from collections.abc import Mapping

from ..fmi.file import FmuFile
from .schema import Scenario
from .source import Problems


def check_steps(scenario: Scenario, files: Mapping[str, FmuFile], problems: Problems) -> None:
    """Report steps of components that do not fit the run, and FMUs that the step control cannot take back."""
    grouped = {name for group in scenario.groups for name in group.components}
    for name, component in scenario.components.items():
        place = ("components", name, "every")
        if scenario.ticks % component.every:
            text = f"the run has {scenario.ticks} steps, which {component.every} does not divide"
            problems.add(place, f"{text}. Choose another 'every', 'step' or 'stop'.")
        if component.every > 1 and name in grouped:
            problems.add(
                place, f"component {name!r} is in a group, whose components step together. Remove one of the two."
            )
    unable = sorted({file.name for file in files.values() if not file.can_repeat})
    if scenario.step_control is not None and unable:
        text = f"{', '.join(unable)} cannot restore its state or vary its step, so its steps cannot be controlled"
        problems.add(("step_control",), f"{text}. Remove the table, or use a smaller 'step'.")
