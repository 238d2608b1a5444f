"""The membrane's explicit step: order, cuts of time, stability limit, energy, damping and load."""

import casadi as ca
import numpy as np
import pytest
from gossamer_models import InputError, simulate
from gossamer_models.membrane import MembraneParams
from oracles.membrane import energy_function, equations, membrane, motion, started, vectors
from oracles.modal import natural_frequencies
from oracles.statics import integrate_implicit, static_deflection

CENTRE = 3 * equations(8).mesh.centre + 2


@pytest.fixture(scope="module")
def model():
    return membrane(8)


@pytest.fixture(scope="module")
def small():
    return membrane(4)


def deflections(stepper, steps):
    return simulate(stepper, steps, {}, ["deflection"])["deflection"]


def relative(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(b)


def test_the_explicit_step_is_of_second_order(model):
    """Halving the step quarters the distance to a fine solution."""
    end = 0.03
    fine = deflections(started(model), 3200 * [end / 3200])[-1]
    errors = [abs(deflections(started(model), n * [end / n])[-1] - fine) for n in (200, 400, 800)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize(
    ("n", "order", "samples", "parts", "spread", "nearest"),
    [(8, 1, 12, (5, 10, 20), 0.2, 1.5e-3), (4, 4, 6, (10, 20), 0.3, 2e-3)],
)
def test_explicit_and_implicit_steps_converge_to_each_other(n, order, samples, parts, spread, nearest):
    mesh, steps = equations(n, order), 80 if order == 1 else 120
    fine = deflections(started(membrane(n, order)), samples * steps * [2e-3 / steps])[steps - 1 :: steps]  # every 2 ms
    distance = []
    for per_sample in parts:
        history = integrate_implicit(mesh, MembraneParams(), samples * per_sample, h=2e-3 / per_sample)
        distance.append(relative(history.q[per_sample::per_sample, 3 * mesh.mesh.centre + 2], fine))
    rates = np.log2(np.array(distance[:-1]) / distance[1:])
    assert rates == pytest.approx(2.0, abs=spread)
    assert distance[-1] < nearest


def test_an_explicit_step_is_closer_to_the_converged_run_than_an_implicit_one_of_the_same_length(model):
    """Measured over 0.1 s: 0.00095 explicit (two internal steps), 0.0076 Newmark."""
    fine = deflections(started(model), 333 * 16 * [3e-4 / 16])[15::16]
    explicit = relative(deflections(started(model), 333 * [3e-4]), fine)
    history = integrate_implicit(equations(8), MembraneParams(), 333)
    implicit = relative(history.q[1:, CENTRE], fine)
    assert explicit < 2e-3
    assert implicit > 3.0 * explicit


def test_the_result_depends_on_the_cuts_of_time_to_second_order_only(model):
    distance = []
    for n in (1, 2, 4):
        even = deflections(started(model), 150 * n * [2e-4 / n])[-1]
        uneven = deflections(started(model), 50 * n * [0.5e-4 / n, 2.5e-4 / n, 2e-4 / n, 1e-4 / n])[-1]
        distance.append(abs(uneven - even))
    assert distance[0] < 1e-3 * 0.1
    assert distance[1] < distance[0] / 3.0
    assert distance[2] < distance[1] / 3.0


def test_a_long_communication_step_equals_its_parts(model):
    one, two = started(model), started(model)
    simulate(one, 50 * [3e-4], {}, [])
    simulate(two, 100 * [1.5e-4], {}, [])
    for name in ("deflection", "strain[2]", "w[1,2]"):
        assert one.get(name) == pytest.approx(two.get(name), rel=1e-12)
    with pytest.raises(InputError, match="internal steps"):
        one.step(100.0)


def test_the_default_run_needs_two_internal_steps_per_3e_4_seconds(model):
    for damping in (0.0, 20.0):
        stepper = started(model, mass_damping=damping)
        limits = simulate(stepper, 600 * [3e-4], {}, ["max_step"])["max_step"]
        assert stepper.get("strain[1]") > -1.0
        assert 1.5e-4 < limits.min() <= limits.max() < 3e-4


SQUARES = [(n, 1, 6, 0.45) for n in (4, 8, 16)] + [(4, order, 4 if order < 5 else 2, 0.75) for order in (2, 3, 4, 5, 8)]


@pytest.mark.parametrize(("n", "order", "cases", "highest"), SQUARES)
def test_max_step_stays_below_the_true_limit_and_not_far_below(n, order, cases, highest):
    """2/omega_max of the assembled, stretched mesh, flat and under static pressure, with and without damage."""
    mesh, model, params = equations(n, order), membrane(n, order), MembraneParams()
    loaded = [(0.0, {}), (1e4, {6: 0.95}), (1e4, {}), (1e5, {}), (1e4, {1: 0.4}), (0.0, {6: 0.8})]
    for pressure, damage in loaded[:cases]:  # statics of high orders take long
        d = np.array([damage.get(k, 0.0) for k in range(1, 17)])
        q = static_deflection(mesh, params, pressure, d, load_steps=8 if order == 1 or pressure == 1e5 else 3)
        loads = {"pressure": pressure, **{f"damage[{k}]": value for k, value in damage.items()}}
        x = np.concatenate([q, np.zeros(mesh.n_q + 1)])
        _, y = model.step(x, *vectors(model, pressure_amplitude=0.0, **loads), 1e-9)
        true = 1.0 / (np.pi * natural_frequencies(mesh, params, q, d, count=1, highest=True)[0])
        assert 0.3 < float(y[-1]) / true < highest


def test_steps_beyond_the_true_limit_would_indeed_be_unstable(model):
    """The step the limit protects from: the same function, called directly."""
    undamped, n_q = MembraneParams(mass_damping=0.0), equations(8).n_q
    u, p = vectors(model, mass_damping=0.0, pressure_amplitude=0.0)
    true = 1.0 / (np.pi * natural_frequencies(equations(8), undamped, count=1, highest=True)[0])
    rng = np.random.default_rng(0)
    size = {}
    for factor in (0.98, 1.03):
        x = np.concatenate([1e-9 * rng.standard_normal(n_q), np.zeros(n_q + 1)])
        for _ in range(40):
            x, _ = model.step(x, u, p, factor * true)
        size[factor] = float(ca.norm_inf(x[:n_q]))
    assert size[0.98] < 1e-7
    assert size[1.03] > 1e4 * size[0.98]


def test_energy_is_kept_to_second_order_without_damping_and_load(model):
    """Position Verlet is symplectic: after a jolt of the base the energy oscillates about a constant."""
    params = MembraneParams(mass_damping=0.0, pressure_amplitude=0.0)
    mass, strain_energy = equations(8).node_mass(params), energy_function(equations(8).mesh, params)
    rest = strain_energy(np.zeros(equations(8).n_q))
    u, p = vectors(model, mass_damping=0.0, pressure_amplitude=0.0)
    jolt, _ = vectors(model, base_acceleration=3000.0)
    spread = []
    for h in (1.5e-4, 0.75e-4):
        x, _ = model.init(u, p)
        for _ in range(round(0.006 / h)):
            x, _ = model.step(x, jolt, p, h)
        energy = []
        for _ in range(round(0.06 / h)):
            x, _ = model.step(x, u, p, h)
            q, v = motion(model, x)
            energy.append(strain_energy(q) - rest + mass * v @ v / 2.0)
        spread.append(np.ptp(energy) / np.mean(energy))
    assert np.mean(energy) > 10.0
    assert spread[0] < 0.02
    assert spread[0] / spread[1] == pytest.approx(4.0, abs=1.0)


def test_base_motion_acts_as_minus_mass_times_acceleration(small):
    """Far from stiffness: one short step from rest moves every node by -a h^2/2, and a base pulse equals a pressure."""
    shaken = started(small, pressure_amplitude=0.0, mass_damping=0.0)
    shaken.set("base_acceleration", 50.0)
    shaken.step(1e-6)
    assert shaken.get("w[2,6]") == pytest.approx(-50.0 * 1e-12 / 2.0, rel=1e-9)
    pushed = started(small, pressure_amplitude=0.0, mass_damping=0.0)
    pushed.set("pressure", -50.0 * 1100.0 * 0.001)
    pushed.step(1e-6)
    area = (1.0 + 0.012 / 0.588) ** 2  # pressure acts on the stretched area, mass on the unstretched one
    assert pushed.get("deflection") == pytest.approx(shaken.get("deflection") * area, rel=1e-9)


def test_mass_damping_shrinks_velocity_exponentially(small):
    """Without stiffness in play (rho huge) v' = -c v exactly; the step keeps second order."""
    c, n = 50.0, 100
    light = {"pressure_amplitude": 0.0, "mass_damping": c, "density": 1e5, "youngs_modulus": 1.0}
    u, p = vectors(small, **light)
    jolt, _ = vectors(small, base_acceleration=-1000.0)
    x, _ = small.step(small.init(u, p)[0], jolt, p, 1e-4)
    _, v0 = motion(small, x)
    for _ in range(n):
        x, _ = small.step(x, u, p, 1e-4)
    _, v1 = motion(small, x)
    assert v1[2] / v0[2] == pytest.approx(np.exp(-c * n * 1e-4), rel=1e-4)


def test_the_built_in_pressure_equals_the_same_pressure_from_outside(small):
    """Held at its value in the middle of each step, as an input would have to be."""
    steps, middles = 400 * [2e-4], (np.arange(400) + 0.5) * 2e-4
    pressure = {"pressure": 1e4 * np.sin(2.0 * np.pi * 7.9 * middles + 0.7)}
    inside = deflections(started(small, pressure_phase=0.7), steps)
    outside = simulate(started(small, pressure_amplitude=0.0), steps, pressure, ["deflection"])["deflection"]
    np.testing.assert_allclose(outside, inside, rtol=0.0, atol=1e-11)


def test_the_phase_stays_within_one_cycle(small):
    u, p = vectors(small, pressure_phase=-0.5)
    x, _ = small.init(u, p)
    for _ in range(2000):
        x, _ = small.step(x, u, p, 2.5e-4)
        assert 0.0 <= float(x[-1]) < 1.0
    cycles = 7.9 * 0.5 - 0.5 / (2.0 * np.pi)
    assert float(x[-1]) == pytest.approx(cycles % 1.0, abs=1e-12)


@pytest.mark.parametrize("frequency", [500.0, 3000.0])
def test_a_fast_built_in_pressure_is_resolved(small, frequency):
    """A communication step of 3e-4 s, about one cycle and more, against one of 1e-5 s."""
    coarse = deflections(started(small, pressure_frequency=frequency), [3e-4] * 100)
    fine = deflections(started(small, pressure_frequency=frequency), [1e-5] * 3000)[29::30]
    assert relative(coarse, fine) < 0.02
