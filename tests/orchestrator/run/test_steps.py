"""Components of other rates, steps of a size that the error demands, and components that step at once."""

from __future__ import annotations

import threading
import time
from itertools import pairwise

import numpy as np
import pytest
from gossamer_orchestrator import (
    ScenarioError,
    Simulation,
    SimulationError,
    build_container,
    export_ssp,
    make_plan,
    parse_scenario,
    run_scenario,
)
from gossamer_orchestrator.run import stream
from simulated import simulate

# --- a rate per component ---


def ramp_held(every, *, step=0.25, stop=2.0, more=""):
    """A clock, and an integrator of it that steps less often."""
    return parse_scenario(
        f"step = {step}\nstop = {stop}\n[components.clock]\nfmu = 'clock'\ninputs = {{ u = 0.0 }}\n"
        f"[components.slow]\nfmu = 'integrator'\nevery = {every}\n"
        f"[[connections]]\nfrom = 'clock.end'\nto = 'slow.u'\n{more}"
    )


def test_a_slow_component_steps_over_the_steps_that_end_where_it_does_and_is_held_between(fmus):
    data = simulate(ramp_held(4), fmus)
    assert data["slow.y"].values.tolist() == [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 3.0]  # 1.0 * 1.0, + 1.0 * 2.0


def test_a_slow_component_equals_a_run_with_its_own_step(fmus):
    slow = simulate(ramp_held(4), fmus)
    alone = simulate(ramp_held(1, step=1.0), fmus)
    assert slow["slow.y"].values[::4].tolist() == alone["slow.y"].values.tolist()


def test_a_slow_component_that_refuses_its_step_is_divided_with_the_others(fmus):
    whole = ramp_held(4)
    text = whole.source.text.replace("every = 4", "every = 4\nparameters = { limit = 0.3 }")
    data = simulate(parse_scenario(text), fmus)
    assert data["slow.y"].values.tolist() == simulate(whole, fmus)["slow.y"].values.tolist()
    assert data.attrs["divided_steps"] == 2


def test_an_event_reaches_a_slow_component_at_its_own_next_point(fmus):
    text = (
        "step = 0.25\nstop = 3.0\n[components.slow]\nfmu = 'integrator'\nevery = 4\ninputs = { u = 1.0 }\n"
        "[[events]]\ntime = 1.25\ncomponent = 'slow'\nset = { u = 5.0 }\n"
    )
    assert simulate(parse_scenario(text), fmus)["slow.y"].values[::4].tolist() == [0.0, 1.0, 2.0, 7.0]


def test_what_does_not_fit_a_rate_is_refused(fmus, tmp_path):
    with pytest.raises(ScenarioError, match="the run has 8 steps, which 3 does not divide"):
        make_plan(ramp_held(3), fmus)
    with pytest.raises(ScenarioError, match="component 'slow' is in a group, whose components step together"):
        make_plan(ramp_held(4, more="[[groups]]\ncomponents = ['clock', 'slow']\n"), fmus)
    with pytest.raises(ScenarioError, match="a container steps all components at once, so it has no 'every'"):
        build_container(ramp_held(4), fmus, tmp_path / "one.fmu")


# --- step-size control ---


def oscillator(head, *, step=0.1, stop=1.0):
    """x' = v and v' = -x from x = 1, each in a component of its own that holds the other over a step."""
    return parse_scenario(
        f"step = {step}\nstop = {stop}\nmaster = 'jacobi'\n{head}\n[components]\n"
        "x = { fmu = 'integrator' }\nv = { fmu = 'integrator' }\n"
        "[[connections]]\nfrom = 'v.y'\nto = 'x.u'\n[[connections]]\nfrom = 'x.y'\nto = 'v.u'\ngain = -1.0\nbias = 1.0\n"
    )  # x.y is 1 - cos t, and v.y is sin t, if v' = 1 - x.y


def error_of(scenario, fmus):
    data = simulate(scenario, fmus)
    t = data.time.values
    return np.abs(data["x.y"].values - (1.0 - np.cos(t))).max(), data


def test_the_master_is_of_order_one_in_the_fixed_step(fmus):
    errors = [error_of(oscillator("", step=step), fmus)[0] for step in (0.05, 0.025, 0.0125)]
    assert np.diff(np.log2(errors)) == pytest.approx(-1.0, abs=0.1)


def test_the_error_follows_the_square_root_of_the_tolerance(fmus):
    """The step of a method of order one is as the root of its tolerance, and so is the error at the end."""
    tolerances = [1e-3, 1e-4, 1e-5]
    errors = [error_of(oscillator(f"step_control = {{ tolerance = {t} }}"), fmus)[0] for t in tolerances]
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert slope == pytest.approx(0.5, abs=0.15)
    assert errors[-1] < 0.1 * error_of(oscillator(""), fmus)[0]


def test_steps_are_small_only_where_that_is_needed(fmus):
    text = (
        "step = 0.5\nstop = 8.0\nstep_control = { tolerance = 1e-3 }\n[components]\n"
        "a = { fmu = 'integrator', inputs = { u = 0.0 } }\nb = { fmu = 'integrator' }\nc = { fmu = 'integrator' }\n"
        "[[connections]]\nfrom = 'a.y'\nto = 'b.u'\n[[connections]]\nfrom = 'b.y'\nto = 'c.u'\n"
        "[[events]]\ntime = 4.0\ncomponent = 'a'\nset = { u = 1.0 }\n"
        "[record]\nvariables = ['*']\n"
    )
    data = simulate(parse_scenario(text), fmus)
    steps = np.diff(data["b.steps"].values)
    assert steps[:8].tolist() == [2.0] * 8  # two halves of each
    assert steps[8:].max() > 8.0
    assert data["b.y"].values[-1] == pytest.approx(8.0, rel=0.02)


def test_a_tolerance_that_cannot_be_met_is_said_once_and_strict_ends_the_run(fmus, tmp_path, caplog):
    scenario = oscillator("step_control = { tolerance = 1e-8, parts = 4 }")
    run_scenario(scenario, fmus, tmp_path)
    (said,) = [r.getMessage() for r in caplog.records if "smallest step of the step control" in r.getMessage()]
    assert "0.025 s" in said
    with pytest.raises(SimulationError, match="Allow more 'parts', or use a larger 'tolerance'"):
        run_scenario(scenario, fmus, tmp_path, strict=True)


@pytest.mark.parametrize("rate", [20.0, 200.0])
def test_trials_that_are_taken_back_leave_no_trace(fmus, rate):
    """x' = k (1 - x): the first trials are unstable and huge, and the answer is as good as the tolerance asks."""
    text = (
        "step = 1.0\nstop = 10.0\nmaster = 'jacobi'\nstep_control = { tolerance = 1e-3, parts = 65536 }\n"
        "[components.x]\nfmu = 'integrator'\n[components.one]\nfmu = 'gain'\ninputs = { '*' = 0.0, 'offset[1]' = 1.0 }\n"
        f"[[connections]]\nfrom = 'x.y'\nto = 'x.u'\ngain = {-rate}\nbias = {rate}\n"
    ).replace("'*' = 0.0, 'offset[1]' = 1.0", "u = 0.0, 'offset[*]' = 0.0")
    data = simulate(parse_scenario(text), fmus)
    assert data["x.y"].values[1:] == pytest.approx(1.0, abs=1e-3)


def test_a_value_that_leaves_zero_slowly_is_no_miss(fmus, caplog):
    """Two integrators in a row, by Jacobi: the second begins as the square of time."""
    text = (
        "step = 0.5\nstop = 2.0\nmaster = 'jacobi'\nstep_control = { tolerance = 1e-3 }\n[components]\n"
        "a = { fmu = 'integrator', inputs = { u = 1.0 } }\nb = { fmu = 'integrator' }\nc = { fmu = 'integrator' }\n"
        "[[connections]]\nfrom = 'a.y'\nto = 'b.u'\n[[connections]]\nfrom = 'b.y'\nto = 'c.u'\n"
    )
    data = simulate(parse_scenario(text), fmus)
    assert "smallest step" not in caplog.text
    assert data["c.y"].values[-1] == pytest.approx(8.0 / 6.0, abs=0.1)


def test_a_run_under_step_control_resumes_to_the_same_bits(reference_fmus, tmp_path):
    text = "step = 0.1\nstop = 4.0\nstep_control = { tolerance = 1e-5 }\n[components.a]\nfmu = 'VanDerPol2'\n"
    text += "[components.b]\nfmu = 'VanDerPol2'\nevery = 2\n"
    plan = make_plan(parse_scenario(text), reference_fmus)
    with Simulation(plan) as whole:
        for _ in range(20):
            whole.step()
        stream.save_checkpoint(tmp_path / "half.npz", whole, 0, stream.digests(plan))
        whole.run()
        wanted = whole.values.tolist()
    with Simulation(make_plan(parse_scenario(text), reference_fmus)) as resumed:
        stream.restore_checkpoint(resumed, *stream.load_checkpoint(tmp_path / "half.npz", resumed.plan))
        resumed.run()
        assert resumed.values.tolist() == wanted


def test_a_refused_step_is_halved_by_the_step_control(fmus):
    text = oscillator("step_control = { tolerance = 0.1 }").source.text
    data = simulate(
        parse_scenario(
            text.replace("x = { fmu = 'integrator' }", "x = { fmu = 'integrator', parameters = { limit = 0.02 } }")
        ),
        fmus,
    )
    assert data.attrs["divided_steps"] == 10


def test_what_cannot_be_controlled_is_refused(fmus, tmp_path):
    scenario = oscillator("step_control = { tolerance = 1e-3 }")
    text = scenario.source.text
    with pytest.raises(ScenarioError, match="forgetful cannot restore its state"):
        make_plan(parse_scenario(text.replace("integrator", "forgetful")), fmus)
    with pytest.raises(ScenarioError, match="is a power of two"):
        parse_scenario(text.replace("1e-3", "1e-3, parts = 100"))
    with pytest.raises(ScenarioError, match="no step control"):
        export_ssp(scenario, fmus, tmp_path / "x.ssp")


# --- components that step at once ---


class Counted:
    """Stands for the step of an instance, and counts how many are in it at once; each waits for as many as are expected."""

    def __init__(self, expected):
        self.now = self.most = 0
        self.expected, self.changed = expected, threading.Condition()

    def of(self, step):
        def counted(*arguments):
            with self.changed:
                self.now += 1
                self.most = max(self.most, self.now)
                self.changed.notify_all()
                self.changed.wait_for(lambda: self.most >= self.expected, timeout=10.0)
            time.sleep(0.01)  # time for one more than expected
            try:
                return step(*arguments)
            finally:
                with self.changed:
                    self.now -= 1

        return counted


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_as_many_components_step_at_once_as_there_are_threads(reference_fmus, threads):
    components = "".join(f"c{i} = {{ fmu = 'Dahlquist2' }}\n" for i in range(4))
    scenario = parse_scenario(f"step = 0.1\nstop = 0.2\nmaster = 'jacobi'\n[components]\n{components}")
    with Simulation(make_plan(scenario, reference_fmus), threads=threads) as simulation:
        counted = Counted(threads)
        for member in simulation.members:
            member.instance.step = counted.of(member.instance.step)
        simulation.run()
    assert counted.most == threads


def test_of_several_that_end_the_simulation_the_first_in_order_is_named_with_threads_too(reference_fmus):
    stairs = "a = { fmu = 'Stair2' }\nb = { fmu = 'Stair2' }\n"
    scenario = parse_scenario(f"step = 0.2\nstop = 10.0\nmaster = 'jacobi'\n[components]\n{stairs}")
    for threads in (1, 2):
        data = run_scenario(scenario, reference_fmus, threads=threads)
        assert data.attrs["ended"] == "component 'a' ended the simulation at t = 9 s"


@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel"])
def test_threads_change_no_bit(reference_fmus, master):
    balls = "".join(f"ball{i} = {{ fmu = 'BouncingBall2', parameters = {{ e = 0.{i} }} }}\n" for i in (6, 7, 8))
    scenario = parse_scenario(f"step = 0.01\nstop = 1.0\nmaster = '{master}'\n[components]\n{balls}")
    one = run_scenario(scenario, reference_fmus)
    three = run_scenario(scenario, reference_fmus, threads=3)
    for name in one.data_vars:
        assert three[name].values.tolist() == one[name].values.tolist()


def stages(scenario, fmus):
    """Return which components step at once."""
    with Simulation(make_plan(scenario, fmus), threads=2) as simulation:
        begins = [stage.number for stage in simulation._stages] + [len(simulation.members)]
        names = [member.name for member in simulation.members]
    return [names[a:b] for a, b in pairwise(begins)]


def test_under_gauss_seidel_a_component_waits_for_those_that_feed_it(chain, fmus):
    text = oscillator("").source.text
    assert stages(parse_scenario(text), fmus) == [["x", "v"]]
    assert stages(parse_scenario(text.replace("jacobi", "gauss-seidel")), fmus) == [["x"], ["v"]]


def test_a_component_that_refuses_among_several_is_named(fmus):
    text = oscillator("").source.text.replace(
        "v = { fmu = 'integrator' }", "v = { fmu = 'integrator', parameters = { until = 0.5 } }"
    )
    with (
        pytest.raises(SimulationError, match="component 'v' refused the step"),
        Simulation(make_plan(parse_scenario(text), fmus), threads=2) as simulation,
    ):
        simulation.run()
