"""Compensator under noise and with a wrong eta, beyond the thesis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .compute import Results
from .metrics import Metric, number, table
from .noise import ETA, LONG, STEP, TARGETS, WRONG_ETA_TARGET, Case
from .style import BLUE, COMPENSATORS, MEASURED, RED, panels, save, show

WINDOW = (900.0, 1200.0)  # [s] of the history that is drawn


def section(results: Results, pictures: Path) -> list[str]:
    """Return what the thesis does not have: the compensators under noise and with a wrong eta."""
    return [
        "",
        "## Compensator under noise",
        "",
        f"SYNTHETIC: the default sensor with η = {ETA} and without relaxation, random ramps, 20 000 samples. Noise is "
        "in percent of the range of the output; errors are root mean squares in percent of full scale.",
        "",
        *_noise_matrix(results.noise),
        *show(_trace(results.noise, pictures), CAPTION_TRACE + _coverage(results.noise)),
        *show(_levels([*results.noise, *results.more_noise], pictures), CAPTION_LEVELS),
        "",
        "### With a wrong η",
        "",
        "Noise 0.1 %. In brackets: error over the deviation that the estimator reports. 1 is exact; above 1, the "
        "estimator reports too small a deviation.",
        "",
        *_wrong_matrix(results.wrong_eta),
    ]


def metrics(results: Results) -> list[Metric]:
    """Return all metrics of the chapter."""
    return [metric for case in (*results.noise, *results.wrong_eta) for metric in case.metrics()]


def _noise_matrix(cases: Sequence[Case]) -> list[str]:
    noises = sorted({case.noise for case in cases})
    rows: dict[str, dict[float, str]] = {}
    for case in cases:
        name = case.how if case.history == LONG else f"estimator, {case.history}"
        rms = case.over_runs("rms")
        cell = number(rms)
        if case.target is not None:
            cell = f"{cell} (target {case.target:g}, {_reached(rms <= case.target)})"
        rows.setdefault(name, {})[case.noise] = cell
        if case.history == LONG and case.how == "estimator":
            present, over = case.over_runs("present_rms"), case.over_runs("over_stated")
            rows.setdefault("estimator, present strain", {})[case.noise] = number(present)
            rows.setdefault("estimator, error over reported deviation [1]", {})[case.noise] = number(over)
    head = ("method / history", *(f"noise {100 * noise:g} %" for noise in noises))
    return table(head, [(name, *(row.get(noise, "-") for noise in noises)) for name, row in rows.items()])


def _wrong_matrix(cases: Sequence[Case]) -> list[str]:
    errors = sorted({case.eta_error for case in cases})
    rows: dict[str, dict[float, str]] = {}
    for case in cases:
        rms = case.over_runs("rms")
        cell = number(rms)
        if case.target is not None:
            cell = f"{cell} ({number(case.over_runs('over_stated'))}), {_reached(rms <= case.target)}"
        rows.setdefault(case.how, {})[case.eta_error] = cell
    head = (f"method, target {WRONG_ETA_TARGET:g} % of full scale", *(f"η wrong by {100 * error:+g} %" for error in errors))
    return table(head, [(name, *(row.get(error, "-") for error in errors)) for name, row in rows.items()])


def _reached(met: bool) -> str:
    return "reached" if met else "**not reached**"


def _trace(cases: Sequence[Case], pictures: Path) -> str:
    noise = max(case.noise for case in cases if case.history == LONG)
    runs = {case.how: case.runs[0] for case in cases if case.history == LONG and case.noise == noise}
    figure, axes = panels(2, 1, (9.0, 5.6), sharex=True, height_ratios=(1.5, 1.0))
    estimate, inverse = runs["estimator"], runs["exact inverse"]
    time = STEP * np.arange(1, inverse.strain.size + 1)
    begin = min(WINDOW[0], 0.5 * float(time[-1]))
    rows = (time >= begin) & (time <= WINDOW[1])
    above, below = axes[:, 0]
    above.plot(time[rows], 100.0 * inverse.strain[rows], color=MEASURED, lw=2.4, label="true")
    above.plot(time[rows], 100.0 * (inverse.strain + inverse.error)[rows], color=RED, lw=0.8, label="exact inverse")
    rows = rows[: estimate.strain.size]
    time = time[: estimate.strain.size][rows]
    recovered, band = 100.0 * (estimate.strain + estimate.error)[rows], 200.0 * estimate.deviation[rows]
    above.plot(time, recovered, color=BLUE, label="estimator, at the time for which it holds")
    below.fill_between(time, -band, band, color=BLUE, alpha=0.25, lw=0, label="±2σ reported by the estimator")
    below.plot(time, 100.0 * estimate.error[rows], color=BLUE, lw=0.8, label="error of the estimator")
    above.set(ylabel="strain [% of full scale]", title=f"noise of {100 * noise:g} % of the output's range")
    below.set(xlabel="time [s]", ylabel="error [% of full scale]")
    above.legend(loc="upper center", ncols=3)
    above.set_ylim(-3.0, 122.0)
    below.legend(loc="upper left", ncols=2)
    return save(figure, pictures, "noise_trace")


def _coverage(cases: Sequence[Case]) -> str:
    """Return a sentence on the share of all errors within the reported band."""
    shares = []
    for case in cases:
        if case.how == "estimator" and case.history == LONG:
            inside = np.mean([np.mean(np.abs(run.error) < 2.0 * run.deviation) for run in case.runs])
            shares.append(f"{100 * inside:.0f} % at {100 * case.noise:g} %")
    text = ", ".join(shares)
    return f" The error is a drift rather than scatter. An exact band contains 95 % of the errors; this one {text} noise."


def _levels(cases: Sequence[Case], pictures: Path) -> str:
    figure, axes = panels(1, 1, (6.5, 4.0))
    ax = axes[0, 0]
    for how, (colour, marker) in COMPENSATORS.items():
        drawn = sorted((case for case in cases if case.how == how and case.history == LONG), key=lambda case: case.noise)
        noise, rms = [100.0 * case.noise for case in drawn], [case.over_runs("rms") for case in drawn]
        least, most = ([end(run.rms for run in case.runs) for case in drawn] for end in (min, max))
        ax.vlines(noise, least, most, color=colour, lw=2.5, alpha=0.35)
        ax.loglog(noise, rms, color=colour, marker=marker, ms=4, label=how)
    noises = [100.0 * noise for noise in TARGETS]
    ax.plot(noises, list(TARGETS.values()), "x", color="black", ms=8, mew=2, label="target, estimator")
    ax.set(xlabel="noise, standard deviation [% of the output's range]", ylabel="error, RMS [% of full scale]")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.legend(loc="lower right")
    return save(figure, pictures, "noise_levels")


CAPTION_TRACE = (
    "Beyond the thesis: strain recovered under noise, SYNTHETIC. The exact inverse loses the strain, since every "
    "reversal that noise makes is kept in its memory; the estimator keeps it and says how far it may be off."
)
CAPTION_LEVELS = (
    "Beyond the thesis: error over noise, SYNTHETIC, for the ways to compensate. Lines: root mean square over three "
    "random histories; bars: from the best of them to the worst."
)
