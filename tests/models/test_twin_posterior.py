"""Means and deviations that the twin states, against a posterior by random steps."""

import numpy as np
import pytest
from oracles.metropolis import metropolis
from studies.calibration import World, cases, posterior

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
