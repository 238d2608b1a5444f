"""A scenario and its FMUs, checked against each other and resolved to names, numbers and an order.

Every mistake that shows without a run is reported, all of them at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..errors import FmuError
from ..file_kinds import explain_file
from ..fmi.file import FmuFile
from ..names import matches, suggest
from .connections import check_connections
from .graph import order_components
from .schema import Connection, Scenario, Value
from .source import Location, Problems
from .values import expand, start_values


@dataclass(frozen=True, kw_only=True)
class ComponentPlan:
    """One component of a run.

    Attributes
    ----------
    start : dict
        Parameters and unconnected inputs that the scenario sets.
    connections : tuple of Connection
        Those to this component.
    sent, recorded : tuple of str
        Variables read at every step because a component receives them, and the others that are recorded.
    """

    name: str
    fmu: FmuFile
    start: dict[str, Value]
    connections: tuple[Connection, ...]
    sent: tuple[str, ...]
    recorded: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A run, ready to start.

    Attributes
    ----------
    components : tuple of ComponentPlan
        In stepping order.
    start_order : tuple of str
        Components in the order of initialization: each after those that feed it.
    events : dict
        By tick: component and its new input values.
    columns : tuple of (component, variable)
        What is recorded, in the order of the scenario and the model descriptions.
    """

    scenario: Scenario
    components: tuple[ComponentPlan, ...]
    start_order: tuple[str, ...]
    events: dict[int, list[tuple[str, dict[str, float]]]]
    columns: tuple[tuple[str, str], ...]

    @property
    def files(self) -> list[FmuFile]:
        """Every FMU file once."""
        return list({id(c.fmu): c.fmu for c in self.components}.values())

    def component(self, name: str) -> ComponentPlan:
        """Return a component by name."""
        return next(c for c in self.components if c.name == name)

    def close(self) -> None:
        """Remove the unpacked FMUs."""
        for file in self.files:
            file.close()


def make_plan(scenario: Scenario, fmus: Path) -> Plan:
    """Check a scenario against its FMUs.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    fmus : Path
        Folder in which FMUs are looked up by name.

    Raises
    ------
    ScenarioError
        Every mistake, with its line.
    """
    problems = Problems(scenario.source)
    files = _find_files(scenario, Path(fmus), problems)
    problems.raise_if_any()
    connections, fed = check_connections(scenario, files, problems)
    connected = {connection.target for connection in connections}
    start = {
        name: start_values(name, component, files[name], connected, fed, problems)
        for name, component in scenario.components.items()
    }
    events = _check_events(scenario, files, connected, problems)
    columns = _check_recording(scenario, files, connected, problems)
    start_order, order = order_components(scenario, files, connections, problems)
    problems.raise_if_any()

    def plan_component(name: str) -> ComponentPlan:
        received = {c.output for c in connections if c.sender == name}
        return ComponentPlan(
            name=name,
            fmu=files[name],
            start=start[name],
            connections=tuple(c for c in connections if c.receiver == name),
            sent=tuple(v for v in files[name].names("output") if v in received),
            recorded=tuple(v for c, v in columns if c == name and v not in received),
        )

    return Plan(
        scenario=scenario,
        components=tuple(plan_component(name) for name in order),
        start_order=tuple(start_order),
        events=events,
        columns=tuple(columns),
    )


def _find_files(scenario: Scenario, folder: Path, problems: Problems) -> dict[str, FmuFile]:
    """Read every FMU once, and report a problem with one of them once."""
    found: dict[Path, FmuFile | None] = {}
    files: dict[str, FmuFile] = {}
    for name, component in scenario.components.items():
        path = scenario.fmu_path(name, folder)
        place: Location = ("components", name, "fmu")
        if not component.fmu.endswith(".fmu") and not folder.is_dir():
            text = f"there is no folder {folder} with FMUs. Build them: gossamer build --out {folder}"
            problems.found.append(f"{scenario.source.name}: {text}, or name their folder with --fmus.")
            continue
        if path not in found:
            found[path] = _read_file(component.fmu, path, scenario.folder / component.fmu, place, problems)
        file = found[path]
        if file is not None:
            if file.description.coSimulation.canBeInstantiatedOnlyOncePerProcess and file in files.values():
                text = f"FMU {component.fmu!r} can be used by one component only. Make a copy under another name."
                problems.add(place, text)
            files[name] = file
    return files


def _read_file(fmu: str, path: Path, literal: Path, place: Location, problems: Problems) -> FmuFile | None:
    """Read an FMU; None, and a problem, if that is not possible; ``literal`` is the file if the name were a path."""
    other = next((each for each in (path, literal) if each.exists() and not path.is_file()), None)
    if other is not None:
        problems.add(place, f"{fmu!r} is not an FMU, whose name ends in .fmu. {explain_file(other)}")
        return None
    if not path.is_file():
        near = suggest(path.stem, sorted(p.stem for p in path.parent.glob("*.fmu")))
        more = "" if fmu.endswith(".fmu") else " Build the FMUs with 'gossamer build' or name their folder with --fmus."
        problems.add(place, f"there is no FMU {fmu!r} in {path.parent}. {near}{more}")
        return None
    try:
        return FmuFile(path)
    except FmuError as error:
        problems.add(place, str(error))
        return None


def _check_events(
    scenario: Scenario, files: Mapping[str, FmuFile], connected: set[str], problems: Problems
) -> dict[int, list[tuple[str, dict[str, float]]]]:
    events: dict[int, list[tuple[str, dict[str, float]]]] = {}
    for i, event in enumerate(scenario.events):
        if event.component not in files:
            text = f"there is no component {event.component!r}. {suggest(event.component, files)}"
            problems.add(("events", i, "component"), text)
            continue
        fmu = files[event.component]
        place: Location = ("events", i, "set")
        free = {}
        for key, value in event.set.items():
            if f"{event.component}.{key}" in connected:
                text = f"input '{event.component}.{key}' is connected, so no event can set it. Remove the connection."
                problems.add((*place, key), text)
            else:
                free[key] = value
        names = [v for v in fmu.names("input", kind="Real") if f"{event.component}.{v}" not in connected]
        values = expand(place, free, fmu, names, "input", problems)
        tick = math.ceil((event.time - scenario.start) / scenario.step - 1e-6)
        entry = (event.component, {v: float(value) for v, value in values.items()})
        events.setdefault(min(tick, scenario.ticks), []).append(entry)
    return dict(sorted(events.items()))


def _check_recording(
    scenario: Scenario, files: Mapping[str, FmuFile], connected: set[str], problems: Problems
) -> list[tuple[str, str]]:
    patterns = scenario.record.variables
    if patterns is None:
        shown = [(c, v) for c in scenario.components for v in files[c].names("output", "input", kind="Real")]
        return [(c, v) for c, v in shown if f"{c}.{v}" not in connected]
    every = [(c, v) for c in scenario.components for v, x in files[c].variables.items() if x.type == "Real"]
    for i, pattern in enumerate(patterns):
        if not any(matches(pattern, f"{c}.{v}") for c, v in every):
            component = pattern.split(".")[0]
            if any(matches(component, c) for c in files):
                near = suggest(pattern, [f"{c}.{v}" for c, v in every])
            else:
                near = f"There is no component {component!r}. {suggest(component, files)}"
            problems.add(("record", "variables", i), f"no variable to record matches {pattern!r}. {near}")
    return [(c, v) for c, v in every if any(matches(p, f"{c}.{v}") for p in patterns)]
