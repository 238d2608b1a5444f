"""Fractional models identified from records that are known and from the synthetic specimen."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import DataError, ParameterError
from gossamer_models.fractional import (
    FractionalSettings,
    FractionalTerm,
    UniformRecord,
    identify_fractional,
    predict,
)
from gossamer_models.fractional.artifact import MODELS
from gossamer_models.fractional.columns import Columns
from gossamer_models.fractional.parameters import ModelFit
from gossamer_models.fractional.problem import SeparableProblem, random_starts
from oracles.fractional import ALL, INTEGRALS, STRAIN, TURNED, H, record
from studies.specimen import uniform_record


@pytest.mark.parametrize("model", MODELS)
def test_derivatives_of_the_columns_are_those_of_finite_differences(model):
    n_fading = 2 if model == "model-1" else 0
    columns = Columns(STRAIN / 0.075, H, slice(0, 300), model, 2, n_fading, INTEGRALS.grid)
    theta = np.array([0.3, 0.8, 0.05, 2.0, 0.7, 1.8][: 2 + 2 * n_fading])
    _, slopes = columns.evaluate(theta)
    for k in range(theta.size):
        step = 1e-6 * np.eye(theta.size)[k]
        expected = (columns.evaluate(theta + step)[0] - columns.evaluate(theta - step)[0]) / 2e-6
        assert np.abs(slopes[k] - expected).max() < 1e-6 * max(np.abs(expected).max(), 1.0)


@pytest.mark.parametrize("artifact", ALL, ids=lambda a: a.model)
def test_a_model_is_found_again_from_its_own_record(artifact):
    chosen = FractionalSettings(n_terms=len(artifact.terms), n_fading=2, restraint=0.0, starts=5)
    fit = identify_fractional([record(artifact, train=slice(0, 320))], artifact.model, chosen)
    assert fit.train[0].e1 < 0.02
    assert fit.test[0].e1 < 0.2
    if artifact.model != "model-1":
        for found, term in zip(fit.artifact.terms, artifact.terms, strict=True):
            assert found.order == pytest.approx(term.order, abs=0.01)
            assert found.phase == pytest.approx(term.phase, abs=0.02)


def test_standard_errors_are_the_scatter_of_repeated_fits():
    chosen = FractionalSettings(n_terms=1, restraint=0.0, starts=1)
    one = replace(INTEGRALS, terms=INTEGRALS.terms[:1])
    fits = [identify_fractional([record(one, 1.0, seed)], "sub-model-1", chosen) for seed in range(40)]
    values = np.array([[each.value for each in fit.parameters.values()] for fit in fits])
    errors = np.array([each.standard_error for each in fits[0].parameters.values()])
    assert list(fits[0].parameters) == ["C_0", "C_1", "a_1"]
    scale = [fit.artifact.resistance_change for fit in fits]
    values[:, :2] *= np.array(scale)[:, None]
    errors[:2] *= scale[0]
    assert values.std(axis=0, ddof=1) == pytest.approx(errors, rel=0.4)


def test_terms_that_the_data_cannot_tell_apart_are_named():
    one = replace(INTEGRALS, terms=INTEGRALS.terms[:1])
    fit = identify_fractional([record(one, 1.0)], "sub-model-1", FractionalSettings(n_terms=3, starts=4))
    assert "The data do not determine" in fit.warnings[0]
    sure = identify_fractional([record(one, 1.0)], "sub-model-1", FractionalSettings(n_terms=1, starts=2))
    assert sure.warnings == ()
    assert all(each.determined for each in sure.parameters.values())


def test_no_coefficient_is_negative_unless_asked_for():
    signed = replace(INTEGRALS, terms=(INTEGRALS.terms[0], FractionalTerm(coefficient=-0.01, order=0.8)))
    for nonnegative in (True, False):
        chosen = FractionalSettings(n_terms=2, starts=2, restraint=0.0, nonnegative=nonnegative)
        fit = identify_fractional([record(signed)], "sub-model-1", chosen)
        lowest = min(fit.artifact.direct, *(term.coefficient for term in fit.artifact.terms))
        assert nonnegative is bool(lowest >= 0.0)
        assert (fit.train[0].e1 < 0.02) is not nonnegative


def test_the_same_seed_gives_the_same_fit():
    chosen = FractionalSettings(n_terms=2, starts=2)
    fits = [identify_fractional([record(TURNED, 1.0)], "sub-model-2", chosen) for _ in range(2)]
    assert fits[0].artifact == fits[1].artifact


def test_several_records_are_weighed():
    """Two sensors that differ: the fit goes to where the weight is."""
    other = replace(INTEGRALS, direct=0.8)
    for weights, near, far in (((1.0, 0.01), 0, 1), ((0.01, 1.0), 1, 0)):
        pair = [record(a, weight=w) for a, w in zip((INTEGRALS, other), weights, strict=True)]
        fit = identify_fractional(pair, "sub-model-1", FractionalSettings(n_terms=2, starts=1))
        assert fit.train[near].e1 < 0.1 * fit.train[far].e1


def test_uneven_samples_are_brought_to_equal_steps():
    time = np.array([1.0, 1.5, 3.0, 4.0])
    found = UniformRecord.resampled(time, 0.01 * time, 2.0 * time, train=(-np.inf, 2.0), name="uneven")
    assert found.sampling_step == 1.0
    assert found.strain == pytest.approx([0.01, 0.02, 0.03, 0.04])
    assert found.resistance == pytest.approx([2.0, 4.0, 6.0, 8.0])
    assert found.train == slice(0, 2)


def test_a_hold_that_was_not_sampled_does_not_coarsen_the_rest():
    time = np.concatenate([np.arange(10.0), [15.0], 15.0 + np.arange(1.0, 10.0)])
    assert UniformRecord.resampled(time, time, time).sampling_step == 1.0
    time[-1] = 1e6
    assert UniformRecord.resampled(time, time, time).strain.size == 4 * 19 + 1


@pytest.mark.parametrize("artifact", ALL, ids=lambda a: a.model)
def test_the_resistance_at_rest_is_fitted_where_it_is_not_known(artifact):
    chosen = FractionalSettings(n_terms=len(artifact.terms), n_fading=2, restraint=0.0, starts=5)
    fit = identify_fractional([replace(record(artifact), rest_resistance=None)], artifact.model, chosen, full_scale=0.1)
    assert fit.artifact.rest_resistance == pytest.approx(1000.0, abs=0.05)
    assert fit.artifact.full_scale_strain == 0.1
    assert fit.parameters["R_0"].value == fit.artifact.rest_resistance
    assert fit.parameters["R_0"].standard_error < 0.1
    assert fit.covariance.shape == (len(fit.parameters),) * 2
    assert fit.train[0].e1 < 0.02


def test_starts_fill_the_box():
    low, high = np.array([0.001, 0.001, 1e-4]), np.array([0.999, 0.999, 10.0])
    drawn = np.array(list(random_starts(low, high, 2, 50, seed=1)))
    assert (drawn > low).all()
    assert (drawn < high).all()
    assert (drawn[:, 0] < drawn[:, 1]).all()
    assert (np.ptp(np.log(drawn[:, 2])) > 8.0).all()


def test_the_reduced_jacobian_is_exact_where_the_fit_is():
    """Kaufman's neglect vanishes with the residual."""
    s = STRAIN / 0.075
    change = (predict(INTEGRALS, STRAIN, H) - 1000.0) / 300.0
    columns = Columns(s, H, slice(None), "sub-model-1", 2, 0, INTEGRALS.grid)
    problem = SeparableProblem([columns], [change], [1.0], np.zeros(3, dtype=bool), 0.0, np.ones(3, dtype=bool))
    theta = np.array([0.3, 0.8])
    J = problem.jacobian(theta)
    assert np.abs(problem.residual(theta)).max() < 1e-10
    for k in range(2):
        step = 1e-5 * np.eye(2)[k]
        expected = (problem.residual(theta + step) - problem.residual(theta - step)) / 2e-5
        assert np.abs(J[:, k] - expected).max() < 1e-3 * np.abs(expected).max()


def test_records_that_cannot_be_fitted_are_refused():
    good = record(INTEGRALS)
    broken = good.resistance.copy()
    broken[17] = np.nan
    for bad, message in (
        (replace(good, resistance=broken), "row 17"),
        (replace(good, resistance=good.resistance[1:]), "two equal columns"),
        (replace(good, train=slice(0, 10)), "10 samples are too few"),
        (replace(good, strain=np.zeros(401)), "constant"),
        (replace(good, weight=0.0), "leave a record out"),
        (replace(good, sampling_step=1e-6), "outside the memory"),
    ):
        with pytest.raises(DataError, match=message):
            identify_fractional([bad], "sub-model-1")
    with pytest.raises(DataError, match="at least one"):
        identify_fractional([], "sub-model-1")
    with pytest.raises(DataError, match="for all or for none"):
        identify_fractional([good, replace(good, rest_resistance=None)], "sub-model-1")
    with pytest.raises(ParameterError, match="model-9"):
        identify_fractional([good], "model-9")
    with pytest.raises(ParameterError, match="bounds of orders"):
        FractionalSettings(orders=(0.0, 0.5))


@pytest.mark.parametrize("nonnegative", [True, False])
@pytest.mark.parametrize("model", MODELS)
def test_the_gradient_of_the_restrained_fit_is_that_of_finite_differences(model, nonnegative):
    chosen = FractionalSettings(n_terms=2, n_fading=1, restraint=0.05, nonnegative=nonnegative)
    problem = ModelFit([uniform_record(1)], model, chosen).problem
    theta = np.array([0.3, 0.8, 0.05, 1.7][: 4 if model == "model-1" else 2])
    found = problem.jacobian(theta).T @ problem.residual(theta)
    for k in range(theta.size):
        step = 1e-5 * np.eye(theta.size)[k]
        after, before = (0.5 * np.sum(problem.residual(theta + way) ** 2) for way in (step, -step))
        assert found[k] == pytest.approx((after - before) / 2e-5, rel=1e-4, abs=1e-7)


@pytest.mark.parametrize("model", MODELS)
def test_more_terms_never_fit_worse(model):
    first = uniform_record(1)
    costs = [min(identify_fractional([first], model, FractionalSettings(n_terms=n)).costs) for n in (1, 3, 5)]
    assert costs[1] <= costs[0] + 1e-3
    assert costs[2] <= costs[1] + 1e-3


@pytest.mark.parametrize("model", ["sub-model-1", "sub-model-2"])
def test_all_starts_come_to_one_fit(model):
    costs = identify_fractional([uniform_record(1)], model, FractionalSettings(n_terms=3)).costs
    assert max(costs) < 1.05 * min(costs)


def test_terms_that_are_left_out_do_not_make_the_others_doubtful():
    fit = identify_fractional([uniform_record(1)], "sub-model-1", FractionalSettings(n_terms=3))
    kept = [k for k, term in enumerate(fit.artifact.terms, 1) if term.coefficient > 0.0]
    assert len(kept) < 3
    sure = {name for name, each in fit.parameters.items() if each.determined}
    assert {"C_1", "a_1"} <= sure <= {"C_0", *(f"{symbol}_{k}" for symbol in "Ca" for k in kept)}
