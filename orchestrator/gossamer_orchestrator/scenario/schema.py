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

    [[inputs]]
    to = "gain.v"
    file = "measured.csv"
    column = "voltage"

    [step_control]           # divides 'step' where that changes what is sent by more than a part of it
    tolerance = 1e-4

    [[groups]]               # stepped together, again and again, until what they send each other agrees
    components = ["source", "gain"]
    tolerance = 1e-8

    [[events]]
    time = 0.5
    component = "gain"
    set = { "offset[1]" = 1.0 }

    [record]
    variables = ["gain.*"]
    every = 10
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, get_args

from gossamer_files.inputs import followed
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, field_validator

from ..errors import require
from ..names import split_endpoint
from .source import Source

MAX_STEPS = 1e8
Master = Literal["gauss-seidel", "jacobi"]
MASTERS = get_args(Master)
Value = bool | int | float | str
Given = Value | list[Value] | list[list[Value]]  # the elements of an array, or its rows
Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]
Endpoint = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*\..+$")]


class ScenarioTable(BaseModel):
    """A table of the file; unknown keys, other types and infinite numbers are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, populate_by_name=True)


class Noise(ScenarioTable):
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


class Dropout(ScenarioTable):
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


class Component(ScenarioTable):
    """One instance of an FMU.

    Attributes
    ----------
    fmu : str
        Name of an FMU in the folder of FMUs, or a path that ends in ``.fmu``.
    every : int
        It steps at every n-th communication point, over the n steps that end there, with the inputs of the last of them; its
        outputs are held in between.
    parameters : dict
        Values by name or pattern; the others keep the FMU's start values.
    inputs : dict
        Values of the inputs that no connection feeds, by name or pattern; a name beats a pattern, a later pattern an
        earlier one.
    """

    fmu: str
    every: int = Field(default=1, ge=1, le=int(MAX_STEPS))
    parameters: dict[str, Given] = Field(default_factory=dict)
    inputs: dict[str, Given] = Field(default_factory=dict)


class Connection(ScenarioTable):
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
    delayed : bool
        The receiver steps before the sender and gets its value of the last step: what closes a circle of components that
        feed each other.
    """

    origin: Endpoint = Field(alias="from")
    target: Endpoint = Field(alias="to")
    gain: float | None = None
    bias: float | None = None
    noise: Noise | None = None
    dropout: Dropout | None = None
    delayed: bool = False

    @property
    def is_plain(self) -> bool:
        """True if what is sent arrives as it is."""
        return (self.gain, self.bias, self.noise, self.dropout) == (None, None, None, None)

    @property
    def sender(self) -> str:
        """Component that sends."""
        return split_endpoint(self.origin)[0]

    @property
    def output(self) -> str:
        """Name of the sender's output."""
        return split_endpoint(self.origin)[1]

    @property
    def receiver(self) -> str:
        """Component that receives."""
        return split_endpoint(self.target)[0]

    @property
    def input(self) -> str:
        """Name of the receiver's input."""
        return split_endpoint(self.target)[1]


class Input(ScenarioTable):
    """A measured history of an input that no connection feeds; it is looked up where a step of the run begins, and held.

    Attributes
    ----------
    target : str
        ``component.input``; written ``to`` in the file.
    file, column : str
        A CSV file with titles, or a netCDF file, relative to the scenario; the title of a column, without its unit, or the
        name of a variable.
    time : str or None
        Column of the times [s]; None is the first column, or the variable's dimension.
    unit : str or None
        Unit of the column; None is the one in its title, ``pressure [kPa]``, or that of the variable. It is converted.
    between : {"linear", "held"} or None
        What the input is between two rows; None is linear for Reals, and held for other types.
    periodic : bool
        The last row is the first of the next period.
    """

    target: Endpoint = Field(alias="to")
    file: str
    column: str
    time: str | None = None
    unit: str | None = None
    between: Literal["linear", "held"] | None = None
    periodic: bool = False


class Event(ScenarioTable):
    """Inputs that change at the first communication point not before ``time`` [s]."""

    time: float
    component: Name
    set: dict[str, Given] = Field(min_length=1)


class Group(ScenarioTable):
    """Components that need each other's outputs at the same instant; their steps are repeated until these agree.

    Attributes
    ----------
    components : list of str
        Their names.
    tolerance : float
        Largest change of a value that is fed back, from one repetition to the next, in parts of its nominal value, or
        where the FMU declares none of its largest value so far.
    sweeps : int
        Largest number of repetitions of a step.
    """

    components: list[Name] = Field(min_length=1)
    tolerance: float = Field(default=1e-6, gt=0.0, lt=1.0)
    sweeps: int = Field(default=20, ge=1, le=1000)


class StepControl(ScenarioTable):
    """Steps that are divided where that changes what the components send each other.

    Attributes
    ----------
    tolerance : float
        Largest difference between a step and the same in two halves, in parts of a variable's nominal value, or where the
        FMU declares none of its largest value so far, or 1 of its unit if that is more.
    parts : int
        The smallest step that is tried whole is ``step`` over this, a power of two.
    """

    tolerance: float = Field(gt=0.0, lt=1.0)
    parts: int = Field(default=1024, ge=2, le=2**19)

    @field_validator("parts")
    @classmethod
    def _is_a_power_of_two(cls, parts: int) -> int:
        require(not parts & (parts - 1), "'parts' is a power of two, such as 64 or 1024", ValueError)
        return parts


class Recording(ScenarioTable):
    """What is recorded.

    Attributes
    ----------
    variables : list of str or None
        Patterns of ``component.variable``; None records every output and every input that no connection feeds.
    every : int
        Record each n-th communication point.
    frames : int
        Instants, evenly spread over the run, at which the shapes of membranes are recorded; 0 for none.
    """

    variables: list[str] | None = None
    every: int = Field(default=1, ge=1, le=int(MAX_STEPS))
    frames: int = Field(default=240, ge=0, le=100_000)


class Scenario(ScenarioTable):
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
    groups : list of Group
        Components that are iterated, under Gauss-Seidel.
    step_control : StepControl or None
        Divide ``step`` where the error demands it; None does not.
    """

    title: str = ""
    step: float = Field(gt=0.0)
    start: float = 0.0
    stop: float
    master: Master = "gauss-seidel"
    order: list[Name] | None = None
    components: dict[Name, Component] = Field(min_length=1)
    connections: list[Connection] = Field(default_factory=list)
    inputs: list[Input] = Field(default_factory=list)
    groups: list[Group] = Field(default_factory=list)
    step_control: StepControl | None = None
    events: list[Event] = Field(default_factory=list)
    record: Recording = Field(default_factory=Recording)

    _source: Source = PrivateAttr(default=Source("scenario", ""))
    _folder: Path = PrivateAttr(default=Path())

    def model_post_init(self, context: tuple[Source, Path] | None, /) -> None:
        """Keep where the scenario came from, which is no key of the file."""
        if context is not None:
            self._source, self._folder = context

    @property
    def source(self) -> Source:
        """The file it came from."""
        return self._source

    def with_source(self, source: Source) -> Scenario:
        """Return the same scenario, said to come from another source."""
        copy = self.model_copy()
        copy._source = source
        return copy

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
        return followed(self.folder / fmu if fmu.endswith(".fmu") else fmus / f"{fmu}.fmu")

    def seconds(self, tick: int) -> float:
        """Convert a count of steps to time [s]."""
        return self.start + tick * self.step
