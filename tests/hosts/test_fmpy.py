"""A loop over FMPy's own classes gives the orchestrator's trajectories."""

import pytest


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
def test_a_loop_over_fmpy_gives_the_orchestrators_trajectories(master, run_host, own, assert_equal):
    assert_equal(run_host("fmpy_host.py", master=master).table, own[master])


@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_fmi_3_gives_the_same(run_host, with_fmi3, own, assert_equal):
    assert_equal(run_host("fmpy_host.py", components=with_fmi3()).table, own["gauss-seidel"])
