"""Files: begin a scenario, write scenarios and results for people and for other programs."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from gossamer_files.inputs import check_outputs, keep
from gossamer_files.options import option
from gossamer_orchestrator.errors import ResultsError, ScenarioError
from gossamer_orchestrator.scenario.source import INSPECTION, find_scenario, shipped_scenarios, write_new

from .arguments import AnyPath, File, FmiVersion, Folder, Form, NamesWithCommas, command, names_of
from .working import kinds_of, say

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_orchestrator import Scenario

LARGEST_PICTURE = 200_000  # points
STORES = (".json", ".zarr")  # have their page in a folder of their name


@command
def new(name: AnyPath) -> Path:
    """Write a scenario of your own, with a comment on every table and key.

    It runs as it is: a membrane that loses stiffness, noisy sensors that lose samples, estimators and the detector. By the
    name inspection it is a file for gossamer inspect: a dish, its healthy records and three inspections. A file that is
    there is not overwritten.

    Parameters
    ----------
    name
        Name of the scenario, or file to write; NAME.toml by default.

    Returns
    -------
    Path
        The scenario.

    Examples
    --------
    >>> gossamer.new("my_scenario")

    On the command line::

        gossamer new mine && gossamer build && gossamer run mine.toml
    """
    path = Path(name) if str(name).endswith(".toml") else Path(f"{name}.toml")
    if path.stem.startswith("-") or not path.stem.replace("-", "_").isidentifier():
        msg = f"{path.stem!r} is no name of a scenario. Begin with a letter, and take letters, digits, _ and -."
        raise ScenarioError(msg)
    write_new(path)
    inspection = path.stem == INSPECTION.stem
    say(
        f"Run it with 'gossamer inspect {path}'."
        if inspection
        else f"Build the FMUs with 'gossamer build', then run it with 'gossamer run {path}'."
    )
    return path


@command
def report(results: AnyPath) -> Path:
    """Write report.html, the page of a run, from its results.

    One file that opens from disk in any browser, without a network or a server: the verdict, the membrane in 3-D, damage,
    sensors and compensators over time, and what each component was given. A run writes it too.

    Parameters
    ----------
    results
        Folder of a run, or its results.nc or results.csv.

    Returns
    -------
    Path
        The page.

    Examples
    --------
    >>> gossamer.report("out/damaged")

    On the command line::

        gossamer report out/damage_begins
    """
    from gossamer_orchestrator import load_results
    from gossamer_orchestrator.results.report import write_report

    return write_report(load_results(Path(results)), _folder(results))


@command
def view(results: AnyPath) -> Path:
    """Open a page in the browser: of a run, or of what another command found.

    The page of a run is written first if it is not there, or older than the results.

    Parameters
    ----------
    results
        Folder of a page or of a run, results.nc or results.csv, or an artifact, such as a sensor.

    Returns
    -------
    Path
        The page.

    Examples
    --------
    >>> gossamer.view("out/damaged")

    On the command line::

        gossamer view out/damage_begins

        gossamer view out/mine/sensor
    """
    import webbrowser  # slow to load

    path = newest_page(Path(results))
    if not webbrowser.open(path.resolve().as_uri()):
        say(f"No browser could be started. Open {path} in one.", logging.WARNING)
    return path


def newest_page(results: Path) -> Path:
    """Return a page; write that of a run first if it is not there, or older than the results.

    Parameters
    ----------
    results : Path
        Folder of a page or a run, a file in it, or an artifact or a store whose page is in the folder of its name.

    Raises
    ------
    ResultsError
        There is neither a page nor results of a run.
    """
    from gossamer_orchestrator.pages import PAGE
    from gossamer_orchestrator.results.files import RECORDED, WATCH

    own = results.parent / results.stem  # folder of the page of an artifact or a store
    folder = own if results.suffix in STORES and (own / PAGE).is_file() else _folder(results)
    path, recorded = folder / PAGE, [folder / name for name in RECORDED]
    missing = results.suffix in STORES and not results.exists() and folder != own
    if missing or not any(each.is_file() for each in (path, *recorded)):
        raise ResultsError(_nothing_at(results))
    shown = [*recorded, folder / WATCH] if any(each.is_file() for each in recorded) else []
    latest = max((each.stat().st_mtime for each in shown if each.is_file()), default=0.0)
    return path if path.is_file() and path.stat().st_mtime >= latest else report(results)


def _nothing_at(results: Path) -> str:
    """Say what is missing, and which folders near by have a page or results."""
    from gossamer_orchestrator.pages import PAGE
    from gossamer_orchestrator.results.files import MAKE_SOME, RECORDED, others

    if results.suffix in STORES and results.exists():
        page = results.with_suffix("") / PAGE
        allowed = f"unless {option('pictures', False)} forbids it"
        return f"{results} has no page {page}. The command that wrote it writes one, {allowed}."
    is_folder = results.is_dir()
    what = f"the folder {results} has no page and no results" if is_folder else f"there is no file or folder {results}"
    return f"{what}. {others(results, (PAGE, *RECORDED)) or MAKE_SOME}"


def _folder(results: AnyPath) -> Path:
    """Return where the page and the pictures of results go: beside them, for a folder has those of one run."""
    from gossamer_orchestrator.results.files import NETCDF, UNFINISHED_NETCDF

    path = Path(results)
    beside = path.name == UNFINISHED_NETCDF and path.with_name(NETCDF).is_file()
    return path if path.is_dir() else path.with_suffix("") if beside else path.parent


@command
def plot(results: AnyPath, *, out: Folder | None = None, format: Form = "png") -> list[Path]:
    """Draw the pictures of a run again, from its results.

    Parameters
    ----------
    results
        Folder of a run, or its results.nc or results.csv.
    out
        Folder to write to; that of the results by default.
    format
        Of the pictures.

    Returns
    -------
    list of Path
        The pictures.

    Examples
    --------
    >>> gossamer.plot("out/damaged", format="svg")

    On the command line::

        gossamer plot out/damaged --format svg
    """
    from gossamer_orchestrator import load_results
    from gossamer_orchestrator.results.report import save_pictures

    data = load_results(Path(results))
    drawn = data.isel(time=slice(None, None, stride_of(data)))
    return save_pictures(drawn, _folder(results) if out is None else Path(out), format, _folder(results))


def stride_of(data: xr.Dataset) -> int:
    """Return of how many recorded points one is drawn, so that a picture has few enough; say so if it is not 1."""
    stride = -(-data.sizes["time"] // LARGEST_PICTURE)
    if stride > 1:
        say(f"Pictures are drawn of one in {stride} recorded points.", logging.WARNING)
    return stride


@command
def export_vtk(results: AnyPath, *, out: Folder | None = None) -> list[Path]:
    """Write the membranes of a run for ParaView.

    For each membrane NAME.pvd, which ParaView opens, and one .vtu for each instant: displaced nodes, displacement,
    zones, true and estimated damage, largest strain, and wrinkle: 0 taut, 1 wrinkled, 2 slack. The instants
    are those that the run recorded, [record] frames.

    Parameters
    ----------
    results
        Folder of a run, or its results.nc or results.csv.
    out
        Folder to write to; the folder vtk beside the results by default.

    Returns
    -------
    list of Path
        For each membrane the .pvd, which ParaView opens.

    Examples
    --------
    >>> gossamer.export_vtk("out/sail")

    On the command line::

        gossamer export-vtk out/damaged
    """
    from gossamer_orchestrator import load_results
    from gossamer_orchestrator.results.shapes import load_shapes
    from gossamer_orchestrator.results.vtk import export_vtk as write

    folder = _folder(results) / "vtk" if out is None else Path(out)
    return write(load_results(Path(results)), load_shapes(Path(results)), folder)


@command
def export_ssp(
    scenario: AnyPath, *, out: File | None = None, fmus: Folder = "out/fmus", without: NamesWithCommas = "none"
) -> Path:
    """Write a scenario and its FMUs as one .ssp for other tools.

    System Structure and Parameterization is the standard in which co-simulation tools exchange connected FMUs. Events, noise
    and dropout are refused, because SSP cannot express them, unless they are left behind.

    Parameters
    ----------
    scenario
        A scenario file, or the name of one that is shipped.
    out
        File to write; out/NAME.ssp by default.
    fmus
        Folder of the FMUs that scenarios name.
    without
        What of the scenario stays behind: noise, dropout, events, with commas. A warning names it.

    Returns
    -------
    Path
        The .ssp.

    Examples
    --------
    >>> gossamer.export_ssp("damaged")

    On the command line::

        gossamer build --native && gossamer export-ssp damaged

        gossamer export-ssp my_scenario.toml --out mine.ssp
    """
    from gossamer_orchestrator.exchange.ssp_writer import export_ssp as write

    return _write(write, scenario, fmus, out, ".ssp", names_of(without))


@command
def container(
    scenario: AnyPath,
    *,
    out: File | None = None,
    fmus: Folder = "out/fmus",
    fmi: FmiVersion = 2,
    without: NamesWithCommas = "none",
) -> Path:
    """Merge a scenario and its FMUs into one FMU.

    Its inputs are those that the scenario gives a value, and optional ones. Its outputs are those that no component receives
    and those that are recorded. All are named component.variable. Gain and bias are refused, and so are events, noise and
    dropout unless they are left behind.

    Parameters
    ----------
    scenario
        A scenario file, an .ssp, or the name of a shipped scenario.
    out
        File to write; out/NAME.fmu by default.
    fmus
        Folder of the FMUs that scenarios name.
    fmi
        FMI version of the container, 2 or 3.
    without
        What of the scenario stays behind: noise, dropout, events, with commas. A warning names it.

    Returns
    -------
    Path
        The FMU.

    Examples
    --------
    >>> gossamer.container("damaged", fmi=3)

    On the command line::

        gossamer build --native && gossamer container damaged

        gossamer container damaged --fmi 3 --out monitoring.fmu
    """
    from gossamer_orchestrator.exchange.container import build_container

    return _write(partial(build_container, fmi=fmi), scenario, fmus, out, ".fmu", names_of(without))


def _write(
    write: Callable[[Scenario, Path, Path], Path],
    text: AnyPath,
    fmus: AnyPath,
    out: AnyPath | None,
    ending: str,
    without: tuple[str, ...],
) -> Path:
    """Write a scenario, which is not overwritten, as another kind of file; return its path, and say what it holds."""
    from gossamer_orchestrator.exchange import open_scenario
    from gossamer_orchestrator.exchange.ssp_writer import leave_behind

    path = find_scenario(str(text))
    target = Path("out") / f"{path.stem}{ending}" if out is None else Path(out)
    with open_scenario(path) as opened, _naming_shipped(path):
        packed = [opened.fmu_path(component, Path(fmus)) for component in opened.components]
        keep(*packed)
        check_outputs([target])
        written = write(leave_behind(opened, without), Path(fmus), target)
        say(f"packed: {kinds_of(packed)}")
    return written


@contextmanager
def _naming_shipped(path: Path) -> Iterator[None]:
    """Say where a shipped scenario is, which is not to be changed, below what is wrong with it."""
    try:
        yield
    except ScenarioError as error:
        if path in shipped_scenarios().values():
            error.add_note(f"{path.name} ships with Gossamer as {path}. If it must change, change a copy.")
        raise
