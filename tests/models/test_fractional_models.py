"""Fractional models: forward, stepping, as an FMU, and their artifacts."""

from dataclasses import replace

import fmpy
import numpy as np
import pytest
from gossamer_fmus import build_fmu
from gossamer_models import ArtifactError, ParameterError, Stepper
from gossamer_models.fractional import FadingTerm, FractionalArtifact, FractionalTerm, fractional_sensor_model, predict
from gossamer_models.sensor import sensor_model
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.fractional import (
    ALL,
    DERIVATIVES,
    INTEGRALS,
    STRAIN,
    TIME,
    TURNED,
    H,
    derivative_sum,
    integral_sum,
    turned,
)
from scipy.integrate import trapezoid

MODEL = fractional_sensor_model(INTEGRALS)


def stepped(model, at, strain, **start):
    sensor = Stepper(model, **start)
    sensor.initialize()
    resistance = [sensor.get("resistance")]
    for h, value in zip(np.diff(at), strain[1:], strict=True):
        sensor.set("strain", float(value))
        sensor.step(float(h))
        resistance.append(sensor.get("resistance"))
    return np.array(resistance)


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
    cuts=st.sets(st.integers(100, 9900), min_size=1, max_size=6),
)
def test_a_ramp_may_be_cut_into_any_steps(h, before, end, cuts):
    at = np.array([0, *sorted(cuts), 10_000]) / 10_000
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
        ({"terms": (FractionalTerm(coefficient=1.0, order=0.5, phase=0.5),)}, "must lie in 0 to 0"),
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
