"""``gossamer watch``: the twin beside a record, window by window, until damage begins."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from ..errors import OrchestratorError
from .common import model_errors

if TYPE_CHECKING:
    from gossamer_models.twin import Finding
    from rich.table import Table

LEAST_WINDOW = 20  # samples


def watch(
    record: Annotated[
        Path, typer.Argument(help="Results of a run (results.nc, results.csv or their folder), or a CSV file.")
    ],
    window: Annotated[float, typer.Option(help="Length of a window [s].")] = 0.05,
    kind: Annotated[str | None, typer.Option(help="strain or resistance, where the record has both.")] = None,
    noise: Annotated[
        float | None, typer.Option(help="Standard deviation of the noise, 1 or ohm; estimated by default.", min=0.0)
    ] = None,
    false_alarms: Annotated[float, typer.Option(help="Share of the windows that may raise a false alarm.")] = 1e-5,
    params: Annotated[
        list[str] | None, typer.Option(help="A membrane parameter, NAME=VALUE; may be repeated.", metavar="NAME=VALUE")
    ] = None,
    sensor: Annotated[
        Path | None, typer.Option(help="Artifact of the sensors; the shipped one by default.", metavar="FILE")
    ] = None,
    elements: Annotated[int, typer.Option(help="Elements of the twin per side.")] = 4,
    order: Annotated[int, typer.Option(help="Their order; 1 for bilinear ones.")] = 4,
    out: Annotated[
        Path | None, typer.Option(help="JSON file to write; watch.json beside the record by default.", metavar="FILE")
    ] = None,
) -> None:
    """Watch a record as if it arrived live: raise an alarm when damage begins, then say when and where.

    The record begins, undamaged, when the load sets in. After each window the running twin tests whether damage explains the
    readings better; one window after an alarm it fits the onset and the damages.

    For example:

        gossamer run damage_begins && gossamer watch out/damage_begins
    """
    import numpy as np
    from gossamer_models.sensor import SensorArtifact, default_artifact
    from gossamer_models.twin import Watch

    from .twin_record import find_record

    console = Console(stderr=True)
    with model_errors():
        found = find_record(record, kind, noise, None, params or [])
        samples = round(window / found.record.step)
        if samples < LEAST_WINDOW or 2 * samples > found.record.samples:
            msg = (
                f"--window {window:g} s is {samples} samples of the record's {found.record.samples}. A window needs "
                f"{LEAST_WINDOW} or more, and the record two windows or more."
            )
            raise OrchestratorError(msg)
        artifact = None
        if found.record.kind == "resistance":
            artifact = default_artifact() if sensor is None else SensorArtifact.read(sensor)
        with console.status("compiling"):
            watching = Watch(
                np.nan_to_num(found.record.noise_deviation(), nan=1.0),
                elements,
                order,
                found.params,
                sensor=artifact,
                sensor_parameters=found.sensor_parameters,
                step=found.record.step,
                false_alarms=false_alarms,
            )
        begun, alarms, findings, misfits = time.process_time(), [], [], []
        for first in range(0, found.record.samples - samples + 1, samples):
            judged = watching.advance(found.record.values[:, first : first + samples])
            misfits.append(judged.misfit)
            if judged.alarm:
                alarms.append(judged.time)
                console.print(
                    f"t = {judged.time:.4f} s: ALARM, the score of new damage is {judged.statistic:.1f} times its mean",
                    style="bold red",
                    highlight=False,
                )
            if judged.finding is not None:
                findings.append(judged.finding)
                console.print(_zone_table(judged.finding))
        spent = (time.process_time() - begun) / (len(misfits) * samples * found.record.step)
        content = {
            "alarms": alarms,
            "findings": [
                {
                    "onset": f.onset,
                    "onset_deviation": f.onset_deviation,
                    "damage": f.damage.tolist(),
                    "deviation": f.deviation.tolist(),
                    "chi2_per_sample": f.chi2_per_sample,
                }
                for f in findings
            ],
            "misfit": misfits,
        }
        path = (record if record.is_dir() else record.parent) / "watch.json" if out is None else out
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    verdict = f"{len(alarms)} alarm{'s' * (len(alarms) != 1)} in {len(misfits)} windows"
    console.print(f"{verdict}; {spent:.2g} s of processor time per second of the record", highlight=False)
    if misfits[-1] > 2.0:
        console.print(
            f"The twin does not explain the last window: chi2 per sample is {misfits[-1]:.3g}. Check load, damping, "
            "sensors and noise.",
            style="bold yellow",
            highlight=False,
        )
    typer.echo(path)


def _zone_table(finding: Finding) -> Table:
    """Return a table of the damaged zones."""
    from rich.table import Table

    when = f"{finding.onset:.5f} ± {finding.onset_deviation:.5f} s"
    table = Table("zone", "damage [%]", title=f"Damage since t = {when}")
    for k in (finding.damage > 0.0).nonzero()[0]:
        table.add_row(str(k + 1), f"{100.0 * finding.damage[k]:.2f} ± {100.0 * finding.deviation[k]:.2f}")
    return table
