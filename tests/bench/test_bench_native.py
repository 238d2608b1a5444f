"""Cost of native FMUs: one step, the start, their size; and of a simulated second beside CalculiX."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import shutil
import subprocess
import time
from pathlib import Path

import fmpy
import pytest
from fmpy import fmi2
from gossamer_fmus import build_all

CALCULIX_STEP = (23.0, 28.0)  # [ms] of an implicit step of 3e-4 s, 8 x 8, two cores: ../shared/reference/membrane
H = 3e-4


@pytest.fixture(scope="module")
def fmus(built):
    return built("native")


def start(path, folder):
    """Return an initialized FMU."""
    description = fmpy.read_model_description(str(path))
    slave = fmi2.FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="benchmark",
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    return slave


def microseconds(call, *arguments):
    """Time one call of a C function [us of CPU]: the fastest of 40 batches, since the machine may be busy otherwise."""
    best = float("inf")
    for _ in range(40):
        begin = time.process_time()
        for _ in range(500):
            call(*arguments)
        best = min(best, (time.process_time() - begin) / 500)
    return 1e6 * best


def inside(slave, h):
    """Time one ``fmi2DoStep`` [us] less the price of a call from Python that does nothing."""
    component = ctypes.c_void_p(slave.component)
    step, nothing = slave.dll["fmi2DoStep"], slave.dll["fmi2GetReal"]
    time_, size = ctypes.c_double(0.0), ctypes.c_double(h)
    assert step(component, time_, size, 0) == 0
    return microseconds(step, component, time_, size, 0) - microseconds(
        nothing, component, None, ctypes.c_size_t(0), None
    )


@pytest.mark.parametrize(
    ("name", "h", "target"),
    [("membrane", 7e-5, 25.0), ("sensor", H, 3.0), ("compensator", H, 3.0), ("detector", H, 1.0)],
)
def test_step_inside_the_fmu(fmus, tmp_path, name, h, target):
    slave = start(fmus[name], fmpy.extract(fmus[name], str(tmp_path)))
    what = "one internal step" if name == "membrane" else "one step"
    print(f"\nnative {name}, {what}: {inside(slave, h):.2f} us (target {target:g})")
    slave.freeInstance()


def test_estimator_step_beside_the_exact_inverse(fmus, tmp_path):
    """It inverts three times and smooths twice; both see the same machine."""
    costs = {}
    for name in ("estimator", "compensator"):
        slave = start(fmus[name], fmpy.extract(fmus[name], str(tmp_path / name)))
        costs[name] = inside(slave, H)
        slave.freeInstance()
    ratio = costs["estimator"] / costs["compensator"]
    print(f"\nnative estimator, one step: {costs['estimator']:.2f} us, {ratio:.1f} times the exact inverse")


def test_start_of_the_membrane(fmus, tmp_path):
    folder, best = fmpy.extract(fmus["membrane"], str(tmp_path)), float("inf")
    for _ in range(10):
        begin = time.process_time()
        slave = start(fmus["membrane"], folder)
        best = min(best, time.process_time() - begin)
        slave.freeInstance()
    print(f"\nnative membrane, instantiate and initialize, library loaded: {1e3 * best:.1f} ms (target 20)")


def test_a_simulated_second_beside_calculix(fmus, tmp_path):
    """The same mesh, load and communication step; CalculiX is run here for 100 steps if ``ccx`` is installed."""
    bilinear = build_all(tmp_path, ["membrane"], elements_per_side=8, order=1, native=True)
    seconds = {}
    for name, path in (("default", fmus["membrane"]), ("8 x 8", bilinear["membrane"])):
        slave = start(path, fmpy.extract(path, str(tmp_path / name)))
        seconds[name] = inside(slave, H) * 1e-6 / H
        slave.freeInstance()
    ours = seconds["8 x 8"]
    print(f"\nnative membrane, default: {seconds['default']:.3f} s per simulated second, on one core")
    low, high = (1e-3 * step / H for step in CALCULIX_STEP)
    print(f"native membrane, bilinear 8 x 8: {ours:.3f} s per simulated second, on one core")
    print(f"CalculiX, reference: {low:.0f} to {high:.0f} s, {low / ours:.0f} to {high / ours:.0f} times (target 800)")
    if (ccx := shutil.which("ccx")) is None:
        pytest.skip("CalculiX is not installed (ccx), so its reference figure stands alone")
    found = importlib.util.spec_from_file_location("calculix_deck", Path(__file__).with_name("calculix_deck.py"))
    deck = importlib.util.module_from_spec(found)
    found.loader.exec_module(deck)
    (tmp_path / "membrane.inp").write_text(deck.calculix_deck(100))
    begin = time.perf_counter()
    environment = os.environ | {"OMP_NUM_THREADS": "2"}
    subprocess.run([ccx, "membrane"], cwd=tmp_path, env=environment, check=True, capture_output=True)
    theirs = (time.perf_counter() - begin) / (100 * H)
    centre = float((tmp_path / "membrane.dat").read_text().split()[-1])
    print(
        f"CalculiX, here: {theirs:.0f} s, {theirs / ours:.0f} times; "
        f"centre at 0.03 s {centre:.6f} m (reference 0.120686)"
    )
    assert centre == pytest.approx(0.1206857, abs=1e-6)


def test_size_of_an_fmu_with_three_platforms(tmp_path):
    built = build_all(tmp_path, native=True, platforms=["all"])
    sizes = ", ".join(f"{name} {path.stat().st_size / 1e6:.2f}" for name, path in built.items())
    print(f"\nFMI 2.0 FMU for Linux, Windows and macOS (two processors) [MB]: {sizes} (target 3)")
    assert max(path.stat().st_size for path in built.values()) < 3e6
