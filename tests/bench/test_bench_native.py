"""Cost of native FMUs: one step, the start, their size, a million steps; and of a simulated second beside CalculiX."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import shutil
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fmpy
import pytest
from fmu_host import Instance, excite
from gossamer_fmus import NAMES, build_all

CALCULIX_STEP = (23.0, 28.0)  # [ms] of an implicit step of 3e-4 s, 8 x 8, two cores: ../shared/reference/membrane
SIZE = 7.0  # [MB] of an FMU for three platforms; the networks of the detector are 5 of it
THREADS = 4
H = 3e-4


@pytest.fixture
def start(tmp_path):
    """Return an initialized instance of an FMU; all are freed in the end."""
    made = []

    def one(path, **values):
        folder = tmp_path / path.parent.name / path.stem
        made.append(Instance(path, folder if folder.is_dir() else fmpy.extract(str(path), str(folder))))
        made[-1].initialize(**values)
        return made[-1]

    yield one
    for each in made:
        each.slave.freeInstance()


@pytest.fixture
def inside(cost):
    """Time one ``fmi2DoStep`` [us] less the price of a call from Python that does nothing."""

    def one(fmu, h):
        component, dll = ctypes.c_void_p(fmu.slave.component), fmu.slave.dll
        assert fmu.step(h) == 0
        step = cost(dll["fmi2DoStep"], component, ctypes.c_double(0.0), ctypes.c_double(h), 0)
        return step - cost(dll["fmi2GetReal"], component, None, ctypes.c_size_t(0), None)

    return one


@pytest.mark.parametrize(
    ("name", "h", "target"), [("membrane", 7e-5, 25.0), ("sensor", H, 3.0), ("compensator", H, 3.0), ("detector", H, 1.0)]
)
def test_step_inside_the_fmu(built, start, inside, name, h, target):
    what = "one internal step" if name == "membrane" else "one step"
    print(f"\nnative {name}, {what}: {inside(start(built('native')[name]), h):.2f} us (target {target:g})")


def test_estimator_step_beside_the_exact_inverse(built, start, inside):
    """It inverts three times and smooths twice; both see the same machine."""
    estimator, inverse = (inside(start(built("native")[name]), H) for name in ("estimator", "compensator"))
    print(f"\nnative estimator, one step: {estimator:.2f} us, {estimator / inverse:.1f} times the exact inverse")


def test_start_of_the_membrane(built, start, cost):
    path = built("native")["membrane"]
    start(path)  # unpacked, and its library loaded
    print(f"\nnative membrane, instantiate and initialize: {1e-3 * cost(start, path, repeats=1):.1f} ms (target 20)")


def test_a_simulated_second_beside_calculix(built, start, inside, measured, tmp_path):
    """The same mesh, load and communication step; CalculiX is run here for 100 steps if ``ccx`` is installed."""
    square = built("native")["membrane"]
    if measured:
        square = build_all(tmp_path, ["membrane"], elements_per_side=8, order=1, native=True)["membrane"]
    ours = inside(start(square), H) * 1e-6 / H
    print(f"\nnative membrane, bilinear 8 x 8: {ours:.3f} s per simulated second, on one core")
    low, high = (1e-3 * step / H for step in CALCULIX_STEP)
    print(f"CalculiX, reference: {low:.0f} to {high:.0f} s, {low / ours:.0f} to {high / ours:.0f} times (target 800)")
    found = importlib.util.spec_from_file_location("calculix_deck", Path(__file__).with_name("calculix_deck.py"))
    deck = importlib.util.module_from_spec(found)
    found.loader.exec_module(deck)
    (tmp_path / "membrane.inp").write_text(deck.calculix_deck(100))
    if (ccx := shutil.which("ccx")) is None:
        pytest.skip("CalculiX is not installed (ccx), so its reference figure stands alone")
    begin = time.perf_counter()
    environment = os.environ | {"OMP_NUM_THREADS": "2"}
    subprocess.run([ccx, "membrane"], cwd=tmp_path, env=environment, check=True, capture_output=True)
    theirs = (time.perf_counter() - begin) / (100 * H)
    centre = float((tmp_path / "membrane.dat").read_text().split()[-1])
    print(f"CalculiX, here: {theirs:.0f} s, {theirs / ours:.0f} times; centre at 0.03 s {centre:.6f} m (reference 0.120686)")
    assert centre == pytest.approx(0.1206857, abs=1e-6)


def test_size_of_an_fmu_with_three_platforms(built, measured, tmp_path):
    """In the short form with the platform of this machine alone."""
    paths = build_all(tmp_path, native=True, platforms=["all"]) if measured else built("native")
    sizes = ", ".join(f"{name} {path.stat().st_size / 1e6:.2f}" for name, path in paths.items())
    print(f"\nFMI 2.0 FMU for Linux, Windows and macOS (two processors) [MB]: {sizes} (target {SIZE:g})")
    assert max(path.stat().st_size for path in paths.values()) < 1e6 * SIZE


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads /proc, which this system does not have")
@pytest.mark.parametrize("name", NAMES)
def test_a_million_steps_leak_nothing_and_do_not_depend_on_the_thread(built, start, measured, name):
    """In four threads with an instance each."""
    rows, steps = [excite(name, k) for k in range(1000)], 250_000 if measured else 250
    path, n = built("native")[name], len(rows[0])
    values = [(ctypes.c_double * n)(*row.values()) for row in rows]

    def run(fmu, steps=steps):
        references, h = (ctypes.c_uint * n)(*(fmu.references[key] for key in rows[0])), ctypes.c_double(H)
        for k in range(steps):
            fmu.slave.dll.fmi2SetReal(fmu.slave.component, references, n, values[k % 1000])
            assert fmu.slave.dll.fmi2DoStep(fmu.slave.component, ctypes.c_double(k * H), h, 1) == 0
        return fmu.get(*fmu.names("output"))

    def resident():
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4  # [KiB]

    fmus = [start(path, **rows[0]) for _ in range(THREADS)]
    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(lambda fmu: run(fmu, 1000), fmus))
        before, begin = resident(), time.perf_counter()
        found = list(pool.map(run, fmus))
        seconds, growth = time.perf_counter() - begin, resident() - before
    alone = start(path, **rows[0])
    run(alone, 1000)
    assert found == [run(alone)] * THREADS
    assert growth < 512
    print(f"\n{name}: {THREADS * steps} steps in {seconds:.1f} s, {growth:+d} KiB")
