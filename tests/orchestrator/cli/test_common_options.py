"""Options of all commands: one JSON document, quiet, messages, a log file; exit codes; lines of progress."""

from __future__ import annotations

import io
import json
import logging
import os
import re
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from command_line import invoke
from gossamer import FmuInfo
from gossamer.cli import commands
from gossamer.results import INVALID, Result, print_tables
from gossamer.working import say
from gossamer_files import as_json
from gossamer_orchestrator import OrchestratorError, ProgressBar
from rich.console import Console

GAIN = 'step = 0.1\nstop = 1.0\n[components.g]\nfmu = "gain"\ninputs = { u = 1.0, "offset[*]" = 0.0 }\n'


@pytest.fixture
def call():
    return lambda *arguments: invoke([str(a) for a in arguments])


@pytest.fixture
def run(call, fmus, tmp_path):
    (tmp_path / "g.toml").write_text(GAIN)
    return lambda *more: call("run", tmp_path / "g.toml", "--fmus", fmus, "--out", tmp_path / "out", "--no-pictures", *more)


def test_json_is_the_only_thing_on_stdout(run, tmp_path):
    result = run("--json")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["ended"] == "complete"
    assert found["stop_s"] == pytest.approx(1.0)
    assert found["wall_time_s"] > 0.0
    assert found["files"] == [str(tmp_path / "out" / name) for name in ("results.nc", "results.csv")]
    assert (found["valid"], found["judgements"], found["doubts"]) == (None, [], [])


def test_common_options_may_stand_before_the_command(call, fmus):
    before, behind = call("--json", "info", fmus / "bounded.fmu"), call("info", fmus / "bounded.fmu", "--json")
    assert before.stdout == behind.stdout
    variables = {each["variable"]: each for each in json.loads(before.stdout)["variables"]}
    assert variables["factor"]["unit"] == "m"
    assert float(variables["factor"]["max"]) == 10.0


def test_quiet_leaves_the_answer_and_errors(run, call, fmus, tmp_path):
    result = run("--quiet")
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.split() == [str(tmp_path / "out" / name) for name in ("results.nc", "results.csv")]
    assert "no shipped scenario of that name" in call("run", "damagd", "--quiet").stderr


def test_a_log_file_is_appended_to_with_what_was_done_and_how_it_ended(run, call, tmp_path):
    file = tmp_path / "log.txt"
    assert run("--log-file", file).stderr == run().stderr
    assert call("run", "damagd", "--log-file", file).exit_code == 1
    text = file.read_text(encoding="utf-8")
    assert text.count("INFO gossamer.cli: gossamer ") == 2
    assert text.count("INFO gossamer.cli: done in ") == 1
    assert "11 communication points" in text
    assert "ScenarioError: there is no scenario file 'damagd'" in text
    assert "cannot write" in call("info", "x.fmu", "--log-file", tmp_path / "none" / "log.txt").stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_log_whose_disk_is_full_is_said_once_and_takes_no_answer_away(run, tmp_path):
    """It ended in one traceback per message, and the answer was not printed."""
    result = run("--log-file", "/dev/full")
    assert result.exit_code == 0
    assert result.stderr.count("/dev/full is not complete: No space left on device.") == 1
    assert "Traceback" not in result.stderr
    assert str(tmp_path / "out/results.nc") in result.stdout


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="lays a pipe as POSIX has them")
def test_a_log_that_is_a_pipe_is_refused_and_not_waited_for(call, tmp_path):
    os.mkfifo(tmp_path / "log")
    assert f"cannot write {tmp_path / 'log'}: it is a pipe." in call("info", "x.fmu", "--log-file", tmp_path / "log").stderr


def test_verbose_says_what_is_done_and_leaves_the_loggers_as_they_were(run):
    before = logging.getLogger("gossamer_orchestrator").level, list(logging.getLogger().handlers)
    result = run("-v")
    for text in ("10 steps of 0.1 s", "g: gain.fmu", "done in"):
        assert text in result.stderr
    assert (logging.getLogger("gossamer_orchestrator").level, list(logging.getLogger().handlers)) == before


def test_a_warning_has_the_name_of_its_logger_only_where_all_messages_are_wanted(monkeypatch):
    def warns() -> Result:
        """Warn."""
        logging.getLogger("gossamer_orchestrator.results").warning("no pictures")
        return Result()

    monkeypatch.setitem(commands(), "warns", warns)
    assert invoke(["warns"]).stderr == "WARNING: no pictures\n"
    assert "WARNING gossamer_orchestrator.results: no pictures\n" in invoke(["warns", "-v"]).stderr


@pytest.mark.parametrize(("valid", "code"), [((1.0, 1.0), 0), ((0.0, 1.0), 0), ((1.0, 0.0), INVALID)])
def test_an_invalid_last_judgement_has_an_exit_code_of_its_own(call, fmus, tmp_path, monkeypatch, valid, code):
    """A detector that ends two windows, at 0.5 s and 1 s; the code is that of the last one."""
    time, ended = np.linspace(0.0, 1.0, 11), np.array([0] * 5 + [1] * 5 + [2])
    damage, told = np.outer(ended, np.ones(16)) / 10.0, np.array([0.0, *valid])[ended]
    columns = {"detector.damage": (("time", "zone"), damage), "detector.valid": ("time", told)}
    data = xr.Dataset(columns, {"time": time}, {"ended": "complete", "wall_time": 0.1})
    monkeypatch.setattr("gossamer_orchestrator.run.runner.run_scenario", lambda *_, **__: data)
    monkeypatch.setattr("gossamer_orchestrator.results.places.with_places", lambda data, _: data)
    (tmp_path / "g.toml").write_text(GAIN)
    result = call("run", tmp_path / "g.toml", "--out", tmp_path / "out", "--no-pictures", "--json")
    assert result.exit_code == code, result.stderr
    found = json.loads(result.stdout)
    assert found["valid"] is (code == 0)
    assert [each["valid"] for each in found["judgements"]] == [each > 0.5 for each in valid]
    assert found["judgements"][1] == {
        "time_s": 1.0,
        "valid": valid[1] > 0.5,
        "damage": [0.2] * 16,
        "deviation": [None] * 16,
        "determined": [True] * 16,
        "true_damage": [None] * 16,
    }


def test_what_json_cannot_hold_becomes_what_it_can():
    @dataclass
    class Point:
        x: float
        where: Path

    assert as_json({"a": np.array([1.0, np.nan]), "b": Point(np.inf, Path("x")), 3: (True, None)}) == {
        "a": [1.0, None],
        "b": {"x": None, "where": "x"},
        "3": [True, None],
    }


class Works(Result):
    """What a command may say."""

    files = (Path("a path"),)

    def tables(self):
        return ["a table"]

    def exit_code(self):
        return INVALID

    def to_json(self):
        return {"time_s": 1.5}


def test_a_command_prints_its_result_alone_and_an_error_not_as_json(monkeypatch):
    def works() -> Works:
        """Work."""
        say("a note")
        return Works()

    def fails() -> Works:
        """Fail."""
        raise OrchestratorError("there is no such thing")

    monkeypatch.setitem(commands(), "works", works)
    monkeypatch.setitem(commands(), "fails", fails)
    assert invoke(["works"]) == (3, "a path\n", "a note\na table\n")
    code, stdout, stderr = invoke(["works", "--json"])
    assert (code, json.loads(stdout), stderr) == (3, {"time_s": 1.5}, "a note\na table\n")
    assert invoke(["works", "--quiet"]).stderr == ""
    assert invoke(["fails", "--json"]) == (1, "", "there is no such thing\n")


def test_progress_is_a_line_now_and_then_where_there_is_no_terminal(monkeypatch):
    monkeypatch.setattr("gossamer_orchestrator.run.progress.EVERY", 0.05)
    file = io.StringIO()
    with ProgressBar("training", Console(file=file, width=40)) as bar:
        bar.update(1.0, 4.0, "1 of 4 cases,")
        time.sleep(0.3)
        bar.update(2.0)
        time.sleep(0.3)
    lines = file.getvalue().splitlines()
    assert lines[0].startswith("training: 25 %, 1 of 4 cases, 0:00:00 elapsed")
    assert lines[-1].startswith("training: 50 %, 1 of 4 cases, ")
    time.sleep(0.2)
    assert file.getvalue().splitlines() == lines  # none after the end


def line_after_100_s(monkeypatch, label, *updates, **options):
    """Return the last line of a bar whose clock stands at 100 s, after some updates."""
    monkeypatch.setattr("gossamer_orchestrator.run.progress.EVERY", 0.05)
    file = io.StringIO()
    with ProgressBar(label, Console(file=file), **options) as bar:
        task = bar._progress.tasks[0]
        task.start_time, task._get_time = 0.0, lambda: 100.0
        for update in updates:
            bar.update(*update)
        time.sleep(0.2)
    return file.getvalue().splitlines()[-1]


def test_what_remains_is_at_the_mean_speed_and_without_what_was_done_before(monkeypatch):
    """Two of eight were there; two more took 100 s together, so the last four take 200 s."""
    line = line_after_100_s(monkeypatch, "sweep", (2, 8), (4,))
    assert line == "sweep: 50 %, 0:01:40 elapsed, 0:03:20 remaining"


def test_a_task_whose_parts_take_unlike_times_shows_the_elapsed_time_alone(monkeypatch):
    line = line_after_100_s(monkeypatch, "identify", (0.2, 1.0), (0.4,), remaining=False)
    assert line == "identify: 40 %, 0:01:40 elapsed"


def test_what_a_run_waits_for_is_named_and_no_part_of_its_speed():
    """10 s for a tenth of the run, then 300 s of waiting: what remains takes 90 s."""
    file, clock = io.StringIO(), [0.0]
    with ProgressBar("run", Console(file=file, force_terminal=True, color_system=None, width=120)) as bar:
        task = bar._progress.tasks[0]
        task.start_time, task._get_time = 0.0, lambda: clock[0]
        bar.show(0, 100, 0.0)
        for seconds in (10.0, 100.0, 310.0):
            clock[0] = seconds
            bar.show(10, 100, 0.1, "compiling the twin (once)")
        bar._progress.refresh()
        waiting = file.getvalue()
        bar.show(10, 100, 0.1)
    assert "t = 0.1000 s, compiling the twin (once), 0:05:10 elapsed\n" in f"{waiting.rstrip()}\n"
    assert "remaining" not in waiting.split("compiling")[-1]
    assert "t = 0.1000 s, 0.01 simulated s per s, 0:05:10 elapsed, 0:01:30 remaining" in file.getvalue()


def test_while_a_task_waits_only_the_elapsed_time_is_shown():
    """Two of four windows in 20 s, and then a fit of 60 s, which tells nothing of the others."""
    file, clock = io.StringIO(), [0.0]
    with ProgressBar("watching", Console(file=file, force_terminal=True, color_system=None, width=120)) as bar:
        task = bar._progress.tasks[0]
        task.start_time, task._get_time = 0.0, lambda: clock[0]
        bar.update(0, 4, "0 of 4 windows,")
        for seconds, done, aside in ((20.0, 2, "fitting onset and damage"), (80.0, 3, "")):
            clock[0] = seconds
            bar._progress.refresh()
            bar.update(done, 4, f"{done} of 4 windows,", aside)
            bar._progress.refresh()
    lines = [line.strip() for line in re.split(r"[\r\n]", file.getvalue())]
    assert any(line.endswith("2 of 4 windows, fitting onset and damage, 0:00:20 elapsed") for line in lines)
    assert any(line.endswith("fitting onset and damage, 0:01:20 elapsed") for line in lines)
    assert any(line.endswith("3 of 4 windows, 0:01:20 elapsed, 0:00:07 remaining") for line in lines)


def test_a_bar_on_a_terminal_shows_the_elapsed_time():
    file = io.StringIO()
    with ProgressBar("training", Console(file=file, force_terminal=True, width=120)) as bar:
        bar.update(1.0, 4.0)
    assert "25%" in file.getvalue()
    assert "elapsed" in file.getvalue()


def test_a_name_in_brackets_is_no_markup():
    file = io.StringIO()
    with ProgressBar("a[/b]", Console(file=file, force_terminal=True, width=120)) as bar:
        bar.update(1.0, 4.0)
    info = FmuInfo(path=Path("fan.fmu"), name="fan", description="Speed [/s]", fmi="2.0", variables={})
    print_tables(Console(file=file), info.tables())
    assert "a[/b]" in file.getvalue()
    assert "Speed [/s]" in file.getvalue()


def test_quiet_progress_prints_nothing(monkeypatch):
    monkeypatch.setattr("gossamer_orchestrator.run.progress.EVERY", 0.01)
    for terminal in (True, False):
        file = io.StringIO()
        with ProgressBar("training", Console(file=file, quiet=True, force_terminal=terminal)) as bar:
            bar.update(1.0, 4.0)
            time.sleep(0.05)
        assert file.getvalue() == ""
