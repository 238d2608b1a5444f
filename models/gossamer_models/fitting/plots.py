"""Pictures of a record and of a model of it: loop, history, residual, and the strain that is recovered.

A picture that is added to ``RECORD_PICTURES`` or ``STRAIN_PICTURES`` is drawn for every record by ``gossamer identify`` and
``gossamer assess``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from gossamer_files.pictures import COLORS, GREY, axes_or_new, legend_below, picture

from ..arrays import Rows, Vector
from .records import Record

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FITTED, PREDICTED = COLORS[:2]
SIZE = (7.0, 5.0)  # of a picture [inch]
Picture = Callable[["Figure"], None]


def plot_loop(record: Record, predicted: Vector, train: Rows, *, ax: Axes | None = None) -> Axes:
    """Draw resistance over strain, measured and modelled."""
    ax = axes_or_new(ax)
    ax.plot(100.0 * record.strain, record.resistance, color=GREY, lw=3.0, label="measured")
    _stretches(ax, 100.0 * record.strain, predicted, train)
    ax.set(xlabel="strain [%]", ylabel=quantity(record), title=record.name)
    legend_below(ax, 3)
    return ax


def plot_history(record: Record, predicted: Vector, train: Rows, *, ax: Axes | None = None) -> Axes:
    """Draw resistance over time, measured and modelled."""
    ax = axes_or_new(ax)
    ax.plot(record.time, record.resistance, color=GREY, lw=3.0, label="measured")
    _stretches(ax, record.time, predicted, train)
    ax.set(xlabel="time [s]", ylabel=quantity(record), title=record.name)
    legend_below(ax, 3)
    return ax


def plot_residual(record: Record, predicted: Vector, train: Rows, *, ax: Axes | None = None) -> Axes:
    """Draw the residual of the model over time [% of the record's range]."""
    ax = axes_or_new(ax)
    _stretches(ax, record.time, 100.0 * (predicted - record.resistance) / np.ptp(record.resistance), train)
    ax.axhline(0.0, color=GREY, lw=0.8)
    ax.set(xlabel="time [s]", ylabel="model - measured [% of range]", title=record.name)
    legend_below(ax, 3)
    return ax


def plot_strain(record: Record, recovered: Vector, train: Rows, *, ax: Axes | None = None) -> Axes:
    """Draw strain over time, applied and recovered from the resistance."""
    ax = axes_or_new(ax)
    ax.plot(record.time, 100.0 * record.strain, color=GREY, lw=3.0, label="applied")
    _stretches(ax, record.time, 100.0 * recovered, train, ("recovered, fitted", "recovered"))
    ax.set(xlabel="time [s]", ylabel="strain [%]", title=record.name)
    legend_below(ax, 3)
    return ax


def plot_strain_residual(record: Record, recovered: Vector, train: Rows, *, ax: Axes | None = None) -> Axes:
    """Draw the error of the recovered strain over time [% of the record's range]."""
    ax = axes_or_new(ax)
    residual = 100.0 * (recovered - record.strain) / np.ptp(record.strain)
    _stretches(ax, record.time, residual, train, ("recovered, fitted", "recovered"))
    ax.axhline(0.0, color=GREY, lw=0.8)
    ax.set(xlabel="time [s]", ylabel="recovered - applied [% of range]", title=record.name)
    legend_below(ax, 3)
    return ax


def quantity(record: Record) -> str:
    """Name what a record measured beside strain, with the unit that its file states: a signal if it is a ratio."""
    return {"ohm": "resistance [ohm]", "1": "signal [1]"}.get(record.unit or "", "resistance [unit not stated]")


def _stretches(ax: Axes, x: Vector, y: Vector, train: Rows, labels: tuple[str, str] = ("fitted", "predicted")) -> None:
    for rows, colour, label in ((train, FITTED, labels[0]), (~train, PREDICTED, labels[1])):
        if rows.any():
            ax.plot(np.where(rows, x, np.nan), np.where(rows, y, np.nan), color=colour, lw=1.0, label=label)


RECORD_PICTURES: dict[str, Callable[..., Axes]] = {
    "loop": plot_loop,
    "history": plot_history,
    "residual": plot_residual,
}
STRAIN_PICTURES: dict[str, Callable[..., Axes]] = {
    "strain": plot_strain,
    "strain_residual": plot_strain_residual,
}


def save_figures(pictures: Mapping[str, Picture], folder: Path, form: str = "png") -> list[Path]:
    """Write pictures; return their paths.

    Parameters
    ----------
    pictures : mapping of str to callable
        Name of the file, without its ending, to what draws into a figure.
    folder : Path
        Where to; made if needed.
    form : {"png", "svg", "pdf"}
        Form of the files.
    """
    paths = []
    for name, draw in pictures.items():
        paths.append(folder / f"{name}.{form}")
        with picture(paths[-1], SIZE) as figure:
            draw(figure)
    return paths


def into_axes(plot: Callable[..., object], *data: object) -> Picture:
    """Return what draws a plot of data into the only axes of a figure."""

    def draw(figure: Figure) -> None:
        plot(*data, ax=figure.subplots())

    return draw


def record_pictures(
    record: Record, predicted: Vector, recovered: Mapping[str, Vector], train: Rows
) -> dict[str, Picture]:
    """Return the pictures of one record by name: resistance as predicted, and strain as recovered by each compensator."""
    stem = Path(record.name).stem
    drawn = {f"{stem}_{name}": into_axes(plot, record, predicted, train) for name, plot in RECORD_PICTURES.items()}
    for compensator, strain in recovered.items():
        kind = f"_{compensator}" if len(recovered) > 1 else ""
        drawn |= {
            f"{stem}_{name}{kind}": into_axes(plot, record, strain, train) for name, plot in STRAIN_PICTURES.items()
        }
    return drawn
