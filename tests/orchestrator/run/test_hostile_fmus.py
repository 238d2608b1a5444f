"""Whatever an FMU does, a run ends with its name and time, and what was simulated is on the disk."""

from __future__ import annotations

import hostile as faults
import numpy as np
import psutil
import pytest
from gossamer_orchestrator import SimulationError, load_results, run_scenario


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


def test_an_fmu_that_hangs_in_its_instantiation_is_named(hostile, beside, tmp_path):
    message = f"component '{faults.SLEEPER}' did not return within 0.5 s when it was instantiated"
    with pytest.raises(SimulationError, match=message):
        run_scenario(beside(name=faults.SLEEPER), hostile, tmp_path / "out", limit=0.5)
    assert not (tmp_path / "out").exists()  # there is nothing to keep


@pytest.mark.parametrize(("fault", "value"), [(faults.NAN, "nan"), (faults.INFINITE, "inf")])
def test_the_first_value_that_is_not_finite_is_named_once(hostile, beside, tmp_path, caplog, fault, value):
    data = run_scenario(beside(f"fault = {fault}, at = 20"), hostile, tmp_path)
    (record,) = caplog.records
    assert record.getMessage().startswith(f"component 'bad' returned y[1] = {value} at t = 0.021 s.")
    assert data.attrs["ended"] == "complete"
    assert not np.isfinite(data["bad.y"].values[-1, 0])


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
def test_what_an_fmu_starts_ends_with_the_run(hostile, beside, tmp_path):
    before = {process.pid for process in psutil.process_iter()}
    run_scenario(beside(f"fault = {faults.FORK}, at = 21"), hostile, tmp_path)
    after = [process for process in psutil.process_iter(["cmdline"]) if process.pid not in before]
    assert [process for process in after if "gossamer_orchestrator.run.child" in (process.info["cmdline"] or [])] == []
