"""Measured records: silver thread and carbon black, beyond the thesis."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes

from .compute import Results
from .measured import Comparison, MeasuredFit
from .metrics import Metric, number, table, verdict
from .style import BLUE, FITTED_STRETCH, GREEN, MEASURED, RED, Curve, compare, panels, save, show

CARBON_RECORD = "velocity_profile_10wt"
LOOP_ENDS = 0.06  # of a record with many cycles: the loops of its first and last ones are drawn


def section(results: Results, pictures: Path) -> list[str]:
    """Return the chapter and write its pictures; one line if the records are missing."""
    if not results.measured:
        return ["", "## Measured records", "", "The measured records were missing when this page was made."]
    lines = ["", "## Measured records", "", INTRODUCTION, "", *_matrix(_comparisons(results))]
    lines += show(_forward(results, pictures), CAPTION_FORWARD)
    if any(row.name == CARBON_RECORD for row in results.measured):
        lines += show(_carbon(results, pictures), CAPTION_CARBON)
    return lines


def metrics(results: Results) -> list[Metric]:
    """Return all metrics of the chapter."""
    return [m for each in _comparisons(results) for m in (each.train, each.test) if m is not None]


def _comparisons(results: Results) -> list[Comparison]:
    fitted = (each for row in results.measured for each in row.comparisons())
    return [*fitted, *(row.comparison() for row in results.transfers), *results.reviewed]


def _matrix(comparisons: list[Comparison]) -> list[str]:
    """Return a row per record and model, with both stretches."""
    body = []
    for each in comparisons:
        pair = (each.train, each.test)
        numbers = [number(value) for m in pair for value in ((m.target, m.value) if m else (None, None))]
        met = [m.met for m in pair if m]
        body.append((each.what, *numbers, "" if all(one is None for one in met) else verdict(*met)))
    head = ("record, quantity", "fitted, target", "fitted, reached", "predicted, target", "predicted, reached", "met")
    return table(head, body)


def _forward(results: Results, pictures: Path) -> str:
    rows = [row for row in results.measured if row.name != CARBON_RECORD]
    figure, axes = panels(3, len(rows), (9.5, 7.6))
    for k, row in enumerate(rows):
        record, train = row.record, row.fit.train[0]
        carbon = record.strain.max() < 0.9
        curve = Curve(label="model", values=row.fit.predicted[0], colour=BLUE, width=0.7)
        compare(
            axes[:, k],
            record.time,
            record.strain,
            record.resistance,
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
    rows = {row.model: row for row in results.measured if row.name == CARBON_RECORD}
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
        record.resistance,
        curves,
        quantity="resistance",
        fitted=fitted,
        residual_in="% of range",
    )
    _strain(row, strain)
    strain.axvspan(*fitted, color=FITTED_STRETCH, zorder=0, lw=0)
    loop.set_title("resistance over strain")
    history.set_title("resistance over time")
    left.set_title("residuals of the models")
    strain.set_title("strain recovered from resistance")
    loop.legend(loc="lower right")
    return save(figure, pictures, "carbon_black")


def _strain(row: MeasuredFit, ax: Axes) -> None:
    record = row.record
    ax.plot(record.time, 100.0 * record.strain, color=MEASURED, lw=1.8, label="applied")
    for (name, strain), colour in zip(row.recovered.items(), (BLUE, GREEN), strict=False):
        ax.plot(record.time, 100.0 * strain, color=colour, lw=0.9, label=name)
    ax.set(xlabel="time [s]", ylabel="strain [%]", ylim=(-2.0, 130.0 * float(record.strain.max())))
    ax.legend(loc="upper right", ncols=2)


INTRODUCTION = """\
Errors are NRMSE in percent of the range. The records `strain_*` are of silver-coated thread, public data of
roboticslab-uc3m (nylon-silver-soft-sensor), normalised and without a clock; we assume 0.1 s per sample.
`random_sawtooth_7_5wt` and `velocity_profile_10wt` are of carbon black in silicone, public data of richgumy
(electromech-stretcher). The models are fitted to the first half of a record, for carbon black to the first 60 %, and
predict the rest. *Extension* means, for silver thread, a gain that loading changes; for the sawtooth, relaxation that
falling strain drives too; for the velocity profile both, with either sign. `A -> B`: fitted to all of A, evaluated on
B. `two records -> B`: fitted to all of `strain_sin_30` and `strain_mixed_15_25` (hat functions, earlier relaxation), then
`gossamer assess --fit-scales`: gain, offset and what was still relaxing are fitted to the first half of B, and the second
half is judged, beside a static cubic that is fitted to the same first half. All records were seen while this was built."""
CAPTION_FORWARD = (
    "Beyond the thesis: measured records. Output over strain (of silver thread the first and the last cycles) and "
    "over time, measured (grey) and modelled with the extension, and the residual of the model. Shaded: fitted."
)
CAPTION_CARBON = (
    "Beyond the thesis: measured carbon black in silicone, velocity_profile_10wt. Resistance jumps up when unloading "
    "begins and relaxes on both levels. The thesis' drives cannot show this, and the extension does. Shaded: "
    "fitted."
)
