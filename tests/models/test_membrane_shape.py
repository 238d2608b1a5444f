"""The file that describes the shape of a membrane on a mesh."""

import io

import numpy as np
import pytest
from gossamer_models import Stepper
from gossamer_models.membrane.shape import membrane_shape
from sails import sail, sail_model


def arrays_of(content):
    return np.load(io.BytesIO(content), allow_pickle=False)


@pytest.mark.parametrize(("order", "squares"), [(1, 4), (3, 8)])
def test_the_faces_cover_the_elements(order, squares):
    structure = sail(order=order, squares_left=squares)
    model = sail_model(order=order, squares_left=squares)
    shape = arrays_of(model.resources["shape.npz"])
    nodes, faces = shape["nodes"], shape["faces"]
    a, b, c, d = (nodes[faces[:, k]] for k in range(4))
    triangle = faces[:, 3] < 0
    area = np.linalg.norm(np.cross(c - a, np.where(triangle[:, None], b - a, d - b)), axis=1) / 2.0
    found = np.bincount(shape["element"], area)
    assert found == pytest.approx(structure.areas, rel=2e-3 / order**2)  # the surface is slightly curved
    assert len(faces) == (12 if order == 1 else 8 * order**2)
    middle = np.stack([a, b, c]).mean(axis=0)[:, 0]
    assert (shape["zone"] == np.where(middle < 1.0, 0, -1)).all()
    assert (shape["region"] == np.where(middle < 1.0, 0, 1)).all()
    assert shape["sensor_points"].tolist() == [[0.6, 0.6, 0.018]]


def test_places_follow_from_the_state_and_the_variables():
    model = sail_model(expose=True)
    shape, stepper = arrays_of(model.resources["shape.npz"]), Stepper(model, pull=0.5)
    stepper.initialize()
    stepper.set("pull", 0.7)
    stepper.set("pressure", 30.0)
    for _ in range(5):
        stepper.step(2e-3)
    first, count = int(shape["q"]), 3 * len(shape["moving"])
    away = np.zeros_like(shape["nodes"])
    away[shape["moving"]] = stepper.x[first : first + count].reshape(-1, 3)
    for way, by in zip(shape["ways"], shape["moved_by"], strict=True):
        assert model.variables[by].name == "pull"
        away += stepper.values[by] * way
    assert away.ravel() == pytest.approx([stepper.get(f"node[{k + 1}]") for k in range(away.size)], abs=1e-15)
    assert np.abs(away).max() > 1e-3


def test_the_same_structure_gives_the_same_bytes():
    structure, model = sail(), sail_model()
    assert membrane_shape(structure, model.variables) == model.resources["shape.npz"] == sail_model().resources["shape.npz"]
