"""Pictures of an assessment: detection, reliability, confusion, errors and false calls."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
from gossamer_files.pictures import COLORS, GREY, axes_or_new, picture

from ..membrane.square import N_ZONES
from .figures import CALL, NOMINAL
from .results import AssessmentResults, ConfusionRow, DetectionRow, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_detection(row: DetectionRow, *, ax: Axes | None = None) -> Axes:
    """Draw the probability of detection over size with its lower 95 % bound, hits, misses and a90/95."""
    ax = axes_or_new(ax)
    title = f"zone {row.zone}" if row.zone else "all zones"
    size, pod, low = np.array(row.curve, dtype=float).T
    ax.plot(100.0 * size, pod, color=COLORS[0], lw=1.4)
    ax.plot(100.0 * size, low, color=COLORS[0], lw=0.8)
    ax.fill_between(100.0 * size, low, np.where(np.isfinite(pod), pod, low), color=COLORS[0], alpha=0.2, lw=0)
    for sizes, height in ((row.hit_sizes, 1.0), (row.missed_sizes, 0.0)):
        if sizes:
            heights = np.full(len(sizes), height)
            ax.plot(100.0 * np.array(sizes), heights, "|", color="black", ms=5, mew=0.6, clip_on=False)
    if row.remark:
        text = ax.text(0.03, 0.4, "\n".join(wrap(row.remark, 26)), transform=ax.transAxes, fontsize=6)
        text.set_in_layout(False)
    ax.axhline(0.9, color=GREY, lw=0.6, ls=":")
    if np.isfinite(row.a90_95):
        ax.axvline(100.0 * row.a90_95, color=COLORS[1], lw=1.0, ls="--")
        title += f": a90/95 {100.0 * row.a90_95:.2g} %"
    ax.set(xscale="log", xlim=(0.5, 50.0), ylim=(0.0, 1.02), title=title)
    ax.set_xticks([1.0, 10.0], ["1", "10"])
    return ax


def plot_reliability(rows: Sequence[Row], *, ax: Axes | None = None) -> Axes:
    """Draw observed over nominal share of damages in the stated intervals; a right deviation gives the diagonal."""
    ax = axes_or_new(ax)
    ax.plot([0.0, 1.0], [0.0, 1.0], color=GREY, lw=0.8, ls="--")
    for k, row in enumerate(rows):
        label = f"{row.judge}, {row.condition}: z rms {row.figures.damaged_z_rms:.2f} in damaged zones"
        look = "o-" if k < len(COLORS) else "s--"
        ax.plot(NOMINAL, row.reliability, look, color=COLORS[k % 6], ms=3, lw=1.2, label=label)
    ax.set(xlabel="stated share [1]", ylabel="observed share [1]", xlim=(0.0, 1.0), ylim=(0.0, 1.02), aspect="equal")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12))
    return ax


def plot_confusion(row: ConfusionRow, *, ax: Axes | None = None) -> Axes:
    """Draw which zone is called first over the damaged one, in % of its records; the last column is no call."""
    ax = axes_or_new(ax)
    counts = np.array(row.counts)
    percent = 100.0 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    ax.imshow(percent, cmap="Blues", vmin=0.0, vmax=100.0)
    for (i, j), value in np.ndenumerate(percent):
        if value >= 0.5:
            colour = "white" if value > 55.0 else "black"
            ax.text(j, i, f"{value:.0f}", ha="center", va="center", fontsize=6, color=colour)
    zones = [str(zone) for zone in range(1, N_ZONES + 1)]
    ax.set_xticks(range(N_ZONES + 1), [*zones, "none"])
    ax.set_yticks(range(N_ZONES), zones)
    ax.grid(visible=False)
    ax.set(xlabel="zone called first", ylabel="damaged zone", title=f"{row.judge}, {row.condition} [% of records]")
    return ax


def plot_errors(assessment: AssessmentResults, *, ax: Axes | None = None) -> Axes:
    """Draw the mean absolute error over damaged zones of every judge under every condition with damage."""
    ax = axes_or_new(ax)
    named = dict.fromkeys(row.condition for row in assessment.rows if np.isfinite(row.figures.error_damaged))
    places = {condition: place for place, condition in enumerate(named)}
    for k, judge in enumerate(assessment.judges):
        rows = [row for row in assessment.rows if row.judge == judge and row.condition in places]
        x, y = [row.figures.error_damaged for row in rows], [places[row.condition] for row in rows]
        ax.plot(x, y, "os"[k // 6 % 2], color=COLORS[k % 6], ms=5, label=judge)
    ax.set_yticks(range(len(places)), list(places))
    ax.invert_yaxis()
    ax.set(xlabel="mean absolute error over damaged zones [% damage]", xlim=(0.0, None))
    ax.legend(loc="upper center", bbox_to_anchor=(0.4, -0.1), ncols=3)
    return ax


def plot_false_calls(rows: Sequence[Row], *, ax: Axes | None = None) -> Axes:
    """Draw the largest valid estimate of each healthy record as histograms; beyond the dotted line it is a call."""
    ax = axes_or_new(ax)
    top = max([CALL, *(max(row.largest, default=0.0) for row in rows)])
    bins = np.linspace(0.0, 100.0 * top, 41).tolist()
    for k, row in enumerate(rows):
        label = f"{row.judge}, {row.condition.removeprefix('healthy, ')}"
        line = "-" if k < len(COLORS) else "--"
        ax.hist(100.0 * np.array(row.largest), bins, histtype="step", color=COLORS[k % 6], ls=line, lw=1.3, label=label)
    ax.axvline(100.0 * CALL, color=GREY, lw=0.8, ls=":")
    ax.set(xlabel="largest estimate of a healthy record, 0 if not valid [% damage]", ylabel="records", yscale="symlog")
    ax.legend(loc="upper right")
    return ax


def save_pictures(assessment: AssessmentResults, folder: Path) -> list[Path]:
    """Draw everything that was found and write it as PNG, without a display; return the paths."""
    paths: list[Path] = []

    def page(name: str, size: tuple[float, float]) -> AbstractContextManager[Figure]:
        paths.append(folder / f"{re.sub('[^a-z0-9]+', '_', name.lower()).strip('_')}.png")
        return picture(paths[-1], size)

    for judge in assessment.judges:
        for name in dict.fromkeys(row.condition for row in assessment.detections):
            found = [row for row in assessment.detections if (row.judge, row.condition) == (judge, name)]
            if any(row.hits for row in found):
                with page(f"detection {judge} {name}", (9.0, 7.5) if len(found) > N_ZONES else (5.0, 4.0)) as figure:
                    _detections(found, figure)
    for counts in assessment.confusions:
        if np.array(counts.counts)[:, :N_ZONES].any():
            with page(f"confusion {counts.judge} {counts.condition}", (7.0, 6.5)) as figure:
                plot_confusion(counts, ax=figure.subplots())
    wanted = [row for row in assessment.rows if row.reliability and row.condition in ("clean", "noise")]
    stated = [row for row in wanted if not np.isnan(row.reliability).any()]  # some judge is never valid
    if stated:
        with page("reliability", (6.0, 6.5)) as figure:
            plot_reliability(stated, ax=figure.subplots())
    with page("errors", (8.0, 6.0)) as figure:
        plot_errors(assessment, ax=figure.subplots())
    healthy = [row for row in assessment.rows if any(row.largest)]
    if healthy:
        with page("false calls", (7.0, 4.0)) as figure:
            plot_false_calls(healthy, ax=figure.subplots())
    return paths


def _detections(rows: Sequence[DetectionRow], figure: Figure) -> None:
    """Draw the curves of one judge: every zone where it is on the membrane, zone 1 below on the left, or all together."""
    zones = {row.zone: row for row in rows}
    if len(zones) <= N_ZONES:
        plot_detection(zones[0], ax=figure.subplots())
    else:
        grid = figure.subplots(4, 4, sharex=True, sharey=True)[::-1].ravel()
        for zone, ax in enumerate(grid, start=1):
            plot_detection(zones[zone], ax=ax)
    title = f"{rows[0].judge}, {rows[0].condition}: {rows[0].score} above {100.0 * rows[0].threshold:.2g} % is a call"
    figure.suptitle("\n".join(wrap(title, 48 if len(zones) <= N_ZONES else 100)))
    figure.supxlabel("damage [%]")
    figure.supylabel("probability of detection [1]")
