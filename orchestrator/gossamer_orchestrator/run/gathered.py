"""What the cases of a sweep recorded, gathered: a Zarr store with a dimension ``case``, and a table with a row for each."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from gossamer_files import replacing

from ..errors import ResultsError, writing
from ..results.files import NETCDF, load_results
from ..scenario.schema import Given
from .sweep import Case

TABLE, STORE = "cases.csv", "sweep.zarr"


def combine(cases: Sequence[Case], out: Path) -> Path | None:
    """Write what the cases recorded to a Zarr store; return it, None without any results.

    Every recorded variable has the dimension ``case``, whose coordinate is the number of the case; what varies is a
    coordinate along it. Where cases differ in length, the shorter ones end in values that are not a number.
    """
    there = [case for case in cases if (out / case.name / NETCDF).is_file()]
    if not there:
        return None
    each = [load_results(out / case.name).chunk() for case in there]
    data = xr.concat(each, "case", join="outer", combine_attrs="drop_conflicts")
    data = data.assign_coords(case=[case.number for case in there])
    values = {name: ("case", np.array([_cell(case.values[name]) for case in there])) for name in cases[0].values}
    shutil.rmtree(out / STORE, ignore_errors=True)
    with writing(out / STORE, ResultsError):
        data.assign_coords(values).to_zarr(out / STORE, mode="w", consolidated=False)
    return out / STORE


def write_table(cases: Sequence[Case], ended: Sequence[str], out: Path) -> Path:
    """Write a row per case: what varies, how it ended, and the last value of each scalar that was recorded."""
    last = [_last(out / case.name) for case in cases]
    names = list(dict.fromkeys(name for values in last for name in values))
    with writing(out / TABLE, ResultsError), replacing(out / TABLE) as new, new.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["case", *cases[0].values, "ended", *(f"last {name}" for name in names)])
        for case, text, values in zip(cases, ended, last, strict=True):
            given = map(_cell, case.values.values())
            rows.writerow([case.number, *given, text, *(values.get(name, "") for name in names)])
    return out / TABLE


def _last(folder: Path) -> dict[str, float]:
    """Return the last value of each scalar with its unit in the name; nothing where there are no results."""
    if not (folder / NETCDF).is_file():
        return {}
    with load_results(folder) as data:
        scalars = {str(name): each for name, each in data.data_vars.items() if each.dims == ("time",) and each.size}
        return {
            f"{name} [{unit}]" if (unit := each.attrs.get("units")) else name: float(each[-1])
            for name, each in scalars.items()
        }


def _cell(value: Given) -> bool | int | float | str:
    return json.dumps(value) if isinstance(value, list) else value
