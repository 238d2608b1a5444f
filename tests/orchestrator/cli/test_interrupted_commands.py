"""A signal that asks for the end ends every command with a sentence, at any moment; what it leaves is of one command."""

from __future__ import annotations

import itertools
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from gossamer.__main__ import interrupt
from gossamer_orchestrator import load_results

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends signals as POSIX has them")

CAMPAIGN = "cases = 64\nseed = 3\nstop = 0.06\n[damage]\nzones = [1, 2]\ndepth = [0.3, 0.5]\nhealthy = 0.1\n"
SCENARIO = 'step = 0.01\nstop = 20.0\n[components.i]\nfmu = "integrator"\ninputs = { u = 1.0 }\n'
FITS = ("identify", "twin")
COMMANDS = {
    "build": ["build", "sensor", "compensator", "--out", "out"],
    "identify": ["identify", "rec.csv", "--modes", "2", "--relaxations", "0", "--out", "out/sensor.json"],
    "twin": ["twin", "twin.csv", "--out", "out/twin.json"],
    "campaign": ["campaign", "small.toml", "--workers", "1", "--out", "out/small.zarr"],
    "report": ["report", "results"],
    "sweep": ["sweep", "it.toml", "--fmus", "fmus", "--set", "i.u=1:8", "--out", "out/swept"],
    "run": ["run", "it.toml", "--fmus", "fmus", "--out", "results"],
}


@pytest.fixture(scope="module")
def prepared(fmus, tmp_path_factory):
    """A folder with what the commands read, and what they wrote before."""
    folder = tmp_path_factory.mktemp("prepared")
    shutil.copytree(fmus, folder / "fmus")
    (folder / "it.toml").write_text(SCENARIO)
    (folder / "small.toml").write_text(CAMPAIGN)
    time = 0.5 * np.arange(2000)
    strain = 0.04 * (1.0 - np.cos(0.25 * time)) * (0.5 + time / 2400.0)
    rows = np.column_stack([time, strain, 100.0 + 400.0 * strain + 0.01 * time])
    np.savetxt(folder / "rec.csv", rows, delimiter=",", header="time_s,strain [1],R_ohm", comments="")
    strains = 1e-5 * np.random.default_rng(1).normal(size=(1000, 4)) + 1e-3
    table = np.column_stack([3e-4 * np.arange(1, 1001), strains])
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
        time.sleep(60.0)

    signal.signal(signal.SIGINT, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for each, handler in before.items():
            signal.signal(each, handler)
    assert reached == ["inside"]


def wait_until_it_listens(process):
    """Return once a process has a handler of its own for SIGTERM: on a busy machine Python takes seconds to begin."""
    status = Path(f"/proc/{process.pid}/status")
    if not status.is_file():
        time.sleep(1.5)
    while status.is_file() and process.poll() is None:
        if int(status.read_text().split("SigCgt:")[1].split()[0], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.01)


def test_an_interrupt_is_not_lost_where_python_passes_over_exceptions():
    """In a destructor one was forgotten, and the command went on."""
    code = (
        "import signal, time\nimport gossamer.__main__ as program, gossamer.cli\nprogram.LOST = 0.1\n"
        "class Ends:\n    def __del__(self): signal.raise_signal(signal.SIGTERM)\n"
        "def command():\n    Ends()\n    time.sleep(60.0)\n"
        "gossamer.cli.main = command\nprogram.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 130
    assert done.stderr.endswith("\nInterrupted.\n")


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_is_interrupted_says_so_and_leaves_no_mixture(prepared, tmp_path, kills, name):
    """By one signal or by two, 20 to 150 ms apart, at any time of its life; a fit is interrupted twice as often."""
    moments, reach, hits = random.Random(name), 4.5, 0
    for number in itertools.count(len(name)):
        if number - len(name) >= (kills or 1) * (1 + (name in FITS)) and hits:
            break
        assert number < len(name) + 10 or hits, "it had always ended before"
        folder = tmp_path / str(number)
        shutil.copytree(prepared, folder)
        before = (folder / "results/results.nc").read_bytes()
        kind = signal.SIGINT if number % 2 else signal.SIGTERM
        process = subprocess.Popen(
            [sys.executable, "-m", "gossamer", *COMMANDS[name]],
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        wait_until_it_listens(process)
        begun = time.monotonic()
        with suppress(subprocess.TimeoutExpired):
            process.wait(moments.uniform(0.0, reach))
            reach = 0.9 * (time.monotonic() - begun)
        alive = process.poll() is None
        for pause in (0.0, moments.uniform(0.02, 0.15))[: 1 + number % 2]:
            time.sleep(pause)
            process.send_signal(kind)
        _, text = process.communicate(timeout=120)
        assert process.returncode in (0, 130), text
        assert "Traceback" not in text
        hits += alive and process.returncode == 130
        assert process.returncode == 0 or "nterrupted" in text or "Results until" in text, text
        assert kinds(folder / "out") in (({True}, 2), ({False}, 2))
        if name == "run":  # of this one if it was interrupted while it drew
            assert load_results(folder / "results/results.nc").attrs["ended"] == "complete"
        else:
            assert (folder / "results/results.nc").read_bytes() == before
        page = folder / "results/report.html"
        assert not page.is_file() or page.read_text(encoding="utf-8").rstrip().endswith("</html>")
        assert [path for path in Path(folder).rglob(".*.unfinished*") if "zarr" not in str(path)] == []
