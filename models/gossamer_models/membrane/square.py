"""The membrane of the thesis as a membrane on a mesh, with its four sensors."""

from __future__ import annotations

import numpy as np

from .mesh import N_ZONES, ZONES_PER_SIDE
from .params import MembraneParams, stretch
from .reading import MeshFile
from .setup import Region, Sensor, Setup, Support, Zone
from .strain import SENSOR_POINTS
from .structure import Structure, make_structure
from .surface import surface_mesh

ZONES = tuple(f"zone_{k + 1}" for k in range(N_ZONES))
LOAD = ("pressure_amplitude", "pressure_frequency", "pressure_phase")  # what a setup does not hold


def square_structure(elements_per_side: int = 4, order: int = 4, params: MembraneParams | None = None) -> Structure:
    """Put the square membrane and the four sensors of the thesis on a mesh.

    Parameters
    ----------
    elements_per_side, order : int
        Mesh, as in ``membrane_model``.
    params : MembraneParams or None
        Membrane; None for that of the thesis. Its load is no part of a setup.
    """
    p = params or MembraneParams()
    side, held = p.side_length, stretch(p)
    setup = Setup(
        title="Square membrane",
        order=order,
        mass_damping=p.mass_damping,
        regions=(
            Region(
                youngs_modulus=p.youngs_modulus,
                poisson_ratio=p.poisson_ratio,
                density=p.density,
                thickness=p.thickness,
            ),
        ),
        supports=(Support(group="rim", stretch=(held, held, 1.0), centre=(side / 2.0, side / 2.0, 0.0)),),
        zones=tuple(Zone(group=name) for name in ZONES),
        sensors=tuple(Sensor(point=(side * x, side * y, 0.0), direction=(0.0, 1.0, 0.0)) for x, y in SENSOR_POINTS),
    )
    return make_structure(setup, surface_mesh(_square(elements_per_side, side), order))


def _square(n: int, side: float) -> MeshFile:
    """Mesh a square by n x n squares, whose zones are those of the thesis, row by row from the origin."""
    x, y = np.meshgrid(*2 * [np.linspace(0.0, side, n + 1)])
    node = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)  # row y, column x
    faces = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1).reshape(-1, 4)
    number = np.arange(n * n)
    zone = ZONES_PER_SIDE * (number // n * ZONES_PER_SIDE // n) + number % n * ZONES_PER_SIDE // n
    lines = [node[0], node[-1], node[:, 0], node[:, -1]]
    return MeshFile(
        name="square",
        nodes=np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]),
        quadrilaterals=faces,
        triangles=np.zeros((0, 3), dtype=np.int64),
        faces={name: np.flatnonzero(zone == k) for k, name in enumerate(ZONES)},
        edges={"rim": np.concatenate([np.column_stack([line[:-1], line[1:]]) for line in lines])},
        points={},
    )
