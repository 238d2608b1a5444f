"""Run a scenario from its file to results on disk, or only its start, in a process of its own."""

from __future__ import annotations

import logging
import pickle
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from gossamer_files import holding_signals, write_text
from gossamer_files.options import option

from ..errors import OrchestratorError, ResultsError, check_path, writing
from ..results import files
from ..results.shapes import SHAPES, settle_shapes
from ..scenario.schema import Given, Scenario
from .child import WAITING, Outline, RunTask
from .folders import locked, scratch
from .master import Observer
from .position import DIVIDED, NOT_FINITE
from .process import Process
from .progress import ProgressBar
from .stream import write_waiting

if TYPE_CHECKING:
    import xarray as xr


logger = logging.getLogger(__name__)
_PACKAGE = logging.getLogger(__name__.partition(".")[0])


def run_scenario(
    scenario: Scenario | Path | str,
    fmus: Path | str,
    out: Path | str | None = None,
    *,
    step: float | None = None,
    stop: float | None = None,
    values: Mapping[str, Given] | None = None,
    master: str | None = None,
    limit: float | None = None,
    strict: bool = False,
    threads: int = 1,
    resume: bool = False,
    csv: bool | None = None,
    observers: Sequence[Observer] = (),
    progress: ProgressBar | None = None,
    soon: Callable[[], object] | None = None,
) -> xr.Dataset:
    """Simulate a scenario.

    The FMUs are in a process of their own, so this one outlives whatever they do.

    Parameters
    ----------
    scenario : Scenario or path
        What to run: a scenario file, an ``.ssp``, or the name of a shipped scenario.
    fmus : path
        Folder in which FMUs are looked up by name.
    out : path or None
        Folder for ``results.nc`` and ``results.csv``; None writes nothing.
    step, stop : float or None
        Communication step and last time [s] in place of those of the file.
    values : mapping of str to value, optional
        Values in place of those of the file, see ``scenario.changes.changed``.
    master : {"gauss-seidel", "jacobi"} or None
        Master in place of that of the file, or of an SSP, which states none.
    limit : float or None
        Time that one call of an FMU may take [s]; None is any.
    strict : bool
        Refuse FMUs whose model description is against the rules of FMI, and end the run at the first value that is not
        finite, group that does not converge or smallest step that misses its tolerance; by default these are warnings.
    threads : int
        How many components may step at once; it pays where their steps take some 0.2 ms and more. The results are the same.
    resume : bool
        Continue the unfinished run in ``out`` from its last saved state.
    csv : bool or None
        Write ``results.csv``; None if it has at most 10 million values.
    observers : sequence of Observer
        What else watches the run. They are pickled, and live in its process; use ``Simulation`` for others.
    progress : ProgressBar or None
        Shows how far it is.
    soon : callable or None
        Called once when the run will end within 3 s at its mean speed so far, at once if it has no more than 10,000 steps,
        and not at all if it ends before that is known.

    Returns
    -------
    xarray.Dataset
        As described in ``results.dataset``; its attribute ``ended`` is ``complete``, or says which FMU ended it.

    Raises
    ------
    ScenarioError, FmuError, ResultsError
        The scenario, an FMU or the folder for results cannot be used; nothing was run. ``ResultsError`` also if the disk
        is full; what it took is kept.
    SimulationError, KeyboardInterrupt
        The run ended early. Its results so far are in ``out``, and ``ended`` gives the reason.

    Examples
    --------
    >>> data = run_scenario("scenarios/damaged.toml", fmus="out/fmus", out="out/damaged")
    >>> data["detector.damage"].isel(time=-1)
    >>> deeper = run_scenario("damaged", fmus="out/fmus", values={"membrane.damage[1]": 0.3})
    """
    with ExitStack() as stack:
        temporary = stack.enter_context(scratch())
        folder = temporary / "results" if out is None else Path(out)
        check_path(folder, ResultsError)
        if not folder.exists():
            stack.callback(_remove_empty, folder)
        files.make_folder(folder)
        stack.enter_context(locked(folder))
        messages = stack.enter_context(Messages())
        task = RunTask(
            scenario=scenario,
            fmus=fmus,
            step=step,
            stop=stop,
            values=values,
            master=master,
            strict=strict,
            scratch=temporary,
            level=logger.getEffectiveLevel(),
            out=folder,
            threads=threads,
            resume=resume,
            observers=_pickled(observers),
        )
        begun = time.perf_counter()
        process = stack.enter_context(Process(task))
        import xarray  # noqa: F401 (takes a second, while the other process starts)

        process.watch(limit, progress, soon)
        process.end()
        error = process.error
        try:
            last, path = _settle(process, folder, temporary, time.perf_counter() - begun, resumed=resume)
            replaced = last is not None and path.name == files.NETCDF
            if replaced:
                messages.save(folder)
            if error is None:
                (folder / files.RESUME).unlink(missing_ok=True)
            elif last is not None and out is not None:
                beside = "" if replaced else f" {folder / files.NETCDF} is of an earlier run."
                error.add_note(f"Results until t = {last:.9g} s are in {folder if replaced else path}.{beside}")
                if (folder / files.RESUME).is_file():
                    error.add_note("Continue the run with 'gossamer run --resume'.")
            data = files.load_results(folder) if replaced else None
            if data is not None and out is not None:
                _write_csv(data, folder, csv)
        except ResultsError as late:
            if error is None:
                raise
            error.add_note(str(late))
        if error is not None:
            raise error
        assert data is not None
        return data.load() if out is None else data


def _settle(
    process: Process, folder: Path, temporary: Path, wall_time: float, *, resumed: bool
) -> tuple[float | None, Path]:
    """Finish the netCDF file; return the time of its last row, None without any, and where it is.

    It takes the place of earlier results, but for those of a complete run if this one is not.
    """
    path = folder / files.UNFINISHED_NETCDF
    if process.shared is None:
        return None, path
    file = write_waiting(path, temporary / WAITING, process.shared, process.position)
    if not file.count:
        path.unlink()
        settle_shapes(folder, kept=False)
        return None, path
    error = process.error
    reason = "interrupted" if isinstance(error, KeyboardInterrupt) else str(error)
    counts = process.position[NOT_FINITE], process.position[DIVIDED]
    effort = {name: {key: round(value, 3) for key, value in each.items()} for name, each in process.effort.items()}
    file.end(reason if error is not None else process.ended, wall_time, counts, effort)
    last = file.last_time()
    logger.info("%d communication points until t = %.9g s in %.1f s", file.count, last, wall_time)
    for name, each in effort.items():
        text = "%s: %.2f s, %d steps refused, %d states restored"
        logger.info(text, name, each["seconds"], each["refused"], each["restored"])
    full = isinstance(error, ResultsError) and (folder / files.NETCDF).exists()
    if full or (error is not None and files.has_complete(folder)):
        return last, path
    with writing(folder, ResultsError), holding_signals():
        _remove_earlier(folder, drawn=resumed or (folder / files.NETCDF).is_file())
        path = path.replace(folder / files.NETCDF)
        settle_shapes(folder, kept=True)
        if (folder / files.UNFINISHED_WATCH).is_file():
            (folder / files.UNFINISHED_WATCH).replace(folder / files.WATCH)
    return last, path


def _remove_earlier(folder: Path, *, drawn: bool) -> None:
    """Remove what was made of earlier results, maybe drawn, so that a folder has files of one run at any moment."""
    from ..pages import PAGE
    from ..results.report.pictures import remove_drawn

    if drawn:
        remove_drawn(folder)
    twin = folder / Path(files.TWIN).stem  # of what the twin found, or of a run that is called so
    if (folder / files.TWIN).is_file() and not any((twin / name).is_file() for name in files.RECORDED):
        (twin / PAGE).unlink(missing_ok=True)
    for name in (files.CSV, files.MESSAGES, SHAPES, files.WATCH, files.TWIN):
        (folder / name).unlink(missing_ok=True)


def _write_csv(data: xr.Dataset, folder: Path, wanted: bool | None) -> None:
    """Write the CSV file if it is wanted, or, where nobody said, not too large."""
    values = files.values_in(data)
    if wanted or (wanted is None and values <= files.CSV_VALUES):
        files.save_csv(data, folder)
        return
    if wanted is None:
        text = f"no %s: it would have %d values, more than %d. {option('csv', True)} writes it."
        logger.warning(text, files.CSV, values, files.CSV_VALUES)


def _pickled(observers: Sequence[Observer]) -> bytes:
    """Pickle observers for another process, and refuse those that it could not read."""
    advice = "Observers live in the process of the run: define them in a module, or use Simulation."
    for observer in observers:
        if type(observer).__module__ == "__main__":
            msg = f"{type(observer).__name__} is defined in a script. {advice}"
            raise OrchestratorError(msg)
    try:
        return pickle.dumps(list(observers))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        msg = f"an observer cannot be pickled: {error}. {advice}"
        raise OrchestratorError(msg) from error


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def validate_scenario(
    scenario: Scenario | Path | str,
    fmus: Path | str,
    *,
    limit: float | None = None,
    **changes: Any,  # noqa: ANN401
) -> Outline:
    """Check everything that ``run_scenario`` checks before its first step: the scenario, its FMUs, and that these start.

    Parameters
    ----------
    scenario, fmus, limit, **changes
        As of ``run_scenario``: ``step``, ``stop``, ``values``, ``master`` and ``strict`` are what may change.

    Returns
    -------
    Outline

    Raises
    ------
    ScenarioError, FmuError, ResultsError, SimulationError
        As ``run_scenario``.
    """
    with scratch() as temporary, Messages() as messages:
        level = logger.getEffectiveLevel()
        task = RunTask(scenario=scenario, fmus=fmus, scratch=temporary, level=level, only_start=True, **changes)
        with Process(task) as process:
            process.watch(limit, None)
        if process.error is not None:
            raise process.error
        assert process.outline is not None
        return replace(process.outline, warnings=messages.texts)


class Messages(logging.Handler):
    """Collects warnings and errors of this package while it is a context.

    Attributes
    ----------
    texts : list of str
        Each with its level, on one line.
    """

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def __enter__(self) -> Messages:
        _PACKAGE.addHandler(self)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        _PACKAGE.removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a message."""
        self.texts.append(f"{record.levelname.lower()}: {' '.join(record.getMessage().split())}")

    def save(self, folder: Path) -> None:
        """Write ``messages.txt``, or remove that of an earlier run if there is nothing to say."""
        path = folder / files.MESSAGES
        with writing(path, ResultsError):
            if not self.texts:
                path.unlink(missing_ok=True)
                return
            write_text(path, "\n".join(self.texts) + "\n")
