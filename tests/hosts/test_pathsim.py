"""PathSim gives the orchestrator's trajectories, one step early."""

import pytest


def test_pathsim_gives_the_orchestrators_trajectories(run_host, own, assert_equal):
    assert_equal(run_host("pathsim_host.py").table, own["gauss-seidel"])


@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_pathsim_runs_fmi_3_without_arrays(run_host, with_fmi3, own, assert_equal):
    host = run_host("pathsim_host.py", components=with_fmi3("sensor|compensator"))
    assert_equal(host.table, own["gauss-seidel"])


@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_pathsim_refuses_arrays(run_host, with_fmi3):
    components = [c | {"start": {}} for c in with_fmi3("membrane")]
    host = run_host("pathsim_host.py", must_end_well=False, components=components)
    assert host.status == 1
    assert "fmi3GetFloat64 failed with status 3 (error)" in host.printed
