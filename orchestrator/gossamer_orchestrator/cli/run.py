"""``gossamer run`` and ``gossamer demo``: from a scenario to results, pictures and judgements."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from ..errors import ResultsError
from ..scenario.shipped import find_scenario
from .build import build_fmus
from .common import FMUS, FmuFolder
from .watch import LiveWatch

DEMO = "damage_begins"


def run(
    scenario: Annotated[str, typer.Argument(help="A scenario file, an .ssp, or the name of a shipped scenario.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results; out/NAME by default.", metavar="FOLDER")
    ] = None,
    fmus: FmuFolder = FMUS,
    step: Annotated[float | None, typer.Option(help="Communication step [s] in place of the file's.")] = None,
    stop: Annotated[float | None, typer.Option(help="Last time [s] in place of the file's.")] = None,
    master: Annotated[
        str | None, typer.Option(help="gauss-seidel or jacobi, in place of the file's or for an .ssp.")
    ] = None,
    strict: Annotated[bool, typer.Option("--strict", help="Refuse FMUs that break the rules of FMI.")] = False,
    pictures: Annotated[bool, typer.Option(help="Draw pictures of what was recorded.")] = True,
    watched: Annotated[
        bool,
        typer.Option("--watch", help="Run the digital twin beside it: an alarm when damage begins, then its place."),
    ] = False,
) -> None:
    """Run a scenario.

    Writes results.nc, results.csv and pictures, and prints their paths. An interrupted or failed run keeps the results
    up to then.

    For example:

        gossamer build && gossamer run damaged

        gossamer run my_scenario.toml --out out/mine --no-pictures

        gossamer run damage_begins --watch

        gossamer run other.ssp --step 1e-3 --stop 2 --master jacobi
    """
    path = find_scenario(scenario)
    folder = Path("out") / path.stem if out is None else out
    _run(path, fmus, folder, pictures=pictures, watched=watched, master=master, strict=strict, step=step, stop=stop)


def demo(
    out: Annotated[Path, typer.Option(help="Folder for FMUs, results and pictures.", metavar="FOLDER")] = Path("out"),
) -> None:
    """Build the FMUs, and find damage that begins during a run.

    Two zones of a membrane lose stiffness half way through the run. Four sensors with noisy resistance, four estimators and
    the detector find the damage, window by window, with its standard deviation. Beside it the digital twin watches the
    same resistances: an alarm, the onset, the damages. Leaves results and pictures in out/damage_begins.

    For example:

        gossamer demo
    """
    build_fmus(out / "fmus")
    _run(find_scenario(DEMO), out / "fmus", out / DEMO, pictures=True, watched=True)


def _run(
    scenario: Path,
    fmus: Path,
    out: Path,
    *,
    pictures: bool,
    watched: bool,
    master: str | None = None,
    strict: bool = False,
    step: float | None = None,
    stop: float | None = None,
) -> None:
    """Run one scenario, write everything, and print the judgements as tables on stderr, if there is a detector."""
    from ..results.files import CSV, NETCDF
    from ..results.judgements import doubts, windows
    from ..results.tables import history_table, zone_table
    from ..run.master import Observer
    from ..run.progress import ProgressBar
    from ..run.runner import run_scenario

    try:
        observers: list[Observer] = [ProgressBar(scenario.stem)]
        if watched:
            observers.append(LiveWatch(out / "watch.json"))
        data = run_scenario(
            scenario, fmus, out, step=step, stop=stop, master=master, strict=strict, observers=observers
        )
    except KeyboardInterrupt:
        typer.echo(f"Interrupted; results until then are in {out}.", err=True)
        raise typer.Exit(130) from None
    typer.echo(out / NETCDF)
    typer.echo(out / CSV)
    if pictures:
        from ..results.plots import save_pictures

        for path in save_pictures(data, out):
            typer.echo(path)
    console = Console(stderr=True)
    try:
        ended = windows(data)
    except ResultsError:
        return
    if len(ended) > 1:
        console.print(history_table(ended))
    for judgement in [window for window in ended if window.valid][-1:]:
        console.print(zone_table(judgement))
    for sentence in doubts(data, ended):
        console.print(sentence, style="bold yellow", highlight=False)
