"""Draw a model as a block, inputs on the left and outputs on the right."""

from __future__ import annotations

import io

from gossamer_models import StepModel

from .arrays import arrays_of


def diagrams(model: StepModel) -> dict[str, bytes]:
    """Return ``diagram.svg`` and ``diagram.png``; the same model and matplotlib give the same bytes."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import FancyBboxPatch

    arrays = {
        causality: [array for array in arrays_of(model) if array.members[0].causality == causality]
        for causality in ("input", "output")
    }
    height = 0.4 * max(map(len, arrays.values())) + 0.4
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
    files = {}
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": model.name, "font.family": "sans-serif"}):
        for kind, metadata in (("svg", {"Date": None}), ("png", {"Software": None})):
            content = io.BytesIO()
            figure.savefig(content, format=kind, metadata=metadata)
            files[f"diagram.{kind}"] = content.getvalue()
    return files
