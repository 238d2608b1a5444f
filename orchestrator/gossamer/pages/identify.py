"""The page of an identification."""

from __future__ import annotations

from pathlib import Path

from gossamer_models.automatic import HERE, defeats
from gossamer_models.fractional import FractionalFit
from gossamer_models.identify import Identified
from gossamer_models.plots import record_charts
from gossamer_models.sensor import SensorArtifact
from gossamer_models.sensor.fit import PreisachFit
from gossamer_models.sensor.fit.doubts import parameters
from gossamer_models.sensor.plots import sensor_charts
from gossamer_models.tables import (
    error_table,
    fractional_facts,
    parameter_table,
    preisach_facts,
    relaxation_table,
    standing_table,
    trial_table,
)
from gossamer_orchestrator.pages import Page, folded, on_page, table
from gossamer_orchestrator.pages.page import Kind

from . import facts
from .comparison import Comparison, comparison_chart, verdict

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
    compared = comparisons(result)
    charts = []
    for k, record in enumerate(fit.records):
        here = [each for each in compared if each.record == record.name]
        charts += [*record_charts(result.modelled(k)), *([comparison_chart(here, record.name)] if here else [])]
    if isinstance(fit.artifact, SensorArtifact):
        charts += sensor_charts(fit.artifact)
    kind, sentence, more = verdict(compared, "test stretch") if compared else _untested(result)
    told = set(defeats(result.standings))  # the verdict says it
    return Page(
        title=f"Sensor identified from {facts.names_of([record.name for record in fit.records])}",
        kind=kind,
        sentence=sentence,
        more=[*more, *(text for text in result.remarks if text not in told)],
        charts=charts,
        facts="\n".join(
            (
                on_page(error_table(result, rest)),
                on_page(standing_table(result)),
                _trials(result),
                facts.read_as(fit.records),
                sensor_tables(fit),
                facts.provenance(fit.artifact.provenance, without=("data", "sha256", "doubts")),
                facts.work(facts.digests([artifact, *files]), seconds),
            )
        ),
        how=facts.HOW,
    )


def comparisons(result: Identified) -> list[Comparison]:
    """Return the errors on the test stretches beside those of the rivals; none without a test stretch."""
    found = []
    for own in (each for each in result.standings if each.model == HERE):
        others = [each for each in result.standings if each.record == own.record and each.model != HERE]
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


def _trials(result: Identified) -> str:
    """Return what an automatic choice tried."""
    inner = on_page(trial_table(result, MOST_TRIALS))
    return folded(f"{len(result.trials)} trials of the automatic choice", inner) if inner else ""


def sensor_tables(fit: PreisachFit | FractionalFit) -> str:
    """Return what the sensor consists of, its relaxation terms and the fitted parameters as tables in HTML."""
    if isinstance(fit, FractionalFit):
        return table((), fractional_facts(fit.artifact), "The sensor") + table(*parameter_table(fit.parameters))
    (known, _), terms = parameters(fit), relaxation_table(fit.artifact.relaxation)
    inner = on_page(terms) or "<p>The sensor has no relaxation.</p>"
    return (
        table((), preisach_facts(fit), "The sensor")
        + (folded(f"{len(terms.rows)} relaxation terms", inner) if len(terms.rows) > FEW else inner)
        + folded(f"{len(known)} fitted parameters", table(*parameter_table(known)))
    )
