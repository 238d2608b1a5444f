"""Charts of a watch over time: evidence of each zone, what is left of each sensor, what would be seen, and the loads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gossamer_files.charts import Array, Chart, Trace, band, curve, rule

from ...pages import table
from ..dataset import zone_label
from ..judgements import onset_table
from ..readers import over_time

MOST_MARKERS = 300  # more would be a line, and slow
COLORED = 6  # zones
EXPLAINED = "One is noise alone; chi2 per sample is the mean square of all sensors together."


def watch_charts(watch: Mapping[str, Any]) -> list[Chart]:
    """Draw the content of ``watch.json``; nothing where no window was judged."""
    if not watch.get("time") or not {"score", "sight", "left", "misfit", "loads"} <= set(watch):
        return []
    time = np.array(watch["time"])
    scores, sights, left = (np.array(watch[name], dtype=float) for name in ("score", "sight", "left"))
    misfit = np.array(watch["misfit"], dtype=float)
    scores[scores == 0.0] = np.nan  # nothing was judged
    shown = np.argsort(-np.nan_to_num(scores).max(axis=0), kind="stable")[:COLORED].tolist()
    labels = [zone_label(name) for name in watch["zones"]]
    marks, log = alarm_rules(watch), {"yaxis": {"type": "log"}}
    traces = [marked(f"zone {labels[z]}", time, scores[:, z], f"@{i}") for i, z in enumerate(shown)]
    note = "At the end of each window: score of new damage in the zones that have the largest. Above 1 is an alarm."
    limit = rule(y=1.0, color="@alarm", dash="dash")
    charts = [over_time("Evidence of new damage", "[1]", traces, note=note, marks=[*marks, limit], layout=log)]
    traces = [marked(f"sensor {k + 1}", time, left[:, k], f"@{k % COLORED}") for k in range(left.shape[1])]
    traces.append(marked("chi2 per sample", time, misfit, "@ink"))
    note = f"Root mean square of what the twin, without new damage, leaves of each sensor, over its noise. {EXPLAINED}"
    charts.append(over_time("What the twin leaves unexplained", "[1]", traces, note=note, marks=marks, layout=log))
    sights[np.isnan(sights)] = np.inf  # nothing is seen
    worst = int(np.argmax(np.median(sights[1:], axis=0))) if len(sights) > 1 else 0
    seen = {f"zone {labels[worst]}, the worst": (sights[:, worst], "@1"), "best zone": (sights.min(axis=1), "@0")}
    traces = [marked(name, time, np.where(np.isfinite(y), 100.0 * y, np.nan), color) for name, (y, color) in seen.items()]
    note = "Damage that would raise an alarm in nine of ten cases. The dashed line is what has to be seen."
    marks_seen = [*marks, rule(y=100.0 * watch["see"], color="@grey", dash="dash")]
    charts.append(over_time("Damage that is seen", "damage [%]", traces, note=note, marks=marks_seen, layout=log))
    for name, rows in watch["loads"].items():
        low, high = np.array(rows).T
        traces = [*band("smallest to largest", time, low, high), curve("middle", time, (low + high) / 2.0)]
        note = "Of each window."
        charts.append(over_time(name, f"[{watch['load_units'][name]}]", traces, note=note, marks=marks))
    return charts


def alarm_rules(watch: Mapping[str, Any]) -> list[Trace]:
    """Return lines at the alarms of a watch."""
    return [rule(x=alarm, color="@alarm", dash="dashdot", width=2) for alarm in watch.get("alarms", [])]


def marked(name: str, x: Array, y: Array, color: str = "@0") -> Trace:
    """Return a curve with marks, if there are not too many."""
    return curve(name, x, y, color) | {"mode": "lines" + "+markers" * (len(x) <= MOST_MARKERS), "cliponaxis": False}


def watch_tables(watch: Mapping[str, Any]) -> str:
    """Return a table of the damages that began while the twin watched, for each onset."""
    found = [
        onset_table(each["onset"], each["onset_deviation"], each["damage"], each["deviation"], each.get("zones", ()))
        for each in watch.get("findings", [])
    ]
    return "\n".join(table(each.head, each.rows, f"{each.caption}, by the digital twin") for each in found)
