"""How pictures of the page look, and the drawing that several chapters share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

Vector = NDArray[np.float64]

MEASURED, FITTED_STRETCH = "0.55", "0.93"
BLUE, RED, GREEN, ORANGE, SKY = ("#0072B2", "#D55E00", "#009E73", "#E69F00", "#56B4E9")  # Okabe and Ito, colour-blind-safe
COMPENSATORS = {  # colour and marker
    "exact inverse": (RED, "s"),
    "dead band of 3 deviations": (ORANGE, "^"),
    "25-point mean": (GREEN, "D"),
    "estimator": (BLUE, "o"),
}
FOLDER = "identification"
DPI = 110
COLOURS = 96  # of a picture: a third of the bytes, and no difference to the eye
LOOK = {
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.labelsize": 8.5,
    "legend.fontsize": 7.5,
    "lines.linewidth": 1.1,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": True,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
}


@dataclass(frozen=True, kw_only=True)
class Curve:
    """One model's output for a record."""

    label: str
    values: Vector
    colour: str
    style: str = "-"
    width: float = 1.1


def panels(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Figure, Any]:  # noqa: ANN401
    """Make a figure of equal panels in the look of the page."""
    mpl.use("Agg")
    plt.style.use(LOOK)
    return plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **options)


def save(figure: Figure, pictures: Path, name: str) -> str:
    """Write a picture as small PNG with the same bytes every time; return its path as the page links it."""
    pictures.mkdir(parents=True, exist_ok=True)
    raw = BytesIO()
    figure.savefig(raw, dpi=DPI, metadata={"Software": None})
    plt.close(figure)
    with Image.open(raw) as image:
        few = image.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    few.save(pictures / f"{name}.png", optimize=True)
    return f"{pictures.name}/{name}.png"


def show(link: str, caption: str) -> list[str]:
    """Return the lines of a picture with its caption."""
    return ["", f"![{caption.split(':')[0]}]({link})", "", f"*{caption}*", ""]


def compare(
    axes: Sequence[Axes | None],
    time: Vector,
    strain: Vector,
    measured: Vector,
    curves: Sequence[Curve],
    *,
    unit: str = "ohm",
    quantity: str = "change of resistance",
    fitted: tuple[float, float] | None = None,
    residual_in: str | None = None,
    ends: float = 1.0,
) -> None:
    """Draw the loop, the history and what the models leave on three axes.

    Parameters
    ----------
    axes : sequence of Axes or None
        Three; None leaves one out.
    time, strain, measured : ndarray, shape (m,)
        Time [s], strain [1], output in ``unit``.
    curves : sequence of Curve
        Models.
    unit, quantity : str
        Of the output.
    fitted : tuple of float or None
        Stretch [s] that was fitted, drawn grey.
    residual_in : str or None
        Unit of what is left if it is not ``unit``: "% of range".
    ends : float
        Part of the record, at its beginning and at its end, of which the loop is drawn [1].
    """
    loop, history, left = axes
    width = 2.2 if measured.size < 2000 else 1.0
    factor = 100.0 / float(np.ptp(measured)) if residual_in else 1.0
    place = np.arange(measured.size) / measured.size
    drawn = np.where((place <= ends) | (place >= 1.0 - ends), 100.0 * strain, np.nan)
    for ax, x in ((loop, drawn), (history, time)):
        if ax is None:
            continue
        ax.plot(x, measured, color=MEASURED, lw=width, label="measured")
        for curve in curves:
            ax.plot(x, curve.values, color=curve.colour, ls=curve.style, lw=curve.width, label=curve.label)
        ax.set(xlabel="strain [%]" if ax is loop else "time [s]", ylabel=f"{quantity} [{unit}]")
    if left is not None:
        for curve in curves:
            values = factor * (curve.values - measured)
            left.plot(time, values, color=curve.colour, ls=curve.style, lw=0.8, label=curve.label)
        left.axhline(0.0, color="0.3", lw=0.6)
        left.set(xlabel="time [s]", ylabel=f"model - measured [{residual_in or unit}]")
    if fitted is not None:
        for ax in (history, left):
            if ax is not None:
                ax.axvspan(*fitted, color=FITTED_STRETCH, zorder=0, lw=0)
