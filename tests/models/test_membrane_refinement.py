"""A membrane with every element in four, or with a higher order: the same surface and groups, a smaller error."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models.membrane import Region, Sensor, Setup, Support, Zone, make_structure, square_structure, surface_mesh
from gossamer_models.twin import MembraneForward
from oracles.meshes import ball, disc, meshed, rectangle, started

FILM = Region(youngs_modulus=1e7, poisson_ratio=0.3, density=1e3, thickness=1e-3, prestress=(1e4, 1e4, 0.0))
RIM = {"rim": lambda x, y, z: np.hypot(x, y) > 1.0 - 1e-9}


def structure(file, order, **setup):
    setup = {"supports": (Support(group="rim"),), "zones": (Zone(rings=2, sectors=(1, 3)),)} | setup
    return make_structure(Setup(regions=(FILM,), order=order, **setup), surface_mesh(file, order))


@pytest.mark.parametrize(("kind", "order", "faces"), [("quad", 1, 4), ("triangle", 1, 4), ("quad9", 2, 1)])
@pytest.mark.parametrize("groups", ["points", "edges"])
def test_a_finer_membrane_is_the_same_surface_held_at_the_same_places(kind, order, faces, groups):
    coarse = structure(meshed(disc(1.0), 6, kind=kind, **{groups: RIM}), order)
    fine = coarse.finer()
    assert fine.mesh.n_faces == faces * coarse.mesh.n_faces
    assert fine.areas.sum() == pytest.approx(coarse.areas.sum(), rel=1e-12 if order == 1 else 1e-4)
    assert fine.mass.sum() == pytest.approx(coarse.mass.sum(), rel=1e-12 if order == 1 else 1e-4)
    assert fine.zone_names == coarse.zone_names
    held = fine.mesh.nodes[~fine.free.reshape(-1, 3).any(axis=1)]
    sides = 24 * (2 if order == 1 else 4)
    assert len(held) == sides  # nodes on the rim: two on a side in place of one, four in place of two
    angles = np.sort(np.arctan2(held[:, 1], held[:, 0]))
    assert np.diff(angles).max() < 1.8 * 2.0 * np.pi / sides


def test_parts_stay_where_they_are():
    coarse = structure(meshed(disc(1.0), 6, edges=RIM), 1, zones=(Zone(parts=7),))
    assert coarse.finer().zone_places == pytest.approx(coarse.zone_places, abs=2e-3)


def test_a_closed_surface_stays_closed():
    file = meshed(ball(1.0), 4, points={"low": lambda x, y, z: z < -0.9})
    coarse = make_structure(Setup(regions=(FILM,), supports=(Support(group="low"),)), surface_mesh(file))
    assert coarse.finer().volume == pytest.approx(coarse.volume, rel=1e-12)


def test_a_setup_is_refined_as_often_as_it_says():
    file = meshed(disc(1.0), 4, edges=RIM)
    twice = structure(file, 1, refine=2)
    assert twice.mesh.n_faces == 16 * 80
    again = structure(file, 1).finer().finer()
    assert again.setup.refine == 2
    assert np.sort(again.areas) == pytest.approx(np.sort(twice.areas), rel=1e-12)


def test_a_finer_membrane_is_nearer_to_the_exact_deflection():
    """A square under tension S t and pressure p: the middle deflects by 0.07367 p a^2 / (S t), Timoshenko's series."""
    edge = {"rim": lambda x, y, z: (np.minimum(x, y) < 1e-9) | (np.maximum(x, y) > 1.0 - 1e-9)}
    file = meshed([rectangle(1.0, 1.0)], 4, points=edge)
    taut = replace(FILM, prestress=(1e6, 1e6, 0.0))
    sensors = (Sensor(point=(0.5, 0.5, 0.0), direction=(1.0, 0.0, 0.0)),)
    errors = []
    for refine in (0, 1, 2):
        setup = {"regions": (taut,), "supports": (Support(group="rim"),), "sensors": sensors, "refine": refine}
        _, model, _ = started(file, **setup)
        model.reset()
        model.set("pressure", 10.0)
        model.initialize()
        errors.append(abs(model.get("displacement") / (0.0736713 * 10.0 / 1e3) - 1.0))
    assert errors[1] < 0.35 * errors[0]
    assert errors[2] < 0.35 * errors[1]


@pytest.mark.parametrize(("coarse", "fine"), [((4, 1), (8, 1)), ((4, 2), (4, 4))])
def test_the_square_of_finer_elements_is_the_square_that_is_made_of_them(coarse, fine):
    """With the parameters and the results of the square, and stretched evenly by its rim."""
    given, damage = {"density": 1000.0, "edge_displacement": 0.005, "pressure": 100.0}, 0.3 * np.eye(16)[4:5]
    refined, made = (MembraneForward(each, given) for each in (square_structure(*coarse).finer(), square_structure(*fine)))
    assert refined.limit == pytest.approx(made.limit)
    strain, wanted = (each.strain(damage, {}, {}, 60, 3e-4) for each in (refined, made))
    assert strain == pytest.approx(wanted, abs=1e-12)
    assert [v.name for v in refined.structure.table] == [v.name for v in made.structure.table]
