"""The page of a watch over a record: alarms, onsets and damages, and the evidence of every window beside the loads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gossamer_files.charts import section
from gossamer_orchestrator.pages import Page
from gossamer_orchestrator.pages.page import Kind
from gossamer_orchestrator.results.report.watch import watch_charts, watch_tables
from gossamer_orchestrator.results.verdict import is_alarmed, watch_sentences

from .twin import damage_chart


def watch_page(name: str, content: Mapping[str, Any], doubts: list[str], *, valid: bool) -> Page:
    """Describe what a watch has seen.

    Parameters
    ----------
    name : str
        Of the record.
    content : mapping
        Of ``watch.json``.
    doubts : list of str
        Which damage is seen, and reasons for doubt, a sentence each.
    valid : bool
        Whether what was seen can be used.
    """
    last, agreed = content["findings"][-1:], [f"{time:.4g} s" for time in content["agreed"]]
    sentence, *more = watch_sentences(content)
    for fault in content["faults"]:
        left_out = f"it is left out from t = {fault['time']:.4g} s on"
        more.append(f"The alarm at t = {fault['alarm']:.4g} s came from sensor {fault['sensor']}; {left_out}.")
    if agreed:
        more.append(f"Damage explained the readings first at t = {', '.join(agreed)}.")
    kind: Kind = "damage" if is_alarmed(content) else "healthy" if valid else "invalid"
    damage = [damage_chart(content["zones"], *(np.array(each[what]) for what in ("damage", "deviation"))) for each in last]
    return Page(
        title=f"Watch of {name}",
        kind=kind,
        sentence=sentence,
        more=[*more, *doubts],
        charts=[*section("Damage since the last onset", damage), *section("Window by window", watch_charts(content))],
        facts=[watch_tables(content)],
        how="Bars of damage are one standard deviation wide to each side. Dash-dotted lines are alarms.",
    )
