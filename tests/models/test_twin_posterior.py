"""What the twin states of records from its own priors: means and deviations, against a posterior by random steps."""

import numpy as np
import pytest
from gossamer_models.membrane import square_structure
from gossamer_models.twin import ResponseRecord, Twin
from oracles.metropolis import metropolis
from studies.calibration import WORLDS, World, cases, posterior

pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")


def test_random_steps_find_a_normal_density_between_bounds():
    """Closed form: without correlation each bound cuts its own unknown, and half a normal one has a mean of sqrt(2 / pi)."""
    C, low, high = np.diag([1.0, 4.0]), np.array([0.0, -np.inf]), np.array([np.inf, np.inf])
    start = np.ones((8, 2))
    draws = metropolis(lambda x: np.sum(x**2 / np.diag(C), axis=1), start, np.eye(2), low, high, 4000, 500)
    assert draws.mean(axis=(0, 1)) == pytest.approx([np.sqrt(2.0 / np.pi), 0.0], abs=0.1)
    assert draws.std(axis=(0, 1)) == pytest.approx([np.sqrt(1.0 - 2.0 / np.pi), 2.0], rel=0.06)


def test_stated_means_and_deviations_are_those_of_the_posterior_by_random_steps():
    """Of damages and nuisances on the nonlinear model, where one set of zones is certain; 1.5 times too small is noticed."""
    case = next(cases(World((4, 1), 300, 1e-3), 1, seed=1))
    answer, zones = case.answer, np.flatnonzero(case.fit.kept[:16])
    np.testing.assert_array_equal(zones, np.flatnonzero(case.truth[:16]))
    mean, deviation, _ = posterior(case, steps=1200)
    n = zones.size
    beside = case.fit.problem.nuisances.values(mean[n:], deviation[n:]).values()
    true = np.vstack([np.c_[mean[:n], deviation[:n]], list(beside)])
    stated = np.vstack([np.c_[answer.damage[zones], answer.deviation[zones]], list(answer.nuisances.values())])
    off, ratio = (stated - true)[:, 0] / true[:, 1], stated[:, 1] / true[:, 1]
    np.testing.assert_allclose(off, 0.0, atol=0.35)
    np.testing.assert_allclose(ratio, 1.0, atol=0.25)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.1)


def test_damages_do_not_take_the_place_of_what_is_off_beside_them():
    """Young's modulus 4 % and prestrain 8 % above those of the twin, 15 samples early, gains and offsets off: all likely."""
    twin, noise = Twin(square_structure(8, 1)), WORLDS["bilinear"].noise
    beside = [0.0, 0.0, -0.4, 2.0, 0.0, 1.6, -2.9, 0.1, -0.2, 0.4, 0.9, -1.0, 2.4, 1.1, 0.4]  # deviations of their priors
    truth = np.r_[np.zeros(16), beside]
    truth[[3, 5]] = 0.5, 0.58
    problem = twin._problem(ResponseRecord(step=3e-4, values=np.ones((4, 1000)), noise=noise))
    values = problem._read(problem.predict(truth[None]), problem.z(truth[None]))[0]
    values = values + noise * np.random.default_rng(0).standard_normal(values.shape)
    answer = twin.fit(ResponseRecord(step=3e-4, values=values, noise=noise))
    assert answer.valid
    np.testing.assert_allclose(answer.damage, truth[:16], atol=0.01)
