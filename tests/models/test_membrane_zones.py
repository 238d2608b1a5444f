"""Zones that divide a surface: by rings, sectors, slices, a grid or evenly."""

import numpy as np
import pytest
from gossamer_models.membrane import (
    Edge,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    make_structure,
    membrane_model,
    square_structure,
    surface_mesh,
)
from gossamer_models.mistakes import DescriptionError
from oracles.meshes import annulus, disc, meshed, rectangle, started, tube
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

FILM = Region(youngs_modulus=1e7, poisson_ratio=0.0, density=1e3, thickness=1e-3)
ALL = {"all": lambda x, y, z: x > -1e9}


def divided(file, *zones):
    setup = Setup(regions=(FILM,), supports=(Support(group="all"),), zones=zones)
    return make_structure(setup, surface_mesh(file))


def areas(structure):
    """Area of each zone [m2]."""
    zone = zone_of_face(structure)
    return np.array([structure.areas[zone == k].sum() for k in range(structure.n_zones)])


def zone_of_face(structure):
    return structure.zone[np.concatenate([block.combination for block in structure.elements])]


def pieces(structure, k):
    """Count the pieces of a zone, whose faces hang together by two common nodes or more."""
    corners = structure.mesh.blocks[0].elements[zone_of_face(structure) == k]
    n, m = corners.shape
    by_node = coo_array((np.ones(n * m), (np.repeat(np.arange(n), m), corners.ravel())))
    return connected_components(by_node @ by_node.T >= 2)[0]


def test_a_grid_of_a_square_is_that_of_the_thesis():
    file = meshed([rectangle(0.588, 0.588)], 8, points=ALL)
    square = square_structure(8, 1)
    found = divided(file, Zone(grid=(4, 4)))
    middles = [np.concatenate([s.mesh.nodes[b.elements].mean(axis=1) for b in s.mesh.blocks]) for s in (found, square)]
    order = [np.lexsort(middle[:, :2].round(6).T) for middle in middles]
    assert zone_of_face(found)[order[0]].tolist() == zone_of_face(square)[order[1]].tolist()
    assert found.zone_names[:5] == ("column 1 row 1", "column 2 row 1", "column 3 row 1", "column 4 row 1", "column 1 row 2")


def test_rings_and_sectors_have_the_areas_of_a_circle():
    file = meshed([annulus(0.2, 1.0)], (64, 24), points=ALL)
    radii = 0.2 * 5.0 ** (np.array([0, 9, 16, 24]) / 24)  # on sides of faces
    found = divided(file, Zone(rings=tuple(radii[1:3].tolist()), sectors=(1, 4, 8)))
    exact = np.repeat(np.pi * np.diff(radii**2) / (1, 4, 8), (1, 4, 8))
    assert areas(found) == pytest.approx(exact, rel=2.1e-3)  # chords of a 64th: 1.6e-3
    assert found.zone_names[0] == "ring 1 sector 1"
    at = found.zone_places[5:]
    assert np.rad2deg(np.arctan2(at[:, 1], at[:, 0])) % 360.0 == pytest.approx(22.5 + 45.0 * np.arange(8))


def test_a_tube_is_cut_across_and_around_its_axis():
    file = meshed([tube(0.2, 1.0)], (16, 8), points=ALL)
    found = divided(file, Zone(sectors=4, slices=(0.25, 0.5), name="{slice}.{sector}"))
    assert found.zone_names == tuple(f"{a}.{b}" for a in (1, 2, 3) for b in (1, 2, 3, 4))
    assert areas(found) == pytest.approx(np.repeat([0.25, 0.25, 0.5], 4) * found.areas.sum() / 4)
    assert found.zone_places[:, 2] == pytest.approx(np.repeat([0.125, 0.375, 0.75], 4))


@pytest.mark.parametrize("count", [2, 3, 7, 16, 40])
@pytest.mark.parametrize("shape", ["disc", "cross", "ring"])
def test_even_parts_are_connected_and_of_about_equal_area(shape, count):
    arms = [lambda s, t, a=a, b=b: (s + a, t + b, 0.0 * s) for a, b in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))]
    patches = {"disc": disc(1.0), "cross": arms, "ring": [annulus(0.7, 1.0)]}[shape]
    found = divided(meshed(patches, {"ring": (80, 8)}.get(shape, 12), points=ALL), Zone(parts=count))
    assert found.n_zones == count
    assert [pieces(found, k) for k in range(count)] == [1] * count
    assert areas(found) == pytest.approx(found.areas.sum() / count, rel=0.3)
    assert areas(found).sum() == pytest.approx(found.areas.sum())


def test_sheets_that_do_not_touch_share_the_parts():
    patches = [rectangle(1.0, 1.0), lambda s, t: (5.0 + 3.0 * s, t, 0.0 * s)]
    found = divided(meshed(patches, 8, points=ALL), Zone(parts=8))
    assert np.sum(found.zone_places[:, 0] < 2.0) == 2  # of 1 m2, the other is of 3 m2
    assert areas(found) == pytest.approx(np.full(8, 0.5), rel=0.3)
    with pytest.raises(DescriptionError, match=r"2 sheets that do not touch. Write parts = 2 or more"):
        divided(meshed(patches, 8, points=ALL), Zone(parts=1))


def test_a_strip_of_two_zones_in_series_stretches_by_its_compliance():
    """Equal tension in both halves: strain is inversely proportional to the modulus that is left."""
    points = {"left": lambda x, y, z: x < 1e-9, "all": lambda x, y, z: x > -1.0}
    file = meshed([rectangle(2.0, 1.0)], (4, 2), points=points, edges={"end": lambda x, y, z: x > 2.0 - 1e-9})
    _, model, _ = started(
        file,
        regions=(FILM,),
        supports=(Support(group="left"), Support(group="all", fixed="yz")),
        zones=(Zone(grid=(2, 1)),),
        edges=(Edge(group="end", tension=1.0),),
        sensors=tuple(Sensor(point=(x, 0.5, 0.0), direction=(1.0, 0.0, 0.0)) for x in (0.4, 1.6)),
    )
    model.reset()
    model.set("damage[2]", 0.5)
    model.initialize()
    strain = [model.get("strain[1]"), model.get("strain[2]")]
    assert strain == pytest.approx([1e-4, 2e-4], rel=1e-3)  # 1 N/m over 1e7 Pa times 1e-3 m


def test_names_stand_in_the_table_of_variables():
    found = divided(meshed([rectangle(1.0, 1.0)], 4, points=ALL), Zone(grid=(2, 2), name="field {row}{column}"))
    texts = [v.description for v in membrane_model(found).variables if v.name.startswith("damage[")]
    assert texts == [f"Lost fraction of Young's modulus in field {name}" for name in ("11", "12", "21", "22")]


def test_faces_in_no_zone_are_remarked_on_and_overlap_is_taken_where_it_is_wanted():
    file = meshed(
        [rectangle(1.0, 1.0)], 4, points=ALL, faces={"west": lambda x, y, z: x < 0.5, "low": lambda x, y, z: y < 0.25}
    )
    assert divided(file, Zone(group="west")).remarks[-1].startswith("8 faces, 50 % of the area, are in no zone")
    found = divided(file, Zone(group="west"), Zone(group="low", overlap=True), Zone())
    assert found.zone_names == ("west", "low", "rest")
    assert areas(found) == pytest.approx([0.375, 0.25, 0.375])
    assert not any("no zone" in text for text in found.remarks)
    quadrant = divided(file, Zone(sectors=2, angles=(0.0, 60.0)))
    assert "in no zone" in quadrant.remarks[-1]


REFUSED = {
    "overlap": ((Zone(group="west"), Zone(group="low")), "2 faces of 'low' are in the zone 'west' already"),
    "too fine": ((Zone(rings=9),), r"no face has its middle in 'ring 1', 'ring 9': .*faces of 0.25 m. Mesh more finely"),
    "one name": ((Zone(grid=(2, 2), name="field {row}"),), "2 zones have the name 'field 1'"),
    "too many parts": ((Zone(parts=17),), "16 faces cannot make 17 parts"),
    "nothing left": ((Zone(grid=(2, 1)), Zone()), "holds no faces: others hold all"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_zones_that_the_mesh_cannot_have_are_refused(name):
    file = meshed(
        [rectangle(1.0, 1.0)], 4, points=ALL, faces={"west": lambda x, y, z: x < 0.5, "low": lambda x, y, z: y < 0.25}
    )
    zones, text = REFUSED[name]
    with pytest.raises(DescriptionError, match=text):
        divided(file, *zones)


MEANINGLESS = {
    "two ways": ({"grid": (2, 2), "rings": 3}, "divided one way, and this one by grid and by rings"),
    "radii out of order": ({"rings": (0.5, 0.2)}, "'rings' are not in order"),
    "too few sectors": ({"rings": (0.5,), "sectors": (1, 2, 3)}, "3 numbers for 2 rings"),
    "negative": ({"slices": -2}, "'slices' is -2"),
    "half a grid": ({"grid": (2,)}, "Write how many columns and rows"),
    "backwards": ({"sectors": 2, "angles": (90.0, 0.0)}, r"'angles' is \[90, 0\]"),
    "unknown number": ({"rings": 2, "name": "zone {row}"}, "In braces it can hold group, ring"),
    "open brace": ({"rings": 2, "name": "zone {ring"}, "In braces it can hold"),
    "no axis": ({"rings": 2, "axis": (0.0, 0.0, 0.0)}, "not all zero"),
    "axis as direction": ({"sectors": 2, "direction": (0.0, 0.0, 1.0)}, "'direction' lies along 'axis'"),
}


@pytest.mark.parametrize("name", MEANINGLESS)
def test_divisions_without_a_meaning_are_refused(name):
    keys, text = MEANINGLESS[name]
    with pytest.raises(DescriptionError, match=text):
        Zone(**keys)
