"""What ``gossamer identify`` shows: progress, and tables of errors, rivals and trials."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console

from ..run.progress import ProgressBar
from .tables import Shown, printed

logger = logging.getLogger(__name__)
SHOWN = 6  # trials of each stage, the best ones


@contextmanager
def progress_of(console: Console, *, bar: bool) -> Iterator[tuple[Callable[[str], None], Callable[[float, str], None]]]:
    """Show progress; yield what to call with a sentence, and with the share that is done and a sentence."""
    # its share counts settings, which take unlike times
    with ProgressBar("identify", console, remaining=False) as shown:

        def say(text: str) -> None:
            logger.info("%s", text)
            shown.update(text=f"{text},")

        def advance(share: float, text: str) -> None:
            say(text)
            if bar:
                shown.update(share, 1.0)

        yield say, advance


def result_as_json(result: Any, model: str) -> dict[str, Any]:  # noqa: ANN401
    """Return an ``Identified`` as JSON; NRMSE over the range of the record [%], E1 of the change from rest [%]."""
    names = ("value", "low", "high")
    return {
        "model": model,
        "rest_resistance_ohm": result.fit.rest_resistance,
        "errors": [
            {
                "record": e.record,
                "stretch": e.stretch,
                "samples": e.samples,
                "e1_percent": e.e1,
                "resistance_nrmse_percent": e.nrmse,
                "strain_nrmse_percent": e.strain_nrmse,
            }
            for e in result.errors
        ],
        "standings": [
            {
                "record": each.record,
                "model": each.model,
                "resistance_nrmse_percent": each.forward and dict(zip(names, each.forward, strict=True)),
                "strain_nrmse_percent": each.strain and dict(zip(names, each.strain, strict=True)),
            }
            for each in result.standings
        ],
        "remarks": result.remarks,
    }


def print_result(console: Console, result: Any, rest: str) -> None:  # noqa: ANN401
    """Print the tables of an ``Identified``; ``rest`` is the resistance from which changes count, in words."""
    for shown in (trial_table(result, SHOWN), error_table(result, rest), standing_table(result)):
        if shown.rows:
            console.print(printed(shown))


def error_table(result: Any, rest: str) -> Shown:  # noqa: ANN401
    """Return the errors on training and test stretches."""
    caption = f"E1: sum of errors over sum of changes from the {rest}"
    starts = result.fit.artifact.provenance.get("starts ended at", "")
    if "," in starts:
        caption += f".\nStarts ended at {starts} of the fitted range, regularisation included"
    head = ("record", "stretch", "samples", "E1 [% of change]", "NRMSE [% of range]", "recovered strain, NRMSE")
    rows = []
    for e in result.errors:
        recovered = "-" if e.strain_nrmse is None else f"{e.strain_nrmse:.3f}"
        rows.append((e.record, e.stretch, str(e.samples), f"{e.e1:.3f}", f"{e.nrmse:.3f}", recovered))
    return Shown(head, rows, caption)


def standing_table(result: Any) -> Shown:  # noqa: ANN401
    """Return the errors of the sensor beside those of its rivals."""
    caption = "NRMSE [% of range] on the test stretch; in brackets 90 % confidence from blocks of it"
    rows = [(each.record, each.model, _interval(each.forward), _interval(each.strain)) for each in result.standings]
    return Shown(("record", "model", "output", "recovered strain"), rows, caption)


def trial_table(result: Any, most: int) -> Shown:  # noqa: ANN401
    """Return what an automatic choice tried, of each stage the best ones."""
    caption = (
        "Error: NRMSE [% of range] on the later part of the training stretch; finalists are judged at two cuts of it. "
        "Extension, earlier relaxation, ridge, knots and residual network are options of gossamer identify --help. A filter "
        "that trusts its models less allows for outliers and for strain that changes its speed more."
    )
    rows: list[tuple[str, ...]] = []
    for stage in dict.fromkeys(trial.stage for trial in result.trials):
        here = [trial for trial in result.trials if trial.stage == stage]
        known = sorted((t for t in here if math.isfinite(t.error)), key=lambda t: (not t.final, t.error))[:most]
        rows += [(t.stage, t.what, f"{t.error:.2f}", "yes" if t.final else "no", f"{t.seconds:.1f}") for t in known]
        failed = sum(not math.isfinite(trial.error) for trial in here)
        for count, what in ((len(here) - failed - len(known), "not shown"), (failed, "that failed")):
            if count:
                rows.append((stage, f"{count} more {what}", "", "", ""))
    return Shown(("choice of", "tried", "error", "finalist", "time [s]"), rows, caption)


def _interval(numbers: tuple[float, float, float] | None) -> str:
    return "-" if numbers is None else f"{numbers[0]:.2f} ({numbers[1]:.2f} to {numbers[2]:.2f})"
