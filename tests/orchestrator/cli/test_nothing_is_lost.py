"""Commands never damage a file that was good: not by overwriting an input, when killed, or on a full disk."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from gossamer_files import replacing, write_text
from gossamer_files.inputs import OverwriteError, is_pipe, keeping
from gossamer_models.detector import PosteriorArtifact
from gossamer_models.sensor import SensorArtifact
from gossamer_orchestrator.fmi.archive import check_archive


@pytest.fixture
def record(tmp_path, monkeypatch):
    """A record of 200 samples in the working directory."""
    monkeypatch.chdir(tmp_path)
    time = 0.5 * np.arange(200)
    strain = 0.04 * (1.0 - np.cos(0.25 * time)) * (0.5 + time / 240.0)
    rows = zip(time, strain, 100.0 + 400.0 * strain + 0.01 * time, strict=True)
    Path("rec.csv").write_text("time_s,strain [1],R_ohm\n" + "".join(f"{t},{s},{r}\n" for t, s, r in rows))
    return Path("rec.csv")


IDENTIFY = ["identify", "rec.csv", "--modes", "2", "--relaxations", "0", "--starts", "1", "--out", "out/sensor.json"]
TRAIN = ["train", "few.zarr", "--window", "0.03", "--steps", "1", "--start", "start.json", "--out", "out/small.json"]
BUILD = ["build", "sensor", "compensator", "--out", "out"]


@pytest.mark.parametrize("command", [
    ["identify", "rec.csv", "--out"],
    ["twin", "rec.csv", "--out"],
    ["watch", "rec.csv", "--out"],
    ["train", "rec.csv", "--out"],
    ["campaign", "rec.csv", "--out"],
    ["export-ssp", "chain.toml", "--fmus", "fmus", "--out"],
    ["container", "chain.toml", "--fmus", "fmus", "--out"],
    ["assess", "folder/sensor.json", "rec.csv", "--out"],
    ["assess-detector", "--artifact", "folder/assessment.json", "--out"],
    ["build", "sensor", "--artifact", "folder/sensor.fmu", "--out"],
])  # fmt: skip
@pytest.mark.parametrize("name", ["itself", "by a detour", "by a link"])
def test_an_output_that_is_an_input_is_refused(record, fmus, command, name):
    """Three names of one file; for commands that write into a folder, of the folder."""
    shutil.copytree(fmus, "fmus")
    Path("chain.toml").write_text('step = 0.1\nstop = 1.0\n[components.i]\nfmu = "integrator"\ninputs = { u = 1.0 }\n')
    Path("folder").mkdir()
    for file in ("folder/assessment.json", "folder/sensor.fmu", "folder/sensor.json"):
        Path(file).write_text("an artifact")
    given = {"export-ssp": "chain.toml", "container": "fmus/integrator.fmu"}.get(command[0], "rec.csv")
    if command[0] in ("assess-detector", "build"):
        given = "folder"
    ending = {"export-ssp": ".ssp", "container": ".fmu"}.get(command[0], "")
    Path(f"link{ending}").symlink_to(given)
    out = {"itself": given, "by a detour": f"fmus/../{given}", "by a link": f"link{ending}"}[name]
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    result = invoke([*command, out])
    assert result.exit_code == 1
    assert "which is an input. Name another place with --out." in result.stderr
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before


HISTORY = """
step = 0.1
stop = 1.0
[components.i]
fmu = "integrator"
[[inputs]]
to = "i.u"
file = "out/hist/results.csv"
column = "R_ohm"
"""


@pytest.mark.parametrize("command", [
    ["identify", "rec.csv", "ok/rec_predicted.csv", "--out", "ok.json"],
    ["assess", "rec.csv", "ok/rec_predicted.csv", "rec.csv", "--out", "ok"],
    ["run", "hist.toml", "--fmus", "fmus", "--out", "out/hist"],
    ["watch", "out/hist", "--out", "out/hist/results.csv"],
    ["twin", "out/hist", "--out", "out/hist/results.csv"],
    ["calibrate", "out/hist", "--setup", "sail", "--out", "out/hist/results.nc"],
    ["identify", "rec.csv", "--log-file", "rec.csv"],
    ["run", "hist.toml", "--fmus", "fmus", "--out", "other", "--log-file", "out/hist/results.csv"],
    ["recover", "sensor.json", "rec.csv", "--log-file", "rec.csv"],
])  # fmt: skip
def test_nothing_else_that_a_command_reads_is_written_over(record, fmus, command):
    """Derived files, results of the run that is read, a history of inputs, the log."""
    shutil.copytree(fmus, "fmus")
    for folder in ("ok", "out/hist"):
        Path(folder).mkdir(parents=True)
    for path in ("ok/rec_predicted.csv", "out/hist/results.csv", "out/hist/results.nc"):
        shutil.copy("rec.csv", path)
    Path("hist.toml").write_text(HISTORY)
    Path("sensor.json").write_text("{}")
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    result = invoke(command)
    assert result.exit_code == 1
    why = "is no log of Gossamer. Name another file" if "--log-file" in command else "which is an input. Name another place"
    assert why in result.stderr
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before


def test_the_name_of_a_shipped_setup_is_no_file_that_is_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    built = [invoke(["build", "membrane", "--setup", "drum", "--out", "drum"]) for _ in range(2)]
    assert [each.exit_code for each in built] == [0, 0]


def test_what_a_command_has_read_may_be_written_by_the_next_one(tmp_path):
    path = tmp_path / "it.csv"
    path.write_text("a")
    with keeping(path), pytest.raises(OverwriteError, match="which is an input"):
        write_text(path, "b")
    write_text(path, "c")
    assert path.read_text() == "c"


def test_a_link_to_what_cannot_be_looked_at_is_no_pipe(tmp_path):
    (tmp_path / "link").symlink_to("x" * 300)  # longer than the name of a file can be
    assert not is_pipe(tmp_path / "link")


@pytest.mark.parametrize("command", [
    ["flight", "compensator", "--out", "loop"],
    ["export-ssp", "chain.toml", "--fmus", "fmus", "--out", "loop/chain.ssp"],
    ["container", "chain.toml", "--fmus", "fmus", "--out", "loop/chain.fmu"],
    ["run", "chain.toml", "--fmus", "loops", "--out", "out"],
    ["modes", "--mesh", "loop", "loop.toml"],
    ["campaign", "loop.toml", "--out", "loop/x.zarr"],
])  # fmt: skip
def test_links_that_go_in_a_circle_are_refused_by_name(record, fmus, command):
    """Whether they are to be read or written: Python's own way to follow them ended in a traceback."""
    shutil.copytree(fmus, "fmus")
    Path("chain.toml").write_text('step = 0.1\nstop = 1.0\n[components.i]\nfmu = "integrator"\ninputs = { u = 1.0 }\n')
    Path("loops").mkdir()
    for link in ("loop", "loop.toml", "loops/integrator.fmu"):
        Path(link).symlink_to(Path(link).name)
    result = invoke(command)
    assert result.exit_code == 1
    assert ("integrator" if "loops" in command else "loop") in result.stderr


def test_a_name_that_is_as_long_as_can_be_is_written(tmp_path):
    for name in ("n" * 250 + ".json", "a" + "\u65e5" * 83 + ".json"):
        for text in ("a", "b"):
            write_text(tmp_path / name, text)
        assert (tmp_path / name).read_text() == "b"
    assert len(list(tmp_path.iterdir())) == 2


def test_what_is_not_written_is_named_and_not_the_file_that_would_have_become_it(tmp_path):
    with pytest.raises(OSError, match=r"x\.json") as caught, replacing(tmp_path / "x.json"):
        pass  # nothing is written
    assert "unfinished" not in str(caught.value)


def test_a_link_in_a_circle_is_not_replaced(tmp_path):
    (tmp_path / "loop.json").symlink_to("loop.json")
    with pytest.raises(OSError, match="symbolic links"):
        write_text(tmp_path / "loop.json", "b")
    assert (tmp_path / "loop.json").is_symlink()


def test_code_for_a_flight_processor_is_all_of_one_command(tmp_path):
    """As where the disk is full: what would have taken the place of earlier files is not written either."""
    assert invoke(["flight", "compensator", "--out", tmp_path]).exit_code == 0
    (tmp_path / "INTERFACE.md").unlink()
    (tmp_path / "INTERFACE.md").mkdir()  # it comes last
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    assert invoke(["flight", "compensator", "--float", "32", "--out", tmp_path]).exit_code == 1
    assert {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


def test_a_file_in_the_store_that_is_read_is_refused(tmp_path):
    (tmp_path / "small.zarr").mkdir()
    (tmp_path / "small.zarr/zarr.json").write_text("{}")
    store = str(tmp_path / "small.zarr")
    result = invoke(["train", store, "--out", f"{store}/zarr.json"])
    assert result.exit_code == 1
    assert "which is an input" in result.stderr


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="lays a pipe as POSIX has them")
@pytest.mark.parametrize("command", [
    ["run", "pipe.toml", "--out", "out"],
    ["verify", "pipe.fmu"],
    ["identify", "pipe.csv", "--out", "out.json"],
    ["twin", "pipe.csv", "--out", "out.json"],
    ["assess", "pipe.json", "rec.csv", "--out", "out"],
])  # fmt: skip
def test_a_pipe_into_which_nobody_writes_is_refused_and_not_waited_for(record, command):
    """As anybody may lay one in a shared folder."""
    os.mkfifo(next(word for word in command if word.startswith("pipe")))
    done = subprocess.run(
        [sys.executable, "-m", "gossamer", *command], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 1
    assert "is a pipe" in " ".join((done.stdout + done.stderr).split())
    assert not Path("out").exists()


# --- killed, and on a full disk ---


@pytest.fixture(params=["identify", "train", "build"])
def prepared(request, record, few_cases):
    """The folder ``before`` with what an earlier command wrote, and a command that will replace all of it."""
    Path("before").mkdir()
    if request.param == "identify":
        shutil.copy("rec.csv", "before")
        earlier, command = [*IDENTIFY, "--ridge", "1e-3"], IDENTIFY
    elif request.param == "train":
        shutil.copytree(few_cases, "before", dirs_exist_ok=True)
        earlier, command = [*TRAIN, "--steps", "2"], TRAIN
    else:
        earlier, command = [*BUILD, "--native"], BUILD
    done = subprocess.run([sys.executable, "-m", "gossamer", *earlier], cwd="before", check=False)
    assert done.returncode == 0
    return command


def files(folder):
    """Return the content of the files in ``out`` by path; those that begin with a dot are nobody's result.

    Without the wall time on a page, which is another one in each run.
    """
    here = Path(folder, "out")
    paths = [path for path in here.rglob("[!.]*") if path.is_file()]
    return {path.relative_to(here): re.sub(rb"Wall time.*?</tr>", b"", path.read_bytes()) for path in paths}


def assert_nothing_is_damaged(folder):
    """Every file is the old or the new one, and artifacts and FMUs can be read."""
    before, complete, found = files("before"), files("complete"), files(folder)
    assert found.keys() >= before.keys()
    assert {name for name, content in found.items() if content not in (before.get(name), complete[name])} == set()
    for path in Path(folder, "out").glob("[!.]*"):
        if path.suffix == ".json":
            {"sensor": SensorArtifact, "small": PosteriorArtifact}[path.stem].read(path)
        elif path.suffix == ".fmu":
            check_archive(path)


def test_a_command_that_is_killed_or_lacks_space_damages_nothing(prepared, record_property, kills):
    times = kills or 4
    script = Path(__file__).with_name("disturbed_command.py")
    done = subprocess.run([sys.executable, script, "1", str(times), *prepared], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    alive = int(re.search(r"(\d+) of \d+ were alive", done.stdout)[1])
    assert alive == times // 2
    assert "File too large. Name another place with --out." in " ".join(done.stderr.split())
    assert files("before") != files("complete")
    killed, full = ([*Path().glob(name)] for name in ("killed_*", "full_*"))
    assert len({folder.name.split("_")[1] for folder in killed}) == times
    assert len(full) == min(times, 3)
    for folder in [*killed, *full]:
        assert_nothing_is_damaged(folder)
    hits = times - times // 2 + alive  # those that come as a name or a file changes all do
    record_property("kills", f"{len(killed)} kills, {hits} of a live process, {len(full)} full disks; 0 files lost")
