"""FMI-LS-XCP: where the values of native FMUs lie, against their memory on Linux and a reader of A2L."""

import ctypes
import re
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from fmu_host import Instance, excite, model_of
from gossamer_fmus import NAMES, build_all
from gossamer_fmus.a2l import FOLDER, VALUES_OFFSET

pytest.importorskip("ziglang", reason="native FMUs need the compiler ziglang")


@pytest.fixture(autouse=True)
def fixed_address(monkeypatch):
    monkeypatch.setenv("GOSSAMER_FIXED_ADDRESS", "1")


def members_of(path):
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def addresses(text):
    """Address of each variable by its name in A2L."""
    return {
        name: int(address, 16) for name, address in re.findall(r"^/begin \w+ (\S+) .*?(0x[0-9A-F]{8})", text, re.MULTILINE)
    }


def a2l_name(name):
    return name.replace(",", "][")


def base_of(library):
    """Where this process has loaded a library."""
    for line in Path("/proc/self/maps").read_text().splitlines():
        if line.endswith(str(library)):
            return int(line.split("-")[0], 16)
    raise AssertionError(library)


@pytest.mark.skipif(sys.platform != "linux", reason="the addresses of libraries are read as Linux has them")
@pytest.mark.parametrize("name", NAMES)
def test_values_of_the_first_instance_lie_where_the_file_says(built, unzipped_once, name):
    path = built("native")[name]
    folder = Path(unzipped_once(path))
    model = model_of(name)
    text = (folder / FOLDER / "linux64" / f"{model.name}.a2l").read_text()
    at = addresses(text)
    assert list(at) == [a2l_name(v.name) for v in model.variables]
    first = Instance(path, folder, "first")
    second = Instance(path, folder, "second")
    try:
        for fmu in (first, second):
            fmu.initialize()
            for key, value in excite(name, 1).items():
                fmu.set(key, value)
            assert fmu.step(3e-4) == 0
        base = base_of((folder / "binaries/linux64" / f"{model.name}.so").resolve())
        for v in model.variables:
            place = ctypes.c_double.from_address(base + at[a2l_name(v.name)])
            assert place.value == first.get(v.name)[0]
            place.value = 0.125
            assert first.get(v.name) == [0.125]
            assert second.get(v.name) != [0.125] or second.get(v.name) == [v.start]
    finally:
        second.slave.freeInstance()
        first.slave.freeInstance()


def test_a_parameter_that_is_written_there_is_that_of_the_next_step(built, unzipped_once):
    path = built("native")["sensor"]
    folder = Path(unzipped_once(path))
    at = addresses((folder / FOLDER / "linux64/sensor.a2l").read_text())
    found = []
    for written in (100.0, 200.0):
        fmu = Instance(path, folder)
        try:
            fmu.initialize(strain=0.0)
            base = base_of((folder / "binaries/linux64/sensor.so").resolve())
            ctypes.c_double.from_address(base + at["rest_resistance"]).value = written
            assert fmu.step(3e-4) == 0
            found += fmu.get("resistance")
        finally:
            fmu.slave.freeInstance()
    assert found[1] - found[0] == pytest.approx(100.0)


@pytest.mark.parametrize("fmi", [2, 3])
def test_every_platform_has_a_file_with_the_address_of_its_first_instance(tmp_path, fmi):
    lief = pytest.importorskip("lief")
    path = build_all(tmp_path, ["sensor"], native=True, fmi=fmi, platforms=["all"])["sensor"]
    members = members_of(path)
    first_value = {}
    for name, library in members.items():
        if name.startswith("binaries/"):
            found = lief.parse(list(library))
            parts = (
                [lief.MachO.parse(list(library)).at(k) for k in range(2)]
                if name.endswith("darwin64/sensor.dylib")
                else [found]
            )
            for part in parts:
                platform = name.split("/")[1]
                if len(parts) > 1:
                    platform = "aarch64-darwin" if "ARM64" in str(part.header.cpu_type) else "x86_64-darwin"
                if isinstance(part, lief.PE.Binary):
                    (address,) = [e.address for e in part.get_export().entries if e.name == "sensor_first_instance"]
                else:
                    names = ("sensor_first_instance", "_sensor_first_instance")
                    (address,) = {s.value for s in part.symbols if s.name in names}
                first_value[platform] = address + VALUES_OFFSET
    written = {name.split("/")[2]: text for name, text in members.items() if name.endswith(".a2l")}
    assert {name: next(iter(addresses(text.decode()).values())) for name, text in written.items()} == first_value


def test_a_parser_of_a2l_reads_every_file_as_it_was_meant(built, tmp_path):
    """In a process of its own: its database writes where it is run."""
    if find_spec("pya2l") is None:
        pytest.skip("the parser pya2ldb is not installed")
    for name, path in built("native").items():
        (tmp_path / f"{name}.a2l").write_bytes(members_of(path)[f"{FOLDER}/linux64/{model_of(name).name}.a2l"])
    code = (
        "import pya2l, sys; from pya2l import model\n"
        "for name in sys.argv[1:]:\n"
        "    s = pya2l.import_a2l(name + '.a2l')\n"
        "    units = {c.name: c.unit for c in s.query(model.CompuMethod).all()}\n"
        "    rows = [(m.ecu_address.address, m) for m in s.query(model.Measurement).all()]\n"
        "    rows += [(m.address, m) for m in s.query(model.Characteristic).all()]\n"
        "    for a, m in sorted(rows, key=lambda row: row[0]):\n"
        "        ends = m.lowerLimit, m.upperLimit\n"
        "        row = (type(m).__name__, m.name, a, units[m.conversion], *ends, m.symbol_link.offset)\n"
        "        print('row', name, *row, sep='\\t')\n"
    )
    command = [sys.executable, "-W", "ignore", "-c", code, *NAMES]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    printed = [line.split("\t")[1:] for line in done.stdout.splitlines() if line.startswith("row")]
    for name in NAMES:
        rows = [row for which, *row in printed if which == name]
        variables = model_of(name).variables
        assert len(rows) == len(variables)
        for k, (v, (kind, label, address, unit, low, high, offset)) in enumerate(zip(variables, rows, strict=True)):
            assert kind == ("Characteristic" if v.causality == "parameter" else "Measurement")
            assert (label, unit, int(offset)) == (a2l_name(v.name), v.unit, VALUES_OFFSET + 8 * k)
            assert int(address) == int(rows[0][2]) + 8 * k
            assert float(low) == (-sys.float_info.max if v.minimum is None else v.minimum)
            assert float(high) == (sys.float_info.max if v.maximum is None else v.maximum)


def test_the_manifest_says_that_an_importer_may_read_the_memory(built):
    members = members_of(built("native")["sensor"])
    root = ET.fromstring(members[f"{FOLDER}/fmi-ls-manifest.xml"])
    space = "{http://fmi-standard.org/fmi-ls-manifest}"
    assert root.tag == "fmiLayeredStandardManifest"
    assert root.get(f"{space}fmi-ls-name") == FOLDER.split("/")[1]
    assert (root.get("containsXcpService"), root.get("supportsDirectMemoryAccessViaA2L")) == ("false", "true")
    assert b"relative to the base address" in members["documentation/fmi-ls-xcp.txt"]
