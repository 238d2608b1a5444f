"""Fractional models: forward, stepping, as an FMU, and identified from records that are known."""

from dataclasses import replace

import fmpy
import numpy as np
import pytest
from gossamer_fmus import build_fmu
from gossamer_models import ArtifactError, DataError, ParameterError, Stepper
from gossamer_models.fractional import (
    FadingTerm,
    FractionalArtifact,
    FractionalSettings,
    FractionalTerm,
    UniformRecord,
    derivative_sum,
    fractional_sensor_model,
    identify_fractional,
    integral_sum,
    misfit,
    predict,
    turned,
)
from gossamer_models.fractional.artifact import MODELS
from gossamer_models.fractional.assess import limits, record_of
from gossamer_models.fractional.columns import Columns
from gossamer_models.fractional.parameters import ModelFit
from gossamer_models.fractional.problem import SeparableProblem, random_starts
from gossamer_models.sensor import sensor_model
from gossamer_models.specimen import dataset
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import trapezoid

H = 0.5
TIME = H * np.arange(401)
STRAIN = 0.075 * np.interp(TIME, [0.0, 50.0, 100.0, 150.0, 200.0], [0.0, 1.0, 0.0, 1.0, 0.0])
SCALES = {"full_scale_strain": 0.075, "resistance_change": 300.0, "rest_resistance": 1000.0}
INTEGRALS = FractionalArtifact(
    model="sub-model-1",
    direct=0.4,
    terms=(FractionalTerm(coefficient=0.12, order=0.3), FractionalTerm(coefficient=0.01, order=0.8)),
    **SCALES,
)
TURNED = FractionalArtifact(
    model="sub-model-2",
    direct=0.4,
    terms=(
        FractionalTerm(coefficient=0.12, order=0.3, phase=-0.4),
        FractionalTerm(coefficient=0.02, order=0.7, phase=0.2),
    ),
    **SCALES,
)
DERIVATIVES = FractionalArtifact(
    model="model-1",
    direct=0.3,
    terms=(FractionalTerm(coefficient=0.5, order=0.4, phase=-0.7),),
    fading=(FadingTerm(coefficient=0.02, rate=0.05, exponent=1.4), FadingTerm(coefficient=0.5, rate=2.0, exponent=0.8)),
    **SCALES,
)
ALL = (INTEGRALS, TURNED, DERIVATIVES)


def stepped(model, at, strain, **start):
    sensor = Stepper(model, **start)
    sensor.initialize()
    resistance = [sensor.get("resistance")]
    for h, value in zip(np.diff(at), strain[1:], strict=True):
        sensor.set("strain", float(value))
        sensor.step(float(h))
        resistance.append(sensor.get("resistance"))
    return np.array(resistance)


def record(artifact, noise=0.0, seed=0, **changes):
    resistance = predict(artifact, STRAIN, H) + noise * np.random.default_rng(seed).standard_normal(STRAIN.size)
    return UniformRecord(strain=STRAIN, resistance=resistance, sampling_step=H, rest_resistance=1000.0, **changes)


@pytest.mark.parametrize("artifact", ALL[:2], ids=lambda a: a.model)
def test_integral_models_are_the_sums_of_eqs_3_22_and_3_27(artifact):
    s = STRAIN / 0.075
    R = artifact.direct * s
    for term in artifact.terms:
        R = R + term.coefficient * integral_sum(turned(s, term.phase), H, term.order)
    assert predict(artifact, STRAIN, H) == pytest.approx(1000.0 + 300.0 * R, abs=300.0 * 2e-6)


def test_model_1_is_the_sum_of_eq_3_20_and_fading_integrals():
    s = STRAIN / 0.075
    (term,) = DERIVATIVES.terms
    R = DERIVATIVES.direct * s
    R[1:] += term.coefficient * derivative_sum(turned(s, term.phase), H, term.order)[1:]
    for fading in DERIVATIVES.fading:
        alone = (predict(replace(DERIVATIVES, direct=0.0, terms=(), fading=(fading,)), STRAIN, H) - 1000.0) / 300.0
        for t in (0.5, 50.0, 166.5):
            tau = np.linspace(0.0, t, 100_001)
            integrand = np.exp(-fading.rate * (t - tau)) * np.interp(tau, TIME, s**fading.exponent)
            assert alone[round(t / H)] == pytest.approx(fading.coefficient * trapezoid(integrand, tau), rel=1e-5)
        R = R + alone
    assert predict(DERIVATIVES, STRAIN, H) == pytest.approx(1000.0 + 300.0 * R, abs=300.0 * 5e-6)


def test_a_fading_integral_of_a_linear_rise_has_a_closed_form():
    """q = 1: (t - (1 - exp(-p t)) / p) / p, at any step, also where p h is large."""
    term = FadingTerm(coefficient=1.0, rate=3.0, exponent=1.0)
    artifact = FractionalArtifact(
        model="model-1", direct=0.0, terms=(), fading=(term,), full_scale_strain=1.0, resistance_change=1.0
    )
    for h in (0.01, 0.5, 20.0):
        t = h * np.arange(30)
        assert predict(artifact, t, h) == pytest.approx((t + np.expm1(-3.0 * t) / 3.0) / 3.0, rel=1e-9, abs=1e-12)


def test_stepping_gives_the_numbers_of_the_batch():
    assert stepped(fractional_sensor_model(INTEGRALS), TIME, STRAIN) == pytest.approx(
        predict(INTEGRALS, STRAIN, H), abs=1e-9
    )


@settings(max_examples=30, deadline=None)
@given(
    h=st.floats(1e-3, 1e3),
    before=st.floats(0.0, 0.1),
    end=st.floats(0.0, 0.1),
    cuts=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=6, unique=True),
)
def test_a_ramp_may_be_cut_into_any_steps(h, before, end, cuts):
    at = np.array([0.0, *sorted(cuts), 1.0])
    whole = stepped(MODEL, [0.0, h, 2.0 * h], [0.0, before, end])[-1]
    parts = stepped(MODEL, [0.0, h, *(h + h * at[1:])], [0.0, before, *(before + at[1:] * (end - before))])[-1]
    assert parts == pytest.approx(whole, rel=1e-12)


@settings(max_examples=20, deadline=None)
@given(rest=st.floats(0.0, 0.1), h=st.floats(1e-4, 1e3))
def test_a_sensor_at_rest_stays_at_rest(rest, h):
    R = stepped(MODEL, h * np.arange(5), np.full(5, rest), rest_strain=rest)
    assert pytest.approx(1000.0 + 300.0 * 0.4 * rest / 0.075, rel=1e-12) == R


def test_the_loop_runs_anticlockwise_climbs_and_relaxes():
    """Observations 1, 3 and 5 of Section 2.1."""
    held = np.concatenate([STRAIN, np.zeros(400)])
    R = predict(INTEGRALS, held, H)
    assert R[150] > R[50] + 1.0  # half strain: on the way down against on the way up
    assert R[300] > R[100]  # second peak above the first
    assert R[400] > R[200] > R[0]
    assert (np.diff(R[401:]) < 0.0).all()


def test_only_sub_model_1_steps():
    for artifact in (TURNED, DERIVATIVES):
        with pytest.raises(ParameterError, match=r"need the whole record.*Identify .* fractional-sub-model-1"):
            fractional_sensor_model(artifact)


def test_its_interface_is_that_of_the_sensor():
    """So its FMU takes the sensor's place in a scenario."""
    both = [[(v.name, v.causality, v.unit) for v in m.variables] for m in (MODEL, sensor_model())]
    assert both[0] == both[1]
    assert MODEL.name == sensor_model().name


def test_strain_outside_the_identified_range_is_flagged_and_not_clipped():
    sensor = Stepper(MODEL)
    sensor.initialize()
    flags, resistances = [], []
    for strain in (0.07, 0.08, -0.001, 0.02):
        sensor.set("strain", strain)
        sensor.step(1.0)
        flags.append(sensor.get("saturated"))
        resistances.append(sensor.get("resistance"))
    assert flags == [0.0, 1.0, 1.0, 0.0]
    assert resistances[1] > resistances[0]


@pytest.mark.parametrize("kind", ["python", "native"])
def test_sub_model_1_runs_as_an_fmu(kind, tmp_path):
    if kind == "native":
        pytest.importorskip("ziglang", reason="native FMUs need the compiler ziglang")
    path = build_fmu(MODEL, tmp_path, native=kind == "native")
    inputs = np.array(
        list(zip(TIME + H, np.append(STRAIN[1:], 0.0), strict=True)), dtype=[("time", "f8"), ("strain", "f8")]
    )
    inputs["time"] -= H  # the strain at the end of each step is set at its start
    result = fmpy.simulate_fmu(
        str(path), stop_time=200.0, step_size=H, output_interval=H, input=inputs, output=["resistance"]
    )
    assert result["resistance"][1:] == pytest.approx(predict(INTEGRALS, STRAIN, H)[1:], abs=1e-6)


@pytest.mark.parametrize("artifact", ALL, ids=lambda a: a.model)
def test_an_artifact_is_read_as_it_was_written(artifact, tmp_path):
    artifact = replace(artifact, provenance={"data": "made up"})
    artifact.write(tmp_path / "model.json")
    assert FractionalArtifact.read(tmp_path / "model.json") == artifact


def test_artifacts_that_make_no_sense_are_refused(tmp_path):
    for change, message in (
        ({"model": "model-3"}, "no fractional model"),
        ({"full_scale_strain": 0.0}, "scales must be positive"),
        ({"direct": float("nan")}, "not finite"),
        ({"terms": (FractionalTerm(coefficient=1.0, order=0.5, phase=0.5),)}, "lies in 0 to 0"),
        ({"fading": DERIVATIVES.fading}, "only model-1 has"),
        ({"shortest": 2.0, "longest": 1.0}, "0 < shortest < longest"),
    ):
        with pytest.raises(ParameterError, match=message):
            replace(INTEGRALS, **change)
    with pytest.raises(ParameterError, match="0 < order < 1"):
        FractionalTerm(coefficient=1.0, order=1.0)
    with pytest.raises(ParameterError, match="p > 0 and q > 0"):
        FadingTerm(coefficient=1.0, rate=0.0, exponent=1.0)
    INTEGRALS.write(tmp_path / "model.json")
    text = (tmp_path / "model.json").read_text()
    (tmp_path / "model.json").write_text(text.replace('"order": 0.3', '"order": 3.0'))
    with pytest.raises(ArtifactError, match="usable fractional model"):
        FractionalArtifact.read(tmp_path / "model.json")


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
    problem = ModelFit([record_of(dataset(1))], model, chosen).problem
    theta = np.array([0.3, 0.8, 0.05, 1.7][: 4 if model == "model-1" else 2])
    found = problem.jacobian(theta).T @ problem.residual(theta)
    for k in range(theta.size):
        step = 1e-5 * np.eye(theta.size)[k]
        after, before = (0.5 * np.sum(problem.residual(theta + way) ** 2) for way in (step, -step))
        assert found[k] == pytest.approx((after - before) / 2e-5, rel=1e-4, abs=1e-7)


@pytest.mark.parametrize("model", MODELS)
def test_more_terms_never_fit_worse(model):
    first = record_of(dataset(1))
    costs = [min(identify_fractional([first], model, FractionalSettings(n_terms=n)).costs) for n in (1, 3, 5)]
    assert costs[1] <= costs[0] + 1e-3
    assert costs[2] <= costs[1] + 1e-3


@pytest.mark.parametrize("model", ["sub-model-1", "sub-model-2"])
def test_all_starts_come_to_one_fit(model):
    costs = identify_fractional([record_of(dataset(1))], model, FractionalSettings(n_terms=3)).costs
    assert max(costs) < 1.05 * min(costs)


def test_terms_that_are_left_out_do_not_make_the_others_doubtful():
    fit = identify_fractional([record_of(dataset(1))], "sub-model-1", FractionalSettings(n_terms=3))
    kept = [k for k, term in enumerate(fit.artifact.terms, 1) if term.coefficient > 0.0]
    assert len(kept) < 3
    sure = {name for name, each in fit.parameters.items() if each.determined}
    assert {"C_1", "a_1"} <= sure <= {"C_0", *(f"{symbol}_{k}" for symbol in "Ca" for k in kept)}


def test_models_that_are_linear_in_strain_cannot_follow_the_synthetic_specimen():
    """The limits that the assessment quotes: above the thesis' figures, which came from another material."""
    limit = limits(starts=2)
    first, second = record_of(dataset(1)), record_of(dataset(2))
    fit = identify_fractional([first], "sub-model-1", FractionalSettings(starts=2))
    assert 0.7110 < limit.fitted["sub-model-2"] < limit.fitted["sub-model-1"] <= fit.train[0].e1
    assert limit.with_square < 0.2 * limit.fitted["sub-model-1"]
    assert limit.noise[0] < limit.informed["model-1"] < limit.informed["sub-model-2"] < limit.informed["sub-model-1"]
    assert misfit(fit.artifact, second).e1 == pytest.approx(limit.doubling, abs=1.5)
    assert max(limit.model_1_informed) < 2.0


def test_model_1_follows_the_synthetic_dataset_1_closer_than_the_thesis_followed_its_own():
    first = record_of(dataset(1))
    fit = identify_fractional([first], "model-1", FractionalSettings(n_terms=3, starts=4))
    assert fit.train[0].e1 < 1.4539  # Table 3.1


MODEL = fractional_sensor_model(INTEGRALS)
