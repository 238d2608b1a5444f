"""Setups and meshes that cannot be used are refused with what is wrong and what to do."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models.errors import DataError
from gossamer_models.membrane import (
    Edge,
    Gas,
    Load,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    make_structure,
    read_mesh,
    surface_mesh,
)
from gossamer_models.mistakes import DescriptionError
from oracles.meshes import meshed, rectangle

meshio = pytest.importorskip("meshio", reason="reading mesh files needs the extra 'mesh'")

FILM = Region(youngs_modulus=1e7, poisson_ratio=0.3, density=1e3, thickness=1e-3)
RIGHT = {"regions": (FILM,), "supports": (Support(group="rim"),)}
GROUPS = {"west": lambda x, y, z: x < 0.5, "east": lambda x, y, z: x > 0.5, "most": lambda x, y, z: x > 0.3}
EDGES = {
    "rim": lambda x, y, z: (np.minimum(x, y) < 1e-9) | (np.maximum(x, y) > 1.0 - 1e-9),
    "left": lambda x, y, z: x < 1e-9,
}


def square(kind="quad"):
    return meshed([rectangle(1.0, 1.0)], 4, faces=GROUPS, edges=EDGES, kind=kind)


REFUSED = {
    "no such zone": ({"zones": (Zone(group="wset"),)}, "patches has no group 'wset' of faces"),
    "no such support": ({"supports": (Support(group="ring"),)}, "no group 'ring' of nodes"),
    "zones overlap": (
        {"zones": (Zone(group="west"), Zone(group="most"))},
        "4 faces of 'most' are in the zone 'west' already",
    ),
    "faces without material": ({"regions": (replace(FILM, group="west"),)}, "8 of 16 faces have no material"),
    "loose": ({"supports": ()}, "free to move along x as a rigid body"),
    "gas in nothing that holds": ({"supports": (), "gas": Gas(pressure=1.0)}, "free to move along x as a rigid body"),
    "no such law": ({"law": "neo-hookean"}, "no law 'neo-hookean'.*Known: st_venant_kirchhoff, hencky, neo_hookean"),
    "turns": ({"supports": (Support(group="left"),)}, "free to move about y"),
    "sensor away": (
        {"sensors": (Sensor(point=(2.0, 0.5, 0.0), direction=(1.0, 0.0, 0.0)),)},
        "sensor 1 at .* away from the surface by 1 m. Move it onto the membrane",
    ),
    "gauge across": (
        {"sensors": (Sensor(point=(0.5, 0.5, 0.0), direction=(0.0, 0.0, 1.0)),)},
        "sensor 1: its direction .* is across the surface",
    ),
    "gauge over the edge": (
        {"sensors": (Sensor(point=(0.9, 0.5, 0.0), direction=(1.0, 0.0, 0.0), gauge_length=0.4),)},
        "its gauge reaches beyond an edge",
    ),
    "no such edge": ({"edges": (Edge(group="top", tension=1.0),)}, "no group 'top' of edges"),
    "open gas": ({"gas": Gas(pressure=100.0)}, "open along 16 sides. Write 'volume'"),
    "gas that leaks": (
        {"gas": Gas(pressure=100.0, volume=1.0, groups=("west",))},
        "border of the faces that enclose the gas moves",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_setup_that_does_not_fit_the_mesh_is_refused(name):
    change, text = REFUSED[name]
    with pytest.raises(DescriptionError, match=text):
        make_structure(Setup(**{**RIGHT, **change}), surface_mesh(square()))


def test_the_right_setup_is_taken():
    assert make_structure(Setup(**RIGHT), surface_mesh(square())).mass.sum() == pytest.approx(1.0)


MEANINGLESS = {
    "no material": (lambda: Setup(regions=()), "there are no regions"),
    "eclipse that is a load": (
        lambda: Setup(**RIGHT, loads=(Load(name="sun", kind="light"), Load(name="sun_eclipse"))),
        "2 loads, motions or results of surfaces",
    ),
    "more light than there is": (
        lambda: Load(name="sun", kind="light", reflectivity=0.8, diffuse=0.3),
        "are 1.1 together. Write shares of 1",
    ),
    "heat that cannot leave": (lambda: Load(name="sun", kind="light", emissivity=(0.0, 0.0)), "'emissivity' is"),
    "gas that scatters": (lambda: Load(name="gas", diffuse=0.3), "'diffuse' belongs to light"),
    "name that is taken": (lambda: Setup(**RIGHT, loads=(Load(name="damage"),)), "that of another variable"),
    "two of a name": (
        lambda: Setup(**RIGHT, loads=(Load(name="p"), Load(name="p"))),
        "2 loads, motions or results of surfaces",
    ),
    "absurd pressure": (lambda: Load(name="p", start=1e9), "'start' is 1e\\+09. Write a number from"),
    "no number": (lambda: replace(FILM, thickness=float("nan")), "'thickness' is nan"),
    "thick": (lambda: replace(FILM, thickness=3.0), "'thickness' is 3. Write a number from 1e-07 to 1"),
    "no direction": (lambda: Sensor(point=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 0.0)), "not all zero"),
    "held nowhere": (lambda: Support(group="rim", fixed="xw"), "Write the directions that are held"),
    "two take the rest": (lambda: Setup(**{**RIGHT, "regions": (FILM, FILM)}), "only one can take the rest"),
    "no Hooke": (
        lambda: Setup(**{**RIGHT, "regions": (replace(FILM, prestress=(1e5, 1e5, 0.0)),)}, law="hencky"),
        "Hooke's",
    ),
    "moves along what is free": (
        lambda: Support(group="rim", fixed="z", displacement=(0.1, 0.0, 0.0)),
        "moves along x, which 'fixed' = 'z' does not hold",
    ),
    "motion of nothing": (
        lambda: Support(group="rim", motion="stroke"),
        "'motion' multiplies the way of the nodes, and there is none",
    ),
    "motion without a name": (lambda: Support(group="rim", motion="my motion", displacement=(0.1, 0.0, 0.0)), "Use letters"),
    "high order": (lambda: Setup(**RIGHT, order=30), "'order' is 30. Write 1 for bilinear"),
    "empty gas": (lambda: Gas(pressure=0.0), "there is no gas"),
}


@pytest.mark.parametrize("name", MEANINGLESS)
def test_values_without_a_meaning_are_refused(name):
    make, text = MEANINGLESS[name]
    with pytest.raises(DescriptionError, match=text):
        make()


def test_triangles_of_higher_order_are_refused():
    with pytest.raises(DataError, match="32 triangles, and elements of order 3 are quadrilaterals"):
        surface_mesh(square("triangle"), 3)


@pytest.mark.parametrize("bad", ["inside out", "flat"])
def test_elements_without_area_or_inside_out_are_refused_with_their_place(bad):
    file = square()
    inner = np.argmin(np.abs(file.nodes - [0.5, 0.5, 0.0]).sum(axis=1))
    file.nodes[inner] = [0.9, 0.9, 0.0] if bad == "inside out" else [0.25, 0.25, 0.0]
    if bad == "flat":
        file.quadrilaterals[0] = file.quadrilaterals[0][[0, 1, 1, 0]]
    with pytest.raises(DescriptionError, match=r"no area or are turned inside out; the first is face \d+ near"):
        make_structure(Setup(**RIGHT), surface_mesh(file))


def test_a_second_sheet_that_nothing_holds_is_refused():
    both = meshed([rectangle(1.0, 1.0), lambda s, t: (s, t, 1.0 + 0.0 * s)], 4, points={"rim": lambda x, y, z: z < 0.5})
    with pytest.raises(DescriptionError, match=r"2 sheets: the one around \[0.5, 0.5, 1.0\] m"):
        make_structure(Setup(**RIGHT), surface_mesh(both))


def test_a_moebius_strip_is_refused():
    def patch(s, t):
        angle, across = 2.0 * np.pi * s, 0.4 * (t - 0.5)
        r = 1.0 + across * np.cos(angle / 2.0)
        return r * np.cos(angle), r * np.sin(angle), across * np.sin(angle / 2.0)

    with pytest.raises(DataError, match="has one side only"):
        surface_mesh(meshed([patch], (12, 2)))


def test_a_tube_given_inside_out_faces_outward_once_its_lids_close_it():
    """Half of a cube's faces are turned; the surface still faces outward everywhere."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    sides = np.array([[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]])
    file = replace(meshed([rectangle(1.0, 1.0)], 1), nodes=corners, quadrilaterals=sides)
    mesh = surface_mesh(file)
    held = (Support(group="all"),)
    file = replace(file, points={"all": np.arange(8)})
    structure = make_structure(Setup(regions=(FILM,), supports=held), surface_mesh(file))
    outward = np.sum(structure.normals * (structure.mesh.nodes - 0.5), axis=1)
    assert np.all(outward > 0.8)
    assert mesh.n_faces == 6


def written(folder, name, cells, points=None):
    path = folder / name
    points = np.random.default_rng(1).random((100, 3)) if points is None else points
    meshio.Mesh(points, cells).write(path)
    return path


def test_files_that_hold_no_surface_are_refused(tmp_path):
    with pytest.raises(DataError, match="there is no mesh file"):
        read_mesh(tmp_path / "none.msh")
    (tmp_path / "mesh.docx").write_text("mesh")
    with pytest.raises(DataError, match=r"knows no format with the ending '\.docx'"):
        read_mesh(tmp_path / "mesh.docx")
    (tmp_path / "broken.msh").write_text("$MeshFormat\n4.1 0 8\n")
    with pytest.raises(DataError, match="as a mesh"):
        read_mesh(tmp_path / "broken.msh")
    with pytest.raises(DataError, match=r"elements of type tetra\. A membrane is made of quad"):
        read_mesh(written(tmp_path, "solid.vtu", [("tetra", np.array([[0, 1, 2, 3]]))]))
    with pytest.raises(DataError, match="holds no faces"):
        read_mesh(written(tmp_path, "line.vtu", [("line", np.array([[0, 1]]))]))


def test_a_mesh_of_a_million_elements_is_refused_before_slow_work(tmp_path):
    path = written(tmp_path, "large.vtu", [("triangle", np.zeros((100_001, 3), dtype=int))])
    with pytest.raises(DataError, match=r"holds 100001 elements, more than 100000\. Mesh it more coarsely"):
        read_mesh(path)
    huge = tmp_path / "huge.msh"
    with huge.open("wb") as file:
        file.truncate(100_000_000)
    with pytest.raises(DataError, match="holds 100 MB, far more than 100000 elements"):
        read_mesh(huge)
