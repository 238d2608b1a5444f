"""Where on the membrane the recorded values belong: zones, nodes and sensors as coordinates of a dataset.

Symbols: ``x``, ``y`` from the corner of the stretched square at the origin [m]; a row of zones runs along x, row 1 at y = 0.
"""

from __future__ import annotations

import json
import math
from collections.abc import Hashable
from typing import Any

import numpy as np
import xarray as xr

from .columns import PLACES
from .plots.axes import side
from .report.membrane import SENSORS
from .roles import find_all, is_whole


def with_places(data: xr.Dataset) -> xr.Dataset:
    """Give results the places of zones, sensors and nodes.

    Parameters
    ----------
    data : xarray.Dataset
        Results, as ``load_results`` gives them, or those of a sweep, with a dimension ``case``.

    Returns
    -------
    xarray.Dataset
        The same values. The dimension ``zone`` of what the membrane and the detectors give by zone has coordinates
        ``row``, ``column`` and the centre ``zone_x``, ``zone_y``; the dimension ``sensor`` of the membrane's strain
        ``sensor_x``, ``sensor_y``; its deflection ``w`` the dimensions ``x`` and ``y``. A membrane from a mesh file, and
        what was recorded of some zones or sensors only, have no places. Places are in parts of the side, of unit 1, where
        the results do not say how long it is.
    """
    found = {"membrane": _squares(data), "detector": find_all(data, "detector")}
    membrane = next(iter(found["membrane"]), "")
    zones = [
        f"{name}.{variable}"
        for role, names in found.items()
        for name in names
        for variable, place in PLACES[role].items()
        if place == "zone"
    ]
    of_zones = [name for name in zones if name in data and len(_places(data[name])) == 1]
    count = max((data[name].shape[-1] for name in of_zones), default=0)
    width, (length, unit) = math.isqrt(count), side(data)
    metres = {"units": unit if unit == "m" else "1"}
    changed: dict[str, xr.Variable] = {}
    coordinates: dict[str, Any] = {}
    for name in of_zones:
        if width**2 == count and is_whole(data[name], count):
            changed[name] = _renamed(data[name], "zone")
    if changed:
        coordinates |= zone_places(width, length, metres)
        coordinates["zone"] = ("zone", np.arange(1, count + 1), {"long_name": "zone"})
    strain = f"{membrane}.strain"
    if strain in data and len(_places(data[strain])) == 1 and is_whole(data[strain], len(SENSORS)):
        changed[strain] = _renamed(data[strain], "sensor")
        coordinates["sensor"] = ("sensor", np.arange(1, len(SENSORS) + 1), {"long_name": "sensor"})
        for axis, values in zip("xy", zip(*SENSORS, strict=True), strict=True):
            described = metres | {"long_name": f"{axis} of the sensor"}
            coordinates[f"sensor_{axis}"] = ("sensor", length / 3.0 * np.array(values), described)
    heights = f"{membrane}.w"
    if heights in data and len(_places(data[heights])) == 2 and is_whole(data[heights]):
        changed[heights] = _renamed(data[heights], "x", "y")
        for axis, nodes in zip("xy", data[heights].shape[-2:], strict=True):
            described = metres | {"long_name": f"{axis} of the node"}
            coordinates[axis] = (axis, length * np.arange(1, nodes + 1) / (nodes + 1), described)
    unused = {dim for name in changed for dim in _places(data[name])}
    unused -= {dim for name in data.data_vars if name not in changed for dim in data[name].dims}
    rest = data.drop_vars([*changed, *(dim for dim in unused if dim in data.coords)])
    rest = rest.rename(
        {
            dim: f"{dim}_index"
            for dim in ("zone", "sensor")
            if dim in coordinates and dim in rest.dims and not np.array_equal(rest[dim], coordinates[dim][1])
        }
    )
    return rest.assign(changed).assign_coords(coordinates)[list(data.data_vars)]


def zone_places(width: int, length: float, units: dict[str, str]) -> dict[str, Any]:
    """Return row, column and centre of the zones of a square with ``width`` zones along a side, for a dimension ``zone``."""
    row, column = np.divmod(np.arange(width**2), width)
    return {
        "row": ("zone", row + 1, {"long_name": "row of the zone, 1 at y = 0"}),
        "column": ("zone", column + 1, {"long_name": "column of the zone, 1 at x = 0"}),
        "zone_x": ("zone", length * (column + 0.5) / width, units | {"long_name": "x of the centre of the zone"}),
        "zone_y": ("zone", length * (row + 0.5) / width, units | {"long_name": "y of the centre of the zone"}),
    }


def _squares(data: xr.Dataset) -> list[str]:
    """List the square membranes: all but those whose parameters are known and have no side."""
    fmus = json.loads(data.attrs.get("fmus", "{}"))
    known = {name: fmus.get(name, {}).get("parameters") for name in find_all(data, "membrane")}
    return [name for name, parameters in known.items() if not parameters or "side_length" in parameters]


def _places(array: xr.DataArray) -> tuple[Hashable, ...]:
    return tuple(dim for dim in array.dims if dim not in ("case", "time"))


def _renamed(array: xr.DataArray, *dims: str) -> xr.Variable:
    variable = array.variable.copy(deep=False)  # values on the disk stay there
    variable.dims = (*(dim for dim in array.dims if dim not in _places(array)), *dims)
    return variable
