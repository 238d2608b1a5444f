"""The membrane's production step: order, stability limit, damage during a run, energy, state, refusals."""

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ConvergenceError, InputError, ParameterError, StepModel, Stepper
from gossamer_models.membrane import (
    SENSOR_POINTS,
    MembraneEquations,
    MembraneParams,
    integrate_implicit,
    membrane_model,
    static_deflection,
)
from oracles.modal import natural_frequencies
from oracles.strain_measures import deformation_gradients, nominal_strain

UNDAMPED = MembraneParams(mass_damping=0.0)


@pytest.fixture(scope="module")
def model():
    return membrane_model(8)


@pytest.fixture(scope="module")
def small():
    return membrane_model(4)


@pytest.fixture(scope="module")
def equations():
    return MembraneEquations(8)


def started(model, damage=None, **start):
    membrane = Stepper(model, **start)
    for zone, value in (damage or {}).items():
        membrane.set(f"damage[{zone}]", value)
    membrane.initialize()
    return membrane


def run(membrane, cuts, names=("deflection", "strain[1]", "strain[4]")):
    rows = []
    for cut in cuts:
        membrane.step(cut)
        rows.append([membrane.get(name) for name in names])
    return np.array(rows)


def parts(model, state):
    """Displacements and velocities in the memory of a model's state vector."""
    n = (model.n_states - 1) // 2
    return state[:n], state[n : 2 * n]


def relative(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(b)


def test_the_table_is_the_agreed_interface(model):
    names = model.names
    assert names[:10] == (
        "side_length",
        "thickness",
        "youngs_modulus",
        "poisson_ratio",
        "density",
        "edge_displacement",
        "mass_damping",
        "pressure_amplitude",
        "pressure_frequency",
        "pressure_phase",
    )
    assert names[10:28] == ("pressure", "base_acceleration", *(f"damage[{k}]" for k in range(1, 17)))
    assert names[28:33] == ("strain[1]", "strain[2]", "strain[3]", "strain[4]", "deflection")
    assert names[33:] == (*(f"w[{i},{j}]" for i in range(1, 8) for j in range(1, 8)), "max_step")
    assert model.step_limit == "max_step"


def test_it_starts_at_rest_with_the_prestrain(model):
    membrane = started(model)
    for k in range(1, 5):
        assert membrane.get(f"strain[{k}]") == pytest.approx(0.012 / 0.588, abs=1e-14)
    assert membrane.get("deflection") == 0.0


def test_damage_before_the_start_redistributes_the_prestrain(model):
    """Values of an independent program (Kratos, first line of its history for 40 % in zone 1), as nominal strain."""
    membrane = started(model, {1: 0.4})
    green = np.array([2.013167294e-02, 2.098198743e-02, 1.983575790e-02, 2.036153362e-02])
    found = [membrane.get(f"strain[{k}]") for k in range(1, 5)]
    np.testing.assert_allclose(found, np.sqrt(1.0 + 2.0 * green) - 1.0, atol=1e-10)


def test_the_prestress_is_found_for_any_damage(small):
    rng = np.random.default_rng(0)
    for _ in range(50):
        damage = rng.uniform(0.0, 0.95, 16) * (rng.random(16) < 0.5)
        membrane = started(small, dict(enumerate(damage, 1)), edge_displacement=rng.uniform(0.0, 0.1))
        assert membrane.get("strain[1]") > -0.5


def test_outputs_are_those_of_the_state(model, equations):
    membrane = started(model)
    run(membrane, 100 * [3e-4])
    x, _ = model.step(membrane._x, membrane._values[model.slices()[1]], membrane._values[model.slices()[0]], 1e-9)
    q, _ = parts(model, np.asarray(x).ravel())
    for k, point in enumerate(SENSOR_POINTS, 1):
        F = deformation_gradients(equations, MembraneParams(), q[None], point)
        assert membrane.get(f"strain[{k}]") == pytest.approx(float(nominal_strain(F)[0]), abs=1e-6)
    assert membrane.get("deflection") == membrane.get("w[4,4]")
    grid = equations.mesh.interior_grid
    assert membrane.get("w[2,5]") == pytest.approx(q[3 * grid[1, 4] + 2], abs=1e-6)


def test_an_undamaged_membrane_stays_symmetric(model):
    membrane = started(model)
    run(membrane, 200 * [3e-4])
    w = np.array([[membrane.get(f"w[{i},{j}]") for j in range(1, 8)] for i in range(1, 8)])
    for twin in (w.T, w[::-1], w[:, ::-1]):
        np.testing.assert_allclose(w, twin, atol=1e-10)


def test_damage_in_a_zone_shows_on_its_side(model):
    """Zone 4 is the corner at the end of the x axis, zone 13 at the end of the y axis."""
    for zone, (near, far) in {4: ("w[7,1]", "w[1,7]"), 13: ("w[1,7]", "w[7,1]")}.items():
        membrane = started(model, {zone: 0.8}, pressure_amplitude=0.0, mass_damping=300.0)
        membrane.set("pressure", 1e4)
        run(membrane, 500 * [3e-4])
        assert membrane.get(near) > membrane.get(far) * 1.05


def test_the_explicit_step_is_of_second_order(model):
    """Halving the step quarters the distance to a fine solution."""
    end, fine = 0.03, run(started(model), 3200 * [0.03 / 3200])[-1]
    errors = [np.abs(run(started(model), n * [end / n])[-1] - fine)[0] for n in (200, 400, 800)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates == pytest.approx(2.0, abs=0.15)


def test_explicit_and_implicit_steps_converge_to_each_other(model, equations):
    params = MembraneParams()
    fine = run(started(model), 960 * [0.024 / 960])[79::80, 0]  # every 2 ms
    grid = equations.mesh.interior_grid
    distance = []
    for per_sample in (5, 10, 20):
        history = integrate_implicit(equations, params, 12 * per_sample, h=2e-3 / per_sample)
        distance.append(relative(history.q[per_sample::per_sample, 3 * grid[3, 3] + 2], fine))
    rates = np.log2(np.array(distance[:-1]) / distance[1:])
    assert rates == pytest.approx(2.0, abs=0.2)
    assert distance[-1] < 1.5e-3


def test_an_explicit_step_is_closer_to_the_converged_run_than_an_implicit_one_of_the_same_length(model, equations):
    """Measured over 0.1 s: 0.00095 explicit (two internal steps), 0.0076 Newmark."""
    fine = run(started(model), 333 * 16 * [3e-4 / 16])[15::16, 0]
    explicit = relative(run(started(model), 333 * [3e-4])[:, 0], fine)
    history = integrate_implicit(equations, MembraneParams(), 333)
    implicit = relative(history.q[1:, 3 * equations.mesh.interior_grid[3, 3] + 2], fine)
    assert explicit < 2e-3
    assert implicit > 3.0 * explicit


def test_the_result_depends_on_the_cuts_of_time_to_second_order_only(model):
    distance = []
    for n in (1, 2, 4):
        even = run(started(model), 150 * n * [2e-4 / n])[-1, 0]
        uneven = run(started(model), 50 * n * [0.5e-4 / n, 2.5e-4 / n, 2e-4 / n, 1e-4 / n])[-1, 0]
        distance.append(abs(uneven - even))
    assert distance[0] < 1e-3 * 0.1
    assert distance[1] < distance[0] / 3.0
    assert distance[2] < distance[1] / 3.0


def test_a_long_communication_step_equals_its_parts(model):
    one, two = started(model), started(model)
    run(one, 50 * [3e-4])
    run(two, 100 * [1.5e-4])
    for name in ("deflection", "strain[2]", "w[1,2]"):
        assert one.get(name) == pytest.approx(two.get(name), rel=1e-12)
    with pytest.raises(InputError, match="internal steps"):
        one.step(100.0)


def test_the_default_run_needs_two_internal_steps_per_3e_4_seconds(model):
    for damping in (0.0, 20.0):
        membrane = started(model, mass_damping=damping)
        limits = run(membrane, 600 * [3e-4], ["max_step"])
        assert membrane.get("strain[1]") > -1.0
        assert 1.5e-4 < limits.min() <= limits.max() < 3e-4


@pytest.mark.parametrize("n", [4, 8, 16])
def test_max_step_stays_below_the_true_limit_and_not_far_below(n):
    """2/omega_max of the assembled, stretched mesh, flat and under static pressure, with and without damage."""
    equations, model, params = MembraneEquations(n), membrane_model(n), MembraneParams()
    n_q, p = equations.n_q, params.vector()
    for pressure, damage in [(0.0, {}), (1e4, {}), (1e5, {}), (1e4, {1: 0.4}), (1e4, {6: 0.95}), (0.0, {6: 0.8})]:
        d = np.array([damage.get(k, 0.0) for k in range(1, 17)])
        q = static_deflection(equations, params, pressure, d, load_steps=8)
        x = np.concatenate([q, np.zeros(n_q + 1)])
        _, y = model.step(x, np.concatenate([[pressure, 0.0], d]), np.concatenate([p[:7], [0.0], p[8:]]), 1e-9)
        true = 1.0 / (np.pi * natural_frequencies(equations, params, q, d, count=1, highest=True)[0])
        assert 0.3 < float(y[-1]) / true < 0.45


def test_steps_beyond_the_true_limit_would_indeed_be_unstable(model, equations):
    """The step the limit protects from: the same function, called directly."""
    params = UNDAMPED.vector() * np.array([1, 1, 1, 1, 1, 1, 1, 0, 1, 1])
    true = 1.0 / (np.pi * natural_frequencies(equations, UNDAMPED, count=1, highest=True)[0])
    rng = np.random.default_rng(0)
    size = {}
    for factor in (0.98, 1.03):
        x = np.concatenate([1e-9 * rng.standard_normal(equations.n_q), np.zeros(equations.n_q + 1)])
        for _ in range(40):
            x, _ = model.step(x, np.zeros(18), params, factor * true)
        size[factor] = float(ca.norm_inf(x[: equations.n_q]))
    assert size[0.98] < 1e-7
    assert size[1.03] > 1e4 * size[0.98]


def test_energy_is_kept_to_second_order_without_damping_and_load(model, equations):
    """Position Verlet is symplectic: after a jolt of the base the energy oscillates about a constant."""
    p = MembraneParams(mass_damping=0.0, pressure_amplitude=0.0)
    mass = equations.masses(p.density, p.thickness, p.side_length)
    spread = []
    for h in (1.5e-4, 0.75e-4):
        membrane = started(model, mass_damping=0.0, pressure_amplitude=0.0)
        rest = float(equations.energy(np.zeros(equations.n_q), np.zeros(16), 0.0, p.vector()))
        membrane.set("base_acceleration", 3000.0)
        run(membrane, round(0.006 / h) * [h])
        membrane.set("base_acceleration", 0.0)
        energy = []
        for _ in range(round(0.06 / h)):
            membrane.step(h)
            q, v = parts(model, membrane._x)
            strain_energy = float(equations.energy(q, np.zeros(16), 0.0, p.vector()))
            energy.append(strain_energy - rest + mass * v @ v / 2.0)
        spread.append(np.ptp(energy) / np.mean(energy))
    assert np.mean(energy) > 10.0
    assert spread[0] < 0.02
    assert spread[0] / spread[1] == pytest.approx(4.0, abs=1.0)


def test_base_motion_acts_as_minus_mass_times_acceleration(small):
    """Far from stiffness: one short step from rest moves every node by -a h^2/2, and a base pulse equals a pressure."""
    membrane = started(small, pressure_amplitude=0.0, mass_damping=0.0)
    membrane.set("base_acceleration", 50.0)
    membrane.step(1e-6)
    assert membrane.get("w[1,3]") == pytest.approx(-50.0 * 1e-12 / 2.0, rel=1e-9)
    pushed = started(small, pressure_amplitude=0.0, mass_damping=0.0)
    pushed.set("pressure", -50.0 * 1100.0 * 0.001)
    pushed.step(1e-6)
    area = (1.0 + 0.012 / 0.588) ** 2  # pressure acts on the stretched area, mass on the unstretched one
    assert pushed.get("deflection") == pytest.approx(membrane.get("deflection") * area, rel=1e-9)


def test_mass_damping_shrinks_velocity_exponentially(small):
    """Without stiffness in play (rho huge) v' = -c v exactly; the step keeps second order."""
    c, n = 50.0, 100
    membrane = started(small, pressure_amplitude=0.0, mass_damping=c, density=1e5, youngs_modulus=1.0)
    membrane.set("base_acceleration", -1000.0)
    membrane.step(1e-4)
    membrane.set("base_acceleration", 0.0)
    _, v0 = (a.copy() for a in parts(small, membrane._x))
    run(membrane, n * [1e-4])
    _, v1 = parts(small, membrane._x)
    assert v1[2] / v0[2] == pytest.approx(np.exp(-c * n * 1e-4), rel=1e-4)


def test_the_built_in_pressure_equals_the_same_pressure_from_outside(small):
    """Held at its value in the middle of each step, as an input would have to be."""
    inside = started(small, pressure_phase=0.7)
    outside = started(small, pressure_amplitude=0.0)
    for k in range(400):
        inside.step(2e-4)
        outside.set("pressure", 1e4 * np.sin(2.0 * np.pi * 7.9 * (k + 0.5) * 2e-4 + 0.7))
        outside.step(2e-4)
        assert outside.get("deflection") == pytest.approx(inside.get("deflection"), abs=1e-11)


def test_the_phase_stays_within_one_cycle(small):
    membrane = started(small, pressure_phase=-0.5)
    for _ in range(1000):
        membrane.step(5e-4)
        assert 0.0 <= membrane._x[-1] < 1.0
    cycles = 7.9 * 0.5 - 0.5 / (2.0 * np.pi)
    assert membrane._x[-1] == pytest.approx(cycles % 1.0, abs=1e-12)


def test_damage_during_the_run_settles_at_the_damaged_equilibrium(model):
    """Positions do not jump when the modulus does; what is reached is what init finds for the same damage."""
    membrane = started(model, pressure_amplitude=0.0, mass_damping=300.0)
    run(membrane, [3e-4])
    before = membrane.get("strain[1]")
    membrane.set("damage[6]", 0.5)
    membrane.step(1e-7)
    assert membrane.get("strain[1]") == pytest.approx(before, abs=1e-7)
    found = run(membrane, 1000 * [3e-4], [f"strain[{k}]" for k in range(1, 5)])[-1]
    target = started(model, {6: 0.5})
    np.testing.assert_allclose(found, [target.get(f"strain[{k}]") for k in range(1, 5)], atol=1e-10)
    membrane.set("damage[6]", 0.0)
    healed = run(membrane, 1000 * [3e-4])[-1]
    np.testing.assert_allclose(healed[1:], 0.012 / 0.588, atol=1e-10)


def test_a_static_load_is_reached_from_the_dynamics(model, equations):
    membrane = started(model, pressure_amplitude=0.0, mass_damping=300.0)
    membrane.set("pressure", 1e4)
    found = run(membrane, 1500 * [3e-4])[-1, 0]
    middle = 3 * equations.mesh.interior_grid[3, 3] + 2
    assert found == pytest.approx(static_deflection(equations, MembraneParams(), 1e4)[middle], abs=1e-7)


def test_saving_and_restoring_continues_bit_for_bit(model):
    first = started(model, {3: 0.2})
    run(first, 100 * [3e-4])
    state = first.state
    onward = run(first, 100 * [3e-4])
    second = Stepper(model)
    second.state = state
    np.testing.assert_array_equal(run(second, 100 * [3e-4]), onward)
    first.state = state
    np.testing.assert_array_equal(run(first, 100 * [3e-4]), onward)


def test_a_stored_model_runs_the_same(small, tmp_path):
    small.save(tmp_path)
    loaded = StepModel.load(tmp_path)
    np.testing.assert_array_equal(
        run(started(loaded, {2: 0.3}), 20 * [3e-4]), run(started(small, {2: 0.3}), 20 * [3e-4])
    )
    assert loaded.digest == small.digest


def test_building_it_twice_gives_the_same_model(small):
    assert membrane_model(4).digest == small.digest


def test_derivatives_by_damage_agree_with_differences(small):
    """The strain after a while, differentiated by the damage of one zone through init and every step."""
    p = np.array([v.start for v in small.variables[:10]])
    u = ca.MX.sym("u", 18)
    x, _ = small.init(u, p)
    for _ in range(20):
        x, y = small.step(x, u, p, 4e-4)
    strain = ca.Function("strain", [u], [y[0], ca.jtimes(y[0], u, ca.DM([0.0] * 7 + [1.0] + [0.0] * 10))])
    at, h = np.array([0.0, 0.0, *(16 * [0.1])]), 1e-5
    step = h * np.eye(18)[7]
    difference = (float(strain(at + step)[0]) - float(strain(at - step)[0])) / (2.0 * h)
    assert float(strain(at)[1]) == pytest.approx(difference, rel=1e-6)


@pytest.mark.parametrize(
    "start",
    [
        {"edge_displacement": 0.0},
        {"edge_displacement": 0.0, "pressure_amplitude": 1.0},
        {"edge_displacement": 0.5},
        {"pressure_amplitude": 1e6},
        {"mass_damping": 0.0, "pressure_amplitude": 3e5},
        {"mass_damping": 1e4},
        {"poisson_ratio": 0.0},
    ],
)
def test_a_slack_or_overstretched_membrane_does_not_crash(small, start):
    membrane = started(small, **start)
    assert np.isfinite(run(membrane, 300 * [3e-4])).all()


@pytest.mark.parametrize("n", [0, 6, 10, -8, 7.5])
def test_elements_that_do_not_fit_the_zones_are_refused(n):
    with pytest.raises(ParameterError, match="multiple of 4"):
        membrane_model(n)


def test_a_prestress_that_is_not_found_is_refused_with_advice(monkeypatch):
    """Every damage and stretch within range converges, so Newton's steps are taken away."""
    monkeypatch.setattr("gossamer_models.membrane.prestress.NEWTON_STEPS", 1)
    membrane = Stepper(membrane_model(4))
    membrane.set("damage[6]", 0.9)
    with pytest.raises(ConvergenceError, match="edge_displacement"):
        membrane.initialize()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("damage[3]", 1.2),
        ("damage[16]", -0.1),
        ("damage[1]", np.nan),
        ("pressure", np.nan),
        ("base_acceleration", np.inf),
    ],
)
def test_inputs_out_of_range_are_refused_and_the_state_stays(small, name, value):
    membrane = started(small)
    run(membrane, 10 * [3e-4])
    before = membrane._x.copy()
    membrane.set(name, value)
    with pytest.raises(InputError, match="must be a finite number"):
        membrane.step(3e-4)
    np.testing.assert_array_equal(membrane._x, before)


@pytest.mark.parametrize(("name", "value"), [("poisson_ratio", 0.5), ("density", 0.0), ("youngs_modulus", np.nan)])
def test_parameters_out_of_range_are_refused(small, name, value):
    membrane = Stepper(small, **{name: value})
    with pytest.raises(ParameterError, match=name):
        membrane.initialize()


@pytest.mark.parametrize("frequency", [500.0, 3000.0])
def test_a_fast_built_in_pressure_is_resolved(small, frequency):
    """A communication step of 3e-4 s, about one cycle and more, against one of 1e-5 s."""
    coarse = run(started(small, pressure_frequency=frequency), [3e-4] * 100)
    fine = run(started(small, pressure_frequency=frequency), [1e-5] * 3000)[29::30]
    assert relative(coarse[:, 0], fine[:, 0]) < 0.02


def test_a_strongly_stretched_membrane_still_starts(small):
    assert started(small, edge_displacement=10.0).get("strain[1]") == pytest.approx(20.0 / 0.588)


def test_a_slack_membrane_has_frequencies_of_zero():
    slack = MembraneParams(edge_displacement=0.0)
    lowest = natural_frequencies(MembraneEquations(4), slack, count=3)
    np.testing.assert_allclose(lowest, 0.0, atol=1e-2)
    with pytest.raises(ParameterError, match="count is 99"):
        natural_frequencies(MembraneEquations(4), slack, count=99)
