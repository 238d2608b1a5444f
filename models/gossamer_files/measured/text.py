r"""A text file as a table: its encoding, preamble, header, row of units and decimal mark.

A meter writes lines of its own above the header, a row of units below it, decimal commas, UTF-16 or Latin-1.
``open_table`` finds out which, and refuses by name what no rule covers. The header is the first line in which all wanted
columns are recognised; a line of comment is one only where no other text but a row of units stands between it and the
numbers. A row of units may be a comment too. Cells are read one by one, so a file of any length fits.
"""

from __future__ import annotations

import codecs
import csv
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, time
from itertools import islice
from pathlib import Path
from typing import NamedTuple, TextIO

from .. import DataError, reason
from ..inputs import is_pipe, keep
from .units import is_unit

MOST_PREAMBLE = 200  # lines above the header
DELIMITERS = ",;\t"
MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
BLOCK = 1 << 20
MISSING = ("", "-", "--", "nan", "na", "n/a", "null", "none", "inf", "-inf", "+inf", "overload", "ol", "ovld")
COMMENTS = "#"
THOUSANDS = re.compile(r"[-+]?\d{1,3}(([.]\d{3})+,\d+|(,\d{3})+[.]\d+)")


@dataclass(kw_only=True)
class Table:
    """What is known of a file before its samples are read.

    Attributes
    ----------
    path : Path
        The file.
    encoding, delimiter : str
        How its text is written.
    header : list of str
        Names of its columns.
    header_line : int
        Line of the header, from 1.
    """

    path: Path
    encoding: str
    delimiter: str
    header: list[str]
    header_line: int


@dataclass(slots=True)
class Numbers:
    """Turns cells into numbers, one mark for decimals throughout, and says what could not be one.

    Attributes
    ----------
    path : Path
        For messages.
    commas, points : int
        First line with a decimal comma and with a decimal point; 0 for none yet.
    clock : datetime, time or None
        First timestamp; times are counted from it.
    """

    path: Path
    commas: int = 0
    points: int = 0
    clock: datetime | time | None = field(default=None)
    plain: bool = False

    def read(self, cell: str, line: int) -> float:
        """Return a number [unit of its column], not a number for a cell without one.

        Raises
        ------
        DataError
            It has another decimal mark than the cells before, or marks thousands.
        """
        cell = cell.strip()
        try:
            number = float(cell)
        except ValueError:
            return self._with_comma(cell, line)
        if "." in cell and math.isfinite(number):
            self.points = self.points or line
            self._one_mark(line)
        return number

    def _with_comma(self, cell: str, line: int) -> float:
        if THOUSANDS.fullmatch(cell):
            msg = f"{self.path}, line {line}: {cell!r} marks thousands. Write numbers with one decimal mark and no other."
            raise DataError(msg)
        if cell.count(",") != 1:
            return math.nan
        try:
            number = float(cell.replace(",", "."))
        except ValueError:
            return math.nan
        self.commas = self.commas or line
        self._one_mark(line)
        return number

    def _one_mark(self, line: int) -> None:
        if self.commas and self.points:
            msg = (
                f"{self.path}, line {line}: decimal commas (line {self.commas}) and decimal points (line {self.points}) "
                "in one file. Write one of them throughout."
            )
            raise DataError(msg)

    def read_time(self, cell: str, line: int) -> float:
        """Return a time: a number [unit of its column], or seconds after the first timestamp.

        Raises
        ------
        DataError
            The file mixes numbers with timestamps, or timestamps of two kinds.
        """
        number = self.read(cell, line)
        stamp = timestamp(cell) if math.isnan(number) else None
        if stamp is None:
            self.plain = self.plain or math.isfinite(number)
            if self.clock is not None and math.isfinite(number):
                self._refuse_mixture(line)
            return number
        if self.clock is None:
            self.clock = stamp
        if self.plain or type(stamp) is not type(self.clock):
            self._refuse_mixture(line)
        if isinstance(stamp, datetime) and isinstance(self.clock, datetime):
            return (stamp - self.clock).total_seconds()
        return _seconds(stamp) - _seconds(self.clock)

    def _refuse_mixture(self, line: int) -> None:
        msg = f"{self.path}, line {line}: the times above are of another kind. Write all as numbers or all as timestamps."
        raise DataError(msg)


def timestamp(cell: str) -> datetime | time | None:
    """Return an ISO 8601 date and time, in UTC where no zone is stated, or a time of day; None for other text."""
    cell = cell.strip()
    try:
        stamp = datetime.fromisoformat(cell) if "-" in cell else None
        if stamp is not None:
            return stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)
        return time.fromisoformat(cell) if ":" in cell else None
    except ValueError:
        return None


def _seconds(stamp: datetime | time) -> float:
    return 3600.0 * stamp.hour + 60.0 * stamp.minute + stamp.second + 1e-6 * stamp.microsecond


def open_table(path: Path, check: Callable[[list[str], int], object]) -> Table:
    """Find out how a file is written.

    Parameters
    ----------
    path : Path
        The file.
    check : callable
        Called with the cells and the number of a line; raises ``DataError`` if they are not the header.

    Returns
    -------
    Table
        With its header: the first line that ``check`` takes, a comment only if no other text but a row of units stands
        between it and the numbers.

    Raises
    ------
    DataError
        No line is a header; the message is that of the last text above the first numbers, a comment only if it has as many
        cells as the numbers.
    OSError, UnicodeError, csv.Error
        The file cannot be read.
    """
    keep(path)
    encoding = _encoding(path)
    with path.open(encoding=encoding, newline="") as file:
        lines = [line.strip("\r\n") for line in islice(file, MOST_PREAMBLE)]
    refused: list[_Refused] = []
    commented: Table | None = None
    for k, line in enumerate(lines):
        delimiter = _delimiter(line)
        header, comment = split(line, delimiter), line.lstrip().startswith(COMMENTS)
        if not any(header):
            continue
        if commented is not None and not comment and _numeric(header):
            break
        try:
            check(header, k + 1)
        except DataError as error:
            refused.append(_Refused(k + 1, delimiter, header, comment, error))
            if commented is not None and not comment and _has_words(header):
                commented = None
            continue
        table = Table(path=path, encoding=encoding, delimiter=delimiter, header=header, header_line=k + 1)
        if not comment:
            return table
        commented = commented or table
    if commented is not None:
        return commented
    if not refused:
        msg = f"cannot read {path}: it is empty. Name a CSV file with a header line."
        raise DataError(msg)
    raise _why_no_header(path, refused)


def header_of(path: Path) -> list[str]:
    """Return the cells of the first line of a file.

    Raises
    ------
    DataError
        It cannot be read.
    """
    try:
        with path.open(encoding=_encoding(path), newline="") as file:
            line = file.readline().strip("\r\n")
        return split(line, _delimiter(line))
    except (OSError, UnicodeError, csv.Error) as error:
        msg = f"cannot read {path}: {reason(error)}. Name a CSV file with a header line."
        raise DataError(msg) from error


class _Refused(NamedTuple):
    """A line that is no header, and why."""

    line: int
    delimiter: str
    cells: list[str]
    comment: bool
    error: DataError


def _why_no_header(path: Path, refused: list[_Refused]) -> DataError:
    """Return the error of the line that is most like a header: the last text above the first numbers."""
    rows = [k for k, each in enumerate(refused) if not each.comment and _numeric(each.cells)]
    if not rows:
        return next((each for each in refused if not each.comment), refused[0]).error
    above = refused[: next((k for k in rows if k > 0), 0)]
    texts = [each for each in above if not each.comment and not _numeric(each.cells)]
    first = refused[rows[0]]
    shape = first.delimiter, len(first.cells)
    names = texts or [each for each in above if each.comment and (each.delimiter, len(each.cells)) == shape]
    if names:
        return names[-1].error
    msg = f"{path}, line {first.line}: numbers, but no names of columns. Write a header line: time_s,strain [%],R_ohm."
    return DataError(msg)


def split(line: str, delimiter: str) -> list[str]:
    """Return the cells of one line of a header, without a mark of comments."""
    row = next(csv.reader([line.lstrip().lstrip(COMMENTS)], delimiter=delimiter, skipinitialspace=True), [])
    return [cell.strip() for cell in row]


def rows_of(table: Table, file: TextIO) -> Iterator[tuple[int, list[str]]]:
    """Yield line and cells of every row below the header that is neither empty nor a comment.

    A comment above the first of them is a row too if it is one of units, with as many cells as the header.
    """
    for _ in islice(file, table.header_line):
        pass
    reader = csv.reader(file, delimiter=table.delimiter, skipinitialspace=table.delimiter == " ")
    first = True
    for row in reader:
        if not any(cell.strip() for cell in row):
            continue
        if row[0].lstrip().startswith(COMMENTS):
            row = split(table.delimiter.join(row), table.delimiter)
            if not (first and len(row) == len(table.header) and units_only(row)):
                continue
        first = False
        yield table.header_line + reader.line_num, row


def bare(cell: str) -> str:
    """Return a cell of a row of units without its brackets."""
    return cell.strip().strip("[]()")


def units_only(cells: list[str]) -> bool:
    """Tell whether a row is one of units: each cell is a unit, of any quantity, empty, or the mark of a ratio."""
    written = [text for text in map(bare, cells) if text != "1" and text.lower() not in MISSING]
    return bool(written) and all(map(is_unit, written))


def is_number(cell: str) -> bool:
    """Tell whether a cell holds a number or a timestamp."""
    try:
        return not math.isnan(Numbers(Path()).read_time(cell, 0))
    except DataError:  # one that marks thousands
        return True


def why_no_number(cells: list[str]) -> str:
    """Return what to do about the first of some cells that holds no number."""
    cell = next((cell for cell in cells if not is_number(cell)), "nan")
    if cell.strip().lower() in MISSING:
        return "Clean the record or name other columns"
    if re.search(r"\d[/.-]\d+[/.-]\d|\d:\d", cell):
        return "It looks like a date or a time: write it in ISO 8601, 2024-05-31T12:00:00.5, or as seconds"
    return "Write numbers only, or name other columns"


def _delimiter(line: str) -> str:
    most = max(DELIMITERS, key=line.count)
    return most if most in line or not line.split() else " "


def _numeric(cells: list[str]) -> bool:
    """Whether a line is a sample: most of its cells hold numbers."""
    return len(cells) > 1 and 2 * sum(map(is_number, cells)) > len(cells)


def _has_words(cells: list[str]) -> bool:
    """Whether a line is text: neither a sample, also one without values, nor a row of units."""
    words = any(cell.lower() not in MISSING for cell in cells)
    return words and not any(map(is_number, cells)) and not units_only(cells)


def _encoding(path: Path) -> str:
    """Return the encoding of a file by its mark, its zeros, or whether all of it is UTF-8; else Latin-1."""
    if is_pipe(path):
        msg = f"{path} is a pipe. Write what comes out of it into a file first."
        raise DataError(msg)
    with path.open("rb") as file:
        start = file.read(4096)
        for mark, name in MARKS:
            if start.startswith(mark):
                return name
        if start.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
            msg = f"{path} is a spreadsheet of another program. Save it as CSV."
            raise DataError(msg)
        if b"\0" in start:
            places = [start[k::2].count(0) for k in (0, 1)]
            if min(places) == 0 and max(places) > 0.4 * len(start):
                return "utf-16-le" if places[1] else "utf-16-be"
            msg = f"{path} holds no text. Name a CSV file with a header line."
            raise DataError(msg)
        decoder = codecs.getincrementaldecoder("utf-8")()
        try:
            decoder.decode(start)
            while block := file.read(BLOCK):
                decoder.decode(block)
            decoder.decode(b"", final=True)
        except UnicodeDecodeError:
            return "latin-1"
    return "utf-8"
