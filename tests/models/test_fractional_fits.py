"""Fractional models identified from records that are known and from the synthetic specimen."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import DataError, ParameterError
from gossamer_models.fitting.records import in_equal_steps
from gossamer_models.fitting.separable import SeparableProblem
from gossamer_models.fractional import FractionalSettings, FractionalTerm, fit_fractional, predict
from gossamer_models.fractional.artifact import MODELS
from gossamer_models.fractional.fit import doubts, random_starts
from gossamer_models.fractional.problem import FractionalColumns, prepare
from oracles.fractional import ALL, INTEGRALS, STRAIN, TIME, TURNED, H, record
from studies.fractional import fit_change, fitted
from studies.specimen import specimen_record

FIRST_CYCLES = TIME < 160.0
EVERYTHING = np.ones(TIME.size, dtype=bool)


def fit(records, model, rows=EVERYTHING, rest_resistance=1000.0, full_scale=None, **chosen):
    records = records if isinstance(records, tuple) else (records,)
    settings = FractionalSettings(model=model, **chosen)
    return fit_fractional(records, (rows,) * len(records), settings, full_scale=full_scale, rest_resistance=rest_resistance)


def fit_specimen(model, **chosen):
    return fit_change(specimen_record(1), fitted(1), FractionalSettings(model=model, **chosen))


def dense(derivative, n):
    """Return the derivative of all columns, of which most do not move."""
    columns, slope = derivative
    found = np.zeros((len(slope), n))
    found[:, columns] = slope
    return found


@pytest.mark.parametrize("model", MODELS)
def test_derivatives_of_the_columns_are_those_of_finite_differences(model):
    n_fading = 2 if model == "model-1" else 0
    chosen = FractionalSettings(model=model, terms=2, fading=n_fading)
    columns = FractionalColumns(STRAIN / 0.075, H, np.arange(STRAIN.size) < 300, chosen, rest_fitted=False)
    theta = np.array([0.3, 0.8, 0.05, 2.0, 0.7, 1.8][: 2 + 2 * n_fading])
    _, slopes = columns.evaluate(theta)
    for k in range(theta.size):
        step = 1e-6 * np.eye(theta.size)[k]
        expected = (columns.evaluate(theta + step)[0] - columns.evaluate(theta - step)[0]) / 2e-6
        assert np.abs(dense(slopes[k], expected.shape[1]) - expected).max() < 1e-6 * max(np.abs(expected).max(), 1.0)


@pytest.mark.parametrize("artifact", ALL, ids=lambda a: a.model)
def test_a_model_is_found_again_from_its_own_record(artifact):
    chosen = {"terms": len(artifact.terms), "fading": 2, "restraint": 0.0, "starts": 5}
    again = fit(record(artifact), artifact.model, FIRST_CYCLES, **chosen)
    train, test = again.errors
    assert train.e1 < 0.02
    assert test.e1 < 0.2
    if artifact.model != "model-1":
        for found, term in zip(again.artifact.terms, artifact.terms, strict=True):
            assert found.order == pytest.approx(term.order, abs=0.01)
            assert found.phase == pytest.approx(term.phase, abs=0.02)


def test_standard_errors_are_the_scatter_of_repeated_fits():
    one = replace(INTEGRALS, terms=INTEGRALS.terms[:1])
    fits = [fit(record(one, 1.0, seed), "sub-model-1", terms=1, restraint=0.0, starts=1) for seed in range(40)]
    found = [each.parameters for each in fits]
    values = np.array([[p.value for p in each] for each in found])
    errors = np.array([p.deviation for p in found[0]])
    assert [p.name for p in found[0]] == ["C_0", "C_1", "a_1"]
    scale = [each.artifact.resistance_change for each in fits]
    values[:, :2] *= np.array(scale)[:, None]
    errors[:2] *= scale[0]
    assert values.std(axis=0, ddof=1) == pytest.approx(errors, rel=0.4)


def test_terms_that_the_data_cannot_tell_apart_are_named():
    one = replace(INTEGRALS, terms=INTEGRALS.terms[:1])
    assert "The data do not determine" in doubts(fit(record(one, 1.0), "sub-model-1", terms=3, starts=4))[0]
    sure = fit(record(one, 1.0), "sub-model-1", terms=1, starts=2)
    assert [text for text in doubts(sure) if "correlation" not in text] == []
    assert all(each.determined for each in sure.parameters)


def test_no_coefficient_is_negative_unless_asked_for():
    signed = replace(INTEGRALS, terms=(INTEGRALS.terms[0], FractionalTerm(coefficient=-0.01, order=0.8)))
    for nonnegative in (True, False):
        found = fit(record(signed), "sub-model-1", terms=2, starts=2, restraint=0.0, nonnegative=nonnegative)
        lowest = min(found.artifact.direct, *(term.coefficient for term in found.artifact.terms))
        assert nonnegative is bool(lowest >= 0.0)
        assert (found.errors[0].e1 < 0.02) is not nonnegative


def test_the_same_seed_gives_the_same_fit():
    fits = [fit(record(TURNED, 1.0), "sub-model-2", terms=2, starts=2) for _ in range(2)]
    assert fits[0].artifact == fits[1].artifact


def test_several_records_are_weighed():
    """Two sensors that differ: the fit goes to where the weight is."""
    other = replace(INTEGRALS, direct=0.8)
    for weights, near, far in (((1.0, 0.01), 0, 1), ((0.01, 1.0), 1, 0)):
        pair = tuple(record(a, weight=w) for a, w in zip((INTEGRALS, other), weights, strict=True))
        errors = fit(pair, "sub-model-1", terms=2, starts=1).errors
        assert errors[near].e1 < 0.1 * errors[far].e1


def test_uneven_samples_are_brought_to_equal_steps():
    time = np.array([1.0, 1.5, 3.0, 4.0])
    uneven = record(INTEGRALS, time=time, strain=0.01 * time, resistance=2.0 * time, lines=np.arange(2, 6))
    found, rows = in_equal_steps(uneven, time <= 2.0)
    assert found.time == pytest.approx([1.0, 2.0, 3.0, 4.0])
    assert found.strain == pytest.approx([0.01, 0.02, 0.03, 0.04])
    assert found.resistance == pytest.approx([2.0, 4.0, 6.0, 8.0])
    assert rows.tolist() == [True, False, False, False]  # the last fitted sample is that of 1.5 s


def test_a_hold_that_was_not_sampled_does_not_coarsen_the_rest():
    time = np.concatenate([np.arange(10.0), [15.0], 15.0 + np.arange(1.0, 10.0)])
    rows = np.ones(time.size, dtype=bool)

    def resampled():
        same = {"time": time, "strain": time, "resistance": time, "lines": np.arange(time.size)}
        return in_equal_steps(record(INTEGRALS, **same), rows)[0].time

    assert np.diff(resampled()) == pytest.approx(1.0)
    time[-1] = 1e6
    assert resampled().size == 4 * 19 + 1


@pytest.mark.parametrize("artifact", ALL, ids=lambda a: a.model)
def test_the_resistance_at_rest_is_fitted_where_it_is_not_known(artifact):
    chosen = {"terms": len(artifact.terms), "fading": 2, "restraint": 0.0, "starts": 5}
    found = fit(record(artifact), artifact.model, rest_resistance=None, full_scale=0.1, **chosen)
    assert found.artifact.rest_resistance == pytest.approx(1000.0, abs=0.05)
    assert found.artifact.full_scale_strain == 0.1
    (rest,) = (each for each in found.parameters if each.name == "R_0")
    assert rest.value == found.artifact.rest_resistance
    assert rest.deviation < 0.1
    assert found.covariance.shape == (len(found.parameters),) * 2
    assert found.errors[0].e1 < 0.02


def test_starts_fill_the_box():
    settings = FractionalSettings(model="model-1", terms=2, fading=1, starts=50, seed=1)
    low, high = settings.box
    drawn = np.array(list(random_starts(settings)))
    assert (drawn > low).all()
    assert (drawn < high).all()
    assert (drawn[:, 0] < drawn[:, 1]).all()
    assert (np.ptp(np.log(drawn[:, 2])) > 8.0).all()


def test_the_reduced_jacobian_is_exact_where_the_fit_is():
    """Kaufman's neglect vanishes with the residual."""
    s = STRAIN / 0.075
    change = (predict(INTEGRALS, STRAIN, H) - 1000.0) / 300.0
    columns = FractionalColumns(s, H, EVERYTHING, FractionalSettings(model="sub-model-1", terms=2), rest_fitted=False)

    def evaluate(theta):
        Phi, derivatives = columns.evaluate(theta)
        return Phi, lambda: derivatives

    problem = SeparableProblem(evaluate, change, nonnegative=False)
    theta = np.array([0.3, 0.8])
    J = problem.jacobian(theta)
    assert np.abs(problem.residual(theta)).max() < 1e-10
    for k in range(2):
        step = 1e-5 * np.eye(2)[k]
        expected = (problem.residual(theta + step) - problem.residual(theta - step)) / 2e-5
        assert np.abs(J[:, k] - expected).max() < 1e-3 * np.abs(expected).max()


def test_records_that_cannot_be_used_are_refused():
    good = record(INTEGRALS)
    broken = good.resistance.copy()
    broken[17] = np.nan
    for change, message in (
        ({"resistance": broken}, "row 17"),
        ({"resistance": good.resistance[1:]}, "equal columns"),
        ({"weight": 0.0}, "leave a record out"),
    ):
        with pytest.raises(DataError, match=message):
            replace(good, **change)


def test_records_that_cannot_be_fitted_are_refused():
    good = record(INTEGRALS)
    with pytest.raises(DataError, match="10 samples are too few"):
        fit(good, "sub-model-1", TIME < 5.0)
    with pytest.raises(DataError, match="constant"):
        fit(replace(good, strain=np.zeros(401)), "sub-model-1", full_scale=0.1)
    with pytest.raises(DataError, match="at least one"):
        fit((), "sub-model-1")
    with pytest.raises(ParameterError, match="model-9"):
        FractionalSettings(model="model-9")
    with pytest.raises(ParameterError, match="bounds of orders"):
        FractionalSettings(model="sub-model-1", orders=(0.0, 0.5))


@pytest.mark.parametrize("nonnegative", [True, False])
@pytest.mark.parametrize("model", MODELS)
def test_the_gradient_of_the_restrained_fit_is_that_of_finite_differences(model, nonnegative):
    chosen = FractionalSettings(model=model, terms=2, fading=1, restraint=0.05, nonnegative=nonnegative)
    problem = prepare((specimen_record(1),), (fitted(1),), chosen, None, 0.0).separable
    theta = np.array([0.3, 0.8, 0.05, 1.7][: 4 if model == "model-1" else 2])
    found = problem.jacobian(theta).T @ problem.residual(theta)
    for k in range(theta.size):
        step = 1e-5 * np.eye(theta.size)[k]
        after, before = (0.5 * np.sum(problem.residual(theta + way) ** 2) for way in (step, -step))
        assert found[k] == pytest.approx((after - before) / 2e-5, rel=1e-4, abs=1e-7)


@pytest.mark.parametrize("model", MODELS)
def test_more_terms_never_fit_worse(model):
    costs = [min(fit_specimen(model, terms=n).costs) for n in (1, 3, 5)]
    assert costs[1] <= costs[0] + 1e-3
    assert costs[2] <= costs[1] + 1e-3


@pytest.mark.parametrize("model", ["sub-model-1", "sub-model-2"])
def test_all_starts_come_to_one_fit(model):
    costs = fit_specimen(model, terms=3).costs
    assert max(costs) < 1.05 * min(costs)


def test_terms_that_are_left_out_do_not_make_the_others_doubtful():
    found = fit_specimen("sub-model-1", terms=3)
    kept = [k for k, term in enumerate(found.artifact.terms, 1) if term.coefficient > 0.0]
    assert len(kept) < 3
    sure = {each.name for each in found.parameters if each.determined}
    assert {"C_1", "a_1"} <= sure <= {"C_0", *(f"{symbol}_{k}" for symbol in "Ca" for k in kept)}
