"""The parts of a fit: columns, densities, kernels, constrained least squares, derivatives."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from gossamer_models.fitting import constrained
from gossamer_models.fitting.constrained import GaussNewton, Problem, compress, solve_constrained
from gossamer_models.identify import settings_for
from gossamer_models.modes import StretchedKernels
from gossamer_models.sensor import default_artifact
from gossamer_models.sensor.fit import fit_preisach
from gossamer_models.sensor.fit.parameters import modal_field, reversible_beyond, wave_numbers
from gossamer_models.sensor.fit.regression import relaxed, switched
from gossamer_models.sensor.law import ModeBank
from oracles.records import everything
from scipy.optimize import lsq_linear, minimize
from studies.specimen import specimen_record


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
