r"""Records for the twin from tables: columns found by name, times put on a grid.

Symbols: ``t`` times [s] since the load set in, ``h`` step of the grid [s].
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Literal, cast

import numpy as np
from gossamer_files import reason

from ..arrays import Matrix, Vector
from ..errors import DataError
from .record import N_SENSORS, Record

TIME = "time"
KINDS = ("resistance", "strain")
OFF_GRID = 0.05  # of a step: how far a time may lie from the grid
LONGEST = 1_000_000  # samples


def read_table(path: Path, kind: str | None = None, noise: float | None = None) -> Record:
    """Read a CSV file with columns ``time`` and ``strain[1]`` to ``strain[4]`` or ``resistance[1]`` to ``resistance[4]``.

    Parameters
    ----------
    path : Path
        File; a unit in brackets after a name, ``time [s]``, is ignored. Empty cells and missing rows are gaps; a sensor
        without a column is left out.
    kind : {"strain", "resistance"} or None
        Which columns to take; None for the only ones there are.
    noise : float or None
        Standard deviation of the noise; None to estimate it.

    Raises
    ------
    DataError
        The file cannot be read, lacks columns, or its times or values make no sense.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError) as error:
        msg = f"cannot read {path}: {reason(error)}. Name a CSV file."
        raise DataError(msg) from error
    names = [name.strip().rpartition(" [")[0] or name.strip() for name in rows[0]] if rows else []
    found = [k for k in KINDS if kind in (None, k) and any(f"{k}[{i + 1}]" in names for i in range(N_SENSORS))]
    if TIME not in names or len(found) != 1:
        wanted = " or ".join(f"{k}[1] to {k}[{N_SENSORS}]" for k in (KINDS if kind is None else [kind]))
        both = (
            "It has both; say which to take with --kind."
            if len(found) == 2
            else f"It has {', '.join(names) or 'none'}."
        )
        msg = f"{path} needs the columns time and {wanted}. {both}"
        raise DataError(msg)
    places = {name: i for i, name in enumerate(names)}
    time = _column(path, rows, places[TIME])
    values = np.full((N_SENSORS, len(time)), np.nan)
    for i in range(N_SENSORS):
        if f"{found[0]}[{i + 1}]" in places:
            values[i] = _column(path, rows, places[f"{found[0]}[{i + 1}]"])
    return make_record(time, values, found[0], noise, str(path))


def make_record(time: Vector, values: Matrix, kind: str, noise: float | None, source: str) -> Record:
    """Put samples on a grid that begins when the load sets in, at time 0; that sample itself is left out.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times of the samples [s].
    values : ndarray, shape (4, n)
        Values; not a number where one is missing.
    kind, noise : str, float or None
        As in ``Record``.
    source : str
        Where they come from, for messages.

    Raises
    ------
    DataError
        The times do not rise, are off a grid or negative, or the record is too short or too long.
    """
    steps = np.diff(time)
    if len(time) < 2 or not np.isfinite(time).all() or not (steps > 0.0).all():
        at = 1 + int(np.argmin(np.where(np.isfinite(steps), steps, -np.inf))) if len(time) > 1 else 0
        msg = f"the times of {source} must rise; sample {at + 1} does not. Sort the rows and remove doubled ones."
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
            f"the times of {source} are no multiples of one step of {h:g} s after the load sets in: sample {at + 1} is at "
            f"{time[at]:g} s. Resample the record, and count its time from the moment that the load sets in."
        )
        raise DataError(msg)
    grid = np.full((N_SENSORS, int(place[-1]) + 1), np.nan)
    grid[:, place] = values
    return Record(step=h, values=grid[:, 1:], kind=cast(Literal["strain", "resistance"], kind), noise=noise)


def _column(path: Path, rows: list[list[str]], place: int) -> Vector:
    column = np.full(len(rows) - 1, np.nan)
    for i, row in enumerate(rows[1:]):
        cell = row[place].strip() if place < len(row) else ""
        try:
            column[i] = float(cell) if cell else np.nan
        except ValueError:
            msg = (
                f"{path}, row {i + 2}: {cell!r} under {rows[0][place]!r} is no number. Leave the cell empty for a gap."
            )
            raise DataError(msg) from None
    return column
