"""Judgements of the detector, beside the true damage where it was recorded, and tables of them.

A window of the detector ends when its outputs change. It gives a valid judgement if ``valid`` is 1 then. Everything is read
from recorded results, from a file as well as right after a run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from gossamer_files.tables import TableText
from numpy.typing import NDArray
from rich.table import Table

from ..errors import ResultsError
from ..words import between, uncertain
from .dataset import LIKENESS, WATCHED, find, find_all, is_whole, need, zone_label, zone_labels

_ROWS = 20_000
LEAST_SHOWN = 0.0005  # damage that is shown as 0.1 %; among zones with less, none is the most damaged
MOST_WINDOWS = 5000  # of a page
# of a valid judgement, by the interface of the detectors
LEAST_SIMILARITY, LARGEST_MISFIT = 0.5, 1.0
DETERMINED, REACH = 0.02, 2.0  # deviation of a damage that has a value, and deviations to the bounds of one that has none


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """Output of the detector at the end of a window.

    Attributes
    ----------
    time : float
        When the window ended [s].
    true, estimated : numpy.ndarray
        Damage of every zone [1], at that time; not a number if the true one was not recorded.
    deviation : numpy.ndarray
        Standard deviation of the estimate of every zone [1]; not a number if the detector states none. A zone is determined
        where it is 2 points or less.
    likeness : str
        How the detector measures whether its training holds the like: "similarity", "misfit", or "" if it was not recorded.
    likeness_value : float
        That measure [1]: similarity is 1 for a case that it was trained on, misfit is 1 at the edge of its training.
    valid : bool
        False if the detector marks its output as no judgement.
    zones : tuple of str
        Labels of the zones; empty for their numbers.
    """

    time: float
    true: NDArray[np.float64]
    estimated: NDArray[np.float64]
    deviation: NDArray[np.float64]
    likeness: str
    likeness_value: float
    valid: bool = True
    zones: tuple[str, ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """What stands for each zone after the word "zone"."""
        return self.zones or tuple(str(k + 1) for k in range(self.estimated.size))

    @property
    def determined(self) -> NDArray[np.bool_]:
        """Which zones have a value; all, if the detector states no deviation."""
        return ~(self.deviation > DETERMINED)

    def bounds(self, zone: int) -> str:
        """Say between which values [%] the damage of a zone lies, within ``REACH`` deviations."""
        ends = self.estimated[zone] + REACH * self.deviation[zone] * np.array([-1.0, 1.0])
        return between(*(100.0 * np.clip(ends, 0.0, 1.0)))

    def said(self, zone: int, sign: str = "±") -> str:
        """Say the damage of a zone [%]: estimate and deviation, with a sign between, or bounds if it is not determined."""
        if not self.determined[zone]:
            return self.bounds(zone)
        bar = f" {sign} {100.0 * self.deviation[zone]:.1f}" if np.isfinite(self.deviation[zone]) else ""
        return f"{100.0 * self.estimated[zone]:.1f}{bar}"

    @property
    def mean_absolute_error(self) -> float:
        """Mean over the zones of ``|estimated - true|`` [1]."""
        return float(np.mean(np.abs(self.estimated - self.true)))

    @property
    def worst_zone(self) -> int:
        """Zone with the largest error, counted from 1."""
        return int(np.argmax(np.abs(self.estimated - self.true))) + 1

    @property
    def largest_error(self) -> float:
        """Error of the worst zone [1], with its sign."""
        return float((self.estimated - self.true)[self.worst_zone - 1])


def windows(data: xr.Dataset) -> list[Judgement]:
    """List the judgement at the end of every window, valid or not, in order of time.

    Raises
    ------
    ResultsError
        There is no detector, or its damage was not recorded of all zones.
    """
    detector = recorded_detector(data)
    watched = [f"{detector}.{name}" for name in WATCHED if f"{detector}.{name}" in data.data_vars]
    data = data.isel(time=changes(data[watched]))
    time, estimated, valid = (data[name].to_numpy() for name in ("time", f"{detector}.damage", f"{detector}.valid"))
    likeness = next((name for name in LIKENESS if f"{detector}.{name}" in data.data_vars), "")
    true, deviation, measure = (
        data[name].to_numpy() if name in data.data_vars and data[name].shape == shape else np.full(shape, math.nan)
        for name, shape in (
            (true_damage(data), estimated.shape),
            (f"{detector}.deviation", estimated.shape),
            (f"{detector}.{likeness}", time.shape),
        )
    )
    labels = tuple(zone_labels(data, estimated.shape[-1]))
    return [
        Judgement(
            zones=labels,
            time=float(time[k]),
            true=true[k],
            estimated=estimated[k],
            deviation=deviation[k],
            likeness=likeness,
            likeness_value=float(measure[k]),
            valid=float(valid[k]) > 0.5,
        )
        for k in range(len(time))
    ]


def windows_of(data: xr.Dataset) -> list[Judgement]:
    """List the windows of the detector; none if there is no detector."""
    try:
        return windows(data)
    except ResultsError:
        return []


def recorded_detector(data: xr.Dataset) -> str:
    """Return the detector of a run, whose damage was recorded of all zones.

    Raises
    ------
    ResultsError
        There is no detector, or its damage was not recorded so.
    """
    detector = find(data, "detector")
    damage, _ = need(data, f"{detector}.damage", f"{detector}.valid")
    if not is_whole(damage):
        msg = f"the results lack {detector}.damage of some zones. Record {detector}.damage* and run the scenario again."
        raise ResultsError(msg)
    return detector


def true_damage(data: xr.Dataset) -> str:
    """Name the variable that is the true damage; empty if it was not recorded of all zones, those of the detector."""
    name = f"{next(iter(find_all(data, 'membrane')), '')}.damage"
    estimated = data.get(f"{next(iter(find_all(data, 'detector')), '')}.damage")
    if name not in data.data_vars or not is_whole(data[name]):
        return ""
    return name if estimated is None or estimated.shape == data[name].shape else ""


def changes(data: xr.Dataset) -> NDArray[np.intp]:
    """List the rows in which a value differs from that of the row before, with few rows in memory at a time.

    Values that are not a number are alike.
    """
    found = [np.zeros(0, dtype=np.intp)]
    for first in range(0, data.sizes["time"] - 1, _ROWS):
        part = data.isel(time=slice(first, first + _ROWS + 1))
        table = np.hstack([part[name].to_numpy().reshape(part.sizes["time"], -1) for name in part.data_vars])
        before, after = table[:-1], table[1:]
        differ = (before != after) & ~(np.isnan(before) & np.isnan(after))
        found.append(first + 1 + np.flatnonzero(differ.any(axis=1)))
    return np.concatenate(found)


def judge(data: xr.Dataset) -> Judgement:
    """Return the last valid judgement of a run.

    Raises
    ------
    ResultsError
        Damage was not recorded, or there is no valid judgement.
    """
    ended = windows(data)
    valid = [window for window in ended if window.valid]
    if not valid:
        raise ResultsError(_why_none(data, ended))
    return valid[-1]


def _why_none(data: xr.Dataset, ended: list[Judgement]) -> str:
    """Explain why there is no valid judgement."""
    if not ended:
        return (
            f"No window of the detector ended until t = {float(data['time'][-1]):.9g} s, so there is no judgement. "
            "Run longer than its 'start_time' and 'window_length' together."
        )
    last = ended[-1]
    many = f"{len(ended)} windows of the detector ended, the last" if len(ended) > 1 else "A window of the detector ended"
    return f"{many} at {last.time:.4f} s, but gave no valid judgement; {_why(last)}"


def _why(judgement: Judgement) -> str:
    """Say why a judgement is not valid, and what to do about it."""
    measure = judgement.likeness_value
    if judgement.likeness == "similarity" and measure < LEAST_SIMILARITY:
        why = f"its similarity with every trained case is below one half: {measure:.2g}"
        advice = "It was trained on nothing like this."
    elif judgement.likeness == "misfit" and measure > LARGEST_MISFIT:
        why = f"its misfit with what it was trained on is above one: {measure:.2g}"
        advice = "It was trained on nothing like this. Check load, sensors, noise and 'delay', unless damage began in it."
    elif judgement.likeness and math.isnan(measure):
        why, advice = f"its {judgement.likeness} is not a number", "Look for the first strain that is none."
    elif judgement.likeness:
        why = f"in spite of a {judgement.likeness} of {measure:.2g}"
        advice = "Give it the 'start_time', 'window_length' and 'sampling_step' it was trained for."
    else:
        why, advice = "its similarity or misfit was not recorded", "Record it to see why."
    return f"{why}. {advice}"


def doubts(data: xr.Dataset, ended: list[Judgement]) -> list[str]:
    """List reasons to doubt the judgements: none is valid, or some windows are not."""
    valid, invalid = ([window for window in ended if window.valid is kind] for kind in (True, False))
    sentences = []
    if not valid:
        sentences.append(_why_none(data, ended))
    elif invalid:
        last = invalid[-1]
        if len(invalid) > 1:
            what = f"{len(invalid)} windows gave no valid judgement, the last at {last.time:.4f} s"
        else:
            what = f"The window that ended at {last.time:.4f} s gave no valid judgement"
        shown = "" if ended[-1].valid else f" The judgement shown is that at {valid[-1].time:.4f} s."
        sentences.append(f"{what}; {_why(last)}{shown}")
    return sentences


def onset_table(
    onset: float, spread: float, damage: Sequence[float], deviation: Sequence[float], names: Sequence[str] = ()
) -> TableText:
    """Return the damage [%] of each zone that is damaged since an onset [s], each with its standard deviation."""
    zones = [zone_label(name) for name in names] or [str(k + 1) for k in range(len(damage))]
    rows = zip(zones, damage, deviation, strict=True)
    cells = [(zone, f"{100.0 * d:.2f} ± {100.0 * s:.2f}") for zone, d, s in rows if d > 0.0]
    return TableText(("zone", "damage ± standard deviation [%]"), cells, f"Damage since t = {uncertain(onset, spread, 's')}")


def zone_table(judgement: Judgement) -> Table:
    """Tabulate true and estimated damage as the membrane is seen: zone 1 lower left, x to the right, y up."""
    side, certain = math.isqrt(judgement.true.size), bool(np.isfinite(judgement.deviation).all())
    known = bool(np.isfinite(judgement.true).all())
    errors = (
        f"mean absolute error {100 * judgement.mean_absolute_error:.2f} %\n"
        f"largest error {100 * judgement.largest_error:+.2f} % in zone {judgement.labels[judgement.worst_zone - 1]}\n"
    )
    what = f"{'true -> ' * known}estimated{' +- its standard deviation' * certain}"
    table = Table(
        title=f"Damage at t = {judgement.time:.4f} s, {what} [%]",
        caption=(
            f"{errors if known else ''}{judgement.likeness or 'similarity'} with training {judgement.likeness_value:.2g}"
        ),
        show_header=False,
        show_lines=True,
    )
    zones = judgement.true.size
    for row in reversed(range(-(-zones // side))):
        cells = []
        for zone in range(row * side, min((row + 1) * side, zones)):
            true, estimated = 100 * judgement.true[zone], 100 * judgement.estimated[zone]
            said = judgement.said(zone, "+-")
            numbers = f"{true:.0f} -> {said}" if known else said
            cells.append(
                f"zone {judgement.labels[zone]}\n"
                + (f"[bold]{numbers}[/bold]" if true > 0.0 or estimated >= 5.0 else numbers)
            )
        table.add_row(*cells)
    return table


def window_table(ended: Sequence[Judgement], most: int | None = None) -> TableText:
    """Tabulate the windows, or the last ones: the most damaged zone, and the errors if the truth is known."""
    likeness = next((judgement.likeness for judgement in ended if judgement.likeness), "similarity")
    known = all(np.isfinite(judgement.true).all() for judgement in ended)
    compared = ("true there [%]", "mean abs. error [%]") if known else ()
    rows = []
    for judgement in ended[-(most or len(ended)) :]:
        zone = int(np.argmax(judgement.estimated))
        found = judgement.estimated[zone] >= LEAST_SHOWN
        true = f"{100 * judgement.true[zone]:.0f}" if found else "-"
        cells = [f"{judgement.time:.4f}", judgement.labels[zone] if found else "-", f"{100 * judgement.estimated[zone]:.1f}"]
        cells += [true, f"{100 * judgement.mean_absolute_error:.2f}"] * known
        rows.append((*cells, f"{judgement.likeness_value:.2g}", "yes" if judgement.valid else "no"))
    some = f", the last {len(rows)} of {len(ended)}" if len(rows) < len(ended) else ""
    head = ("t [s]", "most damaged zone", "estimated [%]", *compared, likeness, "valid")
    return TableText(head, rows, f"Windows of the detector{some}")
