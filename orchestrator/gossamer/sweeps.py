"""Sweeps: a scenario with many values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from gossamer_files.inputs import check_outputs
from gossamer_files.tables import TableText

from .arguments import Address, AnyPath, Count, Folder, Name, Ranges, assigned, command
from .options import ScenarioOptions
from .results import Result
from .working import progress_bar, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_orchestrator.run.sweep import Case

MOST_CASES = 30  # in a table


@dataclass(frozen=True, kw_only=True, repr=False)
class Sweep(Result):
    """Runs of a scenario with many values.

    Attributes
    ----------
    folder : Path
        Where the cases are.
    cases : list of Case
        Number and values of each.
    ended : list of str
        How each ended: "complete", or what the run said.
    data : xarray.Dataset or None
        What the cases recorded, along ``case``, with the values that vary as coordinates; it stays on the disk until it is
        used. None if no case has results.
    files : list of Path
        Table, store, picture and page of all cases.
    """

    folder: Path
    cases: list[Case]
    ended: list[str]
    data: xr.Dataset | None
    files: list[Path]
    PLACE = "Files are in {}."

    @property
    def finished(self) -> list[bool]:
        """Whether each case is finished."""
        from gossamer_orchestrator.results.files import is_finished

        return [is_finished(text) for text in self.ended]

    def exit_code(self) -> int:
        """Return the exit code: 1 if a case failed."""
        return 0 if all(self.finished) else 1

    @property
    def sentence(self) -> str:
        """How many cases are finished."""
        return f"{sum(self.finished)} of {len(self.cases)} cases are finished."

    def __fspath__(self) -> str:
        return str(self.folder)

    def tables(self) -> list[TableText]:
        """Return the first cases and those that failed."""
        rows = [
            (str(case.number), *map(str, case.values.values()), text)
            for case, text, finished in zip(self.cases, self.ended, self.finished, strict=True)
            if case.number <= MOST_CASES or not finished
        ]
        some = f"the first {MOST_CASES} of {len(self.cases)} cases, and those that failed"
        return [TableText(("case", *self.cases[0].values, "ended"), rows, some * (len(self.cases) > MOST_CASES))]

    def to_json(self) -> dict[str, Any]:
        """Return the cases, their values and how they ended."""
        cases = [
            {"case": case.number, "values": case.values, "folder": self.folder / case.name, "ended": text}
            for case, text in zip(self.cases, self.ended, strict=True)
        ]
        return {"files": self.files, "cases": cases}


@command
def sweep(
    scenario: AnyPath,
    *,
    set: Ranges,
    out: Folder | None = None,
    workers: Count | None = None,
    scheduler: Address | None = None,
    plot: Name | None = None,
    pictures: bool = True,
    **options: Unpack[ScenarioOptions],
) -> Sweep:
    """Run a scenario with many values.

    Several runs at once, a folder per case with what a run writes; a table cases.csv; sweep.zarr, which xarray opens with
    everything along the dimension case; sweep.png with a panel per case; and report.html, the page of the sweep. Called
    again, it runs what is missing. A cluster needs this version of Gossamer and the same folders on all its machines.

    Parameters
    ----------
    scenario
        A scenario file, an .ssp, or the name of a shipped scenario.
    set
        What varies: NAME=FIRST:LAST:COUNT, NAME=1:20 for whole numbers, NAME=0.1,0.2, or NAME=VALUE. As often as needed; all
        values are combined with all others.
    out
        Folder of the sweep; out/NAME_sweep by default.
    workers
        Runs at once; as many as cores by default.
    scheduler
        Run on the Dask cluster of this scheduler, tcp://host:8786.
    plot
        Variable to draw, one panel per case, such as membrane.deflection; damage if there is a detector, else the first that
        was recorded.
    pictures
        Draw the picture, and write report.html, the page of the sweep.
    **options
        FMUs and times, see ``ScenarioOptions``.

    Returns
    -------
    Sweep
        Cases and how they ended, and the data of all along ``case``.

    Examples
    --------
    >>> gossamer.sweep("damaged", set={"membrane.damage[1]": [0.0, 0.1, 0.2], "seed": range(1, 4)})

    On the command line::

        gossamer sweep damaged --set "membrane.damage[1]=0:0.5:6"

        gossamer sweep damage_begins --set "estimator?.noise=0.05:0.2:4" --set seed=1:20 --out out/noise

        gossamer sweep damaged --set "membrane.damage[1]=0:0.5:6" --scheduler tcp://192.168.0.5:8786
    """
    from gossamer_orchestrator.results.files import is_finished
    from gossamer_orchestrator.results.places import with_places
    from gossamer_orchestrator.results.report.cases import open_cases, save_cases
    from gossamer_orchestrator.run import sweep as sweeps
    from gossamer_orchestrator.scenario.source import find_scenario

    from .pages.sweep import sweep_page

    path = find_scenario(str(scenario))
    folder = Path("out") / f"{path.stem}_sweep" if out is None else Path(out)
    check_outputs([folder / sweeps.TABLE])
    cases = sweeps.make_cases(sweeps.read_ranges(assigned(set, many=True)))
    times = [f"--{name}={options[name]!r}" for name in ("step", "stop") if options[name] is not None]
    fmus = str(Path(options["fmus"]).absolute())
    arguments = ["run", str(path.absolute()), "--fmus", fmus, "--no-pictures", "--no-csv", *times]
    if scheduler is None:
        spread: sweeps.Spread = partial(sweeps.on_cores, workers=workers)
    else:
        from gossamer_models.campaign.run import on_cluster

        spread = partial(on_cluster, scheduler=scheduler)
    bar = progress_bar(path.stem)
    try:
        with bar:
            ended = sweeps.run_sweep(
                cases,
                arguments,
                folder,
                spread=spread,
                progress=lambda done, total: bar.update(done, total, f"{done} of {total} cases,"),
            )
    except KeyboardInterrupt:
        msg = f"Interrupted; finished cases are kept in {folder}. Run the same command again to go on."
        raise KeyboardInterrupt(msg) from None
    files = [sweeps.write_table(cases, ended, folder)]
    if (store := sweeps.combine(cases, folder)) is not None:
        files.append(store)
        if pictures:
            varied = [name for name in cases[0].values if len({str(case.values[name]) for case in cases}) > 1]
            files += save_cases(store, folder, plot, varied)
    data = None if store is None else open_cases(store)
    if pictures:
        files += save_page(lambda: sweep_page(path.stem, cases, ended, data, folder, plot), folder)
    first = next((folder / case.name for case, text in zip(cases, ended, strict=True) if is_finished(text)), None)
    data = None if data is None else with_places(data, first)
    return Sweep(folder=folder, cases=cases, ended=ended, data=data, files=files)
