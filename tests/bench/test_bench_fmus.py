"""Cost of one FMI call into each FMU, and memory over a million steps."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import fmpy
import pytest
from fmpy import fmi2
from gossamer_fmus import NAMES

STEPS = 1_000_000


class Host:
    """An initialized FMU with the arrays of its inputs and outputs."""

    def __init__(self, path, folder):
        description = fmpy.read_model_description(str(path))
        self.slave = fmi2.FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path), str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="benchmark",
        )
        self.slave.instantiate()
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.ports = {}
        for causality in ("input", "output"):
            references = [v.valueReference for v in description.modelVariables if v.causality == causality]
            n = len(references)
            self.ports[causality] = (ctypes.c_uint * n)(*references), n, (ctypes.c_double * n)()
        self.get("input")

    def get(self, causality):
        assert self.slave.dll.fmi2GetReal(self.slave.component, *self.ports[causality]) == 0

    def set(self):
        assert self.slave.dll.fmi2SetReal(self.slave.component, *self.ports["input"]) == 0

    def step(self):
        assert self.slave.dll.fmi2DoStep(self.slave.component, ctypes.c_double(0.0), ctypes.c_double(3e-4), 0) == 0


@pytest.fixture
def host(built, tmp_path):
    made = []

    def make(name):
        made.append(Host(built("python")[name], tmp_path / name))
        return made[-1]

    yield make
    for each in made:
        each.slave.freeInstance()


@pytest.mark.parametrize("call", ["set", "step", "get"])
@pytest.mark.parametrize("name", NAMES)
def test_cost_of_a_call(benchmark, host, name, call):
    fmu = host(name)
    benchmark.group = call
    benchmark({"set": fmu.set, "step": fmu.step, "get": lambda: fmu.get("output")}[call])


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads /proc, which this system does not have")
def test_memory_over_a_million_steps(host):
    """Half a minute or so; what is allowed is a few pages, not bytes per step."""
    fmu = host("sensor")
    strain = fmu.ports["input"][2]

    def kibibytes_after(steps):
        for k in range(steps):
            strain[0] = 0.2 + 0.15 * math.sin(0.1 * k)
            fmu.set()
            fmu.step()
        return 4 * int(Path("/proc/self/statm").read_text().split()[1])

    before = kibibytes_after(STEPS // 100)
    growth = kibibytes_after(STEPS) - before
    print(f"\nsensor FMU: memory grew by {growth} KiB over {STEPS} steps (target 0)")
    assert growth < 512
