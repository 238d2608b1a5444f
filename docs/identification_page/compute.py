"""Everything the page shows, fitted and run once.

Fits that are timed run first and alone; what remains runs in two processes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from gossamer_models.compensator.assess import (
    ASKED,
    Case,
    Recovery,
    run_histories,
    run_section_5_5,
    run_ways,
    run_wrong_eta,
)
from gossamer_models.fractional import FractionalFit, identify_fractional
from gossamer_models.fractional.assess import AssessmentRow, Limits, assess_fractional, limits, record_of
from gossamer_models.identification import Figure
from gossamer_models.identification.assess import (
    MeasuredFit,
    SpecimenFit,
    Transfer,
    assess_speed,
    run_measured,
    run_specimen,
    run_transfers,
)
from gossamer_models.specimen import dataset

MORE_NOISE = (0.0002, 0.0005, 0.002, 0.01)  # [1], to draw errors over noise


@dataclass(frozen=True, kw_only=True)
class Results:
    """What the chapters are made of.

    Attributes
    ----------
    specimen : sequence of SpecimenFit
        Table 4.1.
    chosen : sequence of SpecimenFit
        The same with the ridge chosen within the fitted stretch.
    speed : sequence of Figure
        Of the fit.
    recovery : Recovery
        Section 5.5, and Figure 4.10.
    rows : sequence of AssessmentRow
        Tables 3.1 and 3.2.
    floors : Limits
        Below which the fractional models cannot go.
    repeated : dict
        Model to its fit to two cycles of Dataset-3, for Figure 3.5.
    noise, more_noise, wrong_eta : sequence of Case
        Compensators under noise, at further levels of it, and with a wrong eta.
    measured, transfers : sequence
        Measured records; empty where they are not.
    """

    specimen: Sequence[SpecimenFit]
    chosen: Sequence[SpecimenFit]
    speed: Sequence[Figure]
    recovery: Recovery
    rows: Sequence[AssessmentRow]
    floors: Limits
    repeated: dict[str, FractionalFit]
    noise: Sequence[Case]
    more_noise: Sequence[Case]
    wrong_eta: Sequence[Case]
    measured: Sequence[MeasuredFit] = field(default=())
    transfers: Sequence[Transfer] = field(default=())


def compute(data: Path | None, report: Callable[[str, int, int], None] | None = None) -> Results:
    """Fit and run everything.

    Parameters
    ----------
    data : Path or None
        Folder of the measured records; None leaves them out.
    report : callable or None
        Told what is done, how many parts, and of how many.
    """
    alone: dict[str, Callable[[], Any]] = {
        "specimen": run_specimen,
        "chosen ridge": lambda: run_specimen(ridge="auto"),
        "speed": assess_speed,
        "recovery": run_section_5_5,
    }
    if data is not None:
        alone |= {"measured": lambda: run_measured(data), "transfers": lambda: run_transfers(data)}
    together: dict[str, tuple[Any, ...]] = {"fractional": (_fractional,), "floors": (limits,)}
    for noise in ASKED:
        together[f"noise {noise}"] = (run_ways, (0, 1, 2), (noise,))
        together[f"histories {noise}"] = (run_histories, 0, (noise,))
    for error in (-0.02, 0.02):
        together[f"wrong eta {error}"] = (run_wrong_eta, (0, 1, 2), 0.001, (error,))
    for noise in MORE_NOISE:
        together[f"noise {noise}"] = (run_ways, (0, 1, 2), (noise,))
    total = len(alone) + len(together)
    found: dict[str, Any] = {}
    for name, run in alone.items():
        found[name] = run()
        if report is not None:
            report(name, len(found), total)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(*call): name for name, call in together.items()}
        for done in as_completed(waiting):
            found[waiting[done]] = done.result()
            if report is not None:
                report(waiting[done], len(found), total)
    rows, repeated = found["fractional"]
    return Results(
        specimen=found["specimen"],
        chosen=found["chosen ridge"],
        speed=found["speed"],
        recovery=found["recovery"],
        rows=rows,
        floors=found["floors"],
        repeated=repeated,
        noise=[case for kind in ("noise", "histories") for noise in ASKED for case in found[f"{kind} {noise}"]],
        more_noise=[case for noise in MORE_NOISE for case in found[f"noise {noise}"]],
        wrong_eta=[case for error in (-0.02, 0.02) for case in found[f"wrong eta {error}"]],
        measured=found.get("measured", ()),
        transfers=found.get("transfers", ()),
    )


def repeat_on_dataset_3(rows: Sequence[AssessmentRow]) -> dict[str, FractionalFit]:
    """Fit each model with its most terms, and the settings of its row, to two cycles of the SYNTHETIC Dataset-3."""
    most = max(row.n_terms for row in rows)
    record = record_of(dataset(3))
    return {row.model: identify_fractional([record], row.model, row.settings) for row in rows if row.n_terms == most}


def _fractional() -> tuple[tuple[AssessmentRow, ...], dict[str, FractionalFit]]:
    rows = assess_fractional()
    return rows, repeat_on_dataset_3(rows)
