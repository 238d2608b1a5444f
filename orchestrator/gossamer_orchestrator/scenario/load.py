"""Read a scenario file and check it, as far as that is possible without its FMUs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gossamer_files.options import option
from pydantic import ValidationError

from . import schema
from .schema import MAX_STEPS, Scenario
from .source import Location, Problems, Source, explain, parse_toml, read_text

_TABLES: dict[str | int, type[schema.ScenarioTable]] = {
    "components": schema.Component,
    "connections": schema.Connection,
    "noise": schema.Noise,
    "dropout": schema.Dropout,
    "inputs": schema.Input,
    "groups": schema.Group,
    "events": schema.Event,
    "record": schema.Recording,
}
_VALUE_DEPTH = 4  # components, name, table and key; or events, number, set and key


def load_scenario(path: Path, *, step: float | None = None, stop: float | None = None) -> Scenario:
    """Read and check a scenario file, as far as that is possible without its FMUs.

    Parameters
    ----------
    path : Path
        A TOML file.
    step, stop : float or None
        Communication step and last time [s] in place of those of the file; events later than ``stop`` are left out then.

    Raises
    ------
    ScenarioError
        The file cannot be read, is not TOML, or has unknown, missing or meaningless keys; one line per mistake.
    """
    path = Path(path)
    return parse_scenario(read_text(path, "scenario"), name=path.name, folder=path.parent, step=step, stop=stop)


def parse_scenario(
    text: str, *, name: str = "scenario", folder: Path | None = None, step: float | None = None, stop: float | None = None
) -> Scenario:
    """Check the text of a scenario; ``name`` stands in messages, paths of FMUs are relative to ``folder``."""
    content = parse_toml(text, name, "scenario")
    given = {key: value for key, value in (("step", step), ("stop", stop)) if value is not None}
    return make_scenario(content | given, source=Source(name, text, {(key,): option(key) for key in given}), folder=folder)


def make_scenario(content: Mapping[str, Any], *, source: Source, folder: Path | None = None) -> Scenario:
    """Check the content of a scenario, as a TOML file or another format gives it."""
    problems = Problems(source)
    try:
        scenario = Scenario.model_validate(content, context=(source, Path() if folder is None else folder))
    except ValidationError as error:
        for item in error.errors():
            kind, place, message = item["type"], item["loc"], item["msg"]
            if place[2:3] in (("parameters",), ("inputs",), ("set",)) and len(place) > _VALUE_DEPTH:
                kind, place = "value", place[:_VALUE_DEPTH]
                message = "should be a finite number, true, false, a text, or an array of these"
            problems.add(place, explain(kind, place, message, item["input"], _known(place)))
        problems.raise_if_any()
        raise
    _check_time(scenario, problems)
    if not problems.found:
        _check_recording(scenario, problems)
    problems.raise_if_any()
    return scenario


def _known(location: Location) -> list[str]:
    """List the keys of the table around a location."""
    around = (*location[2:-1], location[0])  # without the name of a component or the number of an element
    owner = next((_TABLES[part] for part in around if part in _TABLES), Scenario)
    return [field.alias or name for name, field in owner.model_fields.items()]


def _check_recording(scenario: Scenario, problems: Problems) -> None:
    """Require that something is recorded, more often than at the ends of the run."""
    record = scenario.record
    if record.variables == []:
        text = "'variables' in 'record' is empty: nothing would be recorded. Name some, or remove it to record every output."
        problems.add(("record", "variables"), text)
    if record.every > max(scenario.ticks, 1):
        text = f"'every' in 'record' is {record.every}, but the run has {scenario.ticks} steps. Use a smaller number."
        problems.add(("record", "every"), text)


def _check_time(scenario: Scenario, problems: Problems) -> None:
    """Require a run that is a whole number of steps, and events within it."""
    step, start, stop = scenario.step, scenario.start, scenario.stop
    if stop <= start:
        problems.add(("stop",), f"'stop' ({stop:g} s) must lie after 'start' ({start:g} s).")
        return
    steps = (stop - start) / step
    if not steps <= MAX_STEPS:
        many = f"{steps:.3g} steps" if math.isfinite(steps) else "more steps than can be counted"
        problems.add(
            ("step",),
            f"'step' = {step:g} s makes {many} from 'start' = {start:g} s to 'stop' = {stop:g} s; at most {MAX_STEPS:.0e} "
            "are allowed. Use a longer 'step' or an earlier 'stop'.",
        )
        return
    ticks = scenario.ticks
    if abs((stop - start) / step - ticks) > 1e-6:
        nearest = scenario.seconds(max(ticks, 1))
        problems.add(
            ("stop",),
            f"'stop' = {stop:g} s is not a whole number of steps of {step:g} s after 'start'. "
            f"The nearest is {nearest:.12g}.",
        )
    for i, event in enumerate(scenario.events):
        if not start <= event.time <= stop and not (event.time > stop and scenario.source.gives("stop")):
            text = f"the event at {event.time:g} s lies outside the run, {start:g} to {stop:g} s. Move it or the run's end."
            problems.add(("events", i, "time"), text)
