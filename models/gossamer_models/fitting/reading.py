r"""Records of strain and resistance: read, converted to SI, checked and repaired by stated rules.

Rules, each with the line of the file named where it applies:

- Records of one fit have different names.
- Options name the columns, or the names of the columns identify them (``TIME``, ``STRAIN``, ``RESISTANCE`` below).
  Units come from an option, else from the name of the column (``t_ms``, ``strain [%]``, ``R_kohm``), else they are s, 1
  and ohm. Two different units for one column are refused.
- Lines with more cells than the header has names are refused: a decimal comma divides a number.
- Samples with a missing value or no finite number are left out; more than ``MOST_MISSING`` of them are refused.
- Samples with the same time are averaged. Times that go backwards are refused; ``sort`` sorts them instead.
- A record without a time column needs ``sampling_step``. A time column and ``sampling_step`` together are refused.
- A gap, a step longer than ``LONGEST_GAP`` median steps in which strain changes by more than ``GAP_STRAIN`` of its range, is
  refused, because the switching during the gap is unknown. A gap at constant strain is harmless and stays.
- Strain above ``LARGEST_STRAIN`` in a column without a unit, an output that jumps by a factor of ``LARGEST_JUMP`` between
  samples, and records of one fit whose largest outputs differ by this factor are refused as mixed units. Strain above
  ``REPORTED_STRAIN`` in a column without a unit is kept and reported.
- Constant strain or output, and strain below zero by more than rounding of the meter, are refused.
"""

from __future__ import annotations

import csv
import math
import re
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from gossamer_files import reason
from numpy.typing import NDArray

from ..arrays import Vector
from ..errors import DataError
from .options import option
from .records import Record
from .repairs import LARGEST_JUMP, Samples, check, drop_missing, order_times

TIME = ("t", "time", "timestamp", "seconds")
STRAIN = ("strain", "eps", "epsilon")
RESISTANCE = ("resistance", "r", "r_inner", "ohm")
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}
STRAINS = {"1": 1.0, "%": 0.01, "percent": 0.01, "permille": 1e-3, "ustrain": 1e-6}
OHMS = {"ohm": 1.0, "kohm": 1e3, "mohm": 1e-3, "megohm": 1e6, "1": 1.0}
OPTION = {"time": "--time", "strain": "--strain", "resistance": "--resistance"}  # of the command


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Which columns to read, and in which units.

    Attributes
    ----------
    time, strain, resistance : str or None
        Names of columns; None to recognise them.
    time_unit, strain_unit, resistance_unit : str or None
        Keys of ``SECONDS``, ``STRAINS`` and ``OHMS``; None to recognise them.
    sampling_step : float or None
        Time between samples [s] where there is no time column.
    sort : bool
        Sort samples by time instead of refusing times that go backwards.
    """

    time: str | None = option(None, "Column of time; recognised if not given.", metavar="NAME")
    strain: str | None = option(None, "Column of strain.", metavar="NAME")
    resistance: str | None = option(None, "Column of resistance.", metavar="NAME")
    time_unit: str | None = option(None, "s, ms, us, min or h.")
    strain_unit: str | None = option(None, "1, %, permille or ustrain.")
    resistance_unit: str | None = option(None, "ohm, kohm or megohm.")
    sampling_step: float | None = option(None, "Time between samples [s] of a record without time.")
    sort: bool = option(False, "Sort samples by time instead of refusing them.")


def read_record(path: Path, columns: Columns | None = None, *, weight: float = 1.0) -> Record:
    """Read one record from a CSV file with a header line.

    Parameters
    ----------
    path : Path
        Comma, semicolon or tab separated.
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
    header, unread, lines, numbers = _read_columns(path, columns)
    if columns.sampling_step is not None:
        numbers.insert(0, columns.sampling_step * np.arange(len(lines), dtype=np.float64))
    strain_at = _find(path, header, columns.strain, columns.strain_unit, STRAIN, STRAINS, "strain")[0]
    stated = columns.strain_unit is not None or _split(header[strain_at], STRAINS)[1] is not None
    samples = Samples(path, numbers, lines, strain_unit_stated=stated)
    if columns.sampling_step is not None:
        samples.repairs.append(f"no clock was read: samples are taken as {columns.sampling_step:g} s apart")
    drop_missing(samples, unread)
    order_times(samples, sort=columns.sort)
    time, strain, resistance = samples.columns
    check(samples)
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
    )


def read_records(
    paths: Sequence[Path], columns: Columns | None = None, weights: Sequence[float] | None = None
) -> tuple[Record, ...]:
    """Read several records of one sensor with the same columns; ``weights`` of their squared errors are 1 if not given."""
    weights = [1.0] * len(paths) if weights is None else weights
    if len(weights) != len(paths) or not all(0.0 < weight < np.inf for weight in weights):
        msg = f"need one positive weight per record (--weights), not {list(weights)} for {len(paths)}"
        raise DataError(msg)
    records = tuple(read_record(path, columns, weight=weight) for path, weight in zip(paths, weights, strict=True))
    names = [record.name for record in records]
    for name in names:
        if names.count(name) > 1:
            msg = f"{names.count(name)} records are called {name}: errors and pictures go by that name. Rename all but one."
            raise DataError(msg)
    sizes = [float(np.abs(record.resistance).max()) for record in records]
    small, large = int(np.argmin(sizes)), int(np.argmax(sizes))
    if sizes[large] > LARGEST_JUMP * sizes[small]:
        msg = (
            f"the output reaches {sizes[small]:g} in {records[small].name} and {sizes[large]:g} in {records[large].name}, "
            "as if their units differed. State the unit in the columns' names."
        )
        raise DataError(msg)
    return records


def _read_columns(path: Path, columns: Columns) -> tuple[list[str], list[str], NDArray[np.int_], list[Vector]]:
    """Read the header, the cells of the first line that lacks a number, and the lines and values [SI] of all samples.

    No more than the numbers is kept, so that a file of any length fits.
    """
    lines, unread = array("q"), list[str]()
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            sample = file.read(4096)
            file.seek(0)
            first = sample.splitlines()[0] if sample else ""
            reader = csv.reader(file, delimiter=max(",;\t", key=first.count))
            header = [name.strip() for name in next(reader)]
            wanted = _wanted(path, header, columns)
            values = [array("d") for _ in wanted]
            for row in reader:
                if not any(cell.strip() for cell in row):
                    continue
                if any(cell.strip() for cell in row[len(header) :]):
                    msg = (
                        f"{path}, line {reader.line_num}: {len(row)} cells under {len(header)} names. Write decimal points, "
                        "and a name for every column."
                    )
                    raise DataError(msg)
                lines.append(reader.line_num)
                for column, (place, unit) in zip(values, wanted, strict=True):
                    column.append(unit * _number(row, place))
                if not unread and not all(math.isfinite(column[-1]) for column in values):
                    unread = row
    except (OSError, UnicodeDecodeError, csv.Error, StopIteration) as error:
        what = "it is empty" if isinstance(error, StopIteration) else reason(error)
        msg = f"cannot read {path}: {what}. Name a CSV file with a header line."
        raise DataError(msg) from error
    if not lines:
        msg = f"{path} holds no samples. Name a CSV file with a header line and numbers below it."
        raise DataError(msg)
    return header, unread, np.array(lines, dtype=int), [np.array(column, dtype=np.float64) for column in values]


def _wanted(path: Path, header: list[str], columns: Columns) -> list[tuple[int, float]]:
    """Return the places of time, unless there is a sampling step, strain and resistance, and their factors to SI."""
    wanted = [
        _find(path, header, columns.strain, columns.strain_unit, STRAIN, STRAINS, "strain"),
        _find(path, header, columns.resistance, columns.resistance_unit, RESISTANCE, OHMS, "resistance"),
    ]
    if columns.sampling_step is None:
        return [_find(path, header, columns.time, columns.time_unit, TIME, SECONDS, "time"), *wanted]
    if columns.time is not None or columns.time_unit is not None:
        msg = f"{path}: a column or unit of time and a sampling step are given. Leave one of them out."
        raise DataError(msg)
    if not columns.sampling_step > 0.0:
        msg = f"the sampling step must be a positive time [s], not {columns.sampling_step:g}"
        raise DataError(msg)
    return wanted


def _find(
    path: Path,
    header: list[str],
    name: str | None,
    unit: str | None,
    known: tuple[str, ...],
    units: dict[str, float],
    what: str,
) -> tuple[int, float]:
    """Return the place of a column and the factor to SI."""
    parsed = [_split(cell, units) for cell in header]
    if name is not None:
        places = [k for k, cell in enumerate(header) if cell == name]
    else:
        found = ([k for k, (stem, _) in enumerate(parsed) if stem == word] for word in known)
        places = next((group for group in found if group), [])
    if len(places) > 1:
        may = ", ".join(header[k] for k in places)
        msg = f"{path}, line 1: {len(places)} columns may be the {what}: {may}. Name one ({OPTION[what]})."
        raise DataError(msg)
    if not places:
        which = "no column is recognised as" if name is None else f"no column {name!r} for"
        step = " or give the sampling step (--sampling-step)" if what == "time" else ""
        msg = f"{path}, line 1: {which} {what} among {', '.join(header)}. Name one ({OPTION[what]}){step}."
        raise DataError(msg)
    place = places[0]
    stated = parsed[place][1]
    if unit is not None and unit not in units:
        msg = f"{unit!r} is not a unit of {what}; it is one of {', '.join(units)}"
        raise DataError(msg)
    if unit is not None and stated is not None and units[unit] != units[stated]:
        msg = f"{path}, line 1: column {header[place]!r} is in {stated}, but the option is {unit}. Correct the option."
        raise DataError(msg)
    return place, units[unit or stated or next(iter(units))]


def _split(cell: str, units: dict[str, float]) -> tuple[str, str | None]:
    """Divide ``strain [%]`` or ``t_ms`` into name and unit."""
    text = cell.strip().lower()
    match = re.fullmatch(r"(.*?)\s*[\[(]\s*(.+?)\s*[\])]", text) or re.fullmatch(r"(.+)_([^_]+)", text)
    if match and match[2] in units:
        return match[1], match[2]
    return text, None


def _number(row: list[str], place: int) -> float:
    try:
        return float(row[place])
    except (IndexError, ValueError):
        return float("nan")
