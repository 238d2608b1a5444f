"""What a page says in words and tables: how the run went, what each component was given, the judgements."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...pages import folded, on_page, table, written
from ...words import counted, recorded
from ..files import MESSAGES
from ..judgements import Judgement
from ..tables import onset_table, window_table

SHOWN_WINDOWS = 60
SHOWN_MESSAGES = 40


def run_table(data: xr.Dataset, rows_recorded: int) -> str:
    """Return the table of what happened."""
    known, time = data.attrs, data["time"]
    rows = [
        ("Scenario", known.get("scenario_name", "not recorded")),
        ("Time", f"{float(time[0]):.6g} s to {float(time[-1]):.6g} s"),
        ("How it ended", known.get("ended", "not recorded")),
    ]
    if "step" in known:
        rows.append(("Step", f"{float(known['step']):.6g} s{_every(int(known.get('record_every', 1)))}"))
    scalars = sum(int(np.prod(variable.shape[1:])) for variable in data.data_vars.values())
    rows.append(("Recorded", f"{counted(rows_recorded, 'instant')} of {recorded(len(data.data_vars), scalars)}"))
    if "wall_time" in known:
        rows.append(("Wall time", f"{float(known['wall_time']):.3g} s"))
    if int(known.get("divided_steps", 0)):
        rows.append(("Divided steps", str(int(known["divided_steps"]))))
    if "master" in known:
        rows.append(("Master", str(known["master"])))
    versions = json.loads(known.get("versions", "{}"))
    if versions:
        rows.append(("Versions", ", ".join(f"{name} {number}" for name, number in versions.items())))
    if text := known.get("scenario"):
        rows.append(("SHA-256 of the scenario", hashlib.sha256(str(text).encode()).hexdigest()))
    return table((), rows, "The run")


def messages(folder: Path) -> str:
    """Return the warnings of the run, if there were any."""
    try:
        texts = (folder / MESSAGES).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return ""
    lines = "".join(f"<li>{written(text)}</li>" for text in texts[:SHOWN_MESSAGES])
    more = f"<p>All {len(texts)} are in {MESSAGES}.</p>" if len(texts) > SHOWN_MESSAGES else ""
    return f'<h3 id="messages">Messages of the run</h3><ul class="messages">{lines}</ul>{more}' if texts else ""


def _every(steps: int) -> str:
    return f"; one in {steps} is recorded" if steps > 1 else ""


def components(data: xr.Dataset) -> str:
    """Return a table of the components, and for each its parameters."""
    fmus = json.loads(data.attrs.get("fmus", "{}"))
    if not fmus:
        return "<p>The results do not say which FMUs made them.</p>"
    rows = [(name, each.get("file", ""), each.get("model", "")) for name, each in fmus.items()]
    parts = [table(("component", "file", "model"), rows, "Components")]
    for name, each in fmus.items():
        start, values, units = (each.get(what, {}) for what in ("start", "parameters", "units"))
        lines = [(v, f"{x:.9g}", units.get(v, ""), "scenario" if v in start else "FMU") for v, x in values.items()]
        lines += [(v, str(x), units.get(v, ""), "scenario") for v, x in start.items() if v not in values]
        head = ("name", "value", "unit", "set by")
        inner = table(head, lines, f"Parameters and start values of {name}") if lines else ""
        inner += f"<p>GUID of the FMU: <code>{escape(each.get('guid', 'not recorded'))}</code></p>"
        parts.append(folded(f"{name}: {counted(len(lines), 'value')}", inner))
    return "\n".join(parts)


def connections(data: xr.Dataset) -> str:
    """Return a table of the connections, and of what they do to their signals."""
    found = json.loads(data.attrs.get("connections", "[]"))
    if not found:
        return ""
    rows = [(origin, target, _on_the_way(*change)) for origin, target, *change in found]
    changed = any(words for _, _, words in rows)
    head = ("from", "to", "on the way") if changed else ("from", "to")
    inner = table(head, [row[: len(head)] for row in rows], "Connections", row_heads=False)
    return folded(counted(len(found), "connection"), inner)


def _on_the_way(change: Mapping[str, Any] | None = None) -> str:
    """Say what a connection does to its signal; nothing if it arrives as it is, or was not recorded."""
    change = change or {}
    words = [f"{what} {change[what]:.9g}" for what in ("gain", "bias") if what in change]
    if noise := change.get("noise"):
        size = "standard deviation" if noise["kind"] == "normal" else "half-width"
        words.append(f"{noise['kind']} noise, {size} {noise['amplitude']:.9g}, seed {noise.get('seed', 0)}")
    if dropout := change.get("dropout"):
        then = "the last is held" if dropout.get("hold", True) else "zero arrives"
        lost = f"{100 * dropout['probability']:.9g} % of the samples are lost"
        words.append(f"{lost}, {then}, seed {dropout.get('seed', 0)}")
    if change.get("delayed"):
        words.append("arrives one step later")
    return "; ".join(words)


def scenario(data: xr.Dataset) -> str:
    """Return the scenario's text."""
    text = data.attrs.get("scenario")
    return folded("The scenario file", f"<pre>{escape(str(text))}</pre>") if text else ""


def watch_tables(watched: Mapping[str, Any] | None) -> str:
    """Return a table of the damages that began while the twin watched the run, for each onset."""
    found = (watched or {}).get("findings", [])
    shown = [
        onset_table(each["onset"], each["onset_deviation"], each["damage"], each["deviation"], each.get("zones", ()))
        for each in found
    ]
    return "\n".join(table(each.head, each.rows, f"{each.caption}, by the digital twin") for each in shown)


def judgement_tables(ended: Sequence[Judgement]) -> str:
    """Return the last valid judgement zone by zone, and the windows."""
    if not ended:
        return ""
    known, certain = (bool(np.isfinite(x).all()) for x in (ended[-1].true, ended[-1].deviation))
    parts = []
    for last in [window for window in ended if window.valid][-1:]:
        numbers = tuple(str(k + 1) for k in range(len(last.estimated)))
        named = ["name"] * (last.labels != numbers)
        head = ["zone", *named, *["true [%]"] * known, "estimated [%]", *["standard deviation [%]"] * certain]
        columns = [[f"{100 * x:.1f}" for x in each] for each in (*[last.true] * known, last.estimated)]
        columns += [[f"{100 * x:.2f}" for x in last.deviation]] * certain
        rows = zip(numbers, *[last.labels] * len(named), *columns, strict=True)
        inner = table(head, rows, f"Damage of every zone at t = {last.time:.4f} s")
        parts.append(folded("Damage in numbers", inner))
    return "\n".join([*parts, folded(counted(len(ended), "window"), on_page(window_table(ended, SHOWN_WINDOWS)))])
