"""Which column is time, strain or resistance, and in which unit: by option, by name, by the row of units below the header.

A name may carry its unit: ``t_ms``, ``strain [%]``, ``R (kΩ)``, ``R / MOhm``. Two different units for one column are
refused, and so is a unit in brackets that is none. Where several columns may be meant, one must be named.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import DataError
from .options import option
from .table import MISSING, bare, is_number, units_only
from .units import LENGTH, SI, STRAIN, factor

ELONGATION = "elongation"  # a length as well as a strain, so it needs a unit
DATE = "date"  # a day is no time, so such a column is the time only where no other one is
WORDS = {
    "time": ("time", "timestamp", "datetime", "date_time", "date/time", "zeit", "t", "elapsed", DATE),  # T: temperature
    "strain": ("strain", "eps", "epsilon", "ε", "dehnung", ELONGATION),
    "resistance": ("resistance", "r", "widerstand"),
}
BEGINNINGS = {
    "time": ("time", "timestamp", "elapsed"),
    "strain": ("strain", "eps", "dehnung", ELONGATION),
    "resistance": ("resistance", "r"),
}
MOST_NAMES = 12  # of columns that a message lists
OF_A_RUN = re.compile(r"[\w-]+\.\S+ \[\S+\]")  # sensor1.resistance [ohm], in the results of a run
UNITS = {"time": "s, ms, us, min or h", "strain": "1, %, permille or ustrain", "resistance": "ohm, kohm, Mohm or 1"}
NO_UNIT = ("", "-")
LIKE_UNITS = ("min", "day", "month", "year")  # names of columns that hold something else


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Which columns to read, and in which units.

    Attributes
    ----------
    time, strain, resistance : str or None
        Names of columns; None to recognise them.
    time_unit, strain_unit, resistance_unit : str or None
        Units as in ``units.factor``; None to recognise them.
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
    resistance_unit: str | None = option(None, "ohm, kohm or Mohm; 1 for a signal.")
    sampling_step: float | None = option(None, "Time between samples [s] of a record without time.")
    sort: bool = option(False, "Sort samples by time instead of refusing them.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One recognised column.

    Attributes
    ----------
    what : str
        ``time``, ``strain`` or ``resistance``.
    place : int
        Where it stands, from 0.
    name : str
        Its name in the header.
    unit : str or None
        Its unit; None where nothing states it, and it is taken as SI.
    others : tuple of str
        Columns that may have been meant as well.
    """

    what: str
    place: int
    name: str
    unit: str | None
    others: tuple[str, ...] = ()

    @property
    def si(self) -> str:
        """Unit after reading; that of a signal, which states a unit without a dimension, is ``1``."""
        return "1" if self.what == "strain" or (self.unit is not None and _ratio(self.unit)) else SI[self.what]

    @property
    def factor(self) -> float:
        """Factor to SI [1]."""
        return 1.0 if self.unit is None else factor(self.unit, self.what) or 1.0


def wanted_columns(path: Path, header: list[str], line: int, columns: Columns) -> list[Column]:
    """Return time, unless there is a sampling step, strain and resistance; raise ``DataError`` about all unclear ones."""
    wanted, mistakes = list[Column](), list[str]()
    for what in ("strain", "resistance") if columns.sampling_step is not None else ("time", "strain", "resistance"):
        try:
            wanted.append(find(path, header, line, columns, what))
        except DataError as error:
            mistakes.append(str(error))
    if columns.sampling_step is not None:
        if columns.time is not None or columns.time_unit is not None:
            mistakes.append(f"{path}: a column or unit of time and a sampling step are given. Leave one of them out.")
        if not columns.sampling_step > 0.0:
            mistakes.append(f"the sampling step must be a positive time [s], not {columns.sampling_step:g}")
    unnamed = columns.strain is None and columns.resistance is None
    of_a_run = header[0] == "time [s]" and len(header) > 1 and all(map(OF_A_RUN.fullmatch, header[1:]))
    if mistakes and unnamed and of_a_run:
        mistakes = [
            f"{path} is a result of a run, and its sensors are identified already. Name a file that was measured, or the "
            "columns of one sensor here (--strain, --resistance)."
        ]
    if mistakes:
        raise DataError("\n".join(mistakes))
    return wanted


def _listed(names: list[str]) -> str:
    """Return names of columns for a message, without a full stop of their own at the end."""
    left = len(names) - MOST_NAMES
    return ", ".join(names[:MOST_NAMES]).rstrip(".") + f" and {left} more" * (left > 0)


def no_unit(text: str, what: str) -> str:
    """Return what to do about a unit that a column cannot have: of strain, a length is divided by another one first."""
    if what == "strain" and LENGTH.fullmatch(text.strip()):
        return "That is a displacement: divide it by the gauge length first, and write the ratio"
    return f"State the unit (--{what}-unit): {UNITS[what]}"


def find(path: Path, header: list[str], line: int, columns: Columns, what: str) -> Column:
    """Return one column with its unit, by option or by name."""
    name, unit = getattr(columns, what), getattr(columns, f"{what}_unit")
    if unit is not None and factor(unit, what) is None:
        msg = f"{unit!r} is not a unit of {what}. {no_unit(unit, what)}."
        raise DataError(msg)
    parsed = [split_name(cell, what) for cell in header]
    places, others = _named(header, name) if name is not None else _recognised(parsed, what)
    if len(places) > 1:
        may = _listed([header[k] for k in places])
        msg = f"{path}, line {line}: {len(places)} columns may be the {what}: {may}. Name one (--{what})."
        raise DataError(msg)
    if not places:
        which = "no column is recognised as" if name is None else f"no column {name!r} for"
        step = " or give the sampling step (--sampling-step)" if what == "time" else ""
        msg = f"{path}, line {line}: {which} {what} among {_listed(header)}. Name one (--{what}){step}."
        raise DataError(msg)
    place = places[0]
    _, stated, strange = parsed[place]
    if unit is None and strange is not None:
        msg = (
            f"{path}, line {line}: {strange!r} in {header[place]!r} is not a unit of {what}. {no_unit(strange, what)}."
        )
        raise DataError(msg)
    column = Column(
        what=what, place=place, name=header[place], unit=stated, others=tuple(header[k] for k in others if k != place)
    )
    return column if unit is None else with_unit(path, line, column, unit, "the option is")


def with_unit(path: Path, line: int, column: Column, unit: str, source: str) -> Column:
    """Return a column with its unit; refuse one that contradicts the unit it has."""
    if column.unit is not None and factor(unit, column.what) != column.factor:
        msg = f"{path}, line {line}: column {column.name!r} is in {column.unit}, but {source} {unit}. Correct one of them."
        raise DataError(msg)
    return replace(column, unit=unit)


def read_units(path: Path, line: int, row: list[str], wanted: list[Column], columns: Columns) -> list[Column] | None:
    """Return the columns with the units of the row below the header; None if the row is a sample.

    Raises
    ------
    DataError
        The row holds words that are no units of their columns.
    """
    cells = [bare(row[c.place]) if c.place < len(row) else "" for c in wanted]
    missing = any(cell.lower() in MISSING and cell not in NO_UNIT for cell in cells)
    if missing and not any(factor(cell, c.what) is not None for cell, c in zip(cells, wanted, strict=True)):
        return None  # a sample without values, beside a letter that is a unit too
    if not units_only(row):
        if not any(cell.lower() not in MISSING and cell != "1" for cell in cells):
            return None
        if any(cell != "1" and is_number(cell) for cell in cells):
            return None
        stated = all(getattr(columns, f"{c.what}_unit") is not None for c in wanted)
        if stated and not any(factor(cell, c.what) is not None for cell, c in zip(cells, wanted, strict=True)):
            return None
    found = []
    for column, cell in zip(wanted, cells, strict=True):
        if cell in NO_UNIT:
            ratio = cell == "-" and column.what != "time" and column.unit is None
            found.append(replace(column, unit="1") if ratio else column)
        elif factor(cell, column.what) is None:
            if getattr(columns, f"{column.what}_unit") is None:
                msg = (
                    f"{path}, line {line}: under the header stands {' | '.join(cells)}, and {cell!r} is neither a number "
                    f"nor a unit of {column.what}. {no_unit(cell, column.what)}."
                )
                raise DataError(msg)
            found.append(column)
        else:
            found.append(with_unit(path, line, column, cell, "the row of units says"))
    return found


def split_name(cell: str, what: str) -> tuple[str, str | None, str | None]:
    """Divide ``strain [%]``, ``t_ms`` or ``R / kΩ`` into name, unit, and what stands for a unit but is none."""
    text = cell.strip()
    if match := re.fullmatch(r"(.*?)[\s_]*[\[(]\s*([^\[\]()]*?)\s*[\])]", text):
        if factor(match[2], what) is not None:
            return _stem(match[1]), match[2], None
        return _stem(match[1]), None, match[2]
    for pattern in (r"(.+?)\s*/\s*(.+)", r"(.+?)\s*,\s*(.+)", r"(.+)[_\s]+([^_\s]+)", r"(.+?)([%‰])"):
        match = re.fullmatch(pattern, text)
        if match and match[2] != "1" and factor(match[2], what) is not None:
            return _stem(match[1]), match[2], None
    if what == "strain" and (match := re.fullmatch(rf"(.+?)[\s_,/]+({LENGTH.pattern})", text)) and len(match[2]) > 1:
        return _stem(match[1]), None, match[2]
    alone = len(text) > 1 and text.lower() not in (*WORDS[what], *LIKE_UNITS) and factor(text, what) is not None
    if alone and (STRAIN.fullmatch(text) if what == "strain" else not _ratio(text)):
        return WORDS[what][0], text, None
    return _stem(text), None, None


def _stem(text: str) -> str:
    stem = re.sub(r"[\s_]+", "_", text.strip().lower()).strip("_")
    return stem.removesuffix("_in")


def _named(header: list[str], name: str) -> tuple[list[int], list[int]]:
    return [k for k, cell in enumerate(header) if cell == name], []


def _recognised(parsed: list[tuple[str, str | None, str | None]], what: str) -> tuple[list[int], list[int]]:
    """Return the columns that are meant, more than one where it is unclear, and all that may be meant."""
    like = [
        k
        for k, (stem, unit, _) in enumerate(parsed)
        if stem in WORDS[what]
        or stem.split("_")[0] in BEGINNINGS[what]
        or (unit is not None and factor(unit, what) is not None and not _ratio(unit))
    ]
    like = [k for k in like if parsed[k][2] is None] or like  # a unit in brackets that is another quantity's
    like = [k for k in like if parsed[k][0] != DATE] or like
    exact = ([k for k in like if parsed[k][0] == word] for word in WORDS[what])
    return next((group for group in exact if group), like), like


def _ratio(unit: str) -> bool:
    """Whether a unit suits strain and signals alike, so that it names no column."""
    return factor(unit, "resistance") is not None and factor(unit, "strain") is not None
