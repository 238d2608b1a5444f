"""What a scenario states of an FMU is what that computes with, or the run says that it is not."""

from __future__ import annotations

import pytest
from gossamer_orchestrator import parse_scenario, run_scenario
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


def test_a_value_that_an_fmu_does_not_take_is_said_with_what_it_has_instead(tmp_path, caplog):
    build(tmp_path / "odd.fmu", entry=OVERWRITES, exit=OVERWRITES)
    data = run_scenario(parse_scenario(STATED), tmp_path)
    assert data["a.p"].values.tolist() == [0.01] * 3
    (record,) = caplog.records
    assert record.getMessage() == (
        "component 'a' does not keep what the scenario states: u = 0.0 in place of 69.0, p = 0.01 in place of 0.005. "
        "It computes with its own; check it with 'gossamer verify'"
    )
