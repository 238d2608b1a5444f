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
    from ..run.sweep import TABLE, is_finished

    try:
        cases, ended, folder, store = run_cases(scenario, ranges, out, fmus, step=step, stop=stop, workers=workers)
    except KeyboardInterrupt as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(130) from None
    wide(stderr=True).print(case_table(cases, ended))
    typer.echo(folder / TABLE)
    if store is not None:
        typer.echo(store)
    if not all(map(is_finished, ended)):
        raise typer.Exit(1)


def run_cases(
    scenario: str,
    ranges: list[str],
    out: Path | None,
    fmus: Path,
    *,
    step: float | None,
    stop: float | None,
    workers: int | None,
) -> tuple[list[Case], list[str], Path, Path | None]:
    """Run a sweep with the options of the command; return cases, how each ended, the folder, and what holds all results.

    Raises
    ------
    KeyboardInterrupt
        It was interrupted; the message says how to go on.
    """
    from rich.progress import MofNCompleteColumn, Progress

    from ..run.sweep import TABLE, combine, make_cases, read_ranges, run_sweep

    path = find_scenario(scenario)
    folder = Path("out") / f"{path.stem}_sweep" if out is None else out
    keep_inputs([path], [folder / TABLE])
    cases = make_cases(read_ranges(ranges))
    numbers = {"--step": step, "--stop": stop}
    options = [f"{key}={value!r}" for key, value in numbers.items() if value is not None]
    command = ["run", str(path.absolute()), "--fmus", str(fmus.absolute()), "--no-pictures", "--no-csv", *options]
    console = Console(stderr=True)
    bar = Progress(
        *Progress.get_default_columns(),
        MofNCompleteColumn(),
        console=console,
        disable=not (console.is_terminal or console.is_jupyter),
    )
    shown = bar.add_task(path.stem, total=len(cases))
    try:
        with bar:
            ended = run_sweep(
                cases, command, folder, workers=workers, progress=lambda done, _: bar.update(shown, completed=done)
            )
    except KeyboardInterrupt:
        msg = f"Interrupted; finished cases are kept in {folder}. Run the same command again to go on."
        raise KeyboardInterrupt(msg) from None
    return cases, ended, folder, combine(cases, folder)


def case_table(cases: Sequence[Case], ended: Sequence[str]) -> Table:
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
