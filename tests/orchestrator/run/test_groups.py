"""Groups: what depends on itself at the same instant is iterated to its closed form, and what cannot be is said."""

from __future__ import annotations

import zipfile

import coupled
import hostile as faults
import numpy as np
import pytest
from gossamer_orchestrator import (
    Recorder,
    ScenarioError,
    Simulation,
    SimulationError,
    make_plan,
    parse_scenario,
    run_scenario,
)
from gossamer_orchestrator.run.stages import next_guess
from simulated import simulate

GROUP = '[[groups]]\ncomponents = ["one", "two"]\ntolerance = 1e-12\n'


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """Folder with the coupled FMUs."""
    pytest.importorskip("ziglang", reason="the coupled FMUs need the compiler ziglang")
    folder = tmp_path_factory.mktemp("coupled")
    for name in coupled.KINDS:
        coupled.build(name, folder)
    return folder


def loop(a, b, more=GROUP, *, one="", key="", stop=0.3, size=1):
    """y1 = a y2 + 1 and y2 = b y1, by element; ``a`` and ``b`` are numbers or matrices of 3 x 3."""
    A, B = (np.broadcast_to(np.asarray(m, dtype=float) * (np.eye(3) if np.ndim(m) == 0 else 1.0), (3, 3)) for m in (a, b))
    given = lambda A: "A = [" + ", ".join(repr(float(x)) for x in A.ravel()) + "]"  # noqa: E731
    fixed = "".join(f', "u[{i}]" = 0' for i in range(size + 1, 4))
    wires = "".join(
        f'[[connections]]\nfrom = "{x}.y[{i}]"\nto = "{y}.u[{i}]"\n{key if (x, i) == ("two", 1) else ""}\n'
        for i in range(1, size + 1)
        for x, y in (("one", "two"), ("two", "one"))
    )
    return parse_scenario(
        f"step = 0.1\nstop = {stop}\n[components]\n"
        f'one = {{ fmu = "gain", parameters = {{ {given(A)}{one} }}, inputs = {{ "b[*]" = 1{fixed} }} }}\n'
        f'two = {{ fmu = "gain", parameters = {{ {given(B)} }}, inputs = {{ "b[*]" = 0{fixed} }} }}\n{wires}{more}'
    )


class Sweeps:
    """Keep how many sweeps each step takes; without it, how many the initialization took."""

    def begin(self, simulation):
        self.counts = [simulation.groups[0].sweeps]

    def sample(self, simulation):
        if simulation.tick:
            self.counts.append(simulation.groups[0].sweeps)

    def end(self, simulation):
        pass


def run(scenario, fmus, **options):
    """Return the recorded table by column, and the sweeps of the initialization and of each step."""
    plan, sweeps = make_plan(scenario, fmus), Sweeps()
    recorder = Recorder(plan)
    with Simulation(plan, **options) as simulation:
        simulation.run([recorder, sweeps])
    return dict(zip(plan.columns, recorder.table.T, strict=True)), sweeps.counts


@pytest.mark.parametrize("b", [0.5, -0.9, 0.0, 3.0, -40.0, 200.0])
def test_a_linear_loop_converges_in_four_sweeps_to_its_closed_form_also_where_repetition_diverges(fmus, b, caplog):
    """y1 = 1 / (1 - b), from the initialization on."""
    columns, sweeps = run(loop(1.0, b), fmus)
    assert columns["one", "y[1]"] == pytest.approx(1.0 / (1.0 - b), rel=1e-10)
    assert columns["two", "y[1]"] == pytest.approx(b / (1.0 - b), rel=1e-10)
    assert max(sweeps) <= 4
    assert caplog.text == ""


def test_a_loop_of_three_values_converges_to_its_closed_form(fmus):
    """y1 = (1 - A B)^-1 1; A B has the eigenvalues -6, 2 and 1/2."""
    A = np.array([[-6.0, 1.0, 2.0], [0.0, 2.0, -1.0], [0.0, 0.0, 0.5]])
    B = np.eye(3)
    columns, sweeps = run(loop(A, B, size=3), fmus)
    expected = np.linalg.solve(np.eye(3) - A @ B, np.ones(3))
    for i in range(3):
        assert columns["one", f"y[{i + 1}]"] == pytest.approx(expected[i], rel=1e-10)
    assert max(sweeps) <= 6


def test_values_that_change_are_followed_in_every_step(fmus):
    event = '[[events]]\ntime = 0.2\ncomponent = "one"\nset = { "b[1]" = 5.0 }\n'
    columns, _ = run(loop(1.0, -2.0, GROUP + event), fmus)
    assert columns["one", "y[1]"] == pytest.approx([1 / 3, 1 / 3, 1 / 3, 5 / 3], rel=1e-10)


def test_a_component_that_feeds_itself_is_iterated(fmus):
    text = loop(0.25, 0.0, "").source.text.replace('from = "two.y[1]"', 'from = "one.y[1]"')
    columns, _ = run(parse_scenario(text + '[[groups]]\ncomponents = ["one"]\ntolerance = 1e-12\n'), fmus)
    assert columns["one", "y[1]"] == pytest.approx(4 / 3, rel=1e-10)


def test_without_a_group_a_loop_delays_with_a_warning(fmus, caplog):
    columns, _ = run(loop(1.0, 0.5, "" + '[[groups]]\ncomponents = ["one", "two"]\nsweeps = 1\n'), fmus)
    delayed = simulate(loop(1.0, 0.5, ""), fmus)
    assert "the connection two.y[1] -> one.u[1] delays by one step" in caplog.text
    assert delayed["one.y"].values[:, 0].tolist() == [1.0, 1.5, 1.75, 1.875]
    assert columns["one", "y[1]"].tolist() == [1.0, 1.5, 1.75, 1.875]  # one sweep is no more than a delay


def test_an_iterated_loop_is_not_warned_of(fmus, caplog):
    make_plan(loop(1.0, 0.5), fmus)
    assert caplog.text == ""


# --- disturbances, refusals, parts ---


def test_noise_on_a_coupled_connection_is_the_same_in_every_sweep(fmus):
    """With noise n on what comes back, y1 = (1 + n) / (1 - b): the noise is what the delayed run without feedback shows."""
    key = 'noise = { kind = "normal", amplitude = 0.1, seed = 4 }'
    (columns, _), (open_, _) = (run(loop(1.0, b, key=key, stop=2.0), fmus) for b in (0.5, 0.0))
    noise = open_["one", "y[1]"] - 1.0
    assert np.ptp(noise) > 0.1
    assert columns["one", "y[1]"] == pytest.approx((1.0 + noise) / 0.5, rel=1e-10)


def test_a_sample_that_drops_out_leaves_what_arrived_last(fmus):
    """Without the sample the loop is open in that step: the input is that of the step before."""
    key = "dropout = { probability = 0.5, seed = 1 }"
    columns, _ = run(loop(1.0, 0.5, key=key, stop=2.0), fmus)
    assert columns["one", "y[1]"] == pytest.approx(2.0, rel=1e-10)


def test_a_step_that_is_refused_is_done_in_parts_of_iterated_steps(fmus):
    """The gain refuses steps longer than 0.05 s once its limit is set."""
    scenario = loop(1.0, -3.0, one=", limit = 1e9")
    plan, sweeps = make_plan(scenario, fmus), Sweeps()
    recorder = Recorder(plan)
    with Simulation(plan) as simulation:
        simulation.run([recorder, sweeps])
        assert simulation.divided == 3
    column = recorder.table[:, plan.columns.index(("one", "y[1]"))]
    assert column == pytest.approx(0.25, rel=1e-10)


def test_a_refusal_in_a_sweep_names_the_component(fmus):
    with pytest.raises(SimulationError, match=r"component 'two' refused the step of 0.1 s at t = 0 s, even in 64 parts"):
        run(
            parse_scenario(
                loop(1.0, 0.5).source.text.replace(
                    'two = { fmu = "gain", parameters = { ', 'two = { fmu = "gain", parameters = { limit = 1.5, '
                )
            ),
            fmus,
        )


def test_an_fmu_that_crashes_within_a_sweep_is_named_with_the_time(beside, hostile):
    wires = "".join(f'[[connections]]\nfrom = "{a}.y[1]"\nto = "{b}.u"\n' for a, b in (("good", "bad"), ("bad", "good")))
    scenario = beside(f"fault = {faults.SEGFAULT}, at = 21", more=wires + '[[groups]]\ncomponents = ["good", "bad"]\n')
    text = scenario.source.text.replace("inputs = { u = 1.0 }\n", "").replace("inputs = { u = 0.0 }\n", "")
    with pytest.raises(SimulationError, match=r"component 'bad' .* in the step from t = 0.021 s") as error:
        run_scenario(parse_scenario(text), hostile)
    assert error.value.component == "bad"


def test_what_does_not_converge_is_said_once_with_the_residual_and_counted(fmus, caplog):
    """a b = 1 has no solution: every sweep adds one."""
    run(loop(1.0, 1.0, GROUP + "sweeps = 10\n"), fmus)
    first, last = (record.getMessage() for record in caplog.records)
    assert first.startswith(
        "the group one, two does not converge in the step from t = 0 s: after 10 sweeps two.y[1] still changes by 0.1 of "
        "its size, more than 'tolerance' = 1e-12. The run goes on with its last values"
    )
    assert last == "the group one, two did not converge in 4 steps"


def test_with_strict_it_is_an_error_and_the_results_so_far_are_kept(fmus, tmp_path):
    event = '[[events]]\ntime = 0.2\ncomponent = "one"\nset = { "b[1]" = nan }\n'.replace("nan", "1e308")
    scenario = loop(1.0, 1.0 + 1e-9, GROUP.replace("1e-12", "1e-3") + event)
    with pytest.raises(SimulationError, match=r"the group one, two does not converge in the step from t = 0.2 s"):
        run_scenario(scenario, fmus, tmp_path, strict=True)
    assert (tmp_path / "results.nc").is_file()


# --- two masses and a spring ---

MASSES = """
step = {step}
stop = 2.0
[components]
one = {{ fmu = "mass", parameters = {{ m = {m1}, k = {k}, x0 = 0.3 }} }}
two = {{ fmu = "mass", parameters = {{ m = {m2}, x0 = -0.1{longest} }} }}
[[connections]]
from = "two.x"
to = "one.u"
[[connections]]
from = "one.force"
to = "two.u"
gain = -1.0
"""


def masses(step, more=GROUP, m1=1.0, m2=0.5, k=40.0, longest=""):
    return parse_scenario(MASSES.format(step=step, m1=m1, m2=m2, k=k, longest=longest) + more)


def exact(time, m1=1.0, m2=0.5, k=40.0):
    """Displacements of two masses that are released from 0.3 and -0.1 on a spring without a length."""
    w, middle = np.sqrt(k / m1 + k / m2), (0.3 * m1 - 0.1 * m2) / (m1 + m2)
    stretch = 0.4 * np.cos(w * time)
    return middle + stretch * m2 / (m1 + m2), middle - stretch * m1 / (m1 + m2)


def trapezoidal(steps, step, m1, m2, k):
    """The same, by the trapezoidal rule for both masses at once."""
    A = np.zeros((4, 4))
    A[:2, 2:] = np.eye(2)
    A[2:, :2] = [[-k / m1, k / m1], [k / m2, -k / m2]]
    forward = np.linalg.solve(np.eye(4) - step / 2 * A, np.eye(4) + step / 2 * A)
    z = [np.array([0.3, -0.1, 0.0, 0.0])]
    for _ in range(steps):
        z.append(forward @ z[-1])
    return np.array(z)[:, :2].T


def error(data):
    """Largest error of both displacements."""
    return max(
        np.abs(data[f"{c}.x"].values - x).max() for c, x in zip(("one", "two"), exact(data["time"].values), strict=True)
    )


def test_an_iterated_spring_is_the_rule_applied_to_both_masses_at_once_and_of_second_order(fmus):
    coarse, fine = (simulate(masses(step), fmus) for step in (0.02, 0.01))
    for c, x in zip(("one", "two"), trapezoidal(100, 0.02, 1.0, 0.5, 40.0), strict=True):
        assert coarse[f"{c}.x"].values == pytest.approx(x, abs=1e-10)
    assert error(coarse) / error(fine) == pytest.approx(4.0, rel=0.05)


def test_the_iterated_spring_is_closer_to_the_exact_solution_than_the_delayed_one(fmus):
    assert error(simulate(masses(0.02), fmus)) < 0.1 * error(simulate(masses(0.02, ""), fmus))


def test_a_light_mass_whose_repetition_diverges_is_iterated_too(fmus):
    """k h^2 / (4 m2) is 4: plain repetition diverges, and the delayed run grows without bound."""
    scenario = masses(0.02, m2=1e-3, k=40.0)
    data = simulate(scenario, fmus)
    for c, x in zip(("one", "two"), trapezoidal(100, 0.02, 1.0, 1e-3, 40.0), strict=True):
        assert data[f"{c}.x"].values == pytest.approx(x, abs=1e-9)
    assert abs(simulate(masses(0.02, "", m2=1e-3), fmus)["two.x"].values[-1]) > 1e3


def test_parts_of_a_refused_step_begin_from_the_states_of_their_own(fmus):
    """A mass that takes steps of 0.01 s at most gives at every other point what a run with that step gives."""
    parts = simulate(masses(0.02, longest=", longest = 0.0101"), fmus)
    whole = simulate(masses(0.01), fmus)
    assert parts.attrs["divided_steps"] == 100
    assert parts["one.x"].values == pytest.approx(whole["one.x"].values[::2], abs=1e-10)


# --- the iteration itself ---


@pytest.mark.parametrize("n", [1, 4, 9])
def test_the_next_guess_solves_a_linear_problem_of_n_values_after_n_plus_one_sweeps(n):
    random = np.random.default_rng(n)
    H, b = 3.0 * random.normal(size=(n, n)), random.normal(size=n)
    guesses, results = [], []
    x = np.zeros(n)
    for _ in range(n + 1):
        guesses.append(x)
        results.append(H @ x + b)
        x = next_guess(guesses, results, np.ones(n))
    assert x == pytest.approx(np.linalg.solve(np.eye(n) - H, b), rel=1e-7)


# --- refusals ---

WRONG = {
    "an unknown component": ('components = ["one", "to"]', "there is no component 'to'. Did you mean 'two'?"),
    "twice": ('components = ["one", "one"]', "component 'one' stands twice in this group. Name it once."),
    "in two groups": (
        'components = ["one", "two"]\n[[groups]]\ncomponents = ["two", "one"]',
        "component 'two' stands in another group, too. Name it once.",
    ),
    "no connection": ('components = ["two"]', "the group's components are not connected to each other. Remove the group."),
    "no tolerance": ('components = ["one", "two"]\ntolerance = 0.0', "tolerance"),
    "no sweeps": ('components = ["one", "two"]\nsweeps = 0', "sweeps"),
    "another key": ('components = ["one", "two"]\nsweep = 3', "sweeps"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_group_is_refused_with_its_line(fmus, case):
    more, message = WRONG[case]
    with pytest.raises(ScenarioError) as error:
        make_plan(loop(1.0, 0.5, f"[[groups]]\n{more}\n"), fmus)
    assert message in str(error.value)
    assert "scenario:1" in str(error.value)


def test_an_fmu_that_cannot_restore_its_state_is_refused(fmus, tmp_path):
    with zipfile.ZipFile(fmus / "gain.fmu") as old, zipfile.ZipFile(tmp_path / "gain.fmu", "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b'SetFMUstate="true"', b'SetFMUstate="false"'))
    message = r"FMU 'gain' of component 'one' cannot restore its state \(canGetAndSetFMUstate\), so its step cannot be"
    with pytest.raises(ScenarioError, match=message):
        make_plan(loop(1.0, 0.5), tmp_path)


def test_jacobi_and_an_order_that_tears_a_group_apart_are_refused(fmus):
    with pytest.raises(ScenarioError, match="a group is stepped one component after another, which master"):
        make_plan(parse_scenario('master = "jacobi"\n' + loop(1.0, 0.5).source.text), fmus)
    third = '[components.three]\nfmu = "gain"\ninputs = { "*" = 0 }\n'
    text = 'order = ["one", "three", "two"]\n' + loop(1.0, 0.5, third + GROUP).source.text
    with pytest.raises(ScenarioError, match="scenario:1: the components of the group one, two must stand side by side"):
        make_plan(parse_scenario(text), fmus)


def test_a_component_between_two_of_a_group_is_stepped_after_both(fmus, caplog):
    third = '[components.three]\nfmu = "gain"\ninputs = { "b[*]" = 0, "u[2]" = 0, "u[3]" = 0 }\n'
    wires = '[[connections]]\nfrom = "one.y[1]"\nto = "three.u[1]"\n[[connections]]\nfrom = "three.y[1]"\nto = "two.u[2]"\n'
    text = loop(1.0, 0.5, third + wires + GROUP).source.text
    one, _, two = text.partition("two = {")
    plan = make_plan(parse_scenario(one + "two = {" + two.replace(', "u[2]" = 0', "", 1)), fmus)
    assert [component.name for component in plan.components] == ["one", "two", "three"]
    assert "the connection three.y[1] -> two.u[2] delays by one step" in caplog.text
