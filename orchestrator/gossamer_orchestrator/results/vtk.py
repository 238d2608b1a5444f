"""Results for ParaView: of each membrane a file ``NAME.pvd`` that names one ``NAME_0000.vtu`` for each instant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import xarray as xr
from gossamer_files import replacing
from numpy.typing import NDArray

from ..errors import ResultsError, writing
from ..fmi.shape import Array, Surface
from .dataset import find_all, is_whole
from .files import make_folder
from .judgements import windows_of
from .shapes import ShapeHistory, face_strains


def export_vtk(data: xr.Dataset, shapes: Mapping[str, ShapeHistory], folder: Path) -> list[Path]:
    """Write the shapes of all membranes of a run.

    Parameters
    ----------
    data : xarray.Dataset
        Results.
    shapes : mapping of str to ShapeHistory
        As ``load_shapes`` reads them.
    folder : Path
        Where to write; made if needed.

    Returns
    -------
    list of Path
        The ``.pvd`` files.

    Raises
    ------
    ResultsError
        There is no membrane to draw, meshio is not installed, or the folder cannot be written.
    """
    if not shapes:
        msg = "no membrane can be drawn: the run recorded no shapes. Run it again with [record] frames above 0."
        raise ResultsError(msg)
    make_folder(folder)
    return [_write(data, name, history, folder) for name, history in shapes.items()]


def _write(data: xr.Dataset, name: str, history: ShapeHistory, folder: Path) -> Path:
    path = folder / f"{name}.pvd"
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ElementTree.SubElement(root, "Collection")
    for old in folder.glob(f"{name}_*.vtu"):  # of an earlier export, which may have had more
        old.unlink()
    for k, time in enumerate(history.time):
        file = folder / f"{name}_{k:04d}.vtu"
        _write_instant(file, data, name, history, k)
        ElementTree.SubElement(collection, "DataSet", timestep=repr(float(time)), part="0", file=file.name)
    with writing(path, ResultsError), replacing(path) as new:
        ElementTree.ElementTree(root).write(new, encoding="utf-8", xml_declaration=True)
    return path


def write_surface(
    path: Path, surface: Surface, places: Array, of_nodes: Mapping[str, Array], of_faces: Mapping[str, NDArray[Any]]
) -> None:
    """Write a membrane, its nodes at some places [m], as a ``.vtu`` file, with values by name.

    Raises
    ------
    ResultsError
        meshio is not installed, or the file cannot be written.
    """
    try:
        import meshio
    except ModuleNotFoundError:
        msg = "files for ParaView need meshio, which is not installed. Install it with 'pip install meshio'."
        raise ResultsError(msg) from None
    known = {"zone": np.append(surface.zone, surface.segment_zone) + 1, "region": surface.region_of_setup + 1} | dict(
        of_faces
    )
    known["element"] = surface.element + 1
    triangle, line = surface.faces[:, 3] < 0, np.full(len(surface.segments), True)
    blocks = [("quad", ~triangle, 4), ("triangle", triangle, 3)]
    cells = [(kind, surface.faces[some, :corners]) for kind, some, corners in blocks if some.any()]
    data = {what: [values[: len(triangle)][some] for _, some, _ in blocks if some.any()] for what, values in known.items()}
    if line.any():
        cells.append(("line", surface.segments))
        for what, values in known.items():
            data[what].append(_of_segments(values[len(triangle) :], len(line), values.dtype))
    mesh = meshio.Mesh(places, cells, point_data=dict(of_nodes), cell_data=data)
    with writing(path, ResultsError), replacing(path) as new:
        mesh.write(new, file_format="vtu")


def _of_segments(values: NDArray[Any], count: int, kind: np.dtype[Any]) -> NDArray[Any]:
    """Return values of segments; where there are none, 0, or of floats not a number."""
    return values if len(values) else np.full(count, np.nan if kind.kind == "f" else 0, dtype=kind)


def _write_instant(path: Path, data: xr.Dataset, name: str, history: ShapeHistory, k: int) -> None:
    surface, places = history.surface, history.places[k]
    strains = face_strains(surface, places, history.eigenstrain[k])
    of_faces: dict[str, NDArray[Any]] = {"largest_strain": strains.largest, "wrinkle": strains.mark}
    of_faces |= {what: _on_faces(surface, values) for what, values in _damages(data, name, float(history.time[k]))}
    write_surface(path, surface, places, {"displacement": places - surface.nodes}, of_faces)


def _on_faces(surface: Surface, values: Array) -> Array:
    """Spread values of the zones over faces, then segments; not a number where no zone is, or none of that number."""
    zone = np.append(surface.zone, surface.segment_zone)
    return np.append(values, np.nan)[np.where(zone < len(values), zone, -1)]


def _damages(data: xr.Dataset, membrane: str, time: float) -> Iterator[tuple[str, Array]]:
    """Give the true damage of the zones at a time, and that of the last valid judgement before it, as far as recorded."""
    if f"{membrane}.damage" in data and is_whole(data[f"{membrane}.damage"]):
        row = int(np.searchsorted(data["time"].to_numpy(), time * (1.0 + 1e-12) + 1e-12, side="right")) - 1
        yield "true_damage", data[f"{membrane}.damage"].isel(time=max(row, 0)).to_numpy().ravel()
    if membrane != next(iter(find_all(data, "membrane")), None):
        return
    ended = windows_of(data)
    valid = [window for window in ended if window.valid and window.time <= time + 1e-12]
    if ended:
        estimated = valid[-1].estimated if valid else np.full_like(ended[0].estimated, np.nan)
        yield "estimated_damage", estimated
