"""What a host makes of an FMU that refuses: a pressure out of range, and every step after it, as docs/tools says."""

import numpy as np
import pytest


@pytest.fixture
def job_with_bad_pressure(job):
    components = [c | {"start": c["start"] | {"pressure": 1e8}} if c["name"] == "membrane" else c for c in job["components"]]
    return job | {"components": components, "ticks": 10, "steps": job["steps"][:10]}


@pytest.mark.parametrize("script", ["fmpy_host.py", "libcosim_host.py", "pathsim_host.py"])
def test_a_refusal_ends_the_run(script, run_host, job_with_bad_pressure):
    host = run_host(script, must_end_well=False, **job_with_bad_pressure)
    assert host.status != 0
    assert host.table is None


def test_libcosim_prints_why_a_step_was_refused(run_host, job_with_bad_pressure):
    host = run_host("libcosim_host.py", must_end_well=False, **job_with_bad_pressure)
    assert (
        "input 'pressure' of model 'membrane' is 1e+08 Pa; it must be a finite number from -1e+06 to 1e+06" in host.printed
    )


def test_ecos_goes_on_and_says_nothing(run_host, job_with_bad_pressure):
    host = run_host("ecos_host.py", **job_with_bad_pressure)
    assert host.printed == ""
    columns = [place == ("membrane", "strain[1]") for place in job_with_bad_pressure["watched"]]
    strain = host.table[:, columns]
    assert np.array_equal(strain, np.full_like(strain, strain[0]), equal_nan=True)
