"""Plots of the sensors and their compensators."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import ResultsError
from ..judgements import windows
from ..roles import compensators, find, need, sensors
from .axes import COLORS, axes_or_new, time_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

LEAST_ERROR = 1e-9  # [%] less is drawn as that


def plot_sensor_loop(data: xr.Dataset, sensor: int = 1, *, ax: Axes | None = None) -> Axes:
    """Draw resistance against strain of one sensor, coloured by time: hysteresis and drift.

    Of more than two windows of the detector the first and the last are drawn.
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
    ax.add_collection(lines)
    ax.autoscale_view()
    title = f"Sensor {sensor}" + (", first and last window" if many else "")
    ax.set(xlabel="strain [1]", ylabel="resistance [Ω]", title=title)
    ax.figure.colorbar(lines, ax=ax, label="time [s]")
    return ax


def plot_strain(data: xr.Dataset, sensor: int = 1, *, ax: Axes | None = None) -> Axes:
    """Draw true and compensated strain at one sensor over time, the latter without its recorded delay."""
    time, true, compensated, span = _true_and_compensated(data, sensor)
    ax, late = axes_or_new(ax), float(data["time"][len(data["time"]) - len(time)] - data["time"][0])
    label = f"compensated, drawn {1e3 * late:.3g} ms earlier" if late else "compensated"
    ax.plot(time, true, color="black", lw=1.6, label="true")
    ax.plot(time, compensated, color=COLORS[1], lw=1.0, ls="--", label=label)
    percent = 100.0 * float(np.sqrt(np.mean((compensated - true) ** 2))) / span
    shown = "< 1e-9" if percent < 1e-9 else f"{percent:.2g}"
    ax.set(xlabel="time [s]", ylabel="strain [1]", title=f"Sensor {sensor}: RMS error {shown} % of range")
    ax.legend(loc="upper right", ncols=2, borderaxespad=0.1)
    ax.margins(x=0.0)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.15 * (high - low))
    time_axis(ax)
    return ax


def plot_strain_error(data: xr.Dataset, sensor: int = 1, *, ax: Axes | None = None) -> Axes:
    """Draw the error of the compensated strain at one sensor over time, in percent of the true range, on a log scale."""
    time, true, compensated, span = _true_and_compensated(data, sensor)
    ax, percent = axes_or_new(ax), 100.0 * np.abs(compensated - true) / span
    ax.plot(time, np.maximum(percent, LEAST_ERROR), color=COLORS[0], lw=0.8)
    top = max(2.0 * float(percent.max()), 10.0 * LEAST_ERROR)
    low = max(0.5 * float(np.quantile(percent, 0.02)), 1e-4 * top, 0.5 * LEAST_ERROR)
    ax.set(xlabel="time [s]", ylabel="|error| [%]", yscale="log", ylim=(low, top))
    ax.margins(x=0.0)
    time_axis(ax)
    return ax


def _sensors(data: xr.Dataset, figure: Figure) -> None:
    for number, part in _parts(figure, sensors(data), "sensor"):
        plot_sensor_loop(data, number, ax=part.subplots())


def _strains(data: xr.Dataset, figure: Figure) -> None:
    for number, part in _parts(figure, compensators(data), "compensator"):
        upper, lower = part.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        plot_strain(data, number, ax=upper).set(xlabel="")
        plot_strain_error(data, number, ax=lower)


def _parts(figure: Figure, components: dict[int, str], role: str) -> Iterator[tuple[int, SubFigure]]:
    """Divide a page among components; give their numbers and parts."""
    _pick(components, min(components, default=1), role)
    columns = min(len(components), 2)
    parts = figure.subfigures(math.ceil(len(components) / columns), columns, squeeze=False)
    return zip(components, np.ravel(parts), strict=False)


def _element(values: xr.DataArray, number: int) -> NDArray[np.float64]:
    """Return element ``number`` (from 1) of an array over time."""
    return values.sel({values.dims[1]: number}).to_numpy()


def _pick(components: dict[int, str], number: int, role: str) -> str:
    """Return the component at a sensor's place."""
    if number not in components:
        msg = f"there is no {role} {number}; there are {', '.join(map(str, components)) or 'none'}."
        raise ResultsError(msg)
    return components[number]


def _true_and_compensated(
    data: xr.Dataset, sensor: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Return time, true and compensated strain then, and the range of the true one, not zero.

    A compensator that states its ``delay`` is compared with the strain of that time.
    """
    component = _pick(compensators(data), sensor, "compensator")
    strains, compensated = need(data, f"{find(data, 'membrane')}.strain", f"{component}.strain")
    time, true = data["time"].to_numpy(), _element(strains, sensor)
    delay = float(data[f"{component}.delay"][-1]) if f"{component}.delay" in data else 0.0
    late = int(np.searchsorted(time, time[0] + delay - 1e-9)) if delay > 0.0 else 0
    late = late if late < len(time) - 1 else 0
    whole = len(time) - late
    return time[:whole], true[:whole], compensated.to_numpy()[late:], float(np.ptp(true)) or 1.0


PAGES = {"sensors": (_sensors, (9.0, 7.0)), "strains": (_strains, (11.0, 7.5))}
