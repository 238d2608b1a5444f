"""Supports that are springs: closed forms of statics and of vibration, and what is refused."""

import math

import numpy as np
import pytest
from gossamer_models import Stepper
from gossamer_models.membrane import Load, Region, Setup, Support, Zone, make_structure, surface_mesh
from gossamer_models.membrane.model import first_period, membrane_model
from gossamer_models.mistakes import DescriptionError
from oracles.meshes import meshed, rectangle, started

FILM = Region(youngs_modulus=1e9, poisson_ratio=0.3, density=1000.0, thickness=1e-3)
POINTS = {"left": lambda x, y, z: x < 1e-9, "right": lambda x, y, z: x > 2.0 - 1e-9}
SHEET = meshed([rectangle(2.0, 1.0)], (4, 3), edges=POINTS, faces={"all": lambda x, y, z: x < 9.0})
HELD = Support(group="all", fixed="yz")


def sheet(*supports, loads=(), order=1, **more):
    setup = Setup(regions=(FILM,), supports=supports, loads=loads, order=order, zones=(Zone(),), **more)
    return make_structure(setup, surface_mesh(SHEET, order))


def test_a_sheet_moves_on_its_spring_by_force_over_stiffness():
    """6 N right, 2000 N/m left: the left edge moves by 3 mm, the right one by what it stretches too."""
    force = Load(name="force", kind="force", groups=("right",), direction=(1.0, 0.0, 0.0), start=1.5)  # on 4 nodes
    springs = Support(group="left", fixed="x", stiffness=2000.0)
    q = started(SHEET, regions=(FILM,), supports=(HELD, springs), loads=(force,))[2]
    left = POINTS["left"](*SHEET.nodes.T)
    mass = sheet(HELD, springs).mass
    assert np.average(q[left, 0], weights=mass[left]) == pytest.approx(3e-3, rel=1e-6)
    right = POINTS["right"](*SHEET.nodes.T)
    stretch = q[right, 0].mean() - q[left, 0].mean()
    assert stretch == pytest.approx(6.0 * 2.0 / (1e9 * 1e-3) * (1 - 0.3**2), rel=0.05)  # held across
    assert q[:, 1:] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("order", [1, 3])
def test_a_stiff_sheet_on_a_soft_spring_is_an_oscillator(order):
    """Mass 2 kg on 20 kN/m: 100 rad/s."""
    structure = sheet(HELD, Support(group="left", fixed="x", stiffness=2e4), order=order)
    assert first_period(structure) == pytest.approx(2.0 * math.pi / 100.0, rel=0.01)


def test_the_stiffness_is_a_parameter_and_the_anchor_may_be_moved():
    """The anchor of a sheet that a wall holds moves by 1 mm: two springs in series."""
    springs = Support(group="left", fixed="x", stiffness=2e4, displacement=(-1e-3, 0.0, 0.0))
    wall = Support(group="right", fixed="x")
    stiffness = 1e9 * 1e-3 / (1 - 0.3**2) / 2.0  # of the sheet, held across [N/m]
    for k in (2e4, 2e5):
        run = Stepper(membrane_model(sheet(HELD, wall, springs, expose=True)))
        run.set("support_stiffness[1]", k)
        run.initialize()
        q = np.array([run.get(f"node[{3 * i + 1}]") for i in np.flatnonzero(POINTS["left"](*SHEET.nodes.T))])
        assert q.mean() == pytest.approx(-1e-3 * k / (k + stiffness), rel=0.01)


def test_a_spring_that_is_very_stiff_is_a_wall():
    in_plane, left = Support(group="all", fixed="z"), Support(group="left")
    ways = (Support(group="right", fixed="xy", stiffness=stiffness) for stiffness in (0.0, 1e10))
    periods = [first_period(sheet(in_plane, left, way)) for way in ways]
    assert periods[0] == pytest.approx(periods[1], rel=1e-3)


def test_a_sheet_on_springs_moves_as_the_closed_form_says():
    """Free vibration: let go 5 mm beside its anchor, it swings with cos(20 t)."""
    springs = Support(group="left", fixed="x", stiffness=800.0)
    push = Load(name="push", kind="force", groups=("all",), direction=(1.0, 0.0, 0.0))
    structure = sheet(HELD, springs, loads=(push,), expose=True)
    run = Stepper(membrane_model(structure), push=4.0 / 20.0)  # 4 N on 20 nodes
    run.initialize()
    assert run.get("node[1]") == pytest.approx(5e-3, rel=0.01)
    run.set("push", 0.0)
    for _ in range(100):
        run.step(1e-3)
    assert run.get("node[1]") == pytest.approx(5e-3 * math.cos(20.0 * 0.1), abs=5e-5)


def test_springs_count_as_supports_but_only_in_their_directions():
    sheet(Support(group="all", stiffness=10.0))
    with pytest.raises(DescriptionError, match="free to move along x"):
        sheet(Support(group="all", fixed="yz", stiffness=10.0))


def test_an_input_does_not_move_a_spring():
    with pytest.raises(DescriptionError, match="an input moves rigid supports alone"):
        Support(group="left", stiffness=10.0, displacement=(1e-3, 0.0, 0.0), motion="way")


def test_a_spring_pulls_at_nodes_that_are_free_alone():
    """All of the stiffness acts on the nodes of the sheet that the wall on its left does not hold."""
    structure = sheet(HELD, Support(group="left"), Support(group="all", fixed="x", stiffness=100.0))
    assert structure.springs.sum() == pytest.approx(1.0)
    assert structure.springs.reshape(-1, 3)[POINTS["left"](*structure.mesh.nodes.T)].max() == 0.0


def test_on_a_frame_that_flies_springs_are_refused():
    with pytest.raises(DescriptionError, match="on a frame that flies supports are rigid"):
        membrane_model(sheet(Support(group="all", stiffness=10.0)), frame=True)


def test_springs_of_the_finer_mesh_are_as_stiff():
    structure = sheet(HELD, Support(group="left", fixed="x", stiffness=2e4), order=2)
    assert structure.finer().springs.sum() == pytest.approx(1.0)
    assert first_period(structure.finer()) == pytest.approx(first_period(structure), rel=1e-3)
