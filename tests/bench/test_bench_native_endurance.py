"""A million steps of each native FMU, in four threads with an instance each: no growth of memory, identical results."""

import ctypes
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import fmi2
from gossamer_fmus import NAMES

THREADS, STEPS, H = 4, 250_000, 3e-4
SWINGS = {
    "membrane": ("pressure", 500.0, 100.0),
    "sensor": ("strain", 0.1, 0.05),
    "compensator": ("resistance", 102.0, 1.0),
    "detector": ("strain[1]", 0.1, 0.05),
}


def resident():
    """Return resident memory [KiB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4


@pytest.fixture(scope="module")
def fmus(built):
    return built("native")


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads /proc, which this system does not have")
@pytest.mark.parametrize("name", NAMES)
def test_a_million_steps_leak_nothing_and_do_not_depend_on_the_thread(fmus, tmp_path, name):
    fmpy.extract(str(fmus[name]), str(tmp_path))
    description = fmpy.read_model_description(str(fmus[name]))
    references = {v.name: v.valueReference for v in description.modelVariables}
    variable, middle, swing = SWINGS[name]
    outputs = [v.valueReference for v in description.modelVariables if v.causality == "output"]
    values = middle + swing * np.sin(0.05 * np.arange(1000))

    def start(_):
        slave = fmi2.FMU2Slave(
            guid=description.guid, unzipDirectory=str(tmp_path), modelIdentifier=name, instanceName="i"
        )
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.setReal([references[variable]], [float(values[0])])
        slave.exitInitializationMode()
        return slave

    def run(slave, steps=STEPS):
        reference, value = (ctypes.c_uint * 1)(references[variable]), (ctypes.c_double * 1)()
        h = ctypes.c_double(H)
        for k in range(steps):
            value[0] = values[k % 1000]
            slave.dll.fmi2SetReal(slave.component, reference, 1, value)
            assert slave.dll.fmi2DoStep(slave.component, ctypes.c_double(k * H), h, 1) == 0
        return slave.getReal(outputs)

    with ThreadPoolExecutor(THREADS) as pool:
        slaves = list(pool.map(start, range(THREADS)))
        list(pool.map(lambda slave: run(slave, 1000), slaves))
        before, begin = resident(), time.perf_counter()
        found = list(pool.map(run, slaves))
        seconds, growth = time.perf_counter() - begin, resident() - before
    alone = start(0)
    run(alone, 1000)
    assert found == [run(alone)] * THREADS
    assert growth < 512
    sys.stdout.write(f"\n{name}: {THREADS * STEPS} steps in {seconds:.1f} s, {growth:+d} KiB\n")
    for slave in (*slaves, alone):
        slave.freeInstance()
