"""Pictures of a record and of a model of it: loop, history, residual.

A picture that is added to ``RECORD_PICTURES`` is drawn for every record by ``gossamer identify``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

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


def axes_for(ax: Axes | None) -> Axes:
    """Return the axes, or new ones for None."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(7, 5), layout="constrained")[1]


def _stretches(ax: Axes, x: Vector, y: Vector, train: Rows) -> None:
    for rows, colour, label in ((train, FITTED, "fitted"), (~train, PREDICTED, "predicted")):
        if rows.any():
            ax.plot(np.where(rows, x, np.nan), np.where(rows, y, np.nan), color=colour, lw=1.0, label=label)


RECORD_PICTURES: dict[str, Callable[..., Axes]] = {
    "loop": plot_loop,
    "history": plot_history,
    "residual": plot_residual,
}
