"""``gossamer run`` and ``gossamer demo``: from a scenario to results, pictures, a page and judgements."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import nullcontext
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import OrchestratorError, ResultsError
from ..results.drawing import Drawing
from ..results.files import WATCH
from ..scenario.source import find_scenario
from .build import build_fmus
from .command import INVALID, Result, note, show, stderr
from .common import FMUS, FmuFolder, Master, ScenarioName, Step, Stop, note_page, save_page
from .pictures import stride_of
from .watch import LARGE, LiveWatch

if TYPE_CHECKING:
    import xarray as xr

DEMO = "damage_begins"


def run(
    scenario: ScenarioName,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the results; out/NAME by default, out/NAME_ssp of an .ssp.", metavar="FOLDER"),
    ] = None,
    fmus: FmuFolder = FMUS,
    step: Step = None,
    stop: Stop = None,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="Value in place of the file's, such as membrane.damage[1]=0.3 or estimator?.noise=0.2; seed=2 is that "
            "of all noise. As often as needed.",
            metavar="NAME=VALUE",
        ),
    ] = None,
    master: Master = None,
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
) -> Result:
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
    options = {
        "step": step,
        "stop": stop,
        "values": values,
        "master": master,
        "limit": limit,
        "strict": strict,
        "threads": threads,
        "resume": resume,
        "csv": csv,
    }
    return _run(scenario, out, fmus, pictures=pictures, watched=watched, **options)


def demo(
    out: Annotated[Path, typer.Option(help="Folder for FMUs, results and pictures.", metavar="FOLDER")] = Path("out"),
) -> Result:
    """Build the FMUs, and find damage that begins during a run.

    Two zones of a membrane lose stiffness half way through the run. Four sensors with noisy resistance, four estimators and
    the detector find the damage, window by window, with its standard deviation. Beside it the digital twin watches the
    same resistances: an alarm, the onset, the damages. Leaves results and pictures in out/damage_begins.

    For example:

        gossamer demo
    """
    build_fmus(out / "fmus")
    return _run(DEMO, out / DEMO, out / "fmus", pictures=True, watched=True)


def simulate(
    scenario: str,
    out: Path | None,
    fmus: Path,
    *,
    values: list[str] | None = None,
    watched: bool = False,
    resume: bool = False,
    **options: Any,  # noqa: ANN401
) -> tuple[xr.Dataset, Path]:
    """Run a scenario with the options of the command; return its results and their folder."""
    from ..run.progress import ProgressBar
    from ..run.runner import run_scenario
    from ..scenario.values import read_changes

    if watched and resume:
        msg = "--watch must see a run from its start. Resume it without --watch, then use 'gossamer watch' on its results."
        raise OrchestratorError(msg)
    path = find_scenario(scenario)
    name = f"{path.stem}_ssp" if path.suffix == ".ssp" else path.stem  # not over those of the scenario it was made of
    folder = Path("out") / name if out is None else out
    options |= {
        "values": read_changes(values or []),
        "resume": resume,
        "observers": [LiveWatch(folder / WATCH)] if watched else [],
    }
    return run_scenario(path, fmus, folder, progress=ProgressBar(path.stem, stderr()), **options), folder


def _run(
    scenario: str,
    out: Path | None,
    fmus: Path,
    *,
    pictures: bool,
    watched: bool,
    **options: Any,  # noqa: ANN401
) -> Result:
    """Run one scenario, write everything, and return what was judged; say which page to open."""
    from ..pages import PAGE
    from ..results.files import CSV, NETCDF

    with Drawing() if pictures else nullcontext() as drawing:
        try:
            data, out = simulate(scenario, out, fmus, watched=watched, **options)
        except KeyboardInterrupt as error:
            for text in ("Interrupted.", *getattr(error, "__notes__", ())):
                typer.echo(text, err=True)
            raise typer.Exit(130) from None
        files = [out / name for name in (NETCDF, CSV, *[WATCH] * watched) if (out / name).is_file()]
        for path in files:
            show(path)
        found = _judged(data)
        drawn = draw(drawing, data, out, note) if drawing else []
    for path in drawn:
        show(path)
    if watched and (out / WATCH).is_file():
        found["watch"] = json.loads((out / WATCH).read_text(encoding="utf-8"))
        found["valid"] = found["valid"] is not False and found["watch"]["misfit"][-1] <= LARGE
    if out / PAGE in drawn:
        note_page(out / PAGE)
    about = {
        "scenario": find_scenario(scenario),
        "ended": data.attrs["ended"],
        "stop_s": float(data["time"][-1]),
        "wall_time_s": float(data.attrs["wall_time"]),
        "files": [*files, *drawn],
    }
    return Result(about | found, INVALID if found["valid"] is False else 0)


def draw(drawing: Drawing, data: xr.Dataset, out: Path, say: Callable[[str], None]) -> list[Path]:
    """Draw pictures and write the page of a run; return their paths. What goes wrong is a warning and ends no run."""
    from ..pages import PAGE
    from ..results.report import run_page

    drawing.begin(out, stride_of(data, say))
    page = save_page(lambda: run_page(data, out), out / PAGE)
    return [*drawing.finish(), *page]


def _judged(data: xr.Dataset) -> dict[str, Any]:
    """Return the judgements of the detector, and print them as tables on stderr, with reasons for doubt."""
    from ..results.judgements import doubts, windows
    from ..results.tables import history_table, zone_table
    from ..results.verdict import sensor_doubts

    console, sentences = stderr(), sensor_doubts(data)
    try:
        ended = windows(data)
        sentences = doubts(data, ended) + sentences
    except ResultsError:  # there is no detector
        ended = []
    if len(ended) > 1:
        console.print(history_table(ended))
    for judgement in [window for window in ended if window.valid][-1:]:
        console.print(zone_table(judgement))
    for sentence in sentences:
        console.print(sentence, style="bold yellow", highlight=False)
    return {
        "valid": ended[-1].valid if ended else None,
        "judgements": [
            {
                "time_s": window.time,
                "valid": window.valid,
                "damage": window.estimated,
                "deviation": window.deviation,
                "true_damage": window.true,
                **({window.likeness: window.likeness_value} if window.likeness else {}),
                **({} if isnan(window.risk) else {"risk": window.risk}),
            }
            for window in ended
        ],
        "doubts": sentences,
    }
