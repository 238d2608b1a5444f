"""FMUs of a membrane on a mesh: as C they loop over elements and read their mesh from the FMU's resources."""

import shutil
from dataclasses import replace
from pathlib import Path

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
    Cable,
    Gas,
    Load,
    PointMass,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    make_structure,
    membrane_model,
    surface_mesh,
)
from oracles.meshes import disc, meshed

OK = 0
FILM = Region(youngs_modulus=1e7, poisson_ratio=0.33, density=1100.0, thickness=1e-3, prestress=(2e5, 2e5, 0.0))
DRUM = Setup(
    regions=(replace(FILM, group="left", thermal_expansion=1e-5), replace(FILM, poisson_ratio=0.4)),
    zones=(Zone(group="left"), Zone(group="right")),
    supports=(Support(group="rim", stretch=(1.01, 1.01, 1.0)),),
    loads=(Load(name="pressure"), Load(name="sun", kind="light", reflectivity=0.8, direction=(0.0, 0.6, 0.8))),
    gas=Gas(pressure=100.0, ambient=1e5, volume=0.1),
    sensors=(Sensor(point=(0.1, 0.1, 0.0), direction=(0.0, 1.0, 0.0), gauge_length=0.05),),
)
MOVED = replace(DRUM, gas=None, supports=(Support(group="rim", motion="stroke", stretch=(1.01, 1.01, 1.0)),))
ROD = {"youngs_modulus": 1e9, "area": 1e-5, "density": 1500.0, "parts": 4}
RIGGED = replace(  # a cord from the middle, and a pole from a wall to the film with a mass along it
    MOVED,
    cables=(Cable(name="cord", path=((0.0, 0.0, 0.0), (0.0, 0.225, 0.0)), tension=5.0, zone=True, **ROD),),
    beams=(Beam(name="pole", path=((0.225, 0.0, 0.0), (0.9, 0.0, 0.1)), clamped=("pole_end",), second_moment=1e-10, **ROD),),
    masses=(PointMass(group="pole", mass=0.02),),
)
OUTPUTS = ("strain[1]", "displacement", "largest_strain", "compressed_share", "max_step")


def drum(cells, order=1, kind="quad", setup=DRUM):
    rim = {"rim": lambda x, y, z: np.hypot(x, y) > 0.4999}
    halves = {"left": lambda x, y, z: x < 0.0, "right": lambda x, y, z: x > 0.0}
    file = meshed(disc(0.5), cells, faces=halves, edges=rim, points=rim, kind=kind)
    return make_structure(replace(setup, order=order), surface_mesh(file, order))


@pytest.fixture(scope="module")
def native(once):
    """Return the folder of a native drum that is unpacked, and its file beside."""
    pytest.importorskip("ziglang", reason="native FMUs need the compiler ziglang")
    import fmpy

    def fill(folder):
        model = membrane_model(drum(3), compiled=True)
        fmpy.extract(build_fmu(model, folder, Path(__file__), native=True), str(folder / "unpacked"))

    return once("native_drum", fill)


def excited(instance, *, gas=True):
    """Return what a native drum gives while everything that can change does."""
    instance.initialize(pressure_amplitude=300.0, pressure_frequency=20.0, mass_damping=5.0)
    rows = []
    for k in range(60):
        s = np.sin(0.2 * k)
        inputs = {"pressure": 50.0 * s, "sun": 1.0, "temperature[1]": 20.0 * s, "damage[2]": 0.3, "base_acceleration[3]": s}
        more = {"gas_amount": 1.0 - 0.01 * s} if gas else {"stroke": 1.0 + 0.2 * s}
        for name, value in (inputs | more).items():
            instance.set(name, value)
        assert instance.step(2e-4) in (None, OK)
        rows.append(instance.get(*OUTPUTS, *(("gas_pressure", "volume") if gas else ())))
    return np.array(rows)


class Python:
    """A stepper with the methods of an ``Instance``."""

    def __init__(self, model):
        self.stepper = Stepper(model)
        self.set, self.step = self.stepper.set, self.stepper.step

    def initialize(self, **start):
        for name, value in start.items():
            self.stepper.set(name, value)
        self.stepper.initialize()

    def get(self, *names):
        return [self.stepper.get(name) for name in names]


@pytest.mark.parametrize(
    ("order", "kind", "cells", "setup"), [(1, "quad", 3, DRUM), (3, "quad9", 1, DRUM), (1, "triangle", 2, RIGGED)]
)
def test_as_c_it_gives_the_numbers_of_the_virtual_machine(order, kind, cells, setup, tmp_path):
    pytest.importorskip("ziglang", reason="native FMUs need the compiler ziglang")
    import fmpy

    structure, gas = drum(cells, order, kind, setup), setup.gas is not None
    fmu = build_fmu(membrane_model(structure, compiled=True), tmp_path, Path(__file__), native=True)
    instance = Instance(fmu, fmpy.extract(fmu, str(tmp_path / "unpacked")))
    wanted = excited(Python(membrane_model(structure)), gas=gas)
    assert np.allclose(excited(instance, gas=gas), wanted, rtol=1e-9, atol=1e-13)
    assert np.ptp(wanted[:, 0]) > 1e-4  # it moves
    instance.slave.freeInstance()


@pytest.mark.parametrize("order", [1, 3])
def test_the_baseline_and_avx2_give_the_same_bits(order, tmp_path):
    """The library chooses by the processor; where that has no AVX2, both are the baseline."""
    pytest.importorskip("ziglang", reason="native FMUs need the compiler ziglang")
    import fmpy

    model = membrane_model(drum(2, order, "quad9" if order == 3 else "triangle"), compiled=True)
    fmu = build_fmu(model, tmp_path, Path(__file__), native=True)
    chosen = Path(fmpy.extract(fmu, str(tmp_path / "chosen")))
    baseline = shutil.copytree(chosen, tmp_path / "baseline")
    (binary,) = baseline.glob("binaries/*/*")
    code = {path.name: path.read_bytes() for path in (chosen / "sources").iterdir()}
    options = ["-mcpu=baseline", "-DONE_INSTRUCTION_SET", "-I", str(fmi_headers())]
    binary.write_bytes(compile_shared(code, "fmi2.c", binary.name, options, "the baseline"))
    rows = []
    for folder in (chosen, baseline):
        instance = Instance(fmu, folder)
        rows.append(excited(instance))
        instance.slave.freeInstance()
    assert rows[0].tobytes() == rows[1].tobytes()


def test_its_mesh_is_read_once_and_freed_with_the_last_instance(native):
    fmu, unpacked = native / "membrane.fmu", native / "unpacked"
    first, second = Instance(fmu, unpacked, "first"), Instance(fmu, unpacked, "second")
    wanted = excited(first)
    first.slave.freeInstance()
    assert np.array_equal(excited(second), wanted)
    second.slave.freeInstance()
    again = Instance(fmu, unpacked, "again")
    assert np.array_equal(excited(again), wanted)
    again.slave.freeInstance()


def test_a_folder_with_spaces_and_letters_beyond_ascii_is_found(native, tmp_path):
    folder = tmp_path / "a mesh, größer 100%"
    shutil.copytree(native / "unpacked", folder)
    instance = Instance(native / "membrane.fmu", folder)
    instance.initialize()
    instance.slave.freeInstance()


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (lambda path: path.unlink(), "cannot open tables.bin"),
        (lambda path: path.write_bytes(path.read_bytes()[:-8]), "damaged"),
        (lambda path: path.write_bytes(path.read_bytes()[:-1] + b"\x7f"), "damaged"),
    ],
)
def test_a_mesh_that_is_missing_or_damaged_is_refused_by_name(native, tmp_path, harm, message, monkeypatch):
    shutil.copytree(native / "unpacked", tmp_path / "unpacked")
    harm(tmp_path / "unpacked" / "resources" / "tables.bin")
    logged = []
    monkeypatch.setattr(Instance, "_log", lambda *arguments: logged.append(arguments[-1].decode()))
    with pytest.raises(Exception, match="instantiate"):
        Instance(native / "membrane.fmu", tmp_path / "unpacked")
    assert len(logged) == 1
    assert message in logged[0]


def test_the_code_does_not_grow_with_the_mesh():
    """All that grows is a file of numbers: 10,000 elements are asked for in 200 KB of C; 2,000 show what does not grow."""
    small, large = (membrane_model(drum(cells), compiled=True) for cells in (2, 20))
    sizes = [
        sum(len(text) for name, text in sources(model, "", 2).items() if name != TABLES_FILE) for model in (small, large)
    ]
    assert len(large.tables.loops[0].nodes) == 5 * 20**2
    assert sizes[1] < 1.03 * sizes[0] < 200_000


def test_the_same_mesh_gives_the_same_bytes():
    one, two = (membrane_model(drum(2), compiled=True) for _ in range(2))
    assert one.tables.content() == two.tables.content()
    assert one.digest == two.digest
