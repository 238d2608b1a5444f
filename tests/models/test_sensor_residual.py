"""The residual network: what it learns, where it stops, where it vanishes, and the sensor that carries it."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ParameterError, Stepper
from gossamer_models.compensator import compensator_model
from gossamer_models.identify import settings_for
from gossamer_models.replay import predict_resistance
from gossamer_models.sensor import SensorArtifact, default_artifact, sensor_model
from gossamer_models.sensor.artifact import MARGIN, Residual
from gossamer_models.sensor.fit import fit_preisach
from gossamer_models.sensor.fit.residual import choose_steps, corrections, train
from oracles.preisach import UNIT
from oracles.records import record, zigzag

RNG = np.random.default_rng(0)
X = RNG.uniform(-2.0, 3.0, (600, 3))
TARGET = 0.02 * np.tanh(X[:, 0] - X[:, 1]) + 0.01 * X[:, 2] ** 2
FIRST = np.arange(600) < 400


def numpy_correction(net, x):
    """The equations of the network, written again."""
    low, high = np.array(net.lowest), np.array(net.highest)
    u = 2.0 * (x - low) / (high - low) - 1.0
    gate = np.maximum(0.0, 1.0 - np.maximum(np.abs(u) - 1.0, 0.0).sum(axis=1) / MARGIN)
    hidden = np.tanh(u @ np.array(net.hidden).T + np.array(net.bias))
    return gate * net.bound * np.tanh(hidden @ np.array(net.out) / net.bound)


@pytest.fixture(scope="module")
def network():
    return train([X], [TARGET], [FIRST], 150)


def test_a_function_of_the_features_is_learned_and_the_seed_repeats_it(network):
    left = TARGET - corrections(network, X)
    assert np.std(left[~FIRST]) < 0.25 * np.std(TARGET)
    assert train([X], [TARGET], [FIRST], 150) == network
    assert train([X], [TARGET], [FIRST], 150, seed=1) != network


def test_the_casadi_form_is_the_formula(network):
    beyond = np.vstack([X, 1.3 * X, 5.0 * X])
    assert corrections(network, beyond) == pytest.approx(numpy_correction(network, beyond), abs=1e-14)


def test_the_correction_is_bounded_and_vanishes_outside_the_trained_range(network):
    far = np.array(network.highest) + 0.51 * MARGIN * (np.array(network.highest) - np.array(network.lowest))
    assert corrections(network, far[None, :]) == 0.0
    assert np.abs(corrections(network, RNG.uniform(-9, 9, (500, 3)))).max() <= network.bound


def test_noise_is_not_learned():
    """A network that predicts nothing of what comes later is left out."""
    noise = [0.01 * np.random.default_rng(5).standard_normal(600)]
    assert choose_steps([([X], noise, [FIRST], [~FIRST])]) == 0
    assert choose_steps([([X], [TARGET], [FIRST], [~FIRST])]) > 5


@pytest.fixture(scope="module")
def corrected():
    """A play with a softening that hat functions without hysteresis of their own knots cannot follow."""
    strain = zigzag(turns=24, per=12)
    play = np.clip(np.convolve(strain, np.ones(6) / 6)[: strain.size], 0.0, 1.0)
    r = record(strain, 3.0 + strain + 0.2 * np.sin(6.0 * play) * strain)
    rows = (np.arange(strain.size) < 200,)
    settings = settings_for("preisach-hats", knots=4, relaxations=3, extension="reversing")
    return r, rows, *(fit_preisach((r,), rows, replace(settings, residual=n), full_scale=1.0) for n in (0, 60))


def test_a_sensor_that_is_corrected_fits_better_and_steps_as_it_was_fitted(corrected):
    r, rows, plain, fit = corrected
    off = [np.std((r.resistance - each.predicted[0])[rows[0]]) for each in (plain, fit)]
    assert off[1] < 0.8 * off[0]
    assert predict_resistance(fit, r) == pytest.approx(fit.predicted[0], abs=1e-9)


def test_an_artifact_keeps_its_network_and_only_compensators_that_need_no_inverse_take_it(corrected, tmp_path):
    artifact = corrected[3].artifact
    artifact.write(tmp_path / "sensor.json")
    assert SensorArtifact.read(tmp_path / "sensor.json").residual == artifact.residual
    only = replace(default_artifact(), residual=small(7 + 18))
    assert not only.exactly_invertible
    for method in ("inverse", "estimator"):
        with pytest.raises(ParameterError):
            compensator_model(only, method)
    stepper = Stepper(compensator_model(only, "filter"), **UNIT)
    stepper.initialize()
    stepper.step(0.1)


def small(features):
    n = features - 1
    return Residual(
        lowest=(0.0,) * n, highest=(1.0,) * n, hidden=((0.1,) * n,) * 2, bias=(0.0, 0.1), out=(0.01, -0.01), bound=0.02
    )


def test_features_side_by_side_are_corrected_one_by_one(network):
    x = ca.MX.sym("x", 3, 4)
    bank = ca.Function("bank", [x], [network.correction(x)])
    assert bank(X[:4].T).full()[0] == pytest.approx(numpy_correction(network, X[:4]), abs=1e-14)


def test_a_network_that_is_not_complete_is_refused():
    whole = small(4)
    with pytest.raises(ParameterError, match="not complete"):
        replace(whole, bias=(0.0,))
    with pytest.raises(ParameterError, match="not complete"):
        replace(whole, bound=float("nan"))


def test_the_sensor_with_a_network_is_the_sensor_plus_its_correction():
    """Where the network's features leave its range, the sensor is the one without, to the bit."""
    narrow = replace(small(7 + 18), highest=(1e-9,) * 24)
    steppers = [
        Stepper(sensor_model(a), **UNIT) for a in (default_artifact(), replace(default_artifact(), residual=narrow))
    ]
    for stepper in steppers:
        stepper.initialize()
    for strain in (0.3, 0.7, 0.5):
        for stepper in steppers:
            stepper.set("strain", strain)
            stepper.step(0.1)
        assert steppers[0].get("resistance") == steppers[1].get("resistance")
