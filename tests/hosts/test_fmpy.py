"""A loop over FMPy's own classes gives the orchestrator's trajectories."""

import pytest


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
def test_a_loop_over_fmpy_gives_the_orchestrators_trajectories(master, run_host, own, assert_equal):
    assert_equal(run_host("fmpy_host.py", master=master).table, own[master])
