"""Plots of the sensors and their compensators."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from gossamer_files.pictures import COLORS, GREY, axes_or_new
from numpy.typing import NDArray

from ...errors import ResultsError
from ...words import duration
from ..dataset import compensators, find, need, sensors
from ..judgements import windows
from .axes import plain_axis, short_axis, time_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

LEAST_ERROR = 1e-9  # [%] or [1]; less is drawn as that
LEAST_RANGE = 1e-6  # [1] errors in shares of a smaller range say nothing


def plot_sensor_loop(data: xr.Dataset, sensor: int = 1, *, ax: Axes | None = None, bar: bool = True) -> Axes:
    """Draw resistance against strain of one sensor, coloured by time: hysteresis and drift.

    Of more than two windows of the detector the first and the last are drawn. The colours are those of the whole run;
    ``bar`` adds their scale.
    """
    from matplotlib.collections import LineCollection

    component = _pick(sensors(data), sensor, "sensor")
    strains, resistance = need(data, f"{find(data, 'membrane')}.strain", f"{component}.resistance")
    ax, time = axes_or_new(ax), data["time"].to_numpy()
    points = np.column_stack([_element(strains, sensor), resistance.to_numpy()])
    ends: list[float] = []
    with suppress(ResultsError):  # there may be no detector
        ends = [window.time for window in windows(data)]
    many = len(ends) > 2
    drawn = (time[1:] <= ends[0]) | ((time[1:] > ends[-2]) & (time[1:] <= ends[-1])) if many else time[1:] >= time[0]
    lines = LineCollection(list(np.stack([points[:-1], points[1:]], axis=1)[drawn]), cmap="viridis", linewidths=1.0)
    lines.set_array(time[1:][drawn])
    lines.set_clim(float(time[0]), float(time[-1]))
    ax.add_collection(lines)
    ax.autoscale_view()
    plain_axis(ax, "x")
    plain_axis(ax, "y")
    title = f"Sensor {sensor}" + (", first and last window" if many else "")
    ax.set(xlabel="strain [1]", ylabel="resistance [ohm]", title=title)
    if bar:
        ax.figure.colorbar(lines, ax=ax, label="time [s]")
    return ax


def plot_strain(data: xr.Dataset, sensor: int = 1, *, ax: Axes | None = None) -> Axes:
    """Draw true and compensated strain at one sensor over time: a broad line, and on it the latter without its delay."""
    time, true, compensated = _true_and_compensated(data, sensor)
    ax, late = axes_or_new(ax), float(data["time"][len(data["time"]) - len(time)] - data["time"][0])
    label = f"compensated, drawn {duration(late)} earlier" if late else "compensated"
    ax.plot(time, true, color=GREY, lw=3.2, label="true")
    ax.plot(time, compensated, color=COLORS[1], lw=0.8, label=label)
    error, is_percent = _error(true, compensated)
    rms = float(np.sqrt(np.mean(error**2)))
    size = "< 1e-9" if rms < LEAST_ERROR else f"{rms:.2g}" if rms < 99.5 else f"{rms:.0f}"
    shown = size + (" % of range" if is_percent else " in strain")
    ax.set(xlabel="time [s]", ylabel="strain [1]", title=f"Sensor {sensor}: RMS error {shown}")
    ax.legend(loc="upper right", ncols=2, borderaxespad=0.1)
    ax.margins(x=0.0)
    short_axis(ax, "y")
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.15 * (high - low))
    time_axis(ax)
    return ax


def plot_strain_error(data: xr.Dataset, sensor: int = 1, *, ax: Axes | None = None) -> Axes:
    """Draw the error of the compensated strain at one sensor over time, in percent of the true range, on a log scale."""
    time, true, compensated = _true_and_compensated(data, sensor)
    error, is_percent = _error(true, compensated)
    ax, size = axes_or_new(ax), np.maximum(np.abs(error), LEAST_ERROR)
    ax.plot(time, size, color=COLORS[0], lw=0.8)
    ax.set(xlabel="time [s]", ylabel="error [%]" if is_percent else "error [1]", yscale="log")
    if (known := size[np.isfinite(size)]).size:
        ax.set_ylim(0.5 * float(np.quantile(known, 0.02)), 2.0 * float(known.max()))
    ax.margins(x=0.0)
    time_axis(ax)
    return ax


def _sensors(data: xr.Dataset, figure: Figure) -> None:
    drawn = sensors(data)
    rows, columns = _rows_and_columns(drawn, "sensor")
    axes = figure.subplots(rows, columns, squeeze=False)
    for number, ax in zip(drawn, axes.flat, strict=False):
        plot_sensor_loop(data, number, ax=ax, bar=False)
    for ax in axes.flat[len(drawn) :]:
        ax.set_axis_off()
    figure.colorbar(axes[0, 0].collections[0], ax=axes, label="time [s]", shrink=0.6, aspect=40)


def _strains(data: xr.Dataset, figure: Figure) -> None:
    for number, part in _parts(figure, compensators(data), "compensator"):
        upper, lower = part.subplots(2, 1, sharex=True, height_ratios=(5, 2))
        plot_strain(data, number, ax=upper).set(xlabel="")
        plot_strain_error(data, number, ax=lower)


def _parts(figure: Figure, components: dict[int, str], role: str) -> Iterator[tuple[int, SubFigure]]:
    """Divide a page among components; give their numbers and parts."""
    parts = figure.subfigures(*_rows_and_columns(components, role), squeeze=False)
    return zip(components, np.ravel(parts), strict=False)


def _rows_and_columns(components: dict[int, str], role: str) -> tuple[int, int]:
    """Return how to divide a page among components, of which there must be one."""
    _pick(components, min(components, default=1), role)
    columns = min(len(components), 2)
    return math.ceil(len(components) / columns), columns


def _element(values: xr.DataArray, number: int) -> NDArray[np.float64]:
    """Return element ``number`` (from 1) of an array over time; raise ``ResultsError`` if it was not recorded."""
    if number not in values[values.dims[1]]:
        msg = (
            f"the results lack {values.name}[{number}]. Add it to [record] variables in the scenario and run it again."
        )
        raise ResultsError(msg)
    return values.sel({values.dims[1]: number}).to_numpy()


def _pick(components: dict[int, str], number: int, role: str) -> str:
    """Return the component at a sensor's place."""
    if number not in components:
        msg = f"there is no {role} {number}; there are {', '.join(map(str, components)) or 'none'}."
        raise ResultsError(msg)
    return components[number]


def _error(true: NDArray[np.float64], compensated: NDArray[np.float64]) -> tuple[NDArray[np.float64], bool]:
    """Return the error of a strain, and whether it is in % of the range of the true one, which may hardly change."""
    span = float(np.ptp(true))
    is_percent = span >= LEAST_RANGE
    return (compensated - true) * (100.0 / span if is_percent else 1.0), is_percent


def _true_and_compensated(
    data: xr.Dataset, sensor: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return time, true and compensated strain then.

    A compensator that states its ``delay`` is compared with the strain of that time.
    """
    component = _pick(compensators(data), sensor, "compensator")
    strains, compensated = need(data, f"{find(data, 'membrane')}.strain", f"{component}.strain")
    time, true = data["time"].to_numpy(), _element(strains, sensor)
    delay = float(data[f"{component}.delay"][-1]) if f"{component}.delay" in data else 0.0
    late = int(np.searchsorted(time, time[0] + delay - 1e-9)) if delay > 0.0 else 0
    late = late if late < len(time) - 1 else 0
    whole = len(time) - late
    return time[:whole], true[:whole], compensated.to_numpy()[late:]


PAGES = {"strains": (_strains, (11.0, 7.5)), "sensors": (_sensors, (9.0, 7.0))}
