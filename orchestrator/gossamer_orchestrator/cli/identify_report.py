"""What ``gossamer identify`` shows: progress, and tables of errors, rivals and trials."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.table import Table

from ..run.progress import ProgressBar

logger = logging.getLogger(__name__)
SHOWN = 6  # trials of each stage, the best ones


@contextmanager
def progress_of(console: Console, *, bar: bool) -> Iterator[tuple[Callable[[str], None], Callable[[float, str], None]]]:
    """Show progress; yield what to call with a sentence, and with the share that is done and a sentence."""
    with ProgressBar("identify", console) as shown:

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
    if result.trials:
        console.print(_trials(result.trials))
    caption = f"E1: sum of errors over sum of changes from the {rest}"
    starts = result.fit.artifact.provenance.get("starts ended at", "")
    if "," in starts:
        caption += f"\nstarts ended at {starts} of the fitted range, regularisation included"
    headings = ("record", "stretch", "samples", "E1 [% of change]", "NRMSE [% of range]", "recovered strain, NRMSE")
    table = Table(*headings, caption=caption)
    for e in result.errors:
        recovered = "-" if e.strain_nrmse is None else f"{e.strain_nrmse:.3f}"
        table.add_row(e.record, e.stretch, str(e.samples), f"{e.e1:.3f}", f"{e.nrmse:.3f}", recovered)
    console.print(table)
    if result.standings:
        caption = "NRMSE [% of range] on the test stretch; in brackets 90 % confidence from blocks of it"
        table = Table("record", "model", "output", "recovered strain", caption=caption)
        for each in result.standings:
            table.add_row(each.record, each.model, _interval(each.forward), _interval(each.strain))
        console.print(table)


def _trials(trials: Any) -> Table:  # noqa: ANN401
    caption = "NRMSE [% of range] on the later part of the training stretch; at two cuts for the finalists"
    table = Table("choice of", "tried", "error", "finalist", r"time \[s]", caption=caption)
    for stage in dict.fromkeys(trial.stage for trial in trials):
        here = [trial for trial in trials if trial.stage == stage]
        known = sorted((t for t in here if math.isfinite(t.error)), key=lambda t: (not t.final, t.error))
        for t in known[:SHOWN]:
            table.add_row(t.stage, t.what, f"{t.error:.2f}", "yes" if t.final else "no", f"{t.seconds:.1f}")
        if len(here) > SHOWN:
            table.add_row(stage, f"and {len(here) - len(known[:SHOWN])} more", "", "", "")
    return table


def _interval(numbers: tuple[float, float, float] | None) -> str:
    return "-" if numbers is None else f"{numbers[0]:.2f} ({numbers[1]:.2f} to {numbers[2]:.2f})"
