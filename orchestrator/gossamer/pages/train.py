"""The page of a training: errors on held-out cases beside those of the answer 0, stated deviations, loss, provenance."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from gossamer_files.charts import Chart, bars, curve, names_from_top, points, section, with_interval
from gossamer_models.arrays import Matrix, Vector
from gossamer_models.assessment import AlwaysZero, Verdicts, reliability, share
from gossamer_models.assessment.figures import CALL, NOMINAL
from gossamer_models.assessment.plots import COLORS, reliability_chart
from gossamer_models.assessment.tables import error_table
from gossamer_models.detector import DetectorArtifact, PosteriorArtifact
from gossamer_orchestrator.pages import Page, on_page, table

ZERO = AlwaysZero.name
FIRST = "window 1, damaged, "  # records that are drawn case by case
FEW = 100  # held-out records below which figures are rough
DRAWN = 1500  # damaged zones as points
SIZES = 9  # ranges of size that calls are counted in
Errors = Mapping[str, Mapping[str, float]]
Judged = Mapping[str, tuple[Matrix, Verdicts]]


def training_page(name: str, artifact: PosteriorArtifact, judged: Judged) -> Page:
    """Describe a training of a posterior network.

    Parameters
    ----------
    name : str
        What it was trained on.
    artifact : PosteriorArtifact
        What came of it.
    judged : mapping
        True damage and verdicts by kind of record, see ``held_out_verdicts``.
    """
    kinds = [kind for kind in artifact.held_out if ", damaged, " in kind]
    zero, main = artifact.held_out[ZERO], artifact.held_out[kinds[0]]
    lost = [kind for kind in kinds if artifact.held_out[kind]["all zones"] >= zero["all zones"]]
    beside = f"the answer '{ZERO}' is off by {zero['all zones']:.2f} % and {zero['damaged zones']:.2f} %"
    off = f"{main['all zones']:.2f} % damage over all zones and {main['damaged zones']:.2f} % over damaged ones"
    sentence = f"On held-out cases ({kinds[0]}) it is off by {off}; {beside}."
    if len(lost) == len(kinds):
        sentence = f"This detector tells nothing: the answer '{ZERO}' is as good. {sentence}"
    unsure = [kind for kind in kinds if artifact.held_out[kind]["valid"] == 0.0]
    if len(unsure) == len(kinds):
        sentence = f"Not a single record is valid, so no estimate is to be used. {sentence}"
    fewest = min(len(judged[kind][0]) for kind in kinds)
    more = [_line(kind, artifact.held_out[kind]) for kind in kinds]
    if lost:
        more.append(f"The answer '{ZERO}' is as good or better over all zones: {'; '.join(lost)}.")
    if 0 < len(unsure) < len(kinds):
        more.append(f"Not a single record is valid, so no estimate is to be used: {'; '.join(unsure)}.")
    if fewest < FEW:
        more.append(f"Of some kinds only {fewest} records were held out: rough figures.")
    charts = [
        *section("Errors", [_errors(artifact.held_out)]),
        *section("Held-out cases", [*_cases(judged), _by_zone(judged), *_called(judged)]),
        *section("Stated deviations", _stated(judged)),
        *section("Training", _losses(artifact)),
    ]
    return Page(
        title=f"Training of a detector on {name}",
        kind="invalid" if lost or unsure else "none",
        sentence=sentence,
        more=more,
        charts=charts,
        facts="\n".join((on_page(error_table(artifact.held_out)), _trained_over(artifact), _provenance(artifact))),
        how="Everything is of cases that were neither trained nor calibrated on, but for the loss.",
    )


def thesis_page(name: str, artifact: DetectorArtifact, found: Errors) -> Page:
    """Describe one of the thesis' trainings; ``found`` has the errors of the detector, and those that the thesis prints."""
    own = {kind: row for kind, row in found.items() if not kind.endswith(": the thesis")}
    lines = [
        f"{kind}: off by {row['damaged zones']:.2f} % damage over damaged zones; the thesis prints "
        f"{found[f'{kind}: the thesis']['damaged zones']:.2f} %."
        for kind, row in own.items()
    ]
    return Page(
        title=f"Training of the thesis' detector, {name}",
        sentence=lines[0],
        more=lines[1:],
        charts=[_errors(found)],
        facts=on_page(error_table(found)) + _provenance(artifact),
        how="The test cases are those of the thesis, in their first window.",
    )


def _line(kind: str, row: Mapping[str, float]) -> str:
    band = f"; {100.0 * row['in 95 % band']:.1f} % of damages within the stated 95 % band" if "in 95 % band" in row else ""
    return (
        f"{kind}: off by {row['all zones']:.2f} % over all zones, {row['damaged zones']:.2f} % over damaged ones{band}; "
        f"{100.0 * row['valid']:.1f} % of records valid, {100.0 * row['false calls']:.1f} % with a false call."
    )


def _errors(found: Errors) -> Chart:
    kinds = [kind for kind, row in found.items() if "damaged zones" in row]
    names = [kind.replace(", damaged", "") for kind in kinds]
    traces = [
        bars(zones, [found[kind][zones] for kind in kinds], names, color) | {"orientation": "h"}
        for zones, color in (("all zones", "@0"), ("damaged zones", "@1"))
    ]
    layout = {"barmode": "group", "yaxis": names_from_top(names)}
    return Chart("Mean absolute error", "error [% damage]", "damaged cases", traces, layout=layout, broad=True)


def _first(judged: Judged) -> dict[str, tuple[Matrix, Verdicts]]:
    """Return what was said of damaged records in the first window, by their noise."""
    return {kind.removeprefix(FIRST): pair for kind, pair in judged.items() if kind.startswith(FIRST)}


def _some(count: int) -> Vector:
    """Return which of many damaged zones are drawn, evenly chosen."""
    return np.unique(np.linspace(0, count - 1, min(count, DRAWN)).round().astype(int))


def _cases(judged: Judged) -> list[Chart]:
    """Draw the estimates of damaged zones over the truth."""
    charts = []
    for noise, (damage, verdicts) in _first(judged).items():
        records, zones = np.nonzero(damage > 0.0)
        some = _some(len(records))
        records, zones = records[some], zones[some]
        true, estimated = 100.0 * damage[records, zones], 100.0 * verdicts.damage[records, zones]
        valid, ends = verdicts.valid[records], [0.0, float(true.max())]
        traces = [
            points("not valid", true[~valid], estimated[~valid], "@grey", size=4),
            points("valid", true[valid], estimated[valid], "@0", size=4),
            curve("right", ends, ends, "@ink", dash="dash"),
        ]
        note = f"Damaged zones of the first window; {len(some)} of {int((damage > 0.0).sum())}, evenly chosen."
        title = f"Estimated over true damage, {noise}"
        charts.append(Chart(title, "true damage [%]", "estimated damage [%]", traces, note=note))
    return charts


def _by_zone(judged: Judged) -> Chart:
    """Draw the mean absolute error of each zone where it is damaged."""
    traces = []
    for color, (noise, (damage, verdicts)) in zip(COLORS, _first(judged).items(), strict=False):
        there = damage > 0.0
        error = np.where(there, np.abs(verdicts.damage - damage), 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
        traces.append(
            bars(noise, np.arange(1, damage.shape[1] + 1), np.where(there.any(axis=0), 100.0 * error, np.nan), color)
        )
    layout = {"barmode": "group", "xaxis": {"dtick": 1}}
    title = "Mean absolute error of a zone where it is damaged"
    return Chart(title, "zone", "error [% damage]", traces, layout=layout, broad=True)


def _stated(judged: Judged) -> list[Chart]:
    traces = []
    for kind, (damage, verdicts) in judged.items():
        observed = reliability(damage, verdicts) if ", damaged, " in kind else np.full(1, np.nan)
        if np.isfinite(observed).all():
            window = int(kind.split()[1].strip(",")) - 1
            dash = "dash" if "no noise" in kind else "solid"
            traces.append(curve(kind.replace(", damaged", ""), NOMINAL, observed, COLORS[window % len(COLORS)], dash=dash))
    return [reliability_chart(traces, "Damaged zones of valid records.")] if traces else []


def _called(judged: Judged) -> list[Chart]:
    """Draw the share of damaged zones that are called, by size."""
    traces = []
    for color, (noise, (damage, verdicts)) in zip(COLORS, _first(judged).items(), strict=False):
        records, zones = np.nonzero(damage > 0.0)
        size, called = damage[records, zones], verdicts.valid[records] & (verdicts.damage[records, zones] > CALL)
        edges = np.linspace(size.min(), size.max(), SIZES + 1)
        place = np.clip(np.searchsorted(edges, size, side="right") - 1, 0, SIZES - 1)
        shares = [share(called[place == k]) for k in range(SIZES)]
        middle = 50.0 * (edges[1:] + edges[:-1])
        trace = points(noise, middle, [100.0 * each.value for each in shares], color)
        traces.append(with_interval(trace, [100.0 * each.low for each in shares], [100.0 * each.high for each in shares]))
    note = (
        f"A call is a valid estimate above {100.0 * CALL:g} %; bars are 95 % intervals. First window, most with other "
        "damaged zones; 'gossamer assess-detector' finds a90/95 from single damages."
    )
    title, layout = "Damaged zones that are called", {"yaxis": {"range": [0, 102]}}
    chart = Chart(title, "damage of the zone [%]", "share [%]", traces, note=note, layout=layout, broad=True)
    return [chart] if traces else []


def _losses(artifact: PosteriorArtifact) -> list[Chart]:
    if not artifact.losses:
        return []
    traces = [
        curve(f"window {number}", np.arange(1, len(loss) + 1), loss, COLORS[(number - 1) % len(COLORS)])
        for number, loss in enumerate(artifact.losses, start=1)
    ]
    note = "Of training cases, with fresh noise in every epoch. Until three quarters, most cases are moved to other damages."
    title = "Mean negative log likelihood of a case"
    return [Chart(title, "epoch", "loss [1]", traces, note=note, broad=True)]


def _trained_over(artifact: PosteriorArtifact) -> str:
    rows = [(name, f"{low:g} to {high:g}") for name, (low, high) in artifact.trained_over.items()]
    return table(("quantity", "range"), rows, "What the detector is trained over")


def _provenance(artifact: PosteriorArtifact | DetectorArtifact) -> str:
    return table((), artifact.provenance.items(), "How the detector was made")
