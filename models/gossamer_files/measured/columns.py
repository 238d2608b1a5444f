"""Which column holds what, and in which unit: by option, by name, by the row of units below the header.

A name may carry its unit: ``t_ms``, ``strain [%]``, ``R (kΩ)``, ``R / MOhm``. Two different units for one column are
refused, and so is a unit in brackets that is none. Where several columns may be meant, one must be named.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

from gossamer_files.options import option

from .. import DataError
from .text import MISSING, bare, is_number, units_only
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
UNITS = {
    "time": "s, ms, us, min or h",
    "strain": "1, %, permille or ustrain",
    "resistance": "ohm, kohm, Mohm or 1",
    "value": "as in pressure [kPa]",
}
NO_UNIT = ("", "-")
LIKE_UNITS = ("min", "day", "month", "year")  # names of columns that hold something else


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """A column that is looked for.

    Attributes
    ----------
    what : str
        ``time``, ``strain``, ``resistance``; ``value``, a number in any unit; ``text``.
    name, unit : str or None
        Its name in the header and its unit; None to recognise them.
    options : bool
        The reader's user has options for both, ``--strain`` and ``--strain-unit``.
    """

    what: str
    name: str | None = None
    unit: str | None = None
    options: bool = False

    def name_one(self) -> str:
        """Return what to do about columns that are not recognised."""
        return f"Name one ({option(self.what)})" if self.options else f"Call one {self.what}, and no other"

    def state_unit(self, text: str = "") -> str:
        """Return what to do about a unit that it cannot have: of strain, a length is divided by another one first."""
        if self.what == "strain" and LENGTH.fullmatch(text.strip()):
            return "That is a displacement: divide it by the gauge length first, and write the ratio"
        where = f"({option(f'{self.what}_unit')})" if self.options else "in brackets after the column's name"
        return f"State the unit {where}: {UNITS[self.what]}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One recognised column.

    Attributes
    ----------
    wanted : Wanted
        What it was looked for as.
    place : int
        Where it stands, from 0.
    name : str
        Its name in the header.
    unit : str or None
        Its unit; None where nothing states it, and it is taken as SI.
    others : tuple of str
        Columns that may have been meant as well.
    """

    wanted: Wanted
    place: int
    name: str
    unit: str | None
    others: tuple[str, ...] = ()

    @property
    def what(self) -> str:
        """``time``, ``strain``, ``resistance``, ``value`` or ``text``."""
        return self.wanted.what

    @property
    def si(self) -> str:
        """Unit after reading; that of a signal, which states a unit without a dimension, is ``1``."""
        return "1" if self.what == "strain" or (self.unit is not None and _ratio(self.unit)) else SI[self.what]

    @property
    def factor(self) -> float:
        """Factor to SI [1]; 1 for a value, which stays in its unit."""
        return 1.0 if self.unit is None else factor(self.unit, self.what) or 1.0

    def in_unit(self, path: Path, line: int, unit: str, source: str) -> Column:
        """Return the column with its unit; refuse one that contradicts the unit it has."""
        if self.unit is not None and (
            factor(unit, self.what) != self.factor or (self.what == "value" and unit != self.unit)
        ):
            msg = f"{path}, line {line}: column {self.name!r} is in {self.unit}, but {source} {unit}. Correct one of them."
            raise DataError(msg)
        return replace(self, unit=unit)


def of_a_run(header: list[str]) -> bool:
    """Tell whether a table is a result of a run, by its header: every column is that of a component."""
    return header[:1] == ["time [s]"] and len(header) > 1 and all(map(OF_A_RUN.fullmatch, header[1:]))


def listed(names: list[str]) -> str:
    """Return names of columns for a message, without a full stop of their own at the end."""
    left = len(names) - MOST_NAMES
    return ", ".join(names[:MOST_NAMES]).rstrip(".") + f" and {left} more" * (left > 0)


def find_column(path: Path, header: list[str], line: int, wanted: Wanted) -> Column:
    """Return one column with its unit, by option or by name.

    Raises
    ------
    DataError
        No column or several ones may be meant, or the unit is none of what the column holds.
    """
    what, unit = wanted.what, wanted.unit
    if unit is not None and factor(unit, what) is None:
        msg = f"{unit!r} is not a unit of {what}. {wanted.state_unit(unit)}."
        raise DataError(msg)
    parsed = [split_name(cell, what) for cell in header]
    if wanted.name is None:
        places, others = _recognised(parsed, what)
    else:
        places, others = [k for k, cell in enumerate(header) if cell == wanted.name], []
    if len(places) > 1:
        may = listed([header[k] for k in places])
        msg = f"{path}, line {line}: {len(places)} columns may be the {what}: {may}. {wanted.name_one()}."
        raise DataError(msg)
    if not places:
        which = "no column is recognised as" if wanted.name is None else f"no column {wanted.name!r} for"
        step = f" or give the sampling step ({option('sampling_step')})" if what == "time" and wanted.options else ""
        msg = f"{path}, line {line}: {which} {what} among {listed(header)}. {wanted.name_one()}{step}."
        raise DataError(msg)
    place = places[0]
    beside = tuple(header[k] for k in others if k != place)
    return named_column(path, header, line, wanted, place, others=beside)


def named_column(
    path: Path,
    header: list[str],
    line: int,
    wanted: Wanted,
    place: int,
    *,
    name: str | None = None,
    others: tuple[str, ...] = (),
) -> Column:
    """Return the column at a place with the unit that its name, or ``name`` for it, states; refuse what is none."""
    _, stated, strange = split_name(header[place] if name is None else name, wanted.what)
    if wanted.unit is None and strange is not None:
        msg = (
            f"{path}, line {line}: {strange!r} in {header[place]!r} is not a unit of {wanted.what}. "
            f"{wanted.state_unit(strange)}."
        )
        raise DataError(msg)
    column = Column(wanted=wanted, place=place, name=header[place], unit=stated, others=others)
    return column if wanted.unit is None else column.in_unit(path, line, wanted.unit, "the option is")


def read_units(path: Path, line: int, row: list[str], columns: list[Column]) -> list[Column] | None:
    """Return the columns with the units of the row below the header; None if the row is a sample.

    Raises
    ------
    DataError
        The row holds words that are no units of their columns.
    """
    cells = [bare(row[c.place]) if c.place < len(row) else "" for c in columns]
    missing = any(cell.lower() in MISSING and cell not in NO_UNIT for cell in cells)
    if missing and not any(factor(cell, c.what) is not None for cell, c in zip(cells, columns, strict=True)):
        return None  # a sample without values, beside a letter that is a unit too
    if not units_only(row):
        if not any(cell.lower() not in MISSING and cell != "1" for cell in cells):
            return None
        if any(cell != "1" and is_number(cell) for cell in cells):
            return None
        stated = all(c.wanted.unit is not None for c in columns)
        if stated and not any(factor(cell, c.what) is not None for cell, c in zip(cells, columns, strict=True)):
            return None
    found = []
    for column, cell in zip(columns, cells, strict=True):
        if cell in NO_UNIT:
            ratio = cell == "-" and column.what != "time" and column.unit is None
            found.append(replace(column, unit="1") if ratio else column)
        elif factor(cell, column.what) is None:
            if column.wanted.unit is None:
                msg = (
                    f"{path}, line {line}: under the header stands {' | '.join(cells)}, and {cell!r} is neither a number "
                    f"nor a unit of {column.what}. {column.wanted.state_unit(cell)}."
                )
                raise DataError(msg)
            found.append(column)
        else:
            found.append(column.in_unit(path, line, cell, "the row of units says"))
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
