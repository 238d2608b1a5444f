"""Read ``setup.toml`` and its mesh: keys and types are those of ``gossamer_models.mesh_membrane.Setup``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gossamer_models.mesh_membrane import (
    Edge,
    Gas,
    Load,
    Region,
    Sensor,
    Setup,
    Structure,
    Support,
    Zone,
    make_structure,
    read_mesh,
    surface_mesh,
)

from ..errors import ScenarioError
from .described_file import locating, read_description

_TABLES: dict[str, type] = {
    "regions": Region,
    "zones": Zone,
    "supports": Support,
    "edges": Edge,
    "loads": Load,
    "sensors": Sensor,
    "gas": Gas,
}


def load_structure(path: Path, mesh: Path | None = None, *, expose: bool = False) -> Structure:
    """Read and check a setup and its mesh.

    Parameters
    ----------
    path : Path
        A TOML file.
    mesh : Path, optional
        Mesh file, in place of the setup's own.
    expose : bool
        Whether the displacement of every node is a variable, whatever the setup says.

    Returns
    -------
    Structure

    Raises
    ------
    ScenarioError
        The setup has mistakes, in itself or on this mesh; one line per mistake.
    DataError
        The mesh cannot be used.
    """
    setup, source = read_description(path, "setup", Setup, _TABLES)
    if mesh is None and not setup.mesh:
        msg = f'{path.name} names no mesh. Write mesh = "sail.msh" at its top, or name the file with --mesh.'
        raise ScenarioError(msg)
    if expose:
        setup = replace(setup, expose=True)
    with locating(source):
        return make_structure(
            setup, surface_mesh(read_mesh(mesh or path.parent / setup.mesh, setup.scale), setup.order)
        )
