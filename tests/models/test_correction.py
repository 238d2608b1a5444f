"""The correction by a finer mesh: damages are those of the finer mesh, where the error of the own one hides them."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models.errors import ConvergenceError
from gossamer_models.membrane import square_structure
from gossamer_models.twin import MembraneForward, ResponseRecord, Twin, correction
from gossamer_models.twin import twin as twin_module
from gossamer_models.twin.discrepancy import SPACING, Discrepancy, learn, spline_matrix
from gossamer_models.twin.nuisances import BY_DEFAULT

STEP, STEPS = 3e-4, 333
DAMAGE = np.where(np.arange(16) == 5, 0.3, 0.0) + np.where(np.arange(16) == 10, 0.15, 0.0)
NOISE = 1e-4


@pytest.fixture(scope="module")
def strain():
    """What elements of order 2, 4 and 6 read of two damaged zones, and of others."""
    pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")
    random = np.random.default_rng(4)
    others = np.where(random.random((63, 16)) < 0.15, 0.5 * random.random((63, 16)), 0.0)
    damage = np.vstack([DAMAGE, others])
    return {
        order: MembraneForward(square_structure(4, order)).strain(damage[: 64 if order < 6 else 1], {}, {}, STEPS, STEP)
        for order in (2, 4, 6)
    }


@pytest.fixture(scope="module")
def learned(strain):
    """The error of elements of order 2, from pairs that the records have no part in."""
    length = STEPS * STEP
    components = learn((strain[4] - strain[2])[1:], STEP, share=1.0, shrunk=0.4)
    assert components.shape[2] == spline_matrix(STEPS, STEP, length).shape[1] == round(length / SPACING) + 3
    return Discrepancy(elements_per_side=4, order=2, length=length, components=components, provenance={})


def record(strain, order, noise=NOISE):
    values = strain[order][0]
    return ResponseRecord(
        step=STEP, values=values + noise * np.random.default_rng(2).standard_normal(values.shape), noise=noise
    )


def test_damage_is_that_of_a_finer_mesh_whose_error_nobody_learned(strain, learned, monkeypatch):
    """The truth has elements of order 6; what is left of the error there is told."""
    left = np.sqrt(np.mean((strain[6] - strain[4][:1]) ** 2) / np.mean((strain[4] - strain[2]) ** 2))
    monkeypatch.setitem(twin_module.LEFT, "strain", left)
    made = record(strain, 6)
    answer = Twin(discrepancy=learned, structure=square_structure(4, 2)).fit(made)
    monkeypatch.setattr(twin_module, "HIDES", np.inf)
    plain = Twin(discrepancy=learned, structure=square_structure(4, 2)).fit(made)
    error, before = (np.abs(each.damage - DAMAGE).max() for each in (answer, plain))
    assert answer.valid
    assert error < 0.01 < before  # both find the two zones; the own mesh alone errs by about 0.016 of damage
    assert np.all(answer.deviation < 0.7 * plain.deviation)
    assert np.all(np.abs(answer.damage - DAMAGE) < 3.0 * np.maximum(answer.deviation, 1e-3))


def test_a_record_of_the_own_mesh_is_answered_by_the_own_mesh(strain, learned):
    answer = Twin(discrepancy=learned, structure=square_structure(4, 2)).fit(record(strain, 2))
    assert answer.valid
    np.testing.assert_allclose(answer.damage, DAMAGE, atol=5e-3)


def test_noise_that_hides_the_error_costs_no_finer_simulation(strain, learned, monkeypatch):
    monkeypatch.setattr(twin_module, "corrected", lambda *_, **__: pytest.fail("the finer mesh was simulated"))
    answer = Twin(discrepancy=learned, structure=square_structure(4, 2)).fit(record(strain, 4, noise=0.1))
    assert answer.valid


def test_a_finer_mesh_that_fails_leaves_the_fit_of_the_own_one(strain, learned, monkeypatch):
    def fails(*_):
        raise ConvergenceError("no")

    twin = Twin(discrepancy=learned, structure=square_structure(4, 2))
    monkeypatch.setattr(twin._finer_square, "strain", fails)
    fit, _ = twin._searched(record(strain, 4), lambda *_: None)
    assert fit.problem.added is None
    assert np.array_equal(fit.problem.noise, np.full(4, NOISE))
    assert np.isfinite(twin.fit(record(strain, 4)).damage).all()


def test_a_hopeless_fit_states_chi2_by_the_noise_that_was_given(strain, learned):
    made = record(strain, 4)
    twin = Twin(discrepancy=learned, structure=square_structure(4, 2), known=BY_DEFAULT)
    fit, _ = twin._searched(replace(made, values=1.5 * made.values), lambda *_: None)
    assert not fit.passes
    assert np.array_equal(fit.problem.noise, np.full(4, NOISE))


def test_what_is_added_follows_the_finer_mesh_to_first_order(strain, learned):
    twin = Twin(discrepancy=learned, structure=square_structure(4, 2))
    problem = twin._problem(record(strain, 4))
    x = np.zeros(problem.size)
    x[:16] = DAMAGE
    point = problem.points(x[None])[0]
    modulus = 16 + problem.nuisances.simulated.index("modulus")
    moving = np.append(np.flatnonzero(DAMAGE), modulus)
    finer = problem.corrected(twin._finer_square, point, moving, moving, problem.components)
    moved = x.copy()
    moved[[5, 10, modulus]] += [0.01, -0.01, 0.03]
    near, far = problem.points(np.vstack([moved, np.where(x, 2.0 * x, x)]))
    at_near = finer.corrected(twin._finer_square, near, moving, moving, problem.components)
    at_far = finer.corrected(twin._finer_square, far, moving, moving, problem.components)
    assert at_near.added.slopes is finer.added.slopes
    assert at_far.added.slopes is not finer.added.slopes
    assert not finer.added.serves(near.x, np.array([0, *moving]))
    assert not finer.added.serves(np.where(np.arange(x.size) == 5, 0.0, x), np.array([10]))  # a zone that was dropped since
    alone = Twin(twin._finer_square, discrepancy=None)._problem(record(strain, 4))
    exact = alone.predict(np.vstack([x, moved]))[:, :, :STEPS]
    read = finer.predict(np.vstack([x, moved]))[:, :, :STEPS]
    np.testing.assert_allclose(read[0], exact[0], atol=1e-12)
    np.testing.assert_allclose(at_near.predict(moved[None])[0, :, :STEPS], exact[1], atol=1e-12)
    change = np.abs(exact[1] - exact[0]).max()
    assert np.abs(read[1] - exact[1]).max() < 0.02 * change
    coarse = problem.predict(np.vstack([x, moved]))[:, :, :STEPS]
    assert np.abs((coarse[1] - coarse[0]) - (exact[1] - exact[0])).max() > 0.05 * change
    groups = np.r_[np.arange(10), 5, np.arange(10, 15)]  # zones 6 and 11 have one damage
    in_groups = twin._problem(record(strain, 4), groups=groups, wider=True).like(finer)
    together = np.zeros((2, in_groups.size))
    together[:, 5], together[1, 15 + in_groups.nuisances.simulated.index("modulus")] = [0.2, 0.25], 0.03
    apart = np.zeros((2, problem.size))
    apart[:, :16], apart[:, modulus] = together[:, groups], [0.0, 0.03]
    np.testing.assert_allclose(in_groups.predict(together), finer.predict(apart), atol=1e-12)


def test_the_last_round_is_one_that_moves_no_damage(strain, learned):
    twin = Twin(discrepancy=learned, structure=square_structure(4, 2))
    fit, _ = twin._searched(record(strain, 4), lambda *_: None)
    assert correction.moved(fit, fit) == 0.0
    other = replace(fit, kept=~fit.kept)
    assert correction.moved(other, fit) == np.inf
