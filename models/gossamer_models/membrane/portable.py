"""A structure as one text: setup, mesh and groups, which an FMU carries so that a twin can be made from it.

Numbers are written with all their digits, so what is read equals what was written.
"""

import json
from dataclasses import asdict, is_dataclass, replace
from pathlib import Path
from typing import get_args, get_type_hints

import numpy as np
from gossamer_files import reason

from ..artifacts import made_from
from ..errors import DataError
from .setup import Setup
from .structure import Structure, make_structure
from .surface import Block, SurfaceMesh

FILE = "setup.json"
SCHEMA, VERSION = "gossamer.structure", 1
TABLES: dict[str, type] = {  # of a setup
    name: part
    for name, hint in get_type_hints(Setup).items()
    for part in get_args(hint)
    if isinstance(part, type) and is_dataclass(part)
}


def structure_text(structure: Structure) -> str:
    """Return a structure that was made from a setup and a mesh as JSON; its mesh is as fine as it is."""
    mesh = structure.mesh
    setup = replace(structure.setup, mesh=Path(structure.setup.mesh).name, refine=0)
    groups = {kind: {name: rows.tolist() for name, rows in getattr(mesh, kind).items()} for kind in _GROUPS}
    blocks = [{"order": b.order, "elements": b.elements.tolist(), "faces": b.faces.tolist()} for b in mesh.blocks]
    content = {"name": mesh.name, "nodes": mesh.nodes.tolist(), "blocks": blocks, **groups}
    card = {"schema": SCHEMA, "version": VERSION, "setup": asdict(setup), "mesh": content}
    card["zone_names"] = structure.zone_names  # for those who read no meshes
    return json.dumps(card)


def read_structure(text: str) -> Structure:
    """Make a structure from what ``structure_text`` wrote.

    Raises
    ------
    DataError
        The text is none of a structure, or of another version.
    """
    try:
        card = json.loads(text)
        if (card["schema"], card["version"]) != (SCHEMA, VERSION):
            msg = f"it is {card['schema']} version {card['version']}, this program reads {SCHEMA} version {VERSION}"
            raise ValueError(msg)
        setup, mesh = card["setup"], card["mesh"]
        groups = {kind: {name: np.array(rows, dtype=np.int64) for name, rows in mesh[kind].items()} for kind in _GROUPS}
        blocks = tuple(Block(b["order"], np.array(b["elements"]), np.array(b["faces"])) for b in mesh["blocks"])
        faces, points, sides = (groups[kind] for kind in _GROUPS)
        surface = SurfaceMesh(mesh["name"], np.array(mesh["nodes"]), blocks, faces, points, sides)
        return make_structure(made_from(Setup, setup), surface)
    except (KeyError, TypeError, ValueError) as error:
        msg = f"this is no structure of a membrane: {reason(error)}. Make it again."
        raise DataError(msg) from error


_GROUPS = ("faces", "points", "sides")
