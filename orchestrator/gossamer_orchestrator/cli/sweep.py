"""``gossamer sweep``: a scenario with many values."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..scenario.source import find_scenario
from .command import Result, show, stderr
from .common import FMUS, FmuFolder, ScenarioName, Step, Stop, keep_inputs, model_errors, note_page, save_page

if TYPE_CHECKING:
    from rich.table import Table

    from ..run.sweep import Case

SHOWN = 30


def sweep(
    scenario: ScenarioName,
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
    step: Step = None,
    stop: Stop = None,
    workers: Annotated[int | None, typer.Option(help="Runs at once; as many as cores by default.", min=1)] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Run on the Dask cluster of this scheduler, tcp://host:8786.", metavar="URL")
    ] = None,
    plot: Annotated[
        str | None,
        typer.Option(
            help="Variable to draw, one panel per case, such as membrane.deflection; damage if there is a detector, else "
            "the first that was recorded.",
            metavar="NAME",
        ),
    ] = None,
    pictures: Annotated[
        bool, typer.Option(help="Draw the picture, and write report.html, the page of the sweep.")
    ] = True,
) -> Result:
    """Run a scenario with many values.

    Writes a folder per case with what gossamer run writes; a table cases.csv; sweep.zarr, which xarray opens with everything
    along the dimension case; sweep.png with a panel per case; and report.html, the page of the sweep. The same command again
    runs what is missing. A cluster needs this version of Gossamer and the same folders on all its machines.

    For example:

        gossamer sweep damaged --set "membrane.damage[1]=0:0.5:6"

        gossamer sweep damage_begins --set "estimator?.noise=0.05:0.2:4" --set seed=1:20 --out out/noise

        gossamer sweep damaged --set "membrane.damage[1]=0:0.5:6" --scheduler tcp://192.168.0.5:8786
    """
    from ..pages import PAGE
    from ..run.sweep import is_finished

    try:
        cases, ended, folder, files = run_cases(
            scenario,
            ranges,
            out,
            fmus,
            step=step,
            stop=stop,
            workers=workers,
            scheduler=scheduler,
            plot=plot,
            pictures=pictures,
        )
    except KeyboardInterrupt as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(130) from None
    stderr().print(case_table(cases, ended))
    for file in files:
        show(file)
    if folder / PAGE in files:
        note_page(folder / PAGE)
    found = [
        {"case": case.number, "values": case.values, "folder": folder / case.name, "ended": text}
        for case, text in zip(cases, ended, strict=True)
    ]
    return Result({"files": files, "cases": found}, 0 if all(map(is_finished, ended)) else 1)


def run_cases(
    scenario: str,
    ranges: list[str],
    out: Path | None,
    fmus: Path,
    *,
    step: float | None,
    stop: float | None,
    workers: int | None,
    scheduler: str | None,
    plot: str | None,
    pictures: bool,
) -> tuple[list[Case], list[str], Path, list[Path]]:
    """Run a sweep with the options of the command; return cases, how each ended, the folder, and the files of all cases.

    Raises
    ------
    KeyboardInterrupt
        It was interrupted; the message says how to go on.
    """
    from gossamer.pages.sweep import sweep_page

    from ..pages import PAGE
    from ..results.report.cases import save_cases
    from ..run.progress import ProgressBar
    from ..run.sweep import TABLE, combine, make_cases, on_cores, read_ranges, run_sweep, write_table

    path = find_scenario(scenario)
    folder = Path("out") / f"{path.stem}_sweep" if out is None else out
    keep_inputs([path], [folder / TABLE])
    cases = make_cases(read_ranges(ranges))
    numbers = {"--step": step, "--stop": stop}
    options = [f"{key}={value!r}" for key, value in numbers.items() if value is not None]
    command = ["run", str(path.absolute()), "--fmus", str(fmus.absolute()), "--no-pictures", "--no-csv", *options]
    spread = partial(on_cores, workers=workers) if scheduler is None else partial(_on_cluster, scheduler=scheduler)
    bar = ProgressBar(path.stem, stderr())
    try:
        with bar:
            ended = run_sweep(
                cases,
                command,
                folder,
                spread=spread,
                progress=lambda done, total: bar.update(done, total, f"{done} of {total} cases,"),
            )
    except KeyboardInterrupt:
        msg = f"Interrupted; finished cases are kept in {folder}. Run the same command again to go on."
        raise KeyboardInterrupt(msg) from None
    files = [write_table(cases, ended, folder)]
    if (store := combine(cases, folder)) is not None:
        files.append(store)
        if pictures:
            varied = [name for name in cases[0].values if len({str(case.values[name]) for case in cases}) > 1]
            files += save_cases(store, folder, plot, varied)
    if pictures:
        files += save_page(lambda: sweep_page(path.stem, cases, ended, folder, plot), folder / PAGE)
    return cases, ended, folder, files


def _on_cluster(
    function: Callable[[Case], tuple[int, str]], cases: Sequence[Case], scheduler: str
) -> Iterator[tuple[int, str]]:
    """Call a function with each case on the Dask cluster of a scheduler."""
    from gossamer_models.campaign.run import on_cluster

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a lost scheduler is one sentence here
    with model_errors():
        yield from on_cluster(function, cases, scheduler)


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
