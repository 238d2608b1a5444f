"""A run says what each of its components took, by name."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest
from coupled import build
from gossamer_orchestrator import parse_scenario, run_scenario
from gossamer_orchestrator.results.dataset import effort_of
from gossamer_orchestrator.results.report import write_report

TWO = """
step = 0.1
stop = 1.0
[components.slow]
fmu = "hostile"
parameters = { pause = 0.03 }
inputs = { u = 0.0 }
[components.fast]
fmu = "hostile"
inputs = { u = 0.0 }
"""


def test_the_time_of_a_component_is_that_in_which_it_was_called(hostile, tmp_path, caplog):
    with caplog.at_level("INFO"):
        data = run_scenario(parse_scenario(TWO), hostile, tmp_path)
    effort = effort_of(data)
    assert list(effort) == ["slow", "fast"]
    assert effort["slow"]["seconds"] > 0.2  # it sleeps for 0.3 s
    assert effort["slow"]["seconds"] > effort["fast"]["seconds"]
    assert f"slow: {effort['slow']['seconds']:.2f} s, 0 steps refused, 0 states restored" in caplog.text
    write_report(data, tmp_path)
    assert "<th>steps refused</th>" in (tmp_path / "report.html").read_text().replace(' scope="col"', "")


def test_steps_that_it_refused_and_states_that_were_restored_are_counted(tmp_path):
    """It refuses whole steps, and takes halves: all are restored once for each of the ten steps."""
    build("gain", tmp_path)
    build("mass", tmp_path)
    text = (
        'step = 0.1\nstop = 1.0\n[components.a]\nfmu = "mass"\nparameters = { longest = 0.06 }\ninputs = { u = 1.0 }\n'
        '[components.b]\nfmu = "gain"\nparameters = { "A[*]" = 1.0 }\ninputs = { "u[*]" = 1.0, "b[*]" = 0.0 }\n'
    )
    data = run_scenario(parse_scenario(text), tmp_path)
    counts = {name: (each["refused"], each["restored"]) for name, each in effort_of(data).items()}
    assert counts == {"a": (10, 10), "b": (0, 10)}


def test_a_run_does_not_wait_for_the_lock_that_it_has_itself(hostile, tmp_path, monkeypatch):
    waits = SimpleNamespace(sleep=lambda _: pytest.fail("it waits"), time=time.time)
    monkeypatch.setattr("gossamer_files.time", waits)
    for _ in range(2):
        run_scenario(parse_scenario(TWO.replace("stop = 1.0", "stop = 0.2")), hostile, tmp_path)
