"""``gossamer assess-detector``: how good a detector and the twin are, in figures that an inspector asks for."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .command import Result, show, stderr
from .common import keep_inputs, model_errors

if TYPE_CHECKING:
    from gossamer_models.assessment import Assessment, Share
    from rich.table import Table

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
    detection against size with a90/95 of each zone, after MIL-HDBK-1823A. Prints the paths of results and pictures. Run it
    again to go on after an interruption: finished simulations are kept, and so is what the twin said.

    For example:

        gossamer assess-detector

        gossamer assess-detector --artifact mine.json --twin --cases 100 --out out/mine
    """
    found, paths = assess_given(artifact, twin=twin, cases=cases, out=out)
    stderr().print(condition_table(found))
    stderr().print(detection_table(found))
    for path in paths:
        show(path)
    return Result({"files": paths, "conditions": found.rows, "detections": found.detections, "units": UNITS})


def assess_given(artifact: list[Path] | None, *, twin: bool, cases: int, out: Path) -> tuple[Assessment, list[Path]]:
    """Assess detectors with the options of the command; return what was found, and the files of results and pictures."""
    from gossamer_models.assessment import AlwaysZero, assess, read_judge, shipped_judges, twin_judges, write_assessment
    from gossamer_models.assessment.plots import save_pictures

    from ..run.progress import ProgressBar

    keep_inputs(artifact or (), (out / name for name in ("assessment.json", "assessment.npz")))
    with model_errors(), ProgressBar("assessment", stderr()) as bar:
        bar.update(text="reading detectors,")
        judges = [read_judge(path) for path in artifact] if artifact else shipped_judges()
        twins = twin_judges(TWIN_RECORDS, TWIN_SIZES) if twin else ()

        def report(what: str, done: int, total: int) -> None:
            bar.update(done, total, f"{what}: {done} of {total},")

        found = assess([AlwaysZero(), *judges, *twins], out / "simulations", cases=cases, report=report)
        return found, [*write_assessment(found, out), *save_pictures(found, out)]


def condition_table(found: Assessment) -> Table:
    """Return a table of errors and shares, a row for each detector and condition."""
    from rich.table import Table

    head = ("detector", "condition", "records", "error, all zones", "damaged zones", "hits", "false calls", "valid")
    table = Table(
        *head,
        "wrong, of them invalid",
        "z rms",
        "in 95 %",
        "Brier",
        title="Errors [% damage] and shares [%]",
        caption="call: valid estimate above 5 %; false calls: records with a call in an undamaged zone, and the upper 95 % "
        "bound; wrong: error above 10 % in a zone; z rms, in 95 %: of the stated deviations, damaged zones of valid records",
    )
    for row in found.rows:
        f = row.figures
        table.add_row(
            row.judge,
            row.condition,
            str(f.records),
            _number(f.error_all),
            _number(f.error_damaged),
            _share(f.hits),
            f"{_share(f.false_calls)} (< {100.0 * f.false_calls.high:.1f})",
            _share(f.valid),
            f"{f.wrong.number}, {_share(f.wrong_and_invalid)}",
            _number(f.damaged_z_rms),
            _number(100.0 * f.damaged_within_95),
            _number(f.brier),
        )
    return table


def detection_table(found: Assessment) -> Table:
    """Return a table of the probability of detection, a row for each detector, condition and zone."""
    from rich.table import Table

    head = (
        "detector",
        "condition",
        "zone",
        "call above",
        "false calls",
        "hits of sizes",
        "a50",
        "a90",
        "a90/95",
        "remark",
    )
    table = Table(*head, title="Probability of detection: sizes [% damage]")
    for row in found.detections:
        if row.zone and not row.hits:
            continue
        table.add_row(
            row.judge,
            row.condition,
            str(row.zone or "all"),
            f"{row.score} > {100.0 * row.threshold:.2g} %",
            f"{_share(row.false_calls)} (< {100.0 * row.false_calls.high:.1f})",
            f"{row.hits} of {row.sizes}",
            *(_number(100.0 * size) for size in (row.a50, row.a90, row.a90_95)),
            row.remark,
        )
    return table


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _share(share: Share) -> str:
    return _number(100.0 * share.value)
