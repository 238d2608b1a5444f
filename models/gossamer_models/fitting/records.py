"""One measurement of a sensor: what was recognised in its file, the samples that are fitted, its form in equal steps.

What was recognised is shown before a fit, so that no unit, gap or column is assumed without a word.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from gossamer_files.measured import Column
from gossamer_files.options import option
from numpy.typing import NDArray

from ..arrays import Rows, Vector
from ..errors import DataError, NotFiniteError, require

PARTS = 4  # of a training stretch that is cut to predict its later parts
MOST_LEFT_OUT = 3  # records that are judged by a fit to the others
FITTED = (0.6, 0.8)  # of the training samples of every record; the rest is predicted
LONGEST_GAP = 20.0  # median steps; a longer step is a gap
LARGE_STRAIN = 0.5  # [1] a strain without a unit that reaches this may be in per cent
MOST_SAMPLES = 50_000  # of all records of a fit
MOST_RESAMPLED = 4  # times as many samples as before
SECOND_DIFFERENCE = 0.6745 * np.sqrt(6.0)  # median of the absolute second difference of unit white noise
ROUNDED = 0.01  # of a record: its end may be named in a round number
LARGEST_STRAIN = 5.0  # no sensor reads more


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One recognised column and its range.

    Attributes
    ----------
    column : Column
        Name and unit.
    lowest, highest : float
        Range [SI].
    """

    column: Column
    lowest: float
    highest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """A long step between two samples.

    Attributes
    ----------
    seconds, strain : float
        Its length [s] and the change of strain over it [1].
    line : int
        Line of the sample after it.
    """

    seconds: float
    strain: float
    line: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSummary:
    """What was recognised in one file.

    Attributes
    ----------
    written : str
        Encoding, delimiter, decimal mark and where the header stands, where they are not the usual ones.
    quantities : tuple of Quantity
        Time, strain and resistance, and temperature where it was read; no time for a record without a clock.
    samples, rows : int
        Number of samples that were kept, and of rows below the header.
    step, shortest, longest : float
        Median, smallest and largest step between samples [s].
    gaps : tuple of Gap
        Steps longer than ``LONGEST_GAP`` median steps.
    """

    written: str
    quantities: tuple[Quantity, ...]
    samples: int
    rows: int
    step: float
    shortest: float
    longest: float
    gaps: tuple[Gap, ...]

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a user should confirm, one sentence each."""
        sentences = []
        for each in self.quantities:
            c = each.column
            if c.others:
                sentences.append(
                    f"{c.name!r} is taken as {c.what}; {' and '.join(map(repr, c.others))} may be it too ({option(c.what)})."
                )
            if c.unit is None and c.what == "strain" and each.highest >= LARGE_STRAIN:
                sentences.append(
                    f"strain has no unit: read as a ratio, it reaches {each.highest:.0%}. If it is in per cent, give "
                    f"{option('strain_unit', '%')}."
                )
        if self.gaps:
            longest = max(self.gaps, key=lambda gap: gap.seconds)
            sentences.append(
                f"{len(self.gaps)} gap{'s' if len(self.gaps) > 1 else ''} longer than {LONGEST_GAP:g} steps, the longest of "
                f"{longest.seconds:g} s before line {longest.line}, where strain changes by {longest.strain:.3g}. Strain is "
                "taken as linear in between; if it moved, cut the record there."
            )
        return tuple(sentences)


def gaps_of(time: Vector, strain: Vector, lines: NDArray[np.int_]) -> tuple[Gap, ...]:
    """Return the long steps of a record."""
    steps = np.diff(time)
    return tuple(
        Gap(seconds=float(steps[k]), strain=float(abs(strain[k + 1] - strain[k])), line=int(lines[k + 1]))
        for k in np.flatnonzero(steps > LONGEST_GAP * np.median(steps))
    )


@dataclass(frozen=True, kw_only=True)
class Record:
    """One measurement.

    Attributes
    ----------
    name : str
        For messages and tables.
    time, strain, resistance : ndarray, shape (m,)
        Time [s], increasing; strain [1]; resistance [ohm] or a signal linear in it.
    lines : ndarray of int, shape (m,)
        Line of the file of each sample.
    weight : float
        Weight of its squared errors in a fit with others [1].
    repairs : tuple of str
        Repairs of the record, one sentence each.
    summary : RecordSummary or None
        What was recognised in its file; None for a record that comes from none.
    temperature : ndarray, shape (m,), or None
        Of the sensor [K]; None where it was not measured.
    """

    name: str
    time: Vector
    strain: Vector
    resistance: Vector
    lines: NDArray[np.int_]
    weight: float = 1.0
    repairs: tuple[str, ...] = ()
    summary: RecordSummary | None = None
    temperature: Vector | None = None

    def __post_init__(self) -> None:
        table = [self.time, self.strain, self.resistance, *([] if self.temperature is None else [self.temperature])]
        problem = None
        if len({column.shape for column in table}) > 1 or self.time.ndim != 1:
            problem = f"its columns have shapes {', '.join(str(column.shape) for column in table)}: need equal columns"
        elif not np.isfinite(table).all():
            problem = f"row {int(np.argmin(np.isfinite(table).all(axis=0)))} holds a value that is not finite"
        elif not self.weight > 0.0:
            problem = f"its weight is {self.weight:g}; leave a record out instead"
        kind = NotFiniteError if problem and "not finite" in problem else DataError
        require(problem is None, f"cannot use record {self.name!r}: {problem}.", kind)

    @property
    def unit(self) -> str | None:
        """Unit of the resistance as it stands here: "ohm", or "1" for a signal; None where its file states none."""
        columns = [each.column for each in self.summary.quantities] if self.summary else []
        column = next((each for each in columns if each.what == "resistance" and each.unit is not None), None)
        return None if column is None else column.si

    def at(self, rows: Rows | NDArray[np.int_]) -> Record:
        """Return the record with some of its samples."""
        columns = {name: getattr(self, name)[rows] for name in ("time", "strain", "resistance", "lines")}
        return replace(self, **columns, temperature=None if self.temperature is None else self.temperature[rows])

    @property
    def repaired(self) -> tuple[str, ...]:
        """Repairs with the name of the record, one sentence each."""
        return tuple(f"{self.name}: {text}." for text in self.repairs)


def thin(records: Sequence[Record], most: int = MOST_SAMPLES) -> tuple[Record, ...]:
    """Leave samples out of records that have too many together to be fitted, by one rule for all; it is in their repairs.

    Parameters
    ----------
    records : sequence of Record
        Records of one fit.
    most : int
        Largest number of samples of all records together, but for two of each record.

    Returns
    -------
    tuple of Record
        The records themselves if they have no more samples.

    Notes
    -----
    Of every k successive samples those of the smallest and the largest strain are kept, and the first and the last sample
    of a record: so hysteresis sees the same turning points, unless strain turns back twice within k samples. A mean of
    k samples would cut the turning points off. A fit takes 36 kB for each sample: 1.8 GB for ``MOST_SAMPLES``.
    """
    count = sum(record.time.size for record in records)
    if count <= most:
        return tuple(records)
    k = math.ceil(2.0 * count / most)
    thinned = []
    for record in records:
        begins = np.arange(0, record.time.size, k)
        kept = {0, record.time.size - 1}
        for begin in begins:
            part = record.strain[begin : begin + k]
            kept |= {int(begin + part.argmin()), int(begin + part.argmax())}
        rows = np.array(sorted(kept))
        text = (
            f"{rows.size} of {record.time.size} samples are fitted, because the records have {count} together, more than "
            f"{most}: of every {k} successive ones those with the smallest and the largest strain"
        )
        thinned.append(replace(record.at(rows), repairs=(*record.repairs, text)))
    return tuple(thinned)


def training_rows(record: Record, train: str, end: float | None = None) -> Rows:
    """Return which samples to fit.

    Parameters
    ----------
    record : Record
        Times from zero.
    train : str
        ``A:B`` for times from A to B [s], either of which may be missing, or ``P%`` for the leading part of the samples.
    end : float or None
        Where the file ends [s], if the record has only its beginning, or the longest of several records.

    Raises
    ------
    DataError
        The text is neither, no sample lies there, or it ends after ``end``.
    """
    high = None
    try:
        if train.endswith("%"):
            share = 0.01 * float(train[:-1])
            if not 0.0 < share <= 1.0:
                raise ValueError
            rows = np.arange(record.time.size) < round(share * record.time.size)
        else:
            low, high = (float(part) if part.strip() else None for part in train.split(":"))
            rows = np.ones(record.time.size, dtype=bool)
            rows &= record.time >= (0.0 if low is None else low)
            rows &= record.time <= (np.inf if high is None else high)
    except ValueError:
        msg = f"cannot read {train!r} as a training stretch. Write 0:200 for seconds or 50% for a leading part, up to 100%."
        raise DataError(msg) from None
    if not rows.any():
        msg = f"{record.name} runs from 0 to {record.time[-1]:g} s: no sample lies in {train!r}. Name another stretch."
        raise DataError(msg)
    end = float(record.time[-1]) if end is None else end
    if high is not None and high > end + max(ROUNDED * end, float(np.median(np.diff(record.time)))):
        half = float(f"{0.5 * end:.3g}")
        advice = f"Write 0:{half:g} for its first half, or 100% for all of it."
        msg = f"{record.name} ends at {end:g} s, counted from its first sample, and {train!r} goes beyond. {advice}"
        raise DataError(msg)
    return rows


def training_stretches(records: Sequence[Record], train: str) -> tuple[Rows, ...]:
    """Return which samples of each record to fit; a record that ends before the stretch does takes part to its end.

    Raises
    ------
    DataError
        As ``training_rows``; the stretch may end after some records do, but not after all of them.
    """
    longest = max(records, key=lambda record: float(record.time[-1]))
    training_rows(longest, train)
    return tuple(training_rows(record, train, end=float(longest.time[-1])) for record in records)


def judged_rows(first: Rows) -> Rows:
    """Return the rows that a fit is judged on: those outside its first stretch, or this one where there are no more."""
    return first if first.all() else ~first


def check_rest(rest_resistance: float | None) -> None:
    """Refuse a resistance at rest that is not a finite number; None means that it is fitted."""
    if rest_resistance is not None and not np.isfinite(rest_resistance):
        msg = f"the resistance at rest is {rest_resistance:g}; give a finite number, or leave it out to fit it"
        raise DataError(msg)


def noise_of(*signals: Vector) -> float:
    """Return the standard deviation of the white noise of smooth signals, from the median of their second differences."""
    return float(np.median(np.abs(np.concatenate([np.diff(each, 2) for each in signals]))) / SECOND_DIFFERENCE)


def strain_range(records: Sequence[Record], full_scale: float | None) -> float:
    """Return the full scale [1], the largest strain if none is given; refuse strain outside it."""
    require(records, "there is no record to fit. Give at least one.", DataError)
    if full_scale is None:
        full_scale = max(float(r.strain.max()) for r in records)
    elif not 0.0 < full_scale <= LARGEST_STRAIN:
        msg = (
            f"the full scale is {full_scale:g}; give the strain at the end of the range as a ratio [1], 0.2 for 20 %, or "
            "leave it out"
        )
        raise DataError(msg)
    for r in records:
        beyond = np.flatnonzero((r.strain > full_scale) | (r.strain < 0.0))
        if beyond.size:
            k = int(beyond[0])
            advice = "Raise the full scale or leave the samples out."
            msg = f"{r.name}, line {r.lines[k]}: strain {r.strain[k]:g} is outside 0 to full scale {full_scale:g}. {advice}"
            raise DataError(msg)
    return full_scale


def in_equal_steps(record: Record, train: Rows) -> tuple[Record, Rows]:
    """Return a record and its training samples, resampled in equal steps by linear interpolation.

    Notes
    -----
    The step is the median step, unless a few long steps (a hold without samples) would multiply the samples by more
    than ``MOST_RESAMPLED``. Training samples are those between the first and the last one of the record.
    """
    time, steps = record.time, np.diff(record.time)
    count = round(min((time[-1] - time[0]) / np.median(steps), MOST_RESAMPLED * steps.size))
    even = np.linspace(time[0], time[-1], count + 1)
    strain, resistance = (np.interp(even, time, values) for values in (record.strain, record.resistance))
    lines = np.rint(np.interp(even, time, record.lines)).astype(int)
    reach = 1e-6 * (even[1] - even[0])
    rows = (even >= time[train][0] - reach) & (even <= time[train][-1] + reach)
    return replace(record, time=even, strain=strain, resistance=resistance, lines=lines, temperature=None), rows


def forward_cuts(train: tuple[Rows, ...]) -> Iterator[tuple[tuple[Rows, ...], tuple[Rows, ...]]]:
    """Cut the training samples of every record in time order; return what to fit and what to predict."""
    parts = [np.array_split(np.flatnonzero(rows), PARTS) for rows in train]

    def some(which: slice) -> tuple[Rows, ...]:
        places = [np.concatenate(ends[which]) for ends in parts]
        return tuple(np.isin(np.arange(rows.size), each) for rows, each in zip(train, places, strict=True))

    for k in range(PARTS // 2, PARTS):
        yield some(slice(k)), some(slice(k, k + 1))


def cut(train: Sequence[Rows], share: float = FITTED[0]) -> tuple[tuple[Rows, ...], tuple[Rows, ...]]:
    """Return the leading share of the training samples of every record, and the later ones."""
    fitted, held = [], []
    for rows in train:
        places = np.flatnonzero(rows)
        early = np.zeros_like(rows)
        early[places[: round(share * places.size)]] = True
        fitted.append(early)
        held.append(rows & ~early)
    return tuple(fitted), tuple(held)


def judging_cuts(train: Sequence[Rows]) -> tuple[tuple[tuple[Rows, ...], tuple[Rows, ...]], ...]:
    """Return what to fit and what to judge by, several times: in time order, or one of several records after another."""
    used = [k for k, rows in enumerate(train) if rows.any()]
    if len(used) < 2:
        return tuple(cut(train, share) for share in FITTED)
    return tuple(
        (tuple(rows & (j != k) for j, rows in enumerate(train)), tuple(rows & (j == k) for j, rows in enumerate(train)))
        for k in used[:MOST_LEFT_OUT]
    )


def until_the_end_of_training(
    records: Sequence[Record], train: Sequence[Rows]
) -> tuple[tuple[Record, ...], tuple[Rows, ...]]:
    """Return the records that are trained on, up to their last training samples: nothing sees what comes later."""
    ends = {k: int(np.flatnonzero(rows)[-1]) + 1 for k, rows in enumerate(train) if rows.any()}
    return tuple(records[k].at(np.arange(end)) for k, end in ends.items()), tuple(train[k][:end] for k, end in ends.items())


def without_delay(time: Vector, delay: Vector, values: Vector) -> Vector:
    """Return values that are late [s] at the times [s] that they are of; not a number where none is delivered."""
    meant = time - delay
    kept = np.diff(meant, prepend=-np.inf) > 0.0
    return np.asarray(np.interp(time, meant[kept], values[kept], right=np.nan))
