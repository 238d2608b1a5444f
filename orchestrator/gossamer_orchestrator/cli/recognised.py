"""What a command recognised in its records: printed before it fits or judges anything."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

if TYPE_CHECKING:
    from gossamer_models.fitting import Record
    from gossamer_models.fitting.found import Quantity

SI = {"time": "s", "strain": "%", "resistance": "ohm"}


def print_recognised(console: Console, records: Sequence[Record]) -> None:
    """Print columns, units, ranges, sampling and gaps of records, and what a user should confirm."""
    headings = ("record", "quantity", "column", "unit", "range", "samples, steps")
    table = Table(*headings, title="read as")
    sentences = []
    for record in records:
        found = record.found
        if found is None:
            continue
        even = found.longest - found.shortest < 1e-3 * found.step
        steps = (
            f"{found.step:.4g} s"
            if even
            else f"{found.shortest:.3g} to {found.longest:.4g} s, median {found.step:.3g} s"
        )
        first = [escape(record.name), *([found.written] if found.written else [])]
        last = [f"{found.samples} samples", steps, f"gaps: {len(found.gaps)}" if found.gaps else "no gap"]
        for k in range(3):
            quantity = found.quantities[k] if k < len(found.quantities) else None
            table.add_row(
                first[k] if k < len(first) else "",
                *(("", "", "", "") if quantity is None else _cells(quantity)),
                last[k],
                end_section=k == 2,
            )
        sentences += [f"{record.name}: {sentence}" for sentence in found.remarks]
    if table.row_count:
        console.print(table)
    for sentence in sentences:
        console.print(sentence, style="yellow", markup=False)


def _cells(quantity: Quantity) -> tuple[str, str, str, str]:
    column = quantity.column
    factor = 100.0 if column.what == "strain" else 1.0
    low, high = factor * quantity.lowest, factor * quantity.highest
    unit = column.unit or f"{'ratio' if column.what == 'strain' else SI[column.what]}, not stated"
    return column.what, escape(column.name), escape(unit), f"{low:.5g} to {high:.5g} {SI[column.what]}"
