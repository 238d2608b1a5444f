"""A membrane on a mesh as C: its step beside the square membrane's of the same elements, and what 10,000 elements take."""

from __future__ import annotations

import ctypes
import time
from pathlib import Path

import fmpy
from fmpy import fmi2
from gossamer_fmus.build import build_fmu
from gossamer_fmus.c_code import sources
from gossamer_models.membrane import membrane_model, square_structure

PAGE = Path(__file__)


def step_cost(path, folder, repeats):
    """Return the cost of one internal step [us of CPU]: the fastest of many batches of parts of a step."""
    description = fmpy.read_model_description(str(path))
    unpacked = fmpy.extract(str(path), str(folder))
    slave = fmi2.FMU2Slave(
        guid=description.guid,
        unzipDirectory=unpacked,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="benchmark",
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    component, h = ctypes.c_void_p(slave.component), ctypes.c_double(1e-6)
    step, best = slave.dll["fmi2DoStep"], float("inf")
    for _ in range(30):
        begin = time.process_time()
        for _ in range(repeats):
            step(component, ctypes.c_double(0.0), h, 0)
        best = min(best, (time.process_time() - begin) / repeats)
    slave.freeInstance()
    return 1e6 * best


def test_ten_thousand_elements(tmp_path):
    costs = {}
    for n in (8, 32, 64, 100):
        begin = time.perf_counter()
        structure = square_structure(n, 1)
        model = membrane_model(structure, compiled=True)
        path = build_fmu(model, tmp_path / str(n), PAGE, native=True)
        built, size = time.perf_counter() - begin, sum(map(len, sources(model, "", 2).values()))
        costs[n] = step_cost(path, tmp_path / f"unpacked{n}", max(5, 200_000 // n**2))
        print(
            f"\n{n * n} elements: {costs[n]:.1f} us a step, {1e3 * costs[n] / n**2:.0f} ns an element; "
            f"C {size / 1e3:.0f} KB (target 200), built in {built:.1f} s (target 15)"
        )
