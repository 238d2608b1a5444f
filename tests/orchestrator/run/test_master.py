"""The master algorithm on FMUs whose answers are known in closed form."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest
from gossamer_orchestrator import Recorder, Simulation, SimulationError, make_plan, parse_scenario, run_scenario
from simulated import simulate


def test_a_constant_is_integrated(chain, fmus):
    data = simulate(chain(), fmus)
    assert data["time"].values == pytest.approx(np.arange(11) * 0.1, abs=0)
    assert data["integral.y"].values == pytest.approx(2.0 * data["time"].values, abs=1e-14)


def three_gains(master: str, order: str = "") -> str:
    """A clock's end time through three gains of one."""
    components = "".join(f'[components.g{i}]\nfmu = "gain"\ninputs = {{ "offset[*]" = 0.0 }}\n' for i in (1, 2, 3))
    wires = (("clock.end", "g1.u"), ("g1.y", "g2.u"), ("g2.y", "g3.u"))
    connections = "".join(f'[[connections]]\nfrom = "{a}"\nto = "{b}"\n' for a, b in wires)
    return (
        f'step = 0.25\nstop = 2.0\nmaster = "{master}"\n{order}\n{components}[components.clock]\nfmu = "clock"\n'
        f"inputs = {{ u = 0.0 }}\n{connections}"
    )


def test_gauss_seidel_hands_a_value_through_the_whole_chain_in_one_step(fmus):
    data = simulate(parse_scenario(three_gains("gauss-seidel")), fmus)
    assert data["g3.y"].values.tolist() == data["time"].values.tolist()


def test_jacobi_delays_by_one_step_per_connection(fmus):
    data = simulate(parse_scenario(three_gains("jacobi")), fmus)
    assert data["g3.y"].values.tolist() == np.maximum(data["time"].values - 0.75, 0.0).tolist()


def test_gauss_seidel_against_the_flow_delays_as_jacobi_does(fmus):
    order = 'order = ["g3", "g2", "g1", "clock"]'
    backward = simulate(parse_scenario(three_gains("gauss-seidel", order)), fmus)
    jacobi = simulate(parse_scenario(three_gains("jacobi")), fmus)
    assert backward["g3.y"].values.tolist() == jacobi["g3.y"].values.tolist()


def test_gauss_seidel_in_a_partly_wrong_order_delays_only_there(fmus):
    order = 'order = ["clock", "g1", "g3", "g2"]'
    data = simulate(parse_scenario(three_gains("gauss-seidel", order)), fmus)
    assert data["g3.y"].values.tolist() == np.maximum(data["time"].values - 0.25, 0.0).tolist()


LOOP = """
step = 0.5
stop = 2.0
{head}
[components.a]
fmu = "delay"
[components.b]
fmu = "gain"
inputs = {{ "offset[1]" = 1.0, "offset[2]" = 0.0 }}
[[connections]]
from = "a.last_u"
to = "b.u"
[[connections]]
from = "b.y"
to = "a.u"
"""


def test_feedback_through_an_output_without_feedthrough_runs_under_jacobi_and_in_a_stated_order(fmus):
    jacobi = simulate(parse_scenario(LOOP.format(head='master = "jacobi"')), fmus)
    assert jacobi["b.y"].values.tolist() == [1.0, 1.0, 2.0, 2.0, 3.0]
    stated = simulate(parse_scenario(LOOP.format(head='order = ["a", "b"]')), fmus)
    assert stated["b.y"].values.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize(("twice", "once"), [("begin", "end"), ("end", "begin")])
def test_inputs_that_stand_side_by_side_or_not_arrive_where_they_belong(fmus, master, twice, once):
    """Outputs in the order of the inputs are read where they stand, others are gathered; y = 2 u + offset[1]."""
    text = (
        f'step = 0.25\nstop = 2.0\nmaster = "{master}"\n[components]\nclock = {{ fmu = "clock", inputs = {{ u = 0.0 }} }}\n'
        'sum = { fmu = "gain", parameters = { factor = 2.0 }, inputs = { "offset[2]" = 0.0 } }\n'
        f'[[connections]]\nfrom = "clock.{twice}"\nto = "sum.u"\n'
        f'[[connections]]\nfrom = "clock.{once}"\nto = "sum.offset[1]"\n'
    )
    data = simulate(parse_scenario(text), fmus)
    expected = 2.0 * data[f"clock.{twice}"].values + data[f"clock.{once}"].values
    late = 1 if master == "jacobi" else 0
    assert data["sum.y"].values[late:].tolist() == expected[: len(expected) - late].tolist()


def test_a_hundred_thousand_steps_land_exactly(fmus):
    text = 'step = 1e-4\nstop = 10.0\n[components.c]\nfmu = "clock"\ninputs = { u = 0.0 }\n[record]\nevery = 50000\n'
    data = simulate(parse_scenario(text), fmus)
    assert data["time"].values.tolist() == [0.0, 50000 * 1e-4, 100000 * 1e-4]
    assert data["c.begin"].values.tolist()[1:] == [49999 * 1e-4, 99999 * 1e-4]


def test_a_refused_step_is_repeated_in_parts_from_the_same_state(chain, fmus):
    """The integrator takes 0.03 at most: steps of 0.1 are done in 4 parts of 0.025."""
    scenario = chain(
        ('fmu = "integrator"', 'fmu = "integrator"\nparameters = { limit = 0.03 }'),
        more="""
[record]
variables = ["integral.*"]
""",
    )
    data = simulate(scenario, fmus)
    assert data["integral.y"].values == pytest.approx(2.0 * data["time"].values, abs=1e-14)
    assert data["integral.steps"].values.tolist() == [4.0 * k for k in range(11)]
    assert data.attrs["divided_steps"] == 10


def test_times_within_a_divided_step_are_exact(fmus):
    text = """
step = 0.1
stop = 0.3
[components.c]
fmu = "clock"
inputs = { u = 1.0 }
[components.i]
fmu = "integrator"
parameters = { limit = 0.013 }
[[connections]]
from = "c.last_u"
to = "i.u"
"""
    data = simulate(parse_scenario(text), fmus)
    h = 0.1 / 64
    assert data["c.begin"].values.tolist()[1:] == [(64 * k + 56) * h for k in range(3)]
    assert data["i.y"].values[-1] == pytest.approx(0.3, abs=1e-15)


def test_noise_does_not_depend_on_refused_steps(chain, fmus):
    """The sampled noise of a step is the same whether it is done at once or in parts, so Euler gives the same sum."""
    noisy = ('to = "integral.u"', 'to = "integral.u"\nnoise = { kind = "normal", amplitude = 1.0, seed = 3 }\n'
             "dropout = { probability = 0.3, seed = 4 }")  # fmt: skip
    whole = simulate(chain(noisy), fmus)
    limited = ('fmu = "integrator"', 'fmu = "integrator"\nparameters = { limit = 0.03 }')
    parts = simulate(chain(noisy, limited), fmus)
    assert parts["integral.y"].values == pytest.approx(whole["integral.y"].values, abs=1e-12)
    assert np.std(np.diff(whole["integral.y"].values)) > 0.01


def test_a_step_refused_in_all_sizes_ends_the_run_with_time_component_and_log(chain, fmus, tmp_path):
    scenario = chain(('fmu = "integrator"', 'fmu = "integrator"\nparameters = { until = 0.45 }'))
    with pytest.raises(SimulationError) as caught:
        run_scenario(scenario, fmus, tmp_path / "out")
    message = str(caught.value)
    assert caught.value.component == "integral"
    assert caught.value.time == pytest.approx(0.5)
    for words in ("'integral'", "t = 0.5 s", "64 parts", "100 % refused: a step of 0.0015625 s from 0.5 s"):
        assert words in message
    assert (tmp_path / "out/results.nc").is_file()


def test_without_states_a_refused_step_ends_the_run_and_says_whose_fault_it_is(chain, fmus):
    scenario = chain(('fmu = "integrator"', 'fmu = "forgetful"\nparameters = { limit = 0.03 }'))
    with pytest.raises(
        SimulationError, match="the step cannot be repeated in parts, because forgetful cannot restore its state"
    ):
        simulate(scenario, fmus)


FRAGILE = """
step = 0.1
stop = 1.0
[components.fragile]
fmu = "fragile"
[components.integral]
fmu = "integrator"
[[connections]]
from = "fragile.y"
to = "integral.u"
"""


def test_a_fatal_fmu_leaves_results_on_disk_and_is_not_called_again(fmus, tmp_path):
    from gossamer_orchestrator import load_results

    with pytest.raises(SimulationError, match=r"'fragile' failed at t = 0.5 s \(fatal\)(.|\n)*100 %s of it broke") as caught:
        run_scenario(parse_scenario(FRAGILE), fmus, tmp_path)
    assert caught.value.fatal
    data = load_results(tmp_path)
    assert data["time"].values[-1] == pytest.approx(0.5)
    assert data["fragile.y"].values[-1] == pytest.approx(0.5)
    assert "ZeroDivisionError" in data.attrs["ended"]


def test_another_run_follows_a_fatal_one(fmus, chain):
    with pytest.raises(SimulationError):
        simulate(parse_scenario(FRAGILE), fmus)
    assert simulate(chain(), fmus)["integral.y"].values[-1] == pytest.approx(2.0)


def test_every_instance_is_freed_when_a_run_fails(chain, fmus, monkeypatch):
    from gossamer_orchestrator.fmi import instance, slave

    freed = []
    close = instance.Instance.close
    monkeypatch.setattr(instance.Instance, "close", lambda self: (freed.append(self.name), close(self)))
    scenario = chain(('fmu = "integrator"', 'fmu = "integrator"\nparameters = { until = 0.45 }'))
    with pytest.raises(SimulationError):
        simulate(scenario, fmus)
    assert sorted(freed) == ["integral", "source"]
    assert slave._logs == {}


class Interrupter:
    """Press Ctrl-C in the middle of a run."""

    def begin(self, simulation):
        pass

    def sample(self, simulation):
        if simulation.tick == 4:
            os.kill(os.getpid(), signal.SIGINT)

    def end(self, simulation):
        pass


def test_an_interrupted_simulation_stops_after_the_present_step(chain, fmus):
    handler = signal.getsignal(signal.SIGINT)
    plan = make_plan(chain(), fmus)
    with Simulation(plan) as simulation, pytest.raises(KeyboardInterrupt):
        simulation.run([Interrupter()])
    assert simulation.tick == 4
    assert signal.getsignal(signal.SIGINT) is handler


def test_an_event_changes_an_input_from_its_time_on(chain, fmus):
    event = '[[events]]\ntime = 0.45\ncomponent = "source"\nset = { u = 7.0, "offset[2]" = 1.0 }\n'
    data = simulate(chain(more=event), fmus)
    assert data["source.y"].values.tolist() == [2.0] * 6 + [8.0] * 5
    assert data["source.u"].values.tolist() == [2.0] * 6 + [7.0] * 5


def test_two_runs_of_one_plan_are_equal_to_the_bit(chain, fmus):
    plan = make_plan(chain(('to = "integral.u"', 'to = "integral.u"\nnoise = { kind = "uniform", amplitude = 1 }')), fmus)
    tables = []
    for _ in range(2):
        recorder = Recorder(plan)
        with Simulation(plan) as simulation:
            simulation.run([recorder])
        tables.append(recorder.table.tobytes())
    assert tables[0] == tables[1]


def test_the_first_warning_of_every_fmu_is_told_once(fmus, caplog):
    text = 'step = 0.125\nstop = 1.0\n[components.a]\nfmu = "worried"\n[components.b]\nfmu = "worried"\n'
    simulate(parse_scenario(text), fmus)
    assert [record.getMessage() for record in caplog.records] == [
        f"component {name!r} at t = 0.5 s: y is 0.625, which worries me" for name in "ab"
    ]


def test_a_step_that_returns_a_warning_without_a_word_is_told_once(fmus, caplog):
    text = 'step = 0.125\nstop = 1.0\n[components.i]\nfmu = "integrator"\ninputs = { u = 1.0 }\n'
    with Simulation(make_plan(parse_scenario(text), fmus)) as simulation:
        instance = simulation.members[0].instance
        instance._do_step = lambda *_: 1 if instance._time.value >= 0.5 else 0
        simulation.run()
    (record,) = caplog.records
    assert record.getMessage() == "component 'i' at t = 0.5 s: its step returned a warning without a message"


@pytest.mark.parametrize(
    ("call", "what"), [("get_them", "reading its outputs"), ("set_them", "setting its inputs or parameters")]
)
def test_other_calls_that_return_a_warning_without_a_word_are_told_once_too(fmus, caplog, call, what):
    text = 'step = 0.125\nstop = 1.0\n[components.a]\nfmu = "clock"\ninputs = { u = 0.0 }\n'
    text += '[components.i]\nfmu = "integrator"\n[[connections]]\nfrom = "a.begin"\nto = "i.u"\n'
    with Simulation(make_plan(parse_scenario(text), fmus)) as simulation:
        member = simulation.members[1]
        for port in (member.outputs, member.sent, member.inputs):
            setattr(port, call, lambda *_: 1)
        simulation.run()
    assert [record.getMessage() for record in caplog.records] == [
        f"component 'i' at t = 0 s: {what} returned a warning without a message"
    ]


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
def test_the_last_point_and_the_ends_of_windows_are_recorded_with_all_variables(fmus, master):
    text = (
        f'step = 0.125\nstop = 2.875\nmaster = "{master}"\n[components.d]\nfmu = "detector"\n[components.c]\nfmu = "clock"\n'
        "inputs = { u = 0.0 }\n[record]\nevery = 7\n"
    )
    data = simulate(parse_scenario(text), fmus)
    assert (data["time"].values / 0.125).tolist() == [0, 5, 7, 10, 14, 15, 20, 21, 23]
    for name in ("c.end", "d.now"):
        assert data[name].values.tolist() == data["time"].values.tolist()
