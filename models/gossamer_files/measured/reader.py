r"""The one reader of measured tables: columns in SI with the line of every sample, nothing ignored.

- ``text.py`` finds encoding, preamble, header, delimiter and decimal mark, ``columns.py`` the columns and their units.
- A column without a unit is in s, 1 or ohm; ``check_time`` and ``check_strain`` refuse numbers that may be in another one.
- ISO 8601 timestamps are seconds after the first one. Dates without times of day are refused if samples share one.
- Lines with more cells than the header has names are refused: a decimal comma divides a number.
- A cell that holds no finite number is refused, is a gap, or is kept as not a number, as the reader's user asks.
"""

from __future__ import annotations

import csv
import logging
import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .. import DataError, NotFiniteError, reason
from .columns import DATE, ELONGATION, Column, read_units
from .text import MISSING, Numbers, Table, open_table, rows_of, why_no_number

Vector: TypeAlias = NDArray[np.float64]
logger = logging.getLogger(__name__)

DAY, MIDNIGHT = 86400.0, 3600.0  # [s]; how far apart two times of day on both sides of midnight may be
LARGEST_RATIO = 1.0  # [1]; more strain, without a stated unit, may be in per cent; normalised strain reaches 1
WHOLE_STEP = 1.0  # times without a unit that are whole numbers and at least this far apart may be s, ms or a count
LONG_STEP = 5.0  # and so may any that are this far apart
TOLD = 1_000_000  # rows, some seconds
DELIMITERS = {";": "semicolons", "\t": "tabs", " ": "spaces"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Columns of one file in SI, and how they were written.

    Attributes
    ----------
    path : Path
        The file.
    table : Table
        How its text is written.
    columns : list of Column
        What was recognised.
    lines : ndarray of int, shape (m,)
        Line of the file of each sample.
    values : list of ndarray, shape (m,)
        Numbers of each column in SI, of a ``value`` in its own unit; not a number where there is none.
    texts : list of str, length m or 0
        Cells of the column of ``text``, if one was wanted.
    unread : list of str
        Cells of the first sample without a finite number.
    comma : bool
        Decimals have commas.
    clock : object or None
        First timestamp, if times are timestamps.
    """

    path: Path
    table: Table
    columns: list[Column]
    lines: NDArray[np.int_]
    values: list[Vector]
    texts: list[str]
    unread: list[str]
    comma: bool
    clock: object

    @property
    def written(self) -> str:
        """How the file is written, as far as it is not usual."""
        encoding, line = self.table.encoding, self.table.header_line
        unusual = [] if encoding.startswith("utf-8") else [encoding.upper().removesuffix("-LE").removesuffix("-BE")]
        if self.table.delimiter != ",":
            unusual.append(f"{DELIMITERS[self.table.delimiter]} between cells")
        if self.comma:
            unusual.append("decimal commas")
        if line > 1:
            unusual.append(f"header in line {line}")
        return ", ".join(unusual)

    @property
    def header(self) -> str:
        """File and line of the header, for messages."""
        return f"{self.path}, line {self.table.header_line}"

    def why_unread(self) -> str:
        """Return what to do about the first cell of ``unread`` that is no number."""
        cells = [self.unread[c.place] if c.place < len(self.unread) else "" for c in self.columns]
        return why_no_number(cells)

    def check_days(self, time: Vector) -> None:
        """Refuse dates without times of day, on one of which several samples lie."""
        days = np.unique(time)
        midnight = isinstance(self.clock, datetime) and self.clock.time() == datetime.min.time()
        if midnight and days.size < time.size and not (days % DAY).any():
            clock = next(c for c in self.columns if c.what == "time")
            msg = (
                f"{self.path}, line {self.lines[0]}: column {clock.name!r} holds dates without times of day, {days.size} "
                f"for {time.size} samples. {clock.wanted.name_one()}, or write 2024-05-31T12:00:00.5."
            )
            raise DataError(msg)

    def check_rising(self, time: Vector, lines: NDArray[np.int_], remedy: str = "Sort the rows") -> None:
        """Refuse times that go backwards."""
        back = np.flatnonzero(np.diff(time) < 0.0)
        if back.size:
            k = back[0]
            msg = f"{self.path}, line {lines[k + 1]}: time goes backwards, {time[k]:g} s to {time[k + 1]:g} s. " + (
                "It passes midnight: write dates before the times." if passes_midnight(time) else f"{remedy}."
            )
            raise DataError(msg)

    def check_once(self, time: Vector) -> None:
        """Refuse times that do not increase."""
        self.check_days(time)
        self.check_rising(time, self.lines)
        again = np.flatnonzero(np.diff(time) == 0.0)
        if again.size:
            msg = f"{self.path}, line {self.lines[again[0] + 1]}: {time[again[0]]:g} s stands twice. Keep one row per time."
            raise DataError(msg)

    def check_clock(self, time: Vector, remedy: str = "") -> None:
        """Refuse times whose unit is unclear; ``remedy`` is another way out than stating it."""
        clock = next((c for c in self.columns if c.what == "time"), None)
        if clock is None or clock.unit is not None or self.clock is not None or time.size < 2:
            return
        step = float(np.median(np.diff(time)))
        whole = bool((time == np.rint(time)).all())
        why = None
        if clock.name.lower() == DATE:
            why = "holds numbers, which may be days"
        elif step > LONG_STEP or (whole and step >= WHOLE_STEP):
            kind = "whole numbers" if whole else "numbers"
            why = f"has no unit, and its {kind} {step:g} apart may be seconds, milliseconds or a count"
        if why is not None:
            msg = f"{self.header}: column {clock.name!r} {why}. {clock.wanted.state_unit()}{remedy}."
            raise DataError(msg)

    def check_strain(self, column: Column, strain: Vector, lines: NDArray[np.int_]) -> None:
        """Refuse strain without a unit that may be a length or in per cent."""
        if column.unit is not None:
            return
        if column.name.strip().lower().startswith(ELONGATION):
            msg = (
                f"{self.header}: column {column.name!r} has no unit, and may be a length. {column.wanted.state_unit()}; "
                "divide a length by the gauge length first."
            )
            raise DataError(msg)
        large = np.flatnonzero(strain > LARGEST_RATIO)
        if large.size:
            k = int(large[0])
            msg = (
                f"{self.path}, line {lines[k]}: strain {strain[k]:g} has no unit, and may be {strain[k]:.0%} or "
                f"{strain[k]:g} %. {column.wanted.state_unit()}."
            )
            raise DataError(msg)


def passes_midnight(time: Vector) -> bool:
    """Tell whether the first times that go backwards are times of day on both sides of midnight."""
    back = np.flatnonzero(np.diff(time) < 0.0)
    return bool(back.size and DAY - MIDNIGHT < time[back[0]] - time[back[0] + 1] <= DAY)


def read_columns(
    path: Path,
    choose: Callable[[list[str], int], list[Column]],
    *,
    unreadable: Literal["kept", "gap", "refused"] = "refused",
) -> Measured:
    """Read the columns that are chosen of a CSV file with a header line; no more than their numbers is kept.

    Parameters
    ----------
    path : Path
        Comma, semicolon, tab or space separated.
    choose : callable
        Returns the columns that are wanted, one of text last, by the cells and the number of a line; raises ``DataError`` if
        they are not the header.
    unreadable : {"kept", "gap", "refused"}
        Cells without a finite number are kept as not a number; or only empty ones and words for a missing value are; or
        none is.

    Raises
    ------
    DataError
        The file cannot be read or breaks one of the rules above; the message names the line.
    """
    lines, unread, texts = array("q"), list[str](), list[str]()
    numbers = Numbers(path)
    try:
        table = open_table(path, choose)
        columns = choose(table.header, table.header_line)
        width, text = len(table.header), next((c.place for c in columns if c.what == "text"), None)
        read = [
            (c, array("d"), numbers.read_time if c.what == "time" else numbers.read) for c in columns if c.what != "text"
        ]
        with path.open(encoding=table.encoding, newline="") as file:
            for k, (line, row) in enumerate(rows_of(table, file)):
                if any(cell.strip() for cell in row[width:]):
                    msg = (
                        f"{path}, line {line}: {len(row)} cells under {width} names. Write decimal points, or semicolons "
                        "between cells with decimal commas, and a name for every column."
                    )
                    raise DataError(msg)
                # a text may be the name of a unit
                if k == 0 and text is None and (with_units := read_units(path, line, row, columns)) is not None:
                    columns = with_units
                    continue
                lines.append(line)
                if len(lines) % TOLD == 0:
                    logger.info("%s: %d rows read", path.name, len(lines))
                row += [""] * (width - len(row))
                if text is not None:
                    texts.append(row[text].strip())
                for c, column, number in read:
                    value = number(row[c.place], line)
                    column.append(value)
                    if not math.isfinite(value):
                        unread = unread or row
                        if unreadable != "kept":
                            _check_gap(path, line, row[c.place], value, c, allowed=unreadable == "gap" and c.what != "time")
    except (OSError, UnicodeError, csv.Error) as error:
        msg = f"cannot read {path}: {reason(error)}. Name a CSV file with a header line."
        raise DataError(msg) from error
    if not lines:
        msg = f"{path} holds no samples. Name a CSV file with a header line and numbers below it."
        raise DataError(msg)
    stamped = next((c for c in columns if c.what == "time" and numbers.clock is not None), None)
    if stamped is not None and stamped.factor != 1.0:
        msg = (
            f"{path}, line {table.header_line}: column {stamped.name!r} is in {stamped.unit}, but holds timestamps. Leave "
            "the unit out."
        )
        raise DataError(msg)
    with_factors = zip(columns, read, strict=False)  # columns may have got their units from the line below the header
    return Measured(
        path=path,
        table=table,
        columns=columns,
        lines=np.frombuffer(lines, dtype=int),  # the same memory: of ten million rows a copy counts
        values=[np.multiply(c.factor, (one := np.frombuffer(column)), out=one) for c, (_, column, _) in with_factors],
        texts=texts,
        unread=unread,
        comma=bool(numbers.commas),
        clock=numbers.clock,
    )


def _check_gap(path: Path, line: int, cell: str, value: float, column: Column, *, allowed: bool) -> None:
    """Refuse a cell without a finite number, unless it is empty or a word for a missing value and these are allowed."""
    missing = cell.strip().lower() in MISSING and not math.isinf(value)
    if missing and allowed:
        return
    where = f"{path}, line {line}:"
    if math.isinf(value) or cell.strip().lower().lstrip("+-") == "nan":
        what = "infinite" if math.isinf(value) else "no number"
        msg = f"{where} {cell.strip()!r} under {column.name!r} is {what}. Correct or remove the row."
        raise NotFiniteError(msg)
    if missing:
        msg = f"{where} there is no value under {column.name!r}. Correct or remove the row."
    else:
        advice = "Leave the cell empty for a gap" if allowed else why_no_number([cell])
        msg = f"{where} {cell.strip()!r} under {column.name!r} is no number. {advice}."
    raise DataError(msg)
