"""How the columns of a run become variables, and what is said about the run.

A scalar variable ``deflection`` of component ``membrane`` becomes ``membrane.deflection`` over ``time``. The elements
``gain[1]`` to ``gain[4]`` become one ``gain`` over ``time`` and ``gain_index``, labelled 1 to 4; ``w[2,3]`` lies at
``w_i = 2``, ``w_j = 3``. What membranes and detectors give by zone has the dimension ``zone``, a membrane's strain
``sensor``. Units and descriptions are attributes. Nothing here needs xarray, which the process of a simulation does without.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from os.path import commonprefix
from typing import Any, NamedTuple

from ..names import split_endpoint, split_indices
from ..scenario.plan import ComponentPlan, Plan
from ..scenario.schema import Connection

SCHEMA, VERSION = "gossamer.results", 1
UNFINISHED = "unfinished"
DETECTOR = "detector"  # model name of a detector
LIKENESS = ("similarity", "misfit")  # outputs of the detectors
WATCHED = ("damage", "deviation", "valid", "index", *LIKENESS)  # those that change when a window ends
_OF_MEMBRANES = {"damage": "zone", "strain": "sensor"}
PLACES = {  # what the elements of a variable belong to, by model name
    "membrane": _OF_MEMBRANES,
    "framed_membrane": _OF_MEMBRANES,
    "detector": {**_OF_MEMBRANES, **dict.fromkeys(("deviation", "probability", "index"), "zone")},
}


class RecordedScalar(NamedTuple):
    """One recorded scalar: ``component.variable``, its unit, its description, and the model name of its component."""

    name: str
    unit: str
    description: str
    model: str = ""


@dataclass(frozen=True)
class RecordedArray:
    """Columns that are one variable.

    Attributes
    ----------
    name : str
        Name without indices.
    dims : tuple of str
        Dimensions besides time.
    shape : tuple of int
        Their lengths.
    cells, columns : tuple of int
        Flat place in the variable of each of its columns, and where these stand in the table.
    unit, description : str
        As the FMU states them; what all descriptions begin with.
    """

    name: str
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    cells: tuple[int, ...]
    columns: tuple[int, ...]
    unit: str
    description: str

    @property
    def size(self) -> int:
        """Number of elements at one time."""
        return math.prod(self.shape)


def plan_columns(plan: Plan) -> list[RecordedScalar]:
    """Describe what a plan records."""
    described = []
    for component, name in plan.columns:
        fmu = plan.component(component).fmu
        about, model = fmu.variables[name].description or "", fmu.description.modelName
        described.append(RecordedScalar(f"{component}.{name}", fmu.unit(name) or "1", about, model))
    return described


def group(columns: Iterable[RecordedScalar]) -> tuple[list[RecordedArray], dict[str, list[int]]]:
    """Group columns into variables; return them and the labels of every dimension."""
    groups: dict[str, list[tuple[tuple[int, ...], int, RecordedScalar]]] = {}
    for number, column in enumerate(columns):
        base, place = split_indices(column.name)
        if base in groups and len(groups[base][0][0]) != len(place):
            base = column.name
        groups.setdefault(base, []).append((place, number, column))
    labels: dict[str, list[int]] = {}
    variables = []
    for base, members in groups.items():
        places, numbers, described = zip(*members, strict=True)
        axes, rank = [sorted(set(indices)) for indices in zip(*places, strict=True)], len(places[0])
        dims = []
        for axis, values in enumerate(axes):
            suffix = "index" if rank == 1 else "ijk"[axis] if rank <= 3 else str(axis)
            variable = split_endpoint(base)[1]
            own = f"{variable}_{suffix}"
            choice = [PLACES.get(described[0].model, {}).get(variable, own) if rank == 1 else own, own]
            dim = next((each for each in choice if labels.get(each, values) == values), f"{base}_{suffix}")
            labels[dim] = values
            dims.append(dim)
        orders = [{label: i for i, label in enumerate(values)} for values in axes]
        cells = []
        for place in places:
            cell = 0
            for order, index in zip(orders, place, strict=True):
                cell = cell * len(order) + order[index]
            cells.append(cell)
        variables.append(
            RecordedArray(
                name=base,
                dims=tuple(dims),
                shape=tuple(len(values) for values in axes),
                cells=tuple(cells),
                columns=numbers,
                unit=described[0].unit,
                description=_common([column.description for column in described]),
            )
        )
    return variables, labels


def attributes(plan: Plan) -> dict[str, Any]:
    """Describe a run: the scenario, its FMUs and what they were given, its connections, and versions."""
    scenario = plan.scenario
    return {
        "schema": SCHEMA,
        "version": VERSION,
        "title": scenario.title,
        "scenario_name": scenario.name,
        "scenario": scenario.source.text,
        "step": scenario.step,
        "record_every": scenario.record.every,
        "master": scenario.master,
        "fmus": json.dumps(
            {name: _provenance(plan.component(name)) for name in scenario.components}, default=bytes.hex
        ),
        "connections": json.dumps([_connection(c) for c in plan.connections]),
        "versions": json.dumps({name: _version(name) for name in ("gossamer", "FMPy", "numpy")}),
    }


def _provenance(component: ComponentPlan) -> dict[str, Any]:
    """Describe a component: its FMU, what the scenario set, all Real parameters with their values, and units of both."""
    fmu, start = component.fmu, component.start
    values = {v: start.get(v, fmu.variables[v].start) for v in fmu.names("parameter", kind="Real")}
    return {
        "file": fmu.path.name,
        "model": fmu.description.modelName,
        "guid": fmu.description.guid,
        "start": start,
        "parameters": {v: float(value) for v, value in values.items() if value is not None},
        "units": {v: unit for v in {**values, **start} if (unit := fmu.unit(v))},
    }


def _connection(connection: Connection) -> tuple[Any, ...]:
    """Describe a connection: its ends, and what it does to its signal unless that arrives as it is."""
    change = connection.model_dump(exclude={"origin", "target"}, exclude_defaults=True)
    return (connection.origin, connection.target, *([change] if change else []))


def _common(descriptions: Sequence[str]) -> str:
    """Return what the descriptions of all elements begin with, in whole words and without the place that follows."""
    if len(set(descriptions)) == 1:
        return descriptions[0]
    common = commonprefix(list(descriptions))  # noqa: RUF071
    begin = re.sub(r"[^\w)]+$", "", common[: common.rfind(" ") + 1])
    return re.sub(r",? (at|in|of|along|that)( zone| sensor| x)?$", "", begin)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
