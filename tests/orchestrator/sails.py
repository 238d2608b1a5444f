"""Small membranes on meshes, of quadrilaterals beside triangles, for tests of what is drawn."""

from __future__ import annotations

import numpy as np
from gossamer_models import StepModel
from gossamer_models.membrane import (
    MeshFile,
    Region,
    Sensor,
    Setup,
    Structure,
    Support,
    Zone,
    make_structure,
    membrane_model,
    surface_mesh,
)


def sail_file(squares_left: int = 4) -> MeshFile:
    """Return 2 x 1 m in 4 x 2 squares, all but the first few halved; groups ``left`` and ``right``."""
    x, y = (part.ravel() for part in np.meshgrid(np.arange(5.0) / 2.0, np.arange(3.0) / 2.0))
    nodes = np.column_stack([x, y, 0.05 * x * y])
    squares = np.array([[5 * j + i, 5 * j + i + 1, 5 * j + i + 6, 5 * j + i + 5] for i in range(4) for j in range(2)])
    quads, halves = squares[:squares_left], squares[squares_left:][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    rim = np.flatnonzero((x == 0.0) | (x == 2.0))
    left = 4 if squares_left else 8
    groups = {"left": np.arange(left), "right": np.arange(left, len(quads) + len(halves))}
    return MeshFile("sail.msh", nodes, quads, halves, groups, {}, {"rim": rim, "tip": np.array([14])})


def sail(order: int = 1, squares_left: int = 4, expose: bool = False, held=(), more_zones=(), **more) -> Structure:
    """Return a structure that is pulled at one side, with a zone, a sensor, and prestress in one of two regions."""
    film = {"poisson_ratio": 0.3, "density": 1000.0, "thickness": 1e-4}
    setup = Setup(
        order=order,
        expose=expose,
        mass_damping=5.0,
        regions=(
            Region(youngs_modulus=1e7, group="left", prestress=(2e4, 1e4, 5e3), thermal_expansion=1e-4, **film),
            Region(youngs_modulus=2e7, **film),
        ),
        zones=(Zone(group="left"), *more_zones),
        supports=(Support(group="rim", stretch=(1.01, 1.0, 1.0), motion="pull"), *held),
        sensors=(Sensor(point=(0.6, 0.6, 0.018), direction=(1.0, 0.0, 0.0)),),
        **more,
    )
    return make_structure(setup, surface_mesh(sail_file(squares_left), order))


def sail_model(**options) -> StepModel:
    """Return its step model."""
    return membrane_model(sail(**options))
