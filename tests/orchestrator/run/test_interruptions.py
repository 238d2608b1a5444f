"""Signals, kill -9, full disks and a second run: nothing that was good is damaged, what is readable is right."""

from __future__ import annotations

import errno
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import hostile as faults
import numpy as np
import psutil
import pytest
from gossamer_orchestrator import load_results, parse_scenario, run_scenario
from gossamer_orchestrator.run.folders import locked, scratch
from saving import save_results

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends signals as POSIX has them")

SCENARIO = """
step = 0.001
stop = 4.0
[components.a]
fmu = "wide"
parameters = {{ {parameters} }}
inputs = {{ u = 0.0 }}
[components.b]
fmu = "hostile"
[[connections]]
from = "a.y[1]"
to = "b.u"
noise = {{ kind = "normal", amplitude = 0.1, seed = 2 }}
dropout = {{ probability = 0.2, seed = 3 }}
[[events]]
time = 2.2
component = "a"
set = {{ u = 3.0 }}
[record]
variables = ["?.y*"]
"""
STOPS = f"fault = {faults.WAIT}, at = 2400, pause = 3e-4"  # in step 2400 it waits until there is a file called gate
LATE = f"fault = {faults.WAIT}, at = 3900, pause = 3e-4"


class Started:
    """``gossamer run`` of the scenario, as a process of its own."""

    def __init__(self, folder, fmus, parameters, *options):
        self.folder, self.out, self.gate = folder, folder / "out", folder / "gate"
        self.temporary = folder / "temporary"
        self.temporary.mkdir(exist_ok=True)
        (folder / "it.toml").write_text(SCENARIO.format(parameters=parameters))
        command = [sys.executable, "-m", "gossamer", "run", folder / "it.toml", "--fmus", fmus]
        self.process = subprocess.Popen(
            [*map(str, command), "--out", str(self.out), "--no-pictures", *map(str, options)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"TMPDIR": str(self.temporary), "HOSTILE_GATE": str(self.gate)},
        )

    def wait_for_rows(self, count=1):
        """Wait until so many rows are on the disk."""
        file = self.out / "unfinished.nc"
        self._wait(lambda: file.is_file() and int.from_bytes(file.read_bytes()[4:8], "big") >= count)

    def wait_at_gate(self):
        """Wait until the run has written all rows before the gate, and a state to resume from."""
        self.wait_for_rows(2401)
        assert (self.out / "unfinished.npz").is_file()

    def _child(self):
        (child,) = psutil.Process(self.process.pid).children()
        return child

    def _wait(self, condition):
        patience = time.monotonic() + 120.0  # as long as any machine may take
        while not condition():
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < patience
            time.sleep(0.02)

    def kill(self):
        """Kill everything at once."""
        for process in (*psutil.Process(self.process.pid).children(), self.process):
            process.kill()
        self.process.wait()

    def end(self):
        """Wait for its end; return its exit code and what it printed on stderr."""
        _, text = self.process.communicate(timeout=120)
        return self.process.returncode, text


@pytest.fixture
def start(hostile, tmp_path):
    """Start runs, and end what is left of them after the test."""
    started = []

    def begin(parameters, *options, folder=tmp_path):
        started.append(Started(folder, hostile, parameters, *options))
        return started[-1]

    yield begin
    for each in started:
        each.process.kill()
        each.process.communicate()


@pytest.fixture(scope="module")
def whole(hostile):
    """What the run gives if nothing disturbs it."""
    return run_scenario(parse_scenario(SCENARIO.format(parameters="")), hostile)


def assert_beginning_of(whole, data):
    """What is there is, to the bit, the beginning of the whole."""
    size = data.sizes["time"]
    for name in ("time", *whole.data_vars):
        assert np.array_equal(data[name].values, whole[name].values[:size])


@pytest.mark.parametrize(("number", "resumed"), [(signal.SIGINT, False), (signal.SIGTERM, True), (signal.SIGHUP, False)])
def test_a_signal_that_asks_for_the_end_keeps_the_results_and_the_run_resumes_to_the_bit(start, whole, number, resumed):
    before = signal.signal(number, signal.SIG_DFL)  # whoever runs the tests may ignore it: nohup, a shell's background job
    try:
        run = start(STOPS)
    finally:
        signal.signal(number, before)
    run.wait_for_rows()
    run.process.send_signal(number)
    run.gate.touch()
    code, text = run.end()
    assert code == 130
    assert "Continue the run with 'gossamer run --resume'." in text
    data = load_results(run.out)
    assert data.attrs["ended"] == "interrupted"
    assert 0 < data.sizes["time"] <= 2402
    assert_beginning_of(whole, data)
    assert list(run.temporary.iterdir()) == []
    if not resumed:
        return
    code, text = start(STOPS, "--resume").end()
    assert code == 0, text
    data = load_results(run.out)
    assert data.attrs["ended"] == "complete"
    assert data.sizes == whole.sizes
    assert_beginning_of(whole, data)
    assert sorted(path.name for path in run.out.iterdir()) == ["results.csv", "results.nc"]


def test_under_nohup_the_end_of_the_terminal_is_not_that_of_the_run(start, whole):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as a process begins that nohup starts
    try:
        run = start(STOPS)
    finally:
        signal.signal(signal.SIGHUP, before)
    run.wait_for_rows()
    run.process.send_signal(signal.SIGHUP)
    run.gate.touch()
    assert run.end()[0] == 0
    assert load_results(run.out).sizes == whole.sizes


def test_what_a_killed_writer_left_in_the_folder_is_removed_at_the_next_start(tmp_path):
    left, other = tmp_path / ".results.0123abcd.unfinished.csv", tmp_path / ".watch.0123abcd.unfinished.json"
    for path in (left, other):
        path.write_text("hal")
    with locked(tmp_path):
        assert list(tmp_path.iterdir()) == [other]  # that of another command


def test_only_temporary_folders_that_runs_left_are_removed(tmp_path, monkeypatch):
    """Not a folder of a user, a pipe, a link to a folder, or what a run has that lives."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    mine, pipe, link = (tmp_path / f"gossamer-run-{name}" for name in ("mine", "pipe", "link"))
    with scratch() as left:
        shutil.copytree(left, tmp_path / "gossamer-run-left")
    mine.mkdir()
    (mine / "thesis").write_text("years")
    os.mkfifo(pipe)
    shutil.copytree(tmp_path / "gossamer-run-left", tmp_path / "elsewhere")
    link.symlink_to(tmp_path / "elsewhere")
    with scratch() as live, scratch() as another:
        assert sorted(tmp_path.iterdir()) == sorted([mine, pipe, link, tmp_path / "elsewhere", live, another])
        assert list((tmp_path / "elsewhere").iterdir())
        assert (mine / "thesis").read_text() == "years"


def test_where_the_file_system_has_no_locks_no_temporary_folder_is_removed(tmp_path, monkeypatch):
    def flock(_handle, _how):
        raise OSError(errno.ENOLCK, "no locks available")

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr("fcntl.flock", flock)
    with scratch() as live, scratch():
        assert live.is_dir()
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_ends_a_run_whose_fmu_hangs(start, whole):
    run = start(f"fault = {faults.HANG}, at = 2400")
    run.wait_for_rows()
    run.process.send_signal(signal.SIGINT)
    code, text = run.end()
    assert code == 130
    assert "component 'a' did not return in the step from t = 2.4 s" in text
    assert_beginning_of(whole, load_results(run.out))
    assert load_results(run.out).sizes["time"] == 2401


def test_after_kill_9_at_any_moment_what_was_written_is_right_and_earlier_results_are_as_they_were(
    start, whole, caplog, kills
):
    """Kills of the program and of the process of the run, most of them followed by --resume, then to the end."""
    moments, options, times = random.Random(11), [], kills or 3
    for number in range(times):
        run = start(LATE, *options)
        run.wait_for_rows()
        time.sleep(moments.uniform(0.0, 1.5))
        run.kill()
        data = load_results(run.out)
        assert data.attrs["ended"] == "unfinished"
        assert "unfinished.nc is of a run that has not finished." in caplog.text
        assert_beginning_of(whole, data)
        anew = number % 3 == 2 and number < times - 1  # or many kills would outlast the run
        options = ["--resume"] if (run.out / "unfinished.npz").is_file() and not anew else []
    run = start(LATE, *options)
    run.gate.touch()
    code, text = run.end()
    assert code == 0, text
    data = load_results(run.out)
    assert data.sizes == whole.sizes
    assert_beginning_of(whole, data)
    assert list(run.temporary.iterdir()) == []  # the next start removes what the killed ones left


def test_earlier_results_stay_until_a_run_has_ended(start, whole):
    run = start(STOPS)
    save_results(whole, run.out)
    earlier = (run.out / "results.nc").read_bytes(), (run.out / "results.csv").read_bytes()
    run.wait_for_rows()
    run.kill()
    assert ((run.out / "results.nc").read_bytes(), (run.out / "results.csv").read_bytes()) == earlier
    assert load_results(run.out).attrs["ended"] == "complete"
    assert load_results(run.out / "unfinished.nc").attrs["ended"] == "unfinished"


@pytest.mark.parametrize(("end", "code", "ended"), [
    (signal.SIGINT, 130, "interrupted"),
    (signal.SIGTERM, 130, "interrupted"),
    ("its FMU fails", 1, "component 'a' crashed"),
])  # fmt: skip
def test_a_complete_run_is_replaced_by_a_complete_one_only(start, whole, end, code, ended):
    """With all that was made of it; the other one goes on from where it was, and then takes its place."""
    run = start(STOPS if isinstance(end, signal.Signals) else f"fault = {faults.ABORT}, at = 2400")
    save_results(whole, run.out)
    for name in ("report.html", "strains.png", "twin.json", "watch.json", "messages.txt"):
        (run.out / name).write_text(f"of the complete run: {name}")
    (run.out / "mine.png").write_text("a user's")
    before = {path: path.read_bytes() for path in run.out.iterdir()}
    if isinstance(end, signal.Signals):
        run.wait_for_rows()
        run.process.send_signal(end)
        run.gate.touch()
    found, text = run.end()
    assert found == code, text
    assert f"{run.out / 'results.nc'} is of an earlier run." in text
    after = {path: path.read_bytes() for path in run.out.iterdir() if not path.name.startswith("unfinished")}
    assert after == before
    unfinished = load_results(run.out / "unfinished.nc")
    assert unfinished.attrs["ended"].startswith(ended)
    assert_beginning_of(whole, unfinished)
    assert load_results(run.out).attrs["ended"] == "complete"
    if end == signal.SIGTERM:
        code, text = start(STOPS, "--resume").end()
        assert code == 0, text
        assert sorted(path.name for path in run.out.iterdir()) == ["mine.png", "results.csv", "results.nc"]
        assert_beginning_of(whole, load_results(run.out))


@pytest.mark.parametrize("is_run", [True, False])
def test_what_a_twin_found_of_earlier_results_goes_with_them_but_no_run_that_is_called_so(fmus, tmp_path, is_run):
    for name in ("twin.json", "twin/report.html", *["twin/results.nc"] * is_run, "results/report.html"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    text = "step = 0.1\nstop = 0.1\n[components.a]\nfmu = 'integrator'\ninputs = { u = 1 }\n"
    run_scenario(parse_scenario(text), fmus, tmp_path)
    there = {name: (tmp_path / name).exists() for name in ("twin.json", "twin/report.html", "results/report.html")}
    assert there == {"twin.json": False, "twin/report.html": is_run, "results/report.html": True}


def test_when_the_process_of_the_run_is_killed_the_program_says_so_and_keeps_the_results(start, whole):
    run = start(STOPS)
    run.wait_at_gate()
    run._child().kill()
    code, text = run.end()
    assert code == 1
    assert "component 'a' had its process killed (SIGKILL) in the step from t = 2.4 s. Was there enough memory?" in text
    assert load_results(run.out).sizes["time"] == 2401
    assert_beginning_of(whole, load_results(run.out))


def test_a_second_run_into_one_folder_is_refused(start):
    run = start(STOPS)
    run.wait_for_rows()
    code, text = start(STOPS).end()
    assert (code, text) == (1, f"another run writes to {run.out}. Wait for its end, or name another place with --out.\n")
    run.gate.touch()
    assert run.end()[0] == 0


# --- a full disk ---


@pytest.fixture
def disk(tmp_path):
    """Mount a disk of some size [MB] as a folder."""
    mounted = []

    def mount(size):
        folder = tmp_path / f"disk{len(mounted)}"
        folder.mkdir()
        command = ["mount", "-t", "tmpfs", "-o", f"size={int(1e6 * size)}", "tmpfs", str(folder)]
        if not shutil.which("mount") or subprocess.run(command, capture_output=True, check=False).returncode:
            pytest.skip("mounting a small disk is not allowed here")
        mounted.append(folder)
        return folder

    yield mount
    for folder in mounted:
        subprocess.run(["umount", str(folder)], check=True)


def fill(path):
    """Fill a disk with a file, to the last byte."""
    size = 4096
    with path.open("wb", buffering=0) as file:
        while size:
            try:
                file.write(bytes(size))
            except OSError:
                size //= 2


def test_results_larger_than_the_disk_are_refused_before_the_run(hostile, disk):
    out = disk(0.5)
    scenario = parse_scenario(SCENARIO.format(parameters=""))
    with pytest.raises(Exception, match=r"21 scalars at 4001 points take 0.000704 GB, and .* has .* GB free"):
        run_scenario(scenario, hostile, out)
    assert list(out.iterdir()) == []


@pytest.mark.parametrize("size", [1.0, 1.5])
def test_where_the_csv_file_does_not_fit_the_netcdf_file_is_complete(hostile, disk, whole, size):
    out = disk(size)
    with pytest.raises(Exception, match=r"results.csv would take about 1.76 MB, and .* are free. It was not written."):
        run_scenario(parse_scenario(SCENARIO.format(parameters="")), hostile, out)
    assert [path.name for path in out.iterdir()] == ["results.nc"]
    assert load_results(out).attrs["ended"] == "complete"
    assert_beginning_of(whole, load_results(out))


@pytest.mark.parametrize("size", [3.0])
def test_a_disk_that_fills_during_the_run_keeps_what_was_there_and_the_run_resumes(start, disk, whole, tmp_path, size):
    out = tmp_path / "out"
    out.symlink_to(disk(size))
    save_results(whole.isel(time=slice(5)), out)
    earlier = (out / "results.nc").read_bytes(), (out / "results.csv").read_bytes()
    run = start(STOPS)
    run.wait_at_gate()
    fill(out / "ballast")
    run.gate.touch()
    code, text = run.end()
    assert code == 1
    assert f"cannot write {out / 'unfinished.nc'}: No space left on device." in text
    assert ((out / "results.nc").read_bytes(), (out / "results.csv").read_bytes()) == earlier
    assert_beginning_of(whole, load_results(out / "unfinished.nc"))
    assert load_results(out / "unfinished.nc").sizes["time"] >= 2401
    (out / "ballast").unlink()
    code, text = start(STOPS, "--resume").end()
    assert code == 0, text
    assert_beginning_of(whole, load_results(out))
    assert load_results(out).sizes == whole.sizes
