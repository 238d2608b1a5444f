"""Show a result in a notebook: sentences, tables and a picture as HTML that needs nothing else."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from gossamer_files.pictures import picture
from rich.console import Console

WIDTH = 160  # characters of a table
_CODE = '<pre style="white-space:pre;overflow-x:auto;line-height:normal">{code}</pre>'


def as_html(sentences: Sequence[str], print_tables: Callable[[Console], None], picture: bytes | None, alt: str) -> str:
    """Return HTML: the first sentence in bold, the others below it, tables as ``rich`` prints them, a PNG picture.

    Parameters
    ----------
    sentences : sequence of str
        What was found; at least one.
    print_tables : callable
        Prints the tables on the console that it gets.
    picture : bytes or None
        A PNG file.
    alt : str
        The picture in words.
    """
    console = Console(record=True, file=io.StringIO(), width=WIDTH, force_jupyter=False, force_terminal=False)
    print_tables(console)
    parts = [f"<p><strong>{escape(sentences[0])}</strong></p>", *(f"<p>{escape(each)}</p>" for each in sentences[1:])]
    if console.file.getvalue().strip():  # type: ignore[attr-defined]
        parts.append(console.export_html(inline_styles=True, code_format=_CODE))
    if picture is not None:
        coded = base64.b64encode(picture).decode()
        parts.append(f'<img style="max-width:100%" alt="{escape(alt)}" src="data:image/png;base64,{coded}">')
    return f"<div>{''.join(parts)}</div>"


def first_of(paths: Iterable[Path]) -> bytes | None:
    """Return the first of some files that is there."""
    path = next((path for path in paths if path.is_file()), None)
    return None if path is None else path.read_bytes()


def first_loop(files: Iterable[Path]) -> bytes | None:
    """Return the first picture of a loop, resistance over strain, among the files of a fit."""
    return first_of(path for path in files if path.name.endswith("_loop.png"))


def draw_png(draw: Callable[[Any], object], size: tuple[float, float]) -> bytes:
    """Return what is drawn into the axes of a new figure of a size [inch] as a PNG file."""
    target = io.BytesIO()
    with picture(target, size) as figure:
        draw(figure.subplots())
    return target.getvalue()


def page_of(files: Sequence[Path]) -> Path | None:
    """Return the page among files, if there is one."""
    from gossamer_orchestrator.pages import PAGE

    return next((path for path in files if path.name == PAGE), None)
