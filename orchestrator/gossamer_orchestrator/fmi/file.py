"""An FMU file: its model description, its variables as scalars, and its folder once it is unpacked.

An array of FMI 3.0 becomes its elements, as FMI 2.0 names them.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Mapping
from functools import cached_property
from itertools import product
from math import prod
from operator import itemgetter
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import fmpy
from attrs import evolve
from fmpy.model_description import ValidationError

from ..errors import FmuError
from ..names import split_indices
from .archive import check_archive, unpack
from .types import FLOATS, SAME, TEXTS, parse

OPTIONAL = "optional"  # declared type of inputs that may stay at their start values


class FmuFile:
    """One FMU on disk, FMI 2.0 or 3.0, shared by all its instances; for co-simulation, or else for model exchange.

    Parameters
    ----------
    path : Path
        The ``.fmu`` file.
    sizes : mapping of str to int, optional
        Values of structural parameters in place of their start values; they set the dimensions of arrays.
    validate : bool
        Whether to look for ``findings``, which takes seconds for a hundred thousand variables.

    Attributes
    ----------
    description : fmpy.model_description.ModelDescription
        As read by FMPy.
    version : int
        Of FMI, 2 or 3.
    variables : dict
        FMPy's ``ModelVariable`` by name; an array of FMI 3.0 stands there as its elements, named ``strain[1]``.
    arrays : dict
        Names of the elements of every array of FMI 3.0, row by row.
    clocks : dict
        FMPy's ``ModelVariable`` of every clock of FMI 3.0, which are none of the variables.
    findings : list of str
        What FMPy finds against the rules of FMI in a model description that can be read nevertheless.
    corrupt : bool
        An instance returned Fatal: by FMI no function of any instance may be called any more.

    Raises
    ------
    FmuError
        No archive, a dangerous one, no model description that can be read, or an FMI that this program does not run.
    """

    def __init__(self, path: Path, sizes: Mapping[str, int] | None = None, *, validate: bool = True) -> None:
        self.path = Path(path)
        check_archive(self.path)
        self.findings: list[str] = []
        description = self._read(validate=validate)
        if not description.fmiVersion.startswith(("2", "3")) or interface(description) is None:
            kind = "" if interface(description) else " for scheduled execution"
            msg = (
                f"{self.path} is FMI {description.fmiVersion}{kind}; this program runs FMI 2.0 and 3.0 for co-simulation "
                "and model exchange. Export it for one of them."
            )
            raise FmuError(msg)
        self.description: Any = description
        self.version = int(description.fmiVersion[0])
        self.variables, self.arrays = flatten(self.path, description.modelVariables, sizes or {})
        self.clocks = {name: v for name, v in self.variables.items() if v.type == "Clock"}
        self.variables = {name: v for name, v in self.variables.items() if name not in self.clocks}
        self._array_of = {element: name for name, elements in self.arrays.items() for element in elements}
        self._check_starts()
        self.corrupt = False
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def _read(self, *, validate: bool) -> Any:  # noqa: ANN401
        """Read the model description; what is only against the rules goes to ``findings``."""
        try:
            with self.path.open("rb") as file:  # given a path, FMPy may leave it open
                try:
                    return fmpy.read_model_description(file, validate=validate)
                except ValidationError as error:
                    self.findings = [" ".join(str(problem).split()) for problem in error.problems]
                return fmpy.read_model_description(file, validate=False)
        except Exception as error:
            # FMPy raises bare exceptions, lxml its own
            advice = f"Check it with 'gossamer verify {self.path.name}'."
            problem = "; ".join(self.findings[:2]) or error
            msg = f"{self.path}: its modelDescription.xml is not valid: {problem}. {advice}"
            raise FmuError(msg) from error

    def _check_starts(self) -> None:
        for name, variable in self.variables.items():
            try:
                parse(variable.type, variable.start)
            except ValueError as error:
                advice = f"Check it with 'gossamer verify {self.path.name}'."
                msg = f"{self.path}: the start value {variable.start!r} of {name!r} is no {variable.type}. {advice}"
                raise FmuError(msg) from error

    @property
    def name(self) -> str:
        """File name without its ending."""
        return self.path.stem

    @property
    def interface(self) -> Any:  # noqa: ANN401
        """What it declares of the kind that is run, for co-simulation if it has that: FMPy's ``InterfaceType``."""
        return interface(self.description)

    @property
    def model_exchange(self) -> bool:
        """True if it is for model exchange only, so that this program integrates it."""
        return self.description.coSimulation is None

    @property
    def can_repeat(self) -> bool:
        """True if instances can restore their state and repeat a step in parts."""
        can = self.interface
        return bool(can.canGetAndSetFMUstate and (self.model_exchange or can.canHandleVariableCommunicationStepSize))

    def names(self, *causalities: str, kind: str | None = None) -> list[str]:
        """List variables of some causalities, and of one type if given, in the order of the model description."""
        return [v.name for v in self.variables.values() if v.causality in causalities and kind in (None, v.type)]

    def unit(self, name: str) -> str | None:
        """Return a variable's unit, its own or that of its declared type."""
        variable = self.variables[name]
        declared = variable.declaredType.unit if variable.declaredType is not None else None
        return variable.unit or declared

    def unit_definition(self, name: str) -> Any:  # noqa: ANN401
        """Return FMPy's ``BaseUnit`` of a variable's unit, or None; differences have no offset."""
        unit = self.unit(name)
        found = next((each.baseUnit for each in self.description.unitDefinitions if each.name == unit), None)
        return evolve(found, offset=0.0) if found is not None and self.is_difference(name) else found

    def is_difference(self, name: str) -> bool:
        """Tell whether a variable is a difference, of temperatures for instance (``relativeQuantity``).

        Its declared type says so: FMPy 0.3.32 does not read that of a variable itself.
        """
        return bool(getattr(self.variables[name].declaredType, "relativeQuantity", False))

    def is_optional(self, name: str) -> bool:
        """Tell whether an input may stay at its start value: its declared type is ``OPTIONAL``."""
        declared = self.variables[name].declaredType
        return declared is not None and declared.name == OPTIONAL

    def is_continuous(self, name: str) -> bool:
        """Tell whether a variable may change between events."""
        variable = self.variables[name]
        return variable.type in FLOATS and variable.variability in (None, "continuous")

    def feedthrough(self) -> list[tuple[list[str], list[str]]]:
        """List outputs that depend on the same inputs at the same instant, and these; undeclared means all of them."""
        inputs = self.names("input")
        declared = {
            unknown.variable.name: unknown.dependencies
            for unknown in self.description.outputs
            if unknown.variable is not None
        }
        through: dict[str | None, tuple[list[str], list[str]]] = {}
        for output in self.names("output"):
            whole = self.array_of(output) or output
            on = declared.get(whole)
            if on is None:
                through.setdefault(None, ([], inputs))[0].append(output)
                continue
            if whole not in through:
                names = [v.name for v in on if v.causality == "input" and v.name not in self.clocks]
                through[whole] = [], [element for name in names for element in self.arrays.get(name, [name])]
            through[whole][0].append(output)
        return list(through.values())

    def array_of(self, name: str) -> str | None:
        """Return the array of FMI 3.0 of which a variable is an element, which is exchanged as a whole; else None."""
        return self._array_of.get(name)

    def clocks_of(self, name: str) -> tuple[int, ...]:
        """Return the value references of the clocks to which a variable belongs, most often none."""
        return tuple(clock.valueReference for clock in self.variables[name].clocks or ())

    def elements(self, name: str) -> list[str]:
        """List the elements of an array, row by row: one of FMI 3.0, or variables of FMI 2.0 named ``strain[1]`` etc."""
        return self.arrays[name] if name in self.arrays else self._indexed.get(name, [])

    @cached_property
    def _indexed(self) -> dict[str, list[str]]:
        """Elements by the name of what looks like an array in FMI 2.0."""
        found: dict[str, list[tuple[tuple[int, ...], str]]] = {}
        for v in self.variables:
            base, indices = split_indices(v)
            if indices:
                found.setdefault(base, []).append((indices, v))
        return {base: [v for _, v in sorted(each, key=itemgetter(0))] for base, each in found.items()}

    def whole(self, names: Iterable[str]) -> list[str]:
        """List names with the other elements of their arrays of FMI 3.0, in the order of the model description."""
        wanted = set(names)
        arrays = {self.array_of(name) for name in wanted} - {None}
        return [v for v in self.variables if v in wanted or self.array_of(v) in arrays]

    def references(self, names: Iterable[str]) -> list[int]:
        """Return the value references of variables; an array of FMI 3.0, whose elements are neighbours, has one."""
        return list({self.array_of(v) or v: self.variables[v].valueReference for v in names}.values())

    def limits(self, name: str) -> tuple[float, float]:
        """Return the least and the largest value of a variable, its own or that of its declared type."""
        variable, declared = self.variables[name], self.variables[name].declaredType
        limits = []
        for key, none in (("min", -math.inf), ("max", math.inf)):
            text = getattr(variable, key) or getattr(declared, key, None)
            limits.append(none if text is None else float(text))
        items = self.items(name)
        return (min(items), max(items)) if items else (limits[0], limits[1])

    def items(self, name: str) -> dict[int, str]:
        """Return the names of an enumeration's values; nothing of other variables."""
        variable = self.variables[name]
        declared = getattr(variable.declaredType, "items", []) if variable.type == "Enumeration" else []
        return {int(item.value): item.name for item in declared}

    def resized(self, values: Mapping[str, object], *, validate: bool = True) -> FmuFile:
        """Return the FMU with arrays of the sizes that structural parameters among some values give them."""
        given = {v: values.get(v) for v in self.names("structuralParameter")}
        sizes = {v: size for v, size in given.items() if type(size) is int and size >= 0}
        return FmuFile(self.path, sizes, validate=validate) if sizes else self

    def folder(self) -> Path:
        """Unpack it into a temporary folder, once."""
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="gossamer-", ignore_cleanup_errors=True)
            unpack(self.path, Path(self._folder.name))
        return Path(self._folder.name)

    def resource(self, name: str) -> str | None:
        """Return a text file of its resources, None if it has none of this name."""
        with ZipFile(self.path) as archive:
            path = f"resources/{name}"
            return archive.read(path).decode("utf-8") if path in archive.namelist() else None

    def close(self) -> None:
        """Remove the temporary folder."""
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None


def interface(description: Any) -> Any:  # noqa: ANN401
    """Return what an FMU declares of its co-simulation, else of its model exchange; None without both."""
    return description.coSimulation or description.modelExchange


def library_path(folder: Path, description: Any) -> Path:  # noqa: ANN401
    """Return where an unpacked FMU, FMI 2.0 or 3.0, has its binary for this machine."""
    platform = fmpy.platform if description.fmiVersion.startswith("2") else fmpy.platform_tuple
    name = f"{interface(description).modelIdentifier}{fmpy.sharedLibraryExtension}"
    return folder / "binaries" / str(platform) / name


def platforms(folder: Path) -> list[str]:
    """List the platforms for which an unpacked FMU has a binary."""
    return sorted(p.name for p in (folder / "binaries").glob("*") if p.is_dir())


def explain_platforms(folder: Path, library: Path) -> str:
    """Explain which binary an unpacked FMU lacks, and which it has."""
    there = platforms(folder)
    has = f"binaries for {', '.join(there)}" if there else "no binaries"
    return f"It has no {library.relative_to(folder).as_posix()}, which this machine needs; it has {has}."


MAX_ELEMENTS = 1_000_000


def flatten(path: Path, described: Iterable[Any], sizes: Mapping[str, int]) -> tuple[dict[str, Any], dict[str, list[str]]]:
    """List the scalars and elements of arrays of an FMU.

    Parameters
    ----------
    path : Path
        The FMU, for messages.
    described : iterable of fmpy.model_description.ModelVariable
        Its variables. Their types are renamed to those of ``types``.
    sizes : mapping of str to int
        Values of structural parameters in place of their start values.

    Returns
    -------
    variables : dict of str to fmpy.model_description.ModelVariable
        By name; elements row by row, with one-based indices: ``A[1,1]``, ``A[1,2]``.
    arrays : dict of str to list of str
        The names of the elements of every array.

    Raises
    ------
    FmuError
        An array is absurdly large.
    """
    variables: dict[str, Any] = {}
    arrays: dict[str, list[str]] = {}
    for variable in described:
        variable.type = SAME.get(variable.type, variable.type)
        if not variable.dimensions:
            variables[variable.name] = variable
            continue
        shape = [int(d.start) if (v := d.variable) is None else sizes.get(v.name, int(v.start)) for d in variable.dimensions]
        if not 0 <= prod(shape) <= MAX_ELEMENTS:
            msg = (
                f"{path}: its array {variable.name!r} has {' x '.join(map(str, shape))} elements, and at most "
                f"{MAX_ELEMENTS} are exchanged. Give its structural parameters other values."
            )
            raise FmuError(msg)
        starts = _starts(variable, prod(shape))
        names = [f"{variable.name}[{','.join(map(str, i))}]" for i in product(*(range(1, n + 1) for n in shape))]
        arrays[variable.name] = names
        for name, start in zip(names, starts, strict=True):
            variables[name] = evolve(variable, name=name, start=start)
    return variables, arrays


def _starts(variable: Any, size: int) -> list[str | None]:  # noqa: ANN401
    """Return the start value of each element; None if the declared ones are of another number."""
    texts: list[Any] = [variable.start] if variable.type in TEXTS else (variable.start or "").split()
    if len(texts) == 1:
        return texts * size
    return texts if len(texts) == size else [None] * size
