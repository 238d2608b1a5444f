"""Scenario files as editors write them, and what is refused before anything runs."""

from __future__ import annotations

import codecs

import pytest
from gossamer_orchestrator import (
    OrchestratorError,
    ScenarioError,
    load_results,
    load_scenario,
    make_plan,
    parse_scenario,
    run_scenario,
)
from gossamer_orchestrator.scenario.source import find_scenario

GAIN = 'step = 0.1\nstop = 1.0\n[components.g]\nfmu = "gain"\ninputs = { u = 1.0, "offset[*]" = 0.0 }\n'


def test_a_byte_order_mark_is_no_part_of_a_scenario(tmp_path):
    path = tmp_path / "g.toml"
    path.write_bytes(codecs.BOM_UTF8 + GAIN.encode())
    assert load_scenario(path).components == parse_scenario(GAIN).components


@pytest.mark.parametrize("coding", ["utf-16", "utf-16-be"])
def test_utf_16_is_named(tmp_path, coding):
    path = tmp_path / "g.toml"
    path.write_bytes((codecs.BOM_UTF16_BE if coding == "utf-16-be" else b"") + GAIN.encode(coding))
    with pytest.raises(ScenarioError, match=r"is not a scenario .* It is text in UTF-16: save it as UTF-8."):
        load_scenario(path)


def test_python_knows_the_shipped_names_that_the_command_knows(tmp_path):
    with pytest.raises(ScenarioError, match=r"damaged.toml: there is no folder .*nowhere with FMUs"):
        run_scenario("damaged", tmp_path / "nowhere")


@pytest.mark.parametrize("place", ["scenario", "fmu", "fmus", "out", "results", "set"])
def test_a_path_that_no_file_can_have_is_refused_in_a_sentence(tmp_path, fmus, place):
    long, path = "a" * 4400, tmp_path / "g.toml"
    path.write_text(GAIN.replace('"gain"', f'"{long}"') if place in ("fmu", "set") else GAIN)
    scenario, folder, out = (
        long if place == each else usual for each, usual in (("scenario", path), ("fmus", fmus), ("out", None))
    )
    changes = {"g.gain": 1.0} if place == "set" else {}
    message = r"no file can be called '.{60}' \.\., \d{4} characters: .+\. Name another\."
    with pytest.raises(OrchestratorError, match=message):
        load_results(tmp_path / long) if place == "results" else run_scenario(scenario, folder, out, values=changes)


def test_a_missing_ssp_is_not_taken_for_the_shipped_scenario_of_its_name():
    with pytest.raises(ScenarioError, match=r"there is no scenario file 'damaged.ssp'"):
        find_scenario("damaged.ssp")


@pytest.mark.parametrize(("record", "message"), [
    ("variables = []", r"g.toml:7: 'variables' in 'record' is empty: nothing would be recorded."),
    ("every = 100000000", r"g.toml:7: 'every' in 'record' is 100000000, but the run has 10 steps."),
])  # fmt: skip
def test_a_recording_of_nothing_is_refused(tmp_path, record, message):
    path = tmp_path / "g.toml"
    path.write_text(f"{GAIN}[record]\n{record}\n")
    with pytest.raises(ScenarioError, match=message):
        load_scenario(path)


@pytest.mark.parametrize(("fmu", "message"), [
    ("notes.txt", "'notes.txt' is not an FMU, whose name ends in .fmu. It is text."),
    ("folder.fmu", "'folder.fmu' is not an FMU, whose name ends in .fmu. It is a folder."),
    ("notes.fmu", "notes.fmu is not an FMU. It is text."),
    ("gone.fmu", "there is no FMU 'gone.fmu'"),
])  # fmt: skip
def test_a_file_that_is_no_fmu_is_told_from_one_that_is_not_there(tmp_path, fmus, fmu, message):
    (tmp_path / "notes.txt").write_text("notes")
    (tmp_path / "notes.fmu").write_text("notes")
    (tmp_path / "folder.fmu").mkdir()
    path = tmp_path / "g.toml"
    path.write_text(GAIN.replace('"gain"', f'"{fmu}"'))
    with pytest.raises(ScenarioError) as refused:
        run_scenario(path, fmus)
    assert message in str(refused.value)


def test_a_long_value_is_cut_in_a_message():
    with pytest.raises(ScenarioError) as refused:
        parse_scenario(GAIN.replace("step = 0.1", f'step = "{20_000 * "x"}"'))
    assert len(str(refused.value)) < 400


def test_events_after_a_stop_of_the_command_line_are_left_out_with_one_note(fmus, caplog):
    events = "".join(f'[[events]]\ntime = {t}\ncomponent = "g"\nset = {{ u = {t} }}\n' for t in (0.2, 0.6, 0.8))
    plan = make_plan(parse_scenario(GAIN + events, stop=0.5), fmus)
    assert list(plan.events) == [2]
    assert [record.getMessage() for record in caplog.records] == [
        "stop=: the run ends before the events at 0.6, 0.8 s, which are left out"
    ]
    with pytest.raises(ScenarioError, match=r"the event at 0.6 s lies outside the run, 0 to 0.5 s"):
        parse_scenario((GAIN + events).replace("1.0", "0.5", 1))


def test_a_mistake_in_an_option_is_not_given_a_line_of_the_file():
    with pytest.raises(ScenarioError, match=r"^stop=: 'stop' = 0.55 s is not a whole number of steps"):
        parse_scenario(GAIN, name="g.toml", stop=0.55)
    with pytest.raises(ScenarioError, match=r"^g.toml:2: 'stop' = 0.55 s"):
        parse_scenario(GAIN.replace("1.0", "0.55", 1), name="g.toml")
