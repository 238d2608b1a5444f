"""Small membranes of every kind of element, law and load, with zones and gauges: for tests of batches and equilibria."""

from functools import cache

import numpy as np
from gossamer_models.membrane import Gas, Load, Region, Sensor, Setup, Support, Zone, make_structure, surface_mesh

from .meshes import ball, disc, meshed, rectangle

SHELLS = ("film", "balloon", "plate")


@cache
def shell(name):
    """Return a structure: a film that wrinkles, pulled and lit; a balloon of curved elements; a disc of triangles."""
    setup, file = {"film": _film, "balloon": _balloon, "plate": _plate}[name]()
    return make_structure(setup, surface_mesh(file, setup.order))


def _film():
    file = meshed(
        [rectangle(1.0, 0.6)],
        (6, 4),
        faces={"left": lambda x, y, z: x < 0.5, "right": lambda x, y, z: x > 0.5},
        points={"held": lambda x, y, z: x < 1e-9, "pulled": lambda x, y, z: x > 1.0 - 1e-9},
    )
    return Setup(
        law="relaxed",
        inplane_mass=10.0,
        mass_damping=1.0,
        regions=(Region(youngs_modulus=2.5e9, poisson_ratio=0.34, density=1420.0, thickness=2.5e-6),),
        supports=(Support(group="held"), Support(group="pulled", displacement=(2e-3, 0.0, 0.0), motion="boom")),
        loads=(
            Load(name="sun", kind="light", start=1e-3, direction=(0.0, 0.3, 1.0), reflectivity=0.8),
            Load(name="pressure", start=0.05),
        ),
        zones=(Zone(group="left"), Zone(group="right")),
        sensors=(Sensor(point=(0.3, 0.3, 0.0), direction=(1.0, 0.0, 0.0)),),
    ), file


def _balloon():
    axes = {axis: (lambda x, y, z, i=i: np.abs((x, y, z)[i]) > 0.5 - 1e-9) for i, axis in enumerate("xyz")}
    halves = {"upper": lambda x, y, z: z > 0.1, "lower": lambda x, y, z: z < 0.1}
    return Setup(
        law="neo_hookean",
        order=2,
        mass_damping=20.0,
        regions=(Region(youngs_modulus=1e6, poisson_ratio=0.4, density=1000.0, thickness=1e-3),),
        supports=tuple(Support(group=axis, fixed="xyz".replace(axis, "")) for axis in axes),
        loads=(Load(name="pressure", groups=("upper",), start=20.0),),
        gas=Gas(pressure=200.0, ambient=1e3, exponent=1.4),
        zones=(Zone(group="upper"), Zone(group="lower")),
        sensors=(Sensor(point=(0.5, 0.0, 0.0), direction=(0.0, 1.0, 0.0)),),
    ), meshed(ball(0.5), 2, faces=halves, points=axes, kind="quad9")


def _plate():
    file = meshed(
        disc(0.5),
        2,
        faces={"core": lambda x, y, z: np.hypot(x, y) < 0.25, "ring": lambda x, y, z: np.hypot(x, y) > 0.25},
        points={"rim": lambda x, y, z: np.hypot(x, y) > 0.5 - 1e-9, "middle": lambda x, y, z: np.hypot(x, y) < 1e-6},
        kind="triangle",
    )
    film = {"poisson_ratio": 0.3, "density": 1400.0, "thermal_expansion": 2e-5, "thickness": 2.5e-5}
    return Setup(
        law="hencky",
        mass_damping=10.0,
        regions=(
            Region(group="core", youngs_modulus=4e9, prestress=(2e6, 2e6, 0.0), **film),
            Region(group="ring", youngs_modulus=3e9, prestress=(2e6, 2e6, 1e5), **film),
        ),
        supports=(Support(group="rim"),),
        loads=(Load(name="pressure", start=50.0), Load(name="force", kind="force", groups=("middle",), start=0.1)),
        zones=(Zone(group="core"), Zone(group="ring")),
        sensors=(Sensor(point=(0.2, 0.1, 0.0), direction=(1.0, 0.0, 0.0), gauge_length=0.05),),
    ), file
