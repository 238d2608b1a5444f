"""``gossamer run`` and ``gossamer demo``: from a scenario to results, pictures, a page and judgements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import OrchestratorError, ResultsError
from ..scenario.shipped import find_scenario
from .build import build_fmus
from .common import FMUS, FmuFolder, wide
from .pictures import every_so_many
from .watch import LiveWatch

if TYPE_CHECKING:
    import xarray as xr

DEMO = "damage_begins"
WATCHED = "watch.json"


def run(
    scenario: Annotated[str, typer.Argument(help="A scenario file, an .ssp, or the name of a shipped scenario.")],
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the results; out/NAME by default, out/NAME_ssp of an .ssp.", metavar="FOLDER"),
    ] = None,
    fmus: FmuFolder = FMUS,
    step: Annotated[float | None, typer.Option(help="Communication step [s] in place of the file's.")] = None,
    stop: Annotated[float | None, typer.Option(help="Last time [s] in place of the file's.")] = None,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="Value in place of the file's, such as membrane.damage[1]=0.3 or sensor?.rest_strain=0.02; seed=2 is that "
            "of all noise. As often as needed.",
            metavar="NAME=VALUE",
        ),
    ] = None,
    master: Annotated[
        str | None, typer.Option(help="gauss-seidel or jacobi, in place of the file's or for an .ssp.")
    ] = None,
    pictures: Annotated[
        bool, typer.Option(help="Draw pictures of what was recorded, and write report.html, the page of the run.")
    ] = True,
    watched: Annotated[
        bool,
        typer.Option("--watch", help="Run the digital twin beside it: an alarm when damage begins, then its place."),
    ] = False,
    limit: Annotated[
        float | None,
        typer.Option(help="End the run if one call of an FMU takes longer [s].", metavar="SECONDS", min=1e-3),
    ] = None,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Refuse FMUs that break the rules of FMI, values that are not finite, groups that do not converge, and "
            "steps that miss the tolerance of the step control.",
        ),
    ] = False,
    threads: Annotated[
        int,
        typer.Option(
            help="How many FMUs may step at once; it pays where steps take some 0.2 ms and more.", min=1, max=64
        ),
    ] = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the unfinished run in the folder for results.")
    ] = False,
    csv: Annotated[
        bool | None, typer.Option(help="Write results.csv; by default if it has at most 10 million values.")
    ] = None,
) -> None:
    """Run a scenario.

    Writes results.nc, results.csv, pictures and report.html, the page of the run, and prints their paths. The FMUs run in a
    process of their own, and results are on the disk within a second: whatever ends the run, what it reached is kept, and
    --resume continues it.

    For example:

        gossamer build && gossamer run damaged

        gossamer run my_scenario.toml --out out/mine --no-pictures

        gossamer run damage_begins --watch

        gossamer run other.ssp --step 1e-3 --stop 2 --master jacobi

        gossamer run damaged --set "membrane.damage[1]=0.3" --out out/deeper

        gossamer run my_scenario.toml --resume
    """
    from ..scenario.changes import read_changes

    if watched and resume:
        msg = "--watch must see a run from its start. Resume it without --watch, then use 'gossamer watch' on its results."
        raise OrchestratorError(msg)
    path = find_scenario(scenario)
    name = f"{path.stem}_ssp" if path.suffix == ".ssp" else path.stem  # not over those of the scenario it was made of
    folder = Path("out") / name if out is None else out
    options = {
        "step": step,
        "stop": stop,
        "values": read_changes(values or []),
        "master": master,
        "limit": limit,
        "strict": strict,
        "threads": threads,
        "resume": resume,
        "csv": csv,
    }
    _run(path, fmus, folder, pictures=pictures, watched=watched, **options)


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
    **options: Any,  # noqa: ANN401
) -> None:
    """Run one scenario, write everything, and print what was judged and which page to open."""
    from ..results.files import CSV, NETCDF
    from ..run.progress import ProgressBar
    from ..run.runner import run_scenario

    observers = [LiveWatch(out / WATCHED)] if watched else []
    try:
        data = run_scenario(scenario, fmus, out, observers=observers, progress=ProgressBar(scenario.stem), **options)
    except KeyboardInterrupt as error:
        for text in ("Interrupted.", *getattr(error, "__notes__", ())):
            typer.echo(text, err=True)
        raise typer.Exit(130) from None
    for name in (NETCDF, CSV, *[WATCHED] * watched):
        if (out / name).is_file():
            typer.echo(out / name)
    page = _draw(data, out) if pictures else None
    _print_judgements(data)
    if page is not None:
        typer.echo(f"Open {page}, or type 'gossamer view {out}'.", err=True)


def _draw(data: xr.Dataset, out: Path) -> Path | None:
    """Draw pictures and write the page of a run, and print their paths; a page that cannot be written ends no run."""
    from ..results.plots import save_pictures
    from ..results.report import write_report

    for path in save_pictures(every_so_many(data), out):
        typer.echo(path)
    try:
        page = write_report(data, out)
    except ResultsError as error:
        typer.echo(str(error), err=True)
        return None
    typer.echo(page)
    return page


def _print_judgements(data: xr.Dataset) -> None:
    """Print the judgements as tables on stderr, if there is a detector."""
    from ..results.judgements import doubts, windows
    from ..results.tables import history_table, zone_table

    console = wide(stderr=True)
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
