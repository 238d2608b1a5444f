"""The documentation page of an FMU: its README with the table of variables, and a diagram."""

from __future__ import annotations

from html import escape
from pathlib import Path

from gossamer_models import StepModel

from .arrays import arrays_of
from .catalogue import fmu_folder
from .diagram import diagrams

_BEGIN, _END = "<!-- variables -->", "<!-- end of variables -->"
_STYLE = "body{font:1rem/1.5 sans-serif;max-width:60rem;margin:2rem auto}td,th{padding:.2rem .6rem;text-align:left}"


def documents(model: StepModel, readme: Path | None) -> dict[str, bytes]:
    """Return the files below ``documentation/`` by path; without a README, that of this project's FMU of that name."""
    text = (readme or fmu_folder(model.name) / "README.md").read_text(encoding="utf-8")
    files = {"index.html": page(text, model).encode(), "licenses/license.txt": _license()} | diagrams(model)
    return {f"documentation/{name}": data for name, data in files.items()}


def page(readme: str, model: StepModel) -> str:
    """Return a README with the table of variables as an HTML page."""
    from markdown_it import MarkdownIt

    body = MarkdownIt("commonmark", {"html": True}).enable("table").render(with_variables(readme, model))
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(model.description)}</title>'
        f"<style>{_STYLE}</style></head>\n<body>\n{body}</body></html>\n"
    )


def with_variables(readme: str, model: StepModel) -> str:
    """Return a README with the table of variables brought up to date, between its two markers."""
    before, _, rest = readme.partition(_BEGIN)
    after = rest.partition(_END)[2]
    return f"{before}{_BEGIN}\n{variables_table(model)}\n{_END}{after or chr(10)}"


def variables_table(model: StepModel) -> str:
    """Return the variables as a Markdown table; elements of one array share a row."""
    rows = ["| name | causality | unit | start | range | description |", "|---|---|---|---|---|---|"]
    for array in arrays_of(model):
        first = array.members[0]
        start, low, high = ("" if x is None else f"{x:g}" for x in (first.start, first.minimum, first.maximum))
        span = f"{low} .. {high}" if low or high else ""
        rows.append(f"| {array.label} | {first.causality} | {first.unit} | {start} | {span} | {array.description} |")
    return "\n".join(rows)


def _license() -> bytes:
    from importlib.metadata import files

    return next((file.read_binary() for file in files("gossamer") or [] if file.name == "LICENSE"), b"BSD-3-Clause\n")
