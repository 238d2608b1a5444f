"""The estimator: noise, a wrong eta, known strain, faults; and its smoothing."""

from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ParameterError, Stepper, simulate
from gossamer_models.compensator import compensator_model, estimator_model
from gossamer_models.compensator.estimation import smooth
from gossamer_models.sensor import Scales, default_artifact, sensor_model
from oracles.preisach import UNIT, artifact, drive, start, term
from studies.noise import measure, random_legs, uniform_eta

M = 24  # [samples]
TRUE = uniform_eta()
RELAXATION = [term(0.1, 0), term(0.2, 1, (0.03, 3.0), (0.5, 0.5))]
SENSORS = {"default": default_artifact(), "eta 0.85": TRUE, "relaxing": artifact(eta=0.85, relaxation=RELAXATION)}


@pytest.fixture(scope="module")
def estimator():
    return compensator_model(TRUE, "estimator")


def smoother(m, place):
    y, sigma = ca.MX.sym("y", 2 * m + 1), ca.MX.sym("sigma")
    smoothed = smooth(y, sigma, (m,), place)
    return ca.Function("smooth", [y, sigma], [smoothed.value, smoothed.variance, smoothed.turn, smoothed.sharp])


@pytest.mark.parametrize("name", SENSORS)
def test_without_noise_the_strain_is_that_of_the_exact_inverse_delayed(name):
    sensor = SENSORS[name]
    strain = random_legs(600, 3, (5, 40))
    measured = drive(start(sensor_model(sensor)), strain)
    found = drive(start(compensator_model(sensor, "estimator"), noise=0.0), measured)
    # the memory commits a sample late; what rises in between relaxes as if it had risen then
    assert found[M:] == pytest.approx(strain[:-M], abs=1e-9 if name == "eta 0.85" else 2e-3)


def test_resistance_alone_cannot_tell_a_wrong_eta_from_another_strain():
    """What limits every compensator: with eta 2 % off, another strain within the range gives the same resistances."""
    strain = 0.2 + 0.5 * random_legs(3000, 2, (60, 140))
    output = measure(strain, 0.0, 0, TRUE)
    wrong = uniform_eta(0.85 * 1.02)
    other = drive(start(compensator_model(wrong)), output)
    assert measure(other, 0.0, 0, wrong) == pytest.approx(output, abs=1e-9)
    assert 0.0 <= other.min() < other.max() <= 1.0
    assert np.abs(other - strain).max() > 0.04


def test_a_known_strain_ends_the_drift(estimator):
    strain = random_legs(2000, 4, (50, 100))
    output = measure(strain, 0.005, 5, TRUE)
    stepper = start(estimator, noise=0.005, eta_deviation=0.03)
    drive(stepper, output)
    before = stepper.get("strain_deviation")
    stepper.set("known", 1.0)
    stepper.set("known_strain", strain[-1])
    drive(stepper, output[-1:])
    stepper.set("known", 0.0)
    drive(stepper, np.full(M, output[-1]))  # the strain rests; what was known reaches the middle of the window
    assert stepper.get("strain") == pytest.approx(strain[-1], abs=0.01)
    assert stepper.get("strain_deviation") < 0.3 * before


def test_delay_is_the_time_of_half_a_window(estimator):
    stepper = start(estimator)
    h = np.random.default_rng(0).uniform(0.01, 0.2, 100)
    drive(stepper, np.zeros(100), h)
    assert stepper.get("delay") == pytest.approx(h[-M:].sum(), rel=1e-12)


def test_a_short_fault_leaves_no_trace_and_is_flagged(estimator):
    strain = np.concatenate([np.linspace(0.0, 0.7, 300), np.linspace(0.7, 0.3, 300)])
    output = measure(strain, 0.001, 1, TRUE)
    faulty = output.copy()
    faulty[400:403] = 30.0
    expected = drive(start(estimator, noise=0.001), output)
    results = simulate(start(estimator, noise=0.001), np.full(600, 0.1), {"resistance": faulty}, ("strain", "saturated"))
    found, flags = results.values()
    assert 1.0 in flags[400 : 403 + M]
    assert flags[-1] == 0.0
    assert found[-50:] == pytest.approx(expected[-50:], abs=2e-3)


def test_drift_beyond_the_range_is_taken_back_there(estimator):
    """The strain rests at full scale; an offset of 3 % is more than the estimator accepts at first, later it does."""
    stepper = start(estimator, noise=0.001)
    output = drive(start(sensor_model(TRUE)), np.linspace(0.0, 1.0, 300))
    drive(stepper, output)
    drive(stepper, np.full(400, output[-1] + 0.03))
    assert stepper.get("saturated") == 0.0
    down = drive(start(sensor_model(TRUE), rest_strain=1.0), np.linspace(1.0, 0.8, 200))
    drive(stepper, down + output[-1] - 1.0 + 0.03)
    drive(stepper, np.full(M, down[-1] + output[-1] - 1.0 + 0.03))
    assert stepper.get("strain") == pytest.approx(0.8, abs=0.01)


@pytest.mark.parametrize("output", [-1.0, 3.0, 1e4])
def test_a_broken_wire_is_never_taken_for_drift(estimator, output):
    """However long it lasts: drift is no larger than MOST_DRIFT."""
    stepper = start(estimator, noise=0.001)
    drive(stepper, random_legs(200, 2))
    names = ("saturated", "strain_deviation")
    flags, deviations = simulate(stepper, np.full(3000, 0.1), {"resistance": np.full(3000, output)}, names).values()
    assert flags[60:].all()
    assert deviations[-1] > 5.0 * deviations[60]


def test_scales_are_parameters(estimator):
    scales = {"rest_resistance": 120.0, "full_scale_resistance_change": 35.0, "full_scale_strain": 0.4}
    strain = random_legs(300, 1, (20, 60))
    plain = drive(start(estimator, noise=0.001), measure(strain, 0.001, 2, TRUE))
    stepper = Stepper(estimator, **scales, noise=0.035)
    stepper.initialize()
    scaled = drive(stepper, 120.0 + 35.0 * measure(strain, 0.001, 2, TRUE))
    assert scaled == pytest.approx(0.4 * plain, abs=1e-9)


def test_a_saved_state_goes_on_to_the_bit(estimator):
    strain = random_legs(300, 1, (20, 60))
    output = measure(strain, 0.003, 2, TRUE)
    stepper = start(estimator, noise=0.003)
    drive(stepper, output[:150])
    state = stepper.state
    first = drive(stepper, output[150:])
    stepper.state = state
    assert (drive(stepper, output[150:]) == first).all()
    assert len(stepper.state) == len(state)


def test_the_inverse_stays_the_default_and_names_are_shared(estimator):
    plain = compensator_model(TRUE)
    assert plain.digest == compensator_model(TRUE, "inverse").digest
    shared = set(plain.names) - {"dead_band", "filter_time"}
    assert shared <= set(estimator.names)


def test_unusable_choices_are_refused():
    with pytest.raises(ParameterError, match="kalman"):
        compensator_model(TRUE, "kalman")
    for widths in ((), (2, 8), (8, 8), (9, 4)):
        with pytest.raises(ParameterError, match="half widths"):
            estimator_model(TRUE, widths)
    signed = replace(TRUE, relaxation=(replace(term(0.1), drive="falling", signed=True),))
    with pytest.raises(ParameterError, match="against"):
        estimator_model(signed)


@pytest.mark.parametrize("tau", [-15, -4, 0])
def test_a_sharp_turning_point_is_found_where_it_was_passed(tau):
    t = np.arange(-M, M + 1.0)
    value, _, turn, sharp = (float(v) for v in smoother(M, M)(1.0 - 0.1 * np.abs(t - tau), 0.01))
    assert turn == pytest.approx(1.0, abs=1e-6)
    assert value == pytest.approx(1.0 - 0.1 * abs(tau), abs=1e-6)
    assert sharp == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("place", [M, 2 * M])
@pytest.mark.parametrize(("slope", "kink"), [(0.1, 1e-6), (0.011, 4e-4)])  # without a summit, with a round one: the prior
def test_a_parabola_passes_unchanged(place, slope, kink):
    t = np.arange(-M, M + 1.0)
    y = 0.3 + slope * t - 0.002 * t**2
    value, _, _, sharp = (float(v) for v in smoother(M, place)(y, 0.01))
    assert value == pytest.approx(y[place], abs=1e-6)
    assert sharp < kink


@pytest.mark.parametrize("bend", [0.0, 0.5, 2.0])
def test_the_variance_of_the_smoothing_is_that_of_its_errors_within_a_third(bend):
    """4000 draws each: no bend, and bends of so many standard deviations of the noise per sample."""
    rng = np.random.default_rng(1)
    y = -bend * np.abs(np.arange(-M, M + 1.0))[:, None]
    value, variance, _, _ = smoother(M, M).map(4000)(y + rng.standard_normal((2 * M + 1, 4000)), 1.0)
    error = np.array(value).ravel()
    assert np.mean(error**2) == pytest.approx(np.mean(np.array(variance)), rel=0.33)
    assert abs(np.mean(error)) < 0.35


def test_work_of_a_step_does_not_grow_and_windows_are_an_option():
    sizes = [estimator_model(TRUE, widths).n_states for widths in ((3,), (3, 8), (3, 8, 24), (4, 12, 48))]
    # five numbers a sample of the half window
    assert [b - a for a, b in pairwise(sizes)] == [25, 80, 120]
    assert set(UNIT) < set(compensator_model(TRUE, "estimator").names)


def test_noise_is_taken_to_be_a_share_of_the_identified_change():
    scales = Scales(rest_resistance=1e5, full_scale_resistance_change=3e4, full_scale_strain=0.1)
    for sensor, wanted in ((default_artifact(), 0.1), (replace(default_artifact(), scales=scales), 30.0)):
        (noise,) = (v.start for v in estimator_model(sensor).variables if v.name == "noise")
        assert noise == pytest.approx(wanted)
