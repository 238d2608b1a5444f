"""``gossamer new`` writes a scenario that mentions every table and key, is valid as it is, and runs."""

from __future__ import annotations

import re
import tomllib

import pytest
from command_line import invoke
from gossamer_orchestrator import judge, load_scenario, make_plan, parse_scenario, run_scenario
from gossamer_orchestrator.results.judgements import windows
from gossamer_orchestrator.scenario import schema

TABLES = [each for each in vars(schema).values() if isinstance(each, type) and issubclass(each, schema.ScenarioTable)]


@pytest.fixture
def written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = invoke(["new", "mine"])
    assert (result.exit_code, result.stdout) == (0, "mine.toml\n"), result.stderr
    return tmp_path / "mine.toml"


def test_every_table_and_key_of_a_scenario_stands_in_it(written):
    text = written.read_text(encoding="utf-8")
    keys = {field.alias or name for table in TABLES for name, field in table.model_fields.items()}
    assert {"noise", "dropout", "inputs", "groups", "step_control", "events", "record", "components"} <= keys
    for key in keys:
        assert re.search(rf"(^|[\[{{ ]){key}( =|\]|\.)", text, re.MULTILINE), key


def test_what_is_off_can_be_switched_on(written):
    """Every commented key is right: with all of them the file is still a scenario."""
    lines = written.read_text(encoding="utf-8").splitlines()
    on = [re.sub(r"^# (?=\w+ = |\[)", "", line) for line in lines]
    assert on.count("[[inputs]]") == on.count("[[groups]]") == on.count("[step_control]") == 1
    assert parse_scenario("\n".join(on)).step_control.parts == 1024


def test_it_runs_as_it_is_and_finds_the_damage_that_begins(written, built):
    fmus = built("native")["sensor"].parent
    make_plan(load_scenario(written), fmus, strict=True)
    data = run_scenario(written, fmus)
    before, *_, after = windows(data)
    assert before.estimated.max() == 0.0
    assert after.valid
    assert judge(data).estimated[9] == pytest.approx(0.3, abs=0.01)
    assert {name for name, each in tomllib.loads(written.read_text())["components"].items() if each["fmu"] == "sensor"} == {
        f"sensor{k}" for k in range(1, 5)
    }


def test_a_file_that_is_there_is_kept(written):
    before = written.read_bytes()
    result = invoke(["new", "mine.toml"])
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr == "mine.toml is there already. Take another name, or remove it.\n"
    assert written.read_bytes() == before


def test_a_name_may_have_a_hyphen(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = invoke(["new", "scen-1"])
    assert (result.exit_code, result.stdout) == (0, "scen-1.toml\n"), result.stderr
    assert load_scenario(tmp_path / "scen-1.toml").title.startswith("scen-1: ")


@pytest.mark.parametrize(
    ("name", "text"),
    [("no name", "is no name of a scenario"), ("2", "Begin with a letter"), ("none/mine", "cannot write none")],
)
def test_a_name_that_cannot_be_one_is_refused(tmp_path, monkeypatch, name, text):
    monkeypatch.chdir(tmp_path)
    result = invoke(["new", name])
    assert result.exit_code == 1
    assert text in result.stderr
    assert list(tmp_path.iterdir()) == []
