r"""Records of strain and resistance: read, converted to SI, checked and repaired by stated rules.

Rules, each with the line of the file named where it applies:

- Records of one fit have different names.
- ``table.py`` finds encoding, preamble, header, delimiter and decimal mark, ``columns.py`` the columns and their units.
  What was recognised goes with the record, ``found.py``, to be shown before a fit.
- A column without a unit is in s, 1 or ohm. Times without one that may be milliseconds or a count are refused, and so is
  an elongation, which may be a length.
- ISO 8601 timestamps are seconds after the first one. Dates without times of day are refused if samples share one.
- Lines with more cells than the header has names are refused: a decimal comma divides a number.
- Samples with a missing value or no finite number are left out; more than ``MOST_MISSING`` of them are refused.
- Samples with the same time are averaged. Times that go backwards are refused; ``sort`` sorts them instead.
- A record without a time column needs ``sampling_step``. A time column and ``sampling_step`` together are refused.
- A gap, a step longer than ``LONGEST_GAP`` median steps in which strain changes by more than ``GAP_STRAIN`` of its range, is
  refused, because the switching during the gap is unknown. A gap at constant strain stays and is reported.
- Strain above ``LARGEST_RATIO`` in a column without a unit, an output that jumps by a factor of ``LARGEST_JUMP`` between
  samples, and records of one fit whose largest outputs differ by this factor are refused as mixed units.
- Constant strain or output, and strain below zero by more than rounding of the meter, are refused.
"""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
from gossamer_files import reason
from numpy.typing import NDArray

from ..arrays import Vector
from ..errors import DataError
from .columns import DATE, ELONGATION, Column, Columns, no_unit, read_units, wanted_columns
from .found import Found, Quantity, gaps_of, unclear_clock, written
from .records import Record
from .repairs import DAY, LARGEST_JUMP, Samples, check, drop_missing, order_times
from .table import Numbers, Table, is_number, open_table, rows_of, why_no_number


@dataclass(frozen=True, slots=True, kw_only=True)
class _Raw:
    """Samples as they stand in a file, in SI, and how they were found; ``unread`` has the cells of the first bad one."""

    table: Table
    wanted: list[Column]
    numbers: Numbers
    lines: NDArray[np.int_]
    values: list[Vector]
    unread: list[str]

    @property
    def written(self) -> str:
        return written(
            self.table.encoding, self.table.header_line, self.table.delimiter, comma=bool(self.numbers.commas)
        )


def read_record(path: Path, columns: Columns | None = None, *, weight: float = 1.0) -> Record:
    """Read one record from a CSV file with a header line.

    Parameters
    ----------
    path : Path
        Comma, semicolon, tab or space separated.
    columns : Columns or None
        None to recognise names and units.
    weight : float
        Weight of the record among others [1].

    Returns
    -------
    Record
        In SI units, times from zero.

    Raises
    ------
    DataError
        The file cannot be read or breaks one of the rules above; the message names the line.
    """
    columns = columns or Columns()
    raw = _read(path, columns)
    values = list(raw.values)
    if columns.sampling_step is not None:
        values.insert(0, columns.sampling_step * np.arange(raw.lines.size, dtype=np.float64))
    of_strain = next(c for c in raw.wanted if c.what == "strain")
    _check_elongation(raw, of_strain)
    samples = Samples(path, values, raw.lines, strain_unit_stated=of_strain.unit is not None)
    if columns.sampling_step is not None:
        samples.repairs.append(f"no clock was read: samples are taken as {columns.sampling_step:g} s apart")
    drop_missing(samples, " | ".join(raw.unread), _advice(raw.unread, raw.wanted))
    _check_days(raw, samples.columns[0])
    order_times(samples, sort=columns.sort)
    _check_clock(raw, samples.columns[0])
    check(samples)
    time, strain, resistance = samples.columns
    steps = np.diff(time)
    ranges = {"time": time, "strain": strain, "resistance": resistance}
    found = Found(
        written=raw.written,
        quantities=tuple(
            Quantity(column=c, lowest=float(ranges[c.what].min()), highest=float(ranges[c.what].max()))
            for c in raw.wanted
        ),
        samples=time.size,
        rows=raw.lines.size,
        step=float(np.median(steps)),
        shortest=float(steps.min()),
        longest=float(steps.max()),
        gaps=gaps_of(time, strain, samples.lines),
    )
    low = float(strain.min())
    if low < 0.0:
        samples.repairs.append(f"strain from {low:g} up to 0 was set to 0")
    return Record(
        name=path.name,
        time=time - time[0],
        strain=np.maximum(strain, 0.0),
        resistance=resistance,
        lines=samples.lines,
        weight=weight,
        repairs=tuple(samples.repairs),
        found=found,
    )


def read_records(
    paths: Sequence[Path], columns: Columns | None = None, weights: Sequence[float] | None = None
) -> tuple[Record, ...]:
    """Read several records of one sensor with the same columns; ``weights`` of their squared errors are 1 if not given.

    Raises
    ------
    DataError
        Files cannot be read or break a rule above, one line for each; or they do not go together.
    """
    weights = [1.0] * len(paths) if weights is None else weights
    if len(weights) != len(paths) or not all(0.0 < weight < np.inf for weight in weights):
        msg = f"need one positive weight per record (--weights), not {list(weights)} for {len(paths)}"
        raise DataError(msg)
    records, mistakes = list[Record](), list[str]()
    for path, weight in zip(paths, weights, strict=True):
        try:
            records.append(read_record(path, columns, weight=weight))
        except DataError as error:
            mistakes += str(error).splitlines()
    if mistakes:
        raise DataError("\n".join(dict.fromkeys(mistakes)))
    names = [Path(record.name).stem for record in records]
    for name in names:
        if names.count(name) > 1:
            alike = ", ".join(record.name for record in records if Path(record.name).stem == name)
            msg = f"{names.count(name)} records are called {name} ({alike}): pictures go by that name. Rename all but one."
            raise DataError(msg)
    sizes = [float(np.abs(record.resistance).max()) for record in records]
    small, large = int(np.argmin(sizes)), int(np.argmax(sizes))
    if sizes[large] > LARGEST_JUMP * sizes[small]:
        msg = (
            f"the output reaches {sizes[small]:g} in {records[small].name} and {sizes[large]:g} in {records[large].name}, "
            "as if their units differed. State the unit in the columns' names."
        )
        raise DataError(msg)
    return tuple(records)


def _read(path: Path, columns: Columns) -> _Raw:
    """Read all samples; no more than their numbers is kept, so that a file of any length fits."""
    lines, unread = array("q"), list[str]()
    numbers = Numbers(path)
    try:
        table = open_table(path, lambda header, line: wanted_columns(path, header, line, columns))
        wanted = wanted_columns(path, table.header, table.header_line, columns)
        width = len(table.header)
        values = [array("d") for _ in wanted]
        with path.open(encoding=table.encoding, newline="") as file:
            for k, (line, row) in enumerate(rows_of(table, file)):
                if any(cell.strip() for cell in row[width:]):
                    msg = (
                        f"{path}, line {line}: {len(row)} cells under {width} names. Write decimal points, or semicolons "
                        "between cells with decimal commas, and a name for every column."
                    )
                    raise DataError(msg)
                if k == 0 and (with_units := read_units(path, line, row, wanted, columns)) is not None:
                    wanted = with_units
                    continue
                lines.append(line)
                for column, c in zip(values, wanted, strict=True):
                    column.append(_value(row, c, numbers, line))
                if not unread and not all(math.isfinite(column[-1]) for column in values):
                    unread = row
    except (OSError, UnicodeError, csv.Error) as error:
        msg = f"cannot read {path}: {reason(error)}. Name a CSV file with a header line."
        raise DataError(msg) from error
    if not lines:
        msg = f"{path} holds no samples. Name a CSV file with a header line and numbers below it."
        raise DataError(msg)
    factors = [1.0 if c.what == "time" and numbers.clock is not None else c.factor for c in wanted]
    return _Raw(
        table=table,
        wanted=wanted,
        numbers=numbers,
        lines=np.array(lines, dtype=int),
        values=[each * np.array(column, dtype=np.float64) for each, column in zip(factors, values, strict=True)],
        unread=unread,
    )


def _value(row: list[str], column: Column, numbers: Numbers, line: int) -> float:
    if column.place >= len(row):
        return math.nan
    return (numbers.read_time if column.what == "time" else numbers.read)(row[column.place], line)


def _advice(row: list[str], wanted: list[Column]) -> str:
    """Return what to do about the first cell of a sample that is no number."""
    cells = [row[c.place] if c.place < len(row) else "" for c in wanted]
    bad = next((cell for cell in cells if not is_number(cell)), "nan")
    return why_no_number(bad)


def _check_elongation(raw: _Raw, column: Column) -> None:
    """Refuse an elongation without a unit, which may be a length as well as a strain."""
    if column.unit is None and column.name.strip().lower().startswith(ELONGATION):
        msg = (
            f"{raw.table.path}, line {raw.table.header_line}: column {column.name!r} has no unit, and may be a length. "
            f"{no_unit('', 'strain')}; divide a length by the gauge length first."
        )
        raise DataError(msg)


def _check_days(raw: _Raw, time: Vector) -> None:
    """Refuse dates without times of day, on one of which several samples lie."""
    first, days = raw.numbers.clock, np.unique(time)
    midnight = isinstance(first, datetime) and first.time() == datetime.min.time()
    if midnight and days.size < time.size and not (days % DAY).any():
        clock = next(c for c in raw.wanted if c.what == "time")
        msg = (
            f"{raw.table.path}, line {raw.lines[0]}: column {clock.name!r} holds dates without times of day, {days.size} "
            f"for {time.size} samples. Name a column of time (--time), or write 2024-05-31T12:00:00.5."
        )
        raise DataError(msg)


def _check_clock(raw: _Raw, time: Vector) -> None:
    """Refuse times whose unit is unclear, and timestamps in a column that states a unit of its own."""
    clock = next((c for c in raw.wanted if c.what == "time"), None)
    if clock is None:
        return
    where = f"{raw.table.path}, line {raw.table.header_line}"
    if raw.numbers.clock is not None:
        if clock.factor != 1.0:
            msg = f"{where}: column {clock.name!r} is in {clock.unit}, but holds timestamps. Leave the unit out."
            raise DataError(msg)
    elif clock.unit is None and clock.name.lower() == DATE:
        msg = f"{where}: column {clock.name!r} holds numbers, which may be days. State their unit (--time-unit)."
        raise DataError(msg)
    elif (why := unclear_clock(clock, time)) is not None:
        msg = f"{where}: {why}"
        raise DataError(msg)
