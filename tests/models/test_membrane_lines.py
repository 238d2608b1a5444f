"""Cables, beams and point masses: closed forms of statics and of vibration, balances of a step, and what is refused."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from flight import get
from gossamer_models import Stepper
from gossamer_models.membrane import (
    Beam,
    Built,
    Cable,
    Equilibrium,
    Linearised,
    Load,
    MembraneEquations,
    PointMass,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    make_structure,
    membrane_model,
    read_structure,
    surface_mesh,
)
from gossamer_models.membrane.portable import structure_text
from gossamer_models.mistakes import DescriptionError
from gossamer_models.twin.forward import MembraneForward
from gossamer_models.variables import by_name
from oracles.meshes import meshed, rectangle
from scipy.optimize import brentq

FILM = Region(youngs_modulus=1e9, poisson_ratio=0.0, density=1000.0, thickness=1e-4)
PATCH = meshed([lambda s, t: (-1.0 + 0.1 * s, 0.1 * t, 0.0 * s)], 1, faces={"patch": lambda x, y, z: x < 9.0})
ENDS = Support(group="rope_start"), Support(group="rope_end")
E, RADIUS, LENGTH, DENSITY = 70e9, 5e-3, 2.0, 2700.0
EI, MASS = E * np.pi * RADIUS**4 / 4.0, DENSITY * np.pi * RADIUS**2  # [N m2], [kg/m]
TUBE = {"youngs_modulus": E, "area": np.pi * RADIUS**2, "second_moment": np.pi * RADIUS**4 / 4.0, "density": DENSITY}
ROPE = {"youngs_modulus": 1e9, "area": 1e-5, "density": 1000.0}


def beside_a_patch(*supports, **setup):
    """Return lines beside a piece of film that is held."""
    setup = {"regions": (FILM,), "supports": (Support(group="patch"), *supports)} | setup
    return make_structure(Setup(**setup), surface_mesh(PATCH, setup.get("order", 1)))


def rope(parts=10, **more):
    return Cable(name="rope", path=((0.0, 0.0, 0.0), (2.0, 0.0, 0.0)), parts=parts, **ROPE | more)


def boom(parts, tip=0.0, force=0.0, **more):
    """Return a cantilever along x; the force at its tip acts along z."""
    beam = Beam(name="boom", path=((0.0, 0.0, 0.0), (LENGTH, 0.0, 0.0)), parts=parts, clamped=("boom_start",), **TUBE | more)
    masses = (PointMass(group="boom_end", mass=tip),) if tip else ()
    return beside_a_patch(
        beams=(beam,), masses=masses, loads=(Load(name="push", kind="force", groups=("boom_end",), start=force),)
    )


def forces(structure, nodes, **given):
    """Return what pulls at nodes [N], shape (N, 3), where they are, by the equations of the step."""
    model, equations = membrane_model(structure), MembraneEquations(structure)
    p_rows, u_rows, _ = model.slices()
    start = [given.get(v.name, v.start or 0.0) for v in model.variables]
    u, p = by_name(model.variables[u_rows], ca.DM(start[u_rows])), by_name(model.variables[p_rows], ca.DM(start[p_rows]))
    x = ca.DM(nodes[structure.order].ravel())
    found = equations.forces(x, equations.shared(u, p, ca.MX(0.0), ca.MX(0.0)), u, p)
    f = np.asarray(ca.evalf(found.f)).reshape(-1, 3)
    return f[np.argsort(structure.order)]


def test_a_hanging_cable_is_a_catenary_that_stretches():
    """1.3 m between supports 1 m apart; second order in the segments."""
    span, length, EA, weight = 1.0, 1.3, 2e3, 2.0 * 9.81

    def beyond(H):
        return H * length / EA + 2.0 * H / weight * np.arcsinh(weight * length / 2.0 / H) - span

    H = brentq(beyond, 0.1, 20.0)
    sag = weight * length**2 / 8.0 / EA + H / weight * (np.hypot(1.0, weight * length / 2.0 / H) - 1.0)
    errors = []
    for parts in (10, 20, 40):
        cable = Cable(
            name="rope", path=((0.0,) * 3, (span, 0.0, 0.0)), parts=parts, youngs_modulus=EA / 1e-4, area=1e-4, density=2e4,
            length=length,
        )  # fmt: skip
        structure = beside_a_patch(*ENDS, cables=(cable,))
        found = Equilibrium(structure, membrane_model(structure)).solve({"base_acceleration": (0.0, 0.0, 9.81)})
        errors.append(-found.displacement[0][:, 2].min() / sag - 1.0)
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx(4.0, abs=0.1)
    assert abs(errors[-1]) < 5e-4


def test_a_taut_cable_vibrates_as_a_string():
    exact = np.repeat(np.arange(1, 4), 2) / 2.0 / 2.0 * np.sqrt(50.0 / (0.01 / (1.0 + 50.0 / 1e4)))
    first = [Linearised(beside_a_patch(*ENDS, cables=(rope(n, tension=50.0),))).modes(6).frequencies for n in (10, 20)]
    errors = [np.abs(each / exact - 1.0).max() for each in first]
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.2)
    assert errors[1] < 0.01


def test_a_cable_carries_no_compression_and_a_beam_does():
    short = Support(group="rope_end", displacement=(-0.1, 0.0, 0.0))
    for line, pull in ((rope(), 0.0), (Beam(name="rope", path=rope().path, **TUBE), E * TUBE["area"] * 0.05)):
        kind = "cables" if isinstance(line, Cable) else "beams"
        structure = beside_a_patch(ENDS[0], short, **{kind: (line,)})
        f = forces(structure, structure.mesh.nodes * [0.95, 1.0, 1.0])[structure.mesh.points["rope_start"][0]]
        assert f == pytest.approx([-pull, 0.0, 0.0])


@pytest.mark.parametrize("tip", [0.0, 0.3])
def test_a_cantilever_vibrates_as_in_closed_form_with_a_mass_at_its_tip_too(tip):
    """Euler-Bernoulli, whose tip is free of moment: 1 + cos cosh + mu x (cos sinh - sin cosh) = 0."""
    c, s, ch, sh, share = np.cos, np.sin, np.cosh, np.sinh, tip / (MASS * LENGTH)

    def characteristic(x):
        return 1.0 + c(x) * ch(x) + share * x * (c(x) * sh(x) - s(x) * ch(x))

    roots = np.array([brentq(characteristic, 0.5, 2.5), brentq(characteristic, 3.3, 5.0)])
    exact = np.repeat(roots**2, 2) / LENGTH**2 * np.sqrt(EI / MASS) / (2.0 * np.pi)
    errors = [np.abs(Linearised(boom(n, tip)).modes(4).frequencies / exact - 1.0).max() for n in (20, 40, 80)]
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx(4.0, abs=0.1)
    assert errors[-1] < 1e-3


@pytest.mark.parametrize(("load", "along", "across"), [(1.0, 0.05643, 0.30172), (10.0, 0.55500, 0.81061)])
def test_a_cantilever_that_bends_far_is_the_elastica(load, along, across):
    """Table 1 of K. Mattiasson, International Journal for Numerical Methods in Engineering 17, 145-153, 1981."""
    structure = boom(40, force=load * EI / LENGTH**2)
    found = Equilibrium(structure, membrane_model(structure)).solve({"mass_damping": 0.0})
    tip = found.displacement[0][structure.mesh.points["boom_end"][0]] / LENGTH
    assert tip == pytest.approx([-along, 0.0, across], abs=1e-3 * across)


@pytest.mark.parametrize("parts", [20, 40])
def test_a_beam_is_rolled_to_a_circle_by_a_couple_at_its_ends(parts):
    """Where it is a circle of its length, nothing pulls at its inside; the couple is EI over the radius."""
    structure = boom(parts)
    line, angle = structure.mesh.lines["boom"], 2.0 * np.pi / parts
    nodes, h = structure.mesh.nodes.copy(), LENGTH / parts
    turned = angle * (np.arange(parts) + 0.5)  # of each segment
    chain = [line[0, 0], *line[:, 1]]
    nodes[chain, 0] = np.concatenate([[0.0], np.cumsum(h * np.cos(turned))])
    nodes[chain, 2] = np.concatenate([[0.0], np.cumsum(h * np.sin(turned))])
    f = forces(structure, nodes)
    assert nodes[chain[-1]] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert np.abs(f[chain[2:-2]]).max() < 1e-6 * np.abs(f[chain[-1]]).max()
    couple = np.cross(nodes[chain[-2:]], f[chain[-2:]]).sum(axis=0)
    assert couple == pytest.approx([0.0, 2.0 * np.pi * EI / LENGTH, 0.0], rel=1e-5, abs=1e-6)


def energy_of(structure, nodes, parts):
    """Return the energy of a boom [J]: of stretch and of the angles between segments."""
    line, ghost = structure.mesh.lines["boom"], structure.mesh.clamped[0, 0]
    chain = [ghost, line[0, 0], *line[:, 1]]
    e, h = np.diff(nodes[chain], axis=0), LENGTH / parts
    l = np.linalg.norm(e, axis=1)
    t = e / l[:, None]
    angle = 2.0 * np.arcsin(np.linalg.norm(t[1:] - t[:-1], axis=1) / 2.0)
    share = np.where(np.arange(parts) == 0, 0.5, 1.0) * h
    return E * TUBE["area"] * np.sum((l[1:] - h) ** 2) / (2.0 * h) + EI / 2.0 * np.sum(angle**2 / share)


def test_a_boom_let_go_keeps_its_energy_to_second_order():
    """A tip mass, bent by a third of the length; 20 ms without damping."""
    parts, spread = 8, []
    structure = boom(parts, tip=0.3, force=EI / LENGTH**2)
    mass = structure.mass[structure.moving]
    for h in (2e-5, 1e-5):
        run = Stepper(membrane_model(structure))
        run.initialize()
        run.set("push", 0.0)
        rows = []
        for _ in range(round(0.02 / h)):
            run.step(h)
            q, v = np.split(run.x[: 6 * len(mass)], 2)
            nodes = structure.mesh.nodes.copy()
            nodes[structure.moving] += q.reshape(-1, 3)
            rows.append([energy_of(structure, nodes, parts), mass @ np.sum(v.reshape(-1, 3) ** 2, axis=1) / 2.0])
        total = np.sum(rows, axis=1)
        spread.append(np.ptp(total) / total[0])
    assert np.ptp(rows, axis=0)[1] > 0.01 * total[0]  # it moves
    assert spread[0] < 1e-3
    assert spread[0] / spread[1] == pytest.approx(4.0, abs=1.0)


def test_the_frame_takes_what_a_boom_with_a_tip_mass_gives():
    """Force and torque of the clamp are the change of momentum and angular momentum, to round-off."""
    run = Stepper(membrane_model(boom(8, tip=0.3, force=3.0), frame=True), mass_damping=0.0)
    run.initialize()
    run.set("push", 0.0)
    h, largest = 1e-5, 0.0
    for _ in range(200):
        before = get(run, "momentum"), get(run, "angular_momentum")
        run.step(h)
        for was, name, takes in zip(before, ("momentum", "angular_momentum"), ("force", "torque"), strict=True):
            np.testing.assert_allclose(get(run, name) - was, -h * get(run, takes), rtol=0.0, atol=1e-12)
        largest = max(largest, np.linalg.norm(get(run, "torque")))
    assert largest == pytest.approx(3.0 * LENGTH, rel=0.01)
    assert run.get("moving_mass") + run.get("held_mass") == pytest.approx(0.3 + MASS * LENGTH + 1e-3)


def sail_on_booms(factor):
    """Return a strip of film, taut between the tips of two booms and a wall, with so many times its inertia along it."""
    beams = tuple(
        Beam(name=f"boom{k}", path=((-1.0, 0.1 * k, 0.0), f"corner{k}"), parts=4, clamped=(f"boom{k}_start",), **TUBE)
        for k in (0, 1)
    )
    push = Load(name="push", kind="dead_pressure", start=0.2)
    masses = (PointMass(group="boom0_end", mass=0.02),)
    return strip(supports=(Support(group="right"),), beams=beams, masses=masses, loads=(push,), inplane_mass=factor)


def test_a_film_of_scaled_inertia_on_booms_of_true_inertia_swings_as_it_does_unscaled():
    """Let go from a push: both tips along z over half a period of the booms; steps are those of the booms alone."""
    histories, steps = [], []
    for factor in (1.0, 100.0):
        structure = sail_on_booms(factor)
        run = Stepper(membrane_model(structure))
        run.initialize()
        run.set("push", 0.0)
        tips = [int(np.flatnonzero(structure.moving == structure.mesh.points[f"boom{k}_end"][0])[0]) for k in (0, 1)]
        rows = []
        for _ in range(120):
            run.step(1e-3)
            rows.append(run.x[[3 * tip + 2 for tip in tips]])
        histories.append(np.array(rows))
        steps.append(run.get("max_step"))
    size = np.abs(histories[0]).max()
    assert 1e-9 * size < np.abs(histories[1] - histories[0]).max() < 2e-3 * size  # it is scaled, and that changes little
    assert histories[0].min() < -0.5 * size
    assert steps[1] >= steps[0]


def test_a_frame_takes_all_momentum_of_a_film_of_scaled_inertia_on_booms():
    """To round-off after it is let go: 1e-12 N s of 7e-5 N s. Asked: 1e-4."""
    run = Stepper(membrane_model(sail_on_booms(100.0), frame=True), mass_damping=0.0)
    run.initialize()
    run.set("push", 0.0)
    for _ in range(200):
        before = get(run, "momentum"), get(run, "angular_momentum")
        run.step(2e-5)
        for was, name, takes in zip(before, ("momentum", "angular_momentum"), ("force", "torque"), strict=True):
            np.testing.assert_allclose(get(run, name) - was, -2e-5 * get(run, takes), rtol=0.0, atol=1e-12)
    assert np.linalg.norm(get(run, "momentum")) > 5e-5


@pytest.mark.parametrize("tip", [0.0, 5.0])
def test_the_step_that_is_offered_is_nearly_the_longest(tip):
    """60 % of 2 over the highest frequency, which the bound is above, by no more than a tenth."""
    structure = boom(10, tip)
    known = Linearised(structure)
    highest = np.sqrt(np.linalg.eigvalsh(known.K.toarray() / np.sqrt(np.outer(*[known.M.diagonal()] * 2)))[-1])
    run = Stepper(membrane_model(structure))
    run.initialize()
    assert 0.9 < run.get("max_step") / (1.2 / highest) <= 1.0


def strip(**setup):
    """Return a film of 1 m by 0.1 m without Poisson's ratio, taut along x."""
    groups = {"left": lambda x, y, z: x < 1e-9, "right": lambda x, y, z: x > 1.0 - 1e-9}
    groups |= {f"side{k}": lambda x, y, z, k=k: abs(y - 0.1 * k) < 1e-9 for k in (0, 1)}
    corners = {f"corner{k}": lambda x, y, z, k=k: (x < 1e-9) & (abs(y - 0.1 * k) < 1e-9) for k in (0, 1)}
    film = Region(youngs_modulus=1e9, poisson_ratio=0.0, density=1000.0, thickness=1e-4, prestress=(1e6, 0.0, 0.0))
    file = meshed([rectangle(1.0, 0.1)], (16, 1), edges=groups, points=corners)
    return make_structure(Setup(regions=(film,), **setup), surface_mesh(file))


def test_cords_along_the_edges_of_a_film_stiffen_it_as_in_closed_form():
    """10 N of film and 20 N in each of two cords, with the mass of all three."""
    one = {"youngs_modulus": 1e10, "area": 1e-6, "density": 1500.0, "tension": 20.0}
    cords = tuple(Cable(name=f"cord{k}", group=f"side{k}", **one) for k in (0, 1))
    held = tuple(Support(group=name) for name in ("left", "right"))
    modes = Linearised(strip(supports=held, cables=cords)).modes(6)
    bent = np.argmax(modes.participation[:, 2] ** 2)  # along z
    speed = np.sqrt((10.0 + 2 * 20.0) / (0.01 + 2 * 1500.0 * 1e-6))
    assert modes.frequencies[bent] == pytest.approx(speed / 2.0, rel=4e-3)


def test_booms_whose_tips_carry_a_film_vibrate_as_in_closed_form():
    """Half of a film, a string of 5 N, goes on from each tip: a beam in tension, and what the tip takes from the string."""
    beams = tuple(
        Beam(name=f"boom{k}", path=((-1.0, 0.1 * k, 0.0), f"corner{k}"), parts=40, clamped=(f"boom{k}_start",), **TUBE)
        for k in (0, 1)
    )
    modes = Linearised(strip(supports=(Support(group="right"),), beams=beams)).modes(8)
    found = modes.frequencies[np.argmax(modes.participation[:, 2] ** 2)]
    T, line = 5.0, 0.005

    def residual(f):
        omega2 = (2.0 * np.pi * f) ** 2
        a, b = T / (2.0 * EI), np.sqrt((T / (2.0 * EI)) ** 2 + MASS * omega2 / EI)
        k, K = np.sqrt(b - a), np.sqrt(b + a)  # w = A (cos kx - cosh Kx) + B (sin kx / k - sinh Kx / K)
        c, s, ch, sh = np.cos(k), np.sin(k), np.cosh(K), np.sinh(K)
        moment = [-(k**2) * c - K**2 * ch, -k * s - K * sh]
        w = [c - ch, s / k - sh / K]
        slope = [-k * s - K * sh, c - ch]
        third = [k**3 * s - K**3 * sh, -(k**2) * c - K**2 * ch]
        n = np.sqrt(line * omega2 / T)
        shear = [EI * d3 - T * d1 - T * n / np.tan(n) * d0 for d0, d1, d3 in zip(w, slope, third, strict=True)]
        return moment[0] * shear[1] - moment[1] * shear[0]

    assert found == pytest.approx(brentq(residual, 2.0, 9.0), rel=3e-3)


def test_a_cable_that_cools_is_taut_and_a_beam_that_warms_longer_in_closed_form():
    """A cable between fixed ends carries EA alpha times its cooling; a free boom lengthens by its strain. Exact."""
    cable, expansion = rope(thermal_expansion=2e-5), 1e-5
    film = replace(FILM, thermal_expansion=1e-4)
    beam = Beam(name="boom", path=((0.0, 1.0, 0.0), (LENGTH, 1.0, 0.0)), parts=4, **TUBE | {"thermal_expansion": expansion})
    held = *ENDS, Support(group="boom_start"), Support(group="boom", fixed="yz")
    structure = beside_a_patch(*held, regions=(film,), cables=(cable,), beams=(beam,))
    model = Stepper(membrane_model(structure))
    names = {v.name: v.description for v in structure.table if v.name.startswith("temperature")}
    assert ["rest" if "region" in text else text.split()[4] for text in names.values()] == ["rest", "boom", "rope"]
    for name, value in zip(names, (10.0, 50.0, -80.0), strict=True):
        model.set(name, value)
    model.initialize()
    at = model.x[: 3 * len(structure.moving)].reshape(-1, 3)
    tip = np.flatnonzero(structure.moving == structure.mesh.points["boom_end"][0])
    assert at[tip, 0] == pytest.approx([LENGTH * expansion * 50.0], rel=1e-9)
    pull = forces(structure, structure.mesh.nodes, **{"temperature[3]": -80.0})[structure.mesh.points["rope_start"][0]]
    assert pull == pytest.approx([1e9 * 1e-5 * 2e-5 * 80.0, 0.0, 0.0], rel=1e-9)


def test_a_cable_is_a_zone_and_its_strain_a_reading():
    """At rest under its own tension between a wall and a spring; half of its stiffness lost halves the pull."""
    sensor = Sensor(point=(0.3, 0.0, 0.0), direction=(1.0, 0.0, 0.0), line="rope")
    hook = Support(group="rope_end", fixed="x", stiffness=1e4), Support(group="rope_end", fixed="yz"), ENDS[0]
    structure = beside_a_patch(*hook, cables=(rope(tension=50.0, zone=True),), sensors=(sensor,), zones=(Zone(name="film"),))
    assert structure.zone_names == ("film", "rope")
    equilibrium = Equilibrium(structure, membrane_model(structure))
    damage = np.array([[0.0, 0.0], [0.0, 0.5]])
    found, L, EA = equilibrium.solve({"damage": damage}), 2.0 / (1.0 + 50.0 / 1e4), np.array([1e4, 5e3])
    stretch = EA * (2.0 - L) / L / (1e4 + EA / L)  # of the spring
    assert found.strain[:, 0] == pytest.approx(-stretch / 2.0, rel=1e-6)
    slope = equilibrium.derivatives(found, ["damage"]).strain[0, :, 0]
    near = equilibrium.solve({"damage": [[0.0, 1e-5]]}).strain[0, 0]
    assert slope == pytest.approx([0.0, (near - found.strain[0, 0]) / 1e-5], rel=1e-4, abs=1e-9)


def test_a_batch_of_cases_runs_as_the_model_does():
    """A film with cords, one of which loses 40 % of its stiffness, under a pressure that begins."""
    sensor = Sensor(point=(0.5, 0.0, 0.0), direction=(1.0, 0.0, 0.0), line="cord")
    cord = Cable(name="cord", group="side0", tension=20.0, zone=True, **ROPE)
    structure = strip(supports=(Support(group="left"), Support(group="right")), cables=(cord,), sensors=(sensor,))
    strain = MembraneForward(structure).strain(np.array([[0.4]]), {}, {"pressure": np.full((1, 20), 5.0)}, 20, 1e-3)
    run = Stepper(membrane_model(structure))
    run.set("damage[1]", 0.4)
    run.initialize()
    run.set("pressure", 5.0)
    found = [run.step(1e-3) or run.get("strain[1]") for _ in range(20)]
    assert strain[0, 0] == pytest.approx(found, rel=1e-6)


def test_a_beam_that_is_drawn_bent_is_remarked_on():
    bent = Beam(name="arm", path=((0.0,) * 3, (1.0, 0.0, 0.0), (1.0, 1.0, 0.0)), clamped=("arm_start",), **TUBE)
    assert "90 degrees" in " ".join(beside_a_patch(beams=(bent,)).remarks)
    assert "bent" not in " ".join(boom(4).remarks)


def test_lines_are_the_same_read_back_and_finer_with_a_finer_mesh():
    structure = boom(10, tip=1.0)
    again, finer = read_structure(structure_text(structure)), structure.finer()
    np.testing.assert_array_equal(again.mesh.nodes, structure.mesh.nodes)
    np.testing.assert_array_equal(again.mass, structure.mass)
    assert len(finer.mesh.lines["boom"]) == 20
    assert finer.mass.sum() == pytest.approx(structure.mass.sum())


PATH = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
AS_DRAWN = Built(centre=(0.0, 0.0, 0.0), size=1.0, coefficients=(0.0,))


@pytest.mark.parametrize(
    ("line", "more", "message"),
    [
        (Cable(name="a", path=(PATH[0], "tip"), **ROPE), {}, "no group 'tip' of nodes"),
        (Cable(name="a", path=(PATH[0], "patch"), **ROPE), {}, "'patch' holds 4 nodes"),
        (Cable(name="a", group="edge", **ROPE), {}, "no group 'edge' of edges"),
        (Cable(name="a", path=PATH, **ROPE), {}, "free to move"),
        (Beam(name="a", path=PATH, **TUBE), {}, "free to move"),
        (Beam(name="a", path=PATH, clamped=("patch",), **TUBE), {}, "no end of the beam is in the group 'patch'"),
        (Cable(name="a", path=(PATH[0], PATH[0]), **ROPE), {}, "two places of it in a row are one"),
        (Cable(name="patch", path=PATH, **ROPE), {}, "there is a group 'patch' already"),
        (
            Cable(name="a", path=(PATH[0], (-0.95, 0.05, 0.0)), **ROPE),
            {},
            "is on the surface, but at no corner of an element",
        ),
        (
            Cable(name="a", path=PATH, **ROPE),
            {"built": Built(centre=(0.0, 0.0, 0.0), size=1.0, coefficients=(0.0,))},
            "Name groups of nodes in 'path'",
        ),
        (Cable(name="a", path=PATH, **ROPE), {"masses": (PointMass(group="b", mass=1.0),)}, "no group 'b' of nodes"),
    ],
)
def test_lines_that_do_not_fit_are_refused(line, more, message):
    table = {"cables" if isinstance(line, Cable) else "beams": (line,)}
    with pytest.raises(DescriptionError, match=message):
        beside_a_patch(**table, **more)


def test_a_clamp_holds_the_beam_that_has_it_and_no_other_along_the_same_edge():
    beams = Beam(name="held", group="side0", clamped=("left",), **TUBE), Beam(name="hinged", group="side0", **TUBE)
    held = Support(group="left"), Support(group="right")
    both, alone = (strip(supports=held, beams=each) for each in (beams, beams[1:]))
    assert [len(each.mesh.clamped) for each in (both, alone)] == [1, 0]
    (_, bent), (_, of_hinged) = both.lines, alone.lines
    assert np.sum(bent.line == 1) == len(of_hinged.nodes) == np.sum(bent.line == 0) - 1


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"tension": -3.0}, "'tension' is -3 N, and a cable carries tension alone"),
        ({"tension": 3.0, "length": 2.0}, "both say how taut it is"),
        ({"group": "edge"}, "Write one of them"),
    ],
)
def test_a_cable_that_means_nothing_is_refused(wrong, message):
    with pytest.raises(DescriptionError, match=message):
        rope(**wrong)
