"""Tables as data: what a command prints and its page holds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple


class TableText(NamedTuple):
    """One table.

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


def number(value: float) -> str:
    """Return a number in three digits; a dash for what is not finite."""
    return f"{value:.3g}" if math.isfinite(value) else "-"


def percent(value: float) -> str:
    """Return a share in percent, in three digits."""
    return number(100.0 * value)
