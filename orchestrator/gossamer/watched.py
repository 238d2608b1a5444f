"""What a watch has seen of a record or a run: alarms, findings, and the evidence of every window."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING, Any

from gossamer_orchestrator.words import counted, percent

from .results import INVALID, Saved, as_png, print_tables, typed, zone_coordinates

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_files.tables import TableText
    from gossamer_models.arrays import Vector
    from gossamer_models.twin import DamageOnset, Window
    from rich.console import Console

SEE = 0.1  # [1]
UNITS = {
    "alarms": "s",
    "agreed": "s",
    "onset": "s",
    "onset_deviation": "s",
    "damage": "1",
    "deviation": "1",
    "misfit": "1",
    "left": "1",
    "mesh": "1",
    "sees": "1",
}


@dataclass(frozen=True, kw_only=True, repr=False)
class Watching(Saved):
    """What was seen of a record, window by window.

    Attributes
    ----------
    files : list of Path
        JSON file of what was seen, and its page.
    zones : tuple of str
        Names of the zones.
    alarms : list of float
        Ends of the windows that raised an alarm [s].
    findings, withheld : list of gossamer_models.twin.DamageOnset
        Onset and damages, of each damage that began; apart those that do not explain the readings.
    agreed : list of float
        Ends of the windows in which each finding was first made [s].
    faults : list of dict
        Sensors that an alarm came from: ``sensor``, from 1, ``alarm`` and ``time`` [s] when it was left out.
    times, misfits, meshes : list of float
        End of each window [s], chi2 per sample [1], and what finer elements add, over the change of the readings [1].
    scores, sights : list of ndarray, shape (zones,)
        Of each window: score of new damage in each zone, over what raises an alarm [1], and the damage that would [1].
    left : list of ndarray, shape (sensors,)
        Of each window: root mean square of what is left of each sensor, over its noise [1].
    loads : dict
        Smallest and largest value of each load in each window, by name.
    load_units : dict
        Their units.
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
    meshes: list[float] = field(default_factory=list)
    agreed: list[float] = field(default_factory=list)
    faults: list[dict[str, float]] = field(default_factory=list)
    left: list[Vector] = field(default_factory=list)
    loads: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    load_units: dict[str, str] = field(default_factory=dict)
    without: list[tuple[int, ...]] = field(default_factory=list)
    TABLES = "told"

    def take(self, judged: Window, loads: Mapping[str, Vector], console: Console) -> None:
        """Keep what a window says, and print an alarm or a finding."""
        for k in sorted(({*judged.without} ^ {*chain(*self.without[-1:])}) - {*judged.blamed}):
            what = "repeats one reading, or has none: that is left out" if k in judged.without else "moves again"
            console.print(f"t = {judged.time:.4f} s: sensor {k} {what}", highlight=False)
        self.without.append(judged.without)
        self.misfits.append(judged.misfit)
        self.meshes.append(judged.mesh)
        self.times.append(judged.time)
        self.scores.append(judged.evidence)
        self.sights.append(judged.sees)
        self.left.append(judged.left)
        for name, load in loads.items():
            self.loads.setdefault(name, []).append((float(load.min()), float(load.max())))
        if judged.alarm:
            self.alarms.append(judged.time)
            text = f"t = {judged.time:.4f} s: ALARM, new damage is {judged.statistic:.3g} times as evident as an alarm takes"
            console.print(text, style="bold red", highlight=False)
        elif judged.blamed:
            self._blame(judged, console)
        elif judged.finding is not None:
            self._find(judged.finding, judged.time, console)

    def _find(self, found: DamageOnset, time: float, console: Console) -> None:
        """Keep a finding in place of one that did not explain the readings after the same alarm, and print it."""
        del self.withheld[len(self.alarms) - 1 - len(self.findings) :]
        before = self.findings[-1].damage if self.findings else 0.0
        (self.findings if found.valid else self.withheld).append(found)
        if not found.valid:
            why = f"No damage explains the readings: chi2 per sample stays {found.chi2_per_sample:.3g}."
            if found.explains:
                why = f"Where damage is cannot be said: {_coarse(found.mesh)}."
            console.print(f"{why} Zones are withheld.", style="bold yellow", highlight=False)
            return
        self.agreed.append(time)
        if (found.damage > before).any():
            print_tables(console, [_table(found)])
        else:
            text = f"The alarm at t = {self.alarms[-1]:.4f} s is taken back: by t = {time:.4f} s no zone has more damage."
            console.print(text, highlight=False)

    def _blame(self, judged: Window, console: Console) -> None:
        """Keep which sensor an alarm came from, and print it."""
        del self.withheld[len(self.alarms) - 1 - len(self.findings) :]
        alarm = self.alarms.pop()
        self.faults.extend({"sensor": k, "alarm": alarm, "time": judged.time} for k in judged.blamed)
        which = " and ".join(map(str, judged.blamed))
        text = f"The alarm at t = {alarm:.4f} s is taken back: no damage explains what sensor {which} reads, and the others"
        console.print(f"{text} show none. From now on it is left out.", style="bold yellow", highlight=False)

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
        content |= {"without": self.without, "sight": self.sights, "left": self.left, "mesh": self.meshes}
        content |= {"agreed": self.agreed, "faults": self.faults, "loads": self.loads, "load_units": self.load_units}
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
        coarse = [finding for finding in self.withheld if finding.explains]
        if len(self.withheld) > len(coarse):
            worst = self.withheld[-1].chi2_per_sample
        elif lost:
            last = max(lost, key=lambda k: self.misfits[k])
            where, worst = f"{len(lost)} of {counted(len(self.times), 'window')}", self.misfits[last]
            where += f",{' worst' * (len(lost) > 1)} the one that ended at t = {self.times[last]:.4g} s"
        doubt = (
            f"The twin does not explain {where}: chi2 per sample is {worst:.3g}. Check load, "
            "damping, sensors and noise. Where there may be damage from the beginning, use 'gossamer twin'."
        )
        doubts = [f"Zones were withheld after an alarm: {_coarse(coarse[-1].mesh)}. Mesh more finely."] if coarse else []
        return [*sight(self.content), *doubts, *[doubt] * bool(worst)]

    def hints(self) -> list[str]:
        """Return which page shows it."""
        from gossamer_orchestrator.pages import PAGE
        from gossamer_orchestrator.results.files import NETCDF, WATCH

        folder = self.path.parent
        of_run = self.path.name == WATCH and (folder / PAGE).is_file() and (folder / NETCDF).is_file()
        page = folder if of_run else self.path.with_suffix("")
        return [f"The page shows it: type 'gossamer view {typed(page)}'."] if (page / PAGE).is_file() else []

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


def _coarse(mesh: float) -> str:
    return f"finer elements add {percent(mesh)} of the change of the readings, and damage acts otherwise there"
