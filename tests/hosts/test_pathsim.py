"""PathSim and the orchestrator give the same trajectories."""


def test_pathsim_gives_the_orchestrators_trajectories_one_step_early(run_host, own, assert_equal):
    host = run_host("pathsim_host.py")
    print(host.said)
    assert_equal(host.table, own["gauss-seidel"])
