"""Run a scenario from its file to results on disk."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import SimulationError
from ..exchange.open import open_scenario
from ..results.dataset import make_dataset
from ..results.files import make_folder, save_results
from ..scenario.plan import make_plan
from ..scenario.schema import Scenario
from .master import Observer, Simulation
from .recorder import Recorder

if TYPE_CHECKING:
    import xarray as xr


def run_scenario(
    scenario: Scenario | Path | str,
    fmus: Path | str,
    out: Path | str | None = None,
    *,
    step: float | None = None,
    stop: float | None = None,
    master: str | None = None,
    strict: bool = False,
    observers: Sequence[Observer] = (),
) -> xr.Dataset:
    """Simulate a scenario.

    Parameters
    ----------
    scenario : Scenario or path
        What to run: a scenario file or an ``.ssp``.
    fmus : path
        Folder in which FMUs are looked up by name.
    out : path or None
        Folder for ``results.nc`` and ``results.csv``; None writes nothing.
    step, stop : float or None
        Communication step and last time [s] in place of those of the file.
    master : {"gauss-seidel", "jacobi"} or None
        Master in place of that of the file, or of an SSP, which states none.
    strict : bool
        Refuse FMUs whose model description is against the rules of FMI; by default that is a warning.
    observers : sequence of Observer
        More observers, for instance a ``ProgressBar``.

    Returns
    -------
    xarray.Dataset
        As described in ``results.dataset``; its attribute ``ended`` is ``complete``, or says which FMU ended it.

    Raises
    ------
    ScenarioError, FmuError, ResultsError
        The scenario, an FMU or the folder for results cannot be used; nothing was run.
    SimulationError, KeyboardInterrupt
        The run ended early. Its results so far are in ``out``, and ``ended`` gives the reason.

    Examples
    --------
    >>> data = run_scenario("scenarios/damaged.toml", fmus="out/fmus", out="out/damaged")
    >>> data["detector.damage"].isel(time=-1)
    """
    if not isinstance(scenario, Scenario):
        with open_scenario(Path(scenario), step=step, stop=stop) as opened:
            return run_scenario(opened, fmus, out, master=master, strict=strict, observers=observers)
    if master is not None:
        order = scenario.order if master == "gauss-seidel" else None
        scenario = scenario.model_copy(update={"master": master, "order": order})
    plan = make_plan(scenario, Path(fmus), strict=strict)
    recorder = Recorder(plan)
    if out is not None:
        make_folder(Path(out))
    simulation, ended, begun = Simulation(plan), "interrupted", time.perf_counter()
    try:
        with simulation:
            simulation.run([recorder, *observers])
        ended = simulation.ended or "complete"
    except SimulationError as error:
        ended = str(error)
        if out is not None and len(recorder.time):
            error.add_note(f"Results until t = {recorder.time[-1]:.9g} s are in {out}.")
        raise
    finally:
        wall = time.perf_counter() - begun
        how = {"ended": ended, "wall_time": wall, "divided_steps": simulation.divided}
        data = make_dataset(plan, recorder.time, recorder.table, **how)
        if out is not None and len(recorder.time):
            save_results(data, Path(out))
    return data
