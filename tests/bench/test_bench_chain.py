"""Cost of the whole chain of ten FMUs under the master, in Python and native, beside the same FMI calls alone."""

from __future__ import annotations

import ctypes
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from gossamer_orchestrator import FmuFile, Recorder, Simulation, load_scenario, make_plan, parse_scenario
from gossamer_orchestrator.run.position import open_position
from gossamer_orchestrator.run.recorder import FiniteCheck
from gossamer_orchestrator.run.stream import Stream
from gossamer_orchestrator.scenario.source import shipped_scenarios

PYTHON_TARGET = 3.0  # [s] for 1000 steps
NATIVE_TARGET = 0.6  # [s] for one simulated second
STREAMED_TARGET = 0.25  # [s] for one simulated second whose results are on the disk
RATIO_TARGET = 5.0


@pytest.fixture(scope="module")
def plan_of(built, measured):
    """Make the plan of the whole chain with FMUs of a kind; a few steps of it in the short form."""
    scenario = load_scenario(shipped_scenarios()["damaged"], stop=None if measured else 6e-3)
    return lambda kind: make_plan(scenario, built(kind)["sensor"].parent)


def master(plan) -> float:
    """Time a communication step under the master, with saved states and a recorder [s of CPU]."""
    with Simulation(plan) as simulation:
        recorder = Recorder(plan)
        begin = time.process_time()
        simulation.run([recorder])
        return (time.process_time() - begin) / simulation.tick


def streamed(plan) -> float:
    """Time a communication step as a run has it: streamed, every value checked, the position written [s of CPU]."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        position = open_position(folder / "position", new=True)
        with Simulation(plan, position) as simulation:
            stream = Stream(plan, folder, folder / "waiting", lambda _shared: None)
            begin = time.process_time()
            simulation.run([stream, FiniteCheck()])
            return (time.process_time() - begin) / simulation.tick


def bare(plan) -> float:
    """Time the FMI calls of a communication step alone [s of CPU]: set, step, get; no transfer, saved state or recorder."""
    ticks, step = plan.scenario.ticks, ctypes.c_double(plan.scenario.step)
    with Simulation(plan) as simulation:
        begin = time.process_time()
        for tick in range(ticks):
            now = ctypes.c_double(plan.scenario.seconds(tick))
            for member in simulation.members:
                member.instance.write(member.inputs)
                member.advance(now, step, full=True)
        return (time.process_time() - begin) / ticks


def best(*measurements, rounds) -> list[float]:
    """Take turns, so that all see the same machine; the least of each."""
    table = [[function(plan) for function, plan in measurements] for _ in range(rounds)]
    return [min(times) for times in zip(*table, strict=True)]


def test_chain_of_ten_native_fmus_beside_pythonfmu(plan_of, measured):
    python_plan, native_plan = plan_of("python"), plan_of("native")
    python, native = best((master, python_plan), (master, native_plan), rounds=5 if measured else 1)
    print(f"\nten pythonfmu FMUs, 1000 steps of 3e-4 s: {1000 * python:.2f} s (target {PYTHON_TARGET:g} s)")
    seconds = native / native_plan.scenario.step
    with_master, on_disk, alone = best(
        (master, native_plan), (streamed, native_plan), (bare, native_plan), rounds=25 if measured else 1
    )
    overhead = (with_master - alone) / len(native_plan.components)
    print(f"\nten native FMUs, one simulated second at 3e-4 s: {seconds:.2f} s (target {NATIVE_TARGET:g} s)")
    print(f"streamed to disk: {on_disk / native_plan.scenario.step:.3f} s (target {STREAMED_TARGET:g} s), ", end="")
    print(f"{1e6 * on_disk:.1f} us per step, {on_disk / with_master:.3f} of a run that records in memory")
    print(f"pythonfmu over native: {python / native:.1f} (target {RATIO_TARGET:g})")
    print(f"the native FMI calls alone: {1e6 * alone:.0f} us of {1e6 * with_master:.0f} us per step; ", end="")
    print(f"the master costs {1e6 * overhead:.1f} us per FMU and step")
    assert python > 0.5 * RATIO_TARGET * native or not measured


@pytest.mark.parametrize(("name", "copies"), [("sensor", 4), ("membrane", 2)])
def test_components_that_step_at_once(built, measured, name, copies):
    """Steps of a sensor take some 2 us, of a membrane some 100 us; the wall time tells, so the machine must be quiet."""
    folder = built("native")["sensor"].parent
    given = ", ".join(f'"{each}" = 0.0' for each in FmuFile(folder / f"{name}.fmu").names("input"))
    components = "".join(f'[components.c{i}]\nfmu = "{name}"\ninputs = {{ {given} }}\n' for i in range(copies))
    text = f'step = 3e-4\nstop = {0.15 if measured else 0.003}\nmaster = "jacobi"\n{components}'
    scenario = parse_scenario(text)

    def seconds(threads):
        with Simulation(make_plan(scenario, folder), threads=threads) as simulation:
            begin = time.perf_counter()
            simulation.run()
            return (time.perf_counter() - begin) / simulation.tick

    table = [[seconds(threads) for threads in (1, 2)] for _ in range(5 if measured else 1)]
    one, two = (min(times) for times in zip(*table, strict=True))
    print(f"\n{copies} {name}s: {1e6 * one:.0f} us per step one after another, {1e6 * two:.0f} us in two threads")
