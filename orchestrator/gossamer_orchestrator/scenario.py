"""A scenario: which FMUs, with which parameters, how connected, from when to when.

A TOML file such as::

    title = "A gain"
    step = 1e-3          # communication step [s]
    stop = 1.0           # [s], a whole number of steps after start

    [components.source]
    fmu = "source"       # <folder of FMUs>/source.fmu, or a path that ends in .fmu, relative to this file
    parameters = { amplitude = 2.0 }

    [components.gain]
    fmu = "gain"
    inputs = { "offset[*]" = 0.0 }   # every input is connected or given here

    [[connections]]
    from = "source.y"
    to = "gain.u"
    noise = { kind = "normal", amplitude = 0.1, seed = 1 }

    [[events]]
    time = 0.5
    component = "gain"
    set = { "offset[1]" = 1.0 }

    [record]
    variables = ["gain.*"]
    every = 10
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError

from .errors import ScenarioError
from .kinds import explain_file
from .names import suggest
from .source import Location, Problems, Source

MAX_STEPS = 1e8
_VALUE_DEPTH = 5  # components, name, table, key and the type that a value could not be taken for
Value = bool | int | float | str
Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]
Endpoint = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*\..+$")]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, populate_by_name=True)


class Noise(_Table):
    """Noise added to a signal, drawn once per communication step.

    Attributes
    ----------
    kind : {"uniform", "normal"}
        Distribution.
    amplitude : float
        Half-width (uniform) or standard deviation (normal), in the unit of the signal.
    seed : int
        The same seed gives the same noise; two connections with one seed still get different noise.
    """

    kind: Literal["uniform", "normal"]
    amplitude: float = Field(ge=0.0)
    seed: int = Field(default=0, ge=0)


class Dropout(_Table):
    """Samples that do not arrive.

    Attributes
    ----------
    probability : float
        Chance that the sample of a communication step is lost, 0..1.
    seed : int
        The same seed loses the same samples.
    hold : bool
        True: the receiver keeps the last sample that arrived; False: it gets zero.
    """

    probability: float = Field(ge=0.0, le=1.0)
    seed: int = Field(default=0, ge=0)
    hold: bool = True


class Component(_Table):
    """One instance of an FMU.

    Attributes
    ----------
    fmu : str
        Name of an FMU in the folder of FMUs, or a path that ends in ``.fmu``.
    parameters : dict
        Values by name or pattern; the others keep the FMU's start values.
    inputs : dict
        Values of the inputs that no connection feeds, by name or pattern; a name beats a pattern, a later pattern an
        earlier one.
    """

    fmu: str
    parameters: dict[str, Value] = Field(default_factory=dict)
    inputs: dict[str, Value] = Field(default_factory=dict)


class Connection(_Table):
    """A signal: the receiver gets ``gain * value + bias + noise`` unless the sample drops out.

    Attributes
    ----------
    origin, target : str
        ``component.output`` and ``component.input``; written ``from`` and ``to`` in the file.
    gain, bias : float or None
        Factor and offset; also what converts between units.
    noise : Noise or None
        Added after gain and bias.
    dropout : Dropout or None
        Applied last.
    """

    origin: Endpoint = Field(alias="from")
    target: Endpoint = Field(alias="to")
    gain: float | None = None
    bias: float | None = None
    noise: Noise | None = None
    dropout: Dropout | None = None


class Event(_Table):
    """Inputs that change at the first communication point not before ``time`` [s]."""

    time: float
    component: Name
    set: dict[str, float] = Field(min_length=1)


class Record(_Table):
    """What is kept.

    Attributes
    ----------
    variables : list of str or None
        Patterns of ``component.variable``; None keeps every output and every input given from outside.
    every : int
        Keep each n-th communication point.
    """

    variables: list[str] | None = None
    every: int = Field(default=1, ge=1, le=int(MAX_STEPS))


class Scenario(_Table):
    """Everything a run depends on, except the FMU files.

    Attributes
    ----------
    title : str
        One line for pictures and tables.
    step, start, stop : float
        Communication step and first and last time [s].
    master : {"gauss-seidel", "jacobi"}
        Gauss-Seidel steps one component after another and hands new outputs on at once; Jacobi steps all of them with
        the outputs of the last communication point, so that each connection delays by one step.
    order : list of str or None
        Order of the components under Gauss-Seidel; None follows the connections.
    """

    title: str = ""
    step: float = Field(gt=0.0)
    start: float = 0.0
    stop: float
    master: Literal["gauss-seidel", "jacobi"] = "gauss-seidel"
    order: list[Name] | None = None
    components: dict[Name, Component] = Field(min_length=1)
    connections: list[Connection] = Field(default_factory=list)
    events: list[Event] = Field(default_factory=list)
    record: Record = Field(default_factory=Record)

    _source: Source = PrivateAttr(default=Source("scenario", ""))
    _folder: Path = PrivateAttr(default=Path())

    @property
    def source(self) -> Source:
        """The file it came from."""
        return self._source

    @property
    def folder(self) -> Path:
        """Folder to which paths of FMUs are relative."""
        return self._folder

    @property
    def name(self) -> str:
        """File name without its ending."""
        return Path(self._source.name).stem

    @property
    def ticks(self) -> int:
        """Number of communication steps."""
        return round((self.stop - self.start) / self.step)

    def fmu_path(self, component: str, fmus: Path) -> Path:
        """Return the FMU file of a component; names are looked up in a folder."""
        fmu = self.components[component].fmu
        return (self.folder / fmu if fmu.endswith(".fmu") else fmus / f"{fmu}.fmu").resolve()

    def seconds(self, tick: int) -> float:
        """Convert a count of steps to time [s]."""
        return self.start + tick * self.step


def load_scenario(path: Path, *, step: float | None = None, stop: float | None = None) -> Scenario:
    """Read and check a scenario file, as far as that is possible without its FMUs.

    Parameters
    ----------
    path : Path
        A TOML file.
    step, stop : float or None
        Communication step and last time [s] in place of those of the file.

    Raises
    ------
    ScenarioError
        The file cannot be read, is no TOML, or has unknown, missing or meaningless keys; every mistake on a line.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        near = suggest(path.name, sorted(p.name for p in path.parent.glob("*.toml")))
        msg = f"there is no scenario file {path}. {near}"
        raise ScenarioError(msg) from None
    except (OSError, UnicodeDecodeError):
        msg = f"{path} is no scenario, which is a TOML file in UTF-8. {explain_file(path)}"
        raise ScenarioError(msg) from None
    return parse_scenario(text, name=path.name, folder=path.parent, step=step, stop=stop)


def parse_scenario(
    text: str,
    *,
    name: str = "scenario",
    folder: Path | None = None,
    step: float | None = None,
    stop: float | None = None,
) -> Scenario:
    """Check the text of a scenario; ``name`` stands in messages, paths of FMUs are relative to ``folder``."""
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.fullmatch(r"(.*) \(at line (\d+), (column \d+)\)", str(error))
        what, line, column = found.groups() if found else (str(error), len(text.splitlines()), "")
        msg = f"{name}:{line}: {what}{', ' * bool(column)}{column}. Correct the TOML syntax there."
        raise ScenarioError(msg) from None
    except RecursionError:
        msg = f"{name}: its tables or arrays are nested too deeply. A scenario needs four levels."
        raise ScenarioError(msg) from None
    content |= {key: value for key, value in (("step", step), ("stop", stop)) if value is not None}
    return make_scenario(content, source=Source(name, text), folder=folder)


def make_scenario(content: Mapping[str, Any], *, source: Source, folder: Path | None = None) -> Scenario:
    """Check the content of a scenario, as a TOML file or another format gives it."""
    problems = Problems(source)
    try:
        scenario = Scenario.model_validate(content)
    except ValidationError as error:
        for item in error.errors():
            kind, place, message = item["type"], item["loc"], item["msg"]
            if place[2:3] in (("parameters",), ("inputs",)) and len(place) == _VALUE_DEPTH:
                kind, place, message = "value", place[:-1], "should be a finite number, true, false or a text"
            problems.add(place, _explain(kind, place, message, item["input"]))
        problems.raise_if_any()
        raise
    scenario._source = source
    scenario._folder = Path() if folder is None else folder
    _check_time(scenario, problems)
    problems.raise_if_any()
    return scenario


def _explain(kind: str, location: Location, message: str, value: Any) -> str:  # noqa: ANN401
    """Turn one finding of pydantic into a sentence."""
    key, table = str(location[-1]), ".".join(part for part in location[:-1] if isinstance(part, str))
    known = [field.alias or name for name, field in _owner(location).model_fields.items()]
    place = f" in {table!r}" if table else ""
    if kind == "extra_forbidden":
        return f"unknown key {key!r}{place}. {suggest(key, known)}"
    if kind == "missing":
        return f"key {key!r}{place} is missing. Add it."
    if key == "[key]":
        return f"{location[-2]!r} cannot be a name: use letters, digits and underscores, no digit first."
    if kind == "string_pattern_mismatch" and key in ("from", "to"):
        return f"{key!r}{place}: write component.variable, not {value!r}."
    return f"{key!r}{place}: {message[0].lower()}{message[1:]}, not {value!r}."


def _owner(location: Location) -> type[_Table]:
    """Return the table in which the key at a location stands."""
    inner: dict[str | int, type[_Table]] = {"noise": Noise, "dropout": Dropout}
    outer: dict[str | int, type[_Table]] = {
        "components": Component,
        "connections": Connection,
        "events": Event,
        "record": Record,
    }
    if len(location) == 1:
        return Scenario
    return inner.get(location[-2]) or outer.get(location[0], Scenario)


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
            "are run. Use a longer 'step' or an earlier 'stop'.",
        )
        return
    ticks = scenario.ticks
    if abs((stop - start) / step - ticks) > 1e-6:
        nearest = scenario.seconds(max(ticks, 1))
        problems.add(
            ("stop",),
            f"'stop' = {stop:g} s is no whole number of steps of {step:g} s after 'start'; the nearest is {nearest:.12g}.",
        )
    for i, event in enumerate(scenario.events):
        if not start <= event.time <= stop:
            problems.add(
                ("events", i, "time"),
                f"the event at {event.time:g} s lies outside the run, {start:g} to {stop:g} s. Move it or the run's end.",
            )
