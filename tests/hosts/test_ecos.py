"""Ecos gives the trajectories of the orchestrator's Jacobi master, from Python and as a program of its own."""

import importlib.util
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize("source", ["own configuration", "ssp"])
def test_ecospy_gives_the_trajectories_of_the_jacobi_master(source, run_host, ssp, own, assert_equal):
    host = run_host("ecos_host.py", **({"ssp": str(ssp)} if source == "ssp" else {}))
    assert_equal(host.table, own["jacobi"])


@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_ecospy_runs_fmi_3_without_arrays(run_host, with_fmi3, own, assert_equal):
    host = run_host("ecos_host.py", components=with_fmi3("sensor|compensator"))
    assert_equal(host.table, own["jacobi"])


@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_ecospy_has_no_elements_of_arrays(run_host, with_fmi3):
    host = run_host("ecos_host.py", must_end_well=False, components=with_fmi3("membrane"))
    assert "No such real property: membrane::strain[1]" in host.said


@pytest.fixture(scope="module")
def ecos(tmp_path_factory):
    """The program; it comes without the right to be executed."""
    folder = Path(importlib.util.find_spec("ecospy").origin).parent / "binaries"
    program = Path(shutil.copy(folder / "ecos", tmp_path_factory.mktemp("ecos")))
    program.chmod(0o755)
    return program


@pytest.mark.skipif(
    (platform.system(), platform.machine()) != ("Linux", "x86_64"), reason="run here on Linux and x86_64 only"
)
@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_the_ecos_program_gives_the_trajectories_of_the_jacobi_master(ecos, ssp, own, job, tmp_path):
    """It writes six decimals; they are those of the orchestrator."""
    command = [ecos, "simulate", "--path", ssp, "--parameterSet", "initialValues", "--logLevel", "warn"]
    command += ["--stepSize", str(job["step"]), "--stopTime", str(job["ticks"] * job["step"])]
    libraries = {"LD_LIBRARY_PATH": str(Path(sys.prefix, "lib"))}  # libtbb.so.12
    done = subprocess.run(
        command, cwd=tmp_path, env=os.environ | libraries, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    header, *rows = [line.split(", ") for line in (tmp_path / "damaged.csv").read_text().splitlines()]
    columns = [header.index(f"{component}::{variable}[REAL]") for component, variable in job["watched"]]
    written = [[row[column] for column in columns] for row in rows]
    expected = [[f"{value:.6f}" for value in row] for row in own["jacobi"]]
    assert len(written) >= len(expected)
    assert written[: len(expected)] == expected
