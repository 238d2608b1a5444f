"""Words and tables of a page in HTML; what belongs together in words stands on one line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from urllib.parse import quote

from gossamer_files.tables import TableText

NO_BREAK = "\N{NO-BREAK SPACE}"
UNITS = ("%", "s", "ms", "h", "min", "Hz", "kHz", "Pa", "kPa", "GPa", "ohm", "m", "mm", "kg", "N", "rad", "MB", "GB")
_BEFORE_UNIT = re.compile(rf"(?<=\d) (?=(?:{'|'.join(UNITS)})(?!\w))")
_AROUND_SIGN = re.compile(r"(?<=\d) ± (?=\d)|(?<=±) (?=\d)|(?<=\bt) = (?=\d)")


def unbroken(words: str) -> str:
    """Return words in which no line ends between a number and its unit, its deviation or its ``t =``."""
    joined = _BEFORE_UNIT.sub(NO_BREAK, words)
    return _AROUND_SIGN.sub(lambda found: found[0].replace(" ", NO_BREAK), joined)


def written(words: object) -> str:
    """Return words as HTML."""
    return escape(unbroken(str(words)))


class Html(str):
    """A cell of a table that is HTML already."""

    __slots__ = ()


def link(text: str, target: str) -> Html:
    """Return a link to an address, for instance to a file relative to the page."""
    return Html(f'<a href="{escape(quote(target))}">{escape(text)}</a>')


def table(head: Sequence[str], rows: Iterable[Sequence[object]], caption: str, *, row_heads: bool = True) -> str:
    """Return a table in HTML; the first cell of each row is its heading."""
    lines = [f"<table><caption>{written(caption)}</caption>"]
    if head:
        lines.append("<thead><tr>" + "".join(f'<th scope="col">{written(text)}</th>' for text in head) + "</tr></thead>")
    lines.append("<tbody>")
    for first, *rest in rows:
        begin = f'<th scope="row">{_cell(first)}</th>' if row_heads else f"<td>{_cell(first)}</td>"
        lines.append(f"<tr>{begin}" + "".join(f"<td>{_cell(cell)}</td>" for cell in rest) + "</tr>")
    return '<div class="wide">' + "\n".join(lines) + "</tbody></table></div>"


def on_page(shown: TableText) -> str:
    """Return a table in HTML as it is printed; nothing without rows."""
    return table(shown.head, shown.rows, shown.caption, row_heads=False) if shown.rows else ""


def folded(summary: str, inner: str) -> str:
    """Return HTML that its reader unfolds."""
    return f"<details><summary>{written(summary)}</summary>{inner}</details>"


def _cell(value: object) -> str:
    return value if isinstance(value, Html) else written(value)
