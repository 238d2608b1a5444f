"""Read ``setup.toml`` and its mesh: keys and types are those of ``gossamer_models.membrane.Setup``."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

from gossamer_models.membrane import (
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
from ..scenario.source import Source
from .described_file import locating, read_description

logger = logging.getLogger(__name__)

_TABLES: dict[str, type] = {
    "regions": Region,
    "zones": Zone,
    "supports": Support,
    "edges": Edge,
    "loads": Load,
    "sensors": Sensor,
    "gas": Gas,
}
_USUAL = {
    "youngs_modulus": (1e3, 1e13, "Pa"),
    "density": (1.0, 3e4, "kg/m3"),
    "thickness": (1e-8, 0.1, "m"),
}  # of a region


def load_structure(path: Path, mesh: Path | None = None, *, expose: bool = False) -> Structure:
    """Read and check a setup and its mesh; warn of numbers that no membrane has, as from a wrong unit.

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
    _warn_of_units(setup, source)
    if expose:
        setup = replace(setup, expose=True)
    with locating(source):
        return make_structure(
            setup, surface_mesh(read_mesh(mesh or path.parent / setup.mesh, setup.scale), setup.order)
        )


def _warn_of_units(setup: Setup, source: Source) -> None:
    """Warn of materials that are allowed, and so far from any known one that a unit is probably wrong."""
    for i, region in enumerate(setup.regions):
        for name, (low, high, unit) in _USUAL.items():
            if not low <= (value := getattr(region, name)) <= high:
                where = source.where(("regions", i, name))
                text = "%s: %r is %g %s; that of a membrane is %g to %g %s. Is it in another unit?"
                logger.warning(text, where, name, value, unit, low, high, unit)
