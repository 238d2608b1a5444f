"""The twin beside a record or a run, window by window, until damage begins."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError, require
from gossamer_orchestrator.words import counted

from .arguments import AnyPath, File, command, expected_errors
from .options import TwinOptions
from .records import KnownRecord, beside, file_of, find_arriving, find_in_results, find_record
from .results import INVALID, Saved, as_png, print_tables, typed, zone_coordinates
from .working import TERMINAL, keep_inputs, progress_bar, talk

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_files.tables import TableText
    from gossamer_models.arrays import Matrix, Vector
    from gossamer_models.membrane import Structure
    from gossamer_models.twin import DamageOnset, Watch, Window
    from gossamer_orchestrator import Plan, Simulation
    from rich.console import Console

LEAST_WINDOW = 20  # samples
ROUNDING = 1e-9
FALSE_ALARMS = 1e-5
SEE = 0.1  # [1]
FITTING = "fitting onset and damage"
UNITS = {"alarms": "s", "onset": "s", "onset_deviation": "s", "damage": "1", "deviation": "1", "misfit": "1", "sees": "1"}


@dataclass(frozen=True, kw_only=True, repr=False)
class Watching(Saved):
    """What was seen of a record, window by window.

    Attributes
    ----------
    files : list of Path
        JSON file of what was seen.
    zones : tuple of str
        Names of the zones.
    alarms : list of float
        Ends of the windows that raised an alarm [s].
    findings, withheld : list of gossamer_models.twin.DamageOnset
        Onset and damages, of each damage that began; apart those that do not explain the readings.
    times, misfits : list of float
        End of each window [s], and chi2 per sample [1].
    scores, sights : list of ndarray, shape (zones,)
        Of each window: score of new damage in each zone, over what raises an alarm [1], and the damage that would [1].
    without : list of tuple of int
        Of each window the sensors, from 1, whose readings are left out, all or some.
    see : float
        Damage that has to be seen in every zone [1].
    """

    zones: tuple[str, ...]
    see: float = SEE
    alarms: list[float] = field(default_factory=list)
    findings: list[DamageOnset] = field(default_factory=list)
    withheld: list[DamageOnset] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    scores: list[Vector] = field(default_factory=list)
    sights: list[Vector] = field(default_factory=list)
    misfits: list[float] = field(default_factory=list)
    without: list[tuple[int, ...]] = field(default_factory=list)
    TABLES = "told"

    def take(self, judged: Window, console: Console) -> None:
        """Keep what a window says, and print an alarm or a finding."""
        for k in sorted({*judged.without} ^ {*chain(*self.without[-1:])}):
            what = "repeats one reading, or has none: that is left out" if k in judged.without else "moves again"
            console.print(f"t = {judged.time:.4f} s: sensor {k} {what}", highlight=False)
        self.without.append(judged.without)
        self.misfits.append(judged.misfit)
        self.times.append(judged.time)
        self.scores.append(judged.evidence)
        self.sights.append(judged.sees)
        if judged.alarm:
            self.alarms.append(judged.time)
            text = f"t = {judged.time:.4f} s: ALARM, new damage is {judged.statistic:.3g} times as evident as an alarm takes"
            console.print(text, style="bold red", highlight=False)
        if (found := judged.finding) is None:
            return
        before = self.findings[-1].damage if self.findings else 0.0
        (self.findings if found.valid else self.withheld).append(found)
        if found.valid and not (found.damage > before).any():
            text = f"The alarm at t = {self.alarms[-1]:.4f} s is taken back: one window later no zone has more damage."
            console.print(text, highlight=False)
        elif found.valid:
            print_tables(console, [_table(found)])
        else:
            text = f"No damage explains the readings: chi2 per sample stays {found.chi2_per_sample:.3g}. Zones are withheld."
            console.print(text, style="bold yellow", highlight=False)

    def end(self, console: Console) -> None:
        """Print a summary, and write the file."""
        from gossamer_files import write_text

        console.print(self.summary, highlight=False)
        for line in self.more():
            console.print(line, style="bold yellow", highlight=False)
        write_text(self.path, json.dumps(self.content, indent=1) + "\n")

    @property
    def alarmed(self) -> bool:
        """Whether the last window raised an alarm."""
        return self.alarms[-1:] == self.times[-1:] != []

    @property
    def explained(self) -> bool:
        """Whether the twin explains every window, and the readings after each alarm."""
        from gossamer_orchestrator.results.files import is_explained

        return is_explained(self.content)

    @property
    def sees(self) -> Vector:
        """Damage of each zone that would have been seen, shape (zones,): median over the windows [1]."""
        import numpy as np

        return np.asarray(np.median(self.sights[1:] or [np.full(len(self.zones), math.inf)], axis=0))

    @property
    def summary(self) -> str:
        """How many alarms there were."""
        return f"{counted(len(self.alarms), 'alarm')} in {len(self.misfits)} windows"

    @property
    def content(self) -> dict[str, Any]:
        """What is in the file."""
        from gossamer_files import as_json

        content: dict[str, Any] = {"zones": self.zones, "alarms": self.alarms, "findings": self.findings}
        content |= {"misfit": self.misfits, "time": self.times, "score": self.scores, "withheld": len(self.withheld)}
        content |= {"without": self.without}
        return {name: as_json(each) for name, each in (content | {"sees": self.sees, "see": self.see}).items()}

    @property
    def data(self) -> xr.Dataset:
        """``misfit``, chi2 per sample [1], over ``time`` [s], the ends of the windows; over it and ``zone`` the ``score`` of
        new damage and ``sight``, the damage that would be seen [1]; ``damage`` and ``deviation`` [1] by ``onset`` and zone.
        """  # noqa: D205
        import numpy as np
        import xarray as xr

        found, ratio, seconds = self.findings, {"units": "1"}, {"units": "s"}
        values: dict[str, Any] = {"misfit": ("time", self.misfits, ratio)}
        for name, rows in (("score", self.scores), ("sight", self.sights)):
            values[name] = (("time", "zone"), np.array(rows).reshape(-1, len(self.zones)), ratio)
        for name in ("damage", "deviation"):
            table = np.array([getattr(each, name) for each in found]).reshape(len(found), len(self.zones))
            values[name] = (("onset", "zone"), table, ratio)
        values["onset_deviation"] = ("onset", [each.onset_deviation for each in found], seconds)
        ends = {"time": ("time", self.times, seconds), "onset": ("onset", [each.onset for each in found], seconds)}
        return xr.Dataset(values, zone_coordinates(self.zones) | ends)

    def exit_code(self) -> int:
        """Return the exit code."""
        return 0 if self.explained and self.sees.max() <= self.see else INVALID

    @property
    def sentence(self) -> str:
        """How many alarms there were, and when."""
        times = ", ".join(f"{time:.4g} s" for time in self.alarms)
        return f"{self.summary}{': at ' * bool(times)}{times}."

    def more(self) -> list[str]:
        """Return which damage is seen, and a reason for doubt, if the twin does not explain the readings."""
        from gossamer_orchestrator.results.files import unexplained
        from gossamer_orchestrator.results.verdict import sight

        lost, where, worst = unexplained(self.content), "what followed an alarm", 0.0
        if self.withheld:
            worst = self.withheld[-1].chi2_per_sample
        elif lost:
            last = max(lost, key=lambda k: self.misfits[k])
            where, worst = f"{len(lost)} of {counted(len(self.times), 'window')}", self.misfits[last]
            where += f",{' worst' * (len(lost) > 1)} the one that ended at t = {self.times[last]:.4g} s"
        doubt = (
            f"The twin does not explain {where}: chi2 per sample is {worst:.3g}. Check load, "
            "damping, sensors and noise. Where there may be damage from the beginning, use 'gossamer twin'."
        )
        return [*sight(self.content), *[doubt] * (not self.explained)]

    def hints(self) -> list[str]:
        """Return which page shows it."""
        from gossamer_orchestrator.pages import PAGE
        from gossamer_orchestrator.results.files import NETCDF, WATCH

        folder = self.path.parent
        shown = self.path.name == WATCH and (folder / PAGE).is_file() and (folder / NETCDF).is_file()
        return [f"The page of the run shows it: type 'gossamer view {typed(folder)}'."] if shown else []

    def picture(self) -> bytes | None:
        """Draw the damage of the zones since the last onset."""
        from .pages.twin import damage_chart

        last = self.findings[-1:]
        return as_png(damage_chart(self.zones, last[0].damage, last[0].deviation)) if last else None

    def tables(self) -> list[TableText]:
        """Return what was found at each onset."""
        return [_table(finding) for finding in self.findings]

    def to_json(self) -> dict[str, Any]:
        """Return what was seen."""
        return {"file": self.path, **self.content, "units": UNITS}


def _table(finding: DamageOnset) -> TableText:
    """Return a table of the damaged zones."""
    from gossamer_orchestrator.results.judgements import onset_table

    damage, deviation = finding.damage.tolist(), finding.deviation.tolist()
    return onset_table(finding.onset, finding.onset_deviation, damage, deviation, finding.zones)


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
                self._seen = Watching(files=[self._out], zones=self._twin.zones)
                simulation.say("")
            if found.record.samples < samples:
                return
            if self._seen.alarmed:
                simulation.say(FITTING)
            self._seen.take(self._twin.advance(*next(_windows([found], samples))), self._console)
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
    readings better; one window after an alarm it fits the onset and the damages. In the end it says which damage it would
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
        JSON file to write; watch.json beside the record by default.
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

    source = Path(record)
    live = source.exists() and not (source.is_file() or source.is_dir())  # a pipe
    path = Path(out or (WATCH if live else beside(source, WATCH)))
    keep_inputs([file_of(source), options["sensor"]], [path])
    require(0.0 < see < 1.0, f"{option('see')} is {see:g}. Write a damage between 0 and 1, for instance 0.1.")
    parts = find_arriving(source, options) if live else iter([find_record(source, options)])
    found = next(parts)
    samples = _samples(_period(found.structure, found.parameters) if window is None else window, found)
    many = None if live else found.record.samples // samples
    if many is not None and many < 2:
        msg = f"the record has {found.record.samples} samples, less than two windows of {samples}. Record longer."
        raise OrchestratorError(msg)
    console, rest = talk(), 0
    with progress_bar("watching") as bar:
        bar.update(aside="compiling")
        twin = _begin(found, false_alarms, options["sensor"])
        seen = Watching(files=[path], zones=twin.zones, see=see)
        try:
            for done, (readings, loads) in enumerate(_windows(chain([found], parts), samples)):
                rest = readings.shape[1]
                if rest == samples:
                    text = f"{done} of {many} windows," if many else f"{done} windows,"
                    bar.update(done if many else None, many, text, FITTING if seen.alarmed else "")
                    seen.take(twin.advance(readings, loads), console)
        finally:  # what arrives may make no sense: nothing that was seen before is lost
            if seen.times:
                bar.update(many, text=f"{len(seen.times)} windows,")
                if rest % samples:
                    console.print(f"The last {counted(rest, 'sample')}, too few for a window: not judged.", highlight=False)
                seen.end(console)
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
    return Watch(noise, **known, step=found.record.step, false_alarms=false_alarms)
