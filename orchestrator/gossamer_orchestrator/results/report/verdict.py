"""Say in a sentence what the detector found, how sure it is, and what was true if that is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ...errors import ResultsError
from ...pages.page import Kind
from ...words import counted, uncertain
from ..dataset import find_all
from ..judgements import Judgement, doubts, recorded_detector
from ..tables import LEAST_SHOWN
from .sensing import sensor_doubts

LEAST_CLEAR = 0.05  # damage of a zone that counts as found, by a detector that states no deviation
MOST_NAMED = 4  # zones


@dataclass(frozen=True)
class Verdict:
    """What a page says first.

    Attributes
    ----------
    kind : {"damage", "healthy", "invalid", "none"}
        As a ``Page`` has it.
    sentence : str
        The verdict.
    more : list of str
        What else is known: the truth, the alarm, reasons to doubt.
    """

    kind: Kind
    sentence: str
    more: list[str]


def found_zones(judgement: Judgement) -> list[int]:
    """List the zones, from 0, that a judgement calls damaged, the most damaged first."""
    certain = np.isfinite(judgement.deviation).all()
    order = np.argsort(-judgement.estimated, kind="stable")
    return [int(z) for z in order if judgement.estimated[z] >= (LEAST_SHOWN if certain else LEAST_CLEAR)]


def make_verdict(data: xr.Dataset, ended: Sequence[Judgement], watched: dict[str, Any] | None) -> Verdict:
    """Say what was found.

    Parameters
    ----------
    data : xarray.Dataset
        Results.
    ended : sequence of Judgement
        All windows; none if there is no detector.
    watched : dict or None
        Content of ``watch.json``.
    """
    more, sensing = _watch_sentences(watched), sensor_doubts(data)
    if not ended:
        kind: Kind = "invalid" if sensing else "none"
        return Verdict(kind, f"No judgement: {_why_none(data)} The pictures show what was recorded.", sensing + more)
    reasons = doubts(data, list(ended)) + sensing
    valid = [window for window in ended if window.valid]
    if not valid:
        return Verdict("invalid", "No valid judgement. " + reasons[0], reasons[1:] + more)
    last, found = valid[-1], found_zones(valid[-1])
    certain = bool(np.isfinite(last.deviation).all())
    rest, alarmed = [z for z in range(last.estimated.size) if z not in found], _is_alarmed(watched)
    if found:
        listed = _listed(last.estimated, last.deviation, found, 1)
        sentence = f"Damaged: {listed}, judged at t = {last.time:.4f} s{_undamaged(last, rest, certain)}."
        first = next(window for window in valid if found_zones(window))
        if first is not last:
            more.insert(0, f"The first valid window that shows damage ended at t = {first.time:.4f} s.")
    else:
        sentence = f"No damage: judged at t = {last.time:.4f} s{_undamaged(last, rest, certain)}."
        if alarmed:
            sentence += " But the digital twin raised an alarm."
    if np.isfinite(last.true).all():
        more.insert(0, _truth(last))
    else:
        more.insert(0, "The true damage is not recorded.")
    healthy: Kind = (
        "healthy" if ended[-1].valid and not (alarmed or sensing) else "invalid"
    )  # else what came later is not known
    return Verdict("damage" if found else healthy, sentence, reasons + more)


def _why_none(data: xr.Dataset) -> str:
    """Say why there is not a single window."""
    if not find_all(data, "detector"):
        return "the run had no detector."
    try:
        recorded_detector(data)
    except ResultsError as error:
        return str(error)
    return f"until t = {float(data['time'][-1]):.6g} s no window ended."


def _listed(damage: ArrayLike, deviation: ArrayLike, zones: Sequence[int], digits: int) -> str:
    """Say what the first of some zones lost; the first of them says of what."""
    parts: list[str] = []
    for zone in zones[:MOST_NAMED]:
        value, error = 100 * np.asarray(damage)[zone], 100 * np.asarray(deviation)[zone]
        bar = f" ± {error:.{digits}f}" if np.isfinite(error) else ""
        parts.append(f"zone {zone + 1} lost {value:.{digits}f}{bar} %{' of its stiffness' * (not parts)}")
    if more := len(zones[MOST_NAMED:]):
        parts.append(f"{counted(more, 'more zone')} {'is' if more == 1 else 'are'} damaged less")
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def _undamaged(judgement: Judgement, zones: list[int], certain: bool) -> str:
    """Say how sure the detector is of the other zones."""
    if not zones:
        return ""
    one, whole = len(zones) == 1, len(zones) == judgement.estimated.size
    if one:
        which = "its only zone" if whole else "the other zone"
    else:
        which = f"all {len(zones)} zones" if whole else f"the other {len(zones)} zones"
    if not certain:
        show = "shows" if one else "show"
        return f"; {which} {show} less than {100 * LEAST_CLEAR:.0f} %; the detector states no uncertainty"
    undamaged = "is undamaged," if one else "are undamaged, each"
    most = max(100 * float(judgement.deviation[zones].max()), 0.05)
    return f"; {which} {undamaged} within ± {most:.1f} % (± is one standard deviation)"


def _truth(judgement: Judgement) -> str:
    damaged = np.flatnonzero(judgement.true > 0.0)
    true = ", ".join(f"{100 * judgement.true[z]:.3g} % in zone {z + 1}" for z in damaged[:MOST_NAMED])
    if len(damaged) > MOST_NAMED:
        true += " and more"
    error = f"the mean absolute error over all zones is {100 * judgement.mean_absolute_error:.2f} %"
    return f"True then: {true or 'no damage'}; {error}."


def _is_alarmed(watched: Mapping[str, Any] | None) -> bool:
    """Tell whether the twin raised an alarm, and did not find afterwards that no zone is damaged."""
    alarms, findings = ((watched or {}).get(what, []) for what in ("alarms", "findings"))
    return len(findings) < len(alarms) or any(np.any(np.asarray(each["damage"]) > 0.0) for each in findings)


def _watch_sentences(watched: dict[str, Any] | None) -> list[str]:
    """Say what the twin that watched the run found."""
    if not watched:
        return []
    alarms, findings = watched.get("alarms", []), watched.get("findings", [])
    if not alarms:
        return [f"The digital twin raised no alarm in {counted(len(watched.get('misfit', [])), 'window')}."]
    return [f"The digital twin raised its first alarm at t = {alarms[0]:.4f} s.", *map(_dated, findings)]


def _dated(finding: Mapping[str, Any]) -> str:
    """Say when damage began that the twin found, and what the most damaged zones lost."""
    onset = uncertain(finding["onset"], finding["onset_deviation"], "s")
    sentence = f"The digital twin dates the onset of damage to t = {onset}"
    damage = np.asarray(finding["damage"])
    zones = [int(z) for z in np.argsort(-damage, kind="stable") if damage[z] > 0.0]
    return f"{sentence}: {_listed(damage, finding['deviation'], zones, 2)}." if zones else f"{sentence}."
