"""``gossamer campaign``: many simulations, on all cores or a cluster, into one store."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..scenario.source import find_scenario
from ..words import counted
from .command import Result, show, stderr
from .common import keep_inputs, model_errors, note_page, save_page

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
) -> Result:
    """Simulate the cases of a campaign.

    Draws damage, load, material and sensors of each case, simulates them, and prints the folder of the store and
    the path of report.html, the page of the campaign. Run it again to go on after an interruption: finished chunks are kept,
    and the numbers depend on the file alone.

    For example:

        gossamer campaign training

        gossamer campaign my_campaign.toml --out out/mine.zarr --scheduler tcp://192.168.0.5:8786
    """
    try:
        summary, path, title, pages = campaign_given(campaign, out=out, workers=workers, scheduler=scheduler)
    except KeyboardInterrupt:
        text = "Interrupted; finished chunks are kept. Run the same command again to go on."
        typer.echo(text, err=True)
        raise typer.Exit(130) from None
    stderr().print(summary_table(title, path, summary))
    if summary.failed:
        stderr().print(failed(summary), style="bold yellow", highlight=False)
    for each in (path, *pages):
        show(each)
    for page in pages:
        note_page(page)
    found = {"cases": summary.cases, "simulated": summary.simulated, "failed": summary.failed}
    return Result(
        {"store": path, "page": next(iter(pages), None), **found}
        | {"wall_time_s": summary.seconds, "size_bytes": size_of(path)}
    )


def campaign_given(
    campaign: str, *, out: Path | None, workers: int | None, scheduler: str | None
) -> tuple[Summary, Path, str, list[Path]]:
    """Simulate the cases with the options of the command; return what was done, store, title, and page if written."""
    from gossamer.pages.campaign import campaign_page
    from gossamer_models.campaign import read_campaign, run_campaign

    from ..run.progress import ProgressBar
    from .campaign_file import load_campaign
    from .described_file import locating

    file = find_scenario(campaign, "campaign")
    path = Path("out/campaigns") / f"{file.stem}.zarr" if out is None else out
    keep_inputs([file], [path])
    bar = ProgressBar(file.stem, stderr())
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a lost scheduler is one sentence here
    with model_errors():
        wanted, source = load_campaign(file)
        with locating(source), bar:
            bar.update(text="compiling,")
            summary = run_campaign(
                wanted,
                path,
                workers=workers,
                scheduler=scheduler,
                source=source.text,
                progress=lambda done, total: bar.update(done, total, f"{done} of {total} cases,"),
            )
    title = wanted.title or file.stem
    pages = save_page(lambda: campaign_page(title, read_campaign(path), summary), page_beside(path))
    return summary, path, title, pages


def page_beside(store: Path) -> Path:
    """Return the page of a store: not inside it, where programs that read Zarr would warn of it."""
    from ..pages import PAGE

    return (store.with_suffix("") if store.suffix else store.with_name(f"{store.name}_page")) / PAGE


def size_of(path: Path) -> int:
    """Return the size of a store [bytes]."""
    return sum(each.stat().st_size for each in path.rglob("*") if each.is_file())


def failed(summary: Summary) -> str:
    """Say how many cases broke."""
    return f"{counted(summary.failed, 'case')} broke: 'failed' is 1 there, and the histories are not a number."


def summary_table(title: str, path: Path, summary: Summary) -> Table:
    """Return a table of what was simulated."""
    from rich.markup import escape
    from rich.table import Table

    table = Table("cases", "of them now", "failed", "seconds", "cases per second", "size [MB]", title=escape(title))
    rate = summary.simulated / summary.seconds
    cells = (
        summary.cases,
        summary.simulated,
        summary.failed,
        f"{summary.seconds:.1f}",
        f"{rate:.0f}",
        f"{size_of(path) / 1e6:.1f}",
    )
    table.add_row(*map(str, cells))
    return table
