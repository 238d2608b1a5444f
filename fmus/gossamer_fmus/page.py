"""The documentation page of an FMU: its README with the table of variables, and a diagram."""

from __future__ import annotations

import io
from html import escape
from pathlib import Path

from gossamer_files.pictures import style
from gossamer_models import StepModel

from .catalogue import fmu_folder
from .description import arrays_of

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


def diagrams(model: StepModel) -> dict[str, bytes]:
    """Draw the model as a block, inputs on the left and outputs on the right: ``diagram.svg`` and ``diagram.png``.

    The same model and matplotlib give the same bytes.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import FancyBboxPatch

    arrays = {
        causality: [array for array in arrays_of(model) if array.members[0].causality == causality]
        for causality in ("input", "output")
    }
    height = 0.4 * max(map(len, arrays.values())) + 0.4
    files = {}
    with style(), rc_context({"svg.fonttype": "none", "svg.hashsalt": model.name, "figure.constrained_layout.use": False}):
        figure = Figure(figsize=(7.4, height))
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(-0.6, 6.8), ylim=(0.0, height))
        axes.axis("off")
        block = FancyBboxPatch((2.3, 0.15), 1.8, height - 0.3, "round,pad=0,rounding_size=0.06", fc="#f4f6f8", ec="#333344")
        axes.add_patch(block)
        axes.text(3.2, height / 2, model.name, ha="center", va="center", weight="bold")
        for causality, members in arrays.items():
            left = causality == "input"
            for k, array in enumerate(members):
                y = height / 2 + 0.4 * ((len(members) - 1) / 2 - k)
                size = f"[{', '.join(map(str, array.shape))}]" if array.shape else ""
                unit = array.members[0].unit
                text = f"{array.name}{size}" + ("" if unit == "1" else f" [{unit}]")
                tip = 2.3 if left else 4.5
                axes.annotate(
                    "", (tip, y), (tip - 0.4, y), arrowprops={"arrowstyle": "-|>", "color": "#333344", "shrinkA": 0}
                )
                axes.text(1.8 if left else 4.6, y, text, ha="right" if left else "left", va="center")
        for kind, metadata in (("svg", {"Date": None}), ("png", {"Software": None})):
            content = io.BytesIO()
            figure.savefig(content, format=kind, metadata=metadata)
            files[f"diagram.{kind}"] = content.getvalue()
    return files


def _license() -> bytes:
    from importlib.metadata import files

    return next((file.read_binary() for file in files("gossamer") or [] if file.name == "LICENSE"), b"BSD-3-Clause\n")
