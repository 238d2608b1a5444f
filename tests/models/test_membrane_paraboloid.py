"""A dish as an antenna: the paraboloid that fits it best, and how far it is off."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from gossamer.descriptions import load_structure
from gossamer_models import Stepper
from gossamer_models.membrane import Paraboloid, make_structure, membrane_model
from gossamer_models.mistakes import DescriptionError
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation


@cache
def shipped():
    return load_structure("reflector")


@pytest.fixture
def dish():
    """The shipped dish, drawn with a focal length of 1 m."""
    return shipped()


@cache
def written(structure):
    (fit,) = structure.surfaces
    x = ca.MX.sym("x", 3, fit.nodes.size)
    return ca.Function("told", [x], [*fit(x).values()])


def told(structure, nodes):
    """Return rms [m], focal shift [m] and pointing error [rad] of nodes, shape (N, 3)."""
    return [float(value) for value in written(structure)(nodes[structure.surfaces[0].nodes].T)]


small = st.floats(-0.02, 0.02)


@settings(deadline=None)
@given(turn=st.tuples(small, small), scale=st.floats(0.98, 1.02), move=st.tuples(small, small, small))
def test_a_paraboloid_that_is_moved_tilted_and_scaled_is_found_again(turn, scale, move):
    dish = shipped()
    rotation = Rotation.from_rotvec([*turn, 0.0]).as_matrix()
    rms, shift, pointing = told(dish, scale * dish.mesh.nodes @ rotation.T + move)
    assert rms < 1e-6
    assert shift == pytest.approx(scale - 1.0, abs=1e-9)
    assert pointing == pytest.approx(np.linalg.norm(turn), abs=1e-9)


def test_the_best_fit_of_a_rough_dish_is_that_of_least_squares(dish):
    """Another implementation: SciPy fits vertex, axis and focal length to 0.3 mm of astigmatism and noise."""
    nodes, random = dish.mesh.nodes.copy(), np.random.default_rng(0)
    nodes[:, 2] += 3e-4 * (nodes[:, 0] ** 2 - nodes[:, 1] ** 2) + 1e-4 * random.standard_normal(len(nodes))
    (fit,) = dish.surfaces

    def distances(x):
        X = Rotation.from_rotvec([x[3], x[4], 0.0]).inv().apply(nodes[fit.nodes] - x[:3])
        squared = X[:, 0] ** 2 + X[:, 1] ** 2
        return np.sqrt(fit.areas) * (X[:, 2] - squared / (4.0 * x[5])) / np.sqrt(1.0 + squared / (4.0 * x[5] ** 2))

    best = least_squares(distances, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    rms, shift, pointing = told(dish, nodes)
    assert rms == pytest.approx(np.linalg.norm(best.fun), rel=1e-6)
    assert shift == pytest.approx(best.x[5] - 1.0, rel=1e-2)
    assert pointing == pytest.approx(np.hypot(best.x[3], best.x[4]), rel=1e-2)


def test_a_dish_in_any_place_and_direction_has_the_same_figures(dish):
    rotation = Rotation.from_rotvec([0.3, -1.1, 0.5]).as_matrix()
    vertex, axis = (0.4, -0.2, 2.0), tuple(rotation[:, 2].tolist())
    nodes = dish.mesh.nodes @ rotation.T + vertex
    surface = Paraboloid(name="dish", focal_length=1.0, vertex=vertex, axis=axis)
    setup = replace(dish.setup, surfaces=(surface,), sensors=(), zones=())
    moved = make_structure(setup, replace(dish.mesh, nodes=nodes))
    bent = dish.mesh.nodes * [1.0, 1.0, 1.01]
    assert told(moved, bent @ rotation.T + vertex) == pytest.approx(told(dish, bent), abs=1e-12)


def test_pressure_that_pushes_outward_makes_the_dish_deeper(dish):
    """Its results come from the model: more pressure shortens the focal length, and the axis stays."""
    found = []
    for pressure in (-200.0, -400.0):
        model = Stepper(membrane_model(dish), pressure=pressure)
        model.initialize()
        found.append([model.get(f"dish_{name}") for name in ("rms", "focal_shift", "pointing")])
    assert found[1][1] < found[0][1] < 0.0
    assert found[1][0] > found[0][0] > 0.0
    assert found[1][2] < 2e-3  # its mesh is not symmetric


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"focal_length": 2.0}, "best fit has a focal length of 1"),
        ({"axis": (0.0, 1.0, 0.0)}, "form no such paraboloid"),
        ({"groups": ("mirror",)}, "no group 'mirror' of faces"),
        ({"name": "a dish"}, "Use letters, digits and underscores"),
        ({"focal_length": 0.0}, "focal_length"),
        ({"axis": (0.0, 0.0, 0.0)}, "axis"),
    ],
)
def test_a_surface_that_is_none_is_refused_by_name(dish, changes, says):
    with pytest.raises(DescriptionError, match=says):
        make_structure(replace(dish.setup, surfaces=(replace(dish.setup.surfaces[0], **changes),)), dish.mesh)


def test_two_surfaces_of_one_name_are_refused(dish):
    with pytest.raises(DescriptionError, match="2 loads, motions or results of surfaces have the name 'dish_rms'"):
        replace(dish.setup, surfaces=2 * dish.setup.surfaces)
