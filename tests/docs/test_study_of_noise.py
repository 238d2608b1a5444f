"""The estimator in the study of noise: errors over long histories, stated deviations, a wrong eta."""

import numpy as np
import pytest
from studies.noise import TARGETS, measure, random_legs, run_estimator, run_inverse, uniform_eta

TRUE = uniform_eta()


@pytest.mark.parametrize(("noise", "target"), [(0.001, 0.4), (0.005, 1.2)])
def test_error_over_2e4_noisy_samples_meets_the_target(noise, target):
    assert TARGETS[noise] == target
    strain = random_legs(20_000, 7)
    output = measure(strain, noise, 8, TRUE)
    run = run_estimator(TRUE, strain, output, noise)
    assert run.rms < target
    assert run.present_rms < 1.2 * target
    assert run_inverse(TRUE, strain[:4000], output[:4000]).rms > 10.0 * run.rms


@pytest.mark.parametrize("shape", ["cosines", "holds"])
def test_round_turning_points_and_rests_do_not_drift(shape):
    strain = random_legs(6000, 5, (60, 140), shape)
    assert run_estimator(TRUE, strain, measure(strain, 0.005, 6, TRUE), 0.005).rms < 0.6


def test_the_stated_deviation_is_that_of_the_errors():
    ratios = []
    for seed in range(5):
        strain = random_legs(3000, seed, (100, 400))
        run = run_estimator(TRUE, strain, measure(strain, 0.002, 50 + seed, TRUE), 0.002)
        ratios.append(run.error / run.deviation)
    ratio = np.concatenate(ratios)
    assert 0.6 < np.sqrt(np.mean(ratio**2)) < 1.6
    assert np.mean(np.abs(ratio) < 2.0) > 0.85


@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_a_wrong_eta_is_learned_where_the_strain_is_known(factor):
    wrong = uniform_eta(0.85 * factor)
    strain = random_legs(10_000, 2)
    output = measure(strain, 0.001, 3, TRUE)
    informed = run_estimator(wrong, strain, output, 0.001, eta_deviation=0.02, every=2000)
    alone = run_estimator(wrong, strain, output, 0.001, eta_deviation=0.02)
    assert informed.rms < 2.0
    assert np.abs(informed.error[5000:]).max() < 0.01
    assert alone.rms > 2.0 * informed.rms
    # left alone it does not know the strain, and says so
    assert np.mean(np.abs(alone.error / alone.deviation) < 3.0) > 0.98
    assert alone.deviation[-1] > 5.0 * informed.deviation[-1]
