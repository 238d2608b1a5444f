"""Put content, words and the library of the pictures into one file.

The library, plotly.js, and the data are packed by gzip, which every browser since 2023 unpacks. The page asks for nothing
from outside: its policy forbids it.
"""

from __future__ import annotations

import base64
import gzip
import json
import math
from functools import cache
from html import escape
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import xarray as xr
from gossamer_files import replacing

from ...errors import ResultsError, writing
from . import facts
from .content import collect, windows_of
from .verdict import make_verdict

PAGE = "report.html"
ASSETS = Path(__file__).with_name("assets")
SCRIPTS = ("unpack.js", "figures.js", "membrane.js", "surface.js", "damage.js", "sensors.js", "main.js")


def write_report(data: xr.Dataset, folder: Path) -> Path:
    """Write ``report.html`` from results; return its path.

    Parameters
    ----------
    data : xarray.Dataset
        Results, for instance of ``load_results``; they may be longer than memory.
    folder : Path
        Where to write; ``watch.json`` is read from there.

    Raises
    ------
    ResultsError
        There is not a single row, or the folder cannot be written; a page that was there is as it was.
    """
    if not data.sizes.get("time", 0):
        msg = f"the results for {folder} have no row. Run the scenario again."
        raise ResultsError(msg)
    text = _page(data, folder)
    path = folder / PAGE
    with writing(path, ResultsError), replacing(path) as new:
        new.write_text(text, encoding="utf-8")
    return path


def _page(data: xr.Dataset, folder: Path) -> str:
    ended = windows_of(data)
    content = collect(data, ended, folder)
    verdict = make_verdict(data, ended, content["watch"])
    title = str(data.attrs.get("title") or data.attrs.get("scenario_name") or "A run")
    template = Template((ASSETS / "page.html").read_text(encoding="utf-8"))
    return template.substitute(
        title=escape(title),
        kind=verdict.kind,
        verdict=escape(verdict.sentence),
        more="".join(f"<li>{escape(sentence)}</li>" for sentence in verdict.more),
        style=(ASSETS / "page.css").read_text(encoding="utf-8"),
        script="\n".join((ASSETS / name).read_text(encoding="utf-8") for name in SCRIPTS),
        library=_library(),
        data=_packed(json.dumps(_finite(content), default=_plain, allow_nan=False).encode()),
        run=facts.run_table(data, content),
        components=facts.components(data),
        connections=facts.connections(data),
        scenario=facts.scenario(data),
        messages=facts.messages(folder),
        judgements=facts.judgement_tables(ended),
        constants=_constants(content["constant"]),
        thinning=_thinning(content),
    )


def _constants(values: dict[str, float]) -> str:
    """Return a table of recorded variables that never changed."""
    if not values:
        return ""
    inner = facts.table(("variable", "value"), [(n, f"{v:.9g}") for n, v in values.items()], "Constant during the run")
    return f"<details><summary>{len(values)} recorded variables were constant</summary>{inner}</details>"


def _thinning(content: dict[str, Any]) -> str:
    """Say which points the page holds."""
    frames = f"The slider stops at {len(content['frames'])} recorded instants, evenly spaced."
    if content["stride"] == 1:
        return f"Curves over time show every recorded point. {frames}"
    return (
        f"Of the {content['rows']} recorded points, curves over time show the smallest and the largest of every "
        f"{content['stride']} that follow each other, so that no peak is lost. {frames} All numbers are of all points."
    )


@cache
def _library() -> str:
    """Return plotly.js, packed; the package of Python around it is not imported."""
    spec = find_spec("plotly")
    if spec is None or spec.origin is None:
        msg = "the page needs plotly, which is not installed. Install it with 'pip install plotly'."
        raise ResultsError(msg)
    return _packed((Path(spec.origin).parent / "package_data" / "plotly.min.js").read_bytes())


def _packed(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 6, mtime=0)).decode()


def _finite(value: Any) -> Any:  # noqa: ANN401
    """Return a value with null for numbers that JSON does not know."""
    if isinstance(value, dict):
        return {str(name): _finite(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _plain(value: Any) -> Any:  # noqa: ANN401
    """Return what JSON can hold: of an array its shape, and its numbers as bytes; times keep all digits."""
    if isinstance(value, np.ndarray):
        ordered = np.ascontiguousarray(value)
        if ordered.dtype.kind in "iu":
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
