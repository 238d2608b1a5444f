"""Chapter 5: the compensator, Section 5.5, Figures 5.3 and 5.5; and what it does under noise, beyond the thesis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from gossamer_models.compensator.assess import (
    ASKED,
    ETA,
    LONG,
    STEP,
    Case,
    Recovery,
    assess_noise,
    assess_section_5_5,
    assess_wrong_eta,
)
from gossamer_models.compensator.everett import everett_surfaces
from gossamer_models.identification import Figure

from .compute import Results
from .style import BLUE, FITTED_STRETCH, GREEN, MEASURED, ORANGE, RED, panels, save, show
from .tables import number, table, verdict

THESIS = (4.0, 20.0)  # [% of squares], [%] relative root mean square; the thesis prints the first
LOOKS = {
    "exact inverse": (RED, "s"),
    "dead band of 3 deviations": (ORANGE, "^"),
    "25-point mean": (GREEN, "D"),
    "estimator": (BLUE, "o"),
}
LITTLE = 0.01  # [1], of a cycle
WINDOW = (900.0, 1200.0)  # [s] of the history that is drawn


def section(results: Results, pictures: Path) -> list[str]:
    """Return the chapter on the compensator without added noise, as in the thesis, and write its pictures."""
    link, said = _everett(results.recovery, pictures)
    return [
        "",
        "## Chapter 5: compensator",
        *show(link, CAPTION_5_3 + said),
        "",
        "### Section 5.5",
        "",
        *_section_5_5(results.recovery),
        *show(_compensated(results.recovery, pictures), CAPTION_5_5),
    ]


def noise_section(results: Results, pictures: Path) -> list[str]:
    """Return what the thesis does not have: the compensators under noise and with a wrong eta."""
    return [
        "",
        "## Compensator under noise",
        "",
        f"SYNTHETIC: the default sensor with η = {ETA} and without relaxation, random ramps, 20 000 samples; noise in "
        "percent of the range of the output, errors as root mean squares in percent of full scale.",
        "",
        *_noise_matrix(results.noise),
        *show(_trace(results.noise, pictures), CAPTION_TRACE + _coverage(results.noise)),
        *show(_levels([*results.noise, *results.more_noise], pictures), CAPTION_LEVELS),
        "",
        "### With a wrong η",
        "",
        "Noise 0.1 %. In brackets the error over the deviation that the estimator states; 1 is honest, above 1 is too sure.",
        "",
        *_wrong_matrix(results.wrong_eta),
    ]


def figures(results: Results) -> list[Figure]:
    """Return all figures of both sections."""
    return [
        *assess_section_5_5(results.recovery),
        *assess_noise(cases=results.noise),
        *assess_wrong_eta(cases=results.wrong_eta),
    ]


def _section_5_5(recovery: Recovery) -> list[str]:
    found = assess_section_5_5(recovery)
    body = [("thesis", f"{THESIS[0]:g}", f"{THESIS[1]:g}", "", "")]
    for name, squares, relative in zip(recovery.found, found[::2], found[1::2], strict=True):
        body.append(
            (
                f"ours, {name}",
                number(squares.reached),
                number(relative.reached),
                f"{squares.asked:g}",
                verdict(squares.met),
            )
        )
    return table(("compensator", "squares [%]", "relative RMS [%]", "squares asked [%]", "reached"), body)


def _everett(recovery: Recovery, pictures: Path) -> tuple[str, str]:
    """Draw the surfaces; return the link, and what they say about a cycle."""
    fit = recovery.fit
    axis, rising, falling = everett_surfaces(fit.artifact, points=33)
    strain = 100.0 * fit.full_scale * axis
    up, down = fit.scale * rising, fit.scale * falling
    figure, axes = panels(1, 2, (9.5, 4.2))
    axes[0, 0].remove()
    solid, ax = figure.add_subplot(1, 2, 1, projection="3d"), axes[0, 1]
    h2, h1 = np.meshgrid(strain, strain)
    solid.plot_wireframe(h1, h2, up, color=BLUE, lw=0.6, rstride=2, cstride=2, label="rising, $h_2 > h_1$")
    solid.plot_wireframe(h1, h2, down, color=RED, lw=0.6, rstride=2, cstride=2, label="falling, $h_2 < h_1$")
    ticks = np.linspace(0.0, strain[-1], 4)
    solid.set(xlabel="extreme $h_1$ [%]", ylabel="strain now $h_2$ [%]", zlabel="change of resistance [ohm]")
    solid.set(xticks=ticks, yticks=ticks)
    solid.view_init(elev=22, azim=-55)
    solid.set_box_aspect(None, zoom=0.82)
    solid.legend(loc="upper left")
    top = float(np.nanmax(np.abs([up, down])))
    filled = ax.contourf(strain, strain, np.where(np.isnan(up), down, up).T, 14, cmap="RdBu", vmin=-top, vmax=top)
    figure.colorbar(filled, ax=ax, label="change of resistance [ohm]", shrink=0.85)
    ax.set(xlabel="extreme $h_1$ [%]", ylabel="strain now $h_2$ [%]", aspect="equal")
    kept = float(np.nanmax(np.abs(up + down.T)))
    said = f" A cycle between two strains keeps {kept:.1g} ohm of {top:.0f} ohm at most"
    said += (
        ": η is 1 here, so these are the symmetric surfaces of the classical model; drift comes from relaxation."
        if kept < LITTLE * top
        else ", which is nothing in the symmetric surfaces of the classical model."
    )
    return save(figure, pictures, "everett"), said


def _compensated(recovery: Recovery, pictures: Path) -> str:
    record, fit = recovery.record, recovery.fit
    figure, axes = panels(2, 2, (9.5, 6.2))
    loop, history, over, error = axes.ravel()
    loop.plot(100.0 * record.strain, record.output, color=MEASURED, lw=2.2, label="measured")
    loop.plot(100.0 * record.strain, fit.predicted[0], color=BLUE, label="model")
    loop.set(xlabel="strain [%]", ylabel="change of resistance [ohm]", title="(a) resistance")
    history.plot(recovery.time, 100.0 * recovery.strain, color=MEASURED, lw=2.2, label="applied")
    top = 100.0 * float(recovery.strain.max())
    over.plot([0.0, top], [0.0, top], color=MEASURED, lw=2.2, label="applied")
    for name, found in recovery.found.items():
        colour, style = LOOKS[name][0], "-" if name == "estimator" else "--"
        n = found.size
        how = {"color": colour, "ls": style, "lw": 0.9, "label": name}
        history.plot(recovery.time[:n], 100.0 * found, **how)
        over.plot(100.0 * recovery.strain[:n], 100.0 * found, **how)
        error.plot(recovery.time[:n], 100.0 * (found - recovery.strain[:n]), **how)
    band = 200.0 * recovery.deviation
    label = "±2σ stated by the estimator"
    error.fill_between(recovery.time[: band.size], -band, band, color=BLUE, alpha=0.18, lw=0, label=label)
    for ax in (history, error):
        ax.axvspan(0.0, float(recovery.time[~recovery.judged].max()), color=FITTED_STRETCH, zorder=0, lw=0)
    error.axhline(0.0, color="0.3", lw=0.6)
    history.set(xlabel="time [s]", ylabel="strain [%]", title="(b) strain over time")
    over.set(xlabel="applied strain [%]", ylabel="recovered strain [%]", title="(c) recovered over applied strain")
    error.set(xlabel="time [s]", ylabel="recovered - applied [%]", title="(d) error of the strain")
    loop.legend(loc="upper left")
    over.legend(loc="upper left")
    error.set_ylim(bottom=1.25 * error.get_ylim()[0])
    error.legend(loc="lower center", ncols=3)
    return save(figure, pictures, "compensated")


def _noise_matrix(cases: Sequence[Case]) -> list[str]:
    noises = sorted({case.noise for case in cases})
    rows: dict[str, dict[float, str]] = {}
    for case in cases:
        name = case.how if case.history == LONG else f"estimator, {case.history}"
        asked = ASKED.get(case.noise) if case.history == LONG and case.how == "estimator" else None
        rms = case.over_runs("rms")
        said = f" (asked {asked:g}, {'reached' if rms <= asked else '**not reached**'})" if asked is not None else ""
        rows.setdefault(name, {})[case.noise] = number(rms) + said
        if case.history == LONG and case.how == "estimator":
            present, over = case.over_runs("present_rms"), case.over_runs("over_stated")
            rows.setdefault("estimator, strain of the present", {})[case.noise] = number(present)
            rows.setdefault("estimator, error over stated deviation [1]", {})[case.noise] = number(over)
    head = ("method / history", *(f"noise {100 * noise:g} %" for noise in noises))
    return table(head, [(name, *(row.get(noise, "-") for noise in noises)) for name, row in rows.items()])


def _wrong_matrix(cases: Sequence[Case]) -> list[str]:
    errors = sorted({case.eta_error for case in cases})
    rows: dict[str, dict[float, str]] = {}
    for case in cases:
        rms = case.over_runs("rms")
        cell = number(rms)
        if case.how != "exact inverse":
            (figure, _) = assess_wrong_eta(cases=[case])
            cell = f"{cell} ({number(case.over_runs('over_stated'))}), {'reached' if figure.met else '**not reached**'}"
        rows.setdefault(case.how, {})[case.eta_error] = cell
    head = ("method, asked 2 % of full scale", *(f"η wrong by {100 * error:+g} %" for error in errors))
    return table(head, [(name, *(row.get(error, "-") for error in errors)) for name, row in rows.items()])


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
    found, band = 100.0 * (estimate.strain + estimate.error)[rows], 200.0 * estimate.deviation[rows]
    above.plot(time, found, color=BLUE, label="estimator, at the time it speaks of")
    below.fill_between(time, -band, band, color=BLUE, alpha=0.25, lw=0, label="±2σ stated by the estimator")
    below.plot(time, 100.0 * estimate.error[rows], color=BLUE, lw=0.8, label="error of the estimator")
    above.set(ylabel="strain [% of full scale]", title=f"noise of {100 * noise:g} % of the output's range")
    below.set(xlabel="time [s]", ylabel="error [% of full scale]")
    above.legend(loc="upper center", ncols=3)
    above.set_ylim(-3.0, 122.0)
    below.legend(loc="upper left", ncols=2)
    return save(figure, pictures, "noise_trace")


def _coverage(cases: Sequence[Case]) -> str:
    """Say how much of all errors the stated band holds."""
    found = []
    for case in cases:
        if case.how == "estimator" and case.history == LONG:
            inside = np.mean([np.mean(np.abs(run.error) < 2.0 * run.deviation) for run in case.runs])
            found.append(f"{100 * inside:.0f} % at {100 * case.noise:g} %")
    text = ", ".join(found)
    return f" The error is a drift more than a scatter; the band, 95 % if it were exact, holds {text} noise."


def _levels(cases: Sequence[Case], pictures: Path) -> str:
    figure, axes = panels(1, 1, (6.5, 4.0))
    ax = axes[0, 0]
    for how, (colour, marker) in LOOKS.items():
        found = sorted(
            (case for case in cases if case.how == how and case.history == LONG), key=lambda case: case.noise
        )
        noise, rms = [100.0 * case.noise for case in found], [case.over_runs("rms") for case in found]
        least, most = ([end(run.rms for run in case.runs) for case in found] for end in (min, max))
        ax.vlines(noise, least, most, color=colour, lw=2.5, alpha=0.35)
        ax.loglog(noise, rms, color=colour, marker=marker, ms=4, label=how)
    ax.plot(
        [100.0 * noise for noise in ASKED],
        list(ASKED.values()),
        "x",
        color="black",
        ms=8,
        mew=2,
        label="asked, estimator",
    )
    ax.set(xlabel="noise, standard deviation [% of the output's range]", ylabel="error, RMS [% of full scale]")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.legend(loc="lower right")
    return save(figure, pictures, "noise_levels")


CAPTION_5_3 = (
    "In place of Figure 5.3: Everett surfaces of Eqs. (5.3) and (5.4) without relaxation, as identified from "
    "SYNTHETIC Dataset-3."
)
CAPTION_5_5 = (
    "In place of Figure 5.5: SYNTHETIC Dataset-3. The sensor is fitted to the first two cycles (grey); strain is "
    "recovered from all four and judged on the last two. The estimate is drawn at the time it speaks of."
)
CAPTION_TRACE = (
    "Beyond the thesis: strain recovered under noise, SYNTHETIC. The exact inverse loses the strain, since every "
    "reversal that noise makes is kept in its memory; the estimator keeps it and says how far it may be off."
)
CAPTION_LEVELS = (
    "Beyond the thesis: error over noise, SYNTHETIC, for the ways to compensate. Lines: root mean square over three "
    "random histories; bars: from the best of them to the worst."
)
