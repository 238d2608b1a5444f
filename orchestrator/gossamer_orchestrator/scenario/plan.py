"""A scenario and its FMUs, checked against each other and resolved to names, numbers and an order.

Every mistake that shows without a run is reported, all of them at once.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from gossamer_files import MIXED
from gossamer_files.options import option

from ..errors import FmuError, ScenarioError, check_path, explain_file
from ..fmi.file import FmuFile
from ..fmi.types import NUMBERS, TEXTS
from ..names import is_pattern, matches, split_indices, suggest
from ..words import first_few
from .connections import Draft, check_connections, check_groups, check_steps, join_exchange, order_components
from .histories import FILE, History, read_histories
from .schema import Connection, Scenario, Value
from .source import Location, Problems
from .values import expand, start_values

logger = logging.getLogger(__name__)
NO_ESTIMATOR = (
    " For a sensor that has no estimator, build the filter and name it here, as the shipped scenario 'own_sensor_filter' "
    "does."
)


@dataclass(frozen=True, kw_only=True)
class ComponentPlan:
    """One component of a run.

    Attributes
    ----------
    every : int
        It steps at every n-th communication point.
    start : dict
        Parameters and unconnected inputs that the scenario sets.
    connections : tuple of Connection
        Those to this component, also from files.
    sent, recorded : tuple of str
        Variables read at every step because a component receives them, and the others that are recorded; an array of FMI
        3.0 is in one of them as a whole.
    """

    name: str
    fmu: FmuFile
    every: int
    start: dict[str, Value]
    connections: tuple[Connection, ...]
    sent: tuple[str, ...]
    recorded: tuple[str, ...]

    @property
    def ports(self) -> list[tuple[str, bool, list[str]]]:
        """What is read together: its type, whether a component receives it, and the names; first Reals without clock."""
        ports: dict[tuple[bool, str, tuple[int, ...], bool], list[str]] = {}
        for recorded, names in enumerate((self.sent, self.recorded)):
            for name in names:
                kind, clocks = self.fmu.variables[name].type, self.fmu.clocks_of(name)
                ports.setdefault((kind != "Real" or bool(clocks), kind, clocks, bool(recorded)), []).append(name)
        return [(kind, not recorded, names) for (_, kind, _, recorded), names in sorted(ports.items())]

    @property
    def read(self) -> list[str]:
        """Everything that is read, Reals side by side."""
        return [name for _, _, names in self.ports for name in names]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A run, ready to start.

    Attributes
    ----------
    components : tuple of ComponentPlan
        In stepping order.
    start_order : tuple of str
        Components in the order of initialization: each after those that feed it.
    connections : tuple of Connection
        One per scalar that arrives; units are converted by their gain and bias.
    joined : tuple of tuple of str
        Components for model exchange that are integrated as one system, each time.
    histories : dict
        Inputs from files, by ``component.input``.
    events : dict
        By tick: component and its new input values.
    columns : tuple of (component, variable)
        What is recorded, in the order of the scenario and the model descriptions.
    """

    scenario: Scenario
    components: tuple[ComponentPlan, ...]
    start_order: tuple[str, ...]
    connections: tuple[Connection, ...]
    joined: tuple[tuple[str, ...], ...]
    histories: dict[str, History]
    events: dict[int, list[tuple[str, dict[str, Value]]]]
    columns: tuple[tuple[str, str], ...]

    @property
    def files(self) -> list[FmuFile]:
        """Every FMU file once."""
        return list({id(c.fmu): c.fmu for c in self.components}.values())

    def component(self, name: str) -> ComponentPlan:
        """Return a component by name."""
        return self._by_name[name]

    @cached_property
    def _by_name(self) -> dict[str, ComponentPlan]:
        return {c.name: c for c in self.components}

    def close(self) -> None:
        """Remove the unpacked FMUs."""
        for file in self.files:
            file.close()


def make_plan(scenario: Scenario, fmus: Path, *, strict: bool = False) -> Plan:
    """Check a scenario against its FMUs.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    fmus : Path
        Folder in which FMUs are looked up by name.
    strict : bool
        Refuse FMUs whose model description is against the rules of FMI; by default that is a warning.

    Raises
    ------
    ScenarioError
        Every mistake, with its line.
    """
    check_path(Path(fmus), ScenarioError)
    problems = Problems(scenario.source)
    files = _find_files(scenario, Path(fmus), problems, strict=strict)
    problems.raise_if_any()
    for name in files:
        _refuse_clocks(name, files[name], problems)
    draft = Draft(scenario, files, problems)
    connections, fed = check_connections(draft)
    histories = read_histories(draft, fed)
    connected = {connection.target for connection in connections} | set(histories)
    start = {name: start_values(draft, name, connected, set(fed)) for name in scenario.components}
    events = _check_events(draft, connected)
    columns = _check_recording(draft, {c.target for c in connections})
    check_groups(draft, connections)
    check_steps(draft)
    joined = join_exchange(draft, connections)
    start_order, order = order_components(draft, connections, fed, joined)
    problems.raise_if_any()

    def plan_component(name: str) -> ComponentPlan:
        fmu = files[name]
        read = [Connection.model_construct(origin=f"{FILE}.{target}", target=target) for target in histories]
        own = [c for c in (*connections, *read) if c.receiver == name]
        if fmu.arrays:
            places = {v: i for i, v in enumerate(fmu.variables)}
            own.sort(key=lambda c: places[c.input])  # an array is set as a whole
        sent = fmu.whole(c.output for c in connections if c.sender == name)
        recorded = [v for v in fmu.whole(v for c, v in columns if c == name) if v not in set(sent)]
        return ComponentPlan(
            name=name,
            fmu=fmu,
            every=scenario.components[name].every,
            start=start[name],
            connections=tuple(own),
            sent=tuple(sent),
            recorded=tuple(recorded),
        )

    logger.info("%d steps of %g s, %s, %d columns recorded", scenario.ticks, scenario.step, scenario.master, len(columns))
    for name in order:
        logger.info("%s: %s, FMI %s", name, files[name].path.name, files[name].description.fmiVersion)
    return Plan(
        scenario=scenario,
        components=tuple(plan_component(name) for name in order),
        start_order=tuple(start_order),
        connections=tuple(connections),
        joined=tuple(tuple(names) for names in joined),
        histories=histories,
        events=events,
        columns=tuple(columns),
    )


def _refuse_clocks(component: str, fmu: FmuFile, problems: Problems) -> None:
    """Refuse clocks that others trigger, and time-based ones without the event mode in which alone they tick."""
    triggered = [name for name, clock in fmu.clocks.items() if clock.intervalVariability == "triggered"]
    why, advice = "are triggered", "Clocks that tick at times of their own are run: export it with those."
    if fmu.clocks and not triggered and not fmu.model_exchange and not getattr(fmu.interface, "hasEventMode", False):
        triggered, why = [*fmu.clocks], "tick in event mode only, which it has not (hasEventMode)"
        advice = "Export it with event mode, or for model exchange."
    if triggered:
        text = f"FMU {fmu.name!r} has clocks that {why}: {first_few(triggered)}. {advice}"
        problems.add(("components", component, "fmu"), text)


def _find_files(scenario: Scenario, folder: Path, problems: Problems, *, strict: bool) -> dict[str, FmuFile]:
    """Read every FMU once, and report a problem with one of them once."""
    found: dict[Path, FmuFile | None] = {}
    files: dict[str, FmuFile] = {}
    mixed = (folder / MIXED).read_text(encoding="utf-8").split() if (folder / MIXED).is_file() else []
    if any(component.fmu in mixed for component in scenario.components.values()):
        text = "a build of %s in %s was killed, so they may be of two builds. Build them again with 'gossamer build'"
        logger.warning(text, first_few(mixed), folder)
    for name, component in scenario.components.items():
        path = scenario.fmu_path(name, folder)
        place: Location = ("components", name, "fmu")
        if not component.fmu.endswith(".fmu") and not folder.is_dir():
            text = f"there is no folder {folder} with FMUs. Build them: gossamer build --out {folder}"
            problems.found.append(f"{scenario.source.name}: {text}, or name their folder with {option('fmus')}.")
            continue
        if path not in found:
            found[path] = None
            with problems.noting(place):
                found[path] = _read_file(
                    component.fmu, path, scenario.folder / component.fmu, place, problems, strict=strict
                )
        file = found[path]
        if file is not None:
            only_once = file.interface.canBeInstantiatedOnlyOncePerProcess
            if only_once and file.path in [other.path for other in files.values()]:
                text = f"FMU {component.fmu!r} can be used by one component only. Make a copy under another name."
                problems.add(place, text)
            files[name] = file
            with problems.noting(place):
                files[name] = file.resized(component.parameters)
    return files


def _read_file(fmu: str, path: Path, literal: Path, place: Location, problems: Problems, *, strict: bool) -> FmuFile:
    """Read an FMU; ``literal`` is the file if the name were a path."""
    check_path(path)
    check_path(literal)
    other = next((each for each in (path, literal) if each.exists() and not path.is_file()), None)
    if other is not None:
        msg = f"{fmu!r} is not an FMU, whose name ends in .fmu. {explain_file(other)}"
        raise FmuError(msg)
    if not path.is_file():
        near = suggest(path.stem, sorted(p.stem for p in path.parent.glob("*.fmu")))
        build = f"gossamer build {fmu}" if fmu in ("framed_membrane", "hub") else "gossamer build"  # which builds the others
        more = "" if fmu.endswith(".fmu") else f" Build the FMUs with '{build}' or name their folder with {option('fmus')}."
        if fmu == "estimator":
            more += NO_ESTIMATOR
        msg = f"there is no FMU {fmu!r} in {path.parent}. {near}{more}"
        raise FmuError(msg)
    file = FmuFile(path)
    if file.findings:
        more = f" .. and {len(file.findings) - 3} more" if len(file.findings) > 3 else ""
        msg = f"FMU {fmu!r} is against the rules of FMI: {' '.join(file.findings[:3])}{more}"
        if strict:
            msg += f" Correct it, or run it without {option('strict', True)}."
            raise FmuError(msg)
        logger.warning("%s: %s", problems.source.where(place), msg)
    return file


def _check_events(draft: Draft, connected: set[str]) -> dict[int, list[tuple[str, dict[str, Value]]]]:
    scenario, files, problems = draft.scenario, draft.files, draft.problems
    events: dict[int, list[tuple[str, dict[str, Value]]]] = {}
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
        names = [v for v in fmu.names("input") if f"{event.component}.{v}" not in connected]
        values = expand(place, free, fmu, names, "input", problems)
        if event.time > scenario.stop:
            continue
        every = scenario.components[event.component].every
        tick = every * math.ceil((event.time - scenario.start) / (every * scenario.step) - 1e-6)
        if tick >= scenario.ticks:
            text = "the event is at the end of the run, so it changes nothing"
            logger.warning("%s: %s", problems.source.where(("events", i, "time")), text)
        events.setdefault(min(tick, scenario.ticks), []).append((event.component, values))
    if later := ", ".join(f"{event.time:g}" for event in scenario.events if event.time > scenario.stop):
        logger.warning(
            "%s: the run ends before the events at %s s, which are left out", problems.source.where(("stop",)), later
        )
    return dict(sorted(events.items()))


def _check_recording(draft: Draft, connected: set[str]) -> list[tuple[str, str]]:
    scenario, files, problems = draft.scenario, draft.files, draft.problems
    patterns = scenario.record.variables
    every = [(c, v, x) for c in scenario.components for v, x in files[c].variables.items() if x.causality != "independent"]
    if patterns is None:
        shown = [(c, v, x) for c, v, x in every if x.causality in ("output", "input") and f"{c}.{v}" not in connected]
        if texts := [f"{c}.{v}" for c, v, x in shown if x.type in TEXTS]:
            logger.warning("results are numbers, so texts are not recorded: %s", ", ".join(texts))
        return [(c, v) for c, v, x in shown if x.type in NUMBERS]
    numbers = [(c, v, _names(c, v)) for c, v, x in every if x.type in NUMBERS]
    names = {name for *_, named in numbers for name in named}
    wild = [pattern for pattern in patterns if is_pattern(pattern)]
    plain = set(patterns) - set(wild)
    for i, pattern in enumerate(patterns):
        if any(_fits(pattern, named) for *_, named in numbers) if is_pattern(pattern) else pattern in names:
            continue
        place: Location = ("record", "variables", i)
        component = pattern.split(".")[0]
        if text := next((f"{c}.{v}" for c, v, x in every if x.type in TEXTS and _fits(pattern, _names(c, v))), None):
            problems.add(place, f"{text!r} is a text, and results are numbers. Record something else.")
            continue
        if any(matches(component, c) for c in files):
            near = suggest(pattern, [f"{c}.{v}" for c, v, _ in numbers])
        else:
            near = f"There is no component {component!r}. {suggest(component, files)}"
        problems.add(place, f"no variable to record matches {pattern!r}. {near}")
    return [(c, v) for c, v, named in numbers if named & plain or any(_fits(p, named) for p in wild)]


def _fits(pattern: str, names: set[str]) -> bool:
    """Tell whether a pattern fits a variable, or the array of which it is an element."""
    return any(matches(pattern, each) for each in names)


def _names(component: str, name: str) -> set[str]:
    """Return how a variable may be named: by itself, or by the array of which it is an element."""
    return {f"{component}.{name}", f"{component}.{split_indices(name)[0]}"}
