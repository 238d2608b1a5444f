"""Say in a sentence what the detector found, how sure it is, and what was true if that is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from gossamer_files.charts import Array
from numpy.typing import ArrayLike

from ..errors import ResultsError
from ..names import split_endpoint
from ..pages.page import Kind
from ..words import counted, first_few, percent, uncertain
from .dataset import find_all, origins_of, parameters_of, zone_label
from .files import MESSAGES, is_explained, sees_enough
from .judgements import LEAST_SHOWN, REACH, Judgement, doubts, recorded_detector
from .readers import LEAST_RANGE, Reader, curve_of, readers_of

LEAST_CLEAR = 0.05  # damage of a zone that counts as found, by a detector that states no deviation
MOST_NAMED = 4  # zones
COARSE = 0.1  # of the change of the readings: where finer elements add more, the watch knows no damage that it sees
UNEXPLAINED = 1.3  # chi2 per sample above which the model is what hides damage
# share of the errors above two stated deviations, up to which the compensator has said how wrong it is
WITHIN_BAND = 0.1
LARGE_ERROR = 0.15  # RMS error of recovered strain over the range of the true one, from which the strain is called wrong


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
    """List the zones, from 0, that a judgement calls damaged, the most damaged first.

    Of a detector that states deviations these are the zones whose bounds leave out 0.
    """
    certain = np.isfinite(judgement.deviation).all()
    least = np.maximum(LEAST_SHOWN, REACH * judgement.deviation) if certain else np.full(judgement.true.shape, LEAST_CLEAR)
    order = np.argsort(-judgement.estimated, kind="stable")
    return [int(z) for z in order if judgement.estimated[z] >= least[z]]


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
    more, sensing = _beside_headline(watched), sensor_doubts(data)
    if data.attrs.get("not_finite"):
        return Verdict("invalid", f"No valid judgement. {sensing[0]}", sensing[1:] + more)
    if (finding := _explained(watched)) is not None:
        return _by_twin(finding, data, ended, sensing, more)
    if not ended:
        kind: Kind = "invalid" if sensing else "none"
        return Verdict(kind, f"No judgement: {_why_none(data)} The pictures show what was recorded.", sensing + more)
    reasons = doubts(data, list(ended)) + sensing
    valid = [window for window in ended if window.valid]
    if not valid:
        return Verdict("invalid", "No valid judgement. " + reasons[0], reasons[1:] + more)
    last, found = valid[-1], found_zones(valid[-1])
    certain = bool(np.isfinite(last.deviation).all())
    rest, alarmed = [z for z in range(last.estimated.size) if z not in found], is_alarmed(watched)
    is_open = not last.determined[rest].all()
    if found:
        sentence = f"Damaged: {_judged(last)}{_undamaged(last, rest, certain)}."
        first = next(window for window in valid if found_zones(window))
        if first is not last:
            more.insert(0, f"The first valid window that shows damage ended at t = {first.time:.4f} s.")
    else:
        sentence = f"No damage{' that is certain' * is_open}: {_judged(last)}{_undamaged(last, rest, certain)}."
        if alarmed:
            sentence += " But the digital twin raised an alarm."
    more.insert(0, _truth(last.estimated, last.true, last.labels))
    clear = ended[-1].valid and not (alarmed or sensing or is_open)  # else what came later, or is there, is not known
    return Verdict("damage" if found else "healthy" if clear else "invalid", sentence, reasons + more)


def _explained(watched: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """Return the last finding of the twin if it explains the record with it, else None."""
    alarms, findings = ((watched or {}).get(name, []) for name in ("alarms", "findings"))
    explains = watched and findings and len(findings) == len(alarms) and is_explained(watched)
    return dict(findings[-1]) if explains else None


def _by_twin(
    finding: Mapping[str, Any], data: xr.Dataset, ended: Sequence[Judgement], sensing: list[str], more: list[str]
) -> Verdict:
    """Give the answer of the twin, and beside it that of the detector with the reason for the difference."""
    damage, deviation = np.array(finding["damage"]), np.array(finding["deviation"])
    zones = [int(z) for z in np.argsort(-damage, kind="stable") if damage[z] > 0.0]
    onset = uncertain(finding["onset"], finding["onset_deviation"], "s")
    labels = _labels(finding)
    what = f"Damaged: {_listed(damage, deviation, zones, 2, labels)}" if zones else "No damage after all"
    sentence = f"{what}, since t = {onset}, by the digital twin, which explains the record (± is one standard deviation)."
    known = ended[-1].true if ended and ended[-1].true.shape == damage.shape else np.full(damage.shape, np.nan)
    none = [f"The detector gave none: {_why_none(data)}"] if not ended and find_all(data, "detector") else []
    beside = [_truth(damage, known, labels), *none, *_beside_twin(finding, ended), *sensing, *more]
    return Verdict("damage" if zones else "invalid" if sensing else "healthy", sentence, beside)


def _beside_twin(finding: Mapping[str, Any], ended: Sequence[Judgement]) -> list[str]:
    """Say what the detector judged, whether that agrees with the twin, and why not."""
    if not ended:
        return []
    last = next((k for k in reversed(range(len(ended))) if ended[k].valid), None)
    if last is None or ended[last].estimated.shape != np.shape(finding["damage"]):
        return ["The detector beside it gave no valid judgement; the tables say why."]
    judged, begin = ended[last], ended[last - 1].time if last else -np.inf
    apart = np.abs(judged.estimated - finding["damage"])
    reach = 2.0 * np.hypot(np.nan_to_num(judged.deviation), finding["deviation"])
    worst = int(np.argmax(apart - reach))
    if (apart <= np.maximum(reach, LEAST_SHOWN)).all():
        return [f"The detector agrees within two deviations: {_judged(judged)}."]
    why = (
        "its window began before that onset"
        if begin < finding["onset"]
        else "it compares a single window with the simulated cases of its training, where the twin fits the record itself"
    )
    most = f"{100.0 * apart[worst]:.1f} % in zone {judged.labels[worst]}"
    return [f"The detector differs by up to {most}, for {why}: {_judged(judged)}."]


def _judged(last: Judgement) -> str:
    """Say what a judgement found, and when."""
    found = found_zones(last)
    listed = _listed(last.estimated, last.deviation, found, 1, last.labels) + ", " if found else ""
    return f"{listed}judged at t = {last.time:.4f} s"


def _why_none(data: xr.Dataset) -> str:
    """Say why there is not a single window."""
    if not find_all(data, "detector"):
        return "the run had no detector."
    try:
        recorded_detector(data)
    except ResultsError as error:
        return str(error)
    return f"until t = {float(data['time'][-1]):.6g} s no window ended."


def _labels(finding: Mapping[str, Any]) -> list[str]:
    """Return what stands for the zones of a finding after the word "zone"."""
    names = finding.get("zones") or [str(k + 1) for k in range(len(finding["damage"]))]
    return [zone_label(name) for name in names]


def _listed(damage: ArrayLike, deviation: ArrayLike, zones: Sequence[int], digits: int, labels: Sequence[str]) -> str:
    """Say what the first of some zones lost; the first of them says of what."""
    parts: list[str] = []
    for zone in zones[:MOST_NAMED]:
        value, error = 100 * np.asarray(damage)[zone], 100 * np.asarray(deviation)[zone]
        bar = f" ± {error:.{digits}f}" if np.isfinite(error) else ""
        parts.append(f"zone {labels[zone]} lost {value:.{digits}f}{bar} %{' of its stiffness' * (not parts)}")
    if more := len(zones[MOST_NAMED:]):
        parts.append(f"{counted(more, 'more zone')} {'is' if more == 1 else 'are'} damaged less")
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def _undamaged(judgement: Judgement, zones: list[int], certain: bool) -> str:
    """Say how sure the detector is of the other zones."""
    shut, unknown = ([z for z in zones if judgement.determined[z] == kind] for kind in (True, False))
    said = ""
    if shut:
        one, whole = len(shut) == 1, len(shut) == judgement.estimated.size
        which = ("its only zone" if one else f"all {len(shut)} zones") if whole else counted(len(shut), "other zone")
        if not certain:
            show = "shows" if one else "show"
            return f"; {which} {show} less than {100 * LEAST_CLEAR:.0f} %; the detector states no uncertainty"
        undamaged = "is undamaged," if one else "are undamaged, each"
        most = max(100 * float(judgement.deviation[shut].max()), 0.05)
        said = f"; {which} {undamaged} within ± {most:.1f} % (± is one standard deviation)"
    if unknown:
        listed = [f"zone {judgement.labels[z]} {judgement.bounds(z)} %" for z in unknown]
        said += f"; not determined: {first_few(listed, MOST_NAMED)}"
    return said


def _truth(estimated: Array, known: Array, labels: Sequence[str]) -> str:
    if not np.isfinite(known).all():
        return "The true damage is not recorded."
    damaged = np.flatnonzero(known > 0.0)
    true = ", ".join(f"{100 * known[z]:.3g} % in zone {labels[z]}" for z in damaged[:MOST_NAMED])
    if len(damaged) > MOST_NAMED:
        true += " and more"
    error = f"the mean absolute error over all zones is {100 * np.abs(estimated - known).mean():.2f} %"
    return f"True then: {true or 'no damage'}; {error}."


def is_alarmed(watched: Mapping[str, Any] | None) -> bool:
    """Tell whether the twin raised an alarm, and did not find afterwards that no zone is damaged."""
    alarms, findings = ((watched or {}).get(what, []) for what in ("alarms", "findings"))
    return len(findings) < len(alarms) or any(np.any(np.asarray(each["damage"]) > 0.0) for each in findings)


def watch_sentences(watched: Mapping[str, Any]) -> list[str]:
    """Say which alarms a watch raised, and what it found."""
    alarms, findings = watched.get("alarms", []), watched.get("findings", [])
    if not alarms:
        return [f"The digital twin raised no alarm in {counted(len(watched.get('misfit', [])), 'window')}."]
    return [f"The digital twin raised its first alarm at t = {alarms[0]:.4f} s.", *map(_dated, findings)]


def _beside_headline(watched: Mapping[str, Any] | None) -> list[str]:
    """Say what the twin that watched a run found, but for what the headline says."""
    if not watched:
        return []
    said = watch_sentences(watched)
    return [*(said if _explained(watched) is None else said[:-1]), *sight(watched)]


def sight(watched: Mapping[str, Any]) -> list[str]:
    """Say which damage a watch sees; if that is too much, in which zones, and why."""
    sees = np.array(watched.get("sees", []), dtype=float)  # what nothing shows is not a number
    if not sees.size:
        return []
    if sees_enough(watched):
        return [f"In every zone {percent(float(sees.max()))} of damage would raise an alarm in nine of ten cases."]
    order = np.argsort(-np.nan_to_num(sees, nan=np.inf), kind="stable")
    blind = [int(z) for z in order if not sees[z] <= watched["see"]]
    least = ["any" if np.isnan(each) else percent(float(each)) for each in sees]
    parts = [f"{least[z]} in zone {zone_label(watched['zones'][z])}" for z in blind]
    more = " and more" * (len(parts) > MOST_NAMED)
    scale = float(np.median(watched["misfit"]))
    why = "The noise of the sensors hides it; give quieter readings, more sensors or a longer record."
    added = float(np.median(watched.get("mesh", [0.0])))
    if added > COARSE:
        why = f"Its mesh is too coarse to tell: finer elements add {percent(added)} of the change of the readings."
    elif scale > UNEXPLAINED:
        why = f"The readings differ from the twin by more than noise: chi2 per sample is {scale:.2g}. Check the model."
    return [f"The watch is blind to some damage: up to {', '.join(parts[:MOST_NAMED])}{more}. {why}"]


def _dated(finding: Mapping[str, Any]) -> str:
    """Say when damage began that the twin found, and what the most damaged zones lost."""
    onset = uncertain(finding["onset"], finding["onset_deviation"], "s")
    sentence = f"The digital twin dates the onset of damage to t = {onset}"
    damage = np.asarray(finding["damage"])
    zones = [int(z) for z in np.argsort(-damage, kind="stable") if damage[z] > 0.0]
    return f"{sentence}: {_listed(damage, finding['deviation'], zones, 2, _labels(finding))}." if zones else f"{sentence}."


def sensor_doubts(data: xr.Dataset) -> list[str]:
    """List reasons to doubt a run: values that are not finite, components out of their identified range, wrong strain."""
    readers, lost = readers_of(data), int(data.attrs.get("not_finite", 0))
    after = f"{counted(lost, 'component')} had values that are not finite, see {MESSAGES}: what follows means nothing."
    beyond = [
        _beyond(data, name, readers)
        for name in (str(each).removesuffix(".saturated") for each in data.data_vars if str(each).endswith(".saturated"))
        if float(data[f"{name}.saturated"].max()) > 0.5
    ]
    if beyond:
        beyond.append("Do not trust the strain and damage that follow from what was outside its identified range.")
    return [*[after] * (lost > 0), *beyond, *filter(None, map(_wrong, readers))]


def _beyond(data: xr.Dataset, name: str, readers: Sequence[Reader]) -> str:
    """Say how far a component left its identified range, as far as that was recorded."""
    rows = data[f"{name}.saturated"].to_numpy() > 0.5
    when = f"in {percent(float(np.mean(rows)))} of the run"
    if rows.ndim > 1:
        return f"{name} was outside its identified range {when}."
    limits = parameters_of(data, name)
    names = ("rest_resistance", "full_scale_resistance_change", "full_scale_strain")
    rest, rise, full = (float(limits.get(each, np.nan)) for each in names)
    known = np.isfinite([rest, rise, full]).all()
    for reader in readers:
        if reader.sensor == name and reader.true:
            felt = (f"{name}.strain",) if f"{name}.strain" in data else reader.true  # its input, or where that begins
            strain = 100.0 * _furthest(curve_of(*felt)(data)[rows], 0.5 * full)
            limit = f", 0 to {100.0 * full:.4g} % strain" if known else ""
            return f"{name} reached {strain:.4g} % strain, outside its identified range{limit}, {when}."
        read = _reading(data, name)
        if reader.compensator == name and read:
            late = reader.rows_late  # what it judges may have been read so long before
            near = rows | np.append(rows[late:], np.zeros(min(late, rows.size), dtype=bool))
            resistance = _furthest(curve_of(read)(data)[near], rest + 0.5 * rise)
            limit = (
                f", 0 to {100.0 * full:.4g} % strain: from {rest:.5g} ohm at rest to {rest + rise:.5g} ohm when first loaded"
                if known
                else ""
            )
            return (
                f"{name} read {resistance:.5g} ohm, and {when} no strain explains what it read within its identified "
                f"range{limit}."
            )
    return f"{name} was outside its identified range {when}."


def _reading(data: xr.Dataset, name: str) -> str:
    """Name the recorded resistance that a compensator reads; empty if there is none."""
    candidates = (f"{name}.resistance", origins_of(data).get(f"{name}.resistance", ""))
    return next((each for each in candidates if each in data and split_endpoint(each)[1]), "")


def _furthest(values: Array, middle: float) -> float:
    """Return the value that is furthest from the middle of a range; the largest where that is not known."""
    return float(values[np.argmax(np.abs(values - middle))] if np.isfinite(middle) else values.max())


def _wrong(reader: Reader) -> str:
    """Say that recovered strain is off by more than 15 % of the range of the true strain; empty if it is not."""
    error = reader.error
    if (
        error is None
        or not error.span >= LEAST_RANGE
        or error.rms <= LARGE_ERROR * error.span
        or error.beyond <= WITHIN_BAND
    ):
        return ""
    return (
        f"The strain that {reader.compensator} recovers is wrong: its RMS error of {100.0 * error.rms:.3g} % strain is "
        f"{100.0 * error.rms / error.span:.0f} % of the range of the true strain, {100.0 * error.span:.3g} % strain."
    )
