"""Tables that a command prints and its page holds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from rich.markup import escape
from rich.table import Table

from ..pages import table


class Shown(NamedTuple):
    """A table.

    Attributes
    ----------
    head : tuple of str
        Headings of the columns.
    rows : sequence of tuple of str
        Cells.
    caption : str
        What it shows.
    """

    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    caption: str


def printed(shown: Shown) -> Table:
    """Return a table for the terminal."""
    made = Table(*map(escape, shown.head), caption=escape(shown.caption))
    for row in shown.rows:
        made.add_row(*map(escape, row))
    return made


def on_page(shown: Shown) -> str:
    """Return a table in HTML; nothing without rows."""
    return table(shown.head, shown.rows, shown.caption, row_heads=False) if shown.rows else ""
