"""The command line: help that teaches, results on stdout, expected errors alone on stderr."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from command_line import invoke
from gossamer.cli import ORDER, commands, parsed
from gossamer_orchestrator.scenario.source import find_scenario, shipped_scenarios

FRAGILE = 'step = 0.1\nstop = 1.0\n[components.f]\nfmu = "fragile"\n'
GAIN = 'step = 0.1\nstop = 1.0\n[components.g]\nfmu = "gain"\ninputs = { u = 1.0, "offset[*]" = 0.0 }\n'


@pytest.fixture
def call():
    return lambda *arguments: invoke([str(a) for a in arguments])


def test_a_run_prints_the_paths_of_its_results(call, fmus, tmp_path):
    (tmp_path / "g.toml").write_text(GAIN)
    result = call("run", tmp_path / "g.toml", "--fmus", fmus, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    names = ["results.nc", "results.csv", "report.html"]
    assert result.stdout.split() == [str(tmp_path / "out" / name) for name in names]
    assert all(Path(line).is_file() for line in result.stdout.split())
    assert result.stderr.endswith(f"Open {tmp_path / 'out/report.html'}, or type 'gossamer view {tmp_path / 'out'}'.\n")


def test_a_run_without_pictures_writes_no_page(call, fmus, tmp_path):
    (tmp_path / "g.toml").write_text(GAIN)
    result = call("run", tmp_path / "g.toml", "--fmus", fmus, "--out", tmp_path / "out", "--no-pictures")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["results.csv", "results.nc"]
    assert "Open" not in result.stderr


def test_an_expected_error_is_its_message_alone(call, fmus, tmp_path):
    (tmp_path / "g.toml").write_text(GAIN.replace("gain", "gan"))
    result = call("run", tmp_path / "g.toml", "--fmus", fmus)
    assert result.exit_code == 1
    assert result.stdout == ""
    assert result.stderr.startswith("g.toml:4: there is no FMU 'gan' in")
    assert "Traceback" not in result.stderr


def test_a_failing_run_says_where_its_results_are(call, fmus, tmp_path):
    (tmp_path / "f.toml").write_text(FRAGILE)
    result = call("run", tmp_path / "f.toml", "--fmus", fmus, "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert "component 'f' failed at t = 0.5 s (fatal)" in result.stderr
    assert f"Results until t = 0.5 s are in {tmp_path / 'out'}." in result.stderr
    assert (tmp_path / "out/results.csv").is_file()


def test_a_process_whose_fmu_broke_ends_in_order(fmus, tmp_path):
    (tmp_path / "f.toml").write_text(FRAGILE)
    command = [sys.executable, "-m", "gossamer", "run", tmp_path / "f.toml", "--fmus", fmus, "--out", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1, done.stderr
    assert "100 %s of it broke" in done.stderr


def test_unknown_scenarios_and_fmus_are_refused_with_a_suggestion(call):
    result = call("run", "damagd")
    assert (result.exit_code, result.stdout) == (1, "")
    assert "no shipped scenario of that name. Did you mean 'damaged'?" in result.stderr
    result = call("build", "senser")
    assert (result.exit_code, result.stdout) == (1, "")
    assert "there is no FMU 'senser' to build. Did you mean 'sensor'?" in result.stderr


def test_a_build_says_what_its_fmus_run_in(call, tmp_path):
    result = call("build", "sensor", "--out", tmp_path)
    assert (result.exit_code, result.stdout) == (0, f"{tmp_path / 'sensor.fmu'}\n"), result.stderr
    assert re.fullmatch(r"FMI 2.0: sensor \(in Python, on .*linux64.*\)\n", result.stderr)


def test_progress_of_compiling_is_a_line_each_where_there_is_no_terminal(call, fmus, tmp_path, monkeypatch):
    import gossamer_fmus

    def build_all(_folder, _names, *, progress, **_options):
        progress("sensor for win64")
        return {"sensor": fmus / "gain.fmu"}

    monkeypatch.setattr(gossamer_fmus, "build_all", build_all)
    assert call("build", "sensor", "--native").stderr.startswith("compiling sensor for win64\n")


def test_options_of_native_fmus_alone_are_refused_with_the_way_out(call, tmp_path):
    for option in (("--fmi", 3), ("--platform", "win64")):
        assert "Add --native." in call("build", "--out", tmp_path, *option).stderr
    result = call("build", "--out", tmp_path, "--native", "--platform", "aarch64-linux")
    assert "only with --fmi 3" in result.stderr


def test_a_scenario_in_place_of_an_fmu_is_named(call, tmp_path):
    (tmp_path / "a.toml").write_text(GAIN)
    assert "run it with 'gossamer run'." in call("info", tmp_path / "a.toml").stderr


def test_an_fmu_for_scheduled_execution_is_refused_once_though_two_components_use_it(call, tmp_path):
    description = (
        '<fmiModelDescription fmiVersion="3.0" modelName="gain" instantiationToken="x">'
        '<ScheduledExecution modelIdentifier="gain"/><ModelVariables><Float64 name="time" valueReference="0" '
        'causality="independent" variability="continuous"/></ModelVariables><ModelStructure/></fmiModelDescription>'
    )
    with zipfile.ZipFile(tmp_path / "gain.fmu", "w") as file:
        file.writestr("modelDescription.xml", description)
    (tmp_path / "g.toml").write_text(GAIN + GAIN.partition("stop = 1.0\n")[2].replace("[components.g]", "[components.h]"))
    result = call("run", tmp_path / "g.toml", "--fmus", tmp_path)
    (line,) = result.stderr.splitlines()
    assert "is FMI 3.0 for scheduled execution" in line
    assert line.endswith("Export it for one of them.")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no disk that is always full")
def test_an_answer_that_cannot_be_written_is_no_traceback(fmus):
    command = [sys.executable, "-m", "gossamer", "info", str(fmus / "gain.fmu"), "--json"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert done.stderr.startswith("cannot write the answer: ")
    unread, pipe = os.pipe()
    os.close(unread)
    done = subprocess.run(command, stdout=pipe, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    os.close(pipe)
    assert (done.returncode, done.stderr) == (1, "")


def test_info_lists_variables(call, fmus):
    result = call("info", fmus / "bounded.fmu")
    assert result.exit_code == 0, result.stderr
    for text in ("factor", "offset[1]", "parameter", "-10", "what comes out"):
        assert text in result.stdout


def test_help_loads_nothing_heavy():
    code = (
        "import sys, gossamer.cli\ntry: gossamer.cli.main(['--help'])\nexcept SystemExit as end: assert not end.code\n"
        "print([m for m in ('fmpy', 'xarray', 'numpy', 'matplotlib', 'casadi', 'pydantic') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_shipped_scenarios_are_found_by_name():
    assert {"damaged", "damage_begins"} <= set(shipped_scenarios())
    assert find_scenario("damaged").name == "damaged.toml"
    assert find_scenario("damaged.toml").is_file()


LONG = (
    "run|validate|info|view|plot|export-vtk|new|twin|watch|campaign|train|assess sensor.json|identify|place-sensors --setup"
)
LONG += "|demo --out|assess-detector --artifact|build sensor --out|build membrane --setup|container"


@pytest.mark.parametrize("command", LONG.split("|"))
def test_a_path_that_no_system_has_is_one_sentence(call, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, stdout, stderr = call(*command.split(), 4400 * "a")
    assert (code, stdout) == (1, "")
    assert "name too long" in stderr.lower()
    assert "Traceback" not in stderr


@pytest.mark.parametrize("command", [["train"], ["campaign", "small.toml", "--out"]])
def test_a_zarr_store_of_version_2_is_no_campaign(call, command, tmp_path, monkeypatch):
    pytest.importorskip("zarr", reason="campaigns need the extra 'campaign'")
    monkeypatch.chdir(tmp_path)
    Path("small.toml").write_text("cases = 2\nstop = 0.003\n[membrane]\nelements_per_side = 4\norder = 1\n")
    Path("two.zarr").mkdir()
    Path("two.zarr/.zgroup").write_text('{"zarr_format": 2}')
    result = call(*command, "two.zarr")
    assert result.exit_code == 1
    assert result.stderr.endswith(
        "two.zarr is not the store of a campaign. Name its folder, or another one for a new campaign.\n"
    )


def test_the_word_none_is_a_text_where_a_text_is_meant():
    assert parsed(["twin", "x", "--fit", "none"])[1] == {"records": ("x",), "fit": "none"}


def test_the_help_lists_all_commands_in_the_order_of_work(call):
    assert sorted(ORDER) == sorted(name.replace("_", "-") for name in commands())
    listed = re.findall(r"^│ ([a-z-]+) ", call("--help").stdout, re.MULTILINE)
    assert listed[: len(ORDER)] == list(ORDER)


def test_a_default_of_zero_is_in_the_help(call):
    text = call("place-sensors", "--help").stdout
    assert ("[default: 0.0]" in text, "[default: 0]" in text) == (True, True)


def test_names_may_stand_before_behind_and_between_options():
    _, given, _ = parsed(["build", "sensor", "--out", "o", "filter", "--platform", "all", "hub"])
    assert given == {"names": ("sensor", "filter", "hub"), "out": "o", "platform": ["all"]}
