"""Make the meshes of the membranes that ship with Gossamer: ``pip install gmsh``, then run this file.

Each is a few hundred elements at most; the setups beside them name their physical groups.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import gmsh

FOLDER = Path(__file__).parents[2] / "orchestrator" / "membranes"


def sail() -> None:
    """Mesh a quadrant of a square sail of 10 m: corners cut off, held at the hub and two boom tips, four zones."""
    side, cut = 7.0, 0.35
    corners = [(cut, 0.0), (side - cut, 0.0), (side - cut, cut), (cut, side - cut), (0.0, side - cut), (0.0, cut)]
    middle = (0.3 * side, 0.3 * side)
    rim = [gmsh.model.geo.addPoint(x, y, 0.0) for x, y in corners]
    halves = [gmsh.model.geo.addPoint(x, y, 0.0) for x, y in [(side / 2, 0.0), (side / 2, side / 2), (0.0, side / 2)]]
    centre = gmsh.model.geo.addPoint(*middle, 0.0)
    ring = [rim[0], halves[0], rim[1], rim[2], halves[1], rim[3], rim[4], halves[2], rim[5]]
    line = {(a, b): gmsh.model.geo.addLine(a, b) for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)}
    spoke = {half: gmsh.model.geo.addLine(centre, half) for half in halves}
    hub = _surface(
        [-spoke[halves[2]], spoke[halves[0]], -line[rim[0], halves[0]], -line[rim[5], rim[0]], -line[halves[2], rim[5]]]
    )
    right = _surface(
        [spoke[halves[0]], line[halves[0], rim[1]], line[rim[1], rim[2]], line[rim[2], halves[1]], -spoke[halves[1]]]
    )
    left = _surface(
        [spoke[halves[1]], line[halves[1], rim[3]], line[rim[3], rim[4]], line[rim[4], halves[2]], -spoke[halves[2]]]
    )
    gmsh.model.geo.synchronize()
    for name, surface in (("inner", hub), ("right", right), ("left", left)):
        _group(2, [surface], name)
    _group(1, [line[rim[5], rim[0]]], "hub")
    _group(1, [line[rim[1], rim[2]]], "boom_x")
    _group(1, [line[rim[3], rim[4]]], "boom_y")
    _mesh(1.7, quadrilaterals=True)


def drum() -> None:
    """Mesh a disc of 0.3 m radius: a square amid four parts, of quadrilaterals with 9 nodes, whose sides are round."""
    add, radius, half = gmsh.model.geo, 0.3, 0.13
    around = [(1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)]
    middle = add.addPoint(0.0, 0.0, 0.0)
    inner = [add.addPoint(half * x, half * y, 0.0) for x, y in around]
    outer = [add.addPoint(radius * x / 2**0.5, radius * y / 2**0.5, 0.0) for x, y in around]
    sides = [add.addLine(inner[k], inner[(k + 1) % 4]) for k in range(4)]
    arcs = [add.addCircleArc(outer[k], middle, outer[(k + 1) % 4]) for k in range(4)]
    spokes = [add.addLine(inner[k], outer[k]) for k in range(4)]
    parts = [_surface([spokes[k], arcs[k], -spokes[(k + 1) % 4], -sides[k]]) for k in range(4)]
    parts.append(_surface(sides))
    for line in (*sides, *arcs, *spokes):
        add.mesh.setTransfiniteCurve(line, 3)
    for part in parts:
        add.mesh.setTransfiniteSurface(part)
        add.mesh.setRecombine(2, part)
    add.synchronize()
    _group(2, parts, "skin")
    _group(1, arcs, "rim")
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.setOrder(2)


def reflector() -> None:
    """Mesh a parabolic dish of 1 m radius and 1 m focal length, with triangles."""
    gmsh.model.occ.addDisk(0.0, 0.0, 0.0, 1.0, 1.0)
    gmsh.model.occ.synchronize()
    _group(2, [1], "dish")
    _group(1, [1], "rim")
    _mesh(0.16, quadrilaterals=False)
    tags, places, _ = gmsh.model.mesh.getNodes()
    for tag, (x, y, _) in zip(tags, places.reshape(-1, 3), strict=True):
        gmsh.model.mesh.setNode(tag, [x, y, (x**2 + y**2) / 4.0], [])


def tube() -> None:
    """Mesh a closed tube of 0.2 m radius and 1 m length along x, its lids included."""
    gmsh.model.occ.addCylinder(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.2)
    gmsh.model.occ.synchronize()
    _group(2, [1], "mantle")
    _group(2, [2], "lid_far")
    _group(2, [3], "lid")
    _mesh(0.25, quadrilaterals=True)


def _surface(lines: list[int]) -> int:
    return gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop(lines)])


def _group(dimension: int, members: list[int], name: str) -> None:
    gmsh.model.addPhysicalGroup(dimension, members, name=name)


def _mesh(size: float, *, quadrilaterals: bool) -> None:
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.RecombineAll", quadrilaterals)
    gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 1 if quadrilaterals else 0)
    gmsh.model.mesh.generate(2)


def make(shape: Callable[[], None], folder: Path) -> Path:
    """Write one mesh into a folder and return its path."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        shape()
        path = folder / f"{shape.__name__}.msh"
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


if __name__ == "__main__":
    for shape in (sail, drum, reflector, tube):
        sys.stdout.write(f"{make(shape, FOLDER)}\n")
