"""``gossamer campaign``: many simulations, on all cores or a cluster, into one store."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from ..scenario.shipped import find_scenario
from .common import keep_inputs, model_errors

if TYPE_CHECKING:
    from gossamer_models.campaign import Summary
    from rich.table import Table


def campaign(
    campaign: Annotated[str, typer.Argument(help="A campaign file, or the name of a shipped campaign.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder of the store; out/campaigns/NAME.zarr by default.", metavar="FOLDER")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; all cores by default.", min=1)] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Run on the Dask cluster of this scheduler, tcp://host:8786.", metavar="URL")
    ] = None,
) -> None:
    """Simulate the cases of a campaign.

    Draws damage, load, material and sensors of each case, simulates them and prints the folder of the store. Run it again
    to go on after an interruption: finished chunks are kept, and the numbers depend on the file alone.

    For example:

        gossamer campaign training

        gossamer campaign my_campaign.toml --out out/mine.zarr --scheduler tcp://192.168.0.5:8786
    """
    from gossamer_models.campaign import run_campaign
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    from .campaign_file import load_campaign
    from .described_file import locating

    file = find_scenario(campaign, "campaign")
    path = Path("out/campaigns") / f"{file.stem}.zarr" if out is None else out
    keep_inputs([file], [path])
    console = Console(stderr=True)
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.completed} of {task.total} cases, {task.fields[rate]}, remaining"),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
    )

    def show(done: int, total: int) -> None:
        if bar.tasks[0].total is None:
            bar.reset(shown, total=total, completed=done, rate="starting")
        else:
            bar.update(shown, completed=done, rate=f"{bar.tasks[0].speed or 0.0:.0f} per s")

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a lost scheduler is one sentence here
    try:
        with model_errors():
            wanted, source = load_campaign(file)
            shown = bar.add_task(file.stem, total=None, rate="compiling")
            with locating(source), bar:
                summary = run_campaign(
                    wanted, path, workers=workers, scheduler=scheduler, source=source.text, progress=show
                )
    except KeyboardInterrupt:
        typer.echo(f"Interrupted; finished chunks are kept in {path}. Run the same command again to go on.", err=True)
        raise typer.Exit(130) from None
    console.print(_summary_table(wanted.title or file.stem, path, summary))
    if summary.failed:
        text = f"{summary.failed} cases broke: 'failed' marks them, and their histories are not a number."
        console.print(text, style="bold yellow", highlight=False)
    typer.echo(path)


def _summary_table(title: str, path: Path, summary: Summary) -> Table:
    from rich.table import Table

    size = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    table = Table("cases", "of them now", "failed", "seconds", "cases per second", "size [MB]", title=title)
    rate = summary.simulated / summary.seconds
    cells = (
        summary.cases,
        summary.simulated,
        summary.failed,
        f"{summary.seconds:.1f}",
        f"{rate:.0f}",
        f"{size / 1e6:.1f}",
    )
    table.add_row(*map(str, cells))
    return table
