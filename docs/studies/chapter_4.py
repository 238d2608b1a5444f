"""Chapter 4: the modified Preisach model, Table 4.1, Figures 4.1 to 4.10."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from gossamer_files.plots import draw
from gossamer_models.sensor.plots import plane_chart

from . import preisach_plane
from .compute import Results
from .metrics import Metric, listed, number, table, verdict
from .preisach import THESIS
from .style import BLUE, GREEN, ORANGE, Curve, compare, panels, save, show

LOOKS = {3: (ORANGE, ":"), 5: (GREEN, "--"), 7: (BLUE, "-")}
FITTED = 200.0  # [s]
ETA_SCALE = (0.9, 1.1)  # [1]
LITTLE = 0.01  # [1], of eta


def section(results: Results, pictures: Path) -> list[str]:
    """Return the chapter and write its pictures."""
    return [
        "",
        "## Chapter 4: modified Preisach model",
        *show(preisach_plane.relays(pictures), CAPTION_4_1),
        *show(preisach_plane.stages(pictures), CAPTION_4_2),
        "",
        "### Table 4.1",
        "",
        *_errors(results),
        "",
        _chosen(results),
        *show(_densities(results, pictures), CAPTION_4_7 + _spread_of_eta(results)),
        *show(_datasets(results, pictures), CAPTION_4_8),
        "",
        "### Speed of the fit",
        "",
        *listed(results.speed),
    ]


def metrics(results: Results) -> list[Metric]:
    """Return all metrics of the chapter."""
    return [*(metric for row in results.specimen for metric in row.metrics()), *results.speed]


def _errors(results: Results) -> list[str]:
    body = []
    for row in results.specimen:
        first, second, seconds = row.metrics()
        thesis = THESIS[row.modes]
        body.append(
            (
                f"M = P = {row.modes}",
                *(f"{x:g}" for x in thesis),
                *(number(x.value) for x in (first, second, seconds)),
                verdict(first.met, second.met, seconds.met),
            )
        )
    head = (
        "model",
        "thesis, Dataset-1 [%]",
        "thesis, Dataset-2 [%]",
        "thesis, fmincon [s]",
        "ours, Dataset-1 [%]",
        "ours, Dataset-2 [%]",
        "ours, two starts [s]",
        "not above the thesis / the thesis / 10 s",
    )
    return table(head, body)


def _chosen(results: Results) -> str:
    """Return a sentence on the fits whose ridge was chosen without test errors."""
    parts = []
    for row in results.chosen:
        first, second, _ = row.metrics()
        ridge = f"{row.fit.settings.density_ridge:g}"
        parts.append(f"M = P = {row.modes}, ridge {ridge}: {number(first.value)} / {number(second.value)}")
    return (
        "The ridges above are the same for all M. `--ridge auto` chooses one for each M instead: it predicts each half "
        f"of the second fitted cycle from the record before it. E1 is then, Dataset-1 / -2, {'; '.join(parts)}."
    )


def _densities(results: Results, pictures: Path) -> str:
    row = max(results.specimen, key=lambda each: each.modes)
    figure, axes = panels(1, 3, (9.5, 3.2), width_ratios=(0.85, 1.0, 1.0))
    bins, mu, eta = axes[0]
    N = 6
    for i in range(N):
        for j in range(i + 1):
            bins.fill([j, j + 1, j + 1, j], [i, i, i + 1, i + 1], color="#DCEBF5", ec="0.4", lw=0.6)
            bins.text(j + 0.5, i + 0.5, f"{i + 1},{j + 1}", ha="center", va="center", fontsize=7)
    bins.set(xlabel=r"bin j of $\beta$", ylabel=r"bin i of $\alpha$", aspect="equal", title="bins (i, j), N = 6 shown")
    bins.grid(False)
    seen = float(row.records[0].strain[row.fit.train[0]].max()) / row.fit.full_scale
    for ax, name in ((mu, "mu"), (eta, "eta")):
        draw(plane_chart(row.fit.artifact, name), ax)
        ax.plot([0.0, seen, seen], [seen, seen, seen], color="white", lw=2.4)
        ax.plot([0.0, seen], [seen, seen], color="0.1", lw=1.0, ls="--")
        ax.grid(False)
        if name == "eta":
            ax.collections[0].set_clim(*ETA_SCALE)
        ax.set_title(rf"$\{name}$, M = P = {row.modes}, N = {row.fit.artifact.n_lines}")
    return save(figure, pictures, "preisach_densities")


def _spread_of_eta(results: Results) -> str:
    """Return by how much the identified eta differs from one in the operators that the fitted stretch has switched."""
    row = max(results.specimen, key=lambda each: each.modes)
    mu, nu = row.fit.artifact.tables()
    seen = float(row.records[0].strain[row.fit.train[0]].max()) / row.fit.full_scale
    switched = (mu > 0.0) & ((np.arange(mu.shape[0]) + 0.5) / mu.shape[0] < seen)
    most = float(np.abs(nu[switched] / mu[switched] - 1.0).max())
    text = f" In the switched part, η differs from 1 by {most:.1g} at most"
    return (
        f"{text}: relaxation explains the drift of these two cycles, and they do not require another η."
        if (most < LITTLE)
        else f"{text}."
    )


def _datasets(results: Results, pictures: Path) -> str:
    figure, axes = panels(3, 3, (9.5, 8.0))
    for k, record in enumerate(results.specimen[0].records):
        curves = [
            Curve(
                label=f"M = P = {row.modes}", values=row.predicted[k], colour=LOOKS[row.modes][0], style=LOOKS[row.modes][1]
            )
            for row in results.specimen
        ]
        fitted = (0.0, FITTED) if k == 0 else None
        compare(axes[:, k], record.time, record.strain, record.resistance, curves, fitted=fitted)
        axes[0, k].set_title(record.name)
    record, fit = results.recovery.record, results.recovery.fit
    modes = fit.settings.modes
    curve = Curve(label=f"M = P = {modes}", values=fit.predicted[0], colour=BLUE)
    compare(axes[:, 2], record.time, record.strain, record.resistance, [curve], fitted=(0.0, FITTED))
    axes[0, 2].set_title(record.name)
    for ax in axes[:, 1:].ravel():
        ax.set_ylabel("")
    axes[0, 0].legend(loc="upper left")
    bound = 1.1 * max(float(np.abs(axes[2, k].get_ylim()).max()) for k in (0, 2))
    for k in (0, 2):
        axes[2, k].set_ylim(-bound, bound)
    return save(figure, pictures, "preisach_datasets")


CAPTION_4_1 = (
    "In place of Figures 4.1 and 4.4: the classical relay, and the thesis' relay. The thesis' relay falls by η = 0.7 "
    "only, so every cycle (blue, red) starts higher. Solid: rising strain, dashed: falling strain."
)
CAPTION_4_2 = (
    "In place of Figures 4.2, 4.3, 4.5 and 4.6: states of the relays in the Preisach plane, and the output so far "
    "(blue), in the first cycle of the classical model (above) and of the modified one (below), with uniform μ. "
    "Grey: the whole cycle; for the modified model, two cycles. The loop of the modified model does not close."
)
CAPTION_4_7 = (
    "In place of Figure 4.7: the bins, and μ and η as identified from SYNTHETIC Dataset-1. Strain is divided by 15 %, "
    "the full scale. The fitted stretch has switched the operators below the dashed line; above it, the modal "
    "functions keep their value at the line. Densities of the elastic line α = β exceed the scale."
)
CAPTION_4_8 = (
    "In place of Figures 4.8, 4.9 and 4.10: change of resistance over strain and over time, and the residuals of the "
    "models. SYNTHETIC Dataset-1, fitted to 0..200 s (grey); SYNTHETIC Dataset-2, predicted by the same sensors at "
    "twice the strain and rate; SYNTHETIC Dataset-3, fitted to its first two cycles (grey). The residual of "
    "Dataset-2 has a separate scale."
)
