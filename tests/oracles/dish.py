"""A parabolic dish of 1 m radius that 500 Pa keep in shape, in five zones, one in the middle, with five sensors."""

import numpy as np
from gossamer_models.membrane import Load, Region, Sensor, Setup, Support, Zone

from .meshes import disc, meshed

NEAR = [(0.3, 0.1), (0.75, 0.1), (0.1, 0.75), (-0.75, -0.1), (-0.1, -0.75)]


def lifted(patch):
    def parabola(s, t):
        x, y, _ = patch(s, t)
        return x, y, 0.25 * (x**2 + y**2)

    return parabola


def dish_file():
    """Return its mesh file, with the group ``rim``."""
    return meshed([lifted(patch) for patch in disc(1.0)], 3, points={"rim": lambda x, y, z: x**2 + y**2 > 0.999})


def dish_setup(file, **values):
    """Return its setup on a mesh file; sensors lie in the middle of an element."""
    middles = file.nodes[file.quadrilaterals].mean(axis=1)
    points = [middles[np.argmin(np.linalg.norm(middles[:, :2] - place, axis=1))] for place in NEAR]
    return Setup(
        law="hencky",
        mass_damping=20.0,
        regions=(Region(youngs_modulus=4e8, poisson_ratio=0.3, density=1400.0, thickness=5e-5),),
        supports=(Support(group="rim"),),
        zones=(Zone(rings=(0.5,), sectors=(1, 4), name="ring {ring} sector {sector}"),),
        loads=(Load(name="pressure", start=-500.0),),
        sensors=tuple(
            Sensor(point=(x, y, z), direction=(y, -x, 0.0) if k % 2 else (x, y, 0.0)) for k, (x, y, z) in enumerate(points)
        ),
        **values,
    )
