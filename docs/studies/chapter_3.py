"""Chapter 3: the fractional models, Tables 3.1 and 3.2, Figures 3.1 to 3.5."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from gossamer_models.fractional import FractionalArtifact, FractionalFit, predict

from .compute import Results
from .fractional import TableRow
from .metrics import Metric, number, table, verdict
from .operators import derivative, integral
from .specimen import Dataset, dataset
from .style import BLUE, RED, Curve, Vector, compare, panels, save, show

TABLES = {3: ("3.1", "M = 6"), 5: ("3.2", "M = 8")}
NAMES = {"model-1": "model-1", "sub-model-1": "model-2, sub-model-1", "sub-model-2": "model-2, sub-model-2"}


def section(results: Results, pictures: Path) -> list[str]:
    """Return the chapter and write its pictures."""
    lines = ["", "## Chapter 3: fractional models", *show(_operators(pictures), CAPTION_3_1)]
    for n, (name, size) in TABLES.items():
        rows = [row for row in results.rows if row.terms == n]
        if rows:
            lines += ["", f"### Table {name} (N = {n}, {size})", "", *_errors(rows), "", *_parameters(rows)]
    limits = results.limits
    lines += [
        "",
        "Limits of E1. "
        f"Noise alone leaves {limits.noise[0]:.2f} % on Dataset-1 and {limits.noise[1]:.2f} % on Dataset-2. "
        "With five terms of any sign and hardly any restraint, fitted to 0..200 s, "
        f"sub-model-1 leaves {limits.fitted['sub-model-1']:.2f} %, "
        f"sub-model-2 {limits.fitted['sub-model-2']:.2f} % and model-1 {limits.fitted['model-1']:.2f} % on 0..200 s. "
        f"Fitted to all of Dataset-1, they leave {limits.informed['sub-model-1']:.2f}, "
        f"{limits.informed['sub-model-2']:.2f} and {limits.informed['model-1']:.2f} % there. The sub-models of model-2 "
        "are linear in strain, and the specimen is not. Strain in triangles has odd harmonics only, and a linear "
        "model, with or without phases, adds no even ones in the long run; but a curved loop has even harmonics. With "
        f"one more term, the square of strain, sub-model-1 leaves {limits.with_square:.2f} % on 0..200 s. A causal "
        f"linear model that is perfect on Dataset-1 leaves {limits.doubling:.1f} % on Dataset-2, in which the strain "
        f"is twice as large. Model-1, fitted to both at once, leaves {limits.model_1_informed[0]:.2f} % and "
        f"{limits.model_1_informed[1]:.2f} %.",
        "",
        "Signs, and the restraint of terms that cancel each other, are chosen within 0..200 s: by a fit to the first "
        "cycle and its error on the second. Most terms then get a coefficient of zero, so models with five and three "
        "terms fit and predict almost alike.",
        *show(_dataset_1(results.rows, pictures), CAPTION_3_2),
        *show(_dataset_2_3(results.rows, results.repeated, pictures), CAPTION_3_4),
    ]
    return lines


def metrics(results: Results) -> list[Metric]:
    """Return the errors beside the thesis'."""
    return [
        Metric(what=f"Dataset-{k} (synthetic), {row.model}, N = {row.terms}, E1", unit="%", value=value, target=target)
        for row in results.rows
        for k, (value, target) in enumerate(zip(row.errors, row.thesis, strict=True), start=1)
    ]


def _errors(rows: Sequence[TableRow]) -> list[str]:
    head = (
        "model",
        "thesis, Dataset-1 [%]",
        "thesis, Dataset-2 [%]",
        "ours, 0..200 s fitted [%]",
        "ours, Dataset-1 [%]",
        "ours, Dataset-2 [%]",
        "ours, fit [s]",
        "not above the thesis",
    )
    return table(
        head,
        [
            (
                NAMES[row.model],
                *(f"{error:g}" for error in row.thesis),
                number(row.fit.errors[0].e1),
                *(number(error) for error in row.errors),
                number(row.fit.seconds),
                verdict(*(error <= thesis for error, thesis in zip(row.errors, row.thesis, strict=True))),
            )
            for row in rows
        ],
    )


def _parameters(rows: Sequence[TableRow]) -> list[str]:
    """Return the identified parameters, those that the data do not determine in brackets."""
    body = []
    for row in rows:
        artifact, p = row.fit.artifact, {each.name: each for each in row.fit.parameters}
        for symbol, low, high in (
            ("C", 0, len(artifact.terms) + len(artifact.fading)),
            ("a", 1, len(artifact.terms)),
            ("b", 1, len(artifact.terms)),
            ("p", 1, len(artifact.fading)),
            ("q", 1, len(artifact.fading)),
        ):
            identified = [p[f"{symbol}_{k}"] for k in range(low, high + 1) if f"{symbol}_{k}" in p]
            if identified:
                values = ", ".join(f"{x.value:.4g}" if x.determined else f"({x.value:.4g})" for x in identified)
                body.append((NAMES[row.model], f"{symbol}_k, k = {low} to {high}", values))
    artifact = rows[0].fit.artifact
    return [
        "<details><summary>Identified parameters</summary>",
        "",
        f"Change of resistance over {artifact.resistance_change:.0f} ohm, strain over {artifact.full_scale_strain:.1%}; "
        "times in s. Values in brackets are not determined by the data: the standard error exceeds the value. The "
        "specimen is of another material than the thesis', so the values cannot be compared one by one.",
        "",
        *table(("model", "parameter", "values"), body),
        "",
        "</details>",
    ]


def _operators(pictures: Path) -> str:
    h = 0.002
    t = h * np.arange(round(3 / h) + 1)
    x = 0.5 * (1.0 - np.cos(2.0 * np.pi * t))
    figure, axes = panels(1, 2, (8.0, 3.3))
    for ax, operator, name, colour in (
        (axes[0, 0], derivative, r"$D^{0.5} x$  [T$^{-1/2}$]", RED),
        (axes[0, 1], integral, r"$J^{0.5} x$  [T$^{1/2}$]", BLUE),
    ):
        y = operator(x, h, 0.5)
        ax.plot(x, y, color=colour)
        for k in (round(2.25 / h), round(2.75 / h)):
            ax.annotate("", (x[k + 12], y[k + 12]), (x[k], y[k]), arrowprops={"arrowstyle": "-|>", "color": colour})
        ax.set(xlabel="x [1]", ylabel=name)
    axes[0, 0].set_title("(a) derivative: clockwise, closes")
    axes[0, 1].set_title("(b) integral: anticlockwise, climbs")
    return save(figure, pictures, "operators")


def _change(artifact: FractionalArtifact, data: Dataset) -> Vector:
    step = float(data.time[1] - data.time[0])
    return predict(artifact, data.strain, step) - artifact.rest_resistance


def _curves(rows: Sequence[TableRow], model: str, data: Dataset) -> list[Curve]:
    looks = {3: (RED, "--"), 5: (BLUE, "-")}
    return [
        Curve(
            label=f"N = {row.terms}",
            values=_change(row.fit.artifact, data),
            colour=looks[row.terms][0],
            style=looks[row.terms][1],
        )
        for row in rows
        if row.model == model
    ]


def _dataset_1(rows: Sequence[TableRow], pictures: Path) -> str:
    data = dataset(1)
    figure, axes = panels(3, 3, (9.5, 8.0), sharey="row")
    for column, model in enumerate(NAMES):
        curves = _curves(rows, model, data)
        compare(axes[:, column], data.time, data.strain, data.resistance_change, curves, fitted=(0.0, 200.0))
        axes[0, column].set_title(NAMES[model])
    _finish(axes)
    return save(figure, pictures, "fractional_dataset_1")


def _dataset_2_3(rows: Sequence[TableRow], repeated: dict[str, FractionalFit], pictures: Path) -> str:
    second, third = dataset(2), dataset(3)
    figure, axes = panels(4, 3, (9.5, 10.0), sharey="row")
    for column, model in enumerate(NAMES):
        ax = axes[:, column]
        ax[0].set_title(f"{NAMES[model]}\nDataset-2")
        ax[2].set_title("Dataset-3")
        curves = _curves(rows, model, second)
        compare((ax[0], None, ax[1]), second.time, second.strain, second.resistance_change, curves)
        if model in repeated:
            artifact = repeated[model].artifact
            curve = Curve(label=f"N = {len(artifact.terms)}", values=_change(artifact, third), colour=BLUE)
            compare((ax[2], None, ax[3]), third.time, third.strain, third.resistance_change, [curve], fitted=(0.0, 200.0))
    _finish(axes)
    axes[2, 0].legend(loc="upper left")
    return save(figure, pictures, "fractional_dataset_2_3")


def _finish(axes: np.ndarray) -> None:
    for ax in axes[:, 1:].ravel():
        ax.set_ylabel("")
    axes[0, 0].legend(loc="upper left")


CAPTION_3_1 = (
    "In place of Figure 3.1: derivative (a) and integral (b) of order 0.5 of x = (1 - cos 2πt/T)/2, three periods T "
    "from rest, over x itself. The loop of the derivative is clockwise and closes; that of the integral is "
    "anticlockwise and climbs."
)
CAPTION_3_2 = (
    "In place of Figures 3.2 and 3.3: SYNTHETIC Dataset-1, resistance over strain and over time, and the residuals of "
    "the models. Fitted to 0..200 s (grey), predicted to 400 s. Sub-model-2 takes the record as one period. It starts "
    "with a step, because the strain with turned phases is not zero there."
)
CAPTION_3_4 = (
    "In place of Figures 3.4 and 3.5: SYNTHETIC Dataset-2, predicted by the same models at twice the strain and "
    "twice the rate; and SYNTHETIC Dataset-3, with models that are fitted to its first two cycles (grey) and predict "
    "the other two."
)
