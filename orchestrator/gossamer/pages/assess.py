"""The page of an assessment: an identified sensor judged on other records."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gossamer_files.charts import Chart, curve, section
from gossamer_files.tables import TableText
from gossamer_models.automatic.compare import RIVALS
from gossamer_models.plots import record_charts
from gossamer_models.review import Judged
from gossamer_models.sensor import SensorArtifact
from gossamer_orchestrator.pages import Page, folded, on_page

from . import facts
from .comparison import Comparison, comparison_chart, verdict

CUBIC = RIVALS[0]


def assessment_page(
    judged: Sequence[Judged], sensor: Path, files: Sequence[Path], shown: Sequence[TableText], seconds: float
) -> Page:
    """Return the page of an assessment.

    Parameters
    ----------
    judged : sequence of Judged
        What was found, a record each.
    sensor : Path
        Artifact of the sensor.
    files : sequence of Path
        Files of the records.
    shown : sequence of TableText
        Errors and scales.
    seconds : float
        How long it took [s].
    """
    charts: list[Chart] = []
    compared: list[Comparison] = []
    for each in judged:
        here = comparisons(each)
        charts += record_charts(each.modelled)
        charts += [comparison_chart(here, each.record.name), *_scales(each)]
        compared += here
    stretch = "judged stretch" if "judged" in judged[0].stretches() else "first stretch"
    kind, sentence, more = verdict(compared, stretch)
    known = "fitted scales and the cubic know" if judged[0].scales else "the cubic knows, and the sensor does not"
    more.append(
        f"Nothing of the sensor was fitted anew{' but the scales' * bool(judged[0].scales)}. The first stretch of a "
        f"record is what {known}."
    )
    more += [text for each in judged for text in each.sentences() if text not in each.defeats()]  # the verdict says these
    return Page(
        title=f"Sensor {sensor.name} judged on {facts.names_of([each.record.name for each in judged])}",
        kind="invalid" if any(each.known for each in judged) else kind,
        sentence=sentence,
        more=more,
        charts=charts,
        facts="\n".join(
            (
                *map(on_page, shown),
                facts.read_as([each.record for each in judged]),
                folded("How the sensor was made", facts.provenance(SensorArtifact.read(sensor).provenance)),
                facts.work(facts.digests([sensor, *files]), seconds),
            )
        ),
        how=facts.HOW,
    )


def comparisons(judged: Judged) -> list[Comparison]:
    """Return the errors of the sensor on what is judged of a record, beside those of the cubic."""
    found = []
    for name, (own, cubic) in judged.intervals().items():
        quantity, does = ("resistance", "is predicted") if name == "resistance" else ("strain", "is recovered")
        if name != "resistance" and len(judged.recovered) > 1:
            quantity = f"strain by {name}"
        found.append(Comparison(record=judged.record.name, quantity=quantity, does=does, own=own, rivals={CUBIC: cubic}))
    return found


def _scales(judged: Judged) -> list[Chart]:
    """Return gain and offset over time where they were fitted."""
    scales, record = judged.scales, judged.record
    if scales is None:
        return []
    linked, y = f"time of {record.name}", "[unit of the resistance]"
    charts = []
    for name, values, last in (("gain", scales.gain, scales.last_gain), ("offset", scales.offset, scales.last_offset)):
        note, layout = f"{last:.5g} once nothing relaxes any more.", {"showlegend": False}
        text = f"The {name} changes from {values[0]:.5g} to {values[-1]:.5g}; once nothing relaxes, {last:.5g}."
        traces = [curve(name, record.time, values)]
        charts.append(
            Chart(f"Fitted {name}", "time [s]", f"{name} {y}", traces, note=note, text=text, layout=layout, linked=linked)
        )
    return section(record.name, charts)
