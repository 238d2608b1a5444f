"""The page of a fit of the digital twin: damage of each zone, how well it explains the record, what else was fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gossamer_files.charts import Chart, band, curve, heat, points, section
from gossamer_files.tables import TableText
from gossamer_models.arrays import Matrix, Vector
from gossamer_models.twin import Answer, StaticRecord
from gossamer_orchestrator.pages import Page, table
from gossamer_orchestrator.pages.page import Kind
from gossamer_orchestrator.results.dataset import zone_label
from gossamer_orchestrator.words import between, uncertain

# of what is fitted beside damage; the others are ratios
NUISANCE_UNITS = {"phase": "rad", "pressure": "Pa", "place_along": "m", "place_across": "m"}


def twin_page(names: Sequence[str], answer: Answer, compared: str, *, shown: bool) -> Page:
    """Describe what the twin says of records, and how what the sensors read compares with it.

    Parameters
    ----------
    names : sequence of str
        Of the records.
    answer : Answer
        What was fitted.
    compared : str
        A sentence if only the beginning of the record was compared.
    shown : bool
        Whether the zones are shown, not withheld.
    """
    labels = [zone_label(name) for name in answer.zones]
    parts = []
    for z in np.flatnonzero(answer.damage > 0.0).tolist():
        together = [z, *(k for k, name in enumerate(answer.zones) if name in answer.together_with[z])]
        if z == min(together):  # once for all that are answered together
            which = f"zone{'s' * (len(together) > 1)} {' and '.join(labels[k] for k in together)}"
            parts.append(f"{which} by {_damage_text(answer, z)} %")
    parts += [f"{each.name} by {100.0 * each.share:.3g} %" for each in answer.faults if each.share > 0.0]
    kind: Kind = "invalid" if not answer.valid else "damage" if parts else "healthy"
    record = answer.record
    static = isinstance(record, StaticRecord)
    when = f"in {record.states} load states" if static else f"in the first {record.step * record.samples:.3g} s"
    when = f"by {len(names)} records together" if answer.records else when
    said = f"damaged {when}: {', '.join(parts)}" if parts else f"no zone is damaged {when}"
    sentence = f"{said[0].upper()}{said[1:]}."
    if answer.growth is not None:
        grown = [f"{labels[k]} by {_growth_text(answer, k)} %" for k in np.flatnonzero(answer.growth > 0.0).tolist()]
        sentence += f" Grown since the last inspection: {', '.join(grown) or 'none'}."
        said += f"; grown: {', '.join(grown) or 'none'}"
    if not answer.valid:
        not_used = f" What it says, not to be used: {said}." if shown else " The damage of the zones is withheld."
        sentence = f"Not valid.{not_used}"
    explained = "within" if answer.chi2_per_sample <= answer.chi2_bound else "ABOVE"
    more = [f"{doubt[0].upper()}{doubt[1:]}." for doubt in answer.doubts] + [
        *filter(None, (answer.further * shown, compared))
    ]
    more.append(
        f"Chi2 per sample, the mean square of what the twin leaves unexplained over that of the noise, is "
        f"{answer.chi2_per_sample:.3f}, {explained} its bound of {answer.chi2_bound:.3f}, which a right model passes in "
        "999 of 1000 records."
    )
    if answer.unresolved:
        more.append(f"The record cannot tell the damage of zones {', '.join(labels[k - 1] for k in answer.unresolved)}.")
    return Page(
        title=f"Digital twin of {' and '.join(names)}",
        kind=kind,
        sentence=sentence,
        more=more,
        charts=[
            *(section("Damage", _damage(answer)) if shown else []),
            *(
                chart
                for name, each in zip(names, answer.records or (answer,), strict=True)
                for chart in _histories(each, name if answer.records else "")
            ),
        ],
        facts=_facts(answer, shown=shown),
        how="Bars of damage and the band of noise are one standard deviation wide to each side. A zone whose "
        "deviation is above 2 points has no value, but bounds that hold in 95 of 100 records. What sensors read by the "
        "answer is without the model error that the fit allows for.",
    )


def _damage_text(answer: Answer, zone: int) -> str:
    """Return the damage of a zone [%] with its deviation, or the bounds of one that is not determined."""
    if answer.determined[zone]:
        return f"{100.0 * answer.damage[zone]:.2f} ± {100.0 * answer.deviation[zone]:.2f}"
    return between(*(100.0 * answer.bounds[zone]))


def _growth_text(answer: Answer, zone: int) -> str:
    """Return what has grown in a zone since the last inspection [%], with its deviation."""
    assert answer.growth is not None
    assert answer.growth_deviation is not None
    return f"{100.0 * answer.growth[zone]:.2f} ± {100.0 * answer.growth_deviation[zone]:.2f}"


def zone_cells(answer: Answer, *, shown: bool) -> TableText:
    """Return damage and probability of damage, a row for each zone; withheld where they are not shown."""
    labels = dict(zip(answer.zones, map(zone_label, answer.zones), strict=True))
    remarks = [
        f"with {', '.join(labels[other] for other in others)}" if others else "cannot tell" * (k + 1 in answer.unresolved)
        for k, others in enumerate(answer.together_with)
    ]
    said: list[tuple[str, ...]]
    said = [(_damage_text(answer, k), f"{P:.3f}") if shown else ("withheld", "") for k, P in enumerate(answer.probability)]
    head = ["zone", "damage [%]", "P(damaged)"]
    if answer.growth is not None and answer.growth_probability is not None:
        head += ["grown [%]", "P(grown)"]
        grown = [(_growth_text(answer, k), f"{P:.3f}") for k, P in enumerate(answer.growth_probability)]
        said = [(*cells, *(more if shown else ("", ""))) for cells, more in zip(said, grown, strict=True)]
    rows = [
        (label, *cells, *[remark] * any(remarks))
        for label, cells, remark in zip(labels.values(), said, remarks, strict=True)
    ]
    return TableText((*head, *["remark"] * any(remarks)), rows, "Digital twin")


def explanation_cells(answer: Answer, *, shown: bool) -> list[TableText]:
    """Return what explains the records with its probability, and the faults, where these were weighed and are shown."""
    if not (answer.faults and shown):
        return []
    explained = [
        (f"{probability:.3f}", " and ".join(what) or "nothing is wrong") for probability, what in answer.explanations
    ]
    faults = [
        (fault.name, uncertain(100.0 * fault.share, 100.0 * fault.deviation, "%"), f"{fault.probability:.3f}")
        for fault in answer.faults
    ]
    return [
        TableText(("probability", "explanation"), explained, "Explanations"),
        TableText(("fault", "by", "P(fault)"), faults, "Beside damage"),
    ]


def nuisance_cells(answer: Answer) -> list[tuple[str, str]]:
    """Return name and value with its standard deviation of what was fitted beside damage, and how far sensors are off."""
    cells = []
    for name, (value, deviation) in answer.nuisances.items():
        unit = NUISANCE_UNITS.get(name.partition("[")[0], "")
        factor, unit = (1e3, "mm") if unit == "m" else (1.0, unit)
        cells.append((name, uncertain(factor * value, factor * deviation, unit)))
    for k, (error, offset) in enumerate(zip(answer.sensor_errors, answer.sensor_offsets, strict=True), 1):
        if error is not None and offset is not None:
            off = f"{100.0 * error:.2g} % of its range, beside an offset of {100.0 * offset:.2g} %"
            cells.append((f"sensor {k} off its model", off))
    return cells


def damage_chart(names: Sequence[str], damage: Vector, deviation: Vector, bounds: Matrix | None = None) -> Chart:
    """Draw the damage [1] of each zone with its standard deviation; where it is none, its bounds, shape (zones, 2)."""
    zones, bare = np.arange(1, len(names) + 1), np.isnan(damage)
    traces = [points("damage", zones, 100.0 * damage, "@0", 100.0 * deviation)]
    if bounds is not None and bare.any():
        low, high = 100.0 * bounds[bare].T
        traces.append(points("bounds, 95 %", zones[bare], (low + high) / 2.0, "@grey", (high - low) / 2.0, opacity=0.0))
    axis = {"tick0": 1, "dtick": 1, "tickangle": 0, "tickfont": {"size": 11}, "range": [0.4, len(zones) + 0.6]}
    labels = [zone_label(name) for name in names]
    if labels != [str(k) for k in zones]:
        axis |= {"tickmode": "array", "tickvals": zones.tolist(), "ticktext": labels, "tickangle": -45}
    return Chart("Damage", "zone", "damage [%]", traces, layout={"xaxis": axis, "showlegend": len(traces) > 1})


def answer_chart(answer: Answer) -> Chart:
    """Draw the damage of each zone that is determined, and the bounds of the others."""
    return damage_chart(answer.zones, answer.value, answer.deviation, answer.bounds)


def _damage(answer: Answer) -> list[Chart]:
    zones, damage = np.arange(1, len(answer.damage) + 1), answer_chart(answer)
    layout = {**damage.layout, "yaxis": {"range": [-0.03, 1.03]}, "showlegend": False}
    probability = points("P", zones, answer.probability, "@1")
    charts = [damage, Chart("Probability of damage", "zone", "P(damaged) [1]", [probability], layout=layout)]
    kept = np.flatnonzero(answer.damage > 0.0)
    if kept.size > 1:
        deviation = answer.deviation[kept]
        correlation = answer.covariance[np.ix_(kept, kept)] / np.outer(deviation, deviation)
        names = [zone_label(answer.zones[z]) for z in kept]
        category = {axis: {"type": "category"} for axis in ("xaxis", "yaxis")}
        cells = heat(names, names, correlation, "[1]", zmin=-1.0, zmax=1.0, colorscale="RdBu")
        charts.append(Chart("Correlation of the damages", "zone", "zone", [cells], layout=category))
    return charts


def _histories(answer: Answer, name_of_record: str = "") -> list[Chart]:
    """Draw for each sensor its record and what it reads by the answer, and the difference of both."""
    record = answer.record
    static = isinstance(record, StaticRecord)
    time = np.arange(1, record.samples + 1) * (1.0 if static else record.step)
    axis = "reading" if static else "time [s]"
    factor, unit = (100.0, "%") if record.kind == "strain" else (1.0, "ohm")
    noise = factor * np.broadcast_to(record.noise_deviation(), len(record.values))
    charts = []
    for k in record.sensors:
        measured, read = factor * record.values[k], factor * answer.predicted[k]
        traces = [curve("record", time, measured, "@grey"), curve("by the answer", time, read, "@0", width=1.5)]
        left = [
            *band("± 1 deviation of the noise", time[[0, -1]], np.full(2, -noise[k]), np.full(2, noise[k]), "@1"),
            curve("record less answer", time, measured - read, "@grey"),
        ]
        name, y = f"{name_of_record and f'{name_of_record}, '}Sensor {answer.order[k]}", f"{record.kind} [{unit}]"
        pair = [Chart(title, axis, y, some, linked="time") for title, some in ((name, traces), ("Difference", left))]
        charts += section(name, pair)
    return charts


def _facts(answer: Answer, *, shown: bool) -> list[str | TableText]:
    nuisances = nuisance_cells(answer)
    rows = [
        ("Values that were fitted", answer.samples),
        ("Simulated cases", answer.simulations),
        ("Sensors left out", ", ".join(map(str, answer.left_out)) or "none"),
        ("Order of the sensors", ", ".join(map(str, answer.order))),
    ]
    beside = table(("quantity", "value"), nuisances, "What else was fitted") if nuisances else ""
    each = [
        (k, f"{record.chi2_per_sample:.3f}", f"{record.chi2_bound:.3f}", _own_of(record, answer))
        for k, record in enumerate(answer.records, 1)
    ]
    head = ("record", "chi2 per sample", "bound", "of this record alone")
    records = [table(head, each, "Records")] * bool(each)
    return [
        zone_cells(answer, shown=shown),
        *explanation_cells(answer, shown=shown),
        beside,
        *records,
        table((), rows, "The fit"),
    ]


def _own_of(record: Answer, answer: Answer) -> str:
    """Return what was fitted of one record alone."""
    return ", ".join(f"{name} {text}" for name, text in nuisance_cells(record) if name not in answer.nuisances)
