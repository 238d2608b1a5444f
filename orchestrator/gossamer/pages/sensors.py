"""The pages of sensors: one that was identified, and one that was judged on other records, beside what it must beat."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from gossamer_files import digest
from gossamer_files.charts import Chart, bars, curve, section, with_interval
from gossamer_files.tables import TableText
from gossamer_models import tables
from gossamer_models.automatic import HERE, defeats
from gossamer_models.automatic.compare import LESS, RIVALS, Interval, clearly_less
from gossamer_models.fitting import Record
from gossamer_models.fractional import FractionalFit
from gossamer_models.identify import Identified
from gossamer_models.plots import record_charts
from gossamer_models.review import Judged
from gossamer_models.sensor import SensorArtifact
from gossamer_models.sensor.fit import PreisachFit
from gossamer_models.sensor.fit.doubts import parameters
from gossamer_models.sensor.plots import sensor_charts
from gossamer_orchestrator.pages import Page, folded, on_page, table
from gossamer_orchestrator.pages.page import Kind

PACKAGES = ("gossamer", "numpy", "scipy", "casadi")
HOW = (
    "Of more than 5000 samples, curves over time show the smallest and the largest of each of 2500 parts, and loops those "
    "of strain and of resistance, so that no peak is lost. All numbers are of all samples."
)
CUBIC = RIVALS[0]
LARGER = "with more error, though the intervals overlap, than"
MOST_TRIALS = 100  # of each stage
FEW = 8  # relaxation terms that need no folding


def identification_page(result: Identified, artifact: Path, files: list[Path], rest: str, seconds: float) -> Page:
    """Return the page of an identification.

    Parameters
    ----------
    result : Identified
        What was found.
    artifact : Path
        Its file.
    files : list of Path
        Files of the records.
    rest : str
        The resistance from which changes count, in words.
    seconds : float
        How long it took [s].
    """
    fit = result.fit
    compared = _comparisons(result)
    charts = []
    for k, record in enumerate(fit.records):
        here = [each for each in compared if each.record == record.name]
        charts += [*record_charts(result.modelled(k)), *([_comparison_chart(here)] if here else [])]
    if isinstance(fit.artifact, SensorArtifact):
        charts += sensor_charts(fit.artifact)
    kind, sentence, more = verdict(compared, "test stretch") if compared else _untested(result)
    told = set(defeats(result.standings))  # the verdict says it
    trials = on_page(tables.trial_table(result, MOST_TRIALS))
    return Page(
        title=f"Sensor identified from {_names_of(fit.records)}",
        kind=kind,
        sentence=sentence,
        more=[*more, *(text for text in result.remarks if text not in told)],
        charts=charts,
        facts=[
            tables.error_table(result, rest),
            tables.standing_table(result),
            tables.own_table(result),
            folded(f"{len(result.trials)} trials of the automatic choice", trials) if trials else "",
            tables.recognised_table(fit.records),
            _sensor_tables(fit),
            _provenance(fit.artifact.provenance, without=("data", "sha256", "doubts")),
            _work([artifact, *files], seconds),
        ],
        how=HOW,
    )


def _comparisons(result: Identified) -> list[Comparison]:
    """Return the errors on the test stretches beside those of the rivals; none without a test stretch."""
    found = []
    for own in (each for each in result.standings if each.model == HERE):
        others = [each for each in result.standings if each.record == own.record and each.model in RIVALS]
        for quantity, does in (("resistance", "is predicted"), ("strain", "is recovered")):
            name = "forward" if quantity == "resistance" else "strain"
            if (error := getattr(own, name)) is not None:
                rivals = {other.model: getattr(other, name) for other in others}
                known = {model: rival for model, rival in rivals.items() if rival is not None}
                found.append(Comparison(record=own.record, quantity=quantity, does=does, own=error, rivals=known))
    return found


def _untested(result: Identified) -> tuple[Kind, str, list[str]]:
    """Say that every sample was fitted."""
    fitted = ", ".join(f"{each.nrmse:.2f} % of {each.record}" for each in result.errors)
    return (
        "none",
        f"No test stretch: every sample was fitted, with errors of the resistance (NRMSE) of {fitted}. They say nothing of "
        "other records.",
        [],
    )


def _sensor_tables(fit: PreisachFit | FractionalFit) -> str:
    """Return what the sensor consists of, its relaxation terms and the fitted parameters as tables in HTML."""
    if isinstance(fit, FractionalFit):
        return table((), tables.fractional_facts(fit.artifact), "The sensor") + table(
            *tables.parameter_table(fit.parameters)
        )
    (known, _), terms = parameters(fit), tables.relaxation_table(fit.artifact.relaxation)
    inner = on_page(terms) or "<p>The sensor has no relaxation.</p>"
    return (
        table((), tables.preisach_facts(fit), "The sensor")
        + (folded(f"{len(terms.rows)} relaxation terms", inner) if len(terms.rows) > FEW else inner)
        + folded(f"{len(known)} fitted parameters", table(*tables.parameter_table(known)))
    )


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
        here = _judged_comparisons(each)
        charts += record_charts(each)
        charts += [_comparison_chart(here), *_scales(each)]
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
        title=f"Sensor {sensor.name} judged on {_names_of([each.record for each in judged])}",
        kind="invalid" if any(each.known for each in judged) else kind,
        sentence=sentence,
        more=more,
        charts=charts,
        facts=[
            *shown,
            tables.recognised_table([each.record for each in judged]),
            folded("How the sensor was made", _provenance(SensorArtifact.read(sensor).provenance)),
            _work([sensor, *files], seconds),
        ],
        how=HOW,
    )


def _judged_comparisons(judged: Judged) -> list[Comparison]:
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
    linked, y, charts = f"time of {record.name}", "[unit of the resistance]", []
    for name, values, last in (("gain", scales.gain, scales.last_gain), ("offset", scales.offset, scales.last_offset)):
        note, layout = f"{last:.5g} once nothing relaxes any more.", {"showlegend": False}
        text = f"The {name} changes from {values[0]:.5g} to {values[-1]:.5g}; once nothing relaxes, {last:.5g}."
        traces = [curve(name, record.time, values)]
        charts.append(
            Chart(f"Fitted {name}", "time [s]", f"{name} {y}", traces, note=note, text=text, layout=layout, linked=linked)
        )
    return section(record.name, charts)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Errors of a sensor and of its rivals in one quantity of one record.

    Attributes
    ----------
    record, quantity : str
        Where, and what: "resistance", "strain".
    does : str
        What is done with the quantity, for instance "is predicted".
    own : tuple of float
        NRMSE of the sensor [% of range].
    rivals : mapping of str to tuple of float
        Those of the rivals.
    """

    record: str
    quantity: str
    does: str
    own: Interval
    rivals: Mapping[str, Interval]

    @property
    def beaten(self) -> bool:
        """Whether the error of a rival is clearly smaller."""
        return any(clearly_less(rival, self.own) for rival in self.rivals.values())

    @property
    def ahead(self) -> bool:
        """Whether the error is clearly smaller than that of every rival."""
        return all(clearly_less(self.own, rival) for rival in self.rivals.values())

    @property
    def sentence(self) -> str:
        """Say the error and how it stands beside those of the rivals; overlapping intervals leave that open."""
        value, low, high = self.own
        order = ("better than", "not clearly better than", "no better than", LARGER, "worse than")
        words: dict[str, list[str]] = {word: [] for word in order}
        for name, rival in self.rivals.items():
            if clearly_less(rival, self.own):
                word = "worse than"
            elif rival[0] < value:
                word = LARGER if rival[0] < LESS * value else "no better than"
            else:
                word = "better than" if clearly_less(self.own, rival) else "not clearly better than"
            words[word].append(f"a {name} ({rival[0]:.2f} %)")
        compared = "; ".join(f"{word} {' and '.join(names)}" for word, names in words.items() if names)
        error = f"{value:.2f} % (90 % interval {low:.2f} to {high:.2f} %)"
        return f"{self.quantity.capitalize()} {self.does} with an error of {error}{': ' * bool(compared)}{compared}."


def verdict(comparisons: Sequence[Comparison], stretch: str) -> tuple[Kind, str, list[str]]:
    """Return what a page says first, and a sentence for each record and quantity where there are several records.

    Parameters
    ----------
    comparisons : sequence of Comparison
        At least one.
    stretch : str
        Part of each record that the errors are of.
    """
    kind: Kind = "healthy" if all(each.ahead for each in comparisons) else "none"
    kind = "invalid" if any(each.beaten for each in comparisons) else kind
    records = list(dict.fromkeys(each.record for each in comparisons))
    unit = "Errors are root mean squares in % of the range of the record (NRMSE)."
    if len(records) == 1:
        return kind, f"On the {stretch} of {records[0]}: {' '.join(each.sentence for each in comparisons)}", [unit]
    parts = []
    for quantity, does in dict.fromkeys((each.quantity, each.does) for each in comparisons):
        errors = [each.own[0] for each in comparisons if each.quantity == quantity]
        parts.append(f"{quantity} {does} with errors of {min(errors):.2f} to {max(errors):.2f} %")
    beaten = sum(each.beaten for each in comparisons)
    rest = f"in {beaten} of {len(comparisons)} comparisons" if beaten else "nowhere"
    names = " or a ".join(dict.fromkeys(name for each in comparisons for name in each.rivals))
    sentence = f"On the {stretch}es of {len(records)} records {' and '.join(parts)}; a {names} is clearly better {rest}."
    return kind, sentence, [unit, *(f"{each.record}: {each.sentence}" for each in comparisons)]


def _comparison_chart(comparisons: Sequence[Comparison]) -> Chart:
    """Return a picture of the errors of one record."""
    quantities, traces = [each.quantity for each in comparisons], []
    for name, color in zip([HERE, *comparisons[0].rivals], ("@0", "@grey", "@3"), strict=False):
        value, low, high = np.array([each.own if name == HERE else each.rivals[name] for each in comparisons]).T
        ends = np.minimum(low, value), np.maximum(high, value)
        traces.append(with_interval(bars(name, quantities, value, color), *ends, color="@ink"))
    title, y = "Error beside that of simple models", "NRMSE [% of range]"
    note = "Lines: 90 % confidence from blocks of the samples. Lower is better."
    text = " ".join(each.sentence for each in comparisons)
    layout = {"barmode": "group", "yaxis": {"rangemode": "tozero"}}
    return Chart(title, "", y, traces, note=note, text=text, layout=layout, section=comparisons[0].record)


def _names_of(records: Sequence[Record]) -> str:
    """Name one or two records; count more."""
    return " and ".join(each.name for each in records) if len(records) < 3 else f"{len(records)} records"


def _work(files: Sequence[Path], seconds: float) -> str:
    """Return names of files with their digests, versions, and how long it took [s] as a table."""
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    rows = [(f"SHA-256 of {path.name}", digest(path)) for path in files]
    rows += [("Versions", f"{versions}, Python {platform.python_version()}"), ("Wall time", f"{seconds:.3g} s")]
    return table((), rows, "Files and versions")


def _provenance(told: Mapping[str, str], without: Sequence[str] = ()) -> str:
    """Return how a sensor was made as a table, ``without`` what stands elsewhere on a page."""
    rows = [(name, text) for name, text in told.items() if text and name not in without]
    return table((), rows, "How the sensor was made")
