"""A membrane on a mesh on a frame that flies is the square membrane on its frame."""

from dataclasses import replace

import numpy as np
import pytest
from flight import get, put
from gossamer_models import Stepper
from gossamer_models.membrane import (
    Region,
    Sensor,
    Setup,
    Support,
    make_structure,
    membrane_model,
    square_structure,
    surface_mesh,
)
from gossamer_models.mistakes import DescriptionError
from oracles.meshes import meshed, rectangle

SIDE, MOVED, H = 0.588, 0.006, 1e-4
STRETCH = 1.0 + 2.0 * MOVED / SIDE
RIM = {"rim": lambda x, y, z: (np.minimum(x, y) < 1e-9) | (np.maximum(x, y) > SIDE - 1e-9)}
SETUP = Setup(
    mass_damping=20.0,
    regions=(Region(youngs_modulus=1e7, poisson_ratio=0.33, density=1100.0, thickness=1e-3),),
    supports=(Support(group="rim", stretch=(STRETCH, STRETCH, 1.0), centre=(SIDE / 2, SIDE / 2, 0.0)),),
    sensors=(Sensor(point=(SIDE / 3, SIDE / 3, 0.0), direction=(0.0, 1.0, 0.0)),),
)


def flown(setup=SETUP):
    file = meshed([rectangle(SIDE, SIDE)], 8, points=RIM | {"left": lambda x, y, z: x < 1e-9})
    return membrane_model(make_structure(setup, surface_mesh(file)), frame=True)


def test_it_is_the_square_membrane_on_its_frame():
    """The origin of the mesh is its corner, that of the square membrane its centre."""
    square, mesh = Stepper(membrane_model(square_structure(8, 1), frame=True)), Stepper(flown())
    for model, corner in ((square, 0.0), (mesh, SIDE / 2)):
        model.set("pressure_amplitude", 1e4)
        model.set("enclosed_pressure", 0.3)
        put(model, "mount_position", (0.7 - corner, -corner, 0.2))
        put(model, "angular_velocity", (0.1, 0.2, 0.3))
        model.initialize()
    w, turning = np.array([0.1, 0.2, 0.3]), np.array([1.0, -0.5, 0.3])
    for _ in range(300):
        w = w + H * turning
        for model in (square, mesh):
            put(model, "frame_acceleration", (0.3, 0.1, -0.2))
            put(model, "angular_velocity", w)
            put(model, "angular_acceleration", turning)
            model.step(H)
    vectors = ("force", "torque", "momentum", "angular_momentum", "moving_first_moment", "held_first_moment")
    for name in vectors:
        one, other = (get(model, name) for model in (square, mesh))
        assert other == pytest.approx(one, abs=1e-11 * np.abs(one).max()), name
        assert np.abs(one).max() > 0.0
    for name in ("strain[1]", "moving_mass", "held_mass", "moving_inertia[1]", "held_inertia[5]"):
        assert mesh.get(name) == pytest.approx(square.get(name), rel=1e-11), name


PARTLY = (Support(group="rim", fixed="xz"), Support(group="left", fixed="y"))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [({"supports": PARTLY}, "held in all directions or in none"), ({"inplane_mass": 10.0}, "Leave out 'inplane_mass'")],
)
def test_what_cannot_ride_is_refused(wrong, message):
    with pytest.raises(DescriptionError, match=message):
        flown(replace(SETUP, **wrong))
