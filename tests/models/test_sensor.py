"""The sensor against hysterons, Everett surfaces and integrals; its invariants and refusals."""

import json

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ArtifactError, ConvergenceError, ParameterError, Stepper
from gossamer_models.compensator import compensator_model
from gossamer_models.modes import exponential_sum, phi_1, phi_2
from gossamer_models.sensor import RelaxationTerm, SensorArtifact, default_artifact, sensor_model
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.preisach import EverettStack, RelayLattice, artifact, drive, spring, start, term
from scipy.integrate import quad

strains = st.floats(0.0, 1.0)
histories = st.lists(strains, min_size=1, max_size=20)

CLOSED = sensor_model(artifact(eta=1.0))
DRIFTING = sensor_model(artifact(eta=0.85))
RELAXING = sensor_model(artifact(eta=0.9, relaxation=[term(0.1, 0), term(0.2, 1, (0.03, 3.0), (0.5, 0.5))]))
DEFAULT = sensor_model()


@settings(max_examples=60, deadline=None)
@given(history=histories, rest=strains)
def test_everett_surfaces_give_the_same_output(history, rest):
    for model, eta in ((CLOSED, 1.0), (DRIFTING, 0.85)):
        stack = EverettStack(artifact(eta=eta), rest)
        sensor = start(model, rest_strain=rest)
        assert sensor.get("resistance") == pytest.approx(stack.f, abs=1e-12)
        expected = [stack.move(s) for s in history]
        assert drive(sensor, history) == pytest.approx(expected, abs=1e-12)


def test_everett_surfaces_agree_for_the_default_sensor_over_a_long_history():
    still = SensorArtifact(mu=default_artifact().mu, nu=default_artifact().nu)
    history = np.random.default_rng(3).uniform(0.0, 1.0, 1000)
    stack = EverettStack(still)
    assert drive(start(sensor_model(still)), history) == pytest.approx([stack.move(s) for s in history], abs=1e-12)


def test_a_lattice_of_single_hysterons_converges_to_the_sensor():
    history = np.random.default_rng(5).uniform(0.0, 1.0, 60)
    sensor = drive(start(DRIFTING, rest_strain=0.3), history)
    errors = []
    for per_bin in (4, 16, 64):
        lattice = RelayLattice(artifact(eta=0.85), per_bin, rest=0.3)
        errors.append(np.abs([lattice.move(s) for s in history] - sensor).max())
    assert errors[2] < 2e-3
    assert errors[0] / errors[1] > 2.5  # first order: a quarter of the spacing, a quarter of the error
    assert errors[1] / errors[2] > 2.5


@settings(max_examples=60, deadline=None)
@given(history=histories, lo=strains, hi=strains)
def test_a_minor_loop_closes_at_eta_one(history, lo, hi):
    """Return-point memory: a second trip lo -> hi -> lo ends where the first one ended."""
    lo, hi = sorted((lo, hi))
    sensor = start(CLOSED)
    y1 = drive(sensor, [*history, lo, hi, lo])[-1]
    y2 = drive(sensor, [hi, lo])[-1]
    assert y2 == pytest.approx(y1, abs=1e-13)


@settings(max_examples=60, deadline=None)
@given(first=histories, second=histories)
def test_full_scale_wipes_out_what_came_before_at_eta_one(first, second):
    one, other = start(CLOSED), start(CLOSED)
    drive(one, [*first, 1.0])
    drive(other, [1.0])
    assert drive(one, second) == pytest.approx(drive(other, second), abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(history=histories)
def test_output_lies_between_zero_and_full_scale_at_eta_one(history):
    y = drive(start(CLOSED), history)
    assert (y >= -1e-13).all()
    assert (y <= 1.0 + 1e-13).all()


@settings(max_examples=40, deadline=None)
@given(history=histories, s=strains, ds=st.floats(1e-6, 0.5))
def test_more_strain_is_more_resistance(history, s, ds):
    sensor = start(RELAXING)
    drive(sensor, history)
    before = sensor.state
    lower = drive(sensor, [s])[0]
    sensor.state = before
    assert drive(sensor, [min(s + ds, 1.0)])[0] >= lower


@settings(max_examples=40, deadline=None)
@given(history=histories, h=st.floats(1e-6, 1e4))
def test_a_rate_independent_sensor_ignores_the_step(history, h):
    assert drive(start(DRIFTING), history, h) == pytest.approx(drive(start(DRIFTING), history, 0.1), abs=0.0)


@settings(max_examples=40, deadline=None)
@given(history=histories, end=strains, cuts=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=6), h=st.floats(1e-4, 1e3))
def test_a_ramp_may_be_cut_into_any_steps(history, end, cuts, h):
    for model in (RELAXING, DEFAULT):
        whole, parts = start(model), start(model)
        for sensor in (whole, parts):
            drive(sensor, history, h)
        begin = history[-1]
        at = np.array([0.0, *sorted(set(cuts)), 1.0])
        y = drive(whole, [end], h)[-1]
        ramp = begin + at[1:] * (end - begin)
        ramp[-1] = end
        assert drive(parts, ramp, h * np.diff(at))[-1] == pytest.approx(y, abs=1e-12)


def test_the_loop_runs_anticlockwise():
    """Falling strain gives more resistance than rising strain, so the loop encloses area on its left."""
    s = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 0, 101)])
    y = drive(start(DEFAULT), s, 1.0)
    area = np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(s))
    assert area < -0.03
    assert (y[101:201] > y[100:0:-1] - 1e-12)[10:-10].all()


def test_the_loop_climbs_with_every_cycle_below_eta_one():
    cycles = np.tile([0.9, 0.1], 6)
    lows = drive(start(DRIFTING), cycles)[1::2]
    assert (np.diff(lows) > 0.01).all()
    assert np.diff(lows, 2) == pytest.approx(0.0, abs=1e-12)  # the same amount each time: Eq. (4.7), accumulating
    assert np.diff(drive(start(CLOSED), cycles)[1::2]) == pytest.approx(0.0, abs=1e-13)


def test_resistance_relaxes_while_strain_is_held():
    y = drive(start(RELAXING), np.full(60, 0.7), np.geomspace(0.01, 50.0, 60))
    assert (np.diff(y) < 0.0).all()
    static = start(RELAXING, rest_strain=0.7).get("resistance")
    assert y[-1] == pytest.approx(static, abs=1e-6)


def test_a_faster_rise_reads_higher():
    peaks = [drive(start(RELAXING), np.linspace(0.02, 0.8, 40), h)[-1] for h in (1e-3, 0.1, 10.0)]
    assert peaks[0] > peaks[1] + 0.01
    assert peaks[1] > peaks[2] + 0.01


@pytest.mark.parametrize("power", [0, 1])
def test_relaxation_is_the_integral_over_all_upward_passages(power):
    """Eq. (4.13) for two rises and holds, with the stretched exponential itself."""
    b, c, a = 0.4, 0.5, 0.2
    rates, weights = exponential_sum(b, c)
    one = RelaxationTerm(amplitude=a, power=power, rate=b, exponent=c, decay_rates=tuple(rates), weights=tuple(weights))
    base = artifact(eta=0.9)
    with_term = sensor_model(SensorArtifact(mu=base.mu, nu=base.nu, relaxation=(one,)))
    corners = [0.6, 0.6, 0.2, 0.9, 0.9]
    durations = np.array([3.0, 2.0, 1.0, 4.0, 7.0])
    dynamic = drive(start(with_term), corners, durations)[-1] - drive(start(sensor_model(base)), corners)[-1]

    def passage(from_, to, begin, length):
        speed = (to - from_) / length

        def rate(t):
            return a * (from_ + speed * (t - begin)) ** power * speed * np.exp(-b * (17.0 - t) ** c)

        return quad(rate, begin, begin + length, epsabs=1e-12)[0]

    assert dynamic == pytest.approx(passage(0, 0.6, 0, 3) + passage(0.2, 0.9, 6, 4), abs=2e-7)


@pytest.mark.parametrize("c", [0.3, 0.5, 0.7, 0.8, 0.95])
@pytest.mark.parametrize("b", [0.05, 1.0])
def test_a_stretched_exponential_is_a_short_positive_sum(b, c):
    rates, weights = exponential_sum(b, c)
    t = np.concatenate([[0.0], np.geomspace(0.01, 1e4, 3001)])
    error = np.exp(-np.outer(t, rates)) @ weights - np.exp(-b * t**c)
    assert np.abs(error).max() < 1e-6
    assert rates.size <= 26
    assert (weights > 0).all()
    assert (np.diff(rates) > 0).all()


@pytest.mark.parametrize("c", [0.98, 0.99, 0.995, 0.999, 0.9999])
@pytest.mark.parametrize("tau", [0.06, 6.3, 20.0, 200.0, 2000.0])
def test_a_kernel_that_is_almost_an_exponential_is_a_short_sum_too(tau, c):
    """A fitted exponent may end anywhere below 1."""
    rates, weights = exponential_sum(tau**-c, c, tolerance=1e-5)
    t = np.concatenate([[0.0], np.geomspace(0.01, 1e4, 3001)])
    assert np.abs(np.exp(-np.outer(t, rates)) @ weights - np.exp(-((t / tau) ** c))).max() < 1e-5
    assert rates.size <= 26


def test_a_plain_exponential_stays_one_term():
    rates, weights = exponential_sum(0.3, 1.0)
    assert (rates.tolist(), weights.tolist()) == ([0.3], [1.0])


@pytest.mark.parametrize(("b", "c"), [(0.0, 0.5), (1.0, 0.0), (1.0, 1.5), (-1.0, 0.5)])
def test_a_growing_exponential_is_refused(b, c):
    with pytest.raises(ParameterError, match="need b > 0"):
        exponential_sum(b, c)


@pytest.mark.parametrize("x", [1e-300, 1e-17, 1e-9, 1e-4, 0.1, 0.4999999, 0.5, 0.5000001, 1.0, 30.0, 800.0])
def test_phi_functions_do_not_cancel(x):
    """Compare with the integrals of e^(-x r) and (1 - r) e^(-x r) over 0..1."""
    symbol = ca.SX.sym("x")
    f = ca.Function("f", [symbol], [phi_1(symbol), phi_2(symbol)])
    found = [float(value) for value in f(x)]
    cut = min(1.0, 40.0 / x)
    expected = [
        quad(g, 0.0, cut, epsabs=0, epsrel=1e-13)[0] for g in (lambda r: np.exp(-x * r), lambda r: (1 - r) * np.exp(-x * r))
    ]
    assert found == pytest.approx(expected, rel=2e-13)


def test_the_run_starts_at_rest_whatever_the_strain():
    sensor = Stepper(DEFAULT, rest_strain=0.1)
    sensor.set("strain", 0.4)
    sensor.initialize()
    rest = sensor.get("resistance")
    again = Stepper(DEFAULT, rest_strain=0.1)
    again.initialize()
    assert again.get("resistance") == rest
    sensor.set("strain", 0.1)
    sensor.step(1.0)
    assert sensor.get("resistance") == rest  # rested: nothing happens while strain stays


def test_parameters_scale_the_result():
    history = [0.3, 0.1, 0.25]
    unit = drive(start(DEFAULT), [2.0 * s for s in history])
    scaled = start(DEFAULT, rest_resistance=50.0, full_scale_resistance_change=7.0, full_scale_strain=0.5)
    assert drive(scaled, history) == pytest.approx(50.0 + 7.0 * unit, rel=1e-14)


def test_strain_beyond_full_scale_is_clipped_and_flagged():
    sensor = start(DEFAULT)
    flags = []
    for s in (0.5, 1.0, 1.2, -0.1, 0.0):
        drive(sensor, [s])
        flags.append(sensor.get("saturated"))
    assert flags == [0.0, 0.0, 1.0, 1.0, 0.0]
    assert drive(start(DEFAULT), [1.7])[0] == drive(start(DEFAULT), [1.0])[0]


def test_state_and_work_of_a_step_are_fixed():
    """Nothing grows with the record: the state keeps its size, and the step is one function without loops on data."""
    sensor = start(DEFAULT)
    size = len(sensor.state)
    drive(sensor, np.random.default_rng(0).uniform(0, 1, 2000))
    assert len(sensor.state) == size
    assert DEFAULT.n_states == 3 * 32 + 2 + len(default_artifact().relaxation[0].decay_rates)
    assert DEFAULT.step.n_instructions() < 10_000


def test_the_step_has_exact_derivatives():
    parameters = [0.0, 1.0, 1.0, 0.2, 293.15, 0.0, 0.0]
    x = DEFAULT.init([0.0, 293.15], parameters)[0]
    step = DEFAULT.step.factory("d", ["i0", "i1", "i2", "i3"], ["jac:o1:i1"])
    slope = float(step(x, [0.41, 293.15], parameters, 0.1)[0, 0])
    y = [float(DEFAULT.step(x, [0.41 + d, 293.15], parameters, 0.1)[1][0]) for d in (-1e-6, 1e-6)]
    assert slope == pytest.approx((y[1] - y[0]) / 2e-6, rel=1e-6)


def test_an_artifact_survives_writing_and_reading(tmp_path):
    path = tmp_path / "sensor.json"
    default_artifact().write(path)
    assert SensorArtifact.read(path) == default_artifact()


def test_the_default_artifact_says_where_it_comes_from():
    assert {"data", "origin", "sha256", "command", "settings"} <= set(default_artifact().provenance)
    assert DEFAULT.provenance == default_artifact().provenance


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda card: card["mu"][0].__setitem__(3, -0.1), r"mu\[0, 3\] is -0.1"),
        (lambda card: card["nu"][1].__setitem__(4, -2.0), r"nu\[1, 4\] is -2"),
        (lambda card: card["nu"].pop(), r"nu has shape \(31, 32\)"),
        (lambda card: card["mu"][2].pop(), "mu has shape"),
        (lambda card: card["mu"][5].__setitem__(1, 0.5), "not zero below its diagonal"),
        (lambda card: card["nu"][0].__setitem__(9, 1e-9), "too small a slope"),
        (lambda card: card["mu"][0].__setitem__(9, float("nan")), "not finite"),
        (lambda card: card["relaxation"][0].update(amplitude=-1.0), "amplitude is -1"),
        (lambda card: card["relaxation"][0].update(power=2), "power is 2"),
        (lambda card: card["relaxation"][0]["weights"].pop(), "one weight per decay rate"),
        (lambda card: card["relaxation"][0].update(extra=1), "extra"),
        (lambda card: card["relaxation"][0]["decay_rates"].__setitem__(1, 10**400), "too large"),
        (lambda card: card.pop("nu"), "nu"),
        (lambda card: card.update(version=3), "version 3"),
        (lambda card: card.update(schema="gossamer.detector"), "gossamer.detector"),
    ],
)
def test_a_faulty_artifact_is_refused_by_name(tmp_path, change, message):
    path = tmp_path / "sensor.json"
    default_artifact().write(path)
    card = json.loads(path.read_text())
    change(card)
    path.write_text(json.dumps(card))
    with pytest.raises(ArtifactError, match=message):
        SensorArtifact.read(path)


def test_a_truncated_artifact_is_refused(tmp_path):
    path = tmp_path / "sensor.json"
    default_artifact().write(path)
    path.write_text(path.read_text()[:1000])
    with pytest.raises(ArtifactError, match="cannot read"):
        SensorArtifact.read(path)
    with pytest.raises(ArtifactError, match="cannot read"):
        SensorArtifact.read(tmp_path / "missing.json")


def test_negative_weights_are_refused_where_they_are_made():
    with pytest.raises(ParameterError, match="cannot be inverted"):
        SensorArtifact(mu=((1.0, -1.0), (0.0, 0.0)), nu=((1.0, 1.0), (0.0, 0.0)))


def test_a_sensor_without_memory_is_a_straight_line():
    s = np.random.default_rng(1).uniform(0, 1, 50)
    assert drive(start(sensor_model(spring())), s) == pytest.approx(s, abs=1e-14)


@pytest.mark.parametrize("model", [sensor_model, compensator_model])
def test_a_rest_strain_beyond_full_scale_is_refused(model):
    with pytest.raises(ConvergenceError, match="rest_strain must not exceed full_scale_strain"):
        Stepper(model(), rest_strain=0.7).initialize()
    at_full_scale = Stepper(model(), rest_strain=0.5)
    at_full_scale.initialize()
