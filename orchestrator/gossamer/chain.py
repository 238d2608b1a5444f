"""The chain of FMUs: build it, run it, sweep it, verify it.

Made by ``docs/make_front_door.py`` from the table of the command line: change the command, then run ``make goldens``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from .results.chain import Run, Sweep, Validation, Verification


def demo(
    *,
    out: str | PathLike[str] = "out",
) -> Run:
    """Build the FMUs, and find damage that begins during a run.

    Parameters
    ----------
    out : path, default "out"
        Folder for FMUs, results and pictures.

    Returns
    -------
    Run
        Data, verdict and judgements; a path of the folder for results; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.demo()
    """
    given = vars()
    from . import table
    from .work import chain as work

    with table.words_of_python("demo"):
        return work.demo(**table.values("demo", given))


def build(
    names: str | Sequence[str] | None = None,
    *,
    out: str | PathLike[str] = "out/fmus",
    artifact: str | PathLike[str] | None = None,
    scales: str | Sequence[float] | None = None,
    elements_per_side: int | None = None,
    order: int | None = None,
    law: str | None = None,
    setup: str | PathLike[str] | None = None,
    mesh: str | PathLike[str] | None = None,
    expose: bool = False,
    frame: bool = False,
    native: bool = False,
    platform: str | Sequence[str] | None = None,
    fmi: int = 2,
) -> dict[str, Path]:
    """Build FMUs.

    Parameters
    ----------
    names : str, sequence of str or None
        FMUs to build: membrane, sensor, compensator, estimator (a compensator that tolerates noise), filter
        (one for any sensor), detector: these six by default; framed_membrane (one that a spacecraft carries and
        feels), hub (a rigid spacecraft).
    out : path, default "out/fmus"
        Folder to write them to.
    artifact : path or None
        Identified sensor (for sensor, compensator, estimator and filter) or trained detector: its file, or
        nominal, wide or single_damage, which ship with Gossamer.
    scales : sequence of float, str or None
        Of the identified sensor, in place of its own: resistance at rest [ohm], its rise to full scale [ohm]
        and full scale [1].
    elements_per_side : int or None
        Elements along a side of the membrane, a multiple of 4; 4 by default.
    order : int or None
        Order of the membrane's elements: 1 for bilinear ones, 2 to 12 for spectral ones; 4 by default. 6 halves
        the error and takes seven times as long.
    law : str or None
        Law of the membrane's material: st_venant_kirchhoff, which carries compression, by default; hencky;
        neo_hookean; or relaxed, which wrinkles instead.
    setup : path or None
        Membrane on a mesh: TOML file with its material, supports, zones, loads and sensors (docs/setup.md), or
        sail, drum, reflector, tube, which ship with Gossamer.
    mesh : path or None
        With --setup: mesh file (.msh of gmsh, or any other that meshio reads) in place of the setup's own.
    expose : bool, default False
        With --setup: make the displacement of every node a variable.
    frame : bool, default False
        Put the membrane on a frame that flies: build framed_membrane in place of membrane.
    native : bool, default False
        Compile C code, so that the FMU runs without Python.
    platform : str, sequence of str or None
        With --native: linux64, win64, darwin64, aarch64-linux (FMI 3 only) or all; may be repeated; this
        machine's platform by default.
    fmi : int, default 2
        With --native: version of the standard, 2 or 3.

    Returns
    -------
    dict of str to Path
        FMUs by name.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.build("membrane", order=6)
    """
    given = vars()
    from . import table
    from .work import chain as work

    with table.words_of_python("build"):
        return work.build(**table.values("build", given))


def validate(
    scenario: str | PathLike[str],
    *,
    fmus: str | PathLike[str] = "out/fmus",
    step: float | None = None,
    stop: float | None = None,
    set: Mapping[str, object] | Sequence[str] | None = None,
    master: str | None = None,
    limit: float | None = None,
    strict: bool = False,
) -> Validation:
    """Check a scenario and its FMUs without running it.

    What it refuses, ``run`` refuses before its first step. It starts the FMUs in a process of their own.

    Parameters
    ----------
    scenario : path
        A scenario file, an .ssp, or the name of a shipped scenario.
    fmus : path, default "out/fmus"
        Folder of the FMUs that scenarios name.
    step : float or None
        Communication step [s] in place of the file's.
    stop : float or None
        Last time [s] in place of the file's.
    set : mapping, sequence of str or None
        Value in place of the file's, as of gossamer run.
    master : str or None
        gauss-seidel or jacobi, in place of the file's or for an .ssp.
    limit : float or None
        Time that one call of an FMU may take [s].
    strict : bool, default False
        Refuse FMUs that break the rules of FMI; else that is a warning.

    Returns
    -------
    Validation
        Components in stepping order, connections and warnings; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.validate("my_scenario.toml")
    """
    given = vars()
    from . import table
    from .work import chain as work

    with table.words_of_python("validate"):
        return work.validate(**table.values("validate", given))


def run(
    scenario: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    fmus: str | PathLike[str] = "out/fmus",
    step: float | None = None,
    stop: float | None = None,
    set: Mapping[str, object] | Sequence[str] | None = None,
    master: str | None = None,
    pictures: bool = True,
    watch: bool = False,
    limit: float | None = None,
    strict: bool = False,
    threads: int = 1,
    resume: bool = False,
    csv: bool | None = None,
) -> Run:
    """Run a scenario.

    The FMUs run in a process of their own, and results are on the disk within a second. Whatever ends
    the run, what it reached is kept, and ``resume`` continues it.

    Parameters
    ----------
    scenario : path
        A scenario file, an .ssp, or the name of a shipped scenario.
    out : path or None
        Folder for the results; out/NAME by default, out/NAME_ssp of an .ssp.
    fmus : path, default "out/fmus"
        Folder of the FMUs that scenarios name.
    step : float or None
        Communication step [s] in place of the file's.
    stop : float or None
        Last time [s] in place of the file's.
    set : mapping, sequence of str or None
        Value in place of the file's, such as membrane.damage[1]=0.3 or estimator?.noise=0.2; seed=2 is that of
        all noise. As often as needed.
    master : str or None
        gauss-seidel or jacobi, in place of the file's or for an .ssp.
    pictures : bool, default True
        Draw pictures of what was recorded, and write report.html, the page of the run.
    watch : bool, default False
        Run the digital twin beside it: an alarm when damage begins, then its place.
    limit : float or None
        End the run if one call of an FMU takes longer [s].
    strict : bool, default False
        Refuse FMUs that break the rules of FMI, values that are not finite, groups that do not converge, and
        steps that miss the tolerance of the step control.
    threads : int, default 1
        How many FMUs may step at once; it pays where steps take some 0.2 ms and more.
    resume : bool, default False
        Continue the unfinished run in the folder for results.
    csv : bool or None
        Write results.csv; by default if it has at most 10 million values.

    Returns
    -------
    Run
        Data, verdict and judgements; a path of the folder for results; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.run("damaged", set={"membrane.damage[1]": 0.3}, out="out/deeper")
    """
    given = vars()
    from . import table
    from .work import chain as work

    with table.words_of_python("run"):
        return work.run(**table.values("run", given))


def sweep(
    scenario: str | PathLike[str],
    *,
    set: Mapping[str, object] | Sequence[str],
    out: str | PathLike[str] | None = None,
    fmus: str | PathLike[str] = "out/fmus",
    step: float | None = None,
    stop: float | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    plot: str | None = None,
    pictures: bool = True,
) -> Sweep:
    """Run a scenario with many values.

    Several runs at once, a folder per case. The same call again runs what is missing.

    Parameters
    ----------
    scenario : path
        A scenario file, an .ssp, or the name of a shipped scenario.
    set : mapping or sequence of str
        What varies: NAME=FIRST:LAST:COUNT, NAME=1:20 for whole numbers, NAME=0.1,0.2, or NAME=VALUE. As often
        as needed; all values are combined with all others.
    out : path or None
        Folder of the sweep; out/NAME_sweep by default.
    fmus : path, default "out/fmus"
        Folder of the FMUs that scenarios name.
    step : float or None
        Communication step [s] in place of the file's.
    stop : float or None
        Last time [s] in place of the file's.
    workers : int or None
        Runs at once; as many as cores by default.
    scheduler : str or None
        Run on the Dask cluster of this scheduler, tcp://host:8786.
    plot : str or None
        Variable to draw, one panel per case, such as membrane.deflection; damage if there is a detector, else
        the first that was recorded.
    pictures : bool, default True
        Draw the picture, and write report.html, the page of the sweep.

    Returns
    -------
    Sweep
        Cases and how they ended, and the data of all along ``case``.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.sweep("damaged", set={"membrane.damage[1]": [0.0, 0.1, 0.2], "seed": range(1, 4)})
    """
    given = vars()
    from . import table
    from .work import chain as work

    with table.words_of_python("sweep"):
        return work.sweep(**table.values("sweep", given))


def verify(
    fmus: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    limit: float = 30.0,
) -> Verification:
    """Check FMUs against FMI and against their declared capabilities.

    Parameters
    ----------
    fmus : path or sequence of path
        FMU files of any tool.
    limit : float, default 30.0
        Time that one call of the FMU may take [s].

    Returns
    -------
    Verification
        Findings by FMU; ``passed`` if no check failed.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> assert gossamer.verify("out/fmus/sensor.fmu").passed
    """
    given = vars()
    from . import table
    from .work import chain as work

    with table.words_of_python("verify"):
        return work.verify(**table.values("verify", given))
