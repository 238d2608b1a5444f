"""The twin beside a record or a run, window by window, until damage begins."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from gossamer_files.inputs import check_outputs
from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError, require
from gossamer_orchestrator.words import counted

from .arguments import AnyPath, File, command, expected_errors
from .options import TwinOptions
from .records import KnownRecord, beside, find_arriving, find_in_results, find_record, keep_records, name_of
from .watched import SEE, Watching
from .working import TERMINAL, progress_bar, save_page, talk

if TYPE_CHECKING:
    from gossamer_models.arrays import Matrix, Vector
    from gossamer_models.membrane import Structure
    from gossamer_models.twin import Watch
    from gossamer_orchestrator import Plan, Simulation

LEAST_WINDOW = 20  # samples
ROUNDING = 1e-9
FALSE_ALARMS = 1e-5
FITTING = "fitting onset and damage"


class LiveWatch:
    """Observer of a run that watches it while it goes on, in the process of the run.

    Parameters
    ----------
    out : Path
        JSON file to write.
    window : float, optional
        Length of a window [s]; by default the longest period of the membrane.
    """

    def __init__(self, out: Path, window: float | None = None) -> None:
        self._out, self._window, self._quiet = out, window, TERMINAL.quiet
        self._twin: Watch | None = None
        self._seen: Watching | None = None
        self._due = 0.0  # [s] after the start
        self._forgotten = 0.0  # [s] until where windows are judged; a record counts its time from there

    def begin(self, simulation: Simulation) -> None:
        """Record what the scenario records."""
        from gossamer_orchestrator import Recorder
        from rich.console import Console

        self._out.unlink(missing_ok=True)  # of an earlier run
        self._recorder = Recorder(simulation.plan)
        self._recorder.begin(simulation)
        self._console = Console(stderr=True, quiet=self._quiet)
        with expected_errors():
            self._window = self._window or _period(_structure_of(simulation.plan), {})
        self._due = self._window * (1.0 - ROUNDING)

    def sample(self, simulation: Simulation) -> None:
        """Judge a window when it is complete, and forget it."""
        self._recorder.sample(simulation)
        if simulation.time - simulation.scenario.start < self._due:
            return
        from gossamer_orchestrator.results.dataset import make_dataset

        with expected_errors():
            time = self._recorder.time
            table, master = self._recorder.table, simulation.scenario.master
            found = find_in_results(make_dataset(simulation.plan, time - self._forgotten, table, master=master))
            assert self._window is not None  # since the run began
            samples = _samples(self._window, found)
            if self._twin is None or self._seen is None:
                simulation.say("compiling the twin (once)")
                self._twin = _begin(found, FALSE_ALARMS)
                self._seen = Watching(files=[self._out], zones=self._twin.zones, load_units=_load_units(found))
                simulation.say("")
            if found.record.samples < samples:
                return
            if self._seen.alarmed:
                simulation.say(FITTING)
            readings, loads = next(_windows([found], samples))
            self._seen.take(self._twin.advance(readings, loads), loads, self._console)
            simulation.say("")
            rest = time > time[0] + (samples - 0.5) * found.record.step
            self._forgotten = float(time[rest][0])
            self._recorder.clear(keep=int(rest.sum()))
            self._due += samples * found.record.step

    def end(self, simulation: Simulation) -> None:  # noqa: ARG002
        """Write what was found."""
        if self._seen is not None and self._seen.misfits:
            self._seen.end(self._console)


@command
def watch(
    record: AnyPath,
    *,
    window: float | None = None,
    false_alarms: float = FALSE_ALARMS,
    see: float = SEE,
    out: File | None = None,
    **options: Unpack[TwinOptions],
) -> Watching:
    """Watch a record as if it arrived live: raise an alarm when damage begins, then say when and where.

    The record begins, undamaged, when the load sets in. After each window the running twin tests whether damage explains the
    readings better; one window after an alarm it fits the onset and the damages. What finer elements add to the mesh of the
    twin is simulated beside a measured record. In the end it says which damage it would
    have seen in every zone; where that is too much, no alarm means nothing, and the exit code is 3.

    Parameters
    ----------
    record
        Results of a run (results.nc, results.csv or their folder), or a CSV file. Of a pipe, or - for the standard input,
        lines are read as they arrive; then the noise has to be stated.
    window
        Length of a window [s]; by default the longest period of the membrane, 0.05 s of the square.
    false_alarms
        Share of the windows that may raise a false alarm.
    see
        Damage that has to be seen in every zone, in nine of ten cases; 0.1 by default.
    out
        JSON file to write; watch.json beside the record by default. The page, report.html, is written into a folder of the
        same name beside it.
    **options
        Record and twin, see ``TwinOptions``.

    Returns
    -------
    Watching
        Alarms, onsets and damages, and the score of each window; displayed in a notebook.

    Examples
    --------
    >>> gossamer.watch("out/damage_begins").alarms

    On the command line::

        gossamer run damage_begins && gossamer watch out/damage_begins
        tail -f -n +1 readings.csv | gossamer watch - --noise 0.0006
    """
    from gossamer_orchestrator.results.files import WATCH

    from .pages.watch import watch_page

    source = Path(record)
    live = source.exists() and not (source.is_file() or source.is_dir())  # a pipe
    path = Path(out or (WATCH if live else beside(source, WATCH)))
    keep_records(source)
    check_outputs([path])
    require(0.0 < see < 1.0, f"{option('see')} is {see:g}. Write a damage between 0 and 1, for instance 0.1.")
    parts = find_arriving(source, options) if live else iter([find_record(source, options)])
    found = next(parts)
    samples = _samples(_period(found.structure, found.parameters) if window is None else window, found)
    many = None if live else found.record.samples // samples
    if many is not None and many < 2:
        msg = f"the record has {found.record.samples} samples, less than two windows of {samples}. Record longer."
        raise OrchestratorError(msg)
    console, rest, name = talk(), 0, "what arrived" if live else name_of(source)
    with progress_bar("watching") as bar:
        bar.update(aside="compiling")
        twin = _begin(found, false_alarms, options["sensor"])
        seen = Watching(files=[path], zones=twin.zones, see=see, load_units=_load_units(found))
        try:
            for done, (readings, loads) in enumerate(_windows(chain([found], parts), samples)):
                rest = readings.shape[1]
                if rest == samples:
                    text = f"{done} of {many} windows," if many else f"{done} windows,"
                    bar.update(done if many else None, many, text, FITTING if seen.alarmed else "")
                    seen.take(twin.advance(readings, loads), loads, console)
        finally:  # what arrives may make no sense: nothing that was seen before is lost
            if seen.times:
                bar.update(many, text=f"{len(seen.times)} windows,")
                if rest % samples:
                    console.print(f"The last {counted(rest, 'sample')}, too few for a window: not judged.", highlight=False)
                seen.end(console)
                page = partial(watch_page, name, seen.content, seen.more(), valid=not seen.exit_code())
                seen = replace(seen, files=[path, *save_page(page, path.with_suffix(""))])
    require(
        seen.times, f"fewer samples arrived than the {samples} of a window. Let more arrive, or shorten {option('window')}."
    )
    return seen


def _windows(parts: Iterable[KnownRecord], samples: int) -> Iterator[tuple[Matrix, dict[str, Vector]]]:
    """Yield the readings and the loads of each window of records that follow each other; the last one may be shorter."""
    import numpy as np

    values, loads = None, dict[str, Any]()
    for part in parts:
        record = part.record
        values = record.values if values is None else np.hstack([values, record.values])
        loads = {name: np.append(loads.get(name, ()), load) for name, load in record.inputs.items()}
        while values.shape[1] >= samples:
            yield values[:, :samples], {name: load[:samples] for name, load in loads.items()}
            values, loads = values[:, samples:], {name: load[samples:] for name, load in loads.items()}
    if values is not None and values.size:
        yield values, loads


def _period(structure: Structure | None, parameters: Mapping[str, float]) -> float:
    """Return the longest period of a membrane, by default the square, to two digits [s]."""
    from gossamer_models.membrane import first_period, square_structure

    structure = structure or square_structure()
    return float(f"{first_period(structure, parameters):.2g}")


def _load_units(found: KnownRecord) -> dict[str, str]:
    """Return the unit of each load of a record, by name."""
    from gossamer_models.twin.reading import input_units

    units = input_units(found.structure)
    return {name: units[name] for name in found.record.inputs}


def _structure_of(plan: Plan) -> Structure | None:
    """Return the membrane of a run, if its FMU carries what it was built from."""
    from gossamer_models.membrane import read_structure
    from gossamer_orchestrator.results.dataset import SETUP

    fmus = [component.fmu for component in plan.components if component.fmu.description.modelName == "membrane"]
    return next((read_structure(text) for fmu in fmus if (text := fmu.resource(SETUP)) is not None), None)


def _samples(window: float, found: KnownRecord) -> int:
    """Count the samples of a window, and refuse too few."""
    require(math.isfinite(window), f"{option('window')} is {window:g}. Write a positive number.")
    samples = round(window / found.record.step)
    if samples < LEAST_WINDOW:
        msg = f"a window of {window:g} s is {samples} samples of the record; it needs {LEAST_WINDOW} or more."
        raise OrchestratorError(msg)
    return samples


def _begin(found: KnownRecord, false_alarms: float, sensor: AnyPath | None = None) -> Watch:
    """Start the twin of a record, with the artifact of its sensors."""
    import numpy as np
    from gossamer_models.twin import Watch

    noise = found.record.noise_deviation()
    noise = np.nan_to_num(noise, nan=np.nanmax(noise))  # of sensors without values, or none yet
    known = found.twin(sensor) | {"parameters": {**found.parameters, **found.record.start}}
    return Watch(noise, **known, step=found.record.step, false_alarms=false_alarms, exact_mesh=found.of_run)
