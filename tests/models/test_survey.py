"""The shape as built: a survey of points at rest tells how far it is from the drawing, and the twin is right with it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from gossamer_models import DataError
from gossamer_models.membrane import (
    Built,
    Equilibrium,
    Load,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    as_built,
    make_structure,
    membrane_model,
    surface_mesh,
    surveyed,
    with_shape,
)
from gossamer_models.mistakes import DescriptionError
from gossamer_models.twin import MembraneForward, StaticRecord, Twin, read_survey
from oracles.meshes import disc, meshed

RIM = {"rim": lambda x, y, z: np.hypot(x, y) > 1.0 - 1e-9}
ASTIGMATISM = (0.0, 0.0, 0.0, 0.0, 6e-3, 0.0, 0.0, -6e-3, 0.0, 0.0)  # [m], of xx and yy
PRESSURES = np.array([160.0, 200.0, 240.0, 300.0])


def bowl(patch):
    def raised(s, t):
        x, y, _ = patch(s, t)
        return x, y, 0.2 * (x**2 + y**2)

    return raised


@cache
def dish():
    """A dish that pressure stretches, read by nine gauges."""
    region = Region(youngs_modulus=1e8, poisson_ratio=0.3, density=1e3, thickness=1e-4)
    places = [(0.55 * np.cos(a), 0.55 * np.sin(a), 0.2 * 0.55**2) for a in 2.0 * np.pi * (np.arange(9) + 0.3) / 9.0]
    sensors = tuple(Sensor(point=place, direction=(-place[1], place[0], 0.0)) for place in places)
    setup = Setup(
        regions=(region,),
        supports=(Support(group="rim"),),
        zones=(Zone(rings=1, sectors=(3,)),),
        loads=(Load(name="pressure", start=-200.0),),
        sensors=sensors,
        order=2,
    )
    return make_structure(setup, surface_mesh(meshed([bowl(p) for p in disc(1.0)], 2, points=RIM, kind="quad9"), 2))


@cache
def built():
    return with_shape(dish(), Built(centre=(0.0, 0.0, 0.0), size=2.0, coefficients=ASTIGMATISM))


@cache
def points(noise=1e-4):
    """Nodes of the built dish at rest, of which some are left out."""
    there = built()
    nodes = there.mesh.nodes + Equilibrium(there, membrane_model(there)).solve({}).displacement[0]
    return (nodes + noise * np.random.default_rng(0).standard_normal(nodes.shape))[::2]


@cache
def found():
    return surveyed(dish(), points())


def test_a_known_mode_is_found_from_points_of_the_loaded_dish():
    mesh, seen = dish().mesh, found()
    assert seen.before > 2e-3
    assert seen.after < 1.2e-4
    assert seen.left_out < 1.5e-4
    off = as_built(mesh, seen.built).nodes - built().mesh.nodes
    assert np.sqrt(np.mean(off**2)) < 1e-4
    assert seen.modes < 16


def states(structure, damage=(0.0, 0.0, 0.0), noise=1e-6):
    loads = {"pressure": -PRESSURES}
    strain = MembraneForward(structure).states(np.array([damage]), {}, loads)[0]
    values = strain + noise * np.random.default_rng(1).standard_normal(strain.shape)
    return StaticRecord(step=1.0, values=values, noise=noise, inputs=loads, names=tuple("abcd"), state=np.arange(4))


def test_the_twin_of_the_built_shape_is_right_where_the_drawing_reads_otherwise():
    there, nothing, loads = with_shape(dish(), found().built), np.zeros((1, 3)), {"pressure": -PRESSURES}
    right, known, drawn = (MembraneForward(each).states(nothing, {}, loads) for each in (built(), there, dish()))
    assert known == pytest.approx(right, rel=4e-3)
    assert np.abs(drawn / right - 1.0).max() > 0.02
    answer = Twin(there, known=("gain", "density", "modulus"), discrepancy=None).fit(states(built(), (0.0, 0.15, 0.0)))
    assert answer.valid, answer.doubts
    assert answer.damage == pytest.approx([0.0, 0.15, 0.0], abs=0.02)


def test_what_is_no_survey_of_this_structure_is_refused(tmp_path):
    seen = points()
    with pytest.raises(
        DataError, match=r"of the survey, \(.*\) m, is .* m from the surface.*Check its unit, and that its axes"
    ):
        surveyed(dish(), 1e3 * seen[:8])
    with pytest.raises(DataError, match="of the survey"):
        surveyed(dish(), seen[:8] + np.array([0.0, 0.0, 0.3]))
    with pytest.raises(DataError, match="a survey of 5 points tells no shape"):
        surveyed(dish(), seen[:5])
    with pytest.raises(DataError, match=r"point \d+ of the survey has no three numbers"):
        surveyed(dish(), np.vstack([seen, [[0.0, np.nan, 0.0]]]))
    with pytest.raises(DataError, match="has a shape as built"):
        surveyed(built(), seen)
    with pytest.raises(DescriptionError, match="there are 5 'coefficients'"):
        Built(centre=(0.0, 0.0, 0.0), size=1.0, coefficients=(0.0,) * 5)
    path = tmp_path / "points.csv"
    np.savetxt(path, 1e3 * seen, delimiter=",", header="x [mm],y [mm],z [mm]", comments="")
    assert read_survey(path) == pytest.approx(seen)
    for head, message in (
        ("x [mm],y [mm],h [mm]", "no column 'z'"),
        ("x [mm],y [mm],z", "has no unit"),
        ("x [mm],y [s],z [m]", "no unit of y"),
    ):
        np.savetxt(path, seen, delimiter=",", header=head, comments="")
        with pytest.raises(DataError, match=message):
            read_survey(path)


def test_gauges_go_along_with_a_shape():
    more = replace(found().built, coefficients=tuple(10.0 * np.array(ASTIGMATISM)))
    assert max(gauge.away for gauge in with_shape(dish(), more).gauges) > 0.01
