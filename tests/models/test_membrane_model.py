"""The membrane as a model: its table, start, outputs, damage, saved state and refusals."""

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ConvergenceError, InputError, ParameterError, StepModel, Stepper, simulate
from gossamer_models.membrane import MembraneParams, membrane_model, square_structure
from gossamer_models.membrane.square import SENSORS
from oracles.membrane import equations, membrane, motion, started, vectors
from oracles.statics import static_deflection
from oracles.strain_measures import deformation_gradients, nominal_strain

STRAINS = [f"strain[{k}]" for k in range(1, 5)]
RESULTS = ["deflection", "strain[1]", "strain[4]"]


@pytest.fixture(scope="module")
def model():
    return membrane(8)


@pytest.fixture(scope="module")
def small():
    return membrane(4)


def run(stepper, n, names=RESULTS, h=3e-4):
    """Advance by n equal steps and return the results as columns."""
    return np.column_stack(list(simulate(stepper, n * [h], {}, names).values()))


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
    assert names[33:] == (
        *(f"w[{i},{j}]" for i in range(1, 8) for j in range(1, 8)),
        "largest_strain",
        "deflection_ratio",
        "max_step",
    )
    assert model.step_limit == "max_step"


def test_it_starts_at_rest_with_the_prestrain(model):
    stepper = started(model)
    for name in STRAINS:
        assert stepper.get(name) == pytest.approx(0.012 / 0.588, abs=1e-14)
    assert stepper.get("deflection") == 0.0


def test_damage_before_the_start_redistributes_the_prestrain(model):
    """Values of an independent program (Kratos, first line of its history for 40 % in zone 1), as nominal strain."""
    stepper = started(model, {1: 0.4})
    green = np.array([2.013167294e-02, 2.098198743e-02, 1.983575790e-02, 2.036153362e-02])
    found = [stepper.get(name) for name in STRAINS]
    np.testing.assert_allclose(found, np.sqrt(1.0 + 2.0 * green) - 1.0, atol=1e-10)


@pytest.mark.parametrize(("order", "times"), [(1, 50), (4, 30)])
def test_the_prestress_is_found_for_any_damage(order, times):
    rng = np.random.default_rng(0)
    for _ in range(times):
        damage = rng.uniform(0.0, 0.95, 16) * (rng.random(16) < 0.5)
        stepper = started(membrane(4, order), dict(enumerate(damage, 1)), edge_displacement=rng.uniform(0.0, 0.1))
        assert stepper.get("strain[1]") > -0.5


def test_outputs_are_those_of_the_state(model):
    u, p = vectors(model)
    x, _ = model.init(u, p)
    for _ in range(200):
        x, y = model.step(x, u, p, 1.5e-4)
    q, _ = motion(model, x)
    results = dict(zip(model.names[model.slices()[2]], np.asarray(y).ravel(), strict=True))
    for name, point in zip(STRAINS, SENSORS, strict=True):
        F = deformation_gradients(equations(8), q[None], point)
        assert results[name] == pytest.approx(float(nominal_strain(F)[0]), abs=1e-12)
    assert results["deflection"] == results["w[4,4]"]
    mesh = equations(8).mesh
    node = np.flatnonzero(np.isclose(mesh.nodes[mesh.interior], [2 / 8, 5 / 8]).all(axis=1))[0]
    assert results["w[2,5]"] == pytest.approx(q[3 * node + 2], rel=1e-13)


@pytest.mark.parametrize(("n", "order"), [(8, 1), (4, 4)])
def test_an_undamaged_membrane_stays_symmetric(n, order):
    names = [f"w[{i},{j}]" for i in range(1, 8) for j in range(1, 8)]
    w = run(started(membrane(n, order)), 200, names)[-1].reshape(7, 7)
    for twin in (w.T, w[::-1], w[:, ::-1]):
        np.testing.assert_allclose(w, twin, atol=1e-10)


def test_damage_in_a_zone_shows_on_its_side(model):
    """Zone 4 is the corner at the end of the x axis, zone 13 at the end of the y axis."""
    for zone, names in {4: ["w[7,1]", "w[1,7]"], 13: ["w[1,7]", "w[7,1]"]}.items():
        stepper = started(model, {zone: 0.8}, pressure_amplitude=0.0, mass_damping=300.0)
        stepper.set("pressure", 1e4)
        near, far = run(stepper, 500, names)[-1]
        assert near > far * 1.05


def test_damage_during_the_run_settles_at_the_damaged_equilibrium(model):
    """Positions do not jump when the modulus does; what is reached is what init finds for the same damage."""
    stepper = started(model, pressure_amplitude=0.0, mass_damping=300.0)
    stepper.step(3e-4)
    before = stepper.get("strain[1]")
    stepper.set("damage[6]", 0.5)
    stepper.step(1e-7)
    assert stepper.get("strain[1]") == pytest.approx(before, abs=1e-7)
    found = run(stepper, 1000, STRAINS)[-1]
    target = started(model, {6: 0.5})
    np.testing.assert_allclose(found, [target.get(name) for name in STRAINS], atol=1e-10)
    stepper.set("damage[6]", 0.0)
    healed = run(stepper, 1000, STRAINS)[-1]
    np.testing.assert_allclose(healed, 0.012 / 0.588, atol=1e-10)


def test_a_static_load_is_reached_from_the_dynamics(model):
    stepper = started(model, pressure_amplitude=0.0, mass_damping=300.0)
    stepper.set("pressure", 1e4)
    found = run(stepper, 1500)[-1, 0]
    middle = 3 * equations(8).mesh.centre + 2
    assert found == pytest.approx(static_deflection(equations(8), MembraneParams(), 1e4)[middle], abs=1e-7)


def test_saving_and_restoring_continues_bit_for_bit(model):
    first = started(model, {3: 0.2})
    run(first, 100)
    state = first.state
    onward = run(first, 100)
    second = Stepper(model)
    second.state = state
    np.testing.assert_array_equal(run(second, 100), onward)
    first.state = state
    np.testing.assert_array_equal(run(first, 100), onward)


def test_a_stored_model_runs_the_same(small, tmp_path):
    small.save(tmp_path)
    loaded = StepModel.load(tmp_path)
    np.testing.assert_array_equal(run(started(loaded, {2: 0.3}), 20), run(started(small, {2: 0.3}), 20))
    assert loaded.digest == small.digest


def test_building_it_twice_gives_the_same_model(small):
    assert membrane_model(square_structure(4, 1)).digest == small.digest


def test_derivatives_by_damage_agree_with_differences(small):
    """The strain after a while, differentiated by the damage of one zone through init and every step."""
    at, p = vectors(small, **{f"damage[{k}]": 0.1 for k in range(1, 17)})
    u = ca.MX.sym("u", 18)
    x, _ = small.init(u, p)
    for _ in range(20):
        x, y = small.step(x, u, p, 4e-4)
    zone_6 = np.eye(18)[7]
    strain = ca.Function("strain", [u], [y[0], ca.jtimes(y[0], u, ca.DM(zone_6))])
    h = 1e-5
    difference = (float(strain(at + h * zone_6)[0]) - float(strain(at - h * zone_6)[0])) / (2.0 * h)
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
    assert np.isfinite(run(started(small, **start), 300)).all()


def test_a_strongly_stretched_membrane_still_starts(small):
    assert started(small, edge_displacement=10.0).get("strain[1]") == pytest.approx(20.0 / 0.588)


@pytest.mark.parametrize("n", [0, 2, 6, 9, -4, 8.0, True, "8"])
def test_elements_that_do_not_fit_the_zones_are_refused(n):
    with pytest.raises(ParameterError, match="multiple of 4"):
        membrane_model(square_structure(n))


def test_a_prestress_that_is_not_found_is_refused_with_advice(monkeypatch):
    """Every damage and stretch within range converges, so Newton's steps are taken away."""
    monkeypatch.setattr("gossamer_models.membrane.equilibrium.NEWTON_STEPS", 1)
    stepper = Stepper(membrane_model(square_structure(4, 1)))
    stepper.set("damage[6]", 0.9)
    with pytest.raises(
        ConvergenceError, match=r"forces are .* times those that are accepted. Check supports \(edge_displacement\)"
    ):
        stepper.initialize()


@pytest.mark.parametrize(
    ("name", "value"),
    [("damage[3]", 1.2), ("damage[16]", -0.1), ("damage[1]", np.nan), ("pressure", np.nan), ("base_acceleration", np.inf)],
)
def test_inputs_out_of_range_are_refused_and_the_state_stays(small, name, value):
    stepper = started(small)
    run(stepper, 10)
    before = stepper.state
    stepper.set(name, value)
    with pytest.raises(InputError, match="must be a finite number"):
        stepper.step(3e-4)
    stepper.set(name, 0.0)
    assert stepper.state == before


@pytest.mark.parametrize(("name", "value"), [("poisson_ratio", 0.5), ("density", 0.0), ("youngs_modulus", np.nan)])
def test_parameters_out_of_range_are_refused(small, name, value):
    stepper = Stepper(small, **{name: value})
    with pytest.raises(ParameterError, match=name):
        stepper.initialize()


@pytest.mark.parametrize("wrong", [{"density": 0.0}, {"poisson_ratio": 1.0}, {"side_length": float("nan")}])
def test_parameters_without_meaning_are_refused(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        MembraneParams(**wrong)
