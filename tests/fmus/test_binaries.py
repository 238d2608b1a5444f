"""The compiled libraries of every platform, read as files: exports, needs, the same bytes twice."""

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import pytest
from gossamer_fmus import build_all

lief = pytest.importorskip("lief")
pytest.importorskip("ziglang", reason="native FMUs need the compiler ziglang")

PLACES = {
    2: {"linux64/sensor.so", "win64/sensor.dll", "darwin64/sensor.dylib"},
    3: {
        "x86_64-linux/sensor.so",
        "aarch64-linux/sensor.so",
        "x86_64-windows/sensor.dll",
        "x86_64-darwin/sensor.dylib",
        "aarch64-darwin/sensor.dylib",
    },
}
# In the header of FMI 2.0, but for model exchange only.
MODEL_EXCHANGE = {
    "fmi2EnterEventMode",
    "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode",
    "fmi2CompletedIntegratorStep",
    "fmi2SetTime",
    "fmi2SetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetEventIndicators",
    "fmi2GetContinuousStates",
    "fmi2GetNominalsOfContinuousStates",
}


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    """FMUs of the sensor for all platforms, by version of FMI."""
    return {
        fmi: build_all(tmp_path_factory.mktemp("all"), ["sensor"], native=True, fmi=fmi, platforms=["all"])["sensor"]
        for fmi in (2, 3)
    }


def libraries(archive):
    """Libraries of an FMU by path below ``binaries/``."""
    with zipfile.ZipFile(archive) as members:
        return {
            name.removeprefix("binaries/"): list(members.read(name))
            for name in members.namelist()
            if name.startswith("binaries/")
        }


def functions(fmi):
    """Names of all functions that the standard's header lists for co-simulation."""
    header = (Path(fmpy.__file__).parent / f"c-code/fmi{fmi}Functions.h").read_text()
    return set(re.findall(rf"FMI{fmi}_Export\s+\w+\s+(fmi{fmi}\w+);", header)) - MODEL_EXCHANGE


@pytest.mark.parametrize("fmi", [2, 3])
def test_every_platform_has_its_library_where_the_standard_wants_it_in_three_megabytes(archives, fmi):
    assert set(libraries(archives[fmi])) == PLACES[fmi]
    assert archives[fmi].stat().st_size < 3e6


@pytest.mark.parametrize("fmi", [2, 3])
def test_linux_libraries_export_fmi_alone_and_need_an_old_c_library_alone(archives, fmi):
    for place, content in libraries(archives[fmi]).items():
        if not place.endswith(".so"):
            continue
        library = lief.ELF.parse(content)
        arm = "aarch64" in place
        assert library.header.machine_type == (lief.ELF.ARCH.AARCH64 if arm else lief.ELF.ARCH.X86_64)
        assert {symbol.name for symbol in library.exported_symbols} == functions(fmi) | {"sensor_first_instance"}
        assert set(library.libraries) <= {"libc.so.6", "libm.so.6"}
        versions = [
            tuple(int(part) for part in version.name.removeprefix("GLIBC_").split("."))
            for needed in library.symbols_version_requirement
            for version in needed.get_auxiliary_symbols()
        ]
        assert (2, 2) <= max(versions) <= (2, 17)
        assert not [s.name for s in library.sections if s.name == ".symtab" or s.name.startswith(".debug")]
        assert not library.has(lief.ELF.DynamicEntry.TAG.RUNPATH)
        assert not library.has(lief.ELF.DynamicEntry.TAG.TEXTREL)


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_windows_library_exports_fmi_alone_and_needs_the_system_alone(archives, fmi):
    (content,) = (content for place, content in libraries(archives[fmi]).items() if place.endswith(".dll"))
    library = lief.PE.parse(content)
    assert library.header.machine == lief.PE.Header.MACHINE_TYPES.AMD64
    assert {entry.name for entry in library.get_export().entries} == functions(fmi) | {"sensor_first_instance"}
    for imported in library.imports:
        assert imported.name == "KERNEL32.dll" or imported.name.startswith("api-ms-win-crt-")
    assert lief.PE.Debug.TYPES.REPRO in [entry.type for entry in library.debug]  # a digest stands for the time


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_mac_libraries_export_fmi_alone_need_the_system_alone_and_are_signed_for_arm(archives, fmi):
    names = [name for name in PLACES[fmi] if name.endswith(".dylib")]
    files = [lief.MachO.parse(libraries(archives[fmi])[name]) for name in names]  # own the parts
    parts = [part for file in files for part in file]
    processors = lief.MachO.Header.CPU_TYPE
    assert {part.header.cpu_type for part in parts} == {processors.X86_64, processors.ARM64}
    for part in parts:
        exported = {symbol.name[1:] for symbol in part.exported_symbols}
        assert exported == functions(fmi) | {
            "sensor_first_instance",
            "_mh_dylib_header",
            "__dso_handle",
        }  # the last: the linker's
        assert {library.name for library in part.libraries} == {"sensor.dylib", "/usr/lib/libSystem.B.dylib"}
        assert part.build_version.minos == [11, 0, 0]
        assert part.has_code_signature or part.header.cpu_type == processors.X86_64


def test_a_build_in_another_process_and_folder_gives_the_same_bytes(archives, tmp_path):
    usual = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "zig"  # headers and libraries of platforms
    anew = {"ZIG_GLOBAL_CACHE_DIR": str(usual), **os.environ, "XDG_CACHE_HOME": str(tmp_path / "no libraries")}
    build(tmp_path, 3, ["all"], anew)
    assert (tmp_path / "sensor.fmu").read_bytes() == archives[3].read_bytes()


def test_a_compiler_that_remembers_nothing_gives_the_same_bytes(archives, tmp_path):
    folders = {"ZIG_GLOBAL_CACHE_DIR": "global", "ZIG_LOCAL_CACHE_DIR": "local", "XDG_CACHE_HOME": "no libraries"}
    cold = {name: str(tmp_path / folder) for name, folder in folders.items()}
    build(tmp_path, 2, ["linux64"], os.environ | cold)
    built = libraries(tmp_path / "sensor.fmu")
    assert built["linux64/sensor.so"] == libraries(archives[2])["linux64/sensor.so"]


def build(folder, fmi, platforms, environment):
    code = (
        "from pathlib import Path; from gossamer_fmus import build_all; "
        f"build_all(Path({str(folder)!r}), ['sensor'], native=True, fmi={fmi}, platforms={platforms!r})"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
