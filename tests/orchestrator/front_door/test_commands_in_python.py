"""The functions of ``import gossamer`` are the commands: what they take is explained, checked, and refused by name."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys

import gossamer
import gossamer_orchestrator
import numpy as np
import pytest
from command_line import invoke
from gossamer.arguments import assigned, check, declared, several
from gossamer.cli import commands, parsed
from gossamer_files.options import option

HEAVY = {
    "numpy",
    "xarray",
    "casadi",
    "cyclopts",
    "pydantic",
    "rich",
    "matplotlib",
    "fmpy",
    "gossamer_models",
    "gossamer_orchestrator",
}


@pytest.mark.parametrize("name", commands())
def test_every_parameter_is_explained_and_is_an_option(name):
    function, flag = getattr(gossamer, name), name.replace("_", "-")
    help_of = " ".join(invoke([flag, "--help"]).stdout.split())
    assert "For example:" in help_of
    assert f"gossamer {flag}" in help_of
    assert help_of.count("--log-file") == 1
    signature = inspect.signature(function).parameters
    for called, each in declared(function).items():
        owner = each.owner or function
        assert re.search(rf"^{called}\n +\S", inspect.getdoc(owner), re.MULTILINE)
        assert (f"--{called.replace('_', '-')} " if each.is_option else called.upper()) in help_of
        if called in signature:
            assert signature[called].default == each.default


def test_importing_it_imports_nothing_heavy():
    script = "import gossamer, sys; dir(gossamer); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert "gossamer" in loaded
    assert not HEAVY & set(loaded)


def test_its_public_names_are_there_and_others_are_not():
    assert set(commands()) <= set(dir(gossamer))
    for package in (gossamer, gossamer_orchestrator):
        for name in package.__all__:
            assert getattr(package, name).__name__ == name
        with pytest.raises(AttributeError, match="has no attribute 'fly'"):
            _ = package.fly


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
    assert assigned(given) == texts


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
    assert assigned({"a.x": given}, many=True) == [f"a.x={text}"]


def test_lists_of_numbers_and_names_may_be_sequences():
    assert several("sensor") == ["sensor"]
    scales = declared(gossamer.build)["scales"]
    assert check(scales, (1000, 150, 0.2)) == check(scales, "1000,150,0.2") == (1000.0, 150.0, 0.2)
    assert parsed(["identify", "x.csv", "--tau", "-1,2"])[1]["tau"] == "-1,2"  # no option, though it begins with a dash


@pytest.mark.parametrize(("name", "argument"), [("identify", "files"), ("verify", "fmus")])
def test_an_empty_list_is_refused_where_one_thing_is_needed(name, argument):
    with pytest.raises(gossamer.OrchestratorError, match=rf"{argument} is empty\. Give a path"):
        getattr(gossamer, name)([])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"threads": 0}, "threads is 0. Give at least 1 and at most 64"),
        ({"threads": 1.5}, "threads is 1.5. Give a whole number"),
        ({"step": "short"}, "step is 'short'. Give a number"),
        ({"strict": 1}, "strict is 1. Give True or False"),
        ({"fmus": None}, "fmus is None. Give a value"),
        ({"fmus": 3}, "fmus is 3. Give a path"),
        ({"limit": True}, "limit is True. Give a number"),
        ({"set": 5}, "set is 5. Give values by name"),
        ({"master": ["a"]}, r"master is \['a'\]. Give 'gauss-seidel' or 'jacobi'"),
        ({"set": {"a.x": {1}}}, r"\{1\} is no value. Give a number"),
    ],
)
def test_a_wrong_value_is_refused_by_name(wrong, message):
    with pytest.raises(gossamer.OrchestratorError, match=message):
        gossamer.run("damaged", **wrong)


def test_what_may_be_several_is_refused_by_name_where_it_is_neither_one_nor_several():
    with pytest.raises(gossamer.OrchestratorError, match=r"fmus is 5\. Give a path"):
        gossamer.verify(5)
    with pytest.raises(gossamer.OrchestratorError, match=r"names is 3\. Give a name, or a list of names"):
        gossamer.build(3)


def test_a_number_where_a_text_is_meant_is_read_as_text(tmp_path):
    path = tmp_path / "measured.csv"
    path.write_text("t [s],strain,resistance [ohm]\n0,0,1\n1,0.01,2\n2,0,1\n3,0,1\n")
    with pytest.raises(gossamer.OrchestratorError, match=r"'0\.5'"):
        gossamer.identify(path, strain_unit=1.0, train=0.5, out=tmp_path / "sensor.json")


def test_on_the_command_line_a_wrong_value_is_refused_by_its_option():
    refused = invoke(["run", "damaged", "--threads", "99"])
    assert refused == (2, "", "--threads is 99. Give at least 1 and at most 64.\n")
    for words, sentence in {
        "run damaged --threads 1.5": "--threads is 1.5. Give a whole number.",
        "run damaged --stop none": "--stop is none. Give a number.",
        "twin x.csv --kind stress": 'Invalid value "stress" for --kind. Choose from: "strain", "resistance", "compensated".',
        "train --kind null": 'Invalid value "null" for --kind. Choose from: "posterior", "thesis".',
    }.items():
        more = f"Every command has its own help: gossamer {words.split()[0]} --help"
        assert invoke(words.split()) == (2, "", f"{sentence}\n{more}\n")


def test_a_choice_that_is_not_offered_is_refused_with_those_that_are():
    with pytest.raises(gossamer.OrchestratorError, match=r"kind is 'big'\. Give 'posterior' or 'thesis'"):
        gossamer.train(kind="big")


def test_an_unknown_option_is_refused_by_python():
    with pytest.raises(TypeError, match="unexpected keyword argument 'stp'"):
        gossamer.run("damaged", stp=1.0)
    with pytest.raises(TypeError, match=r"identify\(\) got an unexpected .* 'strian'\. Did you mean 'strain'\?"):
        gossamer.identify("x.csv", strian="e")
    assert {"strain", "tau", "fading"} <= set(inspect.signature(gossamer.identify).parameters)


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
    assert (option("native", True), option("strain_unit", "%")) == ("native=True", "strain_unit='%'")
    with pytest.raises(gossamer.OrchestratorError, match=r"Add native=True\.$"):
        gossamer.build("sensor", fmi=3, out=tmp_path)
    assert "Add --native.\n" in invoke(["build", "sensor", "--fmi", "3", "--out", tmp_path]).stderr
