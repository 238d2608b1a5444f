"""Cost of one FMI call into each FMU, and memory over a million steps."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import fmpy
import pytest
from fmu_host import Instance
from gossamer_fmus import NAMES


class Host(Instance):
    """An initialized FMU with the arrays of its inputs and outputs."""

    def __init__(self, path, folder):
        super().__init__(path, fmpy.extract(str(path), str(folder)))
        self.initialize()
        self.ports = {}
        for causality in ("input", "output"):
            references = [self.references[name] for name in self.names(causality)]
            n = len(references)
            self.ports[causality] = (ctypes.c_uint * n)(*references), n, (ctypes.c_double * n)()
        self.get_all("input")

    def get_all(self, causality="output"):
        assert self.slave.dll.fmi2GetReal(self.slave.component, *self.ports[causality]) == 0

    def set_all(self):
        assert self.slave.dll.fmi2SetReal(self.slave.component, *self.ports["input"]) == 0

    def step_once(self):
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


@pytest.mark.parametrize("call", ["set_all", "step_once", "get_all"])
@pytest.mark.parametrize("name", NAMES)
def test_cost_of_a_call(benchmark, host, name, call):
    benchmark.group = call
    benchmark(getattr(host(name), call))


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads /proc, which this system does not have")
def test_memory_over_a_million_steps(host, measured):
    """Half a minute or so; what is allowed is a few pages, not bytes per step."""
    fmu, steps = host("sensor"), 1_000_000 if measured else 1000
    strain = fmu.ports["input"][2]

    def kibibytes_after(steps):
        for k in range(steps):
            strain[0] = 0.2 + 0.15 * math.sin(0.1 * k)
            fmu.set_all()
            fmu.step_once()
        return 4 * int(Path("/proc/self/statm").read_text().split()[1])

    before = kibibytes_after(steps // 100)
    growth = kibibytes_after(steps) - before
    print(f"\nsensor FMU: memory grew by {growth} KiB over {steps} steps (target 0)")
    assert growth < 512
