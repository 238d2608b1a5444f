"""libcosim (Open Simulation Platform) gives the trajectories of the orchestrator's Jacobi master.

libcosim counts time in nanoseconds and steps from one communication point to the next, both rounded to doubles; so its
steps of 3e-4 s differ from each other by some 1e-17 s. Given the same steps, FMPy gives the same bits.
"""

from itertools import pairwise

import numpy as np
import pytest


@pytest.fixture(scope="module", params=["own configuration", "ssp"])
def table(request, run_host, ssp):
    return run_host("libcosim_host.py", **({"ssp": str(ssp)} if request.param == "ssp" else {})).table


@pytest.fixture(scope="module")
def same_steps(run_host, job):
    times = [k * 300_000 / 1e9 for k in range(job["ticks"] + 1)]
    steps = [[now, after - now] for now, after in pairwise(times)]
    return run_host("fmpy_host.py", master="jacobi", steps=steps).table


def test_libcosim_gives_the_same_bits_as_fmpy_with_the_same_steps(table, same_steps, assert_equal):
    assert_equal(table, same_steps)


def test_libcosim_gives_the_trajectories_of_the_jacobi_master(table, own, job):
    expected = own["jacobi"]
    kinds = np.array([variable.partition("[")[0] for _, variable in job["watched"]])
    for kind in set(kinds):
        columns = kinds == kind
        error = np.abs(table - expected)[:, columns].max()
        assert error <= 1e-12 * np.abs(expected[:, columns]).max(), kind


@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_libcosim_refuses_fmi_3(run_host, with_fmi3):
    host = run_host("libcosim_host.py", must_end_well=False, components=with_fmi3("sensor"))
    assert host.table is None
    assert "Unsupported FMI version" in host.printed
