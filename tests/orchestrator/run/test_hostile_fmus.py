"""Whatever an FMU does, a run ends with its name and time, and what was simulated is on the disk."""

from __future__ import annotations

import subprocess
import sys

import hostile as faults
import numpy as np
import psutil
import pytest
from command_line import invoke
from gossamer_orchestrator import (
    ResultsError,
    ScenarioError,
    Simulation,
    SimulationError,
    load_results,
    load_scenario,
    make_plan,
    run_scenario,
)
from gossamer_orchestrator.run.runner import validate_scenario
from gossamer_orchestrator.run.stream import digests, save_checkpoint


def assert_right_until(data, stop):
    """Rows from the start to ``stop``, each as the FMU's closed form says: the state grows by h (1 + u) in a step."""
    time = data["time"].values
    assert time.tolist() == [k * 0.001 for k in range(len(time))]
    assert time[-1] == pytest.approx(stop)
    assert data["good.y"].values == pytest.approx(2.0 * time[:, None], abs=1e-12)
    assert data["bad.y"].values == pytest.approx(time[:, None], abs=1e-12)


@pytest.mark.parametrize(
    ("fault", "what"),
    [
        (faults.EXIT, r"ended the process with exit code 0"),
        (faults.SEGFAULT, r"crashed the process \(SIG(SEGV|BUS)\)"),
        (faults.ABORT, r"crashed the process \(SIGABRT\)"),
        (faults.OVERFLOW, r"crashed the process \(SIG(SEGV|BUS)\)"),
        (faults.HANG, r"did not return within 0.5 s"),
    ],
)
def test_an_fmu_that_ends_its_process_or_hangs_is_named_with_the_time_and_results_are_kept(
    hostile, beside, tmp_path, fault, what
):
    with pytest.raises(SimulationError, match=rf"^component 'bad' {what} in the step from t = 0.021 s\. ") as caught:
        run_scenario(beside(f"fault = {fault}, at = 21"), hostile, tmp_path, limit=0.5)
    assert (caught.value.component, caught.value.time) == ("bad", pytest.approx(0.021))
    assert f"Results until t = 0.021 s are in {tmp_path}." in caught.value.__notes__
    data = load_results(tmp_path)
    assert data.attrs["ended"] == str(caught.value)
    assert_right_until(data, 0.021)
    assert len((tmp_path / "results.csv").read_text().splitlines()) == 1 + data.sizes["time"]


def test_one_of_several_that_step_at_once_is_named_with_the_others(hostile, beside, tmp_path):
    with pytest.raises(SimulationError, match=r"^component '(good or bad|bad or good)' crashed .* from t = 0.021 s\. "):
        run_scenario(beside(f"fault = {faults.SEGFAULT}, at = 21"), hostile, tmp_path, threads=2)
    assert_right_until(load_results(tmp_path), 0.021)


def test_an_fmu_that_hangs_in_its_instantiation_is_named(hostile, beside, tmp_path):
    message = f"component '{faults.SLEEPER}' did not return within 0.5 s when it was instantiated"
    with pytest.raises(SimulationError, match=message):
        run_scenario(beside(name=faults.SLEEPER), hostile, tmp_path / "out", limit=0.5)
    assert not (tmp_path / "out").exists()  # there is nothing to keep
    with pytest.raises(SimulationError, match=message):
        validate_scenario(beside(name=faults.SLEEPER), hostile, limit=0.5)


@pytest.mark.parametrize(("fault", "value"), [(faults.NAN, "nan"), (faults.INFINITE, "inf")])
def test_the_first_value_that_is_not_finite_is_named_once(hostile, beside, tmp_path, caplog, fault, value):
    data = run_scenario(beside(f"fault = {fault}, at = 20"), hostile, tmp_path)
    (record,) = caplog.records
    assert record.getMessage().startswith(f"component 'bad' returned y[1] = {value} at t = 0.021 s.")
    assert data.attrs["ended"] == "complete"
    assert not np.isfinite(data["bad.y"].values[-1, 0])


def test_a_run_with_values_that_are_not_finite_ends_with_exit_code_3_and_says_so(hostile, tmp_path):
    text = 'step = 0.001\nstop = 0.03\n[components.bad]\nfmu = "hostile"\n'
    (tmp_path / "it.toml").write_text(f"{text}parameters = {{ fault = {faults.NAN}, at = 20 }}\ninputs = {{ u = 0.0 }}\n")
    result = invoke(["run", tmp_path / "it.toml", "--fmus", hostile, "--out", tmp_path / "out"])
    assert result.exit_code == 3
    assert "1 component had values that are not finite, see messages.txt: what follows means nothing." in result.stderr
    assert "'bad' returned y[1] = nan at t = 0.021 s" in (tmp_path / "out/messages.txt").read_text()
    assert "No valid judgement" in (tmp_path / "out/report.html").read_text()


@pytest.mark.parametrize(("options", "fault", "why"), [
    ((), faults.REFUSE, "component 'next' failed"), (("--strict",), 0, "component 'bad' returned y[1] = nan at t = 0.021 s"),
])  # fmt: skip
def test_a_run_that_ends_because_of_them_ends_with_exit_code_3_too(hostile, tmp_path, options, fault, why):
    (tmp_path / "it.toml").write_text(
        f'step = 0.001\nstop = 0.03\n[components.bad]\nfmu = "hostile"\ninputs = {{ u = 0.0 }}\n'
        f"parameters = {{ fault = {faults.NAN}, at = 20 }}\n"
        f'[components.next]\nfmu = "hostile"\nparameters = {{ fault = {fault} }}\n'
        '[[connections]]\nfrom = "bad.y[1]"\nto = "next.u"\n'
    )
    result = invoke(["run", tmp_path / "it.toml", "--fmus", hostile, "--out", tmp_path / "out", *options])
    assert result.exit_code == 3, result.output
    assert why in result.stderr
    assert "component 'bad' returned y[1] = nan" in result.stderr


def test_strict_ends_the_run_there(hostile, beside, tmp_path):
    with pytest.raises(SimulationError, match=r"'bad' returned y\[1\] = nan at t = 0.021 s"):
        run_scenario(beside(f"fault = {faults.NAN}, at = 20"), hostile, tmp_path, strict=True)
    assert load_results(tmp_path).sizes["time"] == 22


@pytest.mark.parametrize("fault", [faults.CRASH_WHEN_FREED])
def test_a_fault_after_the_run_is_a_warning(hostile, beside, tmp_path, caplog, fault):
    data = run_scenario(beside(f"fault = {fault}, at = 21"), hostile, tmp_path)
    assert data.attrs["ended"] == "complete"
    assert "component 'bad' crashed the process (SIGABRT) when it was freed" in caplog.text


@pytest.mark.skipif(not hasattr(psutil.Process, "rlimit"), reason="looks for orphans as Linux names them")
@pytest.mark.parametrize("fault", [faults.FORK, faults.DAEMON, faults.COPY], ids=["child", "daemon", "copy"])
def test_what_an_fmu_starts_ends_with_the_run_and_touches_no_results(hostile, beside, tmp_path, monkeypatch, fault):
    """A child; a daemon, which has left the group; and a copy of the process that returns from the step, too."""
    monkeypatch.setenv("OF_THIS_TEST", str(tmp_path))
    data = run_scenario(beside(f"fault = {fault}, at = 21"), hostile, tmp_path)
    assert_right_until(data, 0.1)
    assert data.sizes["time"] == 101
    assert [process for process in psutil.process_iter() if environment(process) == str(tmp_path)] == []


@pytest.mark.skipif(sys.platform == "win32", reason="its FMU writes as Linux does")
def test_an_fmu_that_writes_to_every_open_file_changes_neither_reports_nor_results(hostile, beside, tmp_path, caplog):
    data = run_scenario(beside(f"fault = {faults.WRITE}, at = 21"), hostile, tmp_path)
    assert_right_until(data, 0.1)
    assert data.attrs["ended"] == "complete"
    assert caplog.text == ""


def environment(process):
    try:
        return process.environ().get("OF_THIS_TEST")
    except psutil.Error:
        return None


@pytest.mark.skipif(sys.platform != "linux", reason="of /proc")
def test_memory_does_not_grow_with_the_run(hostile, tmp_path):
    """Peak of the process of a run, with twenty variables and noise, and of its program: 10,000 and 150,000 steps [MB]."""
    peaks = []
    for steps in (10_000, 150_000):
        text = (
            f'step = 0.5\nstop = {0.5 * steps}\n[components.a]\nfmu = "wide"\ninputs = {{ u = 0.0 }}\n[components.b]\n'
            'fmu = "hostile"\n[[connections]]\nfrom = "a.y[1]"\nto = "b.u"\nnoise = { kind = "normal", amplitude = 0.1 }\n'
            'dropout = { probability = 0.1 }\n[record]\nvariables = ["a.y*"]\n'
        )
        (tmp_path / "it.toml").write_text(text)
        code = (
            "import resource, sys\nfrom gossamer_orchestrator import run_scenario\n"  # no guard of the main module
            f"data = run_scenario({str(tmp_path / 'it.toml')!r}, {str(hostile)!r}, {str(tmp_path / 'out')!r}, csv=False)\n"
            "print(data.sizes['time'], resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)\n"
            "print(*open('/proc/self/status').read().split('VmHWM:')[1].split()[:1])"  # the other one inherits its parent's
        )
        (tmp_path / "script.py").write_text(code)
        done = subprocess.run([sys.executable, tmp_path / "script.py"], capture_output=True, text=True, check=True)
        rows, *of_both = done.stdout.split()
        assert int(rows) == steps + 1
        peaks.append([float(each) / 1024 for each in of_both])
    (run, program), (longer, its_program) = peaks
    assert longer < min(200.0, run + 5.0)  # the table of the longer run has 25 MB
    assert its_program < min(200.0, program + 5.0)


def test_who_gets_ready_for_the_end_of_a_run_is_called_once_and_soon_in_a_short_one(hostile, beside, tmp_path, monkeypatch):
    called = []
    run_scenario(beside(), hostile, tmp_path, soon=lambda: called.append(1))
    assert called == [1]
    monkeypatch.setattr("gossamer_orchestrator.run.process.FEW", 0)
    monkeypatch.setattr("gossamer_orchestrator.run.process.SOON", -1.0)
    run_scenario(beside(), hostile, tmp_path, soon=lambda: called.append(2))
    assert called == [1]


def test_a_state_that_no_fmu_can_serialize_or_that_is_of_another_run_is_refused(hostile, beside, fmus, chain, tmp_path):
    with pytest.raises(ScenarioError, match=r"^gain, integrator cannot serialize their state .* cannot be resumed"):
        run_scenario(chain(), fmus, tmp_path / "a", resume=True)
    with pytest.raises(ResultsError, match=r"^there is no unfinished run in .* to resume. Run it from its start"):
        run_scenario(beside(), hostile, tmp_path / "b", resume=True)
    plan = make_plan(beside(), hostile)
    with Simulation(plan) as simulation:
        save_checkpoint(tmp_path / "unfinished.npz", simulation, 0, digests(plan))
    with pytest.raises(ScenarioError, match=r"^the scenario differs from the unfinished run in "):
        run_scenario(beside("at = 1"), hostile, tmp_path, resume=True)


def test_a_run_is_not_resumed_with_another_file_of_inputs_and_one_that_replaces_it_says_so(hostile, tmp_path, caplog):
    text = 'step = 0.5\nstop = 1.0\n[components.a]\nfmu = "hostile"\n[[inputs]]\nto = "a.u"\nfile = "u.csv"\ncolumn = "u"\n'
    (tmp_path / "it.toml").write_text(text)
    (tmp_path / "u.csv").write_text("t,u\n0,1\n1,2\n")
    out, scenario = tmp_path / "out", load_scenario(tmp_path / "it.toml")
    out.mkdir()
    plan = make_plan(scenario, hostile)
    with Simulation(plan) as simulation:
        save_checkpoint(out / "unfinished.npz", simulation, 0, digests(plan))
    (tmp_path / "u.csv").write_text("t,u\n0,1\n1,3\n")
    with pytest.raises(ScenarioError, match=r"^file 'u.csv' differs from the unfinished run in "):
        run_scenario(scenario, hostile, out, resume=True)
    run_scenario(scenario, hostile, out)
    assert [record.getMessage() for record in caplog.records] == [
        f"the unfinished run in {out} is replaced by this one. resume=True continues a run"
    ]
    caplog.clear()
    run_scenario(scenario, hostile, out)
    assert caplog.text == ""
