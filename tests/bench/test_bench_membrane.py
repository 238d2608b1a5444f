"""A membrane as C: its step with AVX2 and without, on a frame that flies, and what 10,000 elements take."""

from __future__ import annotations

import ctypes
import time
from pathlib import Path

import fmpy
import numpy as np
import pytest
from building import build_fmu
from fmu_host import Instance
from gossamer_fmus.c_code import TABLES_FILE, sources
from gossamer_fmus.compiler import fmi_headers
from gossamer_models import Stepper
from gossamer_models.compiler import compile_shared
from gossamer_models.membrane import (
    Beam,
    Edge,
    Load,
    Region,
    Setup,
    Support,
    make_structure,
    membrane_model,
    square_structure,
    surface_mesh,
)
from oracles.meshes import meshed

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


def sail(n, parts):
    """Return a taut sail of 10 m, 2.5 um and n by n elements on four booms of so many segments; on its corners for none."""
    half, stress = 5.0, 7e3
    points = {"hub": lambda x, y, z: np.hypot(x, y) < 1e-6}
    for k, corner in enumerate([(-half, -half), (-half, half), (half, -half), (half, half)]):
        points[f"corner{k}"] = lambda x, y, z, at=corner: np.hypot(x - at[0], y - at[1]) < 1e-6
    patch = lambda s, t: (2.0 * half * s - half, 2.0 * half * t - half, 0.0 * s)  # noqa: E731
    edges = {"rim": lambda x, y, z: np.maximum(np.abs(x), np.abs(y)) > half - 1e-6}
    file = meshed([patch], n, points=points, edges=edges)
    film = {"youngs_modulus": 2.5e9, "poisson_ratio": 0.34, "density": 1400.0, "thickness": 2.5e-6}
    tube = {"youngs_modulus": 7e10, "area": 8e-5, "density": 1600.0, "second_moment": 4e-9}
    setup = Setup(
        inplane_mass=100.0,
        regions=(Region(**film, prestress=(stress, stress, 0.0)),),
        supports=tuple(Support(group=name) for name in (["hub"] if parts else points)),
        edges=(Edge(group="rim", tension=stress * film["thickness"]),),
        beams=tuple(
            Beam(name=f"boom{k}", path=("hub", f"corner{k}"), parts=parts, clamped=("hub",), **tube)
            for k in range(4 if parts else 0)
        ),
        loads=(Load(name="sun", kind="light", start=9e-6, reflectivity=0.8),),
    )
    return make_structure(setup, surface_mesh(file, 1))


def test_a_flying_sail_on_booms(step_cost, measured, tmp_path):
    n = 32 if measured else 4
    many, costs = max(n * n // 80, 1), {}
    for parts in (0, many, 3):
        structure = sail(n, parts)
        path = build_fmu(membrane_model(structure, frame=True, compiled=True), tmp_path / str(parts), PAGE, native=True)
        costs[parts] = step_cost(path, fmpy.extract(path, str(tmp_path / f"unpacked{parts}")), n * n)
        stepper = Stepper(membrane_model(structure, frame=True))
        stepper.initialize()
        limit = stepper.get("max_step")
        took = f"{costs[parts]:.1f} us a step of {limit:.1e} s, {1e-6 * costs[parts] / limit:.2f} s of CPU a second"
        print(f"\n{n * n} elements on booms of {parts} segments, flying, native: {took} (target 1)")
    share, more = 4 * many / n**2, costs[many] / costs[0] - 1.0
    print(f"segments, {100 * share:.1f} % of the elements, take {100 * more:.1f} % of the step (target 5)")
