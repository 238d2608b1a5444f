"""How the columns of a run become an xarray Dataset, what is said about the run, and the parts that its components play.

A scalar variable ``deflection`` of component ``membrane`` becomes ``membrane.deflection`` over ``time``. The elements
``gain[1]`` to ``gain[4]`` become one ``gain`` over ``time`` and ``gain_index``, labelled 1 to 4; ``w[2,3]`` lies at
``w_i = 2``, ``w_j = 3``. What membranes and detectors give by zone has the dimension ``zone``, a membrane's strain
``sensor``. Units and descriptions are attributes. The process of a simulation does without xarray.

A component is the membrane, a sensor, a compensator or the detector if its FMU's model name says so. In results without
model names, such as a CSV file, the name of the component counts.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from os.path import commonprefix
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ResultsError, require
from ..names import split_endpoint, split_indices
from ..scenario.plan import ComponentPlan, Plan
from ..scenario.schema import Connection

if TYPE_CHECKING:
    import xarray as xr

SCHEMA, VERSION = "gossamer.results", 1
UNFINISHED = "unfinished"
DETECTOR = "detector"  # model name of a detector
SETUP = "setup.json"  # what a membrane was built from, among the resources of its FMU
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
        shape = tuple(len(values) for values in axes)
        within = [np.searchsorted(values, indices) for values, indices in zip(axes, zip(*places, strict=True), strict=True)]
        variables.append(
            RecordedArray(
                name=base,
                dims=tuple(dims),
                shape=shape,
                cells=tuple(np.ravel_multi_index(within, shape).tolist()) if rank else (0,),
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
        "fmus": json.dumps({name: _provenance(plan.component(name)) for name in scenario.components}, default=bytes.hex),
        "connections": json.dumps([_connection(c) for c in plan.connections]),
        "versions": json.dumps({name: _version(name) for name in ("gossamer", "FMPy", "numpy")}),
    }


def _provenance(component: ComponentPlan) -> dict[str, Any]:
    """Describe a component: its FMU, what the scenario set, all Real parameters with their values, and units of both."""
    fmu, start = component.fmu, component.start
    values = {v: start.get(v, fmu.variables[v].start) for v in fmu.names("parameter", kind="Real")}
    setup = fmu.resource(SETUP)
    return {
        **({} if setup is None else {"setup": setup}),
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


def zone_label(name: str) -> str:
    """Return what stands for a zone after the word "zone": its name, or the number of one that is just numbered."""
    return name.removeprefix("zone_")


def zone_labels(data: xr.Dataset, count: int) -> list[str]:
    """Return what stands for each of some zones after the word "zone": names if a membrane was built from a setup."""
    for fmu in json.loads(data.attrs.get("fmus", "{}")).values():
        names = json.loads(fmu["setup"]).get("zone_names", ()) if "setup" in fmu else ()
        if len(names) == count:
            return [zone_label(name) for name in names]
    return [str(k + 1) for k in range(count)]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def make_dataset(
    plan: Plan,
    time: NDArray[np.float64],
    table: NDArray[np.float64],
    **more: Any,  # noqa: ANN401
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
    **more
        More attributes of the dataset, for instance how the run ended.
    """
    data = arrange(time, table, plan_columns(plan))
    data.attrs = attributes(plan) | more
    return data


def arrange(time: NDArray[np.float64], table: NDArray[np.float64], columns: Iterable[RecordedScalar]) -> xr.Dataset:
    """Group the columns of a table into variables."""
    import xarray as xr

    grouped, labels = group(columns)
    coordinates: dict[str, Any] = {"time": ("time", time, {"units": "s", "long_name": "time"})}
    coordinates |= {dim: (dim, np.array(values, dtype=np.int32)) for dim, values in labels.items()}
    variables: dict[str, Any] = {}
    for each in grouped:
        array = np.full((len(time), each.size), np.nan)
        array[:, each.cells] = table[:, each.columns]
        described = {"units": each.unit, "long_name": each.description}
        variables[each.name] = (("time", *each.dims), array.reshape(-1, *each.shape), described)
    return xr.Dataset(variables, coords=coordinates)


def effort_of(data: xr.Dataset) -> dict[str, dict[str, float]]:
    """Return what each component took of a run: ``seconds``, measured by samples, steps ``refused``, states ``restored``."""
    found: dict[str, dict[str, float]] = json.loads(data.attrs.get("effort") or "{}")
    return found


def variables_of(data: xr.Dataset) -> dict[str, xr.Variable]:
    """Return the recorded variables by name: ``data[name]`` takes longer the more of them there are."""
    return {str(name): data.variables[name] for name in data.data_vars}


def find_all(data: xr.Dataset, role: str) -> list[str]:
    """List the components with a role, "membrane", "sensor", "compensator" or "detector", in the order of the scenario."""
    fmus = json.loads(data.attrs.get("fmus", "{}"))
    components = dict.fromkeys([*fmus, *(split_endpoint(str(name))[0] for name in data.data_vars)])
    return [name for name in components if fmus.get(name, {}).get("model", name.rstrip("0123456789")) == role]


def find(data: xr.Dataset, role: str) -> str:
    """Return the first component with a role.

    Raises
    ------
    ResultsError
        There is none.
    """
    found = find_all(data, role)
    require(found, f"no component is a {role}. A {role} is an FMU with the model name {role!r}.", ResultsError)
    return found[0]


def need(data: xr.Dataset, *names: str) -> list[xr.DataArray]:
    """Return recorded variables; if one is missing, raise ``ResultsError`` with the way to record it."""
    missing = [name for name in names if name not in data.data_vars]
    if missing:
        msg = f"the results lack {', '.join(missing)}. Add it to [record] variables in the scenario and run it again."
        raise ResultsError(msg)
    return [data[name] for name in names]


def is_whole(values: xr.DataArray, count: int | None = None) -> bool:
    """Tell whether all elements of an array, from 1, were recorded: ``count`` of them, where it is known.

    A dimension whose labels are no numbers of elements, such as the places of nodes [m], has all of them.
    """
    dims = [dim for dim in values.dims if dim not in ("case", "time")]
    numbered = [values[dim].to_numpy() for dim in dims if dim in values.coords and values[dim].dtype.kind == "i"]
    from_one = all(np.array_equal(each, np.arange(1, len(each) + 1)) for each in numbered)
    return from_one and all(count in (None, values.sizes[dim]) for dim in dims)


def sensors(data: xr.Dataset) -> dict[int, str]:
    """Return the sensors by the number of the membrane's strain that they read; without connections, in order."""
    origins, membrane = origins_of(data), find(data, "membrane")
    found = {}
    for name in find_all(data, "sensor"):
        base, indices = split_indices(origins.get(f"{name}.strain", ""))
        if base == f"{membrane}.strain" and indices:
            found[indices[0]] = name
    return dict(sorted(found.items())) or dict(enumerate(find_all(data, "sensor"), start=1))


def compensators(data: xr.Dataset) -> dict[int, str]:
    """Return the compensators by the numbers of their sensors; without connections, in order."""
    origins, numbers = origins_of(data), {f"{name}.resistance": number for number, name in sensors(data).items()}
    ends = {origins.get(f"{name}.resistance", ""): name for name in find_all(data, "compensator")}
    found = {number: ends[end] for end, number in numbers.items() if end in ends}
    return found or dict(enumerate(find_all(data, "compensator"), start=1))


def origins_of(data: xr.Dataset) -> dict[str, str]:
    """Return the origin of every connected input."""
    return {target: origin for origin, target, *_ in json.loads(data.attrs.get("connections", "[]"))}


def parameters_of(data: xr.Dataset, component: str, what: str = "parameters") -> dict[str, float]:
    """Return the parameters of a component, or its "start", as recorded; none in results such as a CSV file."""
    return dict(json.loads(data.attrs.get("fmus", "{}")).get(component, {}).get(what, {}))
