"""``gossamer sweep``: a scenario with many values."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from ..scenario.shipped import find_scenario
from .common import FMUS, FmuFolder, keep_inputs, wide

if TYPE_CHECKING:
    from rich.table import Table

    from ..run.sweep import Case

SHOWN = 30


def sweep(
    scenario: Annotated[str, typer.Argument(help="A scenario file, an .ssp, or the name of a shipped scenario.")],
    ranges: Annotated[
        list[str],
        typer.Option(
            "--set",
            help="What varies: NAME=FIRST:LAST:COUNT, NAME=1:20 for whole numbers, NAME=0.1,0.2, or NAME=VALUE. As often "
            "as needed; all values are combined with all others.",
            metavar="NAME=VALUES",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder of the sweep; out/NAME_sweep by default.", metavar="FOLDER")
    ] = None,
    fmus: FmuFolder = FMUS,
    step: Annotated[float | None, typer.Option(help="Communication step [s] in place of the file's.")] = None,
    stop: Annotated[float | None, typer.Option(help="Last time [s] in place of the file's.")] = None,
    workers: Annotated[int | None, typer.Option(help="Runs at once; as many as cores by default.", min=1)] = None,
) -> None:
    """Run a scenario with many values.

    Writes a folder per case with what gossamer run writes, a table cases.csv, and sweep.zarr, which xarray opens with
    everything along the dimension case. The same command again runs what is missing.

    For example:

        gossamer sweep damaged --set "membrane.damage[1]=0:0.5:6"

        gossamer sweep damage_begins --set "sensor?.rest_strain=0.01:0.03:5" --set seed=1:20 --out out/noise
    """
    from rich.progress import MofNCompleteColumn, Progress

    from ..run.sweep import TABLE, combine, is_finished, make_cases, read_ranges, run_sweep

    path = find_scenario(scenario)
    folder = Path("out") / f"{path.stem}_sweep" if out is None else out
    keep_inputs([path], [folder / TABLE])
    cases = make_cases(read_ranges(ranges))
    numbers = {"--step": step, "--stop": stop}
    options = [f"{key}={value!r}" for key, value in numbers.items() if value is not None]
    command = ["run", str(path.absolute()), "--fmus", str(fmus.absolute()), "--no-pictures", "--no-csv", *options]
    console = Console(stderr=True)
    bar = Progress(
        *Progress.get_default_columns(), MofNCompleteColumn(), console=console, disable=not console.is_terminal
    )
    shown = bar.add_task(path.stem, total=len(cases))
    try:
        with bar:
            ended = run_sweep(
                cases, command, folder, workers=workers, progress=lambda done, _: bar.update(shown, completed=done)
            )
    except KeyboardInterrupt:
        typer.echo(f"Interrupted; finished cases are kept in {folder}. Run the same command again to go on.", err=True)
        raise typer.Exit(130) from None
    store = combine(cases, folder)
    wide(stderr=True).print(_table(cases, ended))
    typer.echo(folder / TABLE)
    if store is not None:
        typer.echo(store)
    if not all(map(is_finished, ended)):
        raise typer.Exit(1)


def _table(cases: Sequence[Case], ended: Sequence[str]) -> Table:
    """Return a table of the first cases and of those that failed."""
    from rich.markup import escape
    from rich.table import Table

    from ..run.sweep import is_finished

    table = Table("case", *map(escape, cases[0].values), "ended")
    for case, text in zip(cases, ended, strict=True):
        if case.number <= SHOWN or not is_finished(text):
            table.add_row(str(case.number), *(f"{value}" for value in case.values.values()), escape(text))
    if len(cases) > SHOWN:
        table.caption = f"the first {SHOWN} of {len(cases)} cases, and those that failed"
    return table
