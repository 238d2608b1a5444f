"""Where on the membrane the recorded values belong: zones, nodes and sensors as coordinates of a dataset.

Symbols: ``x``, ``y`` from the corner of the stretched square at the origin [m]; a row of zones runs along x, row 1 at y = 0.
Of a membrane from a mesh ``x``, ``y``, ``z`` are those of its mesh [m], without strain.
"""

from __future__ import annotations

import json
import math
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..fmi.shape import Array, Surface
from .dataset import PLACES, find_all, is_whole, parameters_of, variables_of
from .files import load_results
from .shapes import load_shapes


def side(data: xr.Dataset) -> tuple[float, str]:
    """Return the side of the stretched square and its unit; 1 and "side" if its parameters are not known."""
    membrane = next(iter(find_all(data, "membrane")), "")
    known = parameters_of(data, membrane)
    for name in ("side_length", "edge_displacement"):
        if f"{membrane}.{name}" in data.data_vars:
            known[name] = float(data[f"{membrane}.{name}"][0])
    length = known.get("side_length", math.nan) + 2.0 * known.get("edge_displacement", math.nan)
    return (1.0, "side") if math.isnan(length) else (length, "m")


def with_places(data: xr.Dataset, folder: Path | None = None) -> xr.Dataset:
    """Give results the places of zones, sensors and nodes.

    Parameters
    ----------
    data : xarray.Dataset
        Results, as ``load_results`` gives them, or those of a sweep, with a dimension ``case``.
    folder : Path, optional
        Folder of the run, or of one of the cases, where the shape of a membrane from a mesh may be.

    Returns
    -------
    xarray.Dataset
        The same values. The dimension ``zone`` of what the membrane and the detectors give by zone has coordinates
        ``row``, ``column`` and the centre ``zone_x``, ``zone_y``; the dimension ``sensor`` of the membrane's strain
        ``sensor_x``, ``sensor_y``, where the run recorded its shape; its deflection ``w`` the dimensions ``x`` and
        ``y``. Of a membrane from a mesh file, zones have the centres ``zone_x``, ``zone_y``, ``zone_z`` of its mesh, and
        sensors the same three, where the run recorded its shape. What was recorded of some zones or sensors only has no
        places. Places are in parts of the side, of unit 1, where the results do not say how long it is.
    """
    found = {role: find_all(data, role) for role in ("membrane", "detector")}
    meshes = _meshes(data, folder, found["membrane"])
    found["membrane"] = [name for name in found["membrane"] if name not in meshes]
    if meshes and not found["membrane"]:
        return _on_mesh(data, folder, meshes[0], found["detector"])
    membrane = next(iter(found["membrane"]), "")
    of_zones = [name for role, names in found.items() for name in _of_zones(data, role, names)]
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
    if strain in data and len(_places(data[strain])) == 1 and is_whole(data[strain]):
        changed[strain], gauges = _renamed(data[strain], "sensor"), data[strain].shape[-1]
        coordinates["sensor"] = ("sensor", np.arange(1, gauges + 1), {"long_name": "sensor"})
        history = None if folder is None else load_shapes(folder).get(membrane)
        if history is not None and len(history.surface.sensor_points) == gauges:
            coordinates |= _coordinates("sensor", "the sensor", history.surface.sensor_points[:, :2])
    heights = f"{membrane}.w"
    if heights in data and len(_places(data[heights])) == 2 and is_whole(data[heights]):
        changed[heights] = _renamed(data[heights], "x", "y")
        for axis, nodes in zip("xy", data[heights].shape[-2:], strict=True):
            described = metres | {"long_name": f"{axis} of the node"}
            coordinates[axis] = (axis, length * np.arange(1, nodes + 1) / (nodes + 1), described)
    if not changed and not coordinates:
        return data
    unused = {dim for name in changed for dim in _places(data[name])}
    unused -= {dim for name, each in variables_of(data).items() if name not in changed for dim in each.dims}
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


def _meshes(data: xr.Dataset, folder: Path | None, membranes: list[str]) -> list[str]:
    """List the membranes from meshes: those whose parameters are known and have no side."""
    fmus = data.attrs.get("fmus")
    if fmus is None and folder is not None:  # cases of a sweep differ in values, so the sweep says nothing of its FMUs
        fmus = load_results(folder).attrs.get("fmus")
    known = {name: each.get("parameters") for name, each in json.loads(fmus or "{}").items()}
    return [name for name in membranes if known.get(name) and "side_length" not in known[name]]


def _on_mesh(data: xr.Dataset, folder: Path | None, membrane: str, detectors: list[str]) -> xr.Dataset:
    """Give zones and sensors of a membrane from a mesh their places, where its shape was recorded."""
    history = None if folder is None else load_shapes(folder).get(membrane)
    if history is None:
        return data
    zones = _of_zones(data, "membrane", [membrane]) + _of_zones(data, "detector", detectors)
    coordinates: dict[str, Any] = {}
    for dim, what, names, places in (
        ("zone", "the centre of the zone", zones, _zone_centres(history.surface)),
        ("sensor", "the sensor", [f"{membrane}.strain"], history.surface.sensor_points),
    ):
        if any(name in data and data[name].dims[-1] == dim and is_whole(data[name], len(places)) for name in names):
            coordinates |= _coordinates(dim, what, places)
    return data.assign_coords(coordinates)


def _coordinates(dim: str, what: str, places: Array) -> dict[str, Any]:
    """Return places [m], shape (n, 2) or (n, 3), as coordinates along a dimension."""
    axes = zip("xyz"[: places.shape[1]], places.T, strict=True)
    return {f"{dim}_{axis}": (dim, values, {"units": "m", "long_name": f"{axis} of {what}"}) for axis, values in axes}


def _zone_centres(surface: Surface) -> Array:
    """Return the mean place of each zone by area of faces or length of segments [m], shape (zones, 3); without, none."""
    ends = np.where(surface.faces < 0, surface.faces[:, [2]], surface.faces)  # the last one of a triangle twice
    corners = surface.nodes[ends]
    a, b, c, d = np.swapaxes(corners, 0, 1)
    halves = [np.linalg.norm(np.cross(one - a, other - a), axis=1) / 2.0 for one, other in ((b, c), (c, d))]
    centres = halves[0][:, None] * (a + b + c) / 3.0 + halves[1][:, None] * (a + c + d) / 3.0
    start, end = np.swapaxes(surface.nodes[surface.segments], 0, 1)
    lengths = np.linalg.norm(end - start, axis=1)
    sizes, zone = np.concatenate([halves[0] + halves[1], lengths]), np.concatenate([surface.zone, surface.segment_zone])
    centres = np.concatenate([centres, lengths[:, None] * (start + end) / 2.0])
    with np.errstate(invalid="ignore"):
        found = [centres[zone == k].sum(axis=0) / sizes[zone == k].sum() for k in range(surface.zones)]
    return np.array(found).reshape(-1, 3)


def _of_zones(data: xr.Dataset, role: str, names: list[str]) -> list[str]:
    """List the recorded variables of components with a role that have a value for each zone."""
    found = [f"{name}.{variable}" for name in names for variable, place in PLACES[role].items() if place == "zone"]
    return [name for name in found if name in data and len(_places(data[name])) == 1]


def _places(array: xr.DataArray) -> tuple[Hashable, ...]:
    return tuple(dim for dim in array.dims if dim not in ("case", "time"))


def _renamed(array: xr.DataArray, *dims: str) -> xr.Variable:
    variable = array.variable.copy(deep=False)  # values on the disk stay there
    variable.dims = (*(dim for dim in array.dims if dim not in _places(array)), *dims)
    return variable
