"""Read a mesh file of any format that meshio knows."""

import io
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gossamer_files.inputs import keep
from gossamer_files.options import option
from numpy.typing import NDArray

from ..arrays import Vector
from ..errors import DataError, NotFiniteError, require

Integers = NDArray[np.int64]

QUADRILATERALS = ("quad", "quad8", "quad9")
LINES = ("line", "line3")
_IGNORED = ("vertex", *LINES)
_DIMENSION = {"vertex": 0, "line": 1, "line3": 1}  # of all others 2
MOST_ELEMENTS = 100_000
MOST_BYTES = 400 * MOST_ELEMENTS  # of a file; an element with its nodes takes 30 to 150 in the usual formats


@dataclass(frozen=True, eq=False)
class MeshFile:
    """What a mesh file holds of a surface.

    Attributes
    ----------
    name : str
        File name, for messages.
    nodes : ndarray, shape (N, 3)
        Positions [m].
    quadrilaterals : ndarray of int, shape (n, 4), (n, 8) or (n, 9)
        Corners counter-clockwise, then the middles of the sides, then the middle.
    triangles : ndarray of int, shape (k, 3)
        Corners counter-clockwise. Faces are numbered quadrilaterals first.
    faces, edges, points : dict
        Named groups: faces by number, sides as pairs of corners, nodes.
    """

    name: str
    nodes: Vector
    quadrilaterals: Integers
    triangles: Integers
    faces: dict[str, Integers]
    edges: dict[str, Integers]
    points: dict[str, Integers]


def read_mesh(path: Path, scale: float = 1.0) -> MeshFile:
    """Read the faces and the named groups of a mesh file.

    Parameters
    ----------
    path : Path
        Any format of meshio: gmsh (.msh), Abaqus (.inp), VTK (.vtu), ...
    scale : float
        Length of the file's unit [m].

    Returns
    -------
    MeshFile

    Raises
    ------
    DataError
        The file cannot be read, is too large, or holds other elements than quadrilaterals, linear triangles and lines.
    ModuleNotFoundError
        meshio is not installed.
    """
    try:
        import meshio  # an extra: only those who bring a mesh need it
    except ModuleNotFoundError:
        msg = "reading a mesh file needs meshio. Install it with: pip install meshio"
        raise ModuleNotFoundError(msg) from None
    if not path.is_file():
        msg = f"there is no mesh file {path}. Check {option('mesh')}, or the key mesh of the setup."
        raise DataError(msg)
    if path.suffix.lower() not in meshio.extension_to_filetypes:
        msg = f"meshio knows no format with the ending {path.suffix!r} of {path.name}. Save it as .msh, .inp or .vtu."
        raise DataError(msg)
    if (size := path.stat().st_size) > MOST_BYTES:  # reading it would take minutes
        msg = f"{path.name} holds {size / 1e6:.0f} MB, far more than {MOST_ELEMENTS} elements. Mesh it more coarsely."
        raise DataError(msg)
    keep(path)
    try:
        with redirect_stdout(io.StringIO()):  # meshio prints an empty line beside a gmsh file
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio ends the program where a format's own reader fails
        msg = f"cannot read {path} as a mesh: {error or type(error).__name__}. Open it in gmsh and save it as .msh."
        raise DataError(msg) from error
    return _surface(path.name, mesh, scale)


def _surface(name: str, mesh: Any, scale: float) -> MeshFile:  # noqa: ANN401
    count = sum(len(cells.data) for cells in mesh.cells if cells.type not in _IGNORED)
    if count > MOST_ELEMENTS:
        msg = f"{name} holds {count} elements, more than {MOST_ELEMENTS}. Mesh it more coarsely."
        raise DataError(msg)
    kinds = {cells.type for cells in mesh.cells}
    others = sorted(kinds - {*QUADRILATERALS, "triangle", *_IGNORED})
    if others:
        advice = "A membrane is made of quad, quad8, quad9 and triangle; mesh the surface alone, with straight triangles."
        msg = f"{name} holds elements of type {', '.join(others)}. {advice}"
        raise DataError(msg)
    quads = [kind for kind in QUADRILATERALS if kind in kinds]
    require(len(quads) < 2, f"{name} mixes quadrilaterals of types {', '.join(quads)}. Use one of them.", DataError)
    cells = mesh.cells_dict
    if not quads and "triangle" not in cells:
        msg = f"{name} holds no faces (quadrilaterals or triangles). Mesh the surface, not only its edges."
        raise DataError(msg)
    quadrilaterals = _integers(cells.get(quads[0]) if quads else None, 4)
    triangles = _integers(cells.get("triangle"), 3)
    faces, edges, points = {}, {}, {key: _integers(value, 1).ravel() for key, value in mesh.point_sets.items()}
    tags = mesh.cell_data_dict.get("gmsh:physical", {})  # of gmsh's format 2, where meshio makes no sets of them
    physical = {
        key: {kind: np.flatnonzero(values == tag) for kind, values in tags.items() if _DIMENSION.get(kind, 2) == dimension}
        for key, (tag, dimension) in mesh.field_data.items()
    }
    for key, members in (physical | mesh.cell_sets_dict).items():
        if key.startswith("gmsh:"):
            continue
        found = [_integers(members[kind], 1).ravel() for kind in quads if kind in members]
        if "triangle" in members:
            found.append(_integers(members["triangle"], 1).ravel() + len(quadrilaterals))
        if sum(map(len, found)):
            faces[key] = np.concatenate(found)
        sides = [_integers(cells[kind], 2)[_integers(members[kind], 1).ravel(), :2] for kind in LINES if kind in members]
        if sum(map(len, sides)):
            edges[key] = np.concatenate(sides)
        if len(members.get("vertex", ())):
            points[key] = _integers(cells["vertex"], 1).ravel()[_integers(members["vertex"], 1).ravel()]
    nodes = np.zeros((len(mesh.points), 3))
    nodes[:, : mesh.points.shape[1]] = mesh.points * scale
    if not np.all(np.isfinite(nodes)):
        msg = f"{name} holds a node whose position is not a finite number. Mesh it again."
        raise NotFiniteError(msg)
    return MeshFile(name, nodes, quadrilaterals, triangles, faces, edges, points)


def _integers(values: Any, columns: int) -> Integers:  # noqa: ANN401
    found = np.zeros((0, columns)) if values is None else np.asarray(values)
    return found.astype(np.int64)
