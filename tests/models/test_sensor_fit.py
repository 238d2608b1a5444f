"""Fits of the sensor that are known, what the data do not decide, artifacts that build; and the parts of a fit."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from gossamer_models import DataError, ParameterError, Stepper
from gossamer_models.compensator import compensator_model
from gossamer_models.fitting import Columns, constrained, training_rows
from gossamer_models.fitting.constrained import GaussNewton, Problem, compress, solve_constrained
from gossamer_models.fitting.records import training_stretches
from gossamer_models.identify import identify_files, settings_for
from gossamer_models.modes import StretchedKernels
from gossamer_models.replay import predict_resistance
from gossamer_models.sensor import SensorArtifact, default_artifact, sensor_model
from gossamer_models.sensor.fit import PreisachSettings, fit_preisach
from gossamer_models.sensor.fit.doubts import determination, doubts, parameters, undetermined
from gossamer_models.sensor.fit.parameters import wave_numbers
from gossamer_models.sensor.fit.regression import relaxed, switched
from gossamer_models.sensor.fit.solve import RIDGES, between, choose_ridge
from gossamer_models.sensor.fit.weights import modal_field, reversible_beyond
from gossamer_models.sensor.law import ModeBank
from oracles.preisach import drive, start
from oracles.records import QUICK, everything, fit_like, record, zigzag
from scipy.optimize import lsq_linear, minimize
from studies.specimen import specimen_record

pytestmark = pytest.mark.usefixtures("dashes")


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
    assert chosen[2].ridge > chosen[0].ridge  # noise as large as the signal
    assert len(seen) == 3 * len(RIDGES)
    assert fit_preisach((known,), rows, settings, full_scale=1.0).settings == chosen[0]


def test_a_choice_among_ridges_that_predict_alike_hangs_on_no_single_one():
    """A clear best one is taken; equal ones give their geometric mean; the choice never jumps."""
    errors = np.array([1.0, 3.0, 3.0, 3.0, 3.0])
    assert between(RIDGES, errors) == pytest.approx(RIDGES[0], rel=1e-2)
    assert between(RIDGES, np.ones(5)) == pytest.approx(np.exp(np.mean(np.log(RIDGES))), rel=1e-2)
    nearly = [between((1e-2, 1e-3), np.array([1.0, 1.0 + step])) for step in np.linspace(-0.02, 0.02, 21)]
    assert np.all(np.diff(nearly) > 0.0)  # where the best one alone would jump by ten
    assert nearly[-1] < 1.7 * nearly[0]


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
        found[h] = fit_preisach((replace(known, time=h * known.time),), rows, QUICK, full_scale=1.0, rest_resistance=100.0)
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
        assert any("(--earlier)" in text for text in doubts(fit)) == (not earlier)
        assert not any("--earlier" in text for text in doubts(fit, chosen=True))
        assert any("start at rest and do not include it" in text for text in doubts(fit)) == earlier
    assert off[True] < 0.6 * off[False]


def test_a_fit_that_stopped_early_and_an_output_at_rest_in_another_unit_are_told(known):
    settings = replace(QUICK, most_iterations=1)
    fit = fit_preisach((known,), everything(known), settings, full_scale=1.0, rest_resistance=0.1)
    told = " ".join(doubts(fit))
    assert "still improving after 1 steps" in told
    assert "record begins unstrained with a resistance of 100, but the resistance at rest is 0.1" in told
    chosen = " ".join(doubts(fit, chosen=True))  # auto has no option of steps, but takes a resistance at rest
    assert "still improving" not in chosen
    assert "the resistance at rest is 0.1" in chosen


def test_a_sensor_carries_the_noise_of_its_training_stretch_alone(known):
    noise = np.random.default_rng(8).normal(size=known.time.size)
    late = known.time > 0.6 * known.time[-1]
    noisy = replace(known, resistance=known.resistance + np.where(late, 20.0, 0.5) * noise)
    fit = fit_preisach((noisy,), (~late,), QUICK, full_scale=1.0)
    assert fit.artifact.noise * fit.resistance_change == pytest.approx(0.5, rel=0.25)


def test_an_eta_of_one_value_may_be_fitted_from_several_starts(known):
    settings = replace(settings_for("preisach", modes=3, relaxations=2, extension="gain"), starts=3)
    fit = fit_preisach((known,), everything(known), settings, full_scale=1.0)
    mu, nu = fit.artifact.tables()
    assert nu == pytest.approx(mu, rel=1e-9)


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
    assert any("do not separate eta from slow relaxation" in text for text in doubts(fitted))
    C, R = determination(fitted)
    assert R[fitted.names.index("b_elastic[1]"), fitted.names.index("b_elastic[1]")] > 0.8
    assert {p.name for p in parameters(fitted)[0] if p.determined} >= {"b_elastic[1]"}
    loose = [p.name for p in parameters(fitted)[0] if not p.determined and p.name.startswith("b_eta")]
    assert loose
    assert f"{len(loose)} of {QUICK.modes} weights of eta (b_eta)" in undetermined(fitted)
    assert "b_elastic" not in undetermined(fitted)
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
    with pytest.raises(ParameterError, match="one value of tau per relaxation"):
        PreisachSettings(tau=(1.0,), relaxations=2)
    with pytest.raises(ParameterError, match="choose one of auto, preisach"):
        settings_for("neural")
    with pytest.raises(ParameterError, match="auto chooses modes itself"):
        settings_for("auto", modes=3)
    with pytest.raises(ParameterError, match="needs relaxation, but relaxations is 0"):
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
    turned = replace(known, strain=1e-300 * known.strain, resistance=-known.resistance)
    with pytest.raises(DataError, match="the output falls as strain rises"):  # squares of such strains are zero
        fit_preisach((turned,), everything(known), QUICK)
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
    assert found.fit.artifact.error == pytest.approx(found.errors[1].nrmse / 100.0)  # what the twin expects of it
    assert found.fit.records[0].resistance == pytest.approx(known.resistance)
    assert found.fit.artifact.provenance["train"] == "60%"
    assert len(found.fit.artifact.provenance["sha256"]) == 64
    for train in ("half", "150%", "-5%", "nan%"):
        with pytest.raises(DataError, match=f"cannot read '{train}'"):
            identify_files([path], train=train)
    with pytest.raises(DataError, match="no sample lies in '500:600'"):
        identify_files([path], train="500:600")
    end = known.time[-1]
    assert training_rows(known, f"0:{1.009 * end}").all()
    with pytest.raises(DataError, match=rf"ends at {end:g} s, .* '0:9000' goes beyond\. Write 0:{end / 2:.3g} for"):
        identify_files([path], train="0:9000")


def test_a_record_that_is_shorter_than_the_training_stretch_takes_part_to_its_end(known):
    short = replace(known.at(np.arange(known.time.size) < known.time.size // 3), name="short.csv")
    stretch = f"0:{known.time[-1] / 2}"
    for records in ([short, known], [known, short]):
        assert [rows.all() for rows in training_stretches(records, stretch)] == [record is short for record in records]
        with pytest.raises(DataError, match=rf"^{known.name} ends at {known.time[-1]:g} s, .* '0:9000' goes beyond"):
            training_stretches(records, "0:9000")
    with pytest.raises(DataError, match=r"short\.csv ends at .* goes beyond"):
        training_stretches([short], stretch)


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


def test_the_columns_are_what_the_sensor_does(known):
    artifact = default_artifact()
    mu, nu = (table[np.triu_indices(artifact.n_lines)] for table in artifact.tables())
    bank = ModeBank.of(artifact.relaxation)
    up, down = switched(known.strain, artifact.n_lines)
    Z = relaxed(known.time, known.strain, bank.decay_rates, tuple(bank.amplitudes))
    y = up @ mu - down @ nu + Z @ np.concatenate(list(bank.amplitudes.values()))
    assert 100.0 + 50.0 * y == pytest.approx(known.resistance, abs=1e-9)
