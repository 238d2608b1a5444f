"""The page of a sweep: how the cases ended, and how damage and one scalar change with what varies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from gossamer_files.charts import Array, Chart, Trace, curve, heat, points, section
from gossamer_orchestrator.pages import PAGE, Page, link, table
from gossamer_orchestrator.results.dataset import find_all
from gossamer_orchestrator.results.files import is_finished
from gossamer_orchestrator.results.judgements import LEAST_SHOWN, Judgement, windows_of
from gossamer_orchestrator.run.sweep import Case
from numpy.typing import NDArray

CURVES = 12  # cases whose curves are drawn
ROWS = 300  # cases in the table, and all that failed
TICKS = 8  # values of what varies that stand along an axis
ZONES = 5  # zones with a colour of their own
NAMED = 3  # reasons of failures in the verdict
LOOKS = {"last": ("@0", "circle"), "largest": ("@1", "triangle-up"), "RMS": ("@2", "square")}


@dataclass(frozen=True, kw_only=True)
class CaseEnd:
    """A case, how it ended, and what it recorded.

    Attributes
    ----------
    case : Case
        Number and values.
    text : str
        The attribute ``ended`` of its results, or what the run said.
    data : xarray.Dataset or None
        Its results; they stay on the disk until they are used.
    judgement : Judgement or None
        The last valid one; None without any.
    numbers : dict
        Last value, largest size and RMS of the scalar that is drawn.
    """

    case: Case
    text: str
    data: xr.Dataset | None = None
    judgement: Judgement | None = None
    numbers: dict[str, float] = field(default_factory=dict)

    @property
    def finished(self) -> bool:
        """Whether it is finished."""
        return is_finished(self.text)

    @property
    def detector(self) -> bool:
        """Whether it has a detector."""
        return self.data is not None and bool(find_all(self.data, "detector"))


def sweep_page(
    name: str,
    cases: Sequence[Case],
    texts: Sequence[str],
    data: xr.Dataset | None,
    folder: Path,
    variable: str | None = None,
) -> Page:
    """Describe a sweep from what its cases recorded.

    Parameters
    ----------
    name : str
        What was swept.
    cases, texts : sequence of Case and of str
        All cases, and how each ended.
    data : xarray.Dataset or None
        What they recorded along ``case``; None if none did.
    folder : Path
        Folder of the sweep.
    variable : str or None
        Variable to draw, of an array the element that is largest in the first case; None for the first scalar that changes.
    """
    scalar = None if data is None else _choose(data, variable)
    ended = read_cases(cases, texts, data, scalar)
    varied = [each for each in cases[0].values if len({str(case.values[each]) for case in cases}) > 1]
    over = varied or ["case"]
    failed = [each for each in ended if not each.finished]
    count, done = len(ended), len(ended) - len(failed)
    about = [("Scenario", name), ("Cases", count), ("Folder", folder), ("Gossamer", version("gossamer"))]
    return Page(
        title=f"Sweep of {name}",
        kind="invalid" if failed else "none",
        sentence=f"{count} cases: {done} finished, {len(failed)} failed." if failed else f"All {count} cases finished.",
        more=[_what_varies(cases, varied), *_failures(failed), *_judged(ended)],
        charts=[
            *section("Damage", _damage_charts(ended, over)),
            *([] if scalar is None else _scalar_charts(ended, over, scalar)),
        ],
        facts=[_case_table(ended, folder), table((), about, "The sweep")],
        how="Numbers are of all recorded points. Bars of estimates are one standard deviation long to each side.",
    )


def _what_varies(cases: Sequence[Case], varied: Sequence[str]) -> str:
    parts = []
    for name in varied:
        values = list(dict.fromkeys(_text(case.values[name]) for case in cases))
        parts.append(f"{name}, {len(values)} values from {values[0]} to {values[-1]}")
    return f"Varied: {'; '.join(parts)}." if parts else "Nothing varies."


def _failures(failed: Sequence[CaseEnd]) -> list[str]:
    """Name each reason once, with the first case that failed for it."""
    reasons: dict[str, list[int]] = {}
    for each in failed:
        reasons.setdefault(each.text, []).append(each.case.number)
    sentences = []
    for text, numbers in list(reasons.items())[:NAMED]:
        others = f" and {len(numbers) - 1} more" if len(numbers) > 1 else ""
        sentences.append(f"Case {numbers[0]}{others} failed: {text}")
    return sentences + (["Others failed for other reasons; the table says why."] if len(reasons) > NAMED else [])


def _judged(ended: Sequence[CaseEnd]) -> list[str]:
    """Say how many cases were judged, how well, and whether the answer "always 0" is as good."""
    asked = [each for each in ended if each.detector and each.finished]
    if not asked:
        return []
    found = [each.judgement for each in asked if each.judgement is not None]
    sentences = [f"{len(found)} of {len(asked)} finished cases end with a valid judgement of damage."]
    if found and np.isfinite([judgement.true for judgement in found]).all():
        error = 100.0 * float(np.mean([judgement.mean_absolute_error for judgement in found]))
        zero = 100.0 * float(np.mean([np.abs(judgement.true).mean() for judgement in found]))
        sentences.append(
            f"Their mean absolute error over all zones is {error:.2f} % damage; the answer 'always 0' has {zero:.2f} %."
        )
        if 0.0 < zero <= error:
            sentences.append("The answer 'always 0' is as good here, so the detector tells nothing.")
    return sentences


def _damage_charts(ended: Sequence[CaseEnd], over: Sequence[str]) -> list[Chart]:
    """Draw the last valid judgements over what varies, and over the truth where it is known."""
    judged = [(each, each.judgement) for each in ended if each.judgement is not None]
    if not judged:
        return []
    some, found = [each for each, _ in judged], [judgement for _, judgement in judged]
    estimated, true = (100.0 * np.stack([getattr(j, name) for j in found]) for name in ("estimated", "true"))
    stated = 100.0 * np.stack([j.deviation for j in found])
    deviation = stated if np.isfinite(stated).all() else None
    known = bool(np.isfinite(true).all())
    left_out = len(ended) - len(some)
    note = f"{left_out} cases without a valid judgement are left out." if left_out else ""
    charts = []
    for name in over:
        traces = _zones(_values(some, name), estimated, deviation, true if known else None)
        title = f"Last valid judgement over {name}"
        charts.append(Chart(title, name, "damage [%]", traces, note=note, layout=_ticks(some, name)))
    if known:
        ends = [0.0, float(max(true.max(), estimated.max()))]
        bars = None if deviation is None else deviation.ravel()
        traces = [
            curve("right", ends, ends, "@grey", dash="dash"),
            points("a zone of a case", true.ravel(), estimated.ravel(), "@0", bars),
        ]
        charts.append(Chart("Estimated over true damage", "true damage [%]", "estimated damage [%]", traces))
        charts += _map(some, over, "Mean absolute error over all zones [% damage]", np.abs(estimated - true).mean(axis=1))
    return charts


def _zones(x: NDArray[np.float64] | list[str], estimated: Array, deviation: Array | None, true: Array | None) -> list[Trace]:
    """Draw the most damaged zones one by one, and the largest of the others, shape (cases, zones) each [%]."""
    largest = (estimated if true is None else np.maximum(estimated, true)).max(axis=0)
    zones = [int(z) for z in np.argsort(-largest, kind="stable")[:ZONES] if largest[z] >= 100.0 * LEAST_SHOWN]
    traces = []
    for k, z in enumerate(sorted(zones)):
        bars = None if deviation is None else deviation[:, z]
        traces.append(points(f"zone {z + 1}", x, estimated[:, z], f"@{k}", bars))
        if true is not None:
            traces.append(points(f"zone {z + 1}, true", x, true[:, z], f"@{k}", symbol="x-thin-open", size=10))
    others = np.delete(estimated, zones, axis=1)
    if others.size:
        traces.append(points("largest of the others", x, others.max(axis=1), "@grey"))
    return traces


def _scalar_charts(ended: Sequence[CaseEnd], over: Sequence[str], scalar: xr.DataArray) -> list[Chart]:
    """Draw a scalar over time, its difference to the first case, and its last value, largest size and RMS."""
    there, label = [each for each in ended if each.numbers], str(scalar.name)
    if not there:
        return []
    numbers = {kind: np.array([each.numbers[kind] for each in there]) for kind in LOOKS}
    charts = []
    for name in over:
        values = _values(there, name)
        traces = [points(kind, values, numbers[kind], color, symbol=symbol) for kind, (color, symbol) in LOOKS.items()]
        title = f"Last value, largest size and RMS over {name}"
        charts.append(Chart(title, name, label, traces, layout=_ticks(there, name)))
    charts += _map(there, over, f"Last value of {label}", numbers["last"])
    chosen = dict.fromkeys(np.linspace(0, len(there) - 1, min(CURVES, len(there))).round().astype(int).tolist())
    some = [there[k] for k in chosen]
    first, *_ = some
    begin, values = _history(scalar, first)
    curves, apart = [], []
    for k, each in enumerate(some):
        time, own = _history(scalar, each)
        look: dict[str, Any] = {"color": f"@{k % 6}", "dash": "solid" if k < 6 else "dash"}
        curves.append(curve(_label(each, over), time, own, **look))
        both = time <= begin[-1]
        if each is not first and len(time) > 1:
            apart.append(curve(_label(each, over), time[both], own[both] - np.interp(time[both], begin, values), **look))
    few = "" if len(some) == len(there) else f"{len(some)} of {len(there)} cases, evenly chosen by number."
    charts.append(Chart("Over time", "time [s]", label, curves, note=few, broad=True))
    if apart:  # the curves may hardly differ
        charts.append(Chart(f"Difference to case {first.case.number}", "time [s]", label, apart, broad=True))
    return section(label, charts)


def _values(ended: Sequence[CaseEnd], name: str) -> NDArray[np.float64] | list[str]:
    """Return the values of what varies: numbers, or words where one of them is no number."""
    values = [each.case.number if name == "case" else each.case.values[name] for each in ended]
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values, dtype=float)
    return [str(value) for value in values]


def _ticks(ended: Sequence[CaseEnd], name: str) -> dict[str, object]:
    """Return the layout of an axis over what varies: the values themselves, if they are few and apart."""
    values = np.unique(np.asarray(_values(ended, name)))
    if values.dtype.kind == "U" or not 1 < len(values) <= TICKS or np.diff(values).min() < np.ptp(values) / (2 * TICKS):
        return {}
    return {"xaxis": {"tickvals": values, "ticktext": [_text(value) for value in values.tolist()]}}


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _label(ended: CaseEnd, over: Sequence[str]) -> str:
    values = [f"{name.rpartition('.')[2]} = {_text(ended.case.values[name])}" for name in over if name != "case"]
    return f"{ended.case.number}: {', '.join(values)}" if values else f"case {ended.case.number}"


def _map(ended: Sequence[CaseEnd], over: Sequence[str], title: str, values: Array) -> list[Chart]:
    """Draw a number of each case as a colour over two quantities; nothing unless two vary."""
    if len(over) != 2:
        return []
    (x, column), (y, row) = (np.unique(np.asarray(_values(ended, name)), return_inverse=True) for name in over)
    z = np.full((len(y), len(x)), np.nan)
    z[row, column] = values
    cells = heat([*map(_text, x.tolist())], [*map(_text, y.tolist())], z, "")
    layout = {key: {"type": "category"} for key in ("xaxis", "yaxis")}  # a cell for each case
    return [Chart(title, over[0], over[1], [cells], layout=layout)]


def _case_table(ended: Sequence[CaseEnd], folder: Path) -> str:
    """Return a row per case, with a link to its page where there is one."""
    rows = []
    for each in (each for each in ended if each.case.number <= ROWS or not each.finished):
        page = Path(each.case.name) / PAGE
        where = link(each.case.name, page.as_posix()) if (folder / page).is_file() else each.case.name
        rows.append((each.case.number, *map(_text, each.case.values.values()), _most_damaged(each), each.text, where))
    some = f"The first {ROWS} of {len(ended)} cases, and those that failed" if len(ended) > ROWS else "Cases"
    advice = (
        "<p>The cases were run without pictures. 'gossamer report' of the folder of a case writes its page; the same sweep, "
        "run again, links it here. The last values of all scalars are in cases.csv.</p>"
    )
    return table(("case", *ended[0].case.values, "most damaged zone", "ended", "folder"), rows, some) + advice


def _most_damaged(ended: CaseEnd) -> str:
    j = ended.judgement
    if j is None:
        return "no valid judgement" if ended.detector else "-"
    z = int(np.argmax(j.estimated))
    return f"zone {z + 1}: {j.said(z)} %" if j.estimated[z] >= LEAST_SHOWN else "none"


def read_cases(
    cases: Sequence[Case], texts: Sequence[str], data: xr.Dataset | None, scalar: xr.DataArray | None
) -> list[CaseEnd]:
    """Read the last valid judgement of each case, and numbers of a scalar."""
    recorded = [] if data is None else data["case"].to_numpy().tolist()
    ended = []
    for case, text in zip(cases, texts, strict=True):
        found = CaseEnd(case=case, text=text)
        if data is not None and case.number in recorded:
            own = data.sel(case=case.number).dropna("time", how="all")  # where another case has more
            numbers = {} if scalar is None else _numbers(_history(scalar, found)[1])
            last = next((window for window in reversed(windows_of(own)) if window.valid), None)
            found = replace(found, data=own, judgement=last, numbers=numbers)
        ended.append(found)
    return ended


def _history(scalar: xr.DataArray, ended: CaseEnd) -> tuple[Array, Array]:
    """Return times [s] and values of a scalar in a case, shape (n,)."""
    own = scalar.sel(case=ended.case.number).dropna("time")
    return own["time"].to_numpy(), own.to_numpy().astype(float)


def _choose(data: xr.Dataset, variable: str | None) -> xr.DataArray | None:
    """Return what is drawn, by case and time; its name has the unit in brackets."""
    over_time = {
        str(name): each.dims[2:]
        for name, each in data.data_vars.items()
        if each.dims[:2] == ("case", "time") and each.size and each.dtype.kind in "fiub"  # numbers and truth values
    }
    first = data.isel(case=0)
    if variable is None:
        scalars = [name for name, dims in over_time.items() if not dims]
        changing = (name for name in scalars if np.ptp(first[name].dropna("time").to_numpy().astype(float)) > 0.0)
        variable = next(changing, scalars[0] if scalars else None)
    if variable not in over_time:
        return None
    values, index = data[variable], ""
    if dims := over_time[variable]:
        table = np.abs(first[variable].to_numpy().astype(float).reshape(first.sizes["time"], -1))
        element = int(np.nan_to_num(table).max(axis=0).argmax())
        values, index = values.stack(element=dims).isel(element=element, drop=True), f"[{element + 1}]"
    return values.rename(f"{variable}{index} [{data[variable].attrs.get('units', '1')}]")


def _numbers(values: Array) -> dict[str, float]:
    known = values[np.isfinite(values)]
    if not known.size:
        return {}
    return {"last": float(known[-1]), "largest": float(np.abs(known).max()), "RMS": float(np.sqrt(np.mean(known**2)))}
