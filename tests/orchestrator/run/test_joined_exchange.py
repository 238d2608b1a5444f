"""FMUs for model exchange that feed each other are integrated as one system."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from gossamer_orchestrator import Simulation, SimulationError, make_plan, parse_scenario, run_scenario
from gossamer_orchestrator.run.position import COMPONENT
from scipy.integrate import solve_ivp

K, C = 1.0, 0.5  # stiffness of the own spring and of the coupling
VERSIONS = pytest.mark.parametrize("fmi", [(2, 2), (3, 3), (2, 3)])
BOTH = ("a.y -> b.u", "b.y -> a.u")


@pytest.fixture(autouse=True)
def _all_that_is_said(caplog):
    caplog.set_level(logging.WARNING)


def springs(fmi=(2, 2), step=0.01, stop=20.0, *, D=0.0, L=1.0, wires=BOTH, keys="", own="", top="", more=""):
    """Two masses on springs, of which the first is drawn to ``L``.

    ``keys`` stand in every connection, ``own`` in the first component, ``top`` and ``more`` at both ends of the scenario.
    """
    fed = {wire.split(" -> ")[1] for wire in wires}
    text = f"{top}\nstep = {step}\nstop = {stop}\n"
    for name, version, place in (("a", fmi[0], L), ("b", fmi[1], 0.0)):
        free = ", ".join(f"{v} = 0" for v in ("u", "stiff") if f"{name}.{v}" not in fed)
        text += f'[components.{name}]\nfmu = "Spring{version}"\n{own if name == "a" else ""}\ninputs = {{ {free} }}\n'
        text += f"parameters = {{ k = {K}, c = {C}, D = {D}, L = {place} }}\n"
    for wire in wires:
        sender, receiver = wire.split(" -> ")
        text += f'[[connections]]\nfrom = "{sender}"\nto = "{receiver}"\n{keys}\n'
    return parse_scenario(f"{text}[record]\nvariables = ['a.x', 'b.x', 'a.y', 'b.y', 'a.side']\n{more}")


@VERSIONS
@pytest.mark.parametrize("step", [0.01, 0.1])
def test_two_masses_follow_their_closed_form_whatever_the_step(exchange_fmus, caplog, fmi, step):
    """Sum and difference of the places are oscillators of their own."""
    data = run_scenario(springs(fmi, step), exchange_fmus)
    t = data.time.values
    total = 1.0 - np.cos(np.sqrt(K) * t)
    difference = K / (K + 2.0 * C) * (1.0 - np.cos(np.sqrt(K + 2.0 * C) * t))
    assert data["a.x"].values == pytest.approx(0.5 * (total + difference), abs=2e-5)
    assert data["b.x"].values == pytest.approx(0.5 * (total - difference), abs=2e-5)
    assert "for model exchange" not in caplog.text


def reference(D, stop, times, stiff=lambda x: 1.0, event=None):
    """Places of both masses by another solver; the loop of both outputs is solved as the linear system that it is."""
    M = np.array([[1.0, D], [D, 1.0]]) / (1.0 - D * D)

    def rates(_, z):
        y = M @ z[:2]
        u = y[::-1]
        return [z[2], z[3], -K * (z[0] - 1.0) - C * (z[0] - u[0]), -stiff(z[0]) * K * z[1] - C * (z[1] - u[1])]

    found = solve_ivp(rates, (0.0, stop), np.zeros(4), "DOP853", times, events=event, rtol=1e-10, atol=1e-12, max_step=0.02)
    return found.y[0], found.y[1], (M @ found.y[:2])


@pytest.mark.parametrize("D", [0.5, 3.0])  # repetition alone converges for the first only
@VERSIONS
def test_a_loop_through_direct_feedthrough_is_solved_wherever_it_is_evaluated(exchange_fmus, fmi, D):
    data = run_scenario(springs(fmi, D=D, stop=5.0), exchange_fmus)
    a, b, y = reference(D, 5.0, data.time.values)
    assert data["a.x"].values == pytest.approx(a, abs=2e-5)
    assert data["b.x"].values == pytest.approx(b, abs=2e-5)
    assert np.array([data["a.y"].values, data["b.y"].values]) == pytest.approx(y, abs=5e-5)


@VERSIONS
def test_an_event_of_one_changes_the_equations_of_the_other_when_it_happens(exchange_fmus, fmi):
    """The second spring is four times as stiff while the first mass is beyond 0.5."""
    data = run_scenario(springs(fmi, 0.1, 6.0, wires=(*BOTH, "a.side -> b.stiff")), exchange_fmus)
    sharp = reference(0.0, 6.0, data.time.values, lambda x: 4.0 if x > 0.5 else 1.0)
    assert data["a.side"].values.tolist() == (data["a.x"].values > 0.5).astype(float).tolist()
    assert 0.0 < data["a.side"].values.mean() < 1.0
    assert data["b.x"].values == pytest.approx(sharp[1], abs=2e-4)


def test_a_chain_is_one_system_too(exchange_fmus, caplog):
    data = run_scenario(springs(wires=("a.y -> b.u",), stop=10.0), exchange_fmus)
    w = K + C
    t = data.time.values
    assert data["a.x"].values == pytest.approx(K / w * (1.0 - np.cos(np.sqrt(w) * t)), abs=2e-5)
    driven = C * K / w * ((1.0 - np.cos(np.sqrt(w) * t)) / w - t * np.sin(np.sqrt(w) * t) / (2.0 * np.sqrt(w)))
    assert data["b.x"].values == pytest.approx(driven, abs=2e-5)
    assert caplog.text == ""


def test_one_that_feeds_itself_is_one_system_with_itself(exchange_fmus, caplog):
    """It holds itself: the coupling has no effect."""
    data = run_scenario(springs(wires=("a.x -> a.u",), stop=10.0), exchange_fmus)
    assert data["a.x"].values == pytest.approx(1.0 - np.cos(np.sqrt(K) * data.time.values), abs=2e-5)
    assert caplog.text == ""


def test_steps_that_are_repeated_twice_give_the_same_bits(exchange_fmus):
    with Simulation(make_plan(springs(wires=(*BOTH, "a.side -> b.stiff"), step=0.1), exchange_fmus)) as simulation:
        ends = []
        for _ in range(5):
            simulation.step()
        tick = simulation.tick
        for member in simulation.members:
            member.instance.save_state(1)
        for _ in range(3):
            for _ in range(15):
                simulation.step()
            ends.append(simulation.values.copy())
            for member in simulation.members:
                member.instance.restore_state(1)
            simulation.tick = tick
    assert ends[1].tolist() == ends[2].tolist()
    assert ends[0] == pytest.approx(ends[1], abs=1e-4)


def test_inputs_from_elsewhere_jump_between_steps(exchange_fmus):
    """The second spring becomes stiffer at 1 s, by an event of the scenario."""
    event = "[[events]]\ntime = 1.0\ncomponent = 'b'\nset = { stiff = 1 }\n"
    data = run_scenario(springs(step=0.1, stop=3.0, more=event), exchange_fmus)
    first = reference(0.0, 1.0, np.array([1.0]))
    assert data["b.x"].values[10] == pytest.approx(first[1][-1], abs=2e-5)
    plain = reference(0.0, 3.0, np.array([3.0]))
    assert abs(data["b.x"].values[-1] - plain[1][-1]) > 1e-3


def test_steps_under_control_are_those_of_the_joined_system(exchange_fmus):
    data = run_scenario(springs(step=0.1, stop=5.0, more="[step_control]\ntolerance = 1e-3\n"), exchange_fmus)
    assert data["a.x"].values == pytest.approx(reference(0.0, 5.0, data.time.values)[0], abs=1e-4)


APART = {
    'master = "jacobi" delays every connection': {"top": 'master = "jacobi"'},
    "a is in a group": {"more": "[[groups]]\ncomponents = ['a', 'b']\n"},
    "a does not take every step": {"own": "every = 2"},
    "a.y -> b.u has 'noise'": {"keys": "noise = { kind = 'normal', amplitude = 0.0 }"},
    "b.y -> a.u has 'dropout'": {"wires": BOTH[::-1], "keys": "dropout = { probability = 0.0 }"},
}


@pytest.mark.parametrize("why", APART)
def test_where_they_are_integrated_one_by_one_a_warning_says_why(exchange_fmus, caplog, why):
    make_plan(springs(**APART[why]), exchange_fmus)
    said = [record.getMessage() for record in caplog.records if "for model exchange" in record.getMessage()]
    assert len(said) == 1
    assert f"a, b are for model exchange and connected, but {why}: each is integrated by itself" in said[0]


@pytest.mark.parametrize("names", ["amb", "mab", "bam"])
def test_one_that_lies_between_two_that_are_joined_is_told_why_it_delays(exchange_fmus, fmus, caplog, names):
    """It is no circle: the first feeds both others, and the one between feeds the last."""
    wires = ["a.y -> b.u", "a.x -> m.u", "m.y -> b.stiff"]
    components = {
        "a": "fmu = 'Spring2'\ninputs = { u = 0, stiff = 0 }",
        "b": "fmu = 'Spring2'",
        "m": f"fmu = '{fmus / 'gain.fmu'}'\ninputs = {{ 'offset[*]' = 0 }}",
    }
    text = "step = 0.1\nstop = 0.1\n" + "".join(f"[components.{name}]\n{components[name]}\n" for name in names)
    for wire in wires:
        text += '[[connections]]\ngain = 1\nfrom = "{}"\nto = "{}"\n'.format(*wire.split(" -> "))
    make_plan(parse_scenario(text), exchange_fmus)
    joined = "b, a" if names == "bam" else "a, b"
    late = "a.x -> m.u" if names == "mab" else "m.y -> b.stiff"
    assert [record.getMessage().split(": ", 1)[1] for record in caplog.records] == [
        f"{joined} step as one, and 'm' lies between them: the connection {late} delays by one step. Choose a smaller 'step'"
    ]


def test_a_loop_of_large_values_is_solved_relative_to_them_though_its_nominal_values_are_1(exchange_fmus):
    """The system is linear: the places are 10^7 times those of a place of 1."""
    own, large = springs(D=3.0, stop=0.3), springs(D=3.0, stop=0.3, L=1e7)
    data = run_scenario(large, exchange_fmus)
    assert data["a.y"].values == pytest.approx(1e7 * run_scenario(own, exchange_fmus)["a.y"].values, abs=1e3)


def test_a_loop_without_a_solution_leaves_them_one_by_one(exchange_fmus, caplog):
    """With D = 1 both outputs are the other one and 1: there are no such numbers."""
    data = run_scenario(springs(D=1.0, stop=0.02, keys="bias = 1.0"), exchange_fmus)
    assert "but the algebraic loop through b.y does not converge at t = 0 s, after" in caplog.text
    assert [float(data[name].values[0]) for name in ("a.y", "b.y")] == [1.0, 2.0]  # from the start value 0 of b.y


def failing(simulation, monkeypatch, status):
    """Let the second spring return a status in place of its outputs, once, while the two are integrated beyond 0.5 s."""
    first = simulation.member("a").instance
    get_them, left = simulation.member("b").sent.get_them, [status]

    def get(*arguments):
        if left and first._reached > 0.5 and not first._in_events:
            return left.pop()
        return get_them(*arguments)

    monkeypatch.setattr(simulation.member("b").sent, "get_them", get)
    return left


def test_outputs_that_are_discarded_between_two_points_cost_smaller_steps(exchange_fmus, monkeypatch):
    with Simulation(make_plan(springs(step=0.1, stop=1.0), exchange_fmus)) as simulation:
        left = failing(simulation, monkeypatch, 2)
        simulation.run()
        assert not left
        place = simulation.store.places["b", "x"]
        assert simulation.values[place] == pytest.approx(reference(0.0, 1.0, np.array([1.0]))[1][-1], abs=2e-5)


def test_the_one_that_fails_is_named_with_the_time_that_was_reached(exchange_fmus, monkeypatch):
    with Simulation(make_plan(springs(step=0.1, stop=1.0), exchange_fmus)) as simulation:
        failing(simulation, monkeypatch, 3)
        with pytest.raises(SimulationError, match=r"component 'b' did not return its outputs at t = 0\.[5-9]"):
            simulation.run()
        assert simulation.position[COMPONENT] == 1


def test_while_one_of_them_is_called_the_position_of_the_run_is_its_own(exchange_fmus, monkeypatch):
    called = []
    with Simulation(make_plan(springs(step=0.1, stop=0.1), exchange_fmus)) as simulation:
        for member in simulation.members:
            slave, number = member.instance._slave, member.number

            def set_time(time, do=slave.setTime, number=number):
                called.append(number == simulation.position[COMPONENT])
                return do(time)

            monkeypatch.setattr(slave, "setTime", set_time)
        simulation.run()
    assert called
    assert all(called)


def test_the_one_whose_events_do_not_end_is_named(exchange_fmus, monkeypatch):
    monkeypatch.setattr("gossamer_orchestrator.fmi.instances.MAX_EVENTS", 3)
    text = 'step = 1.0\nstop = 1.0\n[components]\na = { fmu = "Sampler2", inputs = { u = 0.0 } }\n'
    text += 'b = { fmu = "Spring2", inputs = { stiff = 0 } }\n[[connections]]\nfrom = "a.x"\nto = "b.u"\n'
    message = r"component 'a' has had 3 events between t = 0 and 0\.3 s, and more to come"
    with (
        Simulation(make_plan(parse_scenario(text), exchange_fmus)) as simulation,
        pytest.raises(SimulationError, match=message),
    ):
        simulation.run()
