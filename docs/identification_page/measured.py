"""Measured records: silver thread and carbon black, beyond the thesis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from gossamer_models.identification import Figure
from gossamer_models.identification.assess import MeasuredFit, assess_measured

from .compute import Results
from .style import BLUE, FITTED_STRETCH, GREEN, MEASURED, RED, Curve, compare, panels, save, show
from .tables import number, table, verdict

CARBON = "velocity_profile_10wt"
LOOP_ENDS = 0.06  # of a record with many cycles: the loops of its first and last ones are drawn


def section(results: Results, pictures: Path) -> list[str]:
    """Return the chapter and write its pictures; a line where the records are not at hand."""
    if not results.measured:
        return ["", "## Measured records", "", "The measured records were not at hand when this page was made."]
    lines = ["", "## Measured records", "", INTRODUCTION, "", *_matrix(figures(results))]
    lines += show(_forward(results, pictures), CAPTION_FORWARD)
    if any(row.name == CARBON for row in results.measured):
        lines += show(_carbon(results, pictures), CAPTION_CARBON)
    return lines


def figures(results: Results) -> list[Figure]:
    """Return all figures of the chapter."""
    return assess_measured(Path(), results.measured, results.transfers) if results.measured else []


def _matrix(found: list[Figure]) -> list[str]:
    """Return a row per record and model, with both stretches."""
    rows: dict[str, dict[str, Figure]] = {}
    for figure in found:
        name, stretch = figure.what, "whole"
        for ending in ("train", "test"):
            if figure.what.endswith(f", {ending}"):
                name, stretch = figure.what.removesuffix(f", {ending}"), ending
        rows.setdefault(name, {})[stretch] = figure
    body = []
    for name, row in rows.items():
        train, test = row.get("train"), row.get("test", row.get("whole"))
        both = [each for each in (train, test) if each is not None]
        body.append(
            (
                name,
                number(train and train.asked),
                number(train and train.reached),
                number(test and test.asked),
                number(test and test.reached),
                verdict(*(each.met for each in both)) if any(each.asked is not None for each in both) else "",
            )
        )
    head = ("record, quantity", "fitted, asked", "fitted, reached", "predicted, asked", "predicted, reached", "met")
    return table(head, body)


def _forward(results: Results, pictures: Path) -> str:
    rows = [row for row in results.measured if row.name != CARBON]
    figure, axes = panels(3, len(rows), (9.5, 7.6))
    for k, row in enumerate(rows):
        record, train = row.record, row.fit.train[0]
        carbon = record.strain.max() < 0.9
        curve = Curve(label="model", values=row.fit.predicted[0], colour=BLUE, width=0.7)
        compare(
            axes[:, k],
            record.time,
            record.strain,
            record.output,
            [curve],
            unit="ohm" if carbon else "1",
            quantity="resistance" if carbon else "normalised signal",
            fitted=(float(record.time[train].min()), float(record.time[train].max())),
            residual_in="% of range",
            ends=1.0 if carbon else LOOP_ENDS,
        )
        axes[0, k].set_title(row.name)
        if not carbon:
            axes[0, k].set_xlabel("normalised strain [%]")
    axes[0, 0].legend(loc="upper left")
    return save(figure, pictures, "measured_forward")


def _carbon(results: Results, pictures: Path) -> str:
    rows = {row.model: row for row in results.measured if row.name == CARBON}
    looks = {"thesis' drives": (RED, "--"), "extension": (BLUE, "-")}
    curves = [
        Curve(label=model, values=rows[model].fit.predicted[0], colour=colour, style=style, width=0.9)
        for model, (colour, style) in looks.items()
        if model in rows
    ]
    row = rows.get("extension", next(iter(rows.values())))
    record, train = row.record, row.fit.train[0]
    fitted = (float(record.time[train].min()), float(record.time[train].max()))
    figure, axes = panels(2, 2, (9.5, 6.4))
    (loop, history), (left, strain) = axes
    compare(
        (loop, history, left),
        record.time,
        record.strain,
        record.output,
        curves,
        quantity="resistance",
        fitted=fitted,
        residual_in="% of range",
    )
    _strain(row, strain)
    strain.axvspan(*fitted, color=FITTED_STRETCH, zorder=0, lw=0)
    loop.set_title("resistance over strain")
    history.set_title("resistance over time")
    left.set_title("what the models leave")
    strain.set_title("strain recovered from resistance")
    loop.legend(loc="lower right")
    return save(figure, pictures, "carbon_black")


def _strain(row: MeasuredFit, ax: object) -> None:
    record = row.record
    ax.plot(record.time, 100.0 * record.strain, color=MEASURED, lw=1.8, label="applied")
    for (name, found), colour in zip(row.recovered.items(), (BLUE, GREEN), strict=False):
        ax.plot(record.time, 100.0 * np.asarray(found), color=colour, lw=0.9, label=name)
    ax.set(xlabel="time [s]", ylabel="strain [%]", ylim=(-2.0, 130.0 * float(record.strain.max())))
    ax.legend(loc="upper right", ncols=2)


INTRODUCTION = """\
NRMSE in percent of the range. `strain_*`: silver-coated thread, public data of roboticslab-uc3m
(nylon-silver-soft-sensor), normalised and without a clock; 0.1 s a sample is assumed. `random_sawtooth_7_5wt` and
`velocity_profile_10wt`: carbon black in silicone, public data of richgumy (electromech-stretcher). The first half, of
carbon black the first 60 %, is fitted; the rest is predicted. *Extension* means, of silver thread, a gain that loading
changes; of the sawtooth, relaxation that falling strain drives too; of the velocity profile both, with either sign.
`A -> B`: fitted to all of A, judged on B."""
CAPTION_FORWARD = (
    "Beyond the thesis: measured records. Output over strain (of silver thread the first and the last cycles) and "
    "over time, measured (grey) and modelled with the extension, and what the model leaves. Shaded: fitted."
)
CAPTION_CARBON = (
    "Beyond the thesis: measured carbon black in silicone, velocity_profile_10wt. Resistance jumps up when unloading "
    "begins and relaxes on both levels, which the thesis' drives cannot show and the extension does. Shaded: "
    "fitted."
)
