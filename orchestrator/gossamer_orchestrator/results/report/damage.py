"""Charts of damage: what the detector judged, over zones and over time, beside the truth where it is recorded.

Only a valid judgement calls a zone damaged, and has the colours of damage. Damage is in %, ``T`` judgements of ``Z`` zones.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np
from gossamer_files.charts import Array, Chart, Stages, Trace, band, bars, curve, heat, points, rule, words
from gossamer_files.plots import Panels

from ...errors import ResultsError
from ..dataset import find, find_all, need, parameters_of, zone_labels
from ..judgements import LARGEST_MISFIT, LEAST_SIMILARITY, MOST_WINDOWS, changes, doubts, judge, true_damage
from ..readers import Recorded, over_time
from .watch import COLORED, MOST_MARKERS, alarm_rules, marked, watch_charts

SUSPECT = 3.0  # [%] a zone that is judged so much damaged has a colour
CERTAIN, UNCERTAIN = 0.05, 5.0  # [%] damage that counts as found, of a detector that states its deviation or not


class DamageHistory:
    """Damage of a run: judgements and the truth, which hold from their times on.

    Attributes
    ----------
    time : ndarray, shape (T,)
        Ends of the windows [s].
    begin : ndarray, shape (T,)
        Where the stretch of each begins [s]; none reaches over the end of the one before.
    estimated, deviation : ndarray, shape (T, Z)
        Estimates and their standard deviations [%].
    valid : ndarray of bool, shape (T,)
        Which are valid judgements.
    true_time : ndarray, shape (K,)
        When the true damage changed [s]; empty if it was not recorded.
    true : ndarray, shape (K, Z)
        True damage from then on [%].
    labels : list of str
        What stands for each zone after the word "zone": its name or its number.
    """

    def __init__(self, run: Recorded) -> None:
        self.run, ended, data = run, run.ended, run.data
        self.time = np.array([window.time for window in ended])
        self.valid = np.array([window.valid for window in ended], dtype=bool)
        name, self.true_time, self.true = true_damage(data), np.zeros(0), np.zeros((0, 0))
        if name:
            run.drawn.add(name)
            rows = np.concatenate([[0], changes(data[[name]])])[:MOST_WINDOWS]
            self.true_time = run.time[rows]
            self.true = 100.0 * data[name].isel(time=rows).to_numpy().reshape(len(rows), -1)
        zones = self.true.shape[1]
        self.estimated = 100.0 * np.array([window.estimated for window in ended]).reshape(len(ended), -1 if ended else zones)
        self.deviation = 100.0 * np.array([window.deviation for window in ended]).reshape(self.estimated.shape)
        self.zones = self.estimated.shape[1]
        self.labels = zone_labels(data, self.zones)
        self.top = max(50.0, *(float(each.max(initial=0.0)) for each in (self.estimated, self.true)))

    @cached_property
    def begin(self) -> Array:
        """Where the stretch of each judgement begins [s]."""
        before = np.concatenate([[self.run.time[0]], self.time[:-1]])
        length = parameters_of(self.run.data, find_all(self.run.data, "detector")[0]).get("window_length", math.nan)
        length = float(np.diff(self.time).min()) if math.isnan(length) and self.time.size > 1 else length
        return before if math.isnan(length) else np.maximum(before, self.time - length)

    @property
    def sure(self) -> bool:
        """Whether the detector states deviations."""
        return bool(self.time.size and np.isfinite(self.deviation[-1]).any())

    @property
    def least(self) -> float:
        """Damage that counts as found [%]."""
        return CERTAIN if self.sure else UNCERTAIN

    @property
    def side(self) -> int:
        """Zones along the side of a square of them, 0 if they are none."""
        side = math.isqrt(self.zones)
        return side if side**2 == self.zones and (self.run.heights is not None or self.run.history is None) else 0

    @property
    def is_known(self) -> bool:
        """Whether there is anything to draw."""
        return bool(self.time.size) or bool((self.true > 0.0).any())

    def steps(self) -> list[tuple[float, int, int]]:
        """Return those of the slider's instants that change something, with the judgement and the truth then, or -1."""
        found: list[tuple[float, int, int]] = []
        times = self.run.time[self.run.instants[0]]
        judgements, truths = (np.searchsorted(each, times + 1e-12, side="right") - 1 for each in (self.time, self.true_time))
        for time, judged, known in zip(times.tolist(), judgements.tolist(), truths.tolist(), strict=True):
            if not found or found[-1][1:] != (judged, known):
                found.append((time, judged, known))
        return found


def zone_charts(judged: DamageHistory, steps: list[tuple[float, int, int]]) -> list[Chart]:
    """Draw the damage of each zone at some times as a map, if they are a square, and as bars."""
    if not judged.is_known:
        return []
    time = np.array([each[0] for each in steps])
    charts = []
    if judged.side:
        charts.append(_map(judged, Stages(time, [_cells(judged, *each[1:]) for each in steps])))
    charts.append(_bars(judged, Stages(time, [_zone_bars(judged, *each[1:]) for each in steps])))
    return charts


def _cells(judged: DamageHistory, k: int, known: int) -> list[Trace]:
    """Return the zones as cells: number, estimate with deviation or bounds alone, and the true damage if there is some."""
    side, valid = judged.side, k < 0 or bool(judged.valid[k])
    true = judged.true[known] if known >= 0 else None
    values = judged.estimated[k] if k >= 0 else true if not judged.time.size else None
    texts = []
    for z in range(judged.zones):
        parts = [f"<i>{z + 1}</i>"]
        if k >= 0 and not judged.run.ended[k].determined[z]:
            parts += [judged.run.ended[k].bounds(z)]
        else:
            parts += ["–" if values is None else f"<b>{values[z]:.1f}</b>"]
            parts += [f"± {judged.deviation[k, z]:.1f}"] if k >= 0 and np.isfinite(judged.deviation[k, z]) else []
        parts += [f"true {true[z]:.0f}"] if true is not None and judged.time.size and true[z] > 0.0 else []
        texts.append("<br>".join(parts))
    shown = np.zeros(judged.zones) if values is None else values
    places, (column, row) = np.arange(1, side + 1), np.indices((side, side)).reshape(2, -1)[::-1] + 1
    cells = heat(places, places, shown.reshape(side, side), "%", zmin=0.0, zmax=judged.top, xgap=2, ygap=2, hoverinfo="skip")
    inks = [f"@over/{value / judged.top:.3f}" if valid else "@ink" for value in shown]
    not_valid = [_not_valid(side / 2.0 + 0.5, side + 0.7)] if not valid else []
    return [cells | {"colorscale": "@damage" if valid else "@unsure"}, words(column, row, texts, inks), *not_valid]


def _not_valid(x: float, y: float) -> Trace:
    return words([x], [y], ["<b>not valid</b>"], "@alarm", font={"size": 15})


def _map(judged: DamageHistory, steps: Stages) -> Chart:
    ends = [0.5, judged.side + (0.5 if judged.valid.all() else 0.9)]
    bare = {"showgrid": False, "zeroline": False, "showticklabels": False, "ticks": "", "constrain": "domain"}
    axes = {"xaxis": bare | {"range": [0.5, judged.side + 0.5]}, "yaxis": bare | {"range": ends, "scaleanchor": "x"}}
    if judged.time.size:
        beside = ", and the true damage where there is some" if judged.true.size else "; the true damage is not recorded"
        grey = "" if judged.valid.all() else " A judgement that is not valid is grey."
        rough = " (bounds alone, where the deviation is above 2)" * judged.sure
        title, note = "Damage of the zones [%]", f"Zone number, estimate, standard deviation{rough}{beside}.{grey}"
    else:
        title, note = "True damage of the zones [%]", "Zone number and damage."
    text = "Map of the damage of every zone; the table of damage in numbers holds the last judgement."
    layout = axes | {"dragmode": False, "showlegend": False}
    return Chart(title, "x →", "y →", note=note, text=text, layout=layout, steps=steps, tall=True)


def _zone_bars(judged: DamageHistory, k: int, known: int) -> list[Trace]:
    """Return the zones as bars with two standard deviations, and diamonds at the true damage."""
    zones, none, valid = np.arange(1, judged.zones + 1), np.full(judged.zones, np.nan), k < 0 or bool(judged.valid[k])
    traces = []
    if judged.time.size:
        bar = bars("estimated", zones, judged.estimated[k] if k >= 0 else none, "@0" if valid else "@grey")
        reach = 2.0 * judged.deviation[k] if k >= 0 and valid and judged.sure else np.zeros(judged.zones)
        traces.append(bar | {"error_y": {"array": reach, "color": "@ink", "thickness": 1.5, "width": 4}})
    if judged.true_time.size:
        true = judged.true[known] if known >= 0 else none
        traces.append(points("true", zones, true, "@1", symbol="diamond-open", size=11, line={"width": 2}))
    return traces if valid else [*traces, _not_valid(0.85 * judged.zones, 1.08 * judged.top)]


def _bars(judged: DamageHistory, steps: Stages) -> Chart:
    sure = " with two standard deviations" * judged.sure
    text = f"Bars: estimated damage of each zone{sure} to each side; diamonds: true damage." if judged.time.size else ""
    zones = {"range": [0.4, judged.zones + 0.6], "tick0": 1} | ({"dtick": 1} if judged.zones <= 40 else {})
    if judged.labels[:1] != ["1"]:
        zones |= {"tickvals": list(range(1, judged.zones + 1)), "ticktext": judged.labels, "tickangle": -45}
    layout = {"xaxis": zones, "yaxis": {"range": [-0.06 * judged.top, 1.15 * judged.top]}}
    title, square = f"{'Damage' if judged.time.size else 'True damage'} of each zone{sure}", bool(judged.side)
    return Chart(title, "zone", "damage [%]", text=text, layout=layout, steps=steps, tall=square, broad=not square)


def history_charts(judged: DamageHistory) -> list[Chart]:
    """Draw the damage of the zones over time: those that matter in colour, the others as their largest in grey."""
    if not judged.is_known:
        return []
    real = list(np.flatnonzero((judged.true > 0.0).any(axis=0)))
    most = np.where(judged.valid[:, None], judged.estimated, 0.0).max(axis=0, initial=0.0)
    suspects = [z for z in np.argsort(-most, kind="stable") if z not in real and most[z] >= max(SUSPECT, judged.least)]
    shown, end = [*real, *suspects][:COLORED], float(judged.run.time[-1])
    traces = _judgements(judged, shown) if judged.time.size else []
    for i, z in enumerate(shown):
        if z in real:
            time, true = np.append(judged.true_time, end), np.append(judged.true[:, z], judged.true[-1, z])
            traces.append(curve(f"zone {judged.labels[z]}, true", time, true, f"@{i}", shape="hv", width=1.6, dash="dash"))
    watch, unsure = judged.run.watch, not judged.valid.all()
    alarms, found = watch.get("alarms", []), watch.get("findings", [])
    if found:
        reach = {"array": [2.0 * each["onset_deviation"] for each in found], "color": "@alarm"}
        onsets, bottom = [each["onset"] for each in found], np.zeros(len(found))
        traces.append(points("onset, twin", onsets, bottom, "@alarm", symbol="diamond", size=11) | {"error_x": reach})
    if alarms:
        traces.append(curve("alarm, twin", [np.nan], [np.nan], "@alarm", width=2, dash="dashdot"))
    note = [
        "A line spans the window that it judges; a dot marks its end, a cross that of one that is not valid."
        * (0 < len(judged.time) <= MOST_MARKERS),
        "Bands are two standard deviations wide to each side, but not below 0." * judged.sure,
        "What is not valid has no band and no colour: the grey line is then the largest of all zones." * unsure,
        "A line marks each alarm of the digital twin, a diamond the onset that it found." * bool(alarms),
    ]
    text = "Estimated damage of the zones over time, true damage dashed, with alarms and onsets." * bool(judged.time.size)
    layout = {"yaxis": {"rangemode": "tozero"}}
    more = {"note": " ".join(filter(None, note)), "text": text, "layout": layout, "marks": alarm_rules(watch), "broad": True}
    return [over_time("Damage over time", "damage [%]", traces, **more)]


def _judgements(judged: DamageHistory, shown: list[int]) -> list[Trace]:
    """Return the judgements over their windows, with bands, and marks at the ends."""
    rest = [z for z in range(judged.zones) if z not in shown]
    x = np.stack([judged.begin, judged.begin, judged.time, judged.time], axis=1).ravel()
    between, traces = np.array([np.nan, 1.0, 1.0, np.nan]), []

    def over_windows(values: Array, gap: float = math.nan) -> Array:
        return np.asarray(np.where(np.isnan(between), gap, values[:, None])).ravel()

    if rest or not judged.valid.all():
        others = judged.estimated[:, rest].max(axis=1) if rest else np.zeros(len(judged.time))
        largest = np.where(judged.valid, others, judged.estimated.max(axis=1))
        traces.append(curve("largest of the others", x, over_windows(largest), "@grey", width=1) | {"hoverinfo": "skip"})
    for i, z in enumerate(shown if judged.valid.any() else []):
        if judged.sure:
            reach = np.outer([-2.0, 2.0], np.nan_to_num(judged.deviation[:, z]))
            ends = np.where(judged.valid, np.maximum(judged.estimated[:, z] + reach, 0.0), 0.0)
            low, high = (over_windows(end, 0.0) for end in ends)
            edges = band(f"zone {judged.labels[z]} ± 2 deviations", x, low, high, f"@{i}")
            traces += [edge | {"showlegend": False} for edge in edges]
        own = np.where(judged.valid, judged.estimated[:, z], np.nan)
        traces.append(curve(f"zone {judged.labels[z]}", x, over_windows(own), f"@{i}", width=2))
    for valid, symbol, name in ((True, "circle", "judgement"), (False, "x", "not valid")):
        some = judged.valid == valid
        if 0 < some.sum() <= MOST_MARKERS:
            heights = judged.estimated[some].max(axis=1)
            traces.append(points(name, judged.time[some], heights, "@ink", symbol=symbol, size=8) | {"hoverinfo": "skip"})
    return traces


def doubt_charts(judged: DamageHistory) -> list[Chart]:
    """Draw how the detector and the twin measure whether they are to be trusted."""
    charts, ended = [], judged.run.ended
    likeness = ended[-1].likeness if ended else ""
    measures = np.array([window.likeness_value for window in ended])
    if likeness and np.isfinite(measures).any():
        limit, side, what = LEAST_SIMILARITY, "from", "1 for a record of its training, 0 for one like none"
        if likeness == "misfit":
            limit, side, what = LARGEST_MISFIT, "up to", "the distance from the records of its training"
        title = f"{likeness.capitalize()} with what the detector was trained on"
        note = f"The {likeness} is {what}; a judgement is valid {side} {limit:g}."
        charts.append(_measured(title, judged.time, measures, limit, f"{likeness} [1]", note))
    return [*charts, *watch_charts(judged.run.watch), *_indices(judged)]


def _measured(title: str, time: Array, values: Array, limit: float, y: str, note: str) -> Chart:
    limits = [rule(y=limit, color="@alarm", dash="dash")]
    layout = {"yaxis": {"rangemode": "tozero"}, "showlegend": False}
    return over_time(title, y, [marked(y.split(" [")[0], time, values)], note=note, marks=limits, layout=layout)


def _indices(judged: DamageHistory) -> list[Chart]:
    """Draw the packet energies of a detector that gives them."""
    data = judged.run.data
    name = f"{next(iter(find_all(data, 'detector')), '')}.index"
    if not judged.time.size or name not in data:
        return []
    index = data[name].isel(time=judged.run.time.first_from(judged.time)).to_numpy()
    judged.run.drawn.add(name)
    if index.ndim != 2 or not index[0].all():
        return []
    cells = heat(judged.time, np.arange(1, index.shape[1] + 1), (index / index[0]).T, "[1]", colorscale="Cividis")
    note = "One row for each index of the detector; 1 is no change."
    return [over_time("Packet energies over those of the first window", "index", [cells], note=note)]


def _damage(run: Recorded) -> Panels:
    last, judged = judge(run.data), DamageHistory(run)
    k, known = (int(np.searchsorted(each, last.time + 1e-12, side="right")) - 1 for each in (judged.time, judged.true_time))
    charts = zone_charts(judged, [(last.time, k, known)])
    first = replace(charts[0], title=f"{charts[0].title.removesuffix(' [%]')}, judged at t = {last.time:.4f} s")
    later = "" if run.ended[-1].valid else doubts(run.data, run.ended)[0]
    return Panels([replace(first, result=later), *charts[1:]], (5.5 * len(charts), 4.9), len(charts))


def _history(run: Recorded) -> Panels:
    need(run.data, f"{find(run.data, 'detector')}.damage")
    judged = DamageHistory(run)
    if len(run.ended) < 2 and len(judged.true_time) < 2:
        msg = "a single window under constant damage has no history."
        raise ResultsError(msg)
    return Panels(history_charts(judged), (9.0, 4.8))


PICTURES = {"damage": _damage, "damage_history": _history}  # files
