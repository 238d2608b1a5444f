"""Meshes of quadrilaterals or triangles from patches, without a mesher."""

import numpy as np
from gossamer_models import Stepper
from gossamer_models.membrane import (
    MeshFile,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    make_structure,
    membrane_model,
    surface_mesh,
)

# of the 3 x 3 nodes of a cell, row by row: corners counter-clockwise, middles of the sides, middle
_NINE = [(0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0), (1, 1)]


def meshed(patches, n, faces=None, points=None, edges=None, kind="quad"):
    """Mesh patches, each a map of the unit square to space, with n (or n by m) elements each.

    Nodes at the same place are one. Groups are given by conditions: of faces on their middles, of points and edges on nodes;
    an edge belongs to a group if its ends do. ``kind`` is quad, quad9 or triangle.
    """
    n, m = (n, n) if isinstance(n, int) else n
    s, t = np.meshgrid(np.linspace(0.0, 1.0, 2 * n + 1), np.linspace(0.0, 1.0, 2 * m + 1))
    places = np.concatenate([np.array(np.broadcast_arrays(*patch(s, t), s)[:3]).reshape(3, -1).T for patch in patches])
    _, first, number = np.unique(places.round(9), axis=0, return_index=True, return_inverse=True)
    grid = number.reshape(len(patches), 2 * m + 1, 2 * n + 1)
    nine = np.stack([grid[:, j : 2 * m - 1 + j : 2, i : 2 * n - 1 + i : 2] for j, i in _NINE], axis=-1).reshape(-1, 9)
    cells = nine if kind == "quad9" else nine[:, :4]
    triangles = np.zeros((0, 3), dtype=int)
    if kind == "triangle":
        cells, triangles = cells[:0], np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    used, number = np.unique(np.concatenate([cells.ravel(), triangles.ravel()]), return_inverse=True)
    nodes = places[first][used]
    cells, triangles = number[: cells.size].reshape(cells.shape), number[cells.size :].reshape(triangles.shape)
    middles = np.concatenate([nodes[part].mean(axis=1) for part in (cells[:, :4], triangles) if len(part)])
    sides = np.concatenate(
        [part[:, [a, (a + 1) % k]] for k, part in ((4, cells[:, :4]), (3, triangles)) for a in range(k) if len(part)]
    )
    sides = np.unique(np.sort(sides, axis=1), axis=0)
    where = nodes.T
    return MeshFile(
        "patches",
        nodes,
        cells,
        triangles,
        {name: np.flatnonzero(test(*middles.T)) for name, test in (faces or {}).items()},
        {name: sides[test(*where)[sides].all(axis=1)] for name, test in (edges or {}).items()},
        {name: np.flatnonzero(test(*where)) for name, test in (points or {}).items()},
    )


def rectangle(width, height):
    """Return the patch from the origin to (width, height)."""
    return lambda s, t: (width * s, height * t, 0.0 * s)


def disc(radius, core=0.45):
    """Return the five patches of a disc: a square in the middle and four parts around it."""
    half = core * radius

    def around(turn):
        def patch(s, t):
            angle = np.pi / 2.0 * (s - 0.5)
            inner = half * np.array([np.ones_like(s), 2.0 * s - 1.0])
            outer = radius * np.array([np.cos(angle), np.sin(angle)])
            x, y = (1.0 - t) * inner + t * outer
            for _ in range(turn):
                x, y = -y, x
            return x, y, 0.0 * s

        return patch

    return [lambda s, t: (half * (2.0 * s - 1.0), half * (2.0 * t - 1.0), 0.0 * s), *map(around, range(4))]


def annulus(inner, outer, share=1.0):
    """Return the patch of a ring, or of a share of it that begins at the x axis; s runs around, t outward, finer inside."""

    def patch(s, t):
        angle, r = 2.0 * np.pi * share * s, inner * (outer / inner) ** t
        return r * np.cos(angle), r * np.sin(angle), 0.0 * s

    return patch


def tube(radius, length):
    """Return the patch of a tube along z whose normal points outward."""
    return lambda s, t: (radius * np.cos(2.0 * np.pi * s), radius * np.sin(2.0 * np.pi * s), length * t)


def ball(radius):
    """Return the six patches of a sphere: the sides of a cube, equal angles apart."""

    def side(turn, sign):
        def patch(s, t):
            u, v = np.tan(np.pi / 4.0 * (2.0 * s - 1.0)), np.tan(np.pi / 4.0 * (2.0 * t - 1.0))
            x = np.array([np.ones_like(u), u, v])
            return np.roll(sign * radius * x / np.linalg.norm(x, axis=0), turn, axis=0)

        return patch

    return [side(turn, sign) for turn in range(3) for sign in (1.0, -1.0)]


def started(file, warn=None, **setup):
    """Return the structure and the running model of a setup on a mesh, in equilibrium; its displacements beside."""
    setup = Setup(**setup)
    structure = make_structure(setup, surface_mesh(file, setup.order))
    model = Stepper(membrane_model(structure))
    model.warn = (lambda text: None) if warn is None else warn
    model.initialize()
    away = structure.ways.sum(axis=0).reshape(-1, 3)
    away[structure.moving] += model.x[: 3 * len(structure.moving)].reshape(-1, 3)
    return structure, model, away


def rim(side):
    """Return the group of the rim of a square between the axes, for ``meshed``."""
    return {"rim": lambda x, y, z: (np.minimum(x, y) < 1e-9) | (np.maximum(x, y) > side - 1e-9)}


def thesis_square(n, order, **changes):
    """Return the square of the thesis as any other membrane: a mesh from its corner, whose numbers are none of its table."""
    side, stretch = 0.588, 1.0 + 2.0 * 0.006 / 0.588
    zones = {
        f"zone{4 * j + i + 1}": (lambda x, y, z, i=i, j=j: (np.floor(4.0 * x / side) == i) & (np.floor(4.0 * y / side) == j))
        for j in range(4)
        for i in range(4)
    }
    file = meshed([rectangle(side, side)], n, faces=zones, points=rim(side) | {"left": lambda x, y, z: x < 1e-9})
    setup = {
        "order": order,
        "mass_damping": 20.0,
        "regions": (Region(youngs_modulus=1e7, poisson_ratio=0.33, density=1100.0, thickness=1e-3),),
        "supports": (Support(group="rim", stretch=(stretch, stretch, 1.0), centre=(side / 2, side / 2, 0.0)),),
        "zones": tuple(Zone(group=name) for name in zones),
        "sensors": tuple(
            Sensor(point=(side * a / 3, side * b / 3, 0.0), direction=(0.0, 1.0, 0.0)) for b in (1, 2) for a in (1, 2)
        ),
    }
    return make_structure(Setup(**setup | changes), surface_mesh(file, order))
