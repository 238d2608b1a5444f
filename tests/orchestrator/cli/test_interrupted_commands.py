"""A signal that asks for the end ends every command with a sentence, at any moment; what it leaves is of one command."""

from __future__ import annotations

import json
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke, wait_for_work
from gossamer.__main__ import INTERRUPTED, interrupt
from gossamer_files import ending_signals
from gossamer_orchestrator import load_results

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends signals as POSIX has them")

CAMPAIGN = "cases = 64\nseed = 3\nstop = 0.06\n[damage]\nzones = [1, 2]\ndepth = [0.3, 0.5]\nhealthy = 0.1\n"
SCENARIO = 'step = 0.01\nstop = 20.0\n[components.i]\nfmu = "integrator"\ninputs = { u = 1.0 }\n'
FITS = ("identify", "twin")
COMMANDS = {
    "build": ["build", "sensor", "compensator", "--out", "out"],
    "identify": ["identify", "rec.csv", "--modes", "2", "--relaxations", "0", "--starts", "1", "--out", "out/sensor.json"],
    "twin": ["twin", "twin.csv", "--order", "1", "--out", "out/twin.json"],
    "watch": ["watch", "twin.csv", "--order", "1", "--out", "out/watch.json"],
    "train": ["train", "few.zarr", "--window", "0.03", "--steps", "1", "--start", "start.json", "--out", "out/small.json"],
    "campaign": ["campaign", "small.toml", "--workers", "1", "--out", "out/small.zarr"],
    "report": ["report", "results"],
    "sweep": ["sweep", "it.toml", "--fmus", "fmus", "--set", "i.u=1:3", "--out", "out/swept"],
    "run": ["run", "it.toml", "--fmus", "fmus", "--out", "results"],
}
LIFE = 3.0  # [s] of the processor, where the whole of it is not measured
EARLIER = 6  # tries to interrupt a command before it ends, each after half the work


@pytest.fixture(scope="module")
def prepared(fmus, few_cases, tmp_path_factory):
    """A folder with what the commands read, and what they wrote before."""
    folder = tmp_path_factory.mktemp("prepared")
    shutil.copytree(few_cases, folder, dirs_exist_ok=True)
    (folder / "fmus").mkdir()
    shutil.copy(fmus / "integrator.fmu", folder / "fmus")
    (folder / "it.toml").write_text(SCENARIO)
    (folder / "small.toml").write_text(CAMPAIGN)
    time = 0.5 * np.arange(200)
    strain = 0.04 * (1.0 - np.cos(0.25 * time)) * (0.5 + time / 240.0)
    rows = np.column_stack([time, strain, 100.0 + 400.0 * strain + 0.01 * time])
    np.savetxt(folder / "rec.csv", rows, delimiter=",", header="time_s,strain [1],R_ohm", comments="")
    strains = 1e-5 * np.random.default_rng(1).normal(size=(500, 4)) + 1e-3
    table = np.column_stack([3e-4 * np.arange(1, 501), strains])
    names = ",".join(f"strain[{k}] [1]" for k in range(1, 5))
    np.savetxt(folder / "twin.csv", table, delimiter=",", header=f"time [s],{names}", comments="")
    done = invoke(["run", folder / "it.toml", "--fmus", folder / "fmus", "--out", folder / "results"])
    assert done.exit_code == 0, done.stderr
    assert invoke(["build", "sensor", "compensator", "--native", "--out", folder / "out"]).exit_code == 0
    return folder


def kinds(folder):
    """Return which kinds of FMUs are in a folder; one that is not whole cannot be read."""
    members = [zipfile.ZipFile(path).namelist() for path in sorted(folder.glob("*.fmu"))]
    return {any(name.startswith("sources/") for name in names) for names in members}, len(members)


def test_an_interrupt_waits_until_casadi_has_returned():
    """Its C++ calls Python, where an exception was lost, or ended the program with a traceback."""
    before, reached = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGALRM)}, []
    text = "signal.raise_signal(signal.SIGINT)\nreached.append('inside')"

    def work():
        exec(compile(text, "casadi/casadi.py", "exec"), {"signal": signal, "reached": reached})
        time.sleep(1e6)

    signal.signal(signal.SIGINT, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for each, handler in before.items():
            signal.signal(each, handler)
    assert reached == ["inside"]


@pytest.mark.parametrize("passes_over", [
    "def __del__(self): signal.raise_signal(signal.SIGTERM)",
    "def __init__(self): weakref.finalize(self, signal.raise_signal, signal.SIGINT)",
    """def __init__(self):
        with contextlib.suppress(BaseException): signal.raise_signal(signal.SIGTERM)""",
])  # fmt: skip
def test_an_interrupt_is_not_lost_where_python_passes_over_exceptions(passes_over):
    """In a destructor or the callback of a weak reference one was forgotten, with a traceback, and the command went on."""
    code = (
        "import contextlib, signal, time, weakref\nimport gossamer.__main__ as program, gossamer.cli\n"
        f"program.LOST = {0.1 if 'suppress' in passes_over else 1e6}\n"
        f"class Ends:\n    {passes_over}\n"
        "def command():\n    Ends()\n    time.sleep(1e6)\n"
        "gossamer.cli.main = command\nprogram.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 130
    assert done.stderr == "Interrupted.\n"


def test_an_interrupt_of_which_python_makes_another_error_ends_the_command_with_a_sentence():
    """As while it imports a class, whose names tell that class of themselves."""
    code = (
        "import signal\nimport gossamer.__main__ as program, gossamer.cli\n"
        "class Name:\n    def __set_name__(self, owner, name): signal.raise_signal(signal.SIGTERM)\n"
        "def command():\n    type('Owner', (), {'name': Name()})\n"
        "gossamer.cli.main = command\nprogram.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 130
    assert done.stderr == "Interrupted.\n"


def wait_until_it_listens(process):
    """Return once a process has a handler of its own for SIGTERM: on a busy machine Python takes seconds to begin."""
    status = Path(f"/proc/{process.pid}/status")
    if not status.is_file():
        time.sleep(1.5)
    while status.is_file() and process.poll() is None:
        with suppress(OSError):  # it has just ended
            if int(status.read_text().split("SigCgt:")[1].split()[0], 16) >> (signal.SIGTERM - 1) & 1:
                return
        time.sleep(0.01)


def start(name, prepared, folder):
    """Start a command in a copy of the folder that was prepared."""
    shutil.copytree(prepared, folder)
    command = [sys.executable, "-m", "gossamer", *COMMANDS[name]]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def life(name, prepared, folder):
    """Return the work [s] of a command that nobody interrupts."""
    process = start(name, prepared, folder)
    with ThreadPoolExecutor(1) as reader:
        told = reader.submit(process.communicate)
        done = wait_for_work(process.pid, math.inf)
        assert process.wait() in (0, 3), told.result()
    return done


def interrupt_at(process, work, pauses, kind):
    """Send signals to a command once it has done some work; return whether it was alive, and what it wrote to stderr."""
    with ThreadPoolExecutor(1) as reader:
        told = reader.submit(process.communicate)
        wait_until_it_listens(process)
        wait_for_work(process.pid, work)
        alive = process.poll() is None
        for pause in pauses:
            time.sleep(pause)
            process.send_signal(kind)
        try:
            process.wait(120)
        finally:
            process.kill()
        return alive, told.result()[1]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_is_interrupted_says_so_and_leaves_no_mixture(prepared, tmp_path, record_property, kills, name):
    """By one signal or by two, 20 to 150 ms apart, at any time of its life; a fit is interrupted twice as often."""
    draw, times = random.Random(name), (kills or 1) * (1 + (name in FITS))
    whole = life(name, prepared, tmp_path / "whole") if kills else LIFE
    sent = 0
    for number in range(times):
        moment, ended_before = whole * (number + draw.random()) / times, True
        kind, pauses = draw.choice(ending_signals()), [0.0, draw.uniform(0.02, 0.15)][: draw.randint(1, 2)]
        for again in range(EARLIER):
            folder = tmp_path / f"{number}_{again}"
            process = start(name, prepared, folder)
            alive, text = interrupt_at(process, moment / 2.0**again, pauses, kind)
            assert_nothing_is_mixed(name, prepared, folder, process.returncode, text)
            shutil.rmtree(folder)
            sent += 1
            ended_before = not alive or process.returncode != INTERRUPTED
            if not ended_before:
                break
        assert not ended_before, f"it had always ended before: {text}"
    record_property(
        "kills", f"{sent} interrupts, {times} of a live process, at any time of {whole:.1f} s of work; 0 files lost"
    )


def assert_nothing_is_mixed(name, prepared, folder, code, text):
    """Look at what an interrupted command said and left."""
    assert code in (0, 3, INTERRUPTED), text
    assert "Traceback" not in text
    assert code != INTERRUPTED or "nterrupted" in text or "Results until" in text, text
    assert kinds(folder / "out") in (({True}, 2), ({False}, 2))
    for artifact in (folder / "out").glob("*.json"):
        json.loads(artifact.read_text(encoding="utf-8"))
    if name == "run":  # of this one if it was interrupted while it drew
        assert load_results(folder / "results/results.nc").attrs["ended"] == "complete"
    else:
        assert (folder / "results/results.nc").read_bytes() == (prepared / "results/results.nc").read_bytes()
    for page in folder.rglob("report.html"):
        assert page.read_text(encoding="utf-8").rstrip().endswith("</html>")
    assert [path for path in folder.rglob(".*.unfinished*") if "zarr" not in str(path)] == []
