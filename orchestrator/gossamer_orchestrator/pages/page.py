"""Put words, tables, the data of pictures and the library that draws them into one file.

The library, plotly.js, and the data are packed by gzip, which every browser since 2023 unpacks. The page asks for nothing
from outside: its policy forbids it.
"""

from __future__ import annotations

import base64
import gzip
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Any, Literal

import numpy as np
from gossamer_files import replacing

from ..errors import ResultsError, writing
from .words import written

PAGE = "report.html"
ASSETS = Path(__file__).with_name("assets")
SHARED = ("unpack.js", "figures.js", "access.js")

Kind = Literal["damage", "healthy", "invalid", "none"]


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
    content : mapping
        What the scripts draw; arrays may stand in it, and numbers that are not finite are null on the page.
    scripts : sequence of Path
        JavaScript files; one of them declares ``addPictures()``.
    controls : str
        HTML above the pictures.
    facts : str
        HTML below the pictures, for instance of ``table``.
    how : str
        How the pictures were made, a sentence or two.
    """

    title: str
    kind: Kind = "none"
    sentence: str
    more: Sequence[str] = ()
    content: Mapping[str, Any] = field(default_factory=dict)
    scripts: Sequence[Path] = ()
    controls: str = ""
    facts: str = ""
    how: str = ""


def write_page(page: Page, path: Path) -> Path:
    """Write a page that opens from disk, and its folder if need be; return its path.

    Raises
    ------
    ResultsError
        The file cannot be written; a page that was there is as it was.
    """
    text = Template((ASSETS / "page.html").read_text(encoding="utf-8")).substitute(
        title=written(page.title),
        kind=page.kind,
        verdict=written(page.sentence),
        more="".join(f"<li>{written(sentence)}</li>" for sentence in page.more),
        style=(ASSETS / "page.css").read_text(encoding="utf-8"),
        controls=page.controls,
        facts=page.facts,
        how=written(page.how),
        library=_library(),
        data=_packed(json.dumps(_finite(page.content), default=_plain, allow_nan=False).encode()),
        script="\n".join(
            each.read_text(encoding="utf-8")
            for each in (*(ASSETS / name for name in SHARED), *page.scripts, ASSETS / "main.js")
        ),
    )
    with writing(path, ResultsError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as new:
            new.write_text(text, encoding="utf-8")
    return path


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


def _finite(value: Any) -> Any:  # noqa: ANN401
    """Return a value with null for numbers that JSON does not know."""
    if isinstance(value, Mapping):
        return {str(name): _finite(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _plain(value: Any) -> Any:  # noqa: ANN401
    """Return what JSON can hold: of an array its shape, and its numbers as bytes; times keep all digits."""
    if isinstance(value, np.ndarray):
        ordered = np.ascontiguousarray(value)
        if ordered.dtype.kind in "iuU":
            return value.tolist()
        steps = np.diff(ordered.ravel()) if ordered.ndim == 1 else np.zeros(1)
        exact = ordered.ndim == 1 and ordered.size > 1 and bool((steps > 0.0).all())  # as times are
        kind = "<f8" if exact else "<f4"
        packed = base64.b64encode(ordered.astype(kind).tobytes()).decode()
        return {"kind": kind[1:], "shape": list(value.shape), "bytes": packed}
    if isinstance(value, np.generic):
        return value.item()
    msg = f"{type(value)} cannot stand on a page"
    raise TypeError(msg)
