"""Identification from records: fits that are known, what the data do not decide, artifacts that build."""

import itertools
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from gossamer_models import DataError, ParameterError, Stepper
from gossamer_models.compensator import compensator_model
from gossamer_models.fitting import Columns, Record, constrained
from gossamer_models.fitting.constrained import GaussNewton, Problem, compress, solve_constrained
from gossamer_models.identify import identify_files, settings_for
from gossamer_models.modes import StretchedKernels
from gossamer_models.replay import predict_resistance, recover_strain
from gossamer_models.sensor import DirectInverse, RelaxationTerm, SensorArtifact, default_artifact, sensor_model
from gossamer_models.sensor.drives import FALLING, GAIN, Drive
from gossamer_models.sensor.fit import PreisachSettings, fit_preisach
from gossamer_models.sensor.fit.densities import modal_field, reversible_beyond, wave_numbers
from gossamer_models.sensor.fit.doubts import determination, doubts, parameters
from gossamer_models.sensor.fit.model import preisach_model
from gossamer_models.sensor.fit.regression import prepare, relaxed, switched
from gossamer_models.sensor.fit.ridge import RIDGES, choose_ridge
from gossamer_models.sensor.relaxation import ModeBank
from oracles.preisach import drive, start
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear, minimize
from studies.specimen import specimen_record

QUICK = settings_for("preisach", modes=3, relaxations=2, starts=1)


def zigzag(seed=4, turns=24, per=14):
    corners = np.concatenate([[0.0], np.random.default_rng(seed).uniform(0, 1, turns)])
    return np.concatenate([[0.0], *(np.linspace(a, b, per)[1:] for a, b in itertools.pairwise(corners))])


def record(strain, output, h=0.1, name="record"):
    return Record(
        name=name, time=h * np.arange(strain.size), strain=strain, resistance=output, lines=np.arange(strain.size) + 2
    )


def everything(r):
    return (np.ones(r.time.size, dtype=bool),)


@pytest.fixture(scope="module")
def known():
    """A record made by the sensor that ships with the package, in ohm."""
    strain = zigzag()
    return record(strain, 100.0 + 50.0 * drive(start(sensor_model()), strain, 0.1))


@pytest.fixture(scope="module")
def fitted(known):
    return fit_preisach((known,), everything(known), QUICK, full_scale=1.0, rest_resistance=100.0)


def test_the_columns_are_what_the_sensor_does(known):
    artifact = default_artifact()
    mu, nu = (table[np.triu_indices(artifact.n_lines)] for table in artifact.tables())
    bank = ModeBank.of(artifact.relaxation)
    up, down = switched(known.strain, artifact.n_lines)
    y = (
        up @ mu
        - down @ nu
        + sum(relaxed(known.time, known.strain, bank.decay_rates, drive) @ a for drive, a in bank.amplitudes.items())
    )
    assert 100.0 + 50.0 * y == pytest.approx(known.resistance, abs=1e-9)


def test_modes_driven_by_falling_strain_solve_their_differential_equation():
    strain, h, rate = np.array([0.2, 0.9, 0.35, 0.35, 0.1]), 0.7, 1.3
    g, k = 0.4, 0.25

    def slope(t, z):
        i = min(int(t / h), strain.size - 2)
        speed = (strain[i + 1] - strain[i]) / h
        return -rate * z + (g + k * (strain[i] + speed * (t - i * h))) * max(-speed, 0.0)

    exact = [0.0]
    for i in range(strain.size - 1):
        exact.append(solve_ivp(slope, (i * h, (i + 1) * h - 1e-12), [exact[-1]], rtol=1e-11, atol=1e-13).y[0, -1])
    constant, linear = (relaxed(h * np.arange(strain.size), strain, np.array([rate]), drive)[:, 0] for drive in FALLING)
    found = g * constant + k * linear
    assert found == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("signed", [False, True])
def test_a_sensor_whose_relaxation_falling_strain_drives_may_be_cut_into_any_steps(signed):
    terms = [
        RelaxationTerm(
            amplitude=a, power=p, rate=b, exponent=1.0, decay_rates=(b,), weights=(1.0,), drive=d, signed=signed
        )
        for a, p, b, d in (
            (0.05, 0, 0.5, "falling"),
            (0.1, 1, 2.0, "falling"),
            (-0.1 if signed else 0.1, 0, 1.0, "rising"),
        )
    ]
    artifact = replace(default_artifact(), relaxation=tuple(terms))
    corners = np.array([0.0, 0.8, 0.3, 0.6, 0.0])
    fine = np.interp(np.arange(33) / 8, np.arange(5), corners)
    coarse_y = drive(start(sensor_model(artifact)), corners, 1.0)
    fine_y = drive(start(sensor_model(artifact)), fine, 0.125)
    assert fine_y[::8] == pytest.approx(coarse_y, abs=1e-12)


def test_the_exact_inverse_undoes_a_sensor_whose_relaxation_falling_strain_drives():
    term = RelaxationTerm(
        amplitude=0.05, power=1, rate=0.5, exponent=1.0, decay_rates=(0.5,), weights=(1.0,), drive="falling"
    )
    artifact = replace(default_artifact(), relaxation=(*default_artifact().relaxation, term))
    strain = zigzag(seed=8)
    y = drive(start(sensor_model(artifact)), strain, 0.1)
    found = fit_like(artifact)
    assert recover_strain(found, record(strain, y)) == pytest.approx(strain, abs=1e-9)


def fit_like(artifact):
    """Stand in for a fit where only its artifact and its scales are looked at."""
    return type(
        "Fit", (), {"artifact": artifact, "full_scale": 1.0, "rest_resistance": 0.0, "resistance_change": 1.0}
    )()


def test_an_extended_artifact_is_read_back_and_a_plain_one_keeps_its_version(tmp_path):
    path = tmp_path / "sensor.json"
    default_artifact().write(path)
    assert '"version": 1' in path.read_text()
    inverse = DirectInverse(
        law=replace(default_artifact(), provenance={}), lowest=0.0, highest=1.0, offset=0.1, scale=0.8
    )
    term = replace(default_artifact().relaxation[0], amplitude=-0.01, drive="falling", signed=True)
    extended = replace(default_artifact(), relaxation=(term,), inverse=inverse)
    extended.write(path)
    assert '"version": 2' in path.read_text()
    assert SensorArtifact.read(path) == extended


def gaining(amplitude=-0.2, rate=0.5):
    """Return the default sensor with a gain that relaxes at one rate."""
    term = RelaxationTerm(
        amplitude=amplitude,
        power=0,
        rate=rate,
        exponent=1.0,
        decay_rates=(rate,),
        weights=(1.0,),
        signed=amplitude < 0.0,
        gain=True,
    )
    return replace(default_artifact(), relaxation=(*default_artifact().relaxation, term))


@pytest.mark.parametrize("amplitude", [0.3, -0.2])
def test_a_gain_adds_its_modes_times_the_present_strain(amplitude):
    strain, h, rate = zigzag(seed=3), 0.2, 0.5
    without = drive(start(sensor_model()), strain, h)
    modes = relaxed(h * np.arange(strain.size), strain, np.array([rate]), Drive())[:, 0]
    found = drive(start(sensor_model(gaining(amplitude, rate))), strain, h)
    assert found == pytest.approx(without + amplitude * strain * modes, abs=1e-12)
    columns = relaxed(h * np.arange(strain.size), strain, np.array([rate]), GAIN)[:, 0]
    assert columns == pytest.approx(strain * modes, abs=1e-15)


def test_a_sensor_with_a_gain_is_read_back_and_has_no_exact_inverse(tmp_path):
    path = tmp_path / "sensor.json"
    gaining().write(path)
    assert SensorArtifact.read(path) == gaining()
    for method in ("inverse", "estimator"):
        with pytest.raises(ParameterError, match="has a gain"):
            compensator_model(gaining(0.3), method)


def test_a_sensor_with_a_gain_is_found_and_gets_a_direct_inverse():
    strain = zigzag(seed=5, turns=40)
    made = record(strain, 100.0 + 50.0 * drive(start(sensor_model(gaining())), strain, 0.1))
    rows = (np.arange(strain.size) < strain.size // 2,)
    off = {}
    for extension in ("none", "gain"):
        settings = settings_for("preisach-hats", extension=extension, ridge=1e-4, starts=1)
        fit = fit_preisach((made,), rows, settings, full_scale=1.0, rest_resistance=100.0)
        off[extension] = float(np.abs(predict_resistance(fit, made) - made.resistance)[~rows[0]].max())
    assert off["gain"] < 0.3 * off["none"]
    assert fit.artifact.inverse is not None
    assert np.sqrt(np.mean((recover_strain(fit, made) - made.strain)[rows[0]] ** 2)) < 0.01


def test_operators_that_no_record_switched_back_lose_nothing():
    """Beyond the fitted strain the first loading goes on as the density says, and what it adds is reversible."""
    n, seen = 8, 0.5
    turn = reversible_beyond(n, seen).toarray()
    line, k = np.triu_indices(n)
    mu = np.random.default_rng(1).uniform(size=line.size)
    moved = turn @ mu
    assert moved[(line / n >= seen)] == pytest.approx(0.0)
    inner = (line > 0) & (line / n < seen)
    assert moved[inner] == pytest.approx(mu[inner])
    virgin = [np.bincount(k, weights) for weights in (mu, moved)]  # what the first loading switches, bin by bin
    assert virgin[1] == pytest.approx(virgin[0])
    assert (reversible_beyond(n, 1.0).toarray() == np.eye(line.size)).all()


def test_the_ridge_is_chosen_without_a_look_at_the_test_stretch(known):
    rows = (np.arange(known.strain.size) < 200,)
    settings = settings_for("preisach-hats", relaxations=2, extension="gain", ridge="auto")
    spoiled = replace(known, resistance=np.where(rows[0], known.resistance, 1e3))
    noisy = replace(known, resistance=known.resistance + np.random.default_rng(0).normal(0.0, 20.0, known.strain.size))
    seen: list[str] = []
    chosen = [
        choose_ridge((r,), rows, settings, full_scale=1.0, watch=lambda name, i, e: seen.append(name))
        for r in (known, spoiled, noisy)
    ]
    assert chosen[0] == chosen[1]
    assert chosen[0].ridge == chosen[0].relaxation_ridge
    assert chosen[2].ridge == max(RIDGES)  # noise as large as the signal
    assert len(seen) == 3 * len(RIDGES)
    assert fit_preisach((known,), rows, settings, full_scale=1.0).settings == chosen[0]


def test_a_ridge_cannot_be_chosen_where_the_first_half_rests():
    strain = np.concatenate([np.zeros(100), zigzag(turns=8)])
    with pytest.raises(DataError, match="rests in the first half"):
        choose_ridge((record(strain, 1.0 + strain),), (np.arange(strain.size) < 180,), QUICK, full_scale=1.0)


def test_identified_scales_are_the_start_values_of_both_models(known, fitted, tmp_path):
    path = tmp_path / "sensor.json"
    fitted.artifact.write(path)
    artifact = SensorArtifact.read(path)
    assert artifact.scales == fitted.artifact.scales
    for model in (sensor_model(artifact), compensator_model(artifact), compensator_model(artifact, "estimator")):
        starts = {v.name: v.start for v in model.variables}
        assert starts["rest_resistance"] == pytest.approx(100.0)
        assert starts["full_scale_resistance_change"] == fitted.resistance_change
        assert starts["full_scale_strain"] == 1.0
    sensor = Stepper(sensor_model(artifact))
    sensor.initialize()
    assert drive(sensor, known.strain, 0.1) == pytest.approx(fitted.predicted[0], abs=1e-6)


def test_a_sensor_that_may_reverse_has_no_exact_inverse():
    term = replace(default_artifact().relaxation[0], amplitude=-0.01, signed=True)
    with pytest.raises(ParameterError, match="no exact inverse"):
        compensator_model(replace(default_artifact(), relaxation=(term,)))


def test_constrained_least_squares_agree_with_another_solver():
    rng = np.random.default_rng(2)
    E, e = rng.normal(size=(30, 6)), rng.normal(size=30)
    bounded = solve_constrained(E, e, np.eye(6), np.zeros(6))
    assert bounded == pytest.approx(lsq_linear(E, e, bounds=(0, np.inf), tol=1e-14).x, abs=1e-8)
    G, h = rng.normal(size=(9, 6)), rng.uniform(-1.0, 0.2, 9)
    found = solve_constrained(E, e, G, h)
    peer = minimize(
        lambda x: np.sum((E @ x - e) ** 2),
        np.zeros(6),
        jac=lambda x: 2.0 * E.T @ (E @ x - e),
        constraints={"type": "ineq", "fun": lambda x: G @ x - h, "jac": lambda x: G},
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 500},
    )
    assert (G @ found - h).min() > -1e-9
    assert found == pytest.approx(peer.x, abs=1e-5)


def test_the_iteration_finds_two_exponentials_and_their_linear_amplitudes():
    t = np.linspace(0, 5, 60)
    x = ca.MX.sym("x", 4)
    f = x[2] * ca.exp(-x[0] * ca.DM(t)) + x[3] * ca.exp(-x[1] * ca.DM(t))
    problem = Problem(
        A=np.eye(60),
        b=2.0 * np.exp(-0.5 * t) + 1.0 * np.exp(-3.0 * t),
        model=ca.Function("m", [x], [f, x[2:], ca.MX(0, 1)]),
        linear=np.array([False, False, True, True]),
        lower=np.array([0.1, 1.0, -np.inf, -np.inf]),
        upper=np.array([1.0, 9.0, np.inf, np.inf]),
    )
    found = GaussNewton(problem).minimize(np.array([0.9, 1.1, 0.0, 0.0]), tolerance=1e-14)
    assert found.x == pytest.approx([0.5, 3.0, 2.0, 1.0], abs=1e-5)


def test_compression_keeps_every_sum_of_squares():
    rng = np.random.default_rng(3)
    A, b, x = rng.normal(size=(200, 7)), rng.normal(size=200), rng.normal(size=7)
    R, r = compress(A, b)
    assert R.shape == (8, 7)
    assert np.sum((R @ x - r) ** 2) == pytest.approx(np.sum((A @ x - b) ** 2))


def test_derivatives_of_the_residual_are_those_of_finite_differences(known, fitted):
    hats = settings_for("preisach-hats", relaxations=2, extension="falling", starts=1)
    for fit in (fitted, fit_preisach((known,), everything(known), replace(hats, most_iterations=1), full_scale=1.0)):
        data, preferred = fit.solver.slopes(fit.x)
        steps = 1e-6 * np.eye(fit.x.size)
        differences = [(fit.solver.stacked(fit.x + d) - fit.solver.stacked(fit.x - d)) / 2e-6 for d in steps]
        assert np.vstack([data, preferred]) == pytest.approx(np.transpose(differences), abs=1e-6)


def test_the_model_is_a_graph_of_few_operations_whatever_the_size_of_the_plane(known):
    """The stopwatch of ``studies.speed`` in numbers that no machine changes: 7e4 and 3e5 as scalar expressions."""
    sizes = []
    for n_lines in (8, 32):
        settings = replace(settings_for("preisach", starts=1), n_lines=n_lines, most_iterations=1)
        model = fit_preisach((known,), everything(known), settings, full_scale=1.0).solver.problem.model
        x = model.mx_in(0)
        slopes = ca.jacobian(ca.vertcat(*model.call([x], True, False)), x)
        sizes.append((model.n_instructions(), ca.Function("slopes", [x], [slopes]).n_instructions()))
    assert sizes[0] == sizes[1]
    assert sizes[1][0] < 200
    assert sizes[1][1] < 3000


def test_a_fit_of_seven_modes_evaluates_model_and_derivatives_a_few_dozen_times(monkeypatch):
    """``scipy.optimize.least_squares`` asks for the residual 17615 times from the same start."""
    evaluations = []
    evaluate = constrained._Fast.__call__
    monkeypatch.setattr(constrained._Fast, "__call__", lambda self, x: evaluations.append(1) or evaluate(self, x))
    specimen = specimen_record(1)
    fit_preisach(
        (specimen,), (specimen.time < 200.0,), settings_for("preisach", starts=1), full_scale=0.15, rest_resistance=0.0
    )
    assert len(evaluations) < 150


def test_modal_functions_are_those_of_the_thesis():
    N, (m, n) = 6, wave_numbers(4)
    b, places = ca.DM([1.0, 0.0, 0.0, 2.0]), (np.arange(N) + 0.5) / N
    field = modal_field(b, ca.DM(m), ca.DM(n), places).full().ravel()
    line, k = np.triu_indices(N)
    i, j = np.pi * (k + 0.5) / N, np.pi * (k - line + 0.5) / N
    wanted = 2.0 + 2.0 * (np.cos(m[3] * i) * np.cos(n[3] * j) + np.cos(n[3] * i) * np.cos(m[3] * j))
    assert field == pytest.approx(wanted)


def test_fixed_rates_hold_a_stretched_exponential():
    kernels = StretchedKernels.between(0.1, 100.0)
    tau, c = np.array([7.0, 20.0]), np.array([0.6, 0.9])
    weights = kernels.weights(ca.DM(np.log(tau)), ca.DM(c)).full()
    t = np.geomspace(0.05, 150.0, 50)
    wanted = np.exp(-((t[:, None] / tau) ** c))
    assert np.exp(-np.outer(t, kernels.rates)) @ weights == pytest.approx(wanted, abs=2e-3)


def test_a_known_sensor_is_predicted_after_a_fit_with_few_modes(known, fitted):
    later = record(zigzag(seed=9), 100.0 + 50.0 * drive(start(sensor_model()), zigzag(seed=9), 0.1))
    size = np.ptp(known.resistance)
    assert np.sqrt(np.mean((fitted.predicted[0] - known.resistance) ** 2)) < 0.01 * size
    assert np.sqrt(np.mean((predict_resistance(fitted, later) - later.resistance) ** 2)) < 0.02 * size


def test_the_artifact_runs_as_it_was_fitted(known, fitted):
    assert predict_resistance(fitted, known) == pytest.approx(fitted.predicted[0], abs=1e-9 * np.ptp(known.resistance))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_what_a_fit_predicts_is_what_its_sensor_gives_however_slow_the_record_is(known, scale):
    """Far beyond the training stretch, too, and beyond the times that kernels hold for by default."""
    record = replace(known, time=scale * known.time)
    rows = (np.arange(known.time.size) < 120,)
    size = np.ptp(known.resistance)
    found = {}
    for h in (1.0, scale):
        found[h] = fit_preisach(
            (replace(known, time=h * known.time),), rows, QUICK, full_scale=1.0, rest_resistance=100.0
        )
    fit = found[scale]
    assert predict_resistance(fit, record) == pytest.approx(fit.predicted[0], abs=1e-9 * size)
    assert fit.predicted[0] == pytest.approx(found[1.0].predicted[0], abs=1e-3 * size)  # time has no scale of its own


def test_what_relaxed_before_a_record_adds_to_a_known_output_at_rest(known):
    left = 8.0 * np.exp(-known.time / 3.0)
    off = {}
    for earlier in (False, True):
        fit = fit_preisach(
            (replace(known, resistance=known.resistance + left),),
            everything(known),
            replace(QUICK, earlier=earlier),
            full_scale=1.0,
            rest_resistance=100.0,
        )
        off[earlier] = float(np.abs(predict_resistance(fit, known) - known.resistance).max())
        assert any("start at rest and do not know it" in text for text in doubts(fit)) == earlier
    assert off[True] < 0.6 * off[False]


def test_a_fit_that_stopped_early_and_an_output_at_rest_in_another_unit_are_told(known):
    settings = replace(QUICK, most_iterations=1)
    fit = fit_preisach((known,), everything(known), settings, full_scale=1.0, rest_resistance=0.1)
    told = " ".join(doubts(fit))
    assert "still improving after 1 steps" in told
    assert "record begins unstrained with an output of 100, where 0.1 is taken for that at rest" in told


def test_an_eta_of_one_value_may_be_fitted_from_several_starts(known):
    settings = replace(settings_for("preisach", modes=3, relaxations=2, extension="gain"), starts=3)
    fit = fit_preisach((known,), everything(known), settings, full_scale=1.0)
    mu, nu = fit.artifact.tables()
    assert nu == pytest.approx(mu, rel=1e-9)


def test_the_constraint_of_the_exact_inverse_is_on_the_weights_that_the_sensor_gets(known):
    """Operators wider than the fitted strain give the elastic line their weight and their eta."""
    settings = replace(QUICK, extension="falling")
    regression = prepare((known,), everything(known), settings, 3.0)
    model = preisach_model(settings, regression)
    N = settings.n_lines
    names = [b.name for b in model.blocks for _ in range(b.size)]
    x = np.random.default_rng(2).uniform(0.1, 0.4, len(names))
    jump = {name: x[[name == each for each in names]].sum() for name in ("g_falling", "k_falling")}
    falling = jump["g_falling"] + jump["k_falling"] * (np.arange(N) + 1.0) / N
    nu = regression.stretches[0].split(model.weights(x)).nu[:N]
    steep = model.function(x)[1].full()[-N:, 0]
    assert steep == pytest.approx(nu - settings.least_slope - falling)


def test_weights_are_not_negative_and_the_inverse_exists(known):
    settings = settings_for("preisach-hats", relaxations=2, extension="falling", starts=1)
    fit = fit_preisach((known,), everything(known), settings, full_scale=1.0)
    assert min(term.amplitude for term in fit.artifact.relaxation) >= 0.0
    assert {term.drive for term in fit.artifact.relaxation} <= {"rising", "falling"}
    back = recover_strain(fit, replace(known, resistance=predict_resistance(fit, known)))
    assert back == pytest.approx(known.strain, abs=1e-8)


def test_a_reversing_sensor_gets_a_direct_inverse_that_recovers_the_strain(known):
    settings = settings_for("preisach-hats", relaxations=4, extension="reversing")
    fit = fit_preisach((known,), everything(known), settings, full_scale=1.0)
    assert fit.artifact.inverse is not None
    assert np.sqrt(np.mean((recover_strain(fit, known) - known.strain) ** 2)) < 0.03


def test_equal_seeds_give_equal_fits_and_two_records_count_as_one(known):
    half = known.strain.size // 2
    settings = replace(QUICK, starts=2, seed=5, most_iterations=4)
    fits = [fit_preisach((known,), everything(known), settings, full_scale=1.0) for _ in range(2)]
    assert (fits[0].x == fits[1].x).all()
    first = record(known.strain[:half], known.resistance[:half])
    both = fit_preisach((known, first), everything(known) + everything(first), settings, full_scale=1.0)
    assert len(both.predicted) == 2
    assert both.rest_resistance == pytest.approx(100.0, abs=5.0)


def test_a_record_without_holds_does_not_decide_eta_and_is_told_so(known, fitted):
    assert any("eta and slow relaxation" in text for text in doubts(fitted))
    C, R = determination(fitted)
    assert R[fitted.names.index("b_elastic[1]"), fitted.names.index("b_elastic[1]")] > 0.8
    assert {p.name for p in parameters(fitted) if p.determined} >= {"b_elastic[1]"}
    assert np.linalg.eigvalsh(C).min() > -1e-12


def test_fixed_kernels_stay_as_given(known):
    settings = replace(QUICK, tau=(1.0, 10.0), exponents=(0.5, 1.0))
    fit = fit_preisach((known,), everything(known), settings, full_scale=1.0)
    found = dict(zip(fit.names, fit.x, strict=True))
    assert [found["log_tau[1]"], found["log_tau[2]"]] == pytest.approx(np.log([1.0, 10.0]))
    assert [found["c[1]"], found["c[2]"]] == [0.5, 1.0]


def test_impossible_settings_are_refused():
    with pytest.raises(ParameterError, match="at least 1 mode"):
        PreisachSettings(modes=0)
    with pytest.raises(ParameterError, match="one of tau per relaxation"):
        PreisachSettings(tau=(1.0,), relaxations=2)
    with pytest.raises(ParameterError, match="it is one of preisach"):
        settings_for("neural")
    with pytest.raises(ParameterError, match="adds to the relaxation, of which there is none"):
        settings_for("preisach", relaxations=0, extension="gain")
    with pytest.raises(ParameterError, match="0 starts"):
        settings_for("preisach", starts=0)
    for wrong in (-1.0, float("nan"), float("inf")):
        with pytest.raises(ParameterError, match="take a finite one of 0 or more"):
            settings_for("preisach", ridge=wrong)
    with pytest.raises(ParameterError, match="the seed is -1"):
        PreisachSettings(seed=-1)


def test_too_few_or_too_large_samples_are_refused(known):
    few = np.arange(known.time.size) < 20
    with pytest.raises(DataError, match="20 samples to fit"):
        fit_preisach((known,), (few,), QUICK)
    with pytest.raises(
        DataError, match=r"record, lines 2 to 314: in the training stretch the strain moves by less than 1 %"
    ):
        fit_preisach((replace(known, strain=1e-3 * known.strain),), everything(known), QUICK, full_scale=1.0)
    with pytest.raises(DataError, match=r"the output falls as strain rises, their correlation is -0\.9"):
        fit_preisach((replace(known, resistance=-known.resistance),), everything(known), QUICK)
    for wrong in (0.0, float("nan"), float("inf")):
        with pytest.raises(DataError, match="the full scale is"):
            fit_preisach((known,), everything(known), QUICK, full_scale=wrong)
    with pytest.raises(DataError, match="the resistance at rest is nan"):
        fit_preisach((known,), everything(known), QUICK, rest_resistance=float("nan"))
    with pytest.raises(DataError, match=r"line \d+: strain .* is outside 0 to full scale 0.5"):
        fit_preisach((known,), everything(known), QUICK, full_scale=0.5)
    with pytest.raises(DataError, match="beyond the full scale"):
        predict_resistance(replace_scale(fit_like(default_artifact()), 0.5), known)


def replace_scale(fit, full_scale):
    fit.full_scale = full_scale
    return fit


def test_a_file_becomes_an_artifact_with_provenance(tmp_path, known):
    path = tmp_path / "measured.csv"
    rows = "\n".join(
        f"{1e3 * t:.3f},{100 * s:.9g},{r / 1e3:.9g}"
        for t, s, r in zip(known.time, known.strain, known.resistance, strict=True)
    )
    path.write_text("t_ms,strain [%],R_kohm\n" + rows + "\n")
    found = identify_files([path], columns=Columns(), train="60%", settings=QUICK, full_scale=1.0, command="test")
    assert [e.stretch for e in found.errors] == ["train", "test"]
    assert found.errors[0].nrmse < 1.0
    assert found.fit.records[0].resistance == pytest.approx(known.resistance)
    assert found.fit.artifact.provenance["train"] == "60%"
    assert len(found.fit.artifact.provenance["sha256"]) == 64
    for train in ("half", "150%", "-5%", "nan%"):
        with pytest.raises(DataError, match=f"cannot read '{train}'"):
            identify_files([path], train=train)
    with pytest.raises(DataError, match="no sample lies in '500:600'"):
        identify_files([path], train="500:600")
