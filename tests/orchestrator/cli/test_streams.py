"""Whatever happens to the streams of a command, its results are whole, without a traceback; without a terminal too."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from functools import partial

import pytest
from gossamer_orchestrator import load_results

pytestmark = pytest.mark.skipif(os.name != "posix", reason="closes streams as a POSIX shell does")

SCENARIO = 'step = 0.01\nstop = 1.0\n[components.i]\nfmu = "integrator"\ninputs = { u = 1.0 }\n'
COMMAND = f"{sys.executable} -m gossamer run it.toml --fmus fmus --out out"
STREAMS = {  # codes of the command: 1 where an answer was lost, which a reader that leaves may have had whole
    "the reader of the answer leaves after a line": ("| head -n 1", (0, 1)),
    "nobody reads the answer": ("| true", (1,)),
    "stdout is closed": (">&-", (0,)),
    "stderr is closed": ("2>&-", (0,)),
    "all are closed": ("<&- >&- 2>&-", (0,)),
    "nobody reads what it tells": ("-v 2> >(true)", (0,)),
    "there is no space for what it tells": ("-v 2> /dev/full", (0,)),
    "there is no space for the answer": ("> /dev/full", (1,)),
}


@pytest.fixture
def folder(fmus, tmp_path):
    shutil.copytree(fmus, tmp_path / "fmus")
    (tmp_path / "it.toml").write_text(SCENARIO)
    return tmp_path


@pytest.mark.parametrize("how", STREAMS)
def test_results_are_whole_whatever_happens_to_its_streams(folder, how):
    redirected, codes = STREAMS[how]
    words = ["bash", "-c", f"set -o pipefail; {COMMAND} {redirected}"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode in codes
    assert "Traceback" not in done.stderr
    assert load_results(folder / "out").attrs["ended"] == "complete"
    assert (folder / "out/report.html").read_text(encoding="utf-8").rstrip().endswith("</html>")
    assert sorted(path.name for path in folder.iterdir()) == ["fmus", "it.toml", "out"]


def test_a_program_that_the_command_starts_has_streams_where_its_own_are_closed():
    """It inherits the numbers, and opens no file under them."""
    code = "import os, gossamer.__main__ as m; m.open_streams(); os._exit(sum(os.get_inheritable(n) for n in range(3)))"
    done = subprocess.run(["bash", "-c", f"{sys.executable} -c '{code}' <&- >&- 2>&-"], check=False)
    assert done.returncode == 3


def test_a_terminal_that_is_closed_ends_the_command_and_leaves_what_there_is(folder):
    """Its process is sent SIGHUP, and what it then writes to the terminal fails."""
    (folder / "it.toml").write_text(SCENARIO.replace("stop = 1.0", "stop = 100000.0"))
    ours, terminal = os.openpty()
    heard = partial(signal.signal, signal.SIGHUP, signal.SIG_DFL)  # also where the tests run under nohup
    streams = {"stdin": terminal, "stdout": terminal, "stderr": terminal}
    with subprocess.Popen(COMMAND.split(), cwd=folder, preexec_fn=heard, **streams) as process:
        try:
            os.close(terminal)
            while not (folder / "out/unfinished.nc").is_file():
                assert process.poll() is None
                time.sleep(0.05)
            time.sleep(1.0)
            os.close(ours)
            process.send_signal(signal.SIGHUP)
            assert process.wait(timeout=120) == 130
        finally:
            process.kill()
    assert load_results(folder / "out").attrs["ended"] == "interrupted"
