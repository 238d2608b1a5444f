"""What a scenario states of an FMU is what that computes with, or the run says that it is not."""

from __future__ import annotations

import pytest
from gossamer_orchestrator import SimulationError, parse_scenario, run_scenario
from odd import build

STATED = """
step = 0.1
stop = 0.2
[components.a]
fmu = "odd"
parameters = { p = 0.005 }
inputs = { u = 69.0 }
[record]
variables = ["a.*"]
"""
OVERWRITES = "if (one->value[2] != 0.0) { one->value[2] = 0.01; one->value[0] = 0.0; }"


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
def test_values_that_an_fmu_overwrites_when_it_enters_initialization_are_set_again(tmp_path, caplog, master):
    build(tmp_path / "odd.fmu", entry=OVERWRITES)
    data = run_scenario(parse_scenario(STATED), tmp_path, master=master)
    assert data["a.p"].values.tolist() == [0.005] * 3
    assert data["a.y"].values.tolist() == [0.0, 69.0, 69.0]
    assert caplog.text == ""


def test_an_fmu_that_fails_when_it_is_read_back_ends_the_run_and_one_that_declines_does_not(tmp_path):
    for status in ("fmi2Error", "fmi2Discard"):
        build(tmp_path / "odd.fmu", reading=f"for (size_t i = 0; i < n; i++) if (r[i] == 2) return {status};")
        scenario = parse_scenario(STATED.replace('"a.*"', '"a.y"'))
        if status == "fmi2Error":
            with pytest.raises(SimulationError, match="component 'a' did not return 'p', which the scenario states"):
                run_scenario(scenario, tmp_path)
        else:
            assert run_scenario(scenario, tmp_path)["a.y"].values[-1] == 69.0


def test_a_value_that_an_fmu_does_not_take_is_said_with_what_it_has_instead(tmp_path, caplog):
    build(tmp_path / "odd.fmu", entry=OVERWRITES, exit=OVERWRITES)
    data = run_scenario(parse_scenario(STATED), tmp_path)
    assert data["a.p"].values.tolist() == [0.01] * 3
    (record,) = caplog.records
    assert record.getMessage() == (
        "component 'a' does not keep what the scenario states: u = 0.0 in place of 69.0, p = 0.01 in place of 0.005. "
        "It computes with its own; check it with 'gossamer verify'"
    )
