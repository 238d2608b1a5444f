"""The rigid hub: closed forms, what it keeps, and that it receives all that its appendage gives."""

import numpy as np
import pytest
from flight import matrix
from gossamer_models import ParameterError, Stepper
from gossamer_models.hub import hub_model


@pytest.fixture(scope="module")
def model():
    return hub_model()


def put(stepper, **arrays):
    for name, values in arrays.items():
        for k, value in enumerate(values, 1):
            stepper.set(f"{name}[{k}]", float(value))


def get(stepper, name, size=3):
    return np.array([stepper.get(f"{name}[{k}]") for k in range(1, size + 1)])


def hub(model, mass=6.0, **arrays):
    stepper = Stepper(model, mass=mass)
    put(stepper, **({"inertia": (1.0, 1.0, 1.6, 0.0, 0.0, 0.0)} | arrays))
    stepper.initialize()
    return stepper


def test_a_symmetric_top_precesses_as_the_closed_form_says(model):
    """w_x + i w_y turns with (J_z - J_x) / J_x * w_z; fourth order."""
    errors = []
    for n in (100, 200, 400):
        top = hub(model, initial_angular_velocity=(0.5, 0.0, 2.0))
        for _ in range(n):
            top.step(10.0 / n)
        angle = 0.6 * 2.0 * 10.0
        errors.append(np.linalg.norm(get(top, "angular_velocity") - [0.5 * np.cos(angle), 0.5 * np.sin(angle), 2.0]))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(4.0, abs=0.2)
    assert errors[-1] < 2e-6


def test_a_free_body_keeps_momentum_and_energy(model):
    """Any body, centre of mass off the origin, 1000 steps: momentum to round-off, energy to fourth order."""
    spread = []
    for h in (0.01, 0.005):
        body = hub(
            model,
            inertia=(1.0, 2.0, 2.5, 0.1, -0.2, 0.3),
            centre_of_mass=(0.2, -0.1, 0.4),
            initial_angular_velocity=(0.7, 0.2, -1.0),
            initial_velocity=(0.3, 0.0, 0.1),
            initial_wheel_momentum=(0.0, 0.5, 0.0),
        )
        start = [get(body, name) for name in ("momentum", "angular_momentum")]
        energies = []
        for _ in range(round(10.0 / h)):
            body.step(h)
            energies.append(body.get("kinetic_energy"))
        for before, name in zip(start, ("momentum", "angular_momentum"), strict=True):
            np.testing.assert_allclose(get(body, name), before, atol=1e-11)
        assert np.linalg.norm(get(body, "attitude", 4)) == pytest.approx(1.0, abs=1e-14)
        wheels = energies + get(body, "wheel_momentum") @ np.zeros(3)
        spread.append(abs(wheels[-1] - wheels[0]))
    assert spread[0] < 1e-8
    assert spread[0] > 8.0 * spread[1]


def test_a_thruster_off_the_centre_pushes_and_turns(model):
    """F = m a and T = J w' for a body that starts at rest, over a short step; the wheels take what they are given."""
    body = hub(model, centre_of_mass=(0.0, 0.3, 0.0), inertia=(2.0, 2.0, 4.0, 0.0, 0.0, 0.0))
    put(body, thruster_force=(12.0, 0.0, 0.0), wheel_torque=(0.0, 0.0, 0.4))
    body.step(1e-4)
    turning = (0.3 * 12.0 - 0.4) / 4.0
    np.testing.assert_allclose(get(body, "angular_acceleration"), [0.0, 0.0, turning], atol=1e-8)
    np.testing.assert_allclose(get(body, "acceleration"), [12.0 / 6.0 + turning * 0.3, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(get(body, "wheel_momentum"), [0.0, 0.0, 0.4e-4], atol=1e-18)


def test_what_is_attached_moves_the_centre_of_mass_and_adds_inertia(model):
    """Two point masses make a dumb-bell: the same motion as one body of their sum."""
    ends = np.array([0.0, 0.0, 0.5])
    whole = hub(model, mass=5.0, centre_of_mass=ends / 5.0, inertia=(1.0 + 0.2, 1.0 + 0.2, 1.6, 0.0, 0.0, 0.0))
    parts = hub(model, mass=4.0)
    put(parts, attached_first_moment=ends, attached_inertia=(0.25, 0.25, 0.0, 0.0, 0.0, 0.0))
    parts.set("attached_mass", 1.0)
    for body in (whole, parts):
        put(body, thruster_force=(1.0, 2.0, 0.0))
        for _ in range(20):
            body.step(0.05)
    for name in ("position", "velocity", "angular_velocity", "momentum"):
        np.testing.assert_allclose(get(parts, name), get(whole, name), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("extrapolation", [0.0, 1.0])
def test_it_receives_all_that_its_appendage_gives(model, extrapolation):
    """Random forces, steps of random length, a hub that tumbles: all impulse but what is on its way."""
    rng = np.random.default_rng(0)
    body = Stepper(model, mass=6.0, extrapolation=extrapolation)
    put(body, inertia=(1.0, 2.0, 2.5, 0.0, 0.0, 0.0), initial_angular_velocity=(1.0, -2.0, 0.5))
    body.initialize()
    given, last, assumed = np.zeros(3), None, np.zeros(3)
    for _ in range(200):
        h, W = rng.uniform(1e-4, 1e-3), rng.standard_normal(3) * [5.0, 3.0, 1.0]
        if extrapolation and last is not None:  # over the last step, in its axes half way
            given += last @ W
        put(body, force=W)
        before = matrix(get(body, "attitude", 4))
        body.step(h)
        R = before + matrix(get(body, "attitude", 4))
        U, _, Vt = np.linalg.svd(R)
        last = h * U @ Vt  # the rotation half way
        assumed = last @ W
        if not extrapolation:
            given += assumed
    on_its_way = assumed if extrapolation else np.zeros(3)
    np.testing.assert_allclose(get(body, "momentum"), given + on_its_way, atol=2e-9)


def test_it_behaves_alike_in_every_frame_that_moves_evenly(model):
    rest, orbit = hub(model), hub(model, initial_velocity=(7.5e3, 0.0, 0.0))
    for k in range(100):
        for body in (rest, orbit):
            put(body, force=(np.sin(k), 2.0, 0.0), torque=(0.0, np.cos(k), 0.3))
            body.step(1e-3)
    for name, size in (("angular_velocity", 3), ("attitude", 4)):
        np.testing.assert_allclose(get(orbit, name, size), get(rest, name, size), atol=1e-13)


def test_a_hub_without_mass_is_refused(model):
    with pytest.raises(ParameterError, match="mass"):
        Stepper(model, mass=0.0).initialize()
