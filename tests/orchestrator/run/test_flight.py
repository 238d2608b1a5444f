"""A hub that carries the membrane, through the master: what it keeps, and connections that are meant to delay."""

from __future__ import annotations

import logging

import flight
import numpy as np
import pytest
from gossamer_orchestrator import ScenarioError, make_plan, parse_scenario, run_scenario
from gossamer_orchestrator.errors import SimulationError
from gossamer_orchestrator.scenario.source import shipped_scenarios

FORCE = '{ from = "membrane.force", to = "hub.force", delayed = true }'


@pytest.fixture
def folder(built):
    return built("native")["hub"].parent


def text_of(name):
    return shipped_scenarios()[name].read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("hub", "warned"),
    [
        ({}, []),
        ({"hub.mass": 6.0, "hub.inertia[1]": 0.5, "hub.inertia[2]": 0.5, "hub.inertia[3]": 0.8}, ["1.36 kg, 3.6 times"]),
    ],
    ids=["120 kg", "6 kg"],
)
def test_a_slew_and_a_thrust_conserve_momentum(hub, warned, folder, caplog):
    """Asked: 1e-4 of the membrane's peak, with what is on its way; then the thruster's impulse is added.

    One warning where the hub is light at the mount, 1 / (1/m + l^2/J): the energy, not the momentum, suffers.
    """
    quiet = {"membrane.mass_damping": 0.0} | hub
    with caplog.at_level(logging.WARNING):
        data = run_scenario(parse_scenario(text_of("flight")), folder, values=quiet)
    assert [text in record.getMessage() for text, record in zip(warned, caplog.records, strict=True)] == [True] * len(warned)
    balance = flight.balance(data, 3e-4)
    time = data["time"].to_numpy()
    before = int(np.searchsorted(time, 0.6 - 1e-9)) + 1
    change = flight.Balance(balance.P[:before], balance.L[:before], balance.peak_P, balance.peak_L).change(1)
    assert max(change) < 1e-4
    attitudes = [flight.matrix(q)[:, 2] for q in flight.column(data, "hub.attitude")]
    fired = np.flatnonzero((time > 0.6 + 1e-9) & (time < 0.7 + 3e-4))  # on at the first points not before 0.6 and 0.7 s
    thrust = [3e-4 * 100.0 * (attitudes[k] + attitudes[k - 1]) / 2.0 for k in fired]
    gained = balance.P[-1] - balance.P[before - 1]
    np.testing.assert_allclose(gained, np.sum(thrust, axis=0), atol=1e-4 * balance.peak_P)


def test_the_sail_rings_and_the_attitude_feels_it(folder):
    """Against a hub with the same membrane held still: a rigid body of the whole mass."""
    data = run_scenario(parse_scenario(text_of("flight")), folder)
    turning = flight.column(data, "hub.angular_velocity")[:, 1]
    slew = data["time"].to_numpy() > 0.1
    assert np.abs(turning[~slew]).max() > 1e-4  # before the wheels turn
    assert np.abs(turning[slew]).max() > 0.03
    assert np.ptp(data["membrane.deflection"].to_numpy()[-300:]) > 0.02
    assert flight.column(data, "membrane.strain").std(axis=0).min() > 1e-4


def test_a_hub_that_is_lighter_than_its_membrane_is_stable_in_a_group(folder, caplog):
    with caplog.at_level(logging.WARNING):
        data = run_scenario(parse_scenario(text_of("light_hub")), folder)
    assert not caplog.records  # it converges in every step
    balance = flight.balance(data, 3e-4, extrapolated=False)
    assert max(balance.change(1)) < 1e-4
    swing = np.abs(flight.column(data, "hub.acceleration")[:, 2])
    assert swing[-300:].max() < 2.0 * swing[100:400].max()


def test_the_same_hub_without_a_group_is_not(folder):
    """So the test above tests the iteration: the extrapolated force runs out of every range within 0.3 s."""
    text = text_of("light_hub").replace('[[groups]]\ncomponents = ["hub", "membrane"]\ntolerance = 1e-5\n', "")
    for of in ("force", "torque", "held_mass", "held_first_moment", "held_inertia"):
        to = of.replace("held", "attached")
        text = text.replace(f'"membrane.{of}", to = "hub.{to}"', f'"membrane.{of}", to = "hub.{to}", delayed = true')
    with pytest.raises(SimulationError, match=r"hub|membrane"):
        run_scenario(parse_scenario(text), folder, values={"hub.extrapolation": 1.0})


def test_a_connection_that_is_meant_to_delay_is_refused_where_it_does_not(folder):
    wrong = text_of("flight").replace(
        '"hub.acceleration", to = "membrane.frame_acceleration"',
        '"hub.acceleration", to = "membrane.frame_acceleration", delayed = true',
    )
    stated = wrong.replace("step = 3e-4 # [s]\n", 'step = 3e-4 # [s]\norder = ["hub", "membrane"]\n')
    with pytest.raises(ScenarioError, match="'hub' steps before 'membrane'"):
        make_plan(parse_scenario(stated), folder)
    grouped = text_of("flight").replace(
        "[components.hub]", '[[groups]]\ncomponents = ["hub", "membrane"]\n\n[components.hub]'
    )
    with pytest.raises(ScenarioError, match="in a group, where nothing delays"):
        make_plan(parse_scenario(grouped), folder)


def test_without_the_word_the_delay_is_a_warning(folder, caplog):
    loud = text_of("flight").replace(FORCE, FORCE.replace(", delayed = true", ""))
    with caplog.at_level(logging.WARNING):
        make_plan(parse_scenario(loud), folder)
    assert "membrane.force[1] -> hub.force[1] delays by one step" in caplog.text
