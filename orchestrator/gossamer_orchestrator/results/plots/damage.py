"""Plots of damage, true and as the detector estimates it."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr
from gossamer_files.pictures import COLORS, GREY, axes_or_new, legend_below
from numpy.typing import NDArray

from ...errors import ResultsError
from ..dataset import find, need
from ..judgements import doubts, judge, true_damage, windows
from .axes import side, time_axis

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Page = tuple[Callable[[xr.Dataset, "Figure"], None], tuple[float, float]]


def plot_damage_map(
    data: xr.Dataset, which: Literal["true", "estimated"] = "estimated", *, ax: Axes | None = None
) -> Axes:
    """Draw damage of the zones at the last valid judgement as numbers: zone 1 at the origin, x to the right.

    Parameters
    ----------
    data : xarray.Dataset
        Results.
    which : {"true", "estimated"}
        True damage, or the estimate of the detector.
    ax : matplotlib.axes.Axes, optional
        Where to draw.
    """
    judgement = judge(data)
    percent = 100.0 * (judgement.true if which == "true" else judgement.estimated)
    bars = np.full(percent.shape, math.nan) if which == "true" else 100.0 * judgement.deviation
    top = 100.0 * float(np.fmax(judgement.true, judgement.estimated).max())
    ax = plot_zones(percent, bars, side(data), top=top, ax=ax)
    ax.set_title(f"{which.capitalize()} damage [%] at t = {judgement.time:.4f} s")
    return ax


def plot_zones(
    percent: NDArray[np.float64],
    bars: NDArray[np.float64],
    size: tuple[float, str],
    *,
    top: float = 50.0,
    ax: Axes | None = None,
) -> Axes:
    """Draw damage of the zones as numbers: zone 1 at the origin, x to the right.

    Parameters
    ----------
    percent, bars : numpy.ndarray, shape (zones,)
        Damage and its standard deviation [%]; not a number where there is none.
    size : tuple of float and str
        Side of the membrane and its unit.
    top : float
        Largest damage of the colours [%]; at least 50.
    ax : matplotlib.axes.Axes, optional
        Where to draw.

    Raises
    ------
    ResultsError
        So many zones do not fill a square.
    """
    n, top = math.isqrt(percent.size), max(50.0, top)
    if n**2 != percent.size:
        msg = f"{percent.size} zones are no square. Add those that are missing to [record] variables and run it again."
        raise ResultsError(msg)
    ax, (length, unit) = axes_or_new(ax), size
    extent = (0.0, length, 0.0, length)
    ax.imshow(percent.reshape(n, n), origin="lower", extent=extent, vmin=0.0, vmax=top, cmap="Blues")
    width = length / n
    for zone, value in enumerate(percent):
        x, y = (zone % n + 0.5) * width, (zone // n + 0.5) * width
        color = "white" if value > 0.55 * top else "black"
        deviation = "" if np.isnan(bars[zone]) else f"\n$\\pm$ {bars[zone]:.1f}"
        ax.text(x, y, f"{value:.1f}{deviation}", ha="center", va="center", color=color, fontsize=11)
        ax.text(x - 0.46 * width, y + 0.46 * width, f"{zone + 1}", ha="left", va="top", color=color, fontsize=8)
    ticks = np.linspace(0.0, length, n + 1)
    ax.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]", title="Damage [%]", xticks=ticks, yticks=ticks)
    ax.grid(color=GREY, alpha=0.6, lw=0.8)
    return ax


def plot_damage_history(data: xr.Dataset, *, watch: Mapping[str, Any] | None = None, ax: Axes | None = None) -> Axes:
    """Draw the estimate of every zone over time, true damage dashed if known; zones that matter in colour, others grey.

    A dot stands at every judgement, a cross where a window ended without a valid one; a band is two standard deviations wide
    to each side, but not below 0. What is no valid judgement is grey, without a band.

    Parameters
    ----------
    data : xarray.Dataset
        Results.
    watch : mapping, optional
        Content of ``watch.json``: a line marks each alarm, a triangle above each onset with two standard deviations.
    ax : matplotlib.axes.Axes, optional
        Where to draw.
    """
    detector = find(data, "detector")
    (estimated,) = need(data, f"{detector}.damage")
    true = data.get(true_damage(data), math.nan * estimated)
    ax, time = axes_or_new(ax), data["time"].to_numpy()
    ended = windows(data)
    t, e = 100.0 * true.to_numpy(), 100.0 * estimated.to_numpy()
    deviation = data.get(f"{detector}.deviation", math.nan * estimated)
    if deviation.shape != e.shape:  # recorded of some zones only
        deviation = math.nan * estimated
    bars = 200.0 * deviation.to_numpy()  # two standard deviations
    e[time < (ended[0].time if ended else math.inf)] = math.nan  # nothing is known before the first judgement
    is_valid = data[f"{detector}.valid"].to_numpy() > 0.5
    judged = np.where(is_valid[:, None], e, math.nan)
    damaged = list(np.flatnonzero((t > 0.0).any(axis=0)))
    largest = np.nan_to_num(judged).max(axis=0)
    suspects = [z for z in np.argsort(-largest) if z not in damaged and largest[z] > 3.0]
    shown = (damaged + suspects)[: len(COLORS)]
    _draw_grey(ax, time, e, judged, [z for z in range(e.shape[1]) if z not in shown])
    for color, zone in zip(COLORS, shown, strict=False):
        label = f"zone {zone + 1}, estimated" if is_valid.any() else None
        ax.step(time, judged[:, zone], where="post", color=color, lw=1.8, label=label)
        low, high = np.maximum(judged[:, zone] - bars[:, zone], 0.0), judged[:, zone] + bars[:, zone]
        first = zone == shown[0] and bool(np.isfinite(low).any())
        name = "± 2 standard deviations" if first else None
        ax.fill_between(time, low, high, step="post", color=color, alpha=0.2, lw=0, label=name)
        if zone in damaged:
            ax.step(time, t[:, zone], where="post", color=color, lw=1.2, ls="--", label=f"zone {zone + 1}, true")
    for valid, marker, label in ((True, "o", "judgement"), (False, "x", "not valid")):
        some = [window for window in ended if window.valid == valid]
        heights = [100.0 * window.estimated.max() for window in some]
        if some:
            ax.plot([w.time for w in some], heights, marker, color="black", ms=5, label=label, zorder=3)
    for window in ended:
        ax.axvline(window.time, color=GREY, lw=0.6, ls=":")
    _mark(watch or {}, ax)
    ax.set(xlabel="time [s]", ylabel="damage [%]", title="Damage over time; a dotted line ends a window")
    ax.set_xlim(time[0], time[-1] + 0.03 * (time[-1] - time[0]))  # room for the last judgement
    time_axis(ax)
    ax.set_ylim(-1.0, max(10.0, 1.15 * float(np.nan_to_num([t, e], posinf=0.0).max())))
    legend_below(ax, 4)
    return ax


def _draw_grey(
    ax: Axes, time: NDArray[np.float64], e: NDArray[np.float64], judged: NDArray[np.float64], rest: list[int]
) -> None:
    """Draw the estimates [%] of the zones that have no colour, and of all zones where they are no valid judgement."""
    without = np.where(np.isnan(judged), e, math.nan)
    without[:, rest] = e[:, rest]
    drawn = np.flatnonzero(np.isfinite(without).any(axis=0))
    label = "other zones" if rest else None
    if np.isfinite(np.delete(without, rest, axis=1)).any():
        label = "other zones, or not valid" if rest else "estimates, not valid"
    for i, zone in enumerate(drawn):
        ax.step(time, without[:, zone], where="post", color=GREY, lw=0.6, label=None if i else label)


def _mark(watch: Mapping[str, Any], ax: Axes) -> None:
    """Mark the alarms of the twin and the onsets that it dates."""
    for k, alarm in enumerate(watch.get("alarms", [])):
        ax.axvline(alarm, color="black", lw=1.0, ls="-.", label=None if k else "alarm, twin")
    found = watch.get("findings", [])
    if found:
        onsets, bars = [each["onset"] for each in found], [2.0 * each["onset_deviation"] for each in found]
        heights, in_axes = [0.97] * len(found), ax.get_xaxis_transform()
        ax.errorbar(onsets, heights, xerr=bars, fmt="v", ms=7, color="black", label="onset, twin", transform=in_axes)


def _damage(data: xr.Dataset, figure: Figure) -> None:
    known = bool(true_damage(data))
    if not known:
        figure.set_figwidth(0.55 * figure.get_figwidth())
    *left, right = figure.subplots(1, 1 + known, squeeze=False)[0]
    for ax in left:
        plot_damage_map(data, "true", ax=ax)
    plot_damage_map(data, "estimated", ax=right)
    figure.colorbar(right.images[0], ax=[*left, right], shrink=0.8, label="damage [%]")
    if not windows(data)[-1].valid:
        figure.supxlabel(doubts(data, windows(data))[0], fontsize=9)


def _history(data: xr.Dataset, figure: Figure, watch: Mapping[str, Any] | None) -> None:
    true = true_damage(data)
    if len(windows(data)) < 2 and not (true and np.ptp(data[true].to_numpy(), axis=0).any()):
        msg = "a single window under constant damage has no history."
        raise ResultsError(msg)
    plot_damage_history(data, watch=watch, ax=figure.subplots())


def damage_pages(watch: Mapping[str, Any] | None) -> dict[str, Page]:
    """Return the pages of damage by file name, with what the twin saw that watched the run."""
    return {"damage": (_damage, (9.0, 4.7)), "damage_history": (partial(_history, watch=watch), (9.0, 4.8))}
