"""Tables of a page in HTML."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def table(head: Sequence[str], rows: Iterable[Sequence[object]], caption: str, *, row_heads: bool = True) -> str:
    """Return a table in HTML; the first cell of each row is its heading."""
    lines = [f"<table><caption>{escape(caption)}</caption>"]
    if head:
        lines.append("<thead><tr>" + "".join(f'<th scope="col">{escape(text)}</th>' for text in head) + "</tr></thead>")
    lines.append("<tbody>")
    for first, *rest in rows:
        begin = f'<th scope="row">{escape(str(first))}</th>' if row_heads else f"<td>{escape(str(first))}</td>"
        lines.append(f"<tr>{begin}" + "".join(f"<td>{escape(str(cell))}</td>" for cell in rest) + "</tr>")
    return '<div class="wide">' + "\n".join(lines) + "</tbody></table></div>"


def folded(summary: str, inner: str) -> str:
    """Return HTML that its reader unfolds."""
    return f"<details><summary>{escape(summary)}</summary>{inner}</details>"
