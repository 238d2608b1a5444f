"""The demo chain as data, for hosts that no one here wrote.

A host is a script ``<tool>_host.py`` beside this file; it knows the tool and nothing of Gossamer. It runs in a process
of its own, so that a host that crashes, prints or warns disturbs nobody: ``python <tool>_host.py job.json table.npy``.
The job names FMUs, start values, connections and what to watch; the table has a row per communication point, the first
at the start, and a column per watched variable.
"""

import json
import platform
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from gossamer_orchestrator import load_scenario, run_scenario
from gossamer_orchestrator.exchange.ssp_writer import export_ssp
from gossamer_orchestrator.scenario.plan import make_plan

# Host: the package it needs, and the systems for which that package has binaries (x86_64 all).
HOSTS = {
    "fmpy_host.py": ("fmpy", None),
    "pathsim_host.py": ("pathsim_fmi", None),
    "libcosim_host.py": ("libcosimpy", ("Linux", "Windows")),
    "ecos_host.py": ("ecospy", ("Linux", "Windows")),
}
HERE = Path(__file__).parent
SCENARIO = HERE.parents[1] / "orchestrator/scenarios/damaged.toml"
WATCHED = [
    *(("membrane", f"strain[{i}]") for i in range(1, 5)),
    ("membrane", "deflection"),
    *((f"sensor{i}", "resistance") for i in range(1, 5)),
    *((f"compensator{i}", "strain") for i in range(1, 5)),
    *(("detector", f"damage[{i}]") for i in range(1, 17)),
    ("detector", "probability[1]"),  # misfit is a ratio to noise, and there is none but round-off
    ("detector", "valid"),
]


@pytest.fixture(scope="session", params=["python", "native"])
def kind(request):
    """Kind of FMU."""
    return request.param


@pytest.fixture(scope="session")
def fmus(kind, built):
    """Folder of the four FMUs."""
    return built(kind)["sensor"].parent


@pytest.fixture(scope="session")
def with_fmi3(job, built):
    """Make components of the job use FMUs of FMI 3.0: all, or those that a pattern of their name names."""
    folder = built("native FMI 3")["sensor"].parent

    def change(pattern=""):
        return [
            c | {"fmu": str(folder / Path(c["fmu"]).name)} if re.match(pattern, c["name"]) else c for c in job["components"]
        ]

    return change


@pytest.fixture(scope="session")
def ssp(fmus):
    """The scenario as an .ssp."""
    return export_ssp(load_scenario(SCENARIO), fmus, fmus / "damaged.ssp")


@pytest.fixture(scope="session")
def job(fmus):
    """What a host must know: the scenario with everything spelled out."""
    scenario = load_scenario(SCENARIO)
    plan = make_plan(scenario, fmus)
    return {
        "step": scenario.step,
        "ticks": scenario.ticks,
        "steps": [[scenario.seconds(k), scenario.step] for k in range(scenario.ticks)],
        "master": "gauss-seidel",
        "components": [{"name": c.name, "fmu": str(c.fmu.path), "start": c.start} for c in plan.components],
        "connections": [[w.sender, w.output, w.receiver, w.input] for c in plan.components for w in c.connections],
        "watched": WATCHED,
    }


@pytest.fixture(scope="session")
def run_host(job, tmp_path_factory):
    """Run a host's script on the job; return its exit status, its table (None if it wrote none) and what it printed."""

    def run(script, *, must_end_well=True, **changes):
        package, systems = HOSTS[script]
        if systems and (platform.system() not in systems or platform.machine() not in ("x86_64", "AMD64")):
            pytest.skip(f"{package} has binaries for {' and '.join(systems)} on x86_64 only")
        folder = tmp_path_factory.mktemp(script.partition(".")[0])
        table = folder / "table.npy"
        (folder / "job.json").write_text(json.dumps(job | changes))
        command = [sys.executable, HERE / script, folder / "job.json", table]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
        printed = done.stdout + done.stderr
        assert done.returncode == 0 or not must_end_well, printed
        return SimpleNamespace(status=done.returncode, table=np.load(table) if table.exists() else None, printed=printed)

    return run


@pytest.fixture(scope="session")
def own(fmus):
    """The orchestrator's own trajectories of the watched variables, by master algorithm."""

    def run(master):
        scenario = load_scenario(SCENARIO).model_copy(update={"master": master})
        data = run_scenario(scenario, fmus)
        assert data.attrs["divided_steps"] == 0
        return np.column_stack([_column(data, component, name) for component, name in WATCHED])

    return {master: run(master) for master in ("gauss-seidel", "jacobi")}


def _column(data, component, name):
    base, _, index = f"{component}.{name}".removesuffix("]").partition("[")
    variable = data[base]
    return variable.sel({variable.dims[1]: int(index)}) if index else variable


@pytest.fixture(scope="session")
def assert_equal(job):
    """Check that two tables are equal to the last bit; say where they first differ."""

    def check(table, expected):
        assert table.shape == expected.shape == (job["ticks"] + 1, len(WATCHED))
        rows, columns = np.nonzero(~((table == expected) | (np.isnan(table) & np.isnan(expected))))
        if len(rows):
            k, j = rows[0], columns[0]
            where = f"{'.'.join(WATCHED[j])} at step {k}: {table[k, j]!r}, not {expected[k, j]!r}"
            pytest.fail(f"{len(rows)} values differ in {sorted({WATCHED[j] for j in columns})}, first {where}")

    return check
