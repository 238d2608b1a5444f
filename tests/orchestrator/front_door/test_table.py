"""The functions of ``import gossamer`` take what the commands take, under the same names, with the same defaults."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import gossamer
import gossamer_orchestrator
import make_front_door
import numpy as np
import pytest
import typer
from gossamer.table import FOR_A_TERMINAL, commands, parameters, values, words_of_python
from gossamer_orchestrator.cli import app

COMMANDS = sorted(commands())
HEAVY = {"numpy", "xarray", "casadi", "typer", "rich", "matplotlib", "fmpy", "gossamer_models", "gossamer_orchestrator"}


def defaults(command):
    return {name: each.default for name, each in parameters(command).items()} | {"scenario": "damaged"}


@pytest.mark.parametrize("name", COMMANDS)
def test_names_order_and_defaults_are_those_that_the_command_line_parses(name):
    command = typer.main.get_command(app).commands[name.replace("_", "-")]
    context = command.make_context(name, [], resilient_parsing=True)
    parsed = {}
    for each in command.get_params(context):
        flags = [flag for flag in each.opts if flag.startswith("--")]
        called = flags[0].removeprefix("--").replace("-", "_") if flags else each.name
        parsed[called] = inspect.Parameter.empty if each.required else each.default
    parsed = {called: default for called, default in parsed.items() if called not in ("help", *FOR_A_TERMINAL)}
    signature = inspect.signature(getattr(gossamer, name)).parameters
    assert list(signature) == list(parsed)
    for called, default in parsed.items():
        expected = str(default) if isinstance(default, Path) else default
        assert signature[called].default == expected, called


def test_the_functions_are_what_the_table_makes(rewrite_goldens):
    for path, text in make_front_door.texts().items():
        if rewrite_goldens:
            path.write_text(text, encoding="utf-8")
        assert path.read_text(encoding="utf-8") == text, f"{path.name} is old: run make goldens"


@pytest.mark.parametrize("name", COMMANDS)
def test_every_parameter_is_explained(name):
    text = inspect.getdoc(getattr(gossamer, name))
    for called, each in parameters(name).items():
        assert f"\n{called} : " in text
        assert each.about.help.split()[0] in text


def test_importing_it_imports_nothing_heavy():
    script = "import gossamer, sys; dir(gossamer); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert "gossamer" in loaded
    assert not HEAVY & set(loaded)


def test_its_public_names_are_there_and_others_are_not():
    assert set(COMMANDS) <= set(dir(gossamer))
    for name in dir(gossamer):
        assert getattr(gossamer, name).__name__ == name
    with pytest.raises(AttributeError, match="has no attribute 'fly'"):
        _ = gossamer.fly


def test_its_errors_are_those_of_the_orchestrator():
    for name in ("OrchestratorError", "ScenarioError", "FmuError", "SimulationError", "ResultsError"):
        assert getattr(gossamer, name) is getattr(gossamer_orchestrator, name)


@pytest.mark.parametrize(
    ("given", "texts"),
    [
        ({"membrane.damage[1]": 0.3, "seed": 2}, ["membrane.damage[1]=0.3", "seed=2"]),
        ({"a.x": np.float64(0.1), "a.on": True, "a.name": "steel"}, ["a.x=0.1", "a.on=true", "a.name=steel"]),
        ({"membrane.damage": np.array([0.5, 0.25])}, ["membrane.damage=[0.5, 0.25]"]),
        ({"a.n": [np.int64(1), 2], "a.m": (1, 2)}, ["a.n=[1, 2]", "a.m=[1, 2]"]),
        (["seed=2"], ["seed=2"]),
        ("seed=2", ["seed=2"]),
    ],
)
def test_values_by_name_become_what_the_command_line_writes(given, texts):
    assert values("run", defaults("run") | {"set": given})["values"] == texts


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (np.linspace(0.0, 0.5, 3), "0.0,0.25,0.5"),
        (range(1, 4), "1,2,3"),
        ((0.01, 0.03), "0.01,0.03"),
        ("0:0.5:6", "0:0.5:6"),
        (0.3, "0.3"),
    ],
)
def test_what_a_sweep_varies_is_any_sequence(given, text):
    assert values("sweep", defaults("sweep") | {"set": {"a.x": given}})["ranges"] == [f"a.x={text}"]


def test_lists_of_numbers_and_names_may_be_sequences():
    read = values("build", defaults("build") | {"names": "sensor", "scales": (1000, 150, 0.2)})
    assert (read["names"], read["scales"], read["out"]) == (["sensor"], "1000,150,0.2", Path("out/fmus"))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"threads": 0}, "threads is 0. It is at least 1 and at most 64"),
        ({"threads": 1.5}, "threads is 1.5. Give a whole number"),
        ({"step": "short"}, "step is 'short'. Give a number"),
        ({"strict": 1}, "strict is 1. Give True or False"),
        ({"fmus": None}, "fmus is None. Give a value"),
        ({"fmus": 3}, "fmus is 3. Give a path"),
        ({"limit": True}, "limit is True. Give a number"),
        ({"set": {"a.x": {1}}}, r"\{1\} is no value. Give a number"),
    ],
)
def test_a_wrong_value_is_refused_by_name(wrong, message):
    with pytest.raises(gossamer.OrchestratorError, match=message):
        values("run", defaults("run") | wrong)


def test_what_may_be_several_is_refused_by_name_where_it_is_neither_one_nor_several():
    with pytest.raises(gossamer.OrchestratorError, match=r"fmus is 5\. Give a path"):
        gossamer.verify(5)


def test_a_choice_that_is_not_offered_is_refused_with_those_that_are():
    with pytest.raises(
        gossamer.OrchestratorError, match=r"kind is 'big'\. Give 'neuro-fuzzy' or 'perceptron' or 'thesis'"
    ):
        gossamer.train(kind="big")


def test_an_unknown_option_is_refused_by_python():
    with pytest.raises(TypeError, match="unexpected keyword argument 'stp'"):
        gossamer.run("damaged", stp=1.0)


def test_errors_name_arguments_as_python_does_and_commands_as_a_shell(tmp_path):
    path = tmp_path / "measured.csv"
    path.write_text("n,input,output\n0,0,1\n")
    with pytest.raises(gossamer_orchestrator.OrchestratorError) as refused:
        gossamer.identify(path, out=tmp_path / "sensor.json")
    lines = str(refused.value).splitlines()
    assert [line.rsplit("Name one ")[1] for line in lines] == [
        "(time=) or give the sampling step (sampling_step=).",
        "(strain=).",
        "(resistance=).",
    ]
    with pytest.raises(gossamer_orchestrator.OrchestratorError) as refused, words_of_python("build"):
        raise gossamer_orchestrator.OrchestratorError("Add --native, or 'gossamer build filter --artifact FILE'.")
    assert str(refused.value) == "Add native=True, or 'gossamer build filter --artifact FILE'."
