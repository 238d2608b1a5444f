"""``gossamer assess-detector``: how good a detector and the twin are, in figures that an inspector asks for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .command import Result, show, stderr
from .common import keep_inputs, model_errors, note_page, save_page

if TYPE_CHECKING:
    from gossamer_models.assessment import AssessmentResults

UNITS = {"error_all": "% damage", "error_damaged": "% damage", "a50": "1", "a90": "1", "a90_95": "1"}
TWIN_RECORDS, TWIN_SIZES = 6, 3  # records of a condition, sizes of damage in each zone that the twin has time for


def assess_detector(
    artifact: Annotated[
        list[Path] | None,
        typer.Option(
            help="Trained detector: its file, or nominal, wide or single_damage; may be repeated. These three by default.",
            metavar="FILE",
        ),
    ] = None,
    twin: Annotated[bool, typer.Option("--twin", help="The digital twin too, on few records: it takes long.")] = False,
    cases: Annotated[
        int, typer.Option(help="Records of each condition; a fifth as many sizes of damage in each zone.", min=4)
    ] = 400,
    out: Annotated[Path, typer.Option(help="Folder of results, pictures and simulations.", metavar="FOLDER")] = Path(
        "out/assessment"
    ),
) -> Result:
    """Assess damage detection.

    Simulates records under many conditions (noise, load, material, sensors, another mesh), asks every detector for the
    damage, and compares: errors, false calls, reliability of stated deviations, confusion of zones, and the probability of
    detection against size with a90/95 of each zone, after MIL-HDBK-1823A. Prints the paths of results and pictures, and of
    report.html, the page of the assessment. Run it again to go on after an interruption: finished simulations are kept, and
    so is what the twin said.

    For example:

        gossamer assess-detector

        gossamer assess-detector --artifact mine.json --twin --cases 100 --out out/mine
    """
    from gossamer.pages.assess_detector import condition_table, detection_table

    from ..pages import PAGE
    from .tables import printed

    found, paths = assess_given(artifact, twin=twin, cases=cases, out=out)
    stderr().print(printed(condition_table(found)))
    stderr().print(printed(detection_table(found)))
    for path in paths:
        show(path)
    if out / PAGE in paths:
        note_page(out / PAGE)
    return Result({"files": paths, "conditions": found.rows, "detections": found.detections, "units": UNITS})


def assess_given(
    artifact: list[Path] | None, *, twin: bool, cases: int, out: Path
) -> tuple[AssessmentResults, list[Path]]:
    """Assess detectors with the options of the command; return what was found, and its files, the page last."""
    from gossamer.pages.assess_detector import assessment_page
    from gossamer_models.assessment import AlwaysZero, assess, read_judge, shipped_judges, twin_judges, write_assessment
    from gossamer_models.assessment.plots import save_pictures

    from ..pages import PAGE
    from ..run.progress import ProgressBar

    keep_inputs(artifact or (), (out / name for name in ("assessment.json", "assessment.npz")))
    with model_errors(), ProgressBar("assessment", stderr()) as bar:
        bar.update(text="reading detectors,")
        judges = [read_judge(path) for path in artifact] if artifact else shipped_judges()
        twins = twin_judges(TWIN_RECORDS, TWIN_SIZES) if twin else ()

        def report(what: str, done: int, total: int) -> None:
            bar.update(done, total, f"{what}: {done} of {total},")

        found = assess([AlwaysZero(), *judges, *twins], out / "simulations", cases=cases, report=report)
        paths = [*write_assessment(found, out), *save_pictures(found, out)]
    return found, paths + save_page(lambda: assessment_page(found), out / PAGE)
