"""Results know where zones, sensors and nodes are on the membrane."""

from __future__ import annotations

import json

import numpy as np
import pytest
from gossamer_orchestrator import judge
from gossamer_orchestrator.fmi.shape import Surface
from gossamer_orchestrator.results.places import with_places
from gossamer_orchestrator.results.shapes import create_shapes
from saving import save_results

SIDE = 0.588 + 2 * 0.006


def save_shape(folder, **changes):
    """Write a shape: a square of 1 m beside a triangle of 3 m2, and a face of no zone."""
    nodes = np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1], [7, 0, 1], [7, 9, 1]], dtype=float)
    surface = Surface(
        nodes=nodes,
        faces=np.array([[0, 1, 2, 3], [1, 4, 2, -1], [4, 5, 2, -1]]),
        element=np.arange(3),
        region=np.zeros(3, dtype=int),
        zone=np.array([0, 1, -1]),
        poisson_ratio=np.array([0.3]),
        direction=np.array([[1.0, 0.0, 0.0]]),
        **{"sensor_points": np.array([[0.1, 0.2, 1.0], [0.3, 0.4, 1.0]]), "sensor_directions": np.ones((2, 3))} | changes,
    )
    create_shapes(folder / "shapes.nc", {"membrane": surface}, 0.0, {"membrane": (nodes, np.zeros((1, 3)))})


@pytest.fixture
def whole(data):
    """The made-up results, of a membrane whose size is known."""
    parameters = {"side_length": 0.588, "edge_displacement": 0.006}
    data.attrs["fmus"] = json.dumps({"membrane": {"model": "membrane", "parameters": parameters}})
    nodes = np.arange(1, 8)
    return data.assign_coords(w_i=nodes, w_j=nodes)


def test_zones_have_rows_and_columns_from_the_corner_x_first(whole):
    placed = with_places(whole)
    assert placed["membrane.damage"].dims == placed["detector.damage"].dims == ("time", "zone")
    zone = placed["zone"].sel(zone=7)
    assert (int(zone["row"]), int(zone["column"])) == (2, 3)
    assert (float(zone["zone_x"]), float(zone["zone_y"])) == pytest.approx((SIDE * 2.5 / 4, SIDE * 1.5 / 4))
    assert zone["zone_x"].attrs["units"] == "m"


def test_nodes_have_x_and_y_and_sensors_the_place_that_the_shape_has(whole, tmp_path):
    thirds = SIDE / 3.0 * np.array([[1, 1, 0], [2, 1, 0], [2, 2, 0], [1, 2, 0]])
    save_shape(tmp_path, sensor_points=thirds, sensor_directions=thirds)
    placed = with_places(whole, tmp_path)
    w = placed["membrane.w"]
    assert w.dims == ("time", "x", "y")
    assert w["x"].to_numpy() == pytest.approx(SIDE * np.arange(1, 8) / 8)
    assert float(w.isel(time=2).sel(x=SIDE / 2, y=SIDE / 8, method="nearest")) == whole["membrane.w"][2, 3, 0]
    second = placed["membrane.strain"].sel(sensor=2)
    assert (float(second["sensor_x"]), float(second["sensor_y"])) == pytest.approx((2 * SIDE / 3, SIDE / 3))
    assert "sensor_x" not in with_places(whole).coords


def test_values_names_and_judgements_are_as_before(whole):
    placed = with_places(whole)
    assert list(placed.data_vars) == list(whole.data_vars)
    assert placed.attrs == whole.attrs
    for name in whole.data_vars:
        assert np.array_equal(placed[name].to_numpy(), whole[name].to_numpy())
        assert placed[name].attrs == whole[name].attrs
    assert not {"w_i", "w_j"} & set(placed.dims)
    assert judge(placed).estimated.tolist() == judge(whole).estimated.tolist()


def test_a_side_that_is_not_known_counts_as_one(whole):
    del whole.attrs["fmus"]
    x = with_places(whole)["x"]
    assert (float(x[3]), x.attrs["units"]) == (0.5, "1")


@pytest.fixture
def sail(whole):
    """Results of a membrane from a mesh, with two zones and two sensors, and a detector that knows these zones."""
    names = ["membrane.damage", "membrane.strain", "detector.damage"]
    sail = whole[names].isel(zone=slice(2), sensor=slice(2)).assign_attrs(schema="gossamer.results", version=1)
    sail.attrs["fmus"] = json.dumps({"membrane": {"model": "membrane", "parameters": {"mass_damping": 1.0}}})
    return sail


def test_a_membrane_from_a_mesh_has_none_of_the_places_of_a_square(sail, tmp_path):
    assert set(with_places(sail).coords) == set(with_places(sail, tmp_path).coords) == {"time", "zone", "sensor"}


def test_zones_and_sensors_of_a_mesh_are_where_its_shape_has_them(sail, tmp_path):
    """A square of 1 m beside a triangle of 3 m2, and a face of no zone; so in a sweep, which names no FMUs."""
    save_shape(tmp_path)
    save_results(sail, tmp_path)
    swept = sail.expand_dims(case=[1, 2]).drop_attrs()
    for placed in (with_places(sail, tmp_path), with_places(swept, tmp_path)):
        assert placed["detector.damage"]["zone_x"].to_numpy() == pytest.approx([0.5, 3.0])
        assert placed["membrane.damage"]["zone_y"].to_numpy() == pytest.approx([0.5, 1.0 / 3.0])
        assert placed["zone_z"].to_numpy() == pytest.approx([1.0, 1.0])
        assert placed["membrane.strain"]["sensor_y"].to_numpy() == pytest.approx([0.2, 0.4])
        assert placed["zone_x"].attrs == {"units": "m", "long_name": "x of the centre of the zone"}
        assert "row" not in placed.coords


def test_a_square_beside_a_membrane_from_a_mesh_keeps_its_places(whole):
    fmus = {"membrane": {"side_length": 0.588, "edge_displacement": 0.006}, "sail": {"mass_damping": 1.0}}
    both = whole.assign({"sail.damage": ("time", np.zeros(whole.sizes["time"]))})
    both.attrs["fmus"] = json.dumps({name: {"model": "membrane", "parameters": p} for name, p in fmus.items()})
    assert with_places(both)["membrane.w"].dims == ("time", "x", "y")


def test_some_zones_alone_have_no_places(whole):
    some = with_places(whole.isel(zone=slice(1, 4)))
    assert some["membrane.damage"].dims == ("time", "zone")
    assert some["zone"].to_numpy().tolist() == [2, 3, 4]
    assert "row" not in some.coords


def test_some_zones_beside_all_zones_have_a_dimension_of_their_own(whole):
    detector = whole["detector.damage"].rename(zone="damage_index")
    some = whole.isel(zone=[5, 11]).drop_vars(["detector.damage", "detector.index"]).assign({"detector.damage": detector})
    placed = with_places(some)
    assert placed["membrane.damage"]["zone_index"].to_numpy().tolist() == [6, 12]
    assert placed["detector.damage"].dims == ("time", "zone")
    assert placed["row"].sizes == {"zone": 16}


def test_zones_with_other_numbers_keep_them_beside_as_many_zones(whole):
    detector = whole["detector.damage"].rename(zone="damage_index")
    later = whole[["membrane.damage"]].assign_coords(zone=np.arange(2, 18)).assign({"detector.damage": detector})
    placed = with_places(later)
    assert placed["membrane.damage"]["zone_index"].to_numpy().tolist() == list(range(2, 18))
    assert placed["zone"].to_numpy().tolist() == list(range(1, 17))


def test_cases_of_a_sweep_keep_their_dimension(whole):
    both = whole.expand_dims(case=[1, 2])
    placed = with_places(both.assign_coords(time=whole["time"]))
    assert placed["membrane.damage"].dims == ("case", "time", "zone")
    assert placed["membrane.w"].dims == ("case", "time", "x", "y")
