"""Inputs from files: the histories that ``[[inputs]]`` of a scenario name, in the unit and type of the input."""

from __future__ import annotations

import csv
import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ScenarioError
from ..fmi.file import FmuFile
from ..fmi.types import FLOATS, Value, parse
from ..fmi.units import conversion, definition_of
from ..names import split_endpoint, suggest
from .schema import Input, Scenario
from .source import Problems

FILE = "[inputs]"  # stands for a component where a connection has its sender


@dataclass(frozen=True)
class History:
    """What an input is over time.

    Attributes
    ----------
    times : list of float
        Increasing [s].
    values : list
        One per time.
    linear : bool
        Interpolate between them; otherwise each is held until the next.
    periodic : bool
        Begin again at the last time, whose value is then that of the first.
    """

    times: list[float]
    values: list[Any]
    linear: bool
    periodic: bool

    def __call__(self, time: float) -> Value:
        """Return the value at a time [s]."""
        first, last = self.times[0], self.times[-1]
        if self.periodic:
            time = first + (time - first) % (last - first)
        if self.linear:
            return float(np.interp(time, self.times, self.values))
        return self.values[max(bisect_right(self.times, time + 1e-9 * (abs(time) + 1.0)) - 1, 0)]  # type: ignore[no-any-return]


def read_histories(
    scenario: Scenario, files: Mapping[str, FmuFile], fed: dict[str, int], problems: Problems
) -> dict[str, History]:
    """Read the histories of inputs, by ``component.input``, and note in ``fed`` what they feed."""
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
        try:
            histories[given.target] = _read(scenario, given, fmu, name, files)
        except ScenarioError as error:
            problems.add(("inputs", i), str(error))
        fed[given.target] = -1
    return histories


def _read(scenario: Scenario, given: Input, fmu: FmuFile, name: str, files: Mapping[str, FmuFile]) -> History:
    """Read one history; every mistake is a ``ScenarioError`` without its line."""
    kind, path = fmu.variables[name].type, scenario.folder / given.file
    linear = given.between == "linear" if given.between else kind in FLOATS
    if linear and kind not in FLOATS:
        msg = f'{given.target!r} is of type {kind} and cannot be interpolated. Write between = "held".'
        raise ScenarioError(msg)
    try:
        times, texts, unit = (_read_csv if path.suffix == ".csv" else _read_netcdf)(path, given)
        values = [parse(kind, text) for text in texts]
    except (OSError, ValueError, IndexError, KeyError, StopIteration) as error:
        reason = "it is empty" if isinstance(error, StopIteration) else str(error).rstrip(".")
        msg = f"column {given.column!r} of {path} cannot be read as {kind}: {reason}. Correct the file."
        raise ScenarioError(msg) from error
    if not times or any(b <= a for a, b in pairwise(times)) or not all(map(math.isfinite, times)):
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
    if kind in FLOATS:
        gain, bias = _unit_conversion(given.unit or unit, fmu, name, files)
        values = [gain * float(value) + bias for value in values]
    _check_range(values, times, fmu, name)
    return History(times, values, linear, given.periodic)


def _read_csv(path: Path, given: Input) -> tuple[list[float], list[str], str | None]:
    """Return times, texts and the unit of a column, whose title may end in its unit: ``pressure [kPa]``."""
    with path.open(newline="", encoding="utf-8-sig") as file:
        rows = csv.reader(file)
        titles = next(rows)
        table = [row for row in rows if row]
    names = [title.partition(" [")[0].strip() for title in titles]
    time, column = (_find(text, titles, names) for text in (given.time or titles[0], given.column))
    _, _, unit = titles[column].partition(" [")
    return [float(row[time]) for row in table], [row[column].strip() for row in table], unit.rstrip("] ") or None


def _find(text: str, titles: list[str], names: list[str]) -> int:
    for known in (titles, names):
        if text in known:
            return known.index(text)
    msg = f"there is no column {text!r}. {suggest(text, names)}"
    raise ValueError(msg)


def _read_netcdf(path: Path, given: Input) -> tuple[list[float], list[str], str | None]:
    """Return times, values as texts and the unit of a variable over one dimension."""
    import xarray as xr  # a scenario without such a file does not need it

    with xr.open_dataset(path, decode_times=False) as data:
        if given.column not in data:
            msg = f"there is no variable {given.column!r}. {suggest(given.column, map(str, data.data_vars))}"
            raise ValueError(msg)
        column = data[given.column]
        if column.ndim != 1:
            msg = f"it has {column.ndim} dimensions, not one"
            raise ValueError(msg)
        times = data[given.time or str(column.dims[0])]
        return times.values.astype(float).tolist(), [repr(v) for v in column.values.tolist()], column.attrs.get("units")


def _unit_conversion(unit: str | None, fmu: FmuFile, name: str, files: Mapping[str, FmuFile]) -> tuple[float, float]:
    """Return gain and bias from the unit of a file to that of an input."""
    own = fmu.unit(name)
    if unit is None or own is None or unit == own:
        return 1.0, 0.0
    defined = {u.name: u.baseUnit for each in files.values() for u in each.description.unitDefinitions}
    converted = conversion(defined.get(unit) or definition_of(unit), fmu.unit_definition(name))
    if converted is None:
        msg = f"its unit {unit!r} cannot be converted to {own!r}, that of {name!r}. Convert the column, or correct its unit."
        raise ScenarioError(msg)
    return converted


def _check_range(values: list[Any], times: list[float], fmu: FmuFile, name: str) -> None:
    low, high = fmu.limits(name)
    for value, time in zip(values, times, strict=True):
        if isinstance(value, int | float) and not low <= value <= high:
            unit = fmu.unit(name) or ""
            msg = (
                f"at {time:g} s input {name!r} would be {value:g} {unit}".rstrip()
                + f", and it must lie in {low:g} to {high:g}. Correct the file or its unit."
            )
            raise ScenarioError(msg)
