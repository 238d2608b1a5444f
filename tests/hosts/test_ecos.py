"""Ecos gives the trajectories of the orchestrator's Jacobi master, from Python and as a program of its own."""

import importlib.util
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from gossamer_orchestrator import load_scenario
from gossamer_orchestrator.exchange.container import build_container

SCENARIO = Path(__file__).parents[2] / "orchestrator/scenarios/damaged.toml"


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
    assert "No such real property: membrane::strain[1]" in host.printed


@pytest.fixture(scope="module")
def ecos(tmp_path_factory, job):
    """Run the program on a file; return the watched variables as it wrote them, with six decimals."""
    if (platform.system(), platform.machine()) != ("Linux", "x86_64"):
        pytest.skip("the program is run here on Linux and x86_64 only")
    folder = tmp_path_factory.mktemp("ecos")
    program = Path(importlib.util.find_spec("ecospy").origin).parent / "binaries/ecos"
    program = Path(shutil.copy(program, folder))
    program.chmod(0o755)  # it comes without the right to be executed

    def run(path, name, *options):
        command = [program, "simulate", "--path", path, "--logLevel", "warn", *options]
        command += ["--stepSize", str(job["step"]), "--stopTime", str(job["ticks"] * job["step"])]
        libraries = {"LD_LIBRARY_PATH": str(Path(sys.prefix, "lib"))}  # libtbb.so.12
        done = subprocess.run(
            command, cwd=folder, env=os.environ | libraries, capture_output=True, text=True, timeout=120, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        header, *rows = [line.split(", ") for line in (folder / f"{path.stem}.csv").read_text().splitlines()]
        columns = [header.index(name.format(*place) + "[REAL]") for place in job["watched"]]
        assert len(rows) > job["ticks"]  # one step too many, perhaps
        return [[row[column] for column in columns] for row in rows[: job["ticks"] + 1]]

    return run


def six_decimals(table):
    return [[f"{value:.6f}" for value in row] for row in table]


@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_the_ecos_program_gives_the_trajectories_of_the_jacobi_master(ecos, ssp, own):
    table = ecos(ssp, "{}::{}", "--parameterSet", "initialValues")
    assert table == six_decimals(own["jacobi"])


@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_the_ecos_program_runs_the_chain_as_one_fmu(ecos, fmus, own, tmp_path):
    container = build_container(load_scenario(SCENARIO), fmus, tmp_path / "chain.fmu")
    assert ecos(container, "instance::{}.{}") == six_decimals(own["gauss-seidel"])
