"""Runs of scenarios: run one, look at its results."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError, ResultsError

from .arguments import AnyPath, Folder, Threads, command
from .fmus import build_fmus
from .options import RunOptions, as_settings
from .results import INVALID, Result, first_of
from .working import progress_bar, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_files.tables import TableText
    from gossamer_orchestrator.results.drawing import Drawing
    from gossamer_orchestrator.results.judgements import Judgement
    from gossamer_orchestrator.results.verdict import Verdict
    from rich.table import Table

DEMO = "damage_begins"
RUN_PICTURES = ("damage_history.png", "damage.png", "deflection.png", "sensors.png")


@dataclass(frozen=True, kw_only=True, repr=False)
class Run(Result):
    """Results of a run.

    Attributes
    ----------
    folder : Path
        Where its files are.
    data : xarray.Dataset
        What was recorded, over ``time`` [s], with units and provenance; by ``zone``, ``sensor`` and node where that is
        known, see ``gossamer_orchestrator.results.places``.
    scenario : Path or None
        Its file; None for results that were loaded.
    files : tuple of Path
        Results, pictures and page that were written now.
    """

    folder: Path
    data: xr.Dataset
    scenario: Path | None = None
    files: tuple[Path, ...] = ()

    @cached_property
    def _windows(self) -> list[Judgement] | None:
        """Judgements; None without a detector."""
        from gossamer_orchestrator.results.judgements import windows

        try:
            return windows(self.data)
        except ResultsError:
            return None

    @property
    def judgements(self) -> list[Judgement]:
        """Judgement of the detector at the end of every window; none without a detector."""
        return self._windows or []

    @cached_property
    def verdict(self) -> Verdict:
        """What the page of the run says first."""
        from gossamer_orchestrator.results.files import read_watch
        from gossamer_orchestrator.results.verdict import make_verdict

        return make_verdict(self.data, self.judgements, read_watch(self.folder))

    @cached_property
    def watched(self) -> dict[str, Any] | None:
        """What the twin saw that watched this run."""
        from gossamer_orchestrator.results.files import WATCH, read_watch

        return read_watch(self.folder) if self.folder / WATCH in self.files else None

    @property
    def valid(self) -> bool | None:
        """Whether the last judgement of the detector and what the twin saw are valid; None if nothing was judged.

        False if a component had values that are not finite.
        """
        from gossamer_orchestrator.results.files import is_explained, sees_enough

        if self.data.attrs.get("not_finite"):
            return False
        judged = self.judgements[-1].valid if self.judgements else None
        if self.watched is None:
            return judged
        return judged is not False and is_explained(self.watched) and sees_enough(self.watched)

    def exit_code(self) -> int:
        """Return the exit code."""
        return INVALID if self.valid is False else 0

    def __fspath__(self) -> str:
        return str(self.folder)

    def __getitem__(self, name: str) -> xr.DataArray:
        return self.data[name]

    @property
    def sentence(self) -> str:
        """The verdict."""
        return self.verdict.sentence

    def more(self) -> list[str]:
        """Return what else the verdict says."""
        return [*self.verdict.more, f"Files are in {self.folder}."]

    def doubts(self) -> list[str]:
        """Return what is doubtful in judgements and sensors."""
        from gossamer_orchestrator.results.judgements import doubts
        from gossamer_orchestrator.results.verdict import sensor_doubts

        return [*([] if self._windows is None else doubts(self.data, self._windows)), *sensor_doubts(self.data)]

    def picture(self) -> bytes | None:
        """Return the first picture of the run that there is."""
        return next(filter(None, (first_of([self.folder / name], name) for name in RUN_PICTURES)), None)

    def tables(self) -> list[TableText | Table]:
        """Return all judgements, and the last one that is valid by zone."""
        from gossamer_orchestrator.results.judgements import window_table, zone_table

        history = [window_table(self.judgements)] if len(self.judgements) > 1 else []
        return [*history, *map(zone_table, [each for each in self.judgements if each.valid][-1:])]

    def to_json(self) -> dict[str, Any]:
        """Return what was judged, and what the run took."""
        from gossamer_orchestrator.results.dataset import effort_of

        judgements = []
        for each in self.judgements:
            told = {"time_s": each.time, "valid": each.valid, "damage": each.estimated, "deviation": each.deviation}
            told |= {"determined": each.determined, "true_damage": each.true}
            judgements.append(told | ({each.likeness: each.likeness_value} if each.likeness else {}))
        return {
            "scenario": self.scenario,
            "ended": self.data.attrs["ended"],
            "stop_s": float(self.data["time"][-1]),
            "wall_time_s": float(self.data.attrs["wall_time"]),
            "components": effort_of(self.data),
            "files": self.files,
            "valid": self.valid,
            "judgements": judgements,
            "doubts": self.doubts(),
        } | ({} if self.watched is None else {"watch": self.watched})


@command
def run(
    scenario: AnyPath,
    *,
    out: Folder | None = None,
    pictures: bool = True,
    watch: bool = False,
    threads: Threads = 1,
    resume: bool = False,
    csv: bool | None = None,
    **options: Unpack[RunOptions],
) -> Run:
    """Run a scenario.

    Writes results.nc, results.csv, pictures and report.html, the page of the run. The FMUs run in a process of their own,
    and results are on the disk within a second: whatever ends the run, what it reached is kept, and ``resume`` continues it.

    Parameters
    ----------
    scenario
        A scenario file, an .ssp, or the name of a shipped scenario.
    out
        Folder for the results; out/NAME by default, out/NAME_ssp of an .ssp.
    pictures
        Draw pictures of what was recorded, and write report.html, the page of the run.
    watch
        Run the digital twin beside it: an alarm when damage begins, then its place.
    threads
        How many FMUs may step at once; it pays where steps take some 0.2 ms and more.
    resume
        Continue the unfinished run in the folder for results.
    csv
        Write results.csv; by default if it has at most 10 million values.
    **options
        FMUs, times, changes and checks, see ``RunOptions``.

    Returns
    -------
    Run
        Data, verdict and judgements; a path of the folder for results; displayed in a notebook.

    Examples
    --------
    >>> gossamer.run("damaged", set={"membrane.damage[1]": 0.3}, out="out/deeper")

    On the command line::

        gossamer build && gossamer run damaged

        gossamer run my_scenario.toml --out out/mine --no-pictures

        gossamer run damage_begins --watch

        gossamer run other.ssp --step 1e-3 --stop 2 --master jacobi

        gossamer run damaged --set "membrane.damage[1]=0.3" --out out/deeper

        gossamer run my_scenario.toml --resume
    """
    from gossamer_orchestrator.results.drawing import Drawing
    from gossamer_orchestrator.results.files import CSV, NETCDF, UNFINISHED_WATCH, WATCH
    from gossamer_orchestrator.results.places import with_places
    from gossamer_orchestrator.run.runner import run_scenario
    from gossamer_orchestrator.scenario.source import find_scenario

    from .watching import LiveWatch

    if watch and resume:
        given = option("watch", True)
        msg = f"{given} must see a run from its start. Resume it without {given}, then use 'gossamer watch' on its results."
        raise OrchestratorError(msg)
    path = find_scenario(str(scenario))
    name = f"{path.stem}_ssp" if path.suffix == ".ssp" else path.stem  # not over those of its scenario
    folder = Path("out") / name if out is None else Path(out)
    with Drawing(folder) if pictures else nullcontext() as drawing:
        data = run_scenario(
            path,
            out=folder,
            progress=progress_bar(path.stem),
            soon=drawing.get_ready if drawing else None,
            observers=[LiveWatch(folder / UNFINISHED_WATCH)] if watch else [],
            threads=threads,
            resume=resume,
            csv=csv,
            **as_settings(**options),
        )
        files = [folder / each for each in (NETCDF, CSV, *[WATCH] * watch) if (folder / each).is_file()]
        files += draw(drawing, data, folder) if drawing else []
    return Run(folder=folder, data=with_places(data, folder), scenario=path, files=tuple(files))


def draw(drawing: Drawing, data: xr.Dataset, folder: Path) -> list[Path]:
    """Draw pictures and write the page of a run; return their paths. What goes wrong is a warning and ends no run."""
    from gossamer_orchestrator.results.report import run_page

    from .files import stride_of

    drawing.begin(stride_of(data))
    page = save_page(lambda: run_page(data, folder), folder)
    return [*drawing.finish(), *page]


@command
def demo(*, out: Folder = "out") -> Run:
    """Build the FMUs, and find damage that begins during a run.

    Two zones of a membrane lose stiffness half way through the run. Four sensors with noisy resistance, four estimators and
    the detector find the damage, window by window, with its standard deviation. Beside it the digital twin watches the
    same resistances: an alarm, the onset, the damages. Leaves results and pictures in out/damage_begins.

    Parameters
    ----------
    out
        Folder for FMUs, results and pictures.

    Returns
    -------
    Run
        Data, verdict and judgements; a path of the folder for results; displayed in a notebook.

    Examples
    --------
    >>> gossamer.demo()

    On the command line::

        gossamer demo
    """
    fmus = Path(out) / "fmus"
    build_fmus(fmus)
    return run(DEMO, out=Path(out) / DEMO, fmus=fmus, watch=True)


def load(results: AnyPath) -> Run:
    """Look at the results of an earlier run.

    Parameters
    ----------
    results
        Folder of a run, or its results.nc or results.csv.

    Returns
    -------
    Run
        Data, verdict and judgements; it is displayed in a notebook.

    Raises
    ------
    ResultsError
        There are no results.

    Examples
    --------
    >>> gossamer.load("out/damaged").data["membrane.deflection"].plot()
    """
    from gossamer_orchestrator import load_results
    from gossamer_orchestrator.results.places import with_places

    path = Path(results)
    folder = path if path.is_dir() else path.parent
    return Run(folder=folder, data=with_places(load_results(path), folder))
