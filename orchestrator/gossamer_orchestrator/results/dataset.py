"""Results as an xarray Dataset, and the parts that its components play; ``columns`` says how columns become variables.

A component is the membrane, a sensor, a compensator or the detector if its FMU's model name says so. In results without
model names, such as a CSV file, the name of the component counts.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..errors import ResultsError
from ..names import split_endpoint, split_indices
from ..scenario.plan import Plan
from .columns import RecordedScalar, attributes, group, plan_columns


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
    if not found:
        msg = f"no component is a {role}. A {role} is an FMU with the model name {role!r}."
        raise ResultsError(msg)
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


def parameters_of(data: xr.Dataset, component: str) -> dict[str, float]:
    """Return the parameters of a component as they were recorded with the run."""
    return dict(json.loads(data.attrs.get("fmus", "{}")).get(component, {}).get("parameters", {}))
