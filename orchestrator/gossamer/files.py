"""Files: look into FMUs, begin a scenario, write scenarios and results for people and for other programs.

Made by ``docs/make_front_door.py`` from the table of the command line: change the command, then run ``make goldens``.
"""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from .results.files import FmuInfo


def new(
    name: str | PathLike[str],
) -> Path:
    """Write a scenario of your own, with a comment on every table and key.

    It runs as it is. A file that is there is not overwritten.

    Parameters
    ----------
    name : path
        Name of the scenario, or file to write; NAME.toml by default.

    Returns
    -------
    Path
        The scenario.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.new("my_scenario")
    """
    given = vars()
    from . import table
    from .work import files as work

    with table.words_of_python("new"):
        return work.new(**table.values("new", given))


def info(
    fmu: str | PathLike[str],
    *,
    locals: bool = False,
) -> FmuInfo:
    """Look into an FMU: parameters, inputs and outputs.

    Parameters
    ----------
    fmu : path
        An FMU file.
    locals : bool, default False
        List local variables too.

    Returns
    -------
    FmuInfo
        Variables by name; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.info("out/fmus/sensor.fmu").variables["rest_strain"]["unit"]
    """
    given = vars()
    from . import table
    from .work import files as work

    with table.words_of_python("info"):
        return work.info(**table.values("info", given))


def view(
    results: str | PathLike[str],
) -> Path:
    """Open a page in the browser; that of a run is written first if it is missing or old.

    Parameters
    ----------
    results : path
        Folder of a page or of a run, results.nc or results.csv, or an artifact, such as a sensor.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.view("out/damaged")
    """
    given = vars()
    from . import table
    from .work import files as work

    with table.words_of_python("view"):
        return work.view(**table.values("view", given))


def report(
    results: str | PathLike[str],
) -> Path:
    """Write the page of a run from its results.

    Parameters
    ----------
    results : path
        Folder of a run, or its results.nc or results.csv.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.report("out/damaged")
    """
    given = vars()
    from . import table
    from .work import files as work

    with table.words_of_python("report"):
        return work.report(**table.values("report", given))


def plot(
    results: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    format: str = "png",
) -> list[Path]:
    """Draw the pictures of a run again, from its results.

    Parameters
    ----------
    results : path
        Folder of a run, or its results.nc or results.csv.
    out : path or None
        Folder to write to; that of the results by default.
    format : str, default "png"
        Of the pictures: png, svg or pdf.

    Returns
    -------
    list of Path
        The pictures.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.plot("out/damaged", format="svg")
    """
    given = vars()
    from . import table
    from .work import files as work

    with table.words_of_python("plot"):
        return work.plot(**table.values("plot", given))


def export_vtk(
    results: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
) -> list[Path]:
    """Write the membranes of a run for ParaView.

    Parameters
    ----------
    results : path
        Folder of a run, or its results.nc or results.csv.
    out : path or None
        Folder to write to; the folder vtk beside the results by default.

    Returns
    -------
    list of Path
        For each membrane the .pvd, which ParaView opens.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.export_vtk("out/sail")
    """
    given = vars()
    from . import table
    from .work import files as work

    with table.words_of_python("export_vtk"):
        return work.export_vtk(**table.values("export_vtk", given))


def export_ssp(
    scenario: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    fmus: str | PathLike[str] = "out/fmus",
) -> Path:
    """Write a scenario and its FMUs as one .ssp for other tools.

    Parameters
    ----------
    scenario : path
        A scenario file, or the name of one that is shipped.
    out : path or None
        File to write; out/NAME.ssp by default.
    fmus : path, default "out/fmus"
        Folder of the FMUs that scenarios name.

    Returns
    -------
    Path
        The .ssp.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.export_ssp("damaged")
    """
    given = vars()
    from . import table
    from .work import files as work

    with table.words_of_python("export_ssp"):
        return work.export_ssp(**table.values("export_ssp", given))


def container(
    scenario: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    fmus: str | PathLike[str] = "out/fmus",
    fmi: int = 2,
) -> Path:
    """Merge a scenario and its FMUs into one FMU.

    Parameters
    ----------
    scenario : path
        A scenario file, an .ssp, or the name of a shipped scenario.
    out : path or None
        File to write; out/NAME.fmu by default.
    fmus : path, default "out/fmus"
        Folder of the FMUs that scenarios name.
    fmi : int, default 2
        FMI version of the container, 2 or 3.

    Returns
    -------
    Path
        The FMU.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.container("damaged", fmi=3)
    """
    given = vars()
    from . import table
    from .work import files as work

    with table.words_of_python("container"):
        return work.container(**table.values("container", given))
