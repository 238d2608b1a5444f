"""Strain and wrinkles of faces, and files for ParaView."""

from __future__ import annotations

from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import pytest
from command_line import invoke
from gossamer_models import Stepper
from gossamer_models.membrane import Cable, Support, Zone, membrane_model, square_structure
from gossamer_orchestrator import ResultsError
from gossamer_orchestrator.fmi.shape import Shape, Surface
from gossamer_orchestrator.results.places import _zone_centres
from gossamer_orchestrator.results.report.membrane import surface_content
from gossamer_orchestrator.results.shapes import (
    SLACK,
    TAUT,
    WRINKLED,
    ShapeHistory,
    create_shapes,
    face_strains,
    load_shapes,
)
from gossamer_orchestrator.results.vtk import export_vtk
from reading_pages import Reader, content_of, numbers
from sails import sail_file, sail_model
from saving import save_results


def surface(nu: float = 0.3) -> Surface:
    """The sail of the tests as a surface, flat, with a zone on its left."""
    file = sail_file()
    faces = np.concatenate([file.quadrilaterals, np.column_stack([file.triangles, np.full(8, -1)])])
    n = len(faces)
    return Surface(
        nodes=file.nodes * [1.0, 1.0, 0.0],
        faces=faces,
        element=np.arange(n),
        region=np.zeros(n, dtype=int),
        zone=np.where(np.arange(n) < 4, 0, -1),
        poisson_ratio=np.array([nu]),
        direction=np.array([[1.0, 0.0, 0.0]]),
        sensor_points=np.zeros((0, 3)),
        sensor_directions=np.zeros((0, 3)),
    )


def deformed(nodes, F):
    """Deform in the plane by F and turn in space by a rotation."""
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    return (nodes[:, :2] @ np.asarray(F).T) @ turn[:, :2].T + [1.0, 2.0, 3.0]


@pytest.mark.parametrize("F", [[[1.1, 0.0], [0.0, 0.95]], [[1.0, 0.3], [0.1, 1.2]]])
def test_an_even_strain_is_found_in_every_face(F):
    """The largest principal stretch is the largest singular value."""
    plain = surface()
    found = face_strains(plain, deformed(plain.nodes, F), np.zeros((1, 3)))
    assert found.largest == pytest.approx(np.full(12, np.linalg.svd(F)[1][0] - 1.0), abs=1e-14)


def test_faces_wrinkle_where_hooke_s_law_asks_for_compression():
    """Across, E2 = -nu E1 is the border; without any tension a face is slack; eigenstrain moves the border."""
    plain, E1 = surface(), 0.02
    for E2, eigen, mark in (
        (-0.3 * E1 + 1e-6, [0.0, 0.0, 0.0], TAUT),
        (-0.3 * E1 - 1e-6, [0.0, 0.0, 0.0], WRINKLED),
        (-0.3 * E1 - 1e-6, [0.0, 2e-6, 0.0], TAUT),
        (-0.3 * E1 + 1e-6, [-1e-5, 0.0, 0.0], WRINKLED),
        (0.0, [0.0, 0.0, 0.05], WRINKLED),
    ):
        F = np.diag(np.sqrt(1.0 + 2.0 * np.array([E1, E2])))
        assert set(face_strains(plain, deformed(plain.nodes, F), np.array([eigen])).mark) == {mark}
    F = np.diag([0.99, 0.98])
    assert set(face_strains(plain, deformed(plain.nodes, F), np.zeros((1, 3))).mark) == {SLACK}
    assert set(face_strains(plain, plain.nodes, np.zeros((1, 3))).mark) == {TAUT}


def files_of(model):
    return dict(np.load(BytesIO(model.resources["shape.npz"])))


def shape_of(model):
    """The shape of a model's Python FMU."""
    layout = {"values": 29, "n_values": len(model.variables), "x": 29 + 8 * len(model.variables), "n_x": model.n_states}
    return Shape(files_of(model), layout)


@pytest.mark.parametrize("pull", [0.2, -0.05])
def test_strain_and_marks_are_those_that_the_model_states(pull):
    """In triangles strain is even, so its largest and the area of the marked ones are those of the equations."""
    model = sail_model(squares_left=0)
    stepper = Stepper(model, pull=pull)
    stepper.initialize()
    shape, files = shape_of(model), files_of(model)
    places, eigenstrain = shape.read(stepper.state)
    found = face_strains(shape.surface(stepper.state), places, eigenstrain)
    assert found.largest.max() == pytest.approx(stepper.get("largest_strain"), abs=1e-13)
    a, b, c = (files["nodes"][files["faces"][:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    share = stepper.get("compressed_share")
    assert share > 0.1
    assert area[found.mark > 0].sum() / area.sum() == pytest.approx(share, abs=1e-13)


@pytest.mark.parametrize("frame", [False, True])
def test_the_shape_of_the_square_is_strained_as_its_sensors_measure(frame):
    """A face is not as small as a sensor, so within a few percent; size and places from the corner are those of the run."""
    model = membrane_model(square_structure(8, 2), frame=frame)
    stepper = Stepper(model, side_length=0.4, edge_displacement=0.004, poisson_ratio=0.4)
    stepper.initialize()
    stepper.set("pressure", 3000.0)
    for _ in range(80):
        stepper.step(3e-4)
    shape = shape_of(model)
    (places, eigenstrain), drawn = shape.read(stepper.state), shape.surface(stepper.state)
    assert places[:, :2].min(axis=0) == pytest.approx([0.0, 0.0], abs=1e-15)
    assert places[:, :2].max(axis=0) == pytest.approx([0.408, 0.408], abs=1e-15)
    assert drawn.sensor_points[1] == pytest.approx([0.004 + 0.4 * 2 / 3, 0.004 + 0.4 / 3, 0.0], abs=1e-15)
    centre = np.argmin(np.linalg.norm(drawn.nodes[:, :2] - drawn.nodes[:, :2].mean(axis=0), axis=1))
    assert places[centre, 2] == pytest.approx(stepper.get("deflection"), abs=1e-15)
    assert drawn.poisson_ratio.tolist() == [0.4]
    assert not eigenstrain.any()
    middles = drawn.nodes[drawn.faces].mean(axis=1)
    for k, point in enumerate(drawn.sensor_points):
        _, _, c, d = nodes = drawn.faces[np.argmin(np.linalg.norm(middles - point, axis=1))]
        a, b = nodes[:2]
        lengths = [np.linalg.norm(x[c] + x[d] - x[a] - x[b]) for x in (places, drawn.nodes)]
        measured = stepper.get(f"strain[{k + 1}]")
        assert measured > 0.05
        assert lengths[0] / lengths[1] - 1.0 == pytest.approx(measured, rel=0.05)
    largest = face_strains(drawn, places, eigenstrain).largest.max()
    assert 0.8 * stepper.get("largest_strain") < largest < stepper.get("largest_strain")


def test_numbers_of_zones_stand_in_their_zones_and_apart_from_sensors():
    """The sensors of the square are near the middles of zones 6, 7, 10 and 11."""
    stepper = Stepper(membrane_model(square_structure(4, 2)))
    stepper.initialize()
    drawn = shape_of(membrane_model(square_structure(4, 2))).surface(stepper.state)
    history = ShapeHistory(drawn, np.zeros(1), drawn.nodes[None], np.zeros((1, 1, 3)))
    content = surface_content(history, np.zeros(1, dtype=int))
    size = 0.588 / 4
    for zone, (node, offset) in enumerate(zip(content["labels"], content["label_offsets"], strict=True)):
        place = drawn.nodes[node] + offset
        row, column = divmod(zone, 4)
        assert ((place - 0.006)[:2] // size).tolist() == [column, row]
        assert np.linalg.norm(place - drawn.sensor_points, axis=1).min() > 0.45 * size
    assert content["label_offsets"][0] == [0.0, 0.0, 0.0]


@pytest.fixture
def known(data):
    """Results of a square membrane, as a file holds them."""
    return data.assign_attrs(schema="gossamer.results", version=1)


def test_paraview_files_hold_places_damage_and_strain(known, tmp_path):
    meshio = pytest.importorskip("meshio", reason="files for ParaView need meshio")
    model = membrane_model(square_structure(4, 1))
    stepper, shape = Stepper(model), shape_of(model)
    stepper.initialize()
    history = ShapeHistory(shape.surface(stepper.state), np.array([9.0]), *(x[None] for x in shape.read(stepper.state)))
    still = history.surface.nodes
    pair = (history.places[0], history.eigenstrain[0])
    file = create_shapes(tmp_path / "shapes.nc", {"membrane": history.surface}, 0.0, {"membrane": (still, pair[1])})
    file.append(np.concatenate([[9.0], *(part.ravel() for part in pair)])[None])
    save_results(known, tmp_path)
    result = invoke(["export-vtk", str(tmp_path)])
    assert result.stdout == f"{tmp_path / 'vtk/membrane.pvd'}\n"
    sets = ElementTree.parse(tmp_path / "vtk/membrane.pvd").getroot()[0]
    assert [float(each.get("timestep")) for each in sets] == [0.0, 9.0]
    first, *_, last = [meshio.read(tmp_path / "vtk" / each.get("file")) for each in sets]
    assert last.points == pytest.approx(history.places[0], abs=1e-15)
    assert last.point_data["displacement"] == pytest.approx(history.places[0] - history.surface.nodes, abs=1e-15)
    cells = {name: values[0] for name, values in last.cell_data.items()}
    assert (cells["zone"] == history.surface.zone + 1).all()
    assert cells["true_damage"] == pytest.approx(np.where(cells["zone"] == 2, 0.3, 0.0))
    assert cells["estimated_damage"] == pytest.approx(np.select([cells["zone"] == 2, cells["zone"] == 7], [0.2, 0.04]))
    strains = face_strains(history.surface, history.places[0], history.eigenstrain[0])
    assert cells["largest_strain"] == pytest.approx(strains.largest, abs=1e-15)
    assert (cells["wrinkle"] == strains.mark).all()
    assert np.isnan(first.cell_data["estimated_damage"][0]).all()  # nothing is judged yet


def test_cables_are_drawn_on_the_page_in_paraview_and_have_a_place_as_zones(known, tmp_path):
    """A cable of two segments above the tip of the sail, which is the second zone."""
    meshio = pytest.importorskip("meshio", reason="files for ParaView need meshio")
    rope = {"youngs_modulus": 1e9, "area": 1e-6, "density": 1e3, "tension": 1.0}
    cable = Cable(name="guy", path=("tip", (2.0, 1.0, 0.9)), parts=2, zone=True, **rope)
    model = sail_model(cables=(cable,), held=(Support(group="guy_end"),))
    stepper, shape = Stepper(model), shape_of(model)
    stepper.initialize()
    drawn = shape.surface(stepper.state)
    places, eigenstrain = shape.read(stepper.state)
    pair = (places, eigenstrain)
    file = create_shapes(tmp_path / "shapes.nc", {"membrane": drawn}, 0.0, {"membrane": pair})
    file.append(np.concatenate([[9.0], *(part.ravel() for part in pair)])[None])
    history = load_shapes(tmp_path)["membrane"]
    assert history.surface.segments.tolist() == drawn.segments.tolist() == [[14, 16], [16, 15]]
    assert _zone_centres(history.surface)[1] == pytest.approx([2.0, 1.0, 0.5])
    content = surface_content(history, np.arange(2))
    assert content["borders"][1] == content["segments"].tolist() == [14, 16, 16, 15]
    assert content["labels"][1] == 16
    (path,) = export_vtk(known.drop_vars("membrane.w"), {"membrane": history}, tmp_path)
    mesh = meshio.read(path.with_name("membrane_0001.vtu"))
    lines = [block.type for block in mesh.cells].index("line")
    assert mesh.cells[lines].data.tolist() == [[14, 16], [16, 15]]
    assert mesh.cell_data["zone"][lines].tolist() == [2, 2]
    assert mesh.cell_data["true_damage"][lines] == pytest.approx([0.3, 0.3])
    assert np.isnan(mesh.cell_data["largest_strain"][lines]).all()


def test_regions_in_paraview_are_those_of_the_setup_where_zones_have_temperatures_of_their_own(known, tmp_path):
    """Their parts, which have eigenstrains of their own, are no regions."""
    meshio = pytest.importorskip("meshio", reason="files for ParaView need meshio")
    model = sail_model(more_zones=(Zone(group="right", parts=3),))
    stepper, shape = Stepper(model), shape_of(model)
    stepper.initialize()
    drawn = shape.surface(stepper.state)
    assert len(np.unique(drawn.region)) == 4
    pair = shape.read(stepper.state)
    create_shapes(tmp_path / "shapes.nc", {"membrane": drawn}, 0.0, {"membrane": pair})
    (path,) = export_vtk(known.drop_vars("membrane.w"), load_shapes(tmp_path), tmp_path)
    mesh = meshio.read(path.with_name("membrane_0000.vtu"))
    region, zone = (np.concatenate(mesh.cell_data[name]) for name in ("region", "zone"))
    assert region.tolist() == np.where(zone == 1, 1, 2).tolist()


def test_a_mesh_of_both_kinds_is_read_back(known, tmp_path):
    meshio = pytest.importorskip("meshio", reason="files for ParaView need meshio")
    plain = surface()
    places = np.stack([deformed(plain.nodes, [[1.1, 0.0], [0.0, 0.9]]), deformed(plain.nodes, np.eye(2))])
    history = ShapeHistory(plain, np.array([5.0, 6.0]), places, np.zeros((2, 1, 3)))
    (path,) = export_vtk(known.drop_vars("membrane.w"), {"membrane": history}, tmp_path)
    mesh = meshio.read(path.with_name("membrane_0000.vtu"))
    assert {block.type: len(block.data) for block in mesh.cells} == {"quad": 4, "triangle": 8}
    assert mesh.points == pytest.approx(places[0], abs=1e-15)
    assert np.concatenate(mesh.cell_data["wrinkle"]).tolist() == [WRINKLED] * 12
    zone, true = (np.concatenate(mesh.cell_data[name]) for name in ("zone", "true_damage"))
    assert zone.tolist() == [1] * 4 + [0] * 8
    assert np.isnan(true).tolist() == [False] * 4 + [True] * 8
    with pytest.raises(ResultsError, match="no membrane can be drawn"):
        export_vtk(known.drop_vars("membrane.w"), {}, tmp_path)


def test_shapes_are_drawn_on_the_page_and_as_a_picture(known, tmp_path):
    plain = surface()
    data = known.drop_vars("membrane.w")
    places = [plain.nodes + np.array([0.0, 0.0, 0.001 * k]) for k in range(3)]
    file = create_shapes(tmp_path / "shapes.nc", {"membrane": plain}, 0.0, {"membrane": (places[0], np.zeros((1, 3)))})
    for time, each in ((4.0, places[1]), (9.0, places[2])):
        file.append(np.concatenate([[time], each.ravel(), np.zeros(3)])[None])
    save_results(data, tmp_path)
    assert invoke(["report", str(tmp_path)]).exit_code == 0
    page = Reader((tmp_path / "report.html").read_text(encoding="utf-8"))
    content = content_of(page.unpacked("data"))
    drawn = content["surface"]
    assert numbers(content["frames"]).tolist() == [0.0, 4.0, 9.0]
    assert numbers(drawn["colours"][0]["values"])[:, 0] == pytest.approx([0.0, 1.0, 2.0], rel=1e-6)  # [mm]
    assert drawn["factor"] == 100.0  # 2 mm of 2 m are drawn as a tenth
    assert numbers(drawn["places"])[-1].reshape(-1, 3)[:, 2] == pytest.approx(0.2)
    assert len(drawn["triangles"]) == 16
    assert [len(pairs) for pairs in drawn["borders"]] == [16, 24]  # two nodes of each side around the zone, and around all
    result = invoke(["plot", str(tmp_path), "--format", "svg", "--out", str(tmp_path / "svg")])
    names = {line.rpartition("/")[2] for line in result.stdout.splitlines()}
    assert "deflection.svg" in names
    assert (tmp_path / "svg/deflection.svg").read_text(encoding="utf-8").startswith("<?xml")
