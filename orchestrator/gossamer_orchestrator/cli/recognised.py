"""What a command recognised in its records: printed before it fits or judges anything."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

if TYPE_CHECKING:
    from gossamer_models.fitting import Record
    from gossamer_models.fitting.records import Quantity

UNITS = {"ohm": " ohm", "1": "", None: " (unit not stated)"}  # after a number, of ``Record.unit``

HEADINGS = ("record", "quantity", "column", "unit", "range", "samples, steps")


def print_recognised(console: Console, records: Sequence[Record]) -> None:
    """Print columns, units, ranges, sampling and gaps of records, how they were repaired, and what a user should confirm."""
    table = Table(*HEADINGS, title="read as")
    for record in records:
        for cells in recognised_rows(record):
            table.add_row(*map(escape, cells))
        table.add_section()
    if table.row_count:
        console.print(table)
    for record in records:
        confirm = [f"{record.name}: {sentence}" for sentence in (record.summary.remarks if record.summary else ())]
        for sentence in (*record.repaired, *confirm):
            console.print(sentence, style="yellow", markup=False)


def print_remarks(console: Console, remarks: Iterable[str], records: Iterable[Record]) -> None:
    """Print what was found out about a sensor, but for the repairs of its records, which are printed already."""
    printed = {sentence for record in records for sentence in record.repaired}
    for sentence in remarks:
        if sentence not in printed:
            console.print(sentence, style="yellow", markup=False)


def recognised_rows(record: Record) -> list[tuple[str, ...]]:
    """Return what was recognised in the file of a record, a row per quantity; nothing for one that comes from no file."""
    found = record.summary
    if found is None:
        return []
    even = found.longest - found.shortest < 1e-3 * found.step
    steps = (
        f"{found.step:.4g} s" if even else f"{found.shortest:.3g} to {found.longest:.4g} s, median {found.step:.3g} s"
    )
    first = (record.name, found.written, "")
    samples = f"{found.samples} samples" + f" of {found.rows} rows" * (found.rows > found.samples)
    last = (samples, steps, f"gaps: {len(found.gaps)}" if found.gaps else "no gap")
    cells = [_cells(quantity) for quantity in found.quantities] + [("",) * 4]  # no time in a record without a clock
    return [(one, *four, six) for one, four, six in zip(first, cells[:3], last, strict=True)]


def _cells(quantity: Quantity) -> tuple[str, ...]:
    column = quantity.column
    factor = 100.0 if column.what == "strain" else 1.0
    low, high = factor * quantity.lowest, factor * quantity.highest
    unit = column.unit or {"time": "s, not stated", "strain": "ratio, not stated"}.get(column.what, "not stated")
    resistance = " ohm" if column.unit is not None and column.si == "ohm" else ""
    after = {"time": " s", "strain": " %"}.get(column.what, resistance)
    return column.what, column.name, unit, f"{low:.5g} to {high:.5g}{after}"
