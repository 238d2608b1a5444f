"""Put words, tables, the data of pictures and the library that draws them into one file.

The library, plotly.js, and the data are packed by gzip, which every browser since 2023 unpacks. The page asks for nothing
from outside: its policy forbids it.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from html import escape
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Any, Literal
from urllib.parse import quote

import numpy as np
from gossamer_files import as_json, write_text
from gossamer_files.charts import Chart
from gossamer_files.tables import TableText

from ..errors import ResultsError, writing

PAGE = "report.html"
ASSETS = Path(__file__).with_name("assets")
SHARED = ("unpack.js", "figures.js", "charts.js", "access.js")

Kind = Literal["damage", "healthy", "invalid", "none"]
NO_BREAK = "\N{NO-BREAK SPACE}"
UNITS = ("%", "s", "ms", "h", "min", "Hz", "kHz", "Pa", "kPa", "GPa", "ohm", "m", "mm", "kg", "N", "rad", "MB", "GB")
_BEFORE_UNIT = re.compile(rf"(?<=\d) (?=(?:{'|'.join(UNITS)})(?!\w))")
_AROUND_SIGN = re.compile(r"(?<=\d) ± (?=\d)|(?<=±) (?=\d)|(?<=\bt) = (?=\d)")


@dataclass(frozen=True, kw_only=True)
class Page:
    """What stands on a page, from the top to the end.

    Attributes
    ----------
    title : str
        Heading.
    kind : {"damage", "healthy", "invalid", "none"}
        What the verdict says: bad, good, not to be trusted, neither. Its colour follows.
    sentence : str
        The verdict.
    more : sequence of str
        What else a reader must know, a sentence each.
    charts : sequence of Chart
        Pictures, one after the other.
    content : mapping
        What scripts need beside; arrays may stand in it, and numbers that are not finite are null on the page.
    scripts : sequence of Path
        JavaScript files, for what a chart cannot say.
    controls : str
        HTML above the pictures.
    facts : sequence of str or TableText
        HTML below the pictures, for instance of ``table``, and tables; what is empty is left out.
    how : str
        How the pictures were made, a sentence or two.
    """

    title: str
    kind: Kind = "none"
    sentence: str
    more: Sequence[str] = ()
    charts: Sequence[Chart] = ()
    content: Mapping[str, Any] = field(default_factory=dict)
    scripts: Sequence[Path] = ()
    controls: str = ""
    facts: Sequence[str | TableText] = ()
    how: str = ""


def write_page(page: Page, path: Path) -> Path:
    """Write a page that opens from disk, and its folder if need be; return its path.

    Raises
    ------
    ResultsError
        The file cannot be written; a page that was there is as it was.
    """
    words = ("title", "note", "result")
    charts = [vars(chart) | {name: unbroken(getattr(chart, name)) for name in words} for chart in page.charts]
    content = as_json({"charts": charts, **page.content}, _Arrays())
    text = Template((ASSETS / "page.html").read_text(encoding="utf-8")).substitute(
        title=written(page.title),
        kind=page.kind,
        verdict=written(page.sentence),
        more="".join(f"<li>{written(sentence)}</li>" for sentence in page.more),
        style=(ASSETS / "page.css").read_text(encoding="utf-8"),
        contents=_contents(page),
        controls=page.controls,
        facts="\n".join(filter(None, (each if isinstance(each, str) else on_page(each) for each in page.facts))),
        how=written(page.how),
        library=_library(),
        data=_packed(json.dumps(content, allow_nan=False).encode()),
        script="\n".join(
            each.read_text(encoding="utf-8")
            for each in (*(ASSETS / name for name in SHARED), *page.scripts, ASSETS / "main.js")
        ),
    )
    with writing(path, ResultsError):
        write_text(path, text)
    return path


def _contents(page: Page) -> str:
    """Return links to the parts of a page, where these are several."""
    sections = [name for name in dict.fromkeys(chart.section for chart in page.charts) if name]
    places = [(f"section-{number}", name) for number, name in enumerate(sections, start=1)]
    places += [("what-happened", "What happened"), ("how", "How the pictures were made")]
    links = "".join(f'<li><a href="#{place}">{written(name)}</a></li>' for place, name in places)
    return f'<nav aria-label="Contents"><ul>{links}</ul></nav>' if len(sections) > 1 else ""


@cache
def _library() -> str:
    """Return plotly.js, packed; the package of Python around it is not imported."""
    spec = find_spec("plotly")
    if spec is None or spec.origin is None:
        msg = "the page needs plotly, which is not installed. Install it with 'pip install plotly'."
        raise ResultsError(msg)
    path = Path(spec.origin).parent / "package_data" / "plotly.min.js"
    return _packed(_opened(path.read_text(encoding="utf-8")).encode())


def _opened(library: str) -> str:
    """Return plotly.js without the function around it, for a browser reads a function within a function twice: 0.3 s."""
    head, begin, rest = library.partition('"use strict";var Plotly=(()=>{')
    body, end, _ = rest.rpartition("return Plotly;")
    licence, comment_end, _ = head.partition("*/")
    return f'{licence}{comment_end}"use strict";var Plotly=(function(){{{body}' if begin and end else library


def _packed(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 6, mtime=0)).decode()


class _Arrays:
    """Return what JSON can hold: of an array its shape and its numbers as bytes, and where it stands again its number.

    Times keep all digits.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[object, ...], int] = {}

    def __call__(self, value: Any) -> Any:  # noqa: ANN401
        if isinstance(value, np.ndarray):
            ordered = np.ascontiguousarray(value)
            if ordered.dtype.kind in "iuUO":
                return value.tolist()
            exact = ordered.ndim == 1 and ordered.size > 1 and bool((np.diff(ordered) > 0.0).all())  # as times are
            data, kind = ordered.astype("<f8" if exact else "<f4").tobytes(), "f8" if exact else "f4"
            name = (data, kind, value.shape)
            if name in self._known:
                return {"same": self._known[name]}
            self._known[name] = len(self._known)
            return {"kind": kind, "shape": list(value.shape), "bytes": base64.b64encode(data).decode()}
        if isinstance(value, np.generic):
            return value.item()
        msg = f"{type(value)} cannot stand on a page"
        raise TypeError(msg)


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
