"""How supports hold and move the nodes of a mesh, whether that is enough, and what dead loads pull at them."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..arrays import Vector
from ..mistakes import Mistake, raise_any
from .element import derivative_matrix, lobatto_points
from .gauges import place_matrix, shape_functions
from .geometry import Geometry
from .setup import Load, Setup, Support
from .surface import SurfaceMesh, sides_of

LATTICE = 8  # places along a side of an element where a force around a point is summed


def free_displacements(setup: Setup, mesh: SurfaceMesh) -> NDArray[np.bool_]:
    """Return which displacements are not held, shape (3 N,)."""
    rigid = [_held(support, mesh) for support in setup.supports if not support.stiffness]
    rigid.append(np.repeat(np.isin(np.arange(len(mesh.nodes)), mesh.clamped[:, :2]), 3))
    return np.asarray(~np.any(rigid, axis=0))


def springs(setup: Setup, mesh: SurfaceMesh, mass: Vector) -> Vector:
    """Return the share [1] of the stiffness of each support that is a spring at each displacement, shape (springs, 3 N)."""
    found, free = np.zeros((len(setup.springs), mesh.nodes.size)), free_displacements(setup, mesh)
    for row, i in zip(found, setup.springs, strict=True):
        on = (np.repeat(mass, 3) * (_held(setup.supports[i], mesh) & free)).reshape(-1, 3)
        row[:] = (on / np.maximum(on.sum(axis=0), 1e-300)).ravel()
    return found


def _held(support: Support, mesh: SurfaceMesh) -> NDArray[np.bool_]:
    """Return which displacements a support acts on, shape (3 N,)."""
    found = np.zeros((len(mesh.nodes), 3), dtype=bool)
    for axis in support.fixed:
        found[mesh.points[support.group], "xyz".index(axis)] = True
    return found.ravel()


def _righted(direction: Vector, X: Vector) -> Vector:
    """Return what hinders motions of a sheet that spins, shape (rows, 6): tilts, if it has most inertia about the axis."""
    e, spread = direction / np.linalg.norm(direction), X.T @ X
    across = np.linalg.svd(e[None])[2][1:]
    rights = np.linalg.eigvalsh(across @ spread @ across.T)[0] > e @ spread @ e
    tilts = np.cross(np.eye(3), e)[: 3 * int(rights)]
    return np.hstack([np.zeros_like(tilts), tilts])


def loose(setup: Setup, mesh: SurfaceMesh, free: NDArray[np.bool_]) -> Iterator[Mistake]:
    """Find rigid motions of a sheet that nothing hinders, neither supports nor spin."""
    n = len(mesh.nodes)
    first = np.concatenate([np.repeat(block.elements[:, 0], block.elements.shape[1]) for block in mesh.blocks])
    every = np.concatenate([block.elements.ravel() for block in mesh.blocks])
    for pairs in (*mesh.lines.values(), mesh.clamped[:, :2]):
        first, every = np.append(first, pairs[:, 0]), np.append(every, pairs[:, 1])
    count, sheet = connected_components(coo_array((np.ones(len(first)), (first, every)), shape=(n, n)), directed=False)
    names = [f"along {axis}" for axis in "xyz"] + [f"about {axis}" for axis in "xyz"]
    held = ~free.reshape(-1, 3)
    for k in range(count):
        X = mesh.nodes[sheet == k] - mesh.nodes[sheet == k].mean(axis=0)
        motions = [np.broadcast_to(axis, X.shape) for axis in np.eye(3)]
        motions += [np.cross(axis, X) / mesh.size for axis in np.eye(3)]
        rigid = np.stack(motions, axis=-1)
        _, sizes, moves = np.linalg.svd(rigid.reshape(-1, 6), full_matrices=False)
        is_motion = sizes > 1e-9 * sizes[0]  # a straight line has none about itself
        moves = np.eye(6) if np.sum(is_motion) == 6 else moves[is_motion].T
        righted = [_righted(np.array(load.direction), X) for load in setup.spins if load.start]
        A = np.concatenate([rigid[held[sheet == k]], *righted]) @ moves
        strengths, modes = np.linalg.eigh(A.T @ A)
        modes = moves @ modes
        if strengths[0] < 1e-18 * len(X):
            which = f" ({count} sheets: the one around {np.round(mesh.nodes[sheet == k].mean(axis=0), 4).tolist()} m)"
            text = (
                f"the supports leave the membrane{which * (count > 1)} free to move "
                f"{names[int(np.argmax(np.abs(modes[:, 0])))]} as a rigid body. Hold more nodes or directions: [[supports]] "
                f"with 'group', one of {', '.join(mesh.points) or 'the groups of the mesh'}."
            )
            yield Mistake(("supports",), text)


def leaking(setup: Setup, mesh: SurfaceMesh, free: NDArray[np.bool_], encloses: NDArray[np.bool_]) -> Iterator[Mistake]:
    """Find what leaves the volume of the gas undefined: an open surface without a volume, or whose border moves."""
    if setup.gas is None:
        return
    sides = Counter(side for face, side in sides_of(mesh) if encloses[face])
    border = [side for side, count in sides.items() if count == 1]
    driven = [bool(support.motion) for support in setup.supports]
    loose = (free | np.any(ways(setup, mesh)[driven] != 0.0, axis=0)).reshape(-1, 3)
    if border and setup.gas.volume is None:
        text = f"the faces that enclose the gas are open along {len(border)} sides. Write 'volume', or close them."
        yield Mistake(("gas",), text)
    elif border and np.any(loose[np.unique(np.array([sorted(side) for side in border]))]):
        text = "the border of the faces that enclose the gas moves, so their volume is not known. Hold it, or close them."
        yield Mistake(("gas",), text)


def ways(setup: Setup, mesh: SurfaceMesh) -> Vector:
    """Return where each support moves its nodes [m], in the directions that it holds, shape (supports, 3 N).

    Where two supports move a node the same way, the first one does.

    Raises
    ------
    DescriptionError
        Two supports move a node to different places.
    """
    found, free = np.zeros((len(setup.supports), len(mesh.nodes), 3)), free_displacements(setup, mesh).reshape(-1, 3)
    mistakes = []
    for i, support in enumerate(setup.supports):
        nodes, centre = mesh.points[support.group], np.array(support.centre)
        axes = ["xyz".index(axis) for axis in support.fixed]
        moved = (np.array(support.stretch) - 1.0) * (mesh.nodes[nodes] - centre) + np.array(support.displacement)
        found[i, nodes[:, None], axes] = moved[:, axes]
        found[i] *= free if support.stiffness else 1.0  # springs do not move what is held
        for j, other in enumerate(setup.supports[:i]):
            both = (found[i] != 0.0) & (found[j] != 0.0)
            same = np.isclose(found[i], found[j], rtol=0.0, atol=1e-9 * mesh.size) & (support.motion == other.motion)
            if np.any(both & ~same):
                node = int(np.argmax(np.any(both & ~same, axis=1)))
                text = (
                    f"{support.group!r} and {other.group!r} move the node at {mesh.nodes[node].tolist()} m to different "
                    "places. Let one of them move it, or give both the same way and motion."
                )
                mistakes.append(Mistake(("supports", i), text))
            found[i][both] = 0.0
        found[i, mesh.clamped[:, 0]] = found[i, mesh.clamped[:, 1]]
    raise_any(mistakes)
    return found.reshape(len(setup.supports), mesh.nodes.size)


def members_of(mesh: SurfaceMesh, groups: tuple[str, ...]) -> NDArray[np.bool_]:
    """Return which faces belong to some of the groups; all if there are no groups."""
    found = np.full(mesh.n_faces, not groups)
    for group in groups:
        if group in mesh.faces:
            found[mesh.faces[group]] = True
    return found


def edge_force(setup: Setup, mesh: SurfaceMesh, normals: Vector) -> Vector:
    """Return the nodal forces of tension along edges, by the Lobatto rule of their order; normals are unit vectors."""
    force = np.zeros((len(mesh.nodes), 3))
    middles = np.concatenate([mesh.nodes[block.elements].mean(axis=1) for block in mesh.blocks])
    beside = {side: middles[face] for face, side in sides_of(mesh)} if setup.edges else {}  # by the corners of the side
    for edge in setup.edges:
        for side in mesh.sides[edge.group]:
            nodes, weights = lobatto_points(len(side))
            along = derivative_matrix(nodes, nodes) @ mesh.nodes[side]
            outward = np.cross(along, normals[side])  # its length is that of the side
            middle = mesh.nodes[side].mean(axis=0) - beside[frozenset((int(side[0]), int(side[-1])))]
            outward *= np.sign(np.sum(outward * middle, axis=1, keepdims=True))
            np.add.at(force, side, edge.tension * weights[:, None] * outward)
    return force.ravel()


def unit_force(load: Load, mesh: SurfaceMesh, measured: list[Geometry]) -> Vector:
    """Return the nodal forces of a dead load per unit of its input."""
    force = np.zeros((len(mesh.nodes), 3))
    if load.kind == "force":
        along = np.array(load.direction) / np.linalg.norm(load.direction)
        if load.point is not None:
            return np.outer(_around(load, mesh), along).ravel()
        force[np.unique(np.concatenate([mesh.points[group] for group in load.groups]))] = along
        return force.ravel()
    acts = members_of(mesh, load.groups)
    for block, found in zip(mesh.blocks, measured, strict=True):
        np.add.at(force, block.elements, found.node_normals * acts[block.faces][:, None, None])
    return force.ravel()


def _around(load: Load, mesh: SurfaceMesh) -> Vector:
    """Return the share of each node in a force at a point, by the area of what lies near; of one place without a radius."""
    shares, side = np.zeros(len(mesh.nodes)), (np.arange(LATTICE) + 0.5) / LATTICE
    for block in mesh.blocks:
        s, t = (each.ravel() for each in np.meshgrid(side, side))
        st = np.column_stack([s, t])[s + t < 1.0] if block.order == 0 else 2.0 * np.column_stack([s, t]) - 1.0
        N, D = (np.array(each) for each in zip(*(shape_functions(block.order, place) for place in st), strict=True))
        X = mesh.nodes[block.elements]
        along = np.einsum("pmk,emi->epki", D, X)
        areas = np.linalg.norm(np.cross(along[:, :, 0], along[:, :, 1]), axis=2)
        near = np.linalg.norm(N @ X - np.array(load.point), axis=2) <= load.radius
        np.add.at(shares, block.elements, (areas * near) @ N)
    return shares / shares.sum() if shares.any() else np.asarray(place_matrix(mesh, np.array([load.point]))[0])
