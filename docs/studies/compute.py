"""Fit and run everything that the page shows, once.

Fits that are timed run first and alone; what remains runs in two processes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from gossamer_models.fractional import FractionalFit

from .automatic import DefaultRow, SpecimenRow, run_automatic, run_on_specimen
from .fractional import Limits, TableRow, limits, run_fractional
from .measured import Comparison, MeasuredFit, Transfer, run_measured, run_transfers
from .metrics import Metric
from .noise import TARGETS, Case, run_histories, run_ways, run_wrong_eta
from .preisach import SpecimenFit, run_specimen
from .recovery import Recovery, run_recovery
from .reviewed import run_reviewed
from .speed import run_speed

MORE_NOISE = (0.0002, 0.0005, 0.002, 0.01)  # [1], to draw errors over noise
ETA_ERRORS = (-0.02, 0.02)  # [1]


@dataclass(frozen=True, kw_only=True)
class Results:
    """Results that the chapters show.

    Attributes
    ----------
    specimen : sequence of SpecimenFit
        Table 4.1.
    chosen : sequence of SpecimenFit
        The same with the ridge chosen within the fitted stretch.
    speed : sequence of Metric
        Of the fit.
    recovery : Recovery
        Section 5.5, and Figure 4.10.
    rows : sequence of TableRow
        Tables 3.1 and 3.2.
    limits : Limits
        Lower limits of the errors of the fractional models.
    repeated : dict
        Model to its fit to two cycles of Dataset-3, for Figure 3.5.
    noise, more_noise, wrong_eta : sequence of Case
        Compensators under noise, at further levels of it, and with a wrong eta.
    measured, transfers, reviewed : sequence
        Measured records; empty if they are missing.
    automatic : sequence of DefaultRow
        The same with the defaults, beside regressions.
    """

    specimen: Sequence[SpecimenFit]
    chosen: Sequence[SpecimenFit]
    speed: Sequence[Metric]
    recovery: Recovery
    rows: Sequence[TableRow]
    limits: Limits
    repeated: dict[str, FractionalFit]
    noise: Sequence[Case]
    more_noise: Sequence[Case]
    wrong_eta: Sequence[Case]
    measured: Sequence[MeasuredFit] = field(default=())
    transfers: Sequence[Transfer] = field(default=())
    reviewed: Sequence[Comparison] = field(default=())
    automatic: Sequence[DefaultRow] = field(default=())
    on_specimen: Sequence[SpecimenRow] = field(default=())


def compute(data: Path | None, report: Callable[[str, int, int], None] | None = None) -> Results:
    """Fit and run everything.

    Parameters
    ----------
    data : Path or None
        Folder of the measured records; None leaves them out.
    report : callable or None
        Called after each part with its name, the number of parts that are done and the number of all.
    """
    alone: dict[str, Callable[[], Any]] = {
        "specimen": run_specimen,
        "chosen ridge": partial(run_specimen, ridge="auto"),
        "speed": run_speed,
        "recovery": run_recovery,
        "automatic choice on the specimen": run_on_specimen,
    }
    if data is not None:
        alone |= {"measured": partial(run_measured, data), "transfers": partial(run_transfers, data)}
        alone["reviewed"] = partial(run_reviewed, data)
        alone["automatic"] = partial(run_automatic, data)
    together: dict[str, Callable[[], Any]] = {"fractional": run_fractional, "limits": limits}
    for noise in TARGETS:
        together[f"noise {noise}"] = partial(run_ways, noise)
        together[f"histories {noise}"] = partial(run_histories, noise)
    for error in ETA_ERRORS:
        together[f"wrong eta {error}"] = partial(run_wrong_eta, error)
    for noise in MORE_NOISE:
        together[f"noise {noise}"] = partial(run_ways, noise)
    total = len(alone) + len(together)
    results: dict[str, Any] = {}

    def keep(name: str, result: object) -> None:
        results[name] = result
        if report is not None:
            report(name, len(results), total)

    for name, run in alone.items():
        keep(name, run())
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(run): name for name, run in together.items()}
        for done in as_completed(waiting):
            keep(waiting[done], done.result())
    rows, repeated = results["fractional"]
    return Results(
        specimen=results["specimen"],
        chosen=results["chosen ridge"],
        speed=results["speed"],
        recovery=results["recovery"],
        rows=rows,
        limits=results["limits"],
        repeated=repeated,
        noise=[case for kind in ("noise", "histories") for noise in TARGETS for case in results[f"{kind} {noise}"]],
        more_noise=[case for noise in MORE_NOISE for case in results[f"noise {noise}"]],
        wrong_eta=[case for error in ETA_ERRORS for case in results[f"wrong eta {error}"]],
        measured=results.get("measured", ()),
        transfers=results.get("transfers", ()),
        reviewed=results.get("reviewed", ()),
        automatic=results.get("automatic", ()),
        on_specimen=results["automatic choice on the specimen"],
    )
