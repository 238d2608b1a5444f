"""Inputs from files: the histories that ``[[inputs]]`` of a scenario name, in the unit and type of the input."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gossamer_files import DataError, NotFiniteError
from gossamer_files.measured import Column, Wanted, factor, named_column, read_columns
from numpy.typing import NDArray

from ..errors import ScenarioError, require
from ..fmi.file import FmuFile
from ..fmi.types import FLOATS, TEXTS, Value, conversion, definition_of, parse
from ..names import split_endpoint, suggest
from .connections import Draft
from .schema import Input, Scenario

FILE = "[inputs]"  # stands for a component where a connection has its sender
TITLE = re.compile(r"(.*?)\s+(?:\[([^\[\]]*)\]|\(([^()]*)\))")  # pressure [kPa]


@dataclass(frozen=True)
class History:
    """What an input is over time.

    Attributes
    ----------
    times : numpy.ndarray
        Increasing [s].
    values : numpy.ndarray or list
        One per time; an array of Reals.
    linear : bool
        Interpolate between them; otherwise each is held until the next.
    periodic : bool
        Begin again, with the first value, at the last time.
    """

    times: NDArray[np.float64]
    values: NDArray[np.float64] | list[Any]
    linear: bool
    periodic: bool

    def __call__(self, time: float) -> Value:
        """Return the value at a time [s]."""
        tolerance = 1e-9 * (abs(time) + 1.0)
        if self.periodic:
            first, period = self.times[0], self.times[-1] - self.times[0]
            phase = (time - first) % period
            time = first + (phase if period - phase > tolerance else 0.0)  # a remainder may be a period by round-off
        if self.linear:
            return float(np.interp(time, self.times, self.values))
        place = int(np.searchsorted(self.times, time + tolerance, side="right")) - 1
        return self.values[max(place, 0)]  # type: ignore[no-any-return]


def read_histories(draft: Draft, fed: dict[str, int]) -> dict[str, History]:
    """Read the histories of inputs, by ``component.input``, and note in ``fed`` what they feed."""
    scenario, files, problems = draft.scenario, draft.files, draft.problems
    histories = {}
    for i, given in enumerate(scenario.inputs):
        component, name = split_endpoint(given.target)
        fmu = files.get(component)
        if fmu is None:
            problems.add(("inputs", i, "to"), f"there is no component {component!r}. {suggest(component, files)}")
            continue
        if name not in fmu.names("input"):
            text = f"FMU {fmu.name!r} has no input {name!r}. {suggest(name, fmu.names('input'))}"
            problems.add(("inputs", i, "to"), text)
            continue
        if given.target in fed or given.target in histories:
            text = f"input {given.target!r} is fed twice. Remove one of its connections and histories."
            problems.add(("inputs", i, "to"), text)
            continue
        with problems.noting(("inputs", i)):
            histories[given.target] = _read(scenario, given, fmu, name, files)
        fed[given.target] = -1
    return histories


def _read(scenario: Scenario, given: Input, fmu: FmuFile, name: str, files: Mapping[str, FmuFile]) -> History:
    """Read one history; every mistake is a ``ScenarioError`` without its line."""
    kind, path = fmu.variables[name].type, scenario.folder / given.file
    linear = given.between == "linear" if given.between else kind in FLOATS
    if linear and kind not in FLOATS:
        msg = f'{given.target!r} is of type {kind} and cannot be interpolated. Write between = "held".'
        raise ScenarioError(msg)
    if not path.exists():
        msg = f"there is no file {path.absolute()}; 'file' is looked for beside the scenario. Correct its name or folder."
        raise ScenarioError(msg)
    try:
        times, values, unit = (_read_csv if path.suffix == ".csv" else _read_netcdf)(path, given, kind)
    except DataError as error:
        raise ScenarioError(str(error)) from error
    except (OSError, ValueError, KeyError) as error:
        msg = f"column {given.column!r} of {path} cannot be read as {kind}: {str(error).rstrip('.')}. Correct the file."
        raise ScenarioError(msg) from error
    if not times.size or not np.all(np.diff(times) > 0.0) or not np.all(np.isfinite(times)):
        msg = f"the times of {path} do not increase. Sort its rows, and keep one per time."
        raise ScenarioError(msg)
    begin, end = times[0], times[-1]
    tolerance = 1e-9 * scenario.step
    if not given.periodic and (begin > scenario.start + tolerance or (linear and end < scenario.stop - tolerance)):
        msg = (
            f"{path} holds times from {begin:g} to {end:g} s and the run needs {scenario.start:g} to {scenario.stop:g} s. "
            'Change the run, or write periodic = true or between = "held".'
        )
        raise ScenarioError(msg)
    if given.periodic and len(times) < 2:
        msg = f"{path} has one time, which is no period. Add the end of the period."
        raise ScenarioError(msg)
    history: NDArray[np.float64] | list[Value] = values
    if kind in FLOATS:
        converted = _unit_conversion(given.unit or unit, fmu, name, files)
        if converted is None:
            why = f"its unit {given.unit or unit!r} cannot be converted to {fmu.unit(name)!r}, that of {name!r}"
            msg = f"column {given.column!r} of {path}: {why}. Convert the column, or correct its unit."
            raise ScenarioError(msg)
        gain, bias = converted
        history = gain * np.array(values, dtype=np.float64) + bias
        if not np.isfinite(history).all():
            at = times[int(np.argmin(np.isfinite(history)))]
            msg = f"column {given.column!r} of {path} holds no finite number at {at:g} s. Correct the file."
            raise ScenarioError(msg) from NotFiniteError(msg)
    _check_range(history, times, fmu, name, path)
    return History(times, history, linear, given.periodic)


def _read_csv(path: Path, given: Input, kind: str) -> tuple[NDArray[np.float64], list[Value], str | None]:
    """Return times, values and the unit of a column, whose title may end in its unit: ``pressure [kPa]``."""
    what = "value" if kind in FLOATS else "text"

    def choose(header: list[str], line: int) -> list[Column]:
        places = [_find(path, line, text, header) for text in (given.time or header[0], given.column)]
        time = named_column(path, header, line, Wanted(what="time"), places[0])
        unit = _divided(header[places[1]])[1]
        return [time, Column(wanted=Wanted(what=what), place=places[1], name=given.column, unit=unit)]

    read = read_columns(path, choose)
    read.check_once(read.values[0])
    unit = read.columns[1].unit
    if kind in FLOATS:
        return read.values[0], read.values[1].tolist(), unit
    values = []
    for line, text in zip(read.lines, read.texts, strict=True):
        try:
            values.append(_parse_cell(kind, text))
        except ValueError as error:
            msg = f"{path}, line {line}: column {given.column!r} cannot be read as {kind}: {error}. Correct the file."
            raise DataError(msg) from error
    return read.values[0], values, unit


def _divided(title: str) -> tuple[str, str | None]:
    """Divide a title into name and unit; the index of ``strain[1]`` is part of the name."""
    match = TITLE.fullmatch(title)
    return (match[1], match[2] or match[3] or None) if match else (title, None)


def _parse_cell(kind: str, text: str) -> Value:
    """Read one value of a file; unlike a start value it cannot be left out."""
    text = text.lower() if kind == "Boolean" else text
    require(text or kind in TEXTS, "there is no value", ValueError)
    return parse(kind, text)


def _find(path: Path, line: int, text: str, titles: list[str]) -> int:
    """Return the place of a column by its title, or by the title without a unit."""
    names = [_divided(title)[0] for title in titles]
    for known in (titles, names):
        if known.count(text) == 1:
            return known.index(text)
    several, none = f"several columns are called {text!r}. Rename all but one.", f"there is no column {text!r}. "
    msg = f"{path}, line {line}: {several if text in names else none + suggest(text, names)}"
    raise DataError(msg)


def _read_netcdf(path: Path, given: Input, kind: str) -> tuple[NDArray[np.float64], list[Value], str | None]:
    """Return times, values and the unit of a variable over one dimension."""
    import xarray as xr  # a scenario without such a file does not need it

    with xr.open_dataset(path, decode_times=False) as data:
        if given.column not in data:
            msg = f"there is no variable {given.column!r}. {suggest(given.column, map(str, data.data_vars))}"
            raise ValueError(msg)
        column = data[given.column]
        require(column.ndim == 1, f"it has {column.ndim} dimensions, not one", ValueError)
        times = data[given.time or str(column.dims[0])]
        clock = str(times.attrs.get("units", "s")).partition(" since ")[0]
        if (seconds := factor(clock, "time")) is None:
            msg = f"the unit of {times.name!r} is {clock!r}, which is none of time"
            raise ValueError(msg)
        values = [_parse_cell(kind, v if isinstance(v, str) else repr(v)) for v in column.values.tolist()]
        return seconds * times.values.astype(np.float64), values, column.attrs.get("units")


def _unit_conversion(unit: str | None, fmu: FmuFile, name: str, files: Mapping[str, FmuFile]) -> tuple[float, float] | None:
    """Return gain and bias from the unit of a file to that of an input; None if there is no way."""
    own = fmu.unit(name)
    if unit is None or own is None or unit == own:
        return 1.0, 0.0
    defined = {u.name: u.baseUnit for each in files.values() for u in each.description.unitDefinitions}
    converted = conversion(defined.get(unit) or definition_of(unit), fmu.unit_definition(name))
    if converted is None:
        return None
    gain, bias = converted
    return gain, 0.0 if fmu.is_difference(name) else bias


def _check_range(values: Iterable[Any], times: NDArray[np.float64], fmu: FmuFile, name: str, path: Path) -> None:
    low, high = fmu.limits(name)
    for value, time in zip(values, times, strict=True):
        if isinstance(value, int | float) and not low <= value <= high:
            unit = fmu.unit(name) or ""
            msg = (
                f"at {time:g} s input {name!r} would be {value:g} {unit}".rstrip()
                + f", and it must lie in {low:g} to {high:g}. Correct {path} or its unit."
            )
            raise ScenarioError(msg)
