"""Values of the command line replace those of a scenario."""

from __future__ import annotations

import pytest
from command_line import invoke
from gossamer_orchestrator import ScenarioError, load_results, make_plan, parse_scenario, run_scenario
from gossamer_orchestrator.names import suggest
from gossamer_orchestrator.scenario.values import changed, read_changes

TEXT = """
step = 0.1
stop = 0.3
[components.one]
fmu = "gain"
parameters = { factor = 2.0 }
inputs = { u = 1.0, "offset[1]" = 5.0, "offset[*]" = 0.0 }
[components.two]
fmu = "gain"
inputs = { u = 1.0, "offset[*]" = 0.0 }
[[connections]]
from = "one.y"
to = "two.u"
noise = { kind = "normal", amplitude = 0.1 }
"""
SCENARIO = TEXT.replace('two]\nfmu = "gain"\ninputs = { u = 1.0, ', 'two]\nfmu = "gain"\ninputs = { ')


def values(fmus, *texts):
    """Return what the components start with."""
    plan = make_plan(changed(parse_scenario(SCENARIO), read_changes(texts), fmus), fmus)
    return {f"{component.name}.{v}": value for component in plan.components for v, value in component.start.items()}


def test_a_value_beats_every_one_of_the_file(fmus):
    start = values(fmus, "one.factor=3", "one.offset[1] = 7.5", "one.u=-1")
    assert (start["one.factor"], start["one.offset[1]"], start["one.offset[2]"], start["one.u"]) == (3.0, 7.5, 0.0, -1.0)


def test_a_pattern_sets_several_components_and_elements(fmus):
    start = values(fmus, "*.factor=4", "one.offset[*]=1")
    assert (start["one.factor"], start["two.factor"], start["one.offset[1]"], start["two.offset[1]"]) == (4.0, 4.0, 1.0, 0.0)


def test_an_array_is_set_as_a_whole_and_a_later_value_beats_an_earlier_one(fmus):
    start = values(fmus, "one.offset=[1, 2]", "one.offset[2]=9")
    assert (start["one.offset[1]"], start["one.offset[2]"]) == (1.0, 9.0)


def test_the_title_says_which_values_are_not_those_of_the_file(fmus):
    scenario = parse_scenario(f'title = "Twice"\n{SCENARIO.lstrip()}', name="twice.toml")
    assert changed(scenario, {"one.factor": 3.0}, fmus).title == "twice, with one.factor = 3"
    many = {"seed": 3, "one.factor": 3.0, "one.offset": [k / 3.0 for k in range(99)]}
    assert len(changed(scenario, many, fmus).title) <= 100
    assert changed(scenario, many, fmus).title.startswith("twice, with one.factor = 3, one.offset = [0.0, 0.33")
    assert changed(scenario, {"seed": 3}, fmus).title == "Twice"
    assert changed(parse_scenario(SCENARIO), {"one.factor": 3.0}, fmus).title == ""


def test_another_seed_gives_other_noise(fmus):
    runs = [
        run_scenario(parse_scenario(SCENARIO), fmus, values={"seed": seed})["two.y"].values.tolist() for seed in (0, 1, 1)
    ]
    assert runs[0] != runs[1] == runs[2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("one.factr=1", "has no parameter and no input 'factr'. Did you mean 'factor'?"),
        ("oen.factor=1", "there is no component 'oen'. Did you mean 'one'?"),
        ("factor=1", "'factor' is no component.variable"),
        ("stop=1", "'stop' is no component.variable. Use stop=."),
        ("factor", "'factor' sets nothing. Write NAME=VALUE"),
        ("one.factor=much", "set='one.factor': parameter 'factor' of FMU 'gain' is of type Real and cannot be 'much'"),
        ("two.u=1", "set='two.u': input 'two.u' is connected and given a value"),
        ("seed=-1", "the seed is a whole number from 0 on"),
    ],
)
def test_a_wrong_value_is_named(fmus, text, message):
    with pytest.raises(ScenarioError) as caught:
        values(fmus, text)
    assert message in str(caught.value)


def test_a_number_beyond_the_last_one_says_how_many_there_are():
    names = ["membrane", *(f"sensor{k}" for k in range(1, 9))]
    assert suggest("sensor9", names) == "There are 8: sensor1 .. sensor8."
    assert suggest("damage[17]", [f"damage[{k}]" for k in range(1, 17)]) == "There are 16: damage[1] .. damage[16]."
    assert suggest("run12", sorted(f"run{k}" for k in range(1, 12))) == "There are 11: run1 .. run11."
    assert suggest("w[9,1]", ["w[1,1]", "w[1,2]", "w[2,1]", "w[2,2]"]) == "There are 4: w[1,1] .. w[2,2]."
    assert suggest("w[2]", ["w[1,1]", "w[1,2]"]) == "There are 2: w[1,1] .. w[1,2]."
    assert suggest("sensor2", ["sensor1", "sensor3"]) == "Did you mean 'sensor3'?"
    assert suggest("membrane1", names) == "Did you mean 'membrane'?"
    assert suggest("sensr1", names) == "Did you mean 'sensor1'?"


def test_the_command_sets_values(fmus, tmp_path):
    (tmp_path / "s.toml").write_text(SCENARIO)
    options = ["--fmus", str(fmus), "--out", str(tmp_path / "out"), "--no-pictures", "--set", "one.factor=0"]
    result = invoke(["run", str(tmp_path / "s.toml"), *options])
    assert result.exit_code == 0, result.stderr
    assert load_results(tmp_path / "out")["one.y"].values.tolist() == [5.0] * 4
