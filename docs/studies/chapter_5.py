"""Chapter 5: the compensator, Section 5.5, Figures 5.3 and 5.5."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from gossamer_models.sensor.plots import everett

from .compute import Results
from .metrics import Metric, number, table, verdict
from .recovery import Recovery
from .style import BLUE, COMPENSATORS, FITTED_STRETCH, MEASURED, RED, panels, save, show

THESIS = (4.0, 20.0)  # [% of squares], [%] relative root mean square; the thesis prints the first
LITTLE = 0.01  # [1], of a cycle


def section(results: Results, pictures: Path) -> list[str]:
    """Return the chapter on the compensator without added noise, as in the thesis, and write its pictures."""
    link, drift = _everett(results.recovery, pictures)
    return [
        "",
        "## Chapter 5: compensator",
        *show(link, CAPTION_5_3 + drift),
        "",
        "### Section 5.5",
        "",
        *_section_5_5(results.recovery),
        *show(_compensated(results.recovery, pictures), CAPTION_5_5),
    ]


def metrics(results: Results) -> list[Metric]:
    """Return all metrics of the chapter."""
    return results.recovery.metrics()


def _section_5_5(recovery: Recovery) -> list[str]:
    metrics = recovery.metrics()
    body = [("thesis", f"{THESIS[0]:g}", f"{THESIS[1]:g}", "", "")]
    for name, squares, relative in zip(recovery.estimates, metrics[::2], metrics[1::2], strict=True):
        target = number(squares.target)
        body.append((f"ours, {name}", number(squares.value), number(relative.value), target, verdict(squares.met)))
    return table(("compensator", "squares [%]", "relative RMS [%]", "target of squares [%]", "reached"), body)


def _everett(recovery: Recovery, pictures: Path) -> tuple[str, str]:
    """Draw the surfaces; return the link and a sentence on what a cycle leaves."""
    fit = recovery.fit
    rise, fall = everett(fit.artifact)
    strain = 100.0 * fit.full_scale * np.linspace(0.0, 1.0, rise.shape[0])
    up, down = (
        fit.resistance_change * rise.T,
        -fit.resistance_change * fall,
    )  # from an extreme h1 (row) to a strain h2 (column)
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
    drift = f" A cycle between two strains leaves {kept:.1g} ohm of {top:.0f} ohm at most"
    drift += (
        ": η is 1 here, so these are the symmetric surfaces of the classical model; drift comes from relaxation."
        if kept < LITTLE * top
        else "; the symmetric surfaces of the classical model leave nothing."
    )
    return save(figure, pictures, "everett"), drift


def _compensated(recovery: Recovery, pictures: Path) -> str:
    record, fit = recovery.record, recovery.fit
    figure, axes = panels(2, 2, (9.5, 6.2))
    loop, history, over, error = axes.ravel()
    loop.plot(100.0 * record.strain, record.resistance, color=MEASURED, lw=2.2, label="measured")
    loop.plot(100.0 * record.strain, fit.predicted[0], color=BLUE, label="model")
    loop.set(xlabel="strain [%]", ylabel="change of resistance [ohm]", title="(a) resistance")
    history.plot(recovery.time, 100.0 * recovery.strain, color=MEASURED, lw=2.2, label="applied")
    top = 100.0 * float(recovery.strain.max())
    over.plot([0.0, top], [0.0, top], color=MEASURED, lw=2.2, label="applied")
    for name, estimate in recovery.estimates.items():
        colour, style = COMPENSATORS[name][0], "-" if name == "estimator" else "--"
        n = estimate.size
        how = {"color": colour, "ls": style, "lw": 0.9, "label": name}
        history.plot(recovery.time[:n], 100.0 * estimate, **how)
        over.plot(100.0 * recovery.strain[:n], 100.0 * estimate, **how)
        error.plot(recovery.time[:n], 100.0 * (estimate - recovery.strain[:n]), **how)
    band = 200.0 * recovery.deviation
    label = "±2σ reported by the estimator"
    error.fill_between(recovery.time[: band.size], -band, band, color=BLUE, alpha=0.18, lw=0, label=label)
    for ax in (history, error):
        ax.axvspan(0.0, float(recovery.time[~recovery.predicted].max()), color=FITTED_STRETCH, zorder=0, lw=0)
    error.axhline(0.0, color="0.3", lw=0.6)
    history.set(xlabel="time [s]", ylabel="strain [%]", title="(b) strain over time")
    over.set(xlabel="applied strain [%]", ylabel="recovered strain [%]", title="(c) recovered over applied strain")
    error.set(xlabel="time [s]", ylabel="recovered - applied [%]", title="(d) error of the strain")
    loop.legend(loc="upper left")
    over.legend(loc="upper left")
    error.set_ylim(bottom=1.25 * error.get_ylim()[0])
    error.legend(loc="lower center", ncols=3)
    return save(figure, pictures, "compensated")


CAPTION_5_3 = (
    "In place of Figure 5.3: Everett surfaces of Eqs. (5.3) and (5.4) without relaxation, as identified from "
    "SYNTHETIC Dataset-3."
)
CAPTION_5_5 = (
    "In place of Figure 5.5: SYNTHETIC Dataset-3. The sensor is fitted to the first two cycles (grey); strain is "
    "recovered from all four and evaluated on the last two. Each estimate is drawn at the time for which it holds."
)
