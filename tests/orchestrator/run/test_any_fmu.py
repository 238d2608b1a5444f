"""Our own chain as FMI 3.0, FMUs that break rules, and the choice of a master."""

from __future__ import annotations

import re

import pytest
from gossamer_orchestrator import (
    FmuError,
    FmuFile,
    Recorder,
    ScenarioError,
    Simulation,
    load_scenario,
    make_plan,
    parse_scenario,
    run_scenario,
)
from gossamer_orchestrator.scenario.source import shipped_scenarios


def recorded(folder, text):
    plan = make_plan(text, folder)
    recorder = Recorder(plan)
    with Simulation(plan) as simulation:
        simulation.run([recorder])
    return plan.columns, recorder.table


def test_the_chain_as_fmi_3_gives_the_numbers_of_fmi_2_to_the_bit(built):
    scenario = load_scenario(shipped_scenarios()["damaged"], stop=0.03)
    columns, table = recorded(built("native")["sensor"].parent, scenario)
    columns3, table3 = recorded(built("native FMI 3")["sensor"].parent, scenario)
    assert columns3 == columns
    assert table3.tobytes() == table.tobytes()


UNDEFINED = 'step = 0.1\nstop = 0.2\n[components.a]\nfmu = "odd"\ninputs = { "*" = 1.0 }\n'


def test_what_breaks_the_rules_is_a_warning_and_with_strict_an_error(edited, tmp_path, caplog):
    edited("gain", "odd", lambda xml: xml.replace("<Real", '<Real unit="lbf"', 1))
    finding = (
        r"scenario:4: FMU 'odd' is against the rules of FMI: The unit \"lbf\" of variable \"factor\" .* is not defined."
    )
    with pytest.raises(ScenarioError, match=finding):
        make_plan(parse_scenario(UNDEFINED), tmp_path, strict=True)
    data = run_scenario(parse_scenario(UNDEFINED), tmp_path)
    assert data["a.y"].values[-1] == 3.0
    assert "FMU 'odd' is against the rules of FMI" in caplog.text


def test_the_master_of_a_file_can_be_replaced(chain, fmus):
    """Under Jacobi the integrator sees the source one step late, which changes nothing but the first sum of an event."""
    event = '[[events]]\ntime = 0.5\ncomponent = "source"\nset = { u = 7.0 }\n'
    seidel = run_scenario(chain(more=event), fmus)
    jacobi = run_scenario(chain(more=event), fmus, master="jacobi")
    assert seidel["integral.y"].values[-1] - jacobi["integral.y"].values[-1] == pytest.approx(0.5)
    assert jacobi.attrs["master"] == "jacobi"


def test_a_master_that_there_is_not_is_refused(chain, fmus):
    with pytest.raises(ScenarioError, match=r"there is no master 'Jacobi'\. Choose gauss-seidel or jacobi"):
        run_scenario(chain(), fmus, master="Jacobi")


GROUP = '[[groups]]\ncomponents = ["source", "integral"]\n'


@pytest.mark.parametrize("event", ["", '[[events]]\ntime = 0.5\ncomponent = "source"\nset = { u = 7.0 }\n'])
def test_a_group_without_a_feedback_gives_the_same_numbers_as_no_group(chain, fmus, event):
    _, alone = recorded(fmus, chain(more=event))
    _, grouped = recorded(fmus, chain(more=event + GROUP))
    assert grouped.tobytes() == alone.tobytes()


INVERTERS = """
step = 0.1
stop = 0.2
[components]
a = {{ fmu = "inverter" }}
{more}
[[connections]]
from = "{last}.y"
to = "a.u"
[[groups]]
components = {names}
"""


def test_truth_values_that_agree_converge_and_those_that_cannot_are_said(fmus, caplog):
    """Of two inverters in a ring one is on; an inverter that feeds itself is never in agreement."""
    ring = '\nb = { fmu = "inverter" }\n[[connections]]\nfrom = "a.y"\nto = "b.u"'
    columns, table = recorded(fmus, parse_scenario(INVERTERS.format(more=ring, last="b", names='["a", "b"]')))
    assert caplog.text == ""
    assert columns == (("a", "y"), ("b", "y"))
    assert table.tolist()[1:] == [[1.0, 0.0], [1.0, 0.0]]
    recorded(fmus, parse_scenario(INVERTERS.format(more="", last="a", names='["a"]')))
    assert "the group a does not converge in the step from t = 0 s: after 20 sweeps a.y still changes." in caplog.text


def test_a_start_value_of_another_type_is_named(edited, tmp_path):
    edited("gain", "odd", lambda xml: re.sub(r'(name="factor"[^>]*>\s*<Real[^>]*start=")[^"]*', r"\1much", xml))
    with pytest.raises(FmuError, match="the start value 'much' of 'factor' is no Real"):
        FmuFile(tmp_path / "odd.fmu")


def test_an_event_at_the_end_of_a_run_is_said_to_change_nothing(fmus, caplog):
    text = "step = 0.5\nstop = 1.0\n[components.a]\nfmu = 'integrator'\ninputs = { u = 1.0 }\n"
    make_plan(parse_scenario(f"{text}[[events]]\ntime = 1.0\ncomponent = 'a'\nset = {{ u = 2.0 }}\n"), fmus)
    assert "the event is at the end of the run, so it changes nothing" in caplog.text
