"""Cost of the whole chain of ten FMUs under the master, beside the same FMI calls in a bare loop."""

from __future__ import annotations

import ctypes
import statistics
import time

import pytest
from gossamer_fmus import build_all
from gossamer_orchestrator import Recorder, Simulation, load_scenario, make_plan
from gossamer_orchestrator.scenario_files import shipped_scenarios

LIMIT = 3.0  # [s] asked of 1000 steps


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    build_all(folder)
    return make_plan(load_scenario(shipped_scenarios()["damaged"]), folder)


def master(plan) -> float:
    """Time 1000 steps under the master, with saved states and a recorder [s]."""
    with Simulation(plan) as simulation:
        recorder = Recorder(plan)
        begin = time.perf_counter()
        simulation.run([recorder])
        return (time.perf_counter() - begin) / simulation.tick * 1000


def bare(plan) -> float:
    """Time the FMI calls of 1000 steps alone: set, step, get; no transfer, no saved state, no recorder [s]."""
    ticks, step = plan.scenario.ticks, ctypes.c_double(plan.scenario.step)
    with Simulation(plan) as simulation:
        begin = time.perf_counter()
        for tick in range(ticks):
            now = ctypes.c_double(plan.scenario.seconds(tick))
            for member in simulation.members:
                member.instance.write(member.inputs)
                member.advance(now, step, full=True)
        return (time.perf_counter() - begin) / ticks * 1000


def test_chain_of_ten_fmus(plan):
    with_master, alone = (statistics.median(function(plan) for _ in range(3)) for function in (master, bare))
    overhead = (with_master - alone) / 1000 / len(plan.components)
    print(f"\n1000 steps of 3e-4 s, {len(plan.components)} FMUs: {with_master:.2f} s (asked {LIMIT:g} s)")
    print(f"the same FMI calls alone: {alone:.2f} s; the master costs {1e6 * overhead:.0f} us per FMU and step")
    assert with_master < LIMIT
