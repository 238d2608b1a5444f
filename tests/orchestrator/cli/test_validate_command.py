"""``gossamer validate`` refuses what a run refuses before its first step, in the same words, and runs nothing."""

from __future__ import annotations

import json

import pytest
from command_line import invoke
from gossamer_files.options import DASHES, STYLE
from gossamer_orchestrator import ScenarioError, make_plan, parse_scenario
from gossamer_orchestrator.scenario.source import shipped_scenarios

SCENARIO = """\
step = 0.1
stop = 1.0
[components.p]
fmu = "pascal"
inputs = { u = 1.0, "offset[*]" = 0.0 }
[components.k]
fmu = "kilo"
inputs = { "offset[*]" = 0.0 }
[[connections]]
from = "p.y"
to = "k.u"
"""
MISTAKES = {
    "syntax": ("step = 0.1", "step = "),
    "step size": ("stop = 1.0", "stop = 1.05"),
    "name of an FMU": ('"kilo"', '"klo"'),
    "name of an input": ("{ u = 1.0,", "{ v = 1.0,"),
    "missing connection": ('[[connections]]\nfrom = "p.y"\nto = "k.u"\n', ""),
    "unit": ('fmu = "kilo"', 'fmu = "metre"'),
    "record": ("stop = 1.0", 'stop = 1.0\n[record]\nvariables = ["q.*"]'),
}


@pytest.fixture
def call(fmus, tmp_path):
    def called(command, text, *options):
        path = tmp_path / "s.toml"
        path.write_text(text)
        arguments = [command, str(path), "--fmus", str(fmus), *options]
        return invoke(arguments + (["--out", str(tmp_path / "out")] if command == "run" else []))

    return called


def test_a_right_scenario_shows_components_and_converted_units_and_leaves_nothing(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = call("validate", SCENARIO)
    assert result.exit_code == 0, result.stderr
    assert "The scenario can run: 2 components, 1 connection, steps of 0.1 s from 0 to 1 s" in result.stderr
    found = json.loads(call("validate", SCENARIO, "--json").stdout)
    assert [each["component"] for each in found["components"]] == ["p", "k"]
    (wired,) = found["connections"]
    assert (wired["from_unit"], wired["to_unit"], wired["gain"]) == ("Pa", "kPa", pytest.approx(1e-3))
    assert (found["points"], found["variables"], found["scalars"]) == (11, 5, 7)
    assert "5 variables (7 scalars) are recorded at 11 points." in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_refused_in_the_words_of_the_plan_of_a_run(call, fmus, mistake, monkeypatch):
    text = SCENARIO.replace(*MISTAKES[mistake])
    assert text != SCENARIO
    checked = call("validate", text)
    monkeypatch.setenv(STYLE, DASHES)
    with pytest.raises(ScenarioError) as planned:
        make_plan(parse_scenario(text, name="s.toml"), fmus)
    assert (checked.exit_code, checked.stderr) == (1, f"{planned.value}\n")


def test_a_run_refuses_in_the_same_words(call):
    text = SCENARIO.replace(*MISTAKES["unit"])
    assert call("run", text, "--no-pictures").stderr == call("validate", text).stderr


def test_a_warning_of_a_run_is_a_warning_here(call):
    text = SCENARIO + '[[events]]\ntime = 1.0\ncomponent = "p"\nset = { u = 2.0 }\n'
    result = call("validate", text, "--json")
    (warning,) = json.loads(result.stdout)["warnings"]
    assert "the event is at the end of the run" in warning
    assert "the event is at the end of the run" in result.stderr


def test_options_replace_values_as_those_of_a_run(call):
    assert json.loads(call("validate", SCENARIO, "--step", "0.2", "--json").stdout)["points"] == 6
    assert "no component 'q'" in call("validate", SCENARIO, "--set", "q.u=1").stderr


@pytest.mark.parametrize("name", ["damaged", "damage_begins", "in_service"])
def test_shipped_scenarios_can_run(built, name):
    assert name in shipped_scenarios()
    folder = built("native")["sensor"].parent
    result = invoke(["validate", name, "--fmus", str(folder), "--strict"])
    assert result.exit_code == 0, result.stderr
