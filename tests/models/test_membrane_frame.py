"""The membrane on a frame that flies: its motion against an independent solution, and what it exerts on the frame."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from flight import get, matrix, put
from gossamer_models import ConvergenceError, Stepper
from gossamer_models.membrane import MembraneParams, Support, membrane_model, square_structure
from gossamer_models.mistakes import DescriptionError
from oracles.membrane import energy_function, equations, membrane, started
from oracles.meshes import thesis_square
from scipy.integrate import solve_ivp

AXIS = np.array([0.36, 0.48, 0.8])
PLACE = np.array([0.5, 0.1, 0.2])
HELD = [5, 12, 14]  # displacements of moving nodes: one in z, another in x and z
RATE, FREQUENCY, SHAKE = 3.0, 40.0, np.array([20.0, -10.0, 60.0])  # rad/s, rad/s, m/s2


@pytest.fixture(scope="module")
def model():
    return membrane_model(square_structure(4, 1), frame=True)


@pytest.fixture(scope="module")
def slowed():
    """The same with 25 times the inertia along its surface."""
    square = square_structure(4, 1)
    return membrane_model(replace(square, setup=replace(square.setup, inplane_mass=25.0)), frame=True)


@pytest.fixture(scope="module")
def partly():
    """The same with some nodes that are held in one direction or two."""
    return membrane_model(partly_held(square_structure(4, 1)), frame=True)


@pytest.fixture(scope="module")
def partly_slowed():
    square = partly_held(square_structure(4, 1))
    return membrane_model(replace(square, setup=replace(square.setup, inplane_mass=25.0)), frame=True)


def partly_held(square):
    free = square.free.reshape(-1, 3).copy()
    free[np.repeat(square.moving, 3), np.tile(range(3), len(square.moving))] = ~np.isin(
        np.arange(3 * len(square.moving)), HELD
    )
    return replace(square, free=free.ravel())


def rate(t):
    """Angular velocity about a fixed axis [rad/s]."""
    return RATE * np.cos(FREQUENCY * t) * AXIS


def mounted(model, **start):
    stepper = Stepper(model, **{"pressure_amplitude": 0.0, "mass_damping": 0.0} | start)
    put(stepper, "mount_position", PLACE)
    return stepper


def fly(stepper, times, push=500.0):
    """Shake and turn the frame from time to time, means over the steps; the pressure ends half way."""
    put(stepper, "angular_velocity", rate(times[0]))
    stepper.initialize()
    for a, b in pairwise(times):
        h = b - a
        put(stepper, "frame_acceleration", SHAKE * (np.cos(FREQUENCY * a) - np.cos(FREQUENCY * b)) / (FREQUENCY * h))
        put(stepper, "angular_velocity", rate(b))
        put(stepper, "angular_acceleration", (rate(b) - rate(a)) / h)
        stepper.set("pressure", push if b < 0.6 * times[-1] else 0.0)
        stepper.step(h)


def rest(n=4):
    """Rest positions of the interior nodes from the frame's origin [m], shape (nodes, 3)."""
    mesh = equations(n).mesh
    plane = 0.6 * (mesh.nodes[mesh.interior] - 0.5)
    return PLACE + np.column_stack([plane, np.zeros(len(plane))])


def test_on_a_frame_that_stands_still_or_moves_along_its_normal_it_is_the_same_membrane(model):
    plain, flying = started(membrane(4)), started(model)
    for k in range(100):
        shake = 30.0 * np.sin(0.1 * k)
        plain.set("base_acceleration", shake)
        flying.set("frame_acceleration[3]", shake)
        for stepper in (plain, flying):
            stepper.step(4e-4)
    for name in ("deflection", "strain[1]", "strain[4]", "w[2,6]", "largest_strain"):
        assert flying.get(name) == pytest.approx(plain.get(name), rel=1e-11)


def test_a_mesh_flies_as_the_square_membrane_does():
    """The origin of the mesh is its corner, that of the square membrane its centre."""
    square, mesh = (Stepper(membrane_model(s, frame=True)) for s in (square_structure(8, 1), thesis_square(8, 1)))
    for stepper, corner in ((square, 0.0), (mesh, 0.588 / 2)):
        stepper.set("pressure_amplitude", 1e4)
        stepper.set("enclosed_pressure", 0.3)
        put(stepper, "mount_position", (0.7 - corner, -corner, 0.2))
        put(stepper, "angular_velocity", (0.1, 0.2, 0.3))
        stepper.initialize()
    w, turning, h = np.array([0.1, 0.2, 0.3]), np.array([1.0, -0.5, 0.3]), 1e-4
    for _ in range(300):
        w = w + h * turning
        for stepper in (square, mesh):
            put(stepper, "frame_acceleration", (0.3, 0.1, -0.2))
            put(stepper, "angular_velocity", w)
            put(stepper, "angular_acceleration", turning)
            stepper.step(h)
    vectors = ("force", "torque", "momentum", "angular_momentum", "moving_first_moment", "held_first_moment")
    for name in vectors:
        one, other = (get(stepper, name) for stepper in (square, mesh))
        assert other == pytest.approx(one, abs=1e-11 * np.abs(one).max()), name
        assert np.abs(one).max() > 0.0
    for name in ("strain[1]", "moving_mass", "held_mass", "moving_inertia[1]", "held_inertia[5]"):
        assert mesh.get(name) == pytest.approx(square.get(name), rel=1e-11), name


def test_springs_cannot_ride():
    springs = (Support(group="rim", fixed="xyz", stiffness=1e5),)
    with pytest.raises(DescriptionError, match="on a frame that flies supports are rigid"):
        membrane_model(thesis_square(8, 1, supports=springs), frame=True)


@pytest.mark.parametrize(
    ("name", "k", "held"), [("model", 1.0, []), ("slowed", 25.0, []), ("partly", 1.0, HELD), ("partly_slowed", 25.0, HELD)]
)
def test_it_moves_as_the_apparent_accelerations_of_a_textbook_say(name, k, held, request):
    """An adaptive Runge-Kutta method on v' = A - c v, A = f/m - a - w' x r - w x (w x r) - 2 w x v; second order.

    With scaled inertia on what is left of A: all of it across the surface, 1/k of it along; nothing of what is held.
    """
    model = request.getfixturevalue(name)
    end, params, r0 = 0.02, MembraneParams(pressure_amplitude=0.0, mass_damping=30.0), rest()
    force, mass = equations(4).force, equations(4).node_mass(params)

    def motion(t, y, pressure):
        q, v = np.split(y, 2)
        w, w_dot = rate(t), -FREQUENCY * RATE * np.sin(FREQUENCY * t) * AXIS
        r, u = r0 + q.reshape(-1, 3), v.reshape(-1, 3)
        f = np.asarray(force(q, np.zeros(16), pressure, params.vector())).ravel() / mass
        field = SHAKE * np.sin(FREQUENCY * t) + np.cross(w_dot, r) + np.cross(w, np.cross(w, r)) + 2.0 * np.cross(w, u)
        A = (f - field.ravel()).reshape(-1, 3) / [k, k, 1.0]
        A.flat[held] = 0.0
        return np.concatenate([v, A.ravel() - params.mass_damping * v])

    y = np.zeros(2 * r0.size)
    for span, pressure in (((0.0, 0.6 * end), 500.0), ((0.6 * end, end), 0.0)):
        y = solve_ivp(motion, span, y, args=(pressure,), method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    errors = []
    for n in (50, 100, 200):
        stepper = mounted(model, mass_damping=30.0)
        fly(stepper, np.linspace(0.0, end, n + 1) - 1e-12)
        errors.append(np.linalg.norm(stepper.x[: r0.size] - y[: r0.size]) / np.linalg.norm(y[: r0.size]))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.25)
    assert errors[-1] < 1e-3


@pytest.mark.parametrize("name", ["partly", "partly_slowed"])
def test_what_is_held_in_a_direction_stays_there_and_pulls_at_the_frame_from_the_start(name, request):
    model = request.getfixturevalue(name)
    stepper = mounted(model)
    fly(stepper, np.linspace(0.0, 0.05, 201))
    assert np.abs(stepper.x[HELD]).max() < 1e-12
    assert np.abs(stepper.x[: rest().size]).max() > 1e-3
    forces = []
    for h in (0.0, 1e-5):
        stepper = mounted(model)
        put(stepper, "angular_velocity", (1.0, 2.0, 3.0))
        stepper.initialize()
        if h:
            stepper.step(h)
        forces.append([*get(stepper, "force"), *get(stepper, "torque")])
    np.testing.assert_allclose(*forces, atol=1e-4 * np.abs(forces).max())  # axes turn by 4e-5 rad in a step


@pytest.mark.parametrize("name", ["model", "slowed", "partly", "partly_slowed"])
@pytest.mark.parametrize("a", [np.zeros(3), np.array([3.0, -1.0, 5.0])])
def test_the_frame_takes_what_the_membrane_gives_in_any_step_that_is_divided(a, name, request):
    """Momentum and angular momentum about the origin, in the axes half way, in three or four parts.

    An acceleration that turns with the frame has the mean of its axes, (w h)^2/24 from those half way; that the first
    moment changes within the step is an error of this test's angular momentum.
    """
    w, h = np.array([0.7, -0.4, 1.1]), 2e-3
    stepper = mounted(request.getfixturevalue(name))
    put(stepper, "angular_velocity", w)
    put(stepper, "frame_acceleration", a)
    stepper.set("damage[3]", 0.5)
    stepper.initialize()
    q = np.concatenate([[np.cos(h * np.linalg.norm(w) / 4)], np.sin(h * np.linalg.norm(w) / 4) * w / np.linalg.norm(w)])
    half = matrix(q)  # over half a step
    largest = 0.0
    for _ in range(50):
        assert name.endswith("slowed") or stepper.get("max_step") < h / 2.0
        before = [get(stepper, name) for name in ("momentum", "angular_momentum", "moving_first_moment")]
        stepper.step(h)
        after = [get(stepper, name) for name in ("momentum", "angular_momentum", "moving_first_moment")]
        mass, middle = stepper.get("moving_mass"), (half @ after[2] + half.T @ before[2]) / 2.0
        force, torque = get(stepper, "force"), get(stepper, "torque")
        change = half @ after[0] - half.T @ before[0] + mass * h * a
        np.testing.assert_allclose(
            change, -h * force, rtol=0.0, atol=h * (1e-9 * np.linalg.norm(force) + 4e-7 * np.linalg.norm(a)) + 1e-13
        )
        spin = half @ after[1] - half.T @ before[1] + h * np.cross(middle, a)
        np.testing.assert_allclose(
            spin, -h * torque, rtol=0.0, atol=(2e-3 if a.any() else 1e-9) * h * np.linalg.norm(torque) + 1e-13
        )
        largest = max(largest, np.linalg.norm(force))
    assert largest > 0.1


@pytest.mark.parametrize("spin", [0.0, 1.0, 20.0])
def test_a_spinning_membrane_keeps_its_energy_to_second_order(model, spin):
    """Strain energy, motion relative to the frame and centrifugal potential (Jacobi's integral), 0.3 s, no damping."""
    params, w = MembraneParams(), spin * AXIS
    energy_of, mass, r0 = energy_function(equations(4).mesh, params), equations(4).node_mass(params)[::3], rest()
    zero, spread = energy_of(np.zeros(r0.size)), []
    for h in (2e-4, 1e-4):
        stepper = mounted(model)
        put(stepper, "angular_velocity", w)
        stepper.set("pressure", 300.0)
        stepper.initialize()
        for _ in range(round(0.01 / h)):
            stepper.step(h)
        stepper.set("pressure", 0.0)
        energies = []
        for _ in range(round(0.3 / h)):
            stepper.step(h)
            q, s = (part.reshape(-1, 3) for part in (stepper.x[: r0.size], stepper.x[r0.size : 2 * r0.size]))
            carried = np.cross(w, r0 + q)
            potential = mass @ (np.sum((s - carried) ** 2, axis=1) - np.sum(carried**2, axis=1)) / 2.0
            energies.append(energy_of(q.ravel()) - zero + potential)
        spread.append(np.ptp(energies))
    kinetic = 0.36 * 0.5**2
    assert spread[0] < 0.05 * kinetic
    assert spread[0] / spread[1] == pytest.approx(4.0, abs=1.5)


def test_scaled_inertia_changes_neither_what_rests_in_the_frame_nor_slow_motion_and_allows_longer_steps(model, slowed):
    """Spun up about its normal and shaken along its plane: strain, force and torque of both."""
    found = []
    for each in (model, slowed):
        stepper = mounted(each, mass_damping=100.0)
        stepper.initialize()
        w, h, rows = np.zeros(3), 4e-4, []
        for k in range(1500):
            speeding = np.array([0.0, 0.0, 80.0 * np.sin(np.pi * k / 1500.0) ** 2])
            w = w + h * speeding
            stepper.set("pressure", 500.0 * np.sin(np.pi * k / 1500.0) ** 2)
            put(stepper, "frame_acceleration", (0.0, 50.0 * np.sin(6e-3 * k), 0.0))
            put(stepper, "angular_velocity", w)
            put(stepper, "angular_acceleration", speeding)
            stepper.step(h)
            rows.append([stepper.get("strain[1]"), *get(stepper, "force"), *get(stepper, "torque")])
        found.append((np.array(rows), stepper.get("max_step")))
    (true, limit), (scaled, longer) = found
    assert longer > 2.5 * limit
    for column, other in zip(true.T, scaled.T, strict=True):
        assert np.abs(other - column).max() < 0.02 * np.ptp(column)


def test_the_edge_and_what_moves_have_the_mass_of_the_whole(model):
    stepper = mounted(model)
    stepper.initialize()
    mass, side = 1100.0 * 0.001 * 0.588**2, 0.6
    assert stepper.get("moving_mass") + stepper.get("held_mass") == pytest.approx(mass, rel=1e-12)
    S = get(stepper, "moving_first_moment") + get(stepper, "held_first_moment")
    np.testing.assert_allclose(S, mass * PLACE, rtol=1e-12)
    J = get(stepper, "moving_inertia", 6) + get(stepper, "held_inertia", 6)
    x, y, z = PLACE
    lumped = side**2 / 12.0 * (1.0 + 2.0 / 4**2)  # masses at the nodes of four elements along a side
    expected = [lumped + y**2 + z**2, lumped + x**2 + z**2, 2 * lumped + x**2 + y**2, -x * y, -x * z, -y * z]
    np.testing.assert_allclose(J, mass * np.array(expected), rtol=1e-10)


@pytest.mark.parametrize(("enclosed", "share"), [(0.0, 1.0), (1.0, 0.0), (0.25, 0.75)])
def test_a_steady_pressure_pushes_the_frame_as_it_would_a_plate(model, enclosed, share):
    """The resultant on any surface with this rim is pressure times the area within the rim."""
    stepper = mounted(model, mass_damping=400.0, enclosed_pressure=enclosed)
    stepper.set("pressure", 2000.0)
    stepper.initialize()
    for _ in range(300):
        stepper.step(1e-3)
    push = 2000.0 * 0.6**2 * np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(get(stepper, "force"), share * push, atol=1e-5 * push[2])
    np.testing.assert_allclose(get(stepper, "torque"), share * np.cross(PLACE, push), atol=1e-5 * push[2])


def test_a_membrane_mounted_askew_is_the_same_one_in_other_axes(model):
    q = np.array([0.5, -0.1, 0.7, 0.5]) / np.linalg.norm([0.5, -0.1, 0.7, 0.5])
    A = matrix(q)
    straight, askew = mounted(model), mounted(model)
    put(askew, "mount_position", A @ PLACE)
    put(askew, "mount_normal", 3.0 * A[:, 2])
    put(askew, "mount_x", 2.0 * A[:, 0] + 0.7 * A[:, 2])
    w, a = np.array([1.0, 2.0, -0.5]), np.array([4.0, 5.0, 6.0])
    for stepper, turn in ((straight, np.eye(3)), (askew, A)):
        put(stepper, "angular_velocity", turn @ w)
        put(stepper, "frame_acceleration", turn @ a)
        stepper.initialize()
        for _ in range(50):
            stepper.step(5e-4)
    assert askew.get("deflection") == pytest.approx(straight.get("deflection"), rel=1e-9)
    for name in ("force", "torque", "momentum", "angular_momentum", "moving_first_moment"):
        np.testing.assert_allclose(get(askew, name), A @ get(straight, name), rtol=1e-8, atol=1e-10)


def test_an_x_axis_along_the_normal_is_refused(model):
    stepper = mounted(model)
    put(stepper, "mount_x", (0.0, 0.0, 1.0))
    with pytest.raises(ConvergenceError, match="mount_x"):
        stepper.initialize()
