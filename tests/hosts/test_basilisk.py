"""A spacecraft in Basilisk carries the membrane and feels it, where Basilisk is installed: ``make test-basilisk``."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import gossamer
import numpy as np
import pytest
import scipy.linalg
from building import build_fmu
from gossamer_models.membrane import membrane_model, square_structure
from gossamer_orchestrator import load_scenario
from gossamer_orchestrator.errors import SimulationError
from gossamer_orchestrator.exchange.container import build_container
from gossamer_orchestrator.hosts.debt import Debt, turn
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).parents[2]
RUN = """
import json, runpy, sys
flight = runpy.run_path(sys.argv[1])["main"](sys.argv[2])
print(json.dumps({k: v.tolist() if hasattr(v, "tolist") else v for k, v in vars(flight).items()}))
"""


@pytest.mark.skipif(not importlib.util.find_spec("Basilisk"), reason="Basilisk is not installed: make test-basilisk")
@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_a_slew_and_a_thrust_ring_the_membrane_and_the_spacecraft_feels_it(fmus, tmp_path):
    """Asked: momentum and angular momentum to 1e-4 of the membrane's peak. Measured: 5e-7 and 8e-8."""
    container = build_container(load_scenario(ROOT / "docs/examples/ex01_sail.toml"), fmus, tmp_path / "sail.fmu")
    command = [sys.executable, "-c", RUN, ROOT / "docs/examples/ex01_basilisk.py", container]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    flight = {name: np.array(value) for name, value in json.loads(done.stdout.splitlines()[-1]).items()}

    for rows, peak in zip((flight["momentum"], flight["angular_momentum"]), flight["peaks"], strict=True):
        assert np.linalg.norm(rows - rows[0], axis=1).max() < 1e-4 * peak
    assert np.abs(flight["deflection"]).max() > 0.1
    time = 3e-4 * np.arange(1, 423)
    rigid = 20.0 / 80.0 * time  # the slew of the spacecraft alone; 10 kPa swing the membrane on a lever of 1.5 m
    swing = np.abs(flight["rate"][:422, 1] - rigid).max()
    assert 0.5 < swing / (flight["peaks"][1] / 80.0) < 1.0
    assert flight["damage"][0] == pytest.approx(0.4, abs=0.05)
    assert flight["damage"][1:].max() < 0.05


@pytest.mark.skipif(not importlib.util.find_spec("Basilisk"), reason="Basilisk is not installed: make test-basilisk")
@pytest.mark.parametrize(("modulus", "near"), [(1e7, 2e-4), (1e9, 2e-5)])
def test_a_stiff_membrane_is_slewed_as_a_rigid_part_of_its_spacecraft(modulus, near, tmp_path):
    """About y, on a lever of 1.5 m, without its own load: by the inertia of both about their centre of mass."""
    from Basilisk.simulation import extForceTorque, spacecraft
    from Basilisk.utilities import SimulationBaseClass, macros
    from gossamer_orchestrator.hosts.basilisk import FramedMembrane

    model = membrane_model(square_structure(4, 1), frame=True, compiled=True)
    path = build_fmu(model, tmp_path, Path(__file__), native=True)
    simulation, step, steps, torque = SimulationBaseClass.SimBaseClass(), 3e-4, 422, 20.0
    simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", macros.sec2nano(step)))
    vehicle, slew = spacecraft.Spacecraft(), extForceTorque.ExtForceTorque()
    vehicle.hub.mHub, vehicle.hub.IHubPntBc_B = 120.0, np.diag([90.0, 80.0, 60.0]).tolist()
    vehicle.addDynamicEffector(slew)
    slew.extTorquePntB_B = [0.0, torque, 0.0]
    given = {"pressure_amplitude": 0.0, "mount_position[1]": 1.5, "youngs_modulus": modulus}
    sail = FramedMembrane(path, vehicle, given)
    simulation.AddModelToTask("task", slew)
    sail.add_to(simulation, "task")
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(step) * steps)
    simulation.ExecuteSimulation()
    rate = vehicle.scStateOutMsg.read().omega_BN_B[1]

    hub, c = vehicle.hub, np.ravel(vehicle.hub.r_BcB_B)  # with the membrane's edge
    m, *S, J = sail.read("moving_mass", *(f"moving_first_moment[{k}]" for k in (1, 2, 3)), "moving_inertia[2]")
    sail.close()
    both = (hub.mHub * c + S) / (hub.mHub + m)
    inertia = hub.IHubPntBc_B[1][1] + hub.mHub * (c[0] ** 2 + c[2] ** 2) + J - (hub.mHub + m) * (both[0] ** 2 + both[2] ** 2)
    assert inertia > 80.5
    assert rate == pytest.approx(torque / inertia * step * steps, rel=near)


@pytest.mark.skipif(not importlib.util.find_spec("Basilisk"), reason="Basilisk is not installed: make test-basilisk")
def test_a_hub_that_the_modes_leave_without_mass_is_refused(tmp_path):
    """The masses of all modes add up to that of the membrane along x, y and z each."""
    from Basilisk.simulation import spacecraft
    from gossamer_orchestrator.hosts.basilisk import add_reduced

    path = gossamer.reduce(modes=120, out=tmp_path).files[0].with_name("reduced.npz")
    vehicle = spacecraft.Spacecraft()
    vehicle.hub.mHub, vehicle.hub.IHubPntBc_B = 0.01, np.diag([1e-3] * 3).tolist()
    with pytest.raises(SimulationError, match=r"modes of .* move .* kg, each along its own line, where the membrane has"):
        add_reduced(path, vehicle)
    assert vehicle.hub.mHub == 0.01


@pytest.mark.skipif(not importlib.util.find_spec("Basilisk"), reason="Basilisk is not installed: make test-basilisk")
def test_a_reduced_membrane_rings_on_a_free_spacecraft_as_both_together_do(tmp_path):
    """Mounted off the centre and turned; the frequency is that of the hub's and the membrane's mass matrices together."""
    from Basilisk.simulation import spacecraft
    from Basilisk.utilities import SimulationBaseClass, macros
    from gossamer_orchestrator.hosts.basilisk import add_reduced

    path = gossamer.reduce(modes=1, set={"mass_damping": 0.0}, out=tmp_path).files[0].with_name("reduced.npz")
    place, A = np.array([0.4, -0.1, 0.2]), Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    mass, J = 3.0, np.diag([0.5, 0.4, 0.6])
    simulation, step = SimulationBaseClass.SimBaseClass(), macros.sec2nano(2e-4)
    simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", step))
    vehicle = spacecraft.Spacecraft()
    vehicle.hub.mHub, vehicle.hub.IHubPntBc_B = mass, J.tolist()
    springs = add_reduced(path, vehicle, place, A)
    springs[0].rhoInit = 1e-3
    simulation.AddModelToTask("task", vehicle)
    for one in springs:
        simulation.AddModelToTask("task", one)
    log = vehicle.scStateOutMsg.recorder()
    simulation.AddModelToTask("task", log)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(500 * step)
    simulation.ExecuteSimulation()

    with np.load(path, allow_pickle=False) as file:
        M, K = file["M"], file["K"]
    cross = np.cross(np.eye(3), place)  # rows e x place
    T = np.block([[A.T, A.T @ cross.T], [np.zeros((3, 3)), A.T]])  # motion of the membrane's origin by that of the hub's
    free = np.eye(7)
    free[:6, :6] = T
    both = free.T @ M @ free
    both[:3, :3] += mass * np.eye(3)
    both[3:6, 3:6] += J
    omega = np.sqrt(scipy.linalg.eigh(K, both, eigvals_only=True)[-1])
    v = np.asarray(log.v_BN_N)[2:, 2] * 1e3
    rows = np.column_stack([v[1:-1], np.ones(len(v) - 2)])
    (cosine, _), *_ = np.linalg.lstsq(rows, v[2:] + v[:-2], rcond=None)
    assert np.ptp(v) > 1.0
    assert np.arccos(cosine / 2.0) / 2e-4 == pytest.approx(omega, rel=1e-3)


def test_a_turn_takes_vectors_from_the_turned_axes_to_the_first_ones():
    angle = np.array([0.3, -0.2, 0.5])
    R = turn(angle)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(turn(1e-3 * angle) @ [0.0, 0.0, 1.0], [-2e-4, -3e-4, 1.0], atol=1e-6)


def test_a_turning_body_receives_all_that_its_appendage_gives():
    """About a fixed axis, with any force: what is applied adds up, in inertial axes, but for the last difference."""
    rng, h, w, w_dot = np.random.default_rng(0), 1e-3, np.zeros(3), np.array([0.0, 0.0, 40.0])
    R, received, given = np.eye(3), np.zeros(6), np.zeros(6)
    force = rng.standard_normal(6)
    debt = Debt(force)
    both = lambda R, W: np.concatenate([R @ W[:3], R @ W[3:]])  # noqa: E731
    for _ in range(300):
        parts = [turn(w * t + w_dot * t**2 / 2.0) for t in (np.arange(200) + 0.5) / 200 * h]
        received += h * both(R @ np.mean(parts, axis=0), force)
        whole = turn(w * h + w_dot * h**2 / 2.0)
        half, R, w = R @ turn((w * h + w_dot * h**2 / 2.0) / 2.0), R @ whole, w + h * w_dot
        W = rng.standard_normal(6)
        given += h * both(half, W)
        force = debt.applied(R, w, w_dot, W, h)
        np.testing.assert_allclose(given, received + debt.owed, atol=1e-9)
    assert np.abs(given).max() > 1e-2
