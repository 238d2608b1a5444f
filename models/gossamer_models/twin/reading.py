r"""Records for the twin from tables: columns found by name, times put on a grid, or readings by load state.

Symbols: ``t`` times [s] since the record began, ``h`` step of the grid [s].
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, TypeAlias, cast

import numpy as np
from gossamer_files.measured import Column, Measured, Wanted, conversion, find_column, listed, named_column, read_columns
from gossamer_files.options import option
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..errors import DataError, require
from ..membrane import Structure, square_structure
from .nuisances import LoadTable
from .record import LEAST_SAMPLES, ResponseRecord, StaticRecord

KINDS = ("resistance", "strain")
INDEXED = re.compile(r"(strain|resistance) ?\[(\d+)\](.*)")  # strain[1] [%]
TITLE = re.compile(r"(\w+(?:\[\d+\])?)\s*(?:[\[(]([^\[\]()]*)[\])])?")  # base_acceleration[2] [m/s2]
STATE = "state"
CLOCKS = ("time", "date")  # how names of columns begin that are no loads
OFF_GRID = 0.05  # of a step: how far a time may lie from the grid
SAME = 1e-9  # of the size of a load: how far the rows of a state may differ
LONGEST = 1_000_000  # samples
PART = 120  # lines of a table that arrives, which are read together
MOST_LOST = 5  # samples in which loads are taken to be straight
Beginning: TypeAlias = Literal["rest", "equilibrium"]

logger = logging.getLogger(__name__)


def read_table(
    path: Path,
    kind: str | None = None,
    noise: float | None = None,
    structure: Structure | None = None,
    begins: Beginning | None = None,
) -> ResponseRecord:
    """Read a CSV file with a column of time, or of load states, and ``strain[1]``, ... or ``resistance[1]``, ...

    Parameters
    ----------
    path : Path
        File. A unit stands after a name, ``strain[1] [%]``, or in a row below; without one, values are in s, 1 or ohm.
        Timestamps are counted from the first one. Empty cells and missing rows are gaps; a sensor without a column is left
        out. Columns with the names of the membrane's inputs are loads and need a unit; where they stop, or more than 5 rows
        are missing, the record ends. With a column ``state`` each row is a reading at rest under its loads; rows of one name
        are readings of one state.
    kind : {"strain", "resistance"} or None
        Which columns to take; None for the only ones there are.
    noise : float or None
        Standard deviation of the noise; None to estimate it.
    structure : Structure or None
        Membrane, which knows its sensors and loads; None for the square of the thesis.
    begins : {"rest", "equilibrium"} or None
        At rest at time 0, without the loads of the columns; or with the first row, in equilibrium under its loads. None for
        equilibrium where there are columns of loads, but for the square.

    Raises
    ------
    DataError
        The file cannot be read, lacks columns, or its times or values make no sense; the message names the line.
    """
    return _record_of(path, kind, noise, structure, begins)[0]


def read_arriving(
    lines: Iterable[str],
    kind: str | None = None,
    noise: float | None = None,
    structure: Structure | None = None,
    begins: Beginning | None = None,
) -> Iterator[ResponseRecord]:
    """Read a table while it is written: records that follow each other, each from one step after the last sample before.

    Parameters
    ----------
    lines : iterable of str
        Lines of a CSV file in time, with their ends; a few hundred of them are kept. It ends where a load stops.
    kind, noise, structure, begins : optional
        As of ``read_table``.

    Raises
    ------
    DataError
        As of ``read_table``, with times and lines counted in what arrived last, below the header; or the step changes.
    """
    arriving, head, step, done = (line for line in lines if line.strip()), list[str](), 0.0, 0.0
    waiting = list(islice(arriving, PART))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "arriving.csv"
        while True:
            new = list(islice(arriving, PART))
            waiting += new if len(new) < PART else []  # too few for a record of their own
            path.write_text("".join([*head, *waiting]), encoding="utf-8")
            try:
                record, measured = _record_of(path, kind, noise, structure, "equilibrium" if head else begins)
            except DataError as error:
                msg = str(error).replace(str(path), f"what arrived after t = {done:g} s")
                raise DataError(msg) from error
            done += record.samples * record.step
            step = step or record.step
            msg = f"the step of what arrives was {step:g} s, and is {record.step:g} s now. Begin another record."
            require(abs(record.step - step) < OFF_GRID * step, msg, DataError)
            yield record
            time = _time(measured)
            if len(new) < PART or record.samples < round((time[-1] - time[0]) / step):  # the loads are not known any more
                return
            head, waiting = head or waiting[: measured.lines[0] - 1], [waiting[-1], *new]


def _record_of(
    path: Path, kind: str | None, noise: float | None, structure: Structure | None, begins: Beginning | None
) -> tuple[ResponseRecord, Measured]:
    """Read a record, and the table that it is made of."""
    structure = square_structure() if structure is None else structure
    count, units = structure.n_sensors, input_units(structure)
    measured = read_columns(path, lambda header, line: _choose(path, header, line, kind, count, units), unreadable="gap")
    values = np.full((count, len(measured.lines)), np.nan)
    loads = _loads(measured, units, may_stop=not measured.texts)
    for column, row in zip(measured.columns, measured.values, strict=False):
        if column.what in KINDS:
            if column.what == "strain":
                measured.check_strain(column, row, measured.lines)
            values[_sensor(column.name)] = row
    found = next(column.what for column in measured.columns if column.what in KINDS)
    if measured.texts:
        return _make_static(measured, values, loads, found, noise), measured
    time = _time(measured)
    settled = begins == "equilibrium" or (begins is None and bool(loads) and not structure.starts_in_plane)
    return make_record(time, values, found, noise, str(path), measured.lines, loads, settled=settled), measured


def read_loads(path: Path, structure: Structure) -> LoadTable:
    """Read a CSV file with columns of loads, and a column of time, or one of the states of rest that they bring about.

    Parameters
    ----------
    path : Path
        File, with the columns of ``read_table`` but those of sensors.
    structure : Structure
        Membrane, which knows its loads.

    Raises
    ------
    DataError
        The file cannot be read, holds no load, or its times or values make no sense; the message names the line.
    """
    units = input_units(structure)
    measured = read_columns(path, lambda header, line: _beside(path, header, line, units, set()), unreadable="gap")
    loads = {name: tuple(load.tolist()) for name, load in _loads(measured, units).items()}
    if not loads:
        msg = f"{path} holds no load. The membrane has {', '.join(units)}; write a column for each that acts."
        raise DataError(msg)
    if len(measured.lines) < 2 or len(set(measured.texts)) < len(measured.texts):
        msg = f"{path} needs two rows or more, and a name of its own for each state."
        raise DataError(msg)
    if measured.texts:
        return LoadTable(values=loads)
    time = _time(measured)
    return LoadTable(values=loads, time=tuple((time - time[0]).tolist()))


def read_survey(path: Path) -> Matrix:
    """Read measured points of a surface from a CSV file with columns x, y and z, whose units stand after their names.

    Returns
    -------
    ndarray, shape (n, 3)
        Points [m].

    Raises
    ------
    DataError
        The file cannot be read, or lacks a column, a unit or a number.
    """
    units = dict.fromkeys("xyz", "m")

    def choose(header: list[str], line: int) -> list[Column]:
        places = {_load(cell).strip().lower(): k for k, cell in enumerate(header)}
        if lost := [axis for axis in units if axis not in places]:
            msg = f"{path}, line {line}: no column {lost[0]!r}. A survey has x [m], y [m], z [m]; it has {listed(header)}."
            raise DataError(msg)
        return [_load_column(path, line, header[places[axis]].strip().lower(), places[axis], units) for axis in units]

    measured = read_columns(path, choose, unreadable="refused")
    rows = zip(measured.columns, measured.values, strict=True)
    return np.column_stack([_in_units(measured, column, row, units, may_stop=False) for column, row in rows])


def input_units(structure: Structure) -> dict[str, str]:
    """Return the units of the loads and motions that a membrane knows, by name."""
    return {v.name: v.unit for v in structure.table if v.causality == "input" and not v.name.startswith("damage[")}


def _choose(
    path: Path, header: list[str], line: int, kind: str | None, count: int, units: Mapping[str, str]
) -> list[Column]:
    """Return the columns of one kind by sensor, and what stands beside them."""
    indexed = {k: match for k, cell in enumerate(header) if (match := INDEXED.fullmatch(cell))}
    kinds = [each for each in KINDS if kind in (None, each) and any(match[1] == each for match in indexed.values())]
    if len(kinds) != 1:
        wanted = " or ".join(f"{k}[1] to {k}[{count}]" for k in (KINDS if kind is None else [kind]))
        it_has = f"It has both; say which to take with {option('kind')}" if kinds else f"It has {listed(header)}"
        msg = f"{path}, line {line}: the twin needs the columns time and {wanted}. {it_has}."
        raise DataError(msg)
    places = {k: match for k, match in indexed.items() if match[1] == kinds[0]}
    sensors = [_sensor(header[k]) for k in places]
    for k, sensor in zip(places, sensors, strict=True):
        if not 0 <= sensor < count or sensors.count(sensor) > 1:
            why = "stands twice" if 0 <= sensor < count else f"is of none of the {count} sensors"
            msg = f"{path}, line {line}: column {header[k]!r} {why}. Remove it."
            raise DataError(msg)
    column = Wanted(what=kinds[0])
    columns = [named_column(path, header, line, column, k, name=match[1] + match[3]) for k, match in places.items()]
    return columns + _beside(path, header, line, units, {*indexed})


def _beside(path: Path, header: list[str], line: int, units: Mapping[str, str], known: set[int]) -> list[Column]:
    """Return the columns of time, of loads, and last of the state."""
    states = [k for k, cell in enumerate(header) if cell.strip().lower() == STATE]
    columns = [] if states else [find_column(path, header, line, Wanted(what="time"))]
    known = {*known, *states, *(c.place for c in columns)}
    for k, cell in enumerate(header):
        if k not in known and cell.strip() and not cell.strip().lower().startswith(CLOCKS):
            columns.append(_load_column(path, line, cell, k, units))
    return columns + [Column(wanted=Wanted(what="text"), place=k, name=header[k], unit=None) for k in states[:1]]


def _load_column(path: Path, line: int, cell: str, place: int, units: Mapping[str, str]) -> Column:
    """Return a column of a load, in its own unit."""
    match = TITLE.fullmatch(cell.strip())
    name, unit = (match[1], match[2]) if match else (cell, None)
    if name not in units:
        close = get_close_matches(name, units, n=1)
        hint = f"Did you mean {close[0]!r}?" if close else f"It has {', '.join(units)}."
        msg = f"{path}, line {line}: the membrane has no load {name!r}. {hint} Rename the column, or remove it."
        raise DataError(msg)
    if unit is None and units[name] != "1":
        msg = f"{path}, line {line}: column {cell!r} has no unit. Write {name} [{units[name]}], or another unit."
        raise DataError(msg)
    if unit is not None and conversion(unit, units[name]) is None:
        msg = f"{path}, line {line}: {unit!r} of {cell!r} is no unit of {name}. Write {name} [{units[name]}]."
        raise DataError(msg)
    return Column(wanted=Wanted(what="value"), place=place, name=cell, unit=unit)


def _loads(measured: Measured, units: Mapping[str, str], *, may_stop: bool = False) -> dict[str, Vector]:
    """Return the columns of loads by name."""
    columns = zip(measured.columns, measured.values, strict=False)
    return {_load(c.name): _in_units(measured, c, row, units, may_stop=may_stop) for c, row in columns if c.what == "value"}


def _time(measured: Measured) -> Vector:
    time = next(row for column, row in zip(measured.columns, measured.values, strict=False) if column.what == "time")
    measured.check_once(time)
    measured.check_clock(time)
    return time


def _in_units(measured: Measured, column: Column, row: Vector, units: Mapping[str, str], *, may_stop: bool) -> Vector:
    """Return a load in the unit of the membrane, not a number where it has stopped; refuse gaps."""
    end = row.size - int(np.argmax(np.isfinite(row[::-1]))) if may_stop else row.size
    if not np.isfinite(row[:end]).all():
        at = measured.lines[int(np.argmin(np.isfinite(row)))]
        msg = f"{measured.path}, line {at}: the load {column.name!r} has no value. Fill it in, or remove the row."
        raise DataError(msg)
    unit = units[_load(column.name)]
    return row * (conversion(column.unit, unit) or 1.0) if column.unit else row


def _load(title: str) -> str:
    match = TITLE.fullmatch(title.strip())
    return match[1] if match else title


def _sensor(name: str) -> int:
    return int(INDEXED.sub(r"\2", name)) - 1


def _make_static(
    measured: Measured, values: Matrix, loads: Mapping[str, Vector], kind: str, noise: float | None
) -> StaticRecord:
    """Gather the readings of each load state."""
    names = tuple(dict.fromkeys(measured.texts))
    state = np.array([names.index(text) for text in measured.texts])
    first = np.array([int(np.argmax(state == k)) for k in range(len(names))])
    for name, load in loads.items():
        away = np.abs(load - load[first][state])
        if np.any(away > SAME * np.abs(load).max()):
            at = int(np.argmax(away))
            msg = (
                f"{measured.path}, line {measured.lines[at]}: the load {name!r} differs within state {names[state[at]]!r}. "
                "Give each load state a name of its own."
            )
            raise DataError(msg)
    return StaticRecord(
        values=values,
        kind=cast(Literal["strain", "resistance"], kind),
        noise=noise,
        inputs={name: load[first] for name, load in loads.items()},
        state=state,
        names=names,
    )


def make_record(
    time: Vector,
    values: Matrix,
    kind: str,
    noise: float | None,
    source: str,
    lines: NDArray[np.int_] | None = None,
    loads: Mapping[str, Vector] | None = None,
    *,
    settled: bool = False,
) -> ResponseRecord:
    """Put samples on a grid that begins when the load sets in, at time 0; that sample itself is left out.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times of the samples [s].
    values : ndarray, shape (sensors, n)
        Values; not a number where one is missing.
    kind, noise : str, float or None
        As in ``ResponseRecord``.
    source : str
        Where they come from, for messages.
    lines : ndarray of int or None
        Line of each sample in a file, for messages.
    loads : mapping of str to ndarray of shape (n,), or None
        Inputs of the membrane at these times; straight between them where up to 5 samples are missing. The record ends where
        more are, or where a load is not a number.
    settled : bool
        Whether the record begins with its first sample, in equilibrium under the loads there.

    Raises
    ------
    DataError
        The times do not rise, are off a grid or negative, or the record is too short or too long.
    """
    steps = np.diff(time)
    if len(time) < 2 or not np.isfinite(time).all() or not (steps > 0.0).all():
        at = 1 + int(np.argmin(np.where(np.isfinite(steps), steps, -np.inf))) if len(time) > 1 else 0
        msg = f"the times of {source} must rise; {_place(at, lines)} does not. Sort the rows and remove doubled ones."
        raise DataError(msg)
    loads, start = loads or {}, dict[str, float]()
    if settled:
        time = time - time[0]
        start = {name: float(load[0]) for name, load in loads.items()}
    if time[0] < 0.0:
        msg = f"the times of {source} begin at {time[0]:g} s. Count them from the moment that the load sets in."
        raise DataError(msg)
    h = float(np.median(steps))
    h = float(time[-1] - time[0]) / max(1, round(float(time[-1] - time[0]) / h))
    place = np.round(time / h).astype(np.int64)
    off = np.abs(time / h - place)
    if off.max() > OFF_GRID or place[-1] > LONGEST:
        at = int(np.argmax(off))
        msg = (
            f"the times of {source} are no multiples of one step of {h:g} s after the load sets in: "
            f"{_place(at, lines)} is at {time[at]:g} s. Resample the record, and count its "
            "time from the moment that the load sets in."
        )
        raise DataError(msg)
    known = np.isfinite(np.array([*loads.values()]).reshape(-1, time.size)).all(axis=0)
    known &= (np.diff(place, prepend=0) <= MOST_LOST + 1) | (not loads)
    end = time.size if known.all() else int(np.argmin(known))
    require(end, f"{source}: the loads are not known at its first sample, or before it. Begin where they are.", DataError)
    if end < time.size:
        lost = (
            f"{source}: the loads are not known after t = {time[end - 1]:g} s ({_place(end - 1, lines)}), so the record ends"
        )
        msg = f"{lost} there. Begin another one where they are."
        require(place[end - 1] >= LEAST_SAMPLES, msg, DataError)
        logger.warning("%s", msg)
    place, values = place[:end], values[:, :end]
    loads = {name: load[:end] for name, load in loads.items()}
    grid = np.full((len(values), int(place[-1]) + 1), np.nan)
    grid[:, place] = values
    return ResponseRecord(
        step=h,
        values=grid[:, 1:],
        kind=cast(Literal["strain", "resistance"], kind),
        noise=noise,
        inputs={name: np.interp(np.arange(1, grid.shape[1]), place, load) for name, load in loads.items()},
        start=start,
    )


def _place(sample: int, lines: NDArray[np.int_] | None) -> str:
    return f"sample {sample + 1}" if lines is None else f"line {lines[sample]}"
