"""Fractional models: forward, stepping, as an FMU, and their artifacts; their operators against closed forms."""

from dataclasses import replace

import fmpy
import numpy as np
import pytest
from building import build_fmu
from gossamer_models import ArtifactError, DataError, ParameterError, Stepper
from gossamer_models.fractional import FadingTerm, FractionalArtifact, FractionalTerm, fractional_sensor_model, predict
from gossamer_models.modes import PowerLawKernels
from gossamer_models.sensor import sensor_model
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.fractional import ALL, DERIVATIVES, INTEGRALS, STRAIN, TIME, TURNED, H, derivative_sum, integral_sum, turned
from scipy.integrate import quad, trapezoid
from scipy.special import gamma
from studies.operators import derivative, integral

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
        with pytest.raises(ParameterError, match=r"need the whole record.*Identify .* model='fractional-sub-model-1'"):
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
    inputs = np.array(list(zip(TIME + H, np.append(STRAIN[1:], 0.0), strict=True)), dtype=[("time", "f8"), ("strain", "f8")])
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


orders = st.floats(0.02, 0.98)
records = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=40).map(np.array)
ORDERS = (0.05, 0.3, 0.5, 0.7, 0.95)
BOTH = ((integral, integral_sum), (derivative, derivative_sum))


def clock(n, lasts=2.0):
    return np.linspace(0.0, lasts, n + 1), lasts / n


@pytest.mark.parametrize("order", [1e-3, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999])
def test_the_sum_of_exponentials_is_the_kernel_to_1e_6_from_one_to_a_million_samples(order):
    grid = PowerLawKernels(1.0, 1e6)
    weights, mass = np.split(grid.at_order(order), [-1])
    t = np.geomspace(1.0, 1e6, 3000)
    kernel = t ** (order - 1.0) / gamma(order)
    found = np.exp(-np.outer(t, grid.rates)) @ weights
    assert np.abs(found / kernel - 1.0).max() < 1e-6
    assert weights.min() > 0.0
    assert mass > 0.0
    assert grid.rates.size <= 42


@pytest.mark.parametrize("order", ORDERS)
def test_the_mass_makes_up_for_what_the_kernel_has_before_the_first_sample(order):
    """The integral of the kernel over one sample, Eq. (3.12) at t = h, and its first moment."""
    grid = PowerLawKernels(1.0, 1e6)
    weights, mass = np.split(grid.at_order(order), [-1])
    whole = mass + np.sum(weights * -np.expm1(-grid.rates) / grid.rates)
    assert whole == pytest.approx(1.0 / gamma(1.0 + order), abs=1e-7)
    moments = [quad(lambda t, r=rate: t * np.exp(-r * t), 0.0, 1.0)[0] for rate in grid.rates]
    assert np.dot(weights, moments) == pytest.approx(1.0 / ((1.0 + order) * gamma(order)), abs=1e-6)
    assert np.exp(-grid.rates[-1]) < 1e-8  # what the mass stands for is over within a sample


@pytest.mark.parametrize("order", ORDERS)
def test_a_constant_decays_as_eq_3_11_and_grows_as_eq_3_12(order):
    t, h = clock(400)
    u = np.full(t.size, 3.0)
    for operator in (derivative, derivative_sum):
        found = operator(u, h, order)
        assert found[1:] == pytest.approx(3.0 * t[1:] ** -order / gamma(1.0 - order), rel=2e-6)
        assert found[0] == np.inf
    for operator in (integral, integral_sum):
        assert operator(u, h, order) == pytest.approx(3.0 * t**order / gamma(1.0 + order), rel=2e-6)


@pytest.mark.parametrize("order", ORDERS)
def test_a_ramp_is_exact(order):
    """J^a t = t^(1+a)/Gamma(2+a) and D^a t = t^(1-a)/Gamma(2-a), at any step."""
    for n in (3, 50, 800):
        t, h = clock(n, 120.0)
        for operator, power in ((integral, 1.0 + order), (derivative, 1.0 - order)):
            assert operator(t, h, order) == pytest.approx(t**power / gamma(1.0 + power), rel=3e-6)
        for operator, power in ((integral_sum, 1.0 + order), (derivative_sum, 1.0 - order)):
            assert operator(t, h, order) == pytest.approx(t**power / gamma(1.0 + power), rel=1e-11)


@pytest.mark.parametrize("operators", BOTH)
@pytest.mark.parametrize("order", [0.3, 0.7])
@pytest.mark.parametrize("power", [2, 3])
def test_powers_converge_at_the_rate_of_linear_interpolation(operators, order, power):
    """Second order for the integral, 2 - a for the derivative: the L1 scheme."""
    sign = 1.0 if operators[0] is integral else -1.0
    rate = 2.0 if sign > 0.0 else 2.0 - order
    for operator in operators:
        errors = []
        for n in (50, 100, 200):
            t, h = clock(n)
            exact = gamma(power + 1.0) / gamma(power + 1.0 + sign * order) * t ** (power + sign * order)
            errors.append(np.abs(operator(t**power, h, order) - exact).max())
        found = np.log2(np.array(errors[:-1]) / errors[1:])
        assert found == pytest.approx(rate, abs=0.1)


@pytest.mark.parametrize("order", [0.2, 0.5, 0.8])
def test_a_sine_converges_to_its_power_series(order):
    """J^a term by term: t^k -> k!/Gamma(k + 1 + a) t^(k + a); for D^a the same with -a."""
    w = 5.0

    def closed(t, a):
        k = np.arange(1.0, 80.0, 2.0)[:, None]
        return np.sum((-1.0) ** ((k - 1.0) / 2.0) * w**k * t ** (k + a) / gamma(k + 1.0 + a), axis=0)

    for operator, a, rate in ((integral, order, 2.0), (derivative, -order, 2.0 - order)):
        errors = []
        for n in (100, 200, 400):
            t, h = clock(n)
            errors.append(np.abs(operator(np.sin(w * t), h, order) - closed(t, a)).max())
        assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(rate, abs=0.15)


@pytest.mark.parametrize("order", [0.25, 0.5, 0.75])
def test_long_after_the_start_a_sine_is_turned_and_scaled(order):
    """The leading terms of Eqs. (3.7) and (3.9); what follows them fades."""
    w = 2.0 * np.pi
    t, h = clock(40_000, 200.0)
    late = t > 190.0
    turned_forward = w**order * np.sin(w * t + 0.5 * np.pi * order)
    turned_back = w**-order * np.sin(w * t - 0.5 * np.pi * order)
    u = np.sin(w * t)
    assert np.abs(derivative(u, h, order) - turned_forward)[late].max() < 1e-2 * w**order
    drift = t[1:] ** (order - 1.0) / (w * gamma(order))  # as printed, Eq. (3.9) has w t where t is meant
    assert np.abs(integral(u, h, order)[1:] - turned_back[1:] - drift)[late[1:]].max() < 2e-3 * w**-order


@settings(max_examples=60, deadline=None)
@given(u=records, order=orders, h=st.floats(1e-3, 1e3))
def test_the_sum_of_exponentials_agrees_with_the_thesis_sums(u, order, h):
    for fast, plain in BOTH:
        exact = plain(u, h, order)[1:]
        assert fast(u, h, order)[1:] == pytest.approx(exact, abs=2e-6 * (np.abs(exact).max() + np.abs(u).max() * h**order))


@settings(max_examples=25, deadline=None)
@given(u=records, v=records, a=st.floats(-3.0, 3.0), order=orders)
def test_the_operators_are_linear(u, v, a, order):
    n = min(u.size, v.size)
    u, v = u[:n], v[:n]
    for operator in (integral, derivative):
        parts = a * operator(u, 0.1, order)[1:] + operator(v, 0.1, order)[1:]
        assert operator(a * u + v, 0.1, order)[1:] == pytest.approx(parts, abs=1e-10)


@settings(max_examples=30, deadline=None)
@given(u=records, order=orders, later=st.integers(1, 30))
def test_a_record_that_starts_later_gives_the_same_later(u, order, later):
    u = np.concatenate([[0.0], u])
    waited = np.concatenate([np.zeros(later), u])
    grid = PowerLawKernels(0.1, 100.0)
    for operator in (integral, derivative):
        assert operator(waited, 0.1, order, grid)[later:] == pytest.approx(operator(u, 0.1, order, grid), abs=1e-11)


@pytest.mark.parametrize(("a", "b"), [(0.3, 0.5), (0.2, 0.2), (0.6, 0.35)])
def test_two_integrals_are_one_of_the_summed_order(a, b):
    """The semigroup property; the second integral sees the first through linear interpolation."""
    errors = []
    for n in (100, 200, 400):
        t, h = clock(n)
        u = t * np.cos(2.0 * t)
        errors.append(np.abs(integral(integral(u, h, a), h, b) - integral(u, h, a + b)).max())
    assert errors[-1] < 2e-4
    assert np.log2(errors[0] / errors[-1]) / 2.0 > 1.0 + min(a, b)


@pytest.mark.parametrize("order", [0.3, 0.6])
def test_the_derivative_undoes_the_integral(order):
    errors = []
    for n in (200, 400, 800):
        t, h = clock(n)
        u = np.sin(3.0 * t) ** 2
        errors.append(np.abs(derivative(integral(u, h, order), h, order) - u).max())
    assert errors[-1] < 1e-3
    assert errors[0] / errors[-1] > 4.0


@settings(max_examples=30, deadline=None)
@given(phase=st.floats(-2.0, 2.0), cycles=st.integers(1, 12), shift=st.floats(0.0, 6.0))
def test_every_harmonic_is_turned_by_the_phase(phase, cycles, shift):
    angle = 2.0 * np.pi * cycles * np.arange(64) / 64
    assert turned(np.cos(angle + shift), phase) == pytest.approx(np.cos(angle + shift + 0.5 * np.pi * phase), abs=1e-12)


@settings(max_examples=30, deadline=None)
@given(u=st.lists(st.floats(-1.0, 1.0), min_size=31, max_size=31).map(np.array), a=st.floats(-1, 1), b=st.floats(-1, 1))
def test_phases_add_up(u, a, b):
    u = u - u.mean()
    assert turned(turned(u, a), b) == pytest.approx(turned(u, a + b), abs=1e-12)


def test_after_a_million_samples_the_relative_error_is_below_1e_6():
    t = np.arange(1_000_001.0)
    found = integral(t, 1.0, 0.4)
    assert np.abs(found[1:] * gamma(2.4) / t[1:] ** 1.4 - 1.0).max() < 1e-6


@pytest.mark.parametrize("order", [0.0, 1.0, -0.2, 1.5, float("nan")])
def test_an_order_outside_zero_to_one_is_refused(order):
    for operator in (integral, derivative, integral_sum, derivative_sum):
        with pytest.raises(ParameterError, match="0 < order < 1"):
            operator(np.zeros(5), 0.1, order)


def test_records_that_cannot_be_used_are_refused():
    for u, h in ((np.zeros(1), 0.1), (np.array([0.0, np.nan]), 0.1), (np.zeros((3, 2)), 0.1), (np.zeros(5), 0.0)):
        with pytest.raises(DataError, match="two or more finite samples"):
            integral(u, h, 0.5)
    with pytest.raises(DataError, match=r"outside the memory of 1 s to 10 s\. Widen"):
        integral(np.zeros(20), 1.0, 0.5, PowerLawKernels(1.0, 10.0))
    with pytest.raises(ParameterError, match="0 < shortest < longest"):
        PowerLawKernels(1.0, 0.5)
