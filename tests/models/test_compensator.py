"""The compensator as the exact inverse of the sensor, beside Chapter 5 as it is printed."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import ParameterError, Stepper, simulate
from gossamer_models.compensator import compensator_model
from gossamer_models.sensor import default_artifact, sensor_model
from gossamer_models.sensor.plots import everett
from hypothesis import example, given, settings
from hypothesis import strategies as st
from oracles.direct import direct_inverse
from oracles.everett import EverettInverse, everett_surfaces
from oracles.preisach import artifact, drive, spring, start, term

MEMORY = 3 * 8 + 2  # states of a sensor with 8 lines and no relaxation

RELAXATION = [term(0.1, 0), term(0.2, 1, (0.03, 3.0), (0.5, 0.5))]
ARTIFACTS = {
    "eta 1": artifact(eta=1.0),
    "eta 0.85": artifact(eta=0.85),
    "relaxing": artifact(eta=0.85, relaxation=RELAXATION),
    "default": default_artifact(),
}
PAIRS = {name: (sensor_model(a), compensator_model(a)) for name, a in ARTIFACTS.items()}
any_pair = pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS.keys())

strains = st.floats(0.0, 1.0)
# lattice points and end points are where the law bends
special = st.one_of(strains, st.sampled_from([0.0, 1.0, 0.125, 0.25, 0.5, 0.875]), st.integers(0, 32).map(lambda k: k / 32))
histories = st.lists(special, min_size=1, max_size=25)


def round_trip(pair, strain, h, **parameters):
    """Return the error of the recovered strain and the flags."""
    sensor, compensator = (start(model, **parameters) for model in pair)
    strain, h = np.broadcast_arrays(np.asarray(strain, float), h)
    measured = simulate(sensor, h, {"strain": strain}, ["resistance"])
    found = simulate(compensator, h, measured, ["strain", "saturated"])
    return found["strain"] - strain, found["saturated"]


def reversals(n, seed=0):
    """Ramps between random turning points, cut into random steps, with holds and visits to both ends of the range."""
    rng = np.random.default_rng(seed)
    turns = rng.uniform(0.0, 1.0, n)
    turns[rng.random(n) < 0.05] = 0.0
    turns[rng.random(n) < 0.05] = 1.0
    strain, now = [], 0.0
    while len(strain) < n:
        for turn in turns:
            parts = rng.integers(1, 8)
            strain += list(now + np.sort(rng.random(parts - 1)) * (turn - now))
            strain += [turn] * rng.integers(1, 3)
            now = turn
    return np.array(strain[:n]), 10.0 ** rng.uniform(-4, 2, n)


@pytest.mark.parametrize("name", ["eta 1", "eta 0.85", "default"])
def test_strain_comes_back_to_1e_9_of_full_scale_over_1e5_steps(name):
    strain, h = reversals(100_000)
    error, flags = round_trip(PAIRS[name], strain, h)
    assert np.abs(error).max() < 1e-9
    assert not flags.any()


@pytest.mark.parametrize("n_lines", [2, 3, 5, 7, 9])
def test_strain_comes_back_whatever_the_number_of_lines(n_lines):
    """A bisection finds intervals and fronts; only numbers of lines that are powers of two fill it."""
    sensor = artifact(n_lines=n_lines, eta=0.85, relaxation=RELAXATION)
    strain, h = reversals(3000, seed=n_lines)
    error, flags = round_trip((sensor_model(sensor), compensator_model(sensor)), strain, h)
    assert np.abs(error).max() < 1e-9
    assert not flags.any()


@settings(max_examples=80, deadline=None)
@given(history=histories, h=st.floats(1e-6, 1e4), rest=special)
@example(history=[0.0, 1.0, 0.0, 1.0], h=1.0, rest=0.0)
@example(history=[0.5, 0.5, 0.5], h=1.0, rest=0.5)
@example(history=[1.0, 1.0, 0.0, 0.0], h=1e-3, rest=1.0)
@example(history=[0.3, 0.3000000001, 0.3], h=1.0, rest=0.3)
def test_any_short_history_comes_back(history, h, rest):
    for pair in PAIRS.values():
        error, flags = round_trip(pair, history, h, rest_strain=rest)
        assert np.abs(error).max() < 1e-12
        assert not flags.any()


@any_pair
def test_the_memory_is_that_of_the_sensor(pair):
    """One law for both: after a round trip, the compensator's state is the sensor's."""
    sensor, compensator = (start(model) for model in pair)
    strain, h = reversals(300, seed=1)
    drive(compensator, drive(sensor, strain, h), h)
    n = pair[0].n_states
    assert compensator.x[:n] == pytest.approx(sensor.x, abs=1e-11)


def test_scales_and_start_are_parameters():
    parameters = {
        "rest_resistance": 120.0,
        "full_scale_resistance_change": 35.0,
        "full_scale_strain": 0.4,
        "rest_strain": 0.05,
    }
    sensor, compensator = (Stepper(model, **parameters) for model in PAIRS["default"])
    compensator.set("resistance", 1e6)  # not looked at: the run starts at rest
    for stepper in (sensor, compensator):
        stepper.initialize()
    assert compensator.get("strain") == 0.05
    strain = 0.05 + 0.35 * np.random.default_rng(2).random(200)
    assert drive(compensator, drive(sensor, strain)) == pytest.approx(strain, abs=1e-13)


@any_pair
@pytest.mark.parametrize("spike", [50.0, -50.0])
def test_a_spike_out_of_reach_saturates_and_leaves_no_trace(pair, spike):
    sensor, compensator = (start(model, rest_strain=0.2) for model in pair)
    strain = 0.2 + 0.6 * np.linspace(0.0, 1.0, 60) ** 2
    h = 0.1
    measured = drive(sensor, strain, h)
    measured[30] += spike
    drive(compensator, measured[:30], h)
    before = compensator.x.copy()
    assert drive(compensator, measured[30:31], h)[0] == (1.0 if spike > 0 else 0.0)
    assert compensator.get("saturated") == 1.0
    n = 3 * ARTIFACTS["default"].n_lines + 2 if pair is PAIRS["default"] else MEMORY
    assert (compensator.x[:n] == before[:n]).all()
    after = drive(compensator, measured[31:], h) - strain[31:]
    assert compensator.get("saturated") == 0.0
    # what is left: the rise of two samples counts as a rise within the second, which matters to the modes alone
    assert np.abs(after).max() < (1e-12 if pair in (PAIRS["eta 1"], PAIRS["eta 0.85"]) else 2e-3)
    assert abs(after[-1]) <= abs(after[0]) + 1e-12


@pytest.mark.parametrize("level", [-5.0, 30.0])
def test_a_long_fault_leaves_no_trace_either(level):
    """A thousand samples out of reach, then the sensor is back at the strain it had."""
    sensor, compensator = (start(model) for model in PAIRS["eta 0.85"])
    measured = drive(sensor, [0.3, 0.7, 0.5])
    drive(compensator, measured)
    drive(compensator, np.full(1000, level))
    assert compensator.get("saturated") == 1.0
    assert drive(compensator, measured[-1:])[0] == pytest.approx(0.5, abs=1e-12)
    assert compensator.get("saturated") == 0.0


@any_pair
def test_a_clipped_sensor_is_followed_exactly(pair):
    """Strain beyond full scale reads as full scale, without a flag: the resistance is one that the sensor can have."""
    sensor, compensator = (start(model) for model in pair)
    strain = np.concatenate([np.linspace(0.1, 1.3, 20), np.linspace(1.3, -0.2, 30), np.linspace(-0.2, 0.6, 20)])
    found = drive(compensator, drive(sensor, strain))
    assert found == pytest.approx(np.clip(strain, 0.0, 1.0), abs=1e-12)
    assert compensator.get("saturated") == 0.0


def test_strain_stays_within_the_dead_band_and_follows_beyond_it():
    sensor, compensator = PAIRS["eta 0.85"]
    measured = drive(start(sensor, rest_strain=0.5), np.full(400, 0.5))
    noise = np.random.default_rng(0).uniform(-0.009, 0.009, 400)
    still = drive(start(compensator, rest_strain=0.5, dead_band=0.01), measured + noise)
    assert (still == 0.5).all()
    assert np.ptp(drive(start(compensator, rest_strain=0.5), measured + noise)) > 0.005
    ramp = np.linspace(0.5, 0.9, 400)
    found = drive(start(compensator, rest_strain=0.5, dead_band=0.01), drive(start(sensor, rest_strain=0.5), ramp))
    spring_slope = min(ARTIFACTS["eta 0.85"].mu[0])
    assert np.abs(found - ramp).max() < 0.01 / spring_slope
    assert np.unique(found).size > 10


def test_a_dead_band_stops_noise_from_ratcheting():
    """Below eta = 1 every up and down of the noise climbs; the exact inverse explains it by falling strain."""
    rng = np.random.default_rng(1)
    strain = 0.5 + 0.3 * np.sin(np.arange(4000) * 0.01)
    sensor, compensator = PAIRS["eta 0.85"]
    measured = drive(start(sensor, rest_strain=0.5), strain) + 1e-3 * rng.standard_normal(strain.size)
    rms = [
        np.sqrt(np.mean((drive(start(compensator, rest_strain=0.5, dead_band=band), measured) - strain) ** 2))
        for band in (0.0, 3e-3)
    ]
    assert rms[1] < 0.2 * rms[0]


def test_the_low_pass_is_exact_for_a_ramp_whatever_the_steps():
    """With a sensor that is a straight line, strain is the filtered resistance: v (t - T (1 - exp(-t/T)))."""
    model, T, v = compensator_model(spring()), 0.3, 0.2
    h = np.array([0.01, 0.5, 0.003, 1.0, 0.2, 1e-6, 0.7])
    t = np.cumsum(h)
    found = drive(start(model, filter_time=T), v * t, h)
    assert found == pytest.approx(v * (t - T * (1.0 - np.exp(-t / T))), abs=1e-14)


@pytest.mark.parametrize("filter_time", [0.0, 1e-9])
def test_without_filter_time_the_resistance_passes_unchanged(filter_time):
    strain = np.random.default_rng(0).random(50)
    found = drive(start(compensator_model(spring()), filter_time=filter_time), strain, 1.0)
    assert found == pytest.approx(strain, abs=1e-8 if filter_time else 1e-15)


def growth(eta):
    """Return by what factor 30 cycles multiply the error of a compensator whose resistance has an offset of 1e-10."""
    a = artifact(eta=eta)
    strain = np.tile([0.8, 0.2], 31)
    measured = drive(start(sensor_model(a)), strain)
    error = np.abs(drive(start(compensator_model(a)), measured + 1e-10) - strain)
    return error[-1] / error[1]


def test_errors_grow_if_eta_rises_with_strain_and_die_if_it_falls():
    """A cycle multiplies an error by eta at its upper over eta at its lower end; one eta for all leaves it as it is."""
    assert growth(0.9) == pytest.approx(1.0, rel=1e-3)
    assert growth(lambda alpha: 0.8 + 0.2 * alpha) > 5.0
    assert growth(lambda alpha: 1.0 - 0.2 * alpha) < 0.2


def test_state_and_work_of_a_step_are_fixed():
    compensator = start(PAIRS["default"][1])
    size = len(compensator.state)
    drive(compensator, np.random.default_rng(0).uniform(0, 1, 2000))
    assert len(compensator.state) == size
    assert PAIRS["default"][1].n_states == PAIRS["default"][0].n_states + 2


def test_a_negative_dead_band_is_refused():
    compensator = Stepper(PAIRS["eta 1"][1], dead_band=-1.0)
    with pytest.raises(ParameterError, match="dead_band"):
        compensator.initialize()


def test_a_sensor_that_has_no_exact_inverse_is_refused_with_what_to_do():
    backwards = replace(term(0.1), amplitude=-0.1, signed=True)
    signed = replace(spring(), relaxation=(backwards,))
    with pytest.raises(
        ParameterError, match=r"build filter --artifact FILE'\. Or identify the sensor again with direct_inv"
    ):
        compensator_model(signed)
    with pytest.raises(ParameterError, match=r"Take the filter, .*: 'gossamer build filter --artifact FILE'"):
        compensator_model(signed, "estimator")
    with pytest.raises(ParameterError, match="which the estimator does not use"):
        compensator_model(replace(spring(), inverse=direct_inverse()), "estimator")


SENSORS = {
    "eta 0.85": artifact(eta=0.85),
    "relaxing": artifact(eta=0.85, relaxation=RELAXATION),
    "default": default_artifact(),
}


def interpolated(sensor, output, points):
    inverse = EverettInverse(sensor, points)
    return np.array([inverse.step(value, 0.1) for value in output])


@pytest.mark.parametrize("name", SENSORS)
def test_inverse_interpolation_and_exact_inverse_agree(name):
    sensor = SENSORS[name]
    strain = np.random.default_rng(3).uniform(0.0, 1.0, 80)
    output = drive(start(sensor_model(sensor)), strain)
    exact = drive(start(compensator_model(sensor)), output)
    assert exact == pytest.approx(strain, abs=1e-12)
    coarse, fine = (np.abs(interpolated(sensor, output, n) - exact).max() for n in (17, 129))
    assert fine < 1e-3
    assert fine < coarse / 9.0  # second order with reservations: the tables bend at a lattice of their own, 1/8 or 1/32


def test_surfaces_are_the_changes_that_the_sensor_makes():
    sensor = SENSORS["eta 0.85"]
    strain, rising, falling = everett_surfaces(sensor, 9)
    # from the virgin state: up to one value, down to another
    for i, top in enumerate(strain[1:], start=1):
        for j, low in enumerate(strain[:i]):
            up, down = drive(start(sensor_model(sensor)), [top, low])
            assert rising[0, i] == pytest.approx(up, abs=1e-12)
            assert falling[i, j] == pytest.approx(down - up, abs=1e-12)
    assert np.isnan(rising[5, 2])
    assert np.isnan(falling[2, 5])
    assert np.abs(np.diag(rising)).max() == 0.0


@pytest.mark.parametrize("name", SENSORS)
def test_the_surfaces_that_a_fit_draws_are_those_of_chapter_5(name):
    up, down = everett(SENSORS[name])
    _, rising, falling = everett_surfaces(SENSORS[name], SENSORS[name].n_lines + 1)
    np.testing.assert_allclose(up.T, rising, atol=1e-12)
    np.testing.assert_allclose(-down, falling, atol=1e-12)


def test_surfaces_of_one_eta_are_mirror_images_but_for_eta():
    """Symmetric about h1 = h2 in the classical model, Section 5.1; eta scales one side of it, Section 5.2."""
    _, rising, falling = everett_surfaces(SENSORS["eta 0.85"], 17)
    upper = np.triu_indices(17)
    assert -falling.T[upper] == pytest.approx(0.85 * rising[upper], abs=1e-12)


def test_surfaces_are_static_and_an_extension_is_refused():
    extended = artifact(relaxation=[replace(term(0.1, 0), drive="falling")])
    with pytest.raises(ParameterError, match="relaxation of the thesis only"):
        EverettInverse(extended)
    for found, wanted in zip(everett_surfaces(extended, 9), everett_surfaces(artifact(), 9), strict=True):
        np.testing.assert_array_equal(found, wanted)
