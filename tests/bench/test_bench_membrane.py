"""A membrane as C: its step with AVX2 and without, on a frame that flies, and what 10,000 elements take."""

from __future__ import annotations

import ctypes
import time
from pathlib import Path

import fmpy
import pytest
from building import build_fmu
from fmu_host import Instance
from gossamer_fmus.c_code import TABLES_FILE, sources
from gossamer_fmus.compiler import fmi_headers
from gossamer_models.compiler import compile_shared
from gossamer_models.membrane import membrane_model, square_structure

PAGE = Path(__file__)


@pytest.fixture
def step_cost(cost):
    """Return the cost of one internal step [us of CPU] of an FMU that is unpacked, by parts of a step."""

    def one(path, folder, nodes):
        fmu = Instance(path, folder)
        fmu.initialize()
        component, h = ctypes.c_void_p(fmu.slave.component), ctypes.c_double(1e-6)
        repeats = max(5, 200_000 // nodes)
        best = cost(fmu.slave.dll["fmi2DoStep"], component, ctypes.c_double(0.0), h, 0, repeats=repeats, batches=30)
        fmu.slave.freeInstance()
        return best

    return one


def test_step_with_avx2_without_and_on_a_frame_that_flies(step_cost, measured, tmp_path):
    for n, order in [(8, 1), (4, 4)] if measured else [(4, 1)]:
        structure, costs = square_structure(n, order), {}
        for frame in (False, True):
            model = membrane_model(structure, frame=frame, compiled=True)
            path = build_fmu(model, tmp_path / f"{n}{order}{frame}", PAGE, native=True)
            unpacked = Path(fmpy.extract(path, str(path.with_suffix(""))))
            costs["flying" if frame else "chosen"] = step_cost(path, unpacked, (n * order) ** 2)
            if not frame:
                (binary,) = unpacked.glob("binaries/*/*")
                code = {file.name: file.read_bytes() for file in (unpacked / "sources").iterdir()}
                options = ["-mcpu=baseline", "-DONE_INSTRUCTION_SET", "-I", str(fmi_headers())]
                baseline = unpacked.rename(unpacked.with_name("baseline")) / binary.relative_to(unpacked)
                baseline.write_bytes(compile_shared(code, "fmi2.c", binary.name, options, "the baseline"))
                costs["baseline"] = step_cost(path, baseline.parents[2], (n * order) ** 2)
        print(
            f"\n{n} x {n} elements of order {order}: {costs['chosen']:.2f} us a step, without AVX2 "
            f"{costs['baseline'] / costs['chosen']:.2f} times that; flying {costs['flying']:.2f} us, "
            f"{costs['flying'] / costs['chosen']:.2f} plain steps (target 1.8)"
        )


def test_ten_thousand_elements(step_cost, measured, tmp_path):
    for n in (8, 32, 64, 100) if measured else (4,):
        begin = time.perf_counter()
        model = membrane_model(square_structure(n, 1), compiled=True)
        path = build_fmu(model, tmp_path / str(n), PAGE, native=True)
        code = sum(len(text) for name, text in sources(model, "", 2).items() if name != TABLES_FILE)
        built, unpacked = time.perf_counter() - begin, fmpy.extract(path, str(tmp_path / f"unpacked{n}"))
        step = step_cost(path, unpacked, n**2)
        print(
            f"\n{n * n} elements: {step:.1f} us a step, {1e3 * step / n**2:.0f} ns an element; "
            f"C {code / 1e3:.0f} KB (target 200), built in {built:.1f} s (target 15)"
        )
