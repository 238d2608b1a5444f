r"""Records of strain and resistance: read, checked and repaired by stated rules.

Rules, beside those of ``gossamer_files.measured``, each with the line of the file named where it applies:

- Records of one fit have different names.
- What was recognised goes with the record, ``summary.py``, to be shown before a fit.
- Times without a unit that may be milliseconds or a count are refused, and so is an elongation, which may be a length.
- Samples with a missing value or no finite number are left out; more than ``MOST_MISSING`` of them are refused.
- Samples with the same time are averaged. Times that go backwards are refused; ``sort`` sorts them instead.
- A record without a time column needs ``sampling_step``. A time column and ``sampling_step`` together are refused.
- A gap, a step longer than ``LONGEST_GAP`` median steps in which strain changes by more than ``GAP_STRAIN`` of its range, is
  refused, because the switching during the gap is unknown. A gap at constant strain stays and is reported.
- Strain above 1 in a column without a unit, an output that jumps by a factor of ``LARGEST_JUMP`` between
  samples, and records of one fit whose largest outputs differ by this factor are refused as mixed units.
- A column called temperature is read where its unit is in brackets, K or degC; it may be missing.
- Constant strain or output, and strain below zero by more than rounding of the meter, are refused.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from gossamer_files.measured import Column, Measured, Wanted, find_column, of_a_run, passes_midnight, read_columns
from gossamer_files.measured.units import in_base_units
from gossamer_files.options import option
from numpy.typing import NDArray

from ..arrays import Rows, Vector
from ..errors import DataError, NotFiniteError
from .records import LONGEST_GAP, Quantity, Record, RecordSummary, gaps_of, noise_of

MOST_MISSING = 0.05
GAP_STRAIN = 0.05
LARGEST_JUMP = 30.0  # of the output between two samples: a meter that changed its unit
LEAST_STRAIN = -0.01  # of the range: a drifted zero of the meter
TEMPERATURE = re.compile(r"(?i:temperatur|temperature|temp)[\s_]*[\[(](K|degC|°C)[\])]")
SWAPPED, NOISY = 1.5, 5e-4  # noise of strain over that of the output, and over its range: gauges are quieter than sensors


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Which columns to read, and in which units.

    Attributes
    ----------
    time, strain, resistance : str or None
        Names of columns; None to recognise them.
    time_unit, strain_unit, resistance_unit : str or None
        Their units; None to recognise them.
    sampling_step : float or None
        Time between samples [s] where there is no time column.
    sort : bool
        Sort samples by time instead of refusing times that go backwards.
    """

    time: str | None = None
    strain: str | None = None
    resistance: str | None = None
    time_unit: str | None = None
    strain_unit: str | None = None
    resistance_unit: str | None = None
    sampling_step: float | None = None
    sort: bool = False

    def choose(self, path: Path, header: list[str], line: int) -> list[Column]:
        """Return time, unless there is a sampling step, strain and resistance; refuse all unclear ones at once.

        Temperature comes last, where one column states that it holds it.
        """
        wanted, mistakes = list[Column](), list[str]()
        for what in ("time", "strain", "resistance")[self.sampling_step is not None :]:
            column = Wanted(what=what, name=getattr(self, what), unit=getattr(self, f"{what}_unit"), options=True)
            try:
                wanted.append(find_column(path, header, line, column))
            except DataError as error:
                mistakes.append(str(error))
        if self.sampling_step is not None:
            if self.time is not None or self.time_unit is not None:
                mistakes.append(f"{path}: a column or unit of time and a sampling step are given. Leave one of them out.")
            if not self.sampling_step > 0.0:
                mistakes.append(f"the sampling step must be a positive time [s], not {self.sampling_step:g}")
        if mistakes and self.strain is None and self.resistance is None and of_a_run(header):
            mistakes = [
                f"{path} is a result of a run, and its sensors are identified already. Name a file that was measured, or "
                f"the columns of one sensor here ({option('strain')}, {option('resistance')})."
            ]
        if mistakes:
            raise DataError("\n".join(mistakes))
        warm = [cell for cell in header if TEMPERATURE.fullmatch(cell.strip())]
        if len(warm) == 1:
            wanted.append(find_column(path, header, line, Wanted(what="value", name=warm[0])))
        return wanted


@dataclass(slots=True)
class _Samples:
    """Time, strain and resistance of a file, and their repairs, one sentence each."""

    path: Path
    columns: list[Vector]
    lines: NDArray[np.int_]
    repairs: list[str] = field(default_factory=list)

    def keep(self, rows: Rows | NDArray[np.int_]) -> None:
        """Keep some samples."""
        self.columns = [c[rows] for c in self.columns]
        self.lines = self.lines[rows]


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
    measured = read_columns(path, lambda header, line: columns.choose(path, header, line), unreadable="kept")
    samples = _Samples(path, list(measured.values), measured.lines)
    if columns.sampling_step is not None:
        samples.columns.insert(0, columns.sampling_step * np.arange(measured.lines.size, dtype=np.float64))
        samples.repairs.append(f"no clock was read: samples are taken as {columns.sampling_step:g} s apart")
    _drop_missing(samples, measured)
    measured.check_days(samples.columns[0])
    _order_times(samples, measured, sort=columns.sort)
    time, strain, resistance, *warm = samples.columns
    measured.check_clock(time, ", or give the sampling step")
    measured.check_strain(next(c for c in measured.columns if c.what == "strain"), strain, samples.lines)
    _check(samples)
    steps = np.diff(time)
    ranges = {"time": time, "strain": strain, "resistance": resistance} | ({"value": warm[0]} if warm else {})
    summary = RecordSummary(
        written=measured.written,
        quantities=tuple(
            Quantity(column=c, lowest=float(ranges[c.what].min()), highest=float(ranges[c.what].max()))
            for c in measured.columns
        ),
        samples=time.size,
        rows=measured.lines.size,
        step=float(np.median(steps)),
        shortest=float(steps.min()),
        longest=float(steps.max()),
        gaps=gaps_of(time, strain, samples.lines),
    )
    noisy, calm = (noise_of(each) / float(np.ptp(each)) for each in (strain, resistance))
    if noisy > max(SWAPPED * calm, NOISY):
        text = (
            f"strain is noisier than the output, {noisy:.1e} of its range against {calm:.1e}: see that they are not swapped"
        )
        samples.repairs.append(text)
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
        summary=summary,
        temperature=_in_kelvin(measured.columns[-1], warm[0]) if warm else None,
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
        msg = f"need one positive weight per record ({option('weights')}), not {list(weights)} for {len(paths)}"
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


def _in_kelvin(column: Column, values: Vector) -> Vector:
    unit = in_base_units({"°C": "degC"}.get(column.unit or "", column.unit or ""))
    assert unit is not None
    return unit.factor * values + unit.offset


def _drop_missing(samples: _Samples, measured: Measured) -> None:
    """Leave out samples without a finite number."""
    good = np.all([np.isfinite(c) for c in samples.columns], axis=0)
    missing = int((~good).sum())
    if not missing:
        return
    line, first = int(samples.lines[~good][0]), " | ".join(measured.unread)
    if missing > MOST_MISSING * good.size:
        msg = (
            f"{samples.path}, line {line}: {missing} of {good.size} samples hold no finite number, more than "
            f"{100 * MOST_MISSING:g} %. It reads {first}. {measured.why_unread()}."
        )
        raise NotFiniteError(msg)
    which = "sample without a finite number was" if missing == 1 else "samples without a finite number were"
    samples.repairs.append(f"{missing} {which} left out, the first in line {line}: {first}")
    samples.keep(good)


def _order_times(samples: _Samples, measured: Measured, *, sort: bool) -> None:
    """Average repeated times; sort times that go backwards, or refuse them: to sort across midnight would tear a record."""
    time = samples.columns[0]
    if not sort or passes_midnight(time):
        measured.check_rising(time, samples.lines, f"Sort the record ({option('sort', True)})")
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        samples.repairs.append(f"samples were sorted by time, the first out of order in line {samples.lines[back[0] + 1]}")
        samples.keep(np.argsort(time, kind="stable"))
        time = samples.columns[0]
    again = np.flatnonzero(np.diff(time) == 0.0)
    if again.size:
        samples.repairs.append(f"{again.size} repeated times were averaged, the first in line {samples.lines[again[0] + 1]}")
        _, first, group = np.unique(time, return_index=True, return_inverse=True)
        count = np.bincount(group)
        samples.columns = [np.bincount(group, weights=c) / count for c in samples.columns]
        samples.columns[0] = time[first]
        samples.lines = samples.lines[first]


def _check(samples: _Samples) -> None:
    """Refuse a record that cannot be that of a sensor."""
    time, strain, resistance, *_ = samples.columns
    size = float(np.ptp(strain)) if strain.size else 0.0
    if time.size < 3 or not size > 0.0 or not np.ptp(resistance) > 0.0:
        what = "too short" if time.size < 3 else "of constant strain" if not size > 0.0 else "of constant output"
        lines = f"lines {samples.lines[0]} to {samples.lines[-1]}"
        msg = f"{samples.path}, {lines}: the record is {what}. Name a record with loading."
        raise DataError(msg)
    negative = np.flatnonzero(strain < LEAST_STRAIN * size)
    if negative.size:
        k = int(negative[0])
        msg = f"{samples.path}, line {samples.lines[k]}: strain {strain[k]:g} is negative. Subtract the strain at rest."
        raise DataError(msg)
    level = np.maximum(np.abs(resistance), 1e-2 * np.abs(resistance).max())
    jumps = np.flatnonzero(np.abs(np.diff(np.log(level))) >= np.log(LARGEST_JUMP) - 1e-9)
    if jumps.size:
        k = int(jumps[0]) + 1
        msg = (
            f"{samples.path}, line {samples.lines[k]}: the output jumps from {resistance[k - 1]:g} to {resistance[k]:g}, "
            "as if its unit changed there. Convert the record to one unit."
        )
        raise DataError(msg)
    steps = np.diff(time)
    gaps = np.flatnonzero((steps > LONGEST_GAP * np.median(steps)) & (np.abs(np.diff(strain)) > GAP_STRAIN * size))
    if gaps.size:
        k = int(gaps[0]) + 1
        msg = (
            f"{samples.path}, line {samples.lines[k]}: a gap of {steps[k - 1]:g} s in which strain changes by "
            f"{abs(strain[k] - strain[k - 1]):g}; what switched there is unknown. Cut the record there into two files."
        )
        raise DataError(msg)
