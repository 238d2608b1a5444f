"""FMUs for model exchange are integrated from step to step, with their events, and can go back."""

from __future__ import annotations

import numpy as np
import pytest
from gossamer_orchestrator import ScenarioError, Simulation, build_container, make_plan, parse_scenario, run_scenario
from scipy.integrate import solve_ivp

VERSIONS = pytest.mark.parametrize("fmi", [2, 3])


def alone(name, step, stop, more=""):
    return parse_scenario(f'step = {step}\nstop = {stop}\n[components.a]\nfmu = "{name}"\n{more}')


@VERSIONS
def test_a_decay_follows_its_closed_form_whatever_the_step(exchange_fmus, fmi):
    for step in (0.1, 1.0):
        data = run_scenario(alone(f"Dahlquist{fmi}", step, 10.0), exchange_fmus)
        assert data["a.x"].values == pytest.approx(np.exp(-data.time.values), abs=1e-5)


@VERSIONS
def test_a_limit_cycle_follows_another_solver(exchange_fmus, fmi):
    data = run_scenario(alone(f"VanDerPol{fmi}", 0.01, 20.0), exchange_fmus)
    exact = solve_ivp(
        lambda _, x: [x[1], (1.0 - x[0] ** 2) * x[1] - x[0]], (0.0, 20.0), [2.0, 0.0], "DOP853", rtol=1e-10, atol=1e-10
    )
    assert data["a.x0"].values[-1] == pytest.approx(exact.y[0, -1], abs=3e-4)


@VERSIONS
def test_a_ball_bounces_when_and_as_high_as_it_must(exchange_fmus, fmi):
    data = run_scenario(alone(f"BouncingBall{fmi}", 0.01, 3.0), exchange_fmus)
    h, t, g, e = data["a.h"].values, data.time.values, 9.81, 0.7
    first = np.sqrt(2.0 / g)
    second = first + 2.0 * e * first
    peak = (t > first) & (t < second)
    assert h[peak] == pytest.approx(e * g * first * (t[peak] - first) - 0.5 * g * (t[peak] - first) ** 2, abs=1e-5)
    assert (h > -1e-9).all()
    assert h[-1] == pytest.approx(0.0, abs=1e-9)


@VERSIONS
def test_events_at_known_times_happen_and_end_the_run(exchange_fmus, fmi):
    data = run_scenario(alone(f"Stair{fmi}", 0.2, 10.0), exchange_fmus)
    t = data.time.values
    assert data["a.counter"].values[:-1].tolist() == np.floor(t[:-1] + 1.0 + 1e-9).tolist()
    assert data["a.counter"].values[-1] == 10
    assert data.attrs["ended"] == "component 'a' ended the simulation at t = 9 s"


def test_a_coarse_step_misses_no_event_between_two_points(exchange_fmus):
    fine = run_scenario(alone("BouncingBall2", 0.01, 2.0), exchange_fmus)
    coarse = run_scenario(alone("BouncingBall2", 0.5, 2.0), exchange_fmus)
    assert coarse["a.h"].values == pytest.approx(fine["a.h"].values[::50], abs=1e-5)


@VERSIONS
def test_inputs_of_all_types_arrive_and_change_in_events(exchange_fmus, fmi):
    inputs = "'Float*_input' = 1.5, '*Int*_input' = 2, Enumeration_input = 1, String_input = 'a', Boolean_input = true"
    more = ", Binary_input = '00'" if fmi == 3 else ""
    event = "time = 0.2\ncomponent = 'a'\nset = { Int32_input = 7, Float64_continuous_input = 2.5 }"
    text = f"inputs = {{ {inputs}{more} }}\n[[events]]\n{event}\n"
    data = run_scenario(alone(f"Feedthrough{fmi}", 0.1, 0.4, text), exchange_fmus)
    assert data["a.Int32_output"].values.tolist() == [2, 2, 2, 7, 7]
    assert data["a.Float64_continuous_output"].values.tolist() == [1.5, 1.5, 1.5, 2.5, 2.5]
    assert data["a.Boolean_output"].values.tolist() == [1] * 5


@VERSIONS
def test_steps_that_are_repeated_twice_give_the_same_bits(exchange_fmus, fmi):
    with Simulation(make_plan(alone(f"BouncingBall{fmi}", 0.1, 2.0), exchange_fmus)) as simulation:
        (member,) = simulation.members
        ends = []
        for _ in range(5):
            simulation.step()
        for _ in range(3):
            member.instance.save_state(1)
            tick = simulation.tick
            for _ in range(10):
                simulation.step()
            ends.append(simulation.values.copy())
            member.instance.restore_state(1)
            simulation.tick = tick
    assert ends[1].tolist() == ends[2].tolist()
    assert ends[0] == pytest.approx(ends[1], abs=1e-4)


@pytest.mark.parametrize("step", [0.01, 0.05, 0.1, 1.0])
def test_events_within_rounding_of_a_communication_point_happen_once(exchange_fmus, step):
    data = run_scenario(alone("Sampler2", step, 1.0, "inputs = { u = 0.0 }\n"), exchange_fmus)
    t = data.time.values
    assert data["a.x"].values == pytest.approx(t, abs=1e-12)
    between = abs(10.0 * t - np.round(10.0 * t)) > 1e-6  # at the points themselves rounding decides which was first
    assert data["a.y"].values[between] == pytest.approx(np.floor(10.0 * t[between]) / 10.0, abs=1e-12)


@pytest.mark.parametrize("step", [0.05, 0.1])
def test_a_state_that_jumps_within_rounding_before_a_communication_point_keeps_its_jump(exchange_fmus, step):
    """x falls by 10 every 0.1 s, at times that are summed up: some are the last floats before the end of a step."""
    text = "inputs = { u = 0.0 }\nparameters = { drop = 10.0 }\n"
    data = run_scenario(alone("Sampler2", step, 1.0, text), exchange_fmus)
    t = data.time.values
    jumps = (t - data["a.x"].values) / 10.0
    assert jumps == pytest.approx(np.round(jumps), abs=1e-9)
    due = np.floor(10.0 * t + 1e-6)  # at the points themselves rounding decides which was first
    between = abs(10.0 * t - np.round(10.0 * t)) > 1e-6
    assert np.round(jumps)[between].tolist() == due[between].tolist()
    assert np.isin(due - np.round(jumps), [0.0, 1.0]).all()


@pytest.mark.parametrize("step", [0.1, 10.0])
def test_a_step_event_happens_after_the_step_that_asks_for_it(exchange_fmus, step):
    """The integrator takes steps of at most 0.1 s, so x falls before it is above 1.6; it needs a second and a half again."""
    data = run_scenario(alone("Sampler2", step, 10.0, "inputs = { u = 0.0 }\n"), exchange_fmus)
    assert data["a.x"].values.max() <= 1.6 + 1e-9
    assert 0.0 <= data["a.x"].values[-1] <= 1.6


def test_an_input_that_makes_the_fmu_end_the_simulation_ends_the_run_in_peace(exchange_fmus):
    text = (
        'step = 0.1\nstop = 10.0\n[components]\na = { fmu = "Sampler2", inputs = { u = 0.0 } }\nb = { fmu = "Sampler2" }\n'
        "[[connections]]\nfrom = 'a.x'\nto = 'b.u'\ngain = 9.0\n"
    )
    data = run_scenario(parse_scenario(text), exchange_fmus)
    assert (
        data.attrs["ended"] == "component 'b' ended the simulation at t = 0.6 s"
    )  # u passes 5 at 0.556 s; then its next event


@pytest.mark.parametrize(
    "more", ["every = 2\n", "[step_control]\ntolerance = 1e-4\n", "[[groups]]\ncomponents = ['a', 'b']\n"]
)
def test_model_exchange_takes_part_in_everything_that_steps(exchange_fmus, more):
    text = 'step = 0.1\nstop = 1.0\n[components.b]\nfmu = "Sampler2"\n[components.a]\nfmu = "Dahlquist3"\n'
    text += more if more.startswith("every") else ""
    text += "[[connections]]\nfrom = 'a.x'\nto = 'b.u'\n" + ("" if more.startswith("every") else more)
    data = run_scenario(parse_scenario(text), exchange_fmus)
    assert data["a.x"].values[-1] == pytest.approx(np.exp(-1.0), abs=1e-5)
    assert data["b.x"].values[-1] == pytest.approx(1.0, abs=1e-9)


def test_what_needs_co_simulation_says_so(exchange_fmus, tmp_path):
    with pytest.raises(ScenarioError, match="is for model exchange, which a container does not integrate"):
        build_container(alone("Dahlquist2", 0.1, 1.0), exchange_fmus, tmp_path / "one.fmu")
    run_scenario(alone("Dahlquist2", 0.1, 1.0), exchange_fmus, tmp_path / "run")
    (tmp_path / "run/unfinished.npz").touch()
    with pytest.raises(ScenarioError, match="Dahlquist2 cannot serialize its state"):
        run_scenario(alone("Dahlquist2", 0.1, 1.0), exchange_fmus, tmp_path / "run", resume=True)
