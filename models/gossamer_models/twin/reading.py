r"""Records for the twin from tables: columns found by name, times put on a grid.

Symbols: ``t`` times [s] since the load set in, ``h`` step of the grid [s].
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal, cast

import numpy as np
from gossamer_files.measured import Column, Wanted, find_column, listed, named_column, read_columns
from gossamer_files.options import option
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..errors import DataError
from ..membrane import square_structure
from .record import ResponseRecord

KINDS = ("resistance", "strain")
INDEXED = re.compile(r"(strain|resistance) ?\[(\d+)\](.*)")  # strain[1] [%]
OFF_GRID = 0.05  # of a step: how far a time may lie from the grid
LONGEST = 1_000_000  # samples


def read_table(
    path: Path, kind: str | None = None, noise: float | None = None, sensors: int | None = None
) -> ResponseRecord:
    """Read a CSV file with a column of time and ``strain[1]``, ... or ``resistance[1]``, ...

    Parameters
    ----------
    path : Path
        File. A unit stands after a name, ``strain[1] [%]``, or in a row below; without one, values are in s, 1 or ohm.
        Timestamps are counted from the first one. Empty cells and missing rows are gaps; a sensor without a column is left
        out.
    kind : {"strain", "resistance"} or None
        Which columns to take; None for the only ones there are.
    noise : float or None
        Standard deviation of the noise; None to estimate it.
    sensors : int or None
        How many the membrane has; None for as many as the square of the thesis.

    Raises
    ------
    DataError
        The file cannot be read, lacks columns, or its times or values make no sense; the message names the line.
    """
    count = square_structure().n_sensors if sensors is None else sensors
    measured = read_columns(path, lambda header, line: _choose(path, header, line, kind, count), unreadable="gap")
    time, *rows = measured.values
    measured.check_once(time)
    measured.check_clock(time)
    values = np.full((count, time.size), np.nan)
    for column, row in zip(measured.columns[1:], rows, strict=True):
        if column.what == "strain":
            measured.check_strain(column, row, measured.lines)
        values[_sensor(column.name)] = row
    return make_record(time, values, measured.columns[1].what, noise, str(path), measured.lines)


def _choose(path: Path, header: list[str], line: int, kind: str | None, count: int) -> list[Column]:
    """Return the column of time and those of one kind, by sensor."""
    indexed = {k: match for k, cell in enumerate(header) if (match := INDEXED.fullmatch(cell))}
    kinds = [each for each in KINDS if kind in (None, each) and any(match[1] == each for match in indexed.values())]
    if len(kinds) != 1:
        wanted = " or ".join(f"{k}[1] to {k}[{count}]" for k in (KINDS if kind is None else [kind]))
        it_has = f"It has both; say which to take with {option('kind')}" if kinds else f"It has {listed(header)}"
        msg = f"{path}, line {line}: the twin needs the columns time and {wanted}. {it_has}."
        raise DataError(msg)
    columns = [find_column(path, header, line, Wanted(what="time"))]
    places = {k: match for k, match in indexed.items() if match[1] == kinds[0]}
    sensors = [_sensor(header[k]) for k in places]
    for k, sensor in zip(places, sensors, strict=True):
        if not 0 <= sensor < count or sensors.count(sensor) > 1:
            why = "stands twice" if 0 <= sensor < count else f"is of none of the {count} sensors"
            msg = f"{path}, line {line}: column {header[k]!r} {why}. Remove it."
            raise DataError(msg)
    column = Wanted(what=kinds[0])
    return columns + [
        named_column(path, header, line, column, k, name=match[1] + match[3]) for k, match in places.items()
    ]


def _sensor(name: str) -> int:
    return int(INDEXED.sub(r"\2", name)) - 1


def make_record(
    time: Vector, values: Matrix, kind: str, noise: float | None, source: str, lines: NDArray[np.int_] | None = None
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
    grid = np.full((len(values), int(place[-1]) + 1), np.nan)
    grid[:, place] = values
    return ResponseRecord(step=h, values=grid[:, 1:], kind=cast(Literal["strain", "resistance"], kind), noise=noise)


def _place(sample: int, lines: NDArray[np.int_] | None) -> str:
    return f"sample {sample + 1}" if lines is None else f"line {lines[sample]}"
