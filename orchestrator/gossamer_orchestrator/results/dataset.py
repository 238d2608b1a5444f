"""Results as an xarray Dataset.

A scalar variable ``deflection`` of component ``membrane`` becomes ``membrane.deflection`` over ``time``. The elements
``strain[1]`` to ``strain[4]`` become one ``membrane.strain`` over ``time`` and ``strain_index``, labelled 1 to 4; ``w[2,3]``
lies at ``w_i = 2``, ``w_j = 3``. Units and descriptions are attributes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from importlib.metadata import PackageNotFoundError, version
from os.path import commonprefix
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..names import split_endpoint, split_indices
from ..scenario.plan import ComponentPlan, Plan

SCHEMA, VERSION = "gossamer.results", 1


def make_dataset(
    plan: Plan,
    time: NDArray[np.float64],
    table: NDArray[np.float64],
    **attributes: Any,  # noqa: ANN401
) -> xr.Dataset:
    """Arrange what was recorded, with units, descriptions and provenance.

    Parameters
    ----------
    plan : Plan
        What was run.
    time : numpy.ndarray, shape (n,)
        Recorded points [s].
    table : numpy.ndarray, shape (n, len(plan.columns))
        What was recorded there.
    **attributes
        More attributes of the dataset, for instance how the run ended.
    """
    labels = []
    for component, name in plan.columns:
        fmu = plan.component(component).fmu
        labels.append((f"{component}.{name}", fmu.unit(name) or "1", fmu.variables[name].description or ""))
    data = arrange(time, table, labels)
    scenario = plan.scenario
    data.attrs = {
        "schema": SCHEMA,
        "version": VERSION,
        "title": scenario.title,
        "scenario_name": scenario.name,
        "scenario": scenario.source.text,
        "step": scenario.step,
        "master": scenario.master,
        "fmus": json.dumps(
            {name: _provenance(plan.component(name)) for name in scenario.components}, default=bytes.hex
        ),
        "connections": json.dumps([(c.origin, c.target) for c in plan.connections]),
        "versions": json.dumps({name: _version(name) for name in ("gossamer", "FMPy", "numpy")}),
    } | attributes
    return data


def _provenance(component: ComponentPlan) -> dict[str, Any]:
    """Describe a component: its FMU, what the scenario set, and all Real parameters with their values."""
    fmu, start = component.fmu, component.start
    values = {v: start.get(v, fmu.variables[v].start) for v in fmu.names("parameter", kind="Real")}
    return {
        "file": fmu.path.name,
        "model": fmu.description.modelName,
        "guid": fmu.description.guid,
        "start": start,
        "parameters": {v: float(value) for v, value in values.items() if value is not None},
    }


def arrange(
    time: NDArray[np.float64], table: NDArray[np.float64], labels: Iterable[tuple[str, str, str]]
) -> xr.Dataset:
    """Group the columns of a table into variables; ``labels`` are name, unit and description of each column."""
    groups: dict[str, list[tuple[tuple[int, ...], int, str, str]]] = {}
    for column, (name, unit, description) in enumerate(labels):
        base, place = split_indices(name)
        if base in groups and len(groups[base][0][0]) != len(place):
            base = name
        groups.setdefault(base, []).append((place, column, unit, description))
    coordinates: dict[str, Any] = {"time": ("time", time, {"units": "s", "long_name": "time"})}
    variables: dict[str, Any] = {}
    for base, members in groups.items():
        places, columns, units, descriptions = zip(*members, strict=True)
        axes, rank = [sorted(set(indices)) for indices in zip(*places, strict=True)], len(places[0])
        dims = []
        for axis, values in enumerate(axes):
            suffix = "index" if rank == 1 else "ijk"[axis] if rank <= 3 else str(axis)
            dim = f"{split_endpoint(base)[1]}_{suffix}"
            if dim in coordinates and list(coordinates[dim][1]) != values:
                dim = f"{base}_{suffix}"
            coordinates[dim] = (dim, np.array(values, dtype=np.int32))
            dims.append(dim)
        array = np.full((len(time), *(len(values) for values in axes)), np.nan)
        for place, column in zip(places, columns, strict=True):
            element: list[Any] = [values.index(i) for values, i in zip(axes, place, strict=True)]
            array[(slice(None), *element)] = table[:, column]
        variables[base] = (("time", *dims), array, {"units": units[0], "long_name": _common(descriptions)})
    return xr.Dataset(variables, coords=coordinates)


def _common(descriptions: Sequence[str]) -> str:
    """Return what the descriptions of all elements begin with, in whole words."""
    if len(set(descriptions)) == 1:
        return descriptions[0]
    common = commonprefix(list(descriptions))  # noqa: RUF071
    begin = re.sub(r"[^\w)]+$", "", common[: common.rfind(" ") + 1])
    return f"{begin} .." if begin else ""


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
