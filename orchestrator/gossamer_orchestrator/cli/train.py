"""``gossamer train``: from simulated damage to a detector."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from .common import model_errors


def train(
    out: Annotated[Path, typer.Option(help="File to write, with its arrays beside it.", metavar="FILE")] = Path(
        "out/detector/single_damage.json"
    ),
) -> None:
    """Train the detector on simulated damage.

    Simulates the membrane with damage in one zone at a time on all cores, which takes a minute or two, writes the networks,
    and tests them on the 13 single-damage cases of the thesis' Table 7.1 and on unseen cases.

    For example:

        gossamer train --out mine.json && gossamer build detector --artifact mine.json
    """
    from gossamer_models.detector.training import THESIS_ERROR, assess, train_detector
    from rich.progress import Progress
    from rich.table import Table

    console = Console(stderr=True)
    with model_errors(), Progress(console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task("simulating damage", total=None)
        artifact = train_detector(progress=lambda done, total: progress.update(task, completed=done, total=total))
        out.parent.mkdir(parents=True, exist_ok=True)
        artifact.write(out)
        found = {"thesis, Table 7.1, its own training": THESIS_ERROR} | assess(artifact)
    table = Table("cases", *THESIS_ERROR, title="Single damage: mean absolute error [% damage]")
    for cases, errors in found.items():
        table.add_row(cases, *(f"{errors[zones]:.3f}" for zones in THESIS_ERROR))
    console.print(table)
    typer.echo(out)
