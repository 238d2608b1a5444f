"""Pictures of a record and of a model of it: loop, history, residual, and the strain that is recovered.

A picture that is added to ``RECORD_PICTURES`` or ``STRAIN_PICTURES`` is drawn for every record by ``gossamer identify`` and
``gossamer assess``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gossamer_files import replacing

from ..arrays import Rows, Vector
from .records import Record

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MEASURED, FITTED, PREDICTED = "0.65", "tab:blue", "tab:orange"


def plot_loop(record: Record, predicted: Vector, train: Rows, *, ax: Axes | None = None) -> Axes:
    """Draw resistance over strain, measured and modelled."""
    ax = axes_for(ax)
    ax.plot(100.0 * record.strain, record.resistance, color=MEASURED, lw=3.0, label="measured")
    _stretches(ax, 100.0 * record.strain, predicted, train)
    ax.set(xlabel="strain [%]", ylabel="resistance [ohm], or signal", title=record.name)
    ax.legend()
    return ax


def plot_history(record: Record, predicted: Vector, train: Rows, *, ax: Axes | None = None) -> Axes:
    """Draw resistance over time, measured and modelled."""
    ax = axes_for(ax)
    ax.plot(record.time, record.resistance, color=MEASURED, lw=3.0, label="measured")
    _stretches(ax, record.time, predicted, train)
    ax.set(xlabel="time [s]", ylabel="resistance [ohm], or signal", title=record.name)
    ax.legend()
    return ax


def plot_residual(record: Record, predicted: Vector, train: Rows, *, ax: Axes | None = None) -> Axes:
    """Draw the residual of the model over time [% of the record's range]."""
    ax = axes_for(ax)
    _stretches(ax, record.time, 100.0 * (predicted - record.resistance) / np.ptp(record.resistance), train)
    ax.axhline(0.0, color=MEASURED, lw=0.8)
    ax.set(xlabel="time [s]", ylabel="model - measured [% of range]", title=record.name)
    ax.legend()
    return ax


def plot_strain(record: Record, recovered: Vector, train: Rows, *, ax: Axes | None = None) -> Axes:
    """Draw strain over time, applied and recovered from the resistance."""
    ax = axes_for(ax)
    ax.plot(record.time, 100.0 * record.strain, color=MEASURED, lw=3.0, label="applied")
    _stretches(ax, record.time, 100.0 * recovered, train, ("recovered, fitted", "recovered"))
    ax.set(xlabel="time [s]", ylabel="strain [%]", title=record.name)
    ax.legend()
    return ax


def plot_strain_residual(record: Record, recovered: Vector, train: Rows, *, ax: Axes | None = None) -> Axes:
    """Draw the error of the recovered strain over time [% of the record's range]."""
    ax = axes_for(ax)
    residual = 100.0 * (recovered - record.strain) / np.ptp(record.strain)
    _stretches(ax, record.time, residual, train, ("recovered, fitted", "recovered"))
    ax.axhline(0.0, color=MEASURED, lw=0.8)
    ax.set(xlabel="time [s]", ylabel="recovered - applied [% of range]", title=record.name)
    ax.legend()
    return ax


def axes_for(ax: Axes | None) -> Axes:
    """Return the axes, or new ones for None."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(7, 5), layout="constrained")[1]


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


def save_figures(pictures: Mapping[str, Callable[[], Any]], folder: Path) -> list[Path]:
    """Write pictures as PNG files; return their paths.

    Parameters
    ----------
    pictures : mapping of str to callable
        Name of the file, without its ending, to what draws the axes.
    folder : Path
        Where to; made if needed.
    """
    import matplotlib as mpl

    if not isinstance(dict.get(mpl.rcParams, "backend"), str):  # none is chosen yet: look for no display
        mpl.use("Agg")  # a notebook has chosen, and goes on showing its own pictures
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    for name, plot in pictures.items():
        ax = plot()
        with replacing(folder / f"{name}.png") as path:
            ax.figure.savefig(path, dpi=130)
        plt.close(ax.figure)
    return [folder / f"{name}.png" for name in pictures]


def record_pictures(
    record: Record, predicted: Vector, recovered: Mapping[str, Vector], train: Rows
) -> dict[str, Callable[[], Any]]:
    """Return the pictures of one record by name: resistance as predicted, and strain as recovered by each compensator."""
    stem = Path(record.name).stem
    drawn: dict[str, Callable[[], Any]] = {}
    drawn |= {f"{stem}_{name}": partial(plot, record, predicted, train) for name, plot in RECORD_PICTURES.items()}
    for compensator, strain in recovered.items():
        kind = f"_{compensator}" if len(recovered) > 1 else ""
        drawn |= {
            f"{stem}_{name}{kind}": partial(plot, record, strain, train) for name, plot in STRAIN_PICTURES.items()
        }
    return drawn
