"""Small multiples of a sweep: a panel per case, with the same axes: a variable over time, or the last values of an array."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import xarray as xr
from gossamer_files.charts import Chart, Trace, bars, curve, points, words
from gossamer_files.pictures import COLORS
from gossamer_files.plots import Panels, save_charts

from ...errors import ResultsError, require
from ...names import suggest
from ..dataset import WATCHED, find_all, variables_of
from ..judgements import changes, true_damage

PICTURE = "sweep.png"
PANELS = 36  # of more cases every k-th is drawn


def open_cases(store: Path) -> xr.Dataset:
    """Open what the cases of a sweep recorded, in the order in which it was; it stays on the disk until it is used."""
    data: xr.Dataset = xr.open_zarr(store, consolidated=False)
    return data[list(data.attrs["variables"])]


def save_cases(store: Path, folder: Path, variable: str | None, varied: Sequence[str]) -> list[Path]:
    """Draw a variable of a sweep and write it as PNG; return the path, nothing if no case recorded any variable.

    Parameters
    ----------
    store : Path
        Zarr store with a dimension ``case``.
    folder : Path
        Where to write ``sweep.png``.
    variable : str or None
        What to draw; None for the estimated damage where there is a detector, else what was recorded first.
    varied : sequence of str
        Coordinates that differ from case to case, for the titles.

    Raises
    ------
    ResultsError
        There is no such variable.
    """
    with open_cases(store) as data:
        names = [name for name, each in variables_of(data).items() if "time" in each.dims]
        if not names:
            return []
        damages = [f"{detector}.damage" for detector in find_all(data, "detector")]
        name = variable or next((each for each in damages if each in names), names[0])
        require(name in names, f"no case recorded {name!r}. {suggest(name, names)}", ResultsError)
        detector, _, what = name.partition(".")
        true = true_damage(data) if what == "damage" and detector in find_all(data, "detector") else ""
        judged = [f"{detector}.{each}" for each in WATCHED if f"{detector}.{each}" in data]
        panels = case_panels(data[name], varied, data[judged] if judged else None, data.get(true))
        return save_charts({Path(PICTURE).stem: panels}, folder)


def case_panels(
    values: xr.DataArray, varied: Sequence[str], judged: xr.Dataset | None = None, true: xr.DataArray | None = None
) -> Panels:
    """Draw a variable with the dimensions ``case``, ``time`` and perhaps one more, a panel per case; damage in percent.

    ``judged`` is what the detector says of its windows: last values that are no valid judgement are grey. Diamonds are the
    values of ``true``, of the dimensions of the variable, when the last window ended.
    """
    stride = -(-values.sizes["case"] // PANELS)
    drawn = values.isel(case=slice(None, None, stride)).load()
    many = values.ndim > 2 and values.shape[-1] > len(COLORS)  # drawn as bars of the last values, not over time
    detector, _, what = str(values.name).rpartition(".")
    percent = what in ("damage", "deviation") and values.attrs.get("units", "1") == "1"
    factor, unit = (100.0, "%") if percent else (1.0, values.attrs.get("units", "1"))
    charts = []
    for _, case in drawn.groupby("case"):
        number, own = case["case"].item(), factor * case.squeeze("case")
        known = xr.Dataset() if judged is None else judged.sel(case=number).dropna("time", how="all")
        last = known.get(f"{detector}.valid", xr.DataArray([1.0]))[-1:]
        if many:
            truth = None if true is None else factor * true.sel(case=number)
            traces = _last_values(own, truth, known, is_valid=bool((last > 0.5).all()))
        else:
            elements = own if own.ndim > 1 else own.expand_dims({"": [what]}, axis=1)
            labels = elements[elements.dims[1]].to_numpy()
            traces = [curve(str(each), own["time"], elements[:, k], f"@{k}") for k, each in enumerate(labels)]
        given = ", ".join(f"{name.rpartition('.')[2]}={_short(case[name].item())}" for name in varied)
        x, y = (str(values.dims[-1]) if many else "time [s]"), f"{what} [{unit}]"
        layout = {"showlegend": values.ndim > 2} | ({"xaxis": {"dtick": 1}} if many else {})
        charts.append(Chart(f"{number}: {given}" if given else str(number), x, y, traces, layout=layout))
    columns = math.ceil(math.sqrt(len(charts)))
    rows = -(-len(charts) // columns)
    some = "" if stride == 1 else f", one in {stride} of {values.sizes['case']} cases"
    title = f"{'last ' * many}{values.name}{some}"
    return Panels(charts, (2.4 * columns + 1.4, 1.9 * rows + 1.2), columns, title=title, shared=True)


def _last_values(own: xr.DataArray, true: xr.DataArray | None, known: xr.Dataset, *, is_valid: bool) -> list[Trace]:
    ended, traces = own.dropna("time", how="all"), []
    if ended.sizes["time"]:
        places = ended[own.dims[1]].to_numpy()
        traces.append(bars("estimated", places, ended[-1], "@0" if is_valid else "@grey"))
    if true is not None and (truth := true.dropna("time", how="all")).sizes["time"]:
        row = [-1, *(changes(known) if "time" in known.sizes else ())][-1]
        places = truth[true.dims[1]].to_numpy()
        traces.append(points("true", places, truth[row], "@1", symbol="diamond-open"))
    if not is_valid:
        middle = float(own[own.dims[1]].mean())
        traces.append(words([middle], [0.5 * float(own.max())], ["not valid"]))
    return traces


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
