"""``gossamer watch``: the twin beside a record, window by window, until damage begins."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from gossamer_files import replacing
from rich.console import Console

from ..errors import OrchestratorError
from ..results.files import WATCH
from .command import INVALID, Result, is_quiet, note, show, stderr
from .common import keep_inputs, model_errors, typed
from .twin_options import (
    ElementsOption,
    KindOption,
    NoiseOption,
    OrderOption,
    RecordArgument,
    SensorOption,
    ValuesOption,
    beside,
    file_of,
)

if TYPE_CHECKING:
    from gossamer_models.twin import DamageOnset, Watch, Window
    from rich.table import Table

    from ..run.master import Simulation
    from .twin_record import Found

LEAST_WINDOW = 20  # samples
ROUNDING = 1e-9
LARGE = 2.0  # chi2 per sample of a window that the twin does not explain
FALSE_ALARMS = 1e-5
FITTING = "fitting onset and damage"
UNITS = {"alarms": "s", "onset": "s", "onset_deviation": "s", "damage": "1", "deviation": "1", "misfit": "1"}


def watch(
    record: RecordArgument,
    window: Annotated[float, typer.Option(help="Length of a window [s].")] = 0.05,
    kind: KindOption = None,
    noise: NoiseOption = None,
    false_alarms: Annotated[
        float, typer.Option(help="Share of the windows that may raise a false alarm.")
    ] = FALSE_ALARMS,
    values: ValuesOption = None,
    sensor: SensorOption = None,
    elements_per_side: ElementsOption = 4,
    order: OrderOption = 4,
    out: Annotated[
        Path | None, typer.Option(help="JSON file to write; watch.json beside the record by default.", metavar="FILE")
    ] = None,
) -> Result:
    """Watch a record as if it arrived live: raise an alarm when damage begins, then say when and where.

    The record begins, undamaged, when the load sets in. After each window the running twin tests whether damage explains the
    readings better; one window after an alarm it fits the onset and the damages.

    For example:

        gossamer run damage_begins && gossamer watch out/damage_begins
    """
    from ..pages import PAGE
    from ..results.files import NETCDF

    report, path = watch_given(
        record,
        window=window,
        kind=kind,
        noise=noise,
        false_alarms=false_alarms,
        values=values,
        sensor=sensor,
        elements_per_side=elements_per_side,
        order=order,
        out=out,
        console=stderr(),
    )
    show(path)
    if out is None and (path.parent / PAGE).is_file() and (path.parent / NETCDF).is_file():
        note(f"The page of the run shows it: type 'gossamer view {typed(path.parent)}'.")
    return Result({"file": path, **report.content, "units": UNITS}, 0 if report.explained else INVALID)


def watch_given(
    record: Path,
    *,
    window: float,
    kind: str | None,
    noise: float | None,
    false_alarms: float,
    values: list[str] | None,
    sensor: Path | None,
    elements_per_side: int,
    order: int,
    out: Path | None,
    console: Console,
) -> tuple[WatchReport, Path]:
    """Watch a record with the options of the command; return what was seen and the file it was written to.

    What is seen is printed on the console as it is seen.
    """
    from ..run.progress import ProgressBar
    from .twin_record import find_record

    path = beside(record, WATCH) if out is None else out
    keep_inputs([file_of(record), sensor], [path])
    with model_errors():
        found = find_record(record, kind, noise, None, values or [])
        samples = _samples(window, found)
        if 2 * samples > found.record.samples:
            msg = f"the record has {found.record.samples} samples, less than two windows of {samples}. Record longer."
            raise OrchestratorError(msg)
        report, firsts = WatchReport(console), range(0, found.record.samples - samples + 1, samples)
        with ProgressBar("watching", stderr()) as bar:
            bar.update(aside="compiling")
            watching = _begin(found, sensor, elements_per_side, order, false_alarms)
            for done, first in enumerate(firsts):
                bar.update(done, len(firsts), f"{done} of {len(firsts)} windows,", FITTING if report.alarmed else "")
                report.take(watching.advance(found.record.values[:, first : first + samples]))
            bar.update(len(firsts), text=f"{len(firsts)} windows,")
    return report, report.end(path)


class LiveWatch:
    """Observer of a run that watches it while it goes on, in the process of the run.

    Parameters
    ----------
    out : Path
        JSON file to write.
    window : float
        Length of a window [s].
    """

    def __init__(self, out: Path, window: float = 0.05) -> None:
        self._out, self._window, self._quiet = out, window, is_quiet()
        self._watching: Watch | None = None
        self._report: WatchReport | None = None
        self._due = window * (1.0 - ROUNDING)  # [s] after the start
        self._forgotten = 0.0  # [s] until where windows are judged; a record counts its time from there

    def begin(self, simulation: Simulation) -> None:
        """Record what the scenario records."""
        from ..run.recorder import Recorder

        self._out.unlink(missing_ok=True)  # of an earlier run
        self._recorder = Recorder(simulation.plan)
        self._recorder.begin(simulation)
        self._report = WatchReport(Console(stderr=True, quiet=self._quiet))

    def sample(self, simulation: Simulation) -> None:
        """Judge a window when it is complete, and forget it."""
        self._recorder.sample(simulation)
        if simulation.time - simulation.scenario.start < self._due:
            return
        report = self._report
        assert report is not None
        from ..results.dataset import make_dataset
        from .twin_record import find_in_results

        with model_errors():
            time = self._recorder.time
            data = make_dataset(
                simulation.plan, time - self._forgotten, self._recorder.table, master=simulation.scenario.master
            )
            found = find_in_results(data, None, None, [])
            samples = _samples(self._window, found)
            if self._watching is None:
                simulation.say("compiling the twin (once)")
                self._watching = _begin(found, None, 4, 4, FALSE_ALARMS)
                simulation.say("")
            if found.record.samples < samples:
                return
            if report.alarmed:
                simulation.say(FITTING)
            report.take(self._watching.advance(found.record.values[:, :samples]))
            simulation.say("")
            rest = time > time[0] + (samples - 0.5) * found.record.step
            self._forgotten = float(time[rest][0])
            self._recorder.clear(keep=int(rest.sum()))
            self._due += samples * found.record.step

    def end(self, simulation: Simulation) -> None:  # noqa: ARG002
        """Write what was found."""
        if self._report is not None and self._report.misfits:
            self._report.end(self._out)


class WatchReport:
    """Print what the windows say, and keep it.

    Attributes
    ----------
    alarmed : bool
        Whether the last window raised an alarm.
    alarms : list of float
        Ends of the windows that raised an alarm [s].
    findings : list of gossamer_models.twin.DamageOnset
        Damages that began.
    times, scores, misfits : list of float
        End of each window [s], the score of new damage in units of its mean [1], and chi2 per sample [1].
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self.alarmed = False
        self.alarms: list[float] = []
        self.findings: list[DamageOnset] = []
        self.misfits: list[float] = []
        self.times: list[float] = []
        self.scores: list[float] = []

    def take(self, judged: Window) -> None:
        """Print an alarm or a finding."""
        self.misfits.append(judged.misfit)
        self.times.append(judged.time)
        self.scores.append(judged.statistic)
        self.alarmed = judged.alarm
        if judged.alarm:
            self.alarms.append(judged.time)
            text = f"t = {judged.time:.4f} s: ALARM, the score of new damage is {judged.statistic:.3g} times its mean"
            self._console.print(text, style="bold red", highlight=False)
        if judged.finding is not None:
            self.findings.append(judged.finding)
            self._console.print(finding_table(judged.finding))

    def end(self, path: Path) -> Path:
        """Print a summary, write the file and return its path."""
        self._console.print(self.summary, highlight=False)
        if self.doubt:
            self._console.print(self.doubt, style="bold yellow", highlight=False)
        with replacing(path) as unfinished:
            unfinished.write_text(json.dumps(self.content, indent=1) + "\n", encoding="utf-8")
        return path

    @property
    def explained(self) -> bool:
        """Whether the twin explains the last window."""
        return self.misfits[-1] <= LARGE

    @property
    def summary(self) -> str:
        """How many alarms there were."""
        alarms, windows = len(self.alarms), len(self.misfits)
        return f"{alarms} alarm{'s' * (alarms != 1)} in {windows} windows"

    @property
    def doubt(self) -> str:
        """A sentence if the twin does not explain the last window, else nothing."""
        if self.explained:
            return ""
        return (
            f"The twin does not explain the last window: chi2 per sample is {self.misfits[-1]:.3g}. Check load, "
            "damping, sensors and noise. Where there may be damage from the beginning, use 'gossamer twin'."
        )

    @property
    def content(self) -> dict[str, Any]:
        """What is in the file."""
        findings = [{name: _plain(value) for name, value in asdict(each).items()} for each in self.findings]
        content = {"alarms": self.alarms, "findings": findings, "misfit": self.misfits}
        return content | {"time": self.times, "score": self.scores}


def _samples(window: float, found: Found) -> int:
    """Count the samples of a window, and refuse too few."""
    if not math.isfinite(window):
        msg = f"--window is {window:g}. Write a positive number."
        raise OrchestratorError(msg)
    samples = round(window / found.record.step)
    if samples < LEAST_WINDOW:
        msg = f"a window of {window:g} s is {samples} samples of the record; it needs {LEAST_WINDOW} or more."
        raise OrchestratorError(msg)
    return samples


def _begin(found: Found, sensor: Path | None, elements_per_side: int, order: int, false_alarms: float) -> Watch:
    """Start the twin of a record."""
    import numpy as np
    from gossamer_models.membrane import square_structure
    from gossamer_models.twin import Watch

    from .twin_record import sensor_of

    return Watch(
        np.nan_to_num(found.record.noise_deviation(), nan=1.0),
        square_structure(elements_per_side, order, params=found.params),
        sensor=sensor_of(found, sensor),
        sensor_parameters=found.sensor_parameters,
        step=found.record.step,
        false_alarms=false_alarms,
    )


def _plain(value: Any) -> Any:  # noqa: ANN401
    return value.tolist() if hasattr(value, "tolist") else value


def finding_table(finding: DamageOnset) -> Table:
    """Return a table of the damaged zones."""
    from rich.table import Table

    from ..results.tables import damage_rows, since

    title = since(finding.onset, finding.onset_deviation)
    table = Table("zone", "damage [%]", title=title, min_width=len(title))
    for row in damage_rows(finding.damage.tolist(), finding.deviation.tolist()):
        table.add_row(*row)
    return table
