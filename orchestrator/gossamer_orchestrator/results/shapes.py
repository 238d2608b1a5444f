"""The shapes of the membranes of a run on disk, ``shapes.nc``, and the strain of their faces.

``shapes.nc``, netCDF 3, lies beside ``results.nc``. For each membrane that can be drawn, ``NAME.shape`` over time, node and
axis holds the places of the nodes [m] at some instants, those of a square from its corner, and ``NAME.eigenstrain`` the
strain beyond the geometry. ``NAME.nodes``, ``NAME.faces`` and so on are its ``Surface``. As with ``results.nc``,
``unfinished_shapes.nc`` takes the place of ``shapes.nc`` while a run goes on, and is whole at any time.

Symbols: ``T`` and ``t`` tangents in the reference and now [m], ``R`` reference tangents by local axes, ``g`` = t R^-1
the deformation gradient, ``E`` = (g^T g - I)/2 the Green-Lagrange strain, ``E1`` >= ``E2`` principal values, ``nu``
Poisson's ratio. All at the centre of each face: exact for triangles of constant strain, of second order for
quadrilaterals.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import ResultsError, check_path, writing
from ..fmi.shape import Array, Integers, Surface
from .files import UNFINISHED_NETCDF, results_in
from .netcdf import GrowingFile, Layout

TAUT, WRINKLED, SLACK = 0, 1, 2
_NO_STRAIN = 1e-9  # [1], of rounding


class FaceStrains(NamedTuple):
    """What the faces strain, arrays of shape (n,).

    Attributes
    ----------
    largest : ndarray
        Largest principal nominal strain of the geometry [1].
    mark : ndarray of int
        ``TAUT``, ``WRINKLED`` or ``SLACK``.
    """

    largest: Array
    mark: Integers


def face_strains(surface: Surface, places: Array, eigenstrain: Array) -> FaceStrains:
    r"""Measure the faces.

    Parameters
    ----------
    surface : Surface
        The membrane without strain.
    places : ndarray, shape (N, 3)
        Where its nodes are [m].
    eigenstrain : ndarray, shape (R, 3)
        Strain beyond the geometry [1]: along the first axis, across, shear.

    Notes ----- The mixed criterion of [1]_ on the strain with the eigenstrain: slack where :math:`E_1 \le 0`; else
    wrinkled where the smaller principal stress of Hooke's law, :math:`\propto E_2 + \nu E_1`, is negative; else taut.
    Damage changes no sign.

    References
    ----------
    .. [1] D. G. Roddeman et al., Journal of Applied Mechanics 54(4), 884-887, 1987, doi:10.1115/1.3173133.
    """
    T, t = _tangents(surface, surface.nodes), _tangents(surface, places)
    R = _local_axes(T, surface.direction[surface.region]) @ T
    g = t @ np.linalg.inv(R)
    E = (np.swapaxes(g, 1, 2) @ g - np.eye(2)) / 2.0
    largest = np.sqrt(np.maximum(1.0 + 2.0 * _principal(E)[0], 0.0)) - 1.0
    along, across, shear = eigenstrain[surface.region].T
    E1, E2 = _principal(E + np.stack([np.stack([along, shear], axis=-1), np.stack([shear, across], axis=-1)], axis=1))
    wrinkled = E2 + surface.poisson_ratio[surface.region] * E1 < -_NO_STRAIN
    return FaceStrains(largest, np.where(wrinkled, np.where(E1 <= 0.0, SLACK, WRINKLED), TAUT))


def _tangents(surface: Surface, places: Array) -> Array:
    """Return the derivatives of the places by the parent coordinates at the centres, shape (n, 3, 2)."""
    a, b, c, d = (places[surface.faces[:, k]] for k in range(4))
    triangle = (surface.faces[:, 3] < 0)[:, None]
    s = np.where(triangle, b - a, (b + c - a - d) / 2.0)
    t = np.where(triangle, c - a, (c + d - a - b) / 2.0)
    return np.stack([s, t], axis=-1)


def _local_axes(T: Array, direction: Array) -> Array:
    """Return the first local axis, a direction projected on the faces, and the second, shape (n, 2, 3)."""
    normal = np.cross(T[..., 0], T[..., 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    first = direction - np.sum(direction * normal, axis=1, keepdims=True) * normal
    lost = np.linalg.norm(first, axis=1, keepdims=True) < 1e-6 * np.linalg.norm(direction, axis=1, keepdims=True)
    other = np.roll(direction, 1, axis=1)
    first = np.where(lost, other - np.sum(other * normal, axis=1, keepdims=True) * normal, first)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normal, first)], axis=1)


def _principal(E: Array) -> tuple[Array, Array]:
    """Return the principal values of symmetric matrices, the larger one first."""
    mean, half = (E[:, 0, 0] + E[:, 1, 1]) / 2.0, (E[:, 0, 0] - E[:, 1, 1]) / 2.0
    radius = np.hypot(half, E[:, 0, 1])
    return mean + radius, mean - radius


SHAPES, UNFINISHED_SHAPES = "shapes.nc", "unfinished_shapes.nc"
SCHEMA, VERSION = "gossamer.shapes", 1
_DIMS = {  # of what a surface holds, besides its name
    "nodes": ("node", "axis"),
    "faces": ("face", "corner"),
    "element": ("face",),
    "region": ("face",),
    "zone": ("face",),
    "poisson_ratio": ("region",),
    "direction": ("region", "axis"),
    "sensor_points": ("sensor", "axis"),
    "sensor_directions": ("sensor", "axis"),
    "segments": ("segment", "end"),
    "segment_zone": ("segment",),
    "part_of": ("region",),
}
_SHARED = {"axis": 3, "corner": 4}


@dataclass(frozen=True, eq=False)
class ShapeHistory:
    """The shapes of one membrane.

    Attributes
    ----------
    surface : Surface
        What does not change.
    time : ndarray, shape (frames,)
        Instants [s].
    places : ndarray, shape (frames, N, 3)
        Places of the nodes [m].
    eigenstrain : ndarray, shape (frames, R, 3)
        Strain of the regions beyond the geometry [1]: along the first axis, across, shear.
    """

    surface: Surface
    time: Array
    places: Array
    eigenstrain: Array


Frame = Mapping[str, tuple[Array, Array]]


def pack_frame(time: float, frame: Frame) -> Array:
    """Return an instant as a row of the file."""
    return np.concatenate([[time], *[part.ravel() for pair in frame.values() for part in pair]])


def create_shapes(path: Path, surfaces: Mapping[str, Surface], time: float, frame: Frame) -> GrowingFile:
    """Start a file with its first instant; raise ``ResultsError`` if the disk does not take it."""
    from scipy.io import netcdf_file

    with writing(path, ResultsError), netcdf_file(path, "w", version=2) as file:
        file.schema, file.version_of_schema = SCHEMA, VERSION
        file.createDimension("time", None)
        for name, size in _SHARED.items():
            file.createDimension(name, size)
        for name, surface in surfaces.items():
            sizes = {"node": len(surface.nodes), "face": len(surface.faces), "region": len(surface.poisson_ratio)}
            sizes |= {"sensor": len(surface.sensor_points), "segment": len(surface.segments)}
            if len(surface.segments) and "end" not in file.dimensions:
                file.createDimension("end", 2)
            for dim, size in sizes.items():
                if size:  # 0 would be unlimited
                    file.createDimension(f"{name}_{dim}", size)
            for what, dims in _DIMS.items():
                values = getattr(surface, what)
                if values.size:
                    named = tuple(f"{name}_{dim}" if dim in sizes else dim for dim in dims)
                    file.createVariable(f"{name}.{what}", "i4" if values.dtype.kind == "i" else "f8", named)[:] = values
        file.createVariable("time", "f8", ("time",))[0] = time
        file.variables["time"].units = "s"
        for name, (places, eigenstrain) in frame.items():
            shape = file.createVariable(f"{name}.shape", "f8", ("time", f"{name}_node", "axis"))
            shape[0], shape.units = places, "m"
            strain = file.createVariable(f"{name}.eigenstrain", "f8", ("time", f"{name}_region", "axis"))
            strain[0], strain.units = eigenstrain, "1"
    return GrowingFile(path, _layout(path, pack_frame(time, frame).size))


def reopen_shapes(path: Path, width: int, count: int) -> GrowingFile:
    """Continue a file whose instants are so many numbers, after so many of them; raise ``ResultsError`` if it has fewer."""
    file = GrowingFile(path, _layout(path, width))
    file.resume(count)
    return file


def _layout(path: Path, width: int) -> Layout:
    """Find the first record: all that a file holds behind its header are records."""
    with writing(path, ResultsError), path.open("rb") as file:
        count = int.from_bytes(file.read(8)[4:], "big")
    begin = os.path.getsize(path) - 8 * width * max(count, 1)  # noqa: PTH202
    return Layout(begin, width, list(range(width)), {})


def settle_shapes(folder: Path, *, kept: bool) -> None:
    """Give the shapes of a run that has ended their name, or remove those of an earlier one."""
    with writing(folder / SHAPES, ResultsError):
        if kept and (folder / UNFINISHED_SHAPES).is_file():
            (folder / UNFINISHED_SHAPES).replace(folder / SHAPES)
            return
        (folder / UNFINISHED_SHAPES).unlink(missing_ok=True)
        if kept:
            (folder / SHAPES).unlink(missing_ok=True)


def load_shapes(results: Path) -> dict[str, ShapeHistory]:
    """Read the shapes beside results, by the names of the membranes; none if there are none.

    Parameters
    ----------
    results : Path
        Folder of a run, or one of its files.

    Raises
    ------
    ResultsError
        The file cannot be read, or another program wrote it.
    """
    check_path(results, ResultsError)
    folder = results if results.is_dir() else results.parent
    unfinished = (results_in(folder) if results.is_dir() else results).name == UNFINISHED_NETCDF
    path = folder / (UNFINISHED_SHAPES if unfinished else SHAPES)
    if not path.is_file():
        return {}
    from scipy.io import netcdf_file

    try:
        with netcdf_file(path, "r", mmap=False) as file:
            known = (getattr(file, "schema", b""), int(getattr(file, "version_of_schema", 0)))
            arrays = {
                name: np.array(variable.data, variable.data.dtype.newbyteorder("="))
                for name, variable in file.variables.items()
            }
    except (OSError, ValueError, TypeError, IndexError) as error:
        msg = f"cannot read shapes from {path}: {error}. Run the scenario again."
        raise ResultsError(msg) from error
    if known != (SCHEMA.encode(), VERSION):
        msg = f"{path} is no file of shapes, version {VERSION}, of this program. Run the scenario again."
        raise ResultsError(msg)
    names = [name.removesuffix(".shape") for name in arrays if name.endswith(".shape")]
    return {name: _history(arrays, name) for name in names}


def _history(arrays: Mapping[str, Any], name: str) -> ShapeHistory:
    empty = {"sensor_points": np.zeros((0, 3)), "sensor_directions": np.zeros((0, 3))}
    known = {field.name: arrays[f"{name}.{field.name}"] for field in fields(Surface) if f"{name}.{field.name}" in arrays}
    surface = Surface(**empty | known)
    return ShapeHistory(surface, arrays["time"], arrays[f"{name}.shape"], arrays[f"{name}.eigenstrain"])
