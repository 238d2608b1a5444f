"""The C that a model is written as, and what the compiler makes of it."""

import math
import shutil
import subprocess
from pathlib import Path

import fmpy
import numpy as np
import pytest
from gossamer_fmus.c_code import sources, with_guid
from gossamer_fmus.catalogue import MODELS
from gossamer_fmus.compiler import choose_platforms, fmi_headers, universal
from gossamer_models import ParameterError, Stepper
from gossamer_models.membrane import membrane_model, square_structure


def test_the_membranes_two_expressions_give_the_same_numbers():
    """One maps one element's function, whose C is small; the other is columns, which suit the virtual machine."""
    both = [Stepper(membrane_model(square_structure(4), mapped=mapped), pressure_amplitude=2e4) for mapped in (False, True)]
    for stepper in both:
        stepper.set("damage[6]", 0.3)
        stepper.initialize()
    for k in range(100):
        for stepper in both:
            stepper.set("base_acceleration", 5.0 * math.sin(0.1 * k))
            stepper.step(3e-4)
        assert np.allclose(both[0]._x, both[1]._x, rtol=1e-10, atol=1e-13)


def test_platforms_are_chosen_by_name_and_a_wrong_one_is_refused_with_those_there_are():
    assert choose_platforms(["all"], 2) == ["linux64", "win64", "darwin64"]
    assert choose_platforms(["all"], 3) == ["linux64", "win64", "darwin64", "aarch64-linux"]
    with pytest.raises(ParameterError, match="'aarch64-linux' only with fmi=3"):
        choose_platforms(["aarch64-linux"], 2)
    with pytest.raises(ParameterError, match="'solaris'; choose from linux64, win64, darwin64 and all"):
        choose_platforms(["linux64", "solaris"], 2)


def test_the_sources_name_no_path_and_depend_on_the_model_alone():
    first, second = (sources(MODELS["sensor"](), "{guid}", 2) for _ in range(2))
    assert first == second
    assert set(first) == {"fmi2.c", "stepper.h", "state.h", "instance.h", "model.h", "functions.h"}
    assert not any(b"/home" in text or b"/tmp" in text for text in first.values())


def test_a_guid_put_in_later_is_all_that_changes():
    model = MODELS["sensor"]()
    without = sources(model, "", 2)
    named = with_guid(without, "{1-2}")
    assert named == sources(model, "{1-2}", 2)
    assert [name for name in without if without[name] != named[name]] == ["model.h"]


def test_a_universal_library_lists_its_parts_by_processor():
    """Two headers of Mach-O files: x86-64 (0x01000007, 3) and arm64 (0x0100000c, 0), little-endian."""
    parts = [bytes.fromhex("cffaedfe07000001030000000600") + b"x" * 9, bytes.fromhex("cffaedfe0c00000100000000") + b"y" * 9]
    fat = universal(parts)
    head = np.frombuffer(fat[: 8 + 2 * 20], dtype=">u4").tolist()
    assert head[:2] == [0xCAFEBABE, 2]
    for k, (processor, subtype) in enumerate([(0x01000007, 3), (0x0100000C, 0)]):
        found, found_subtype, offset, size, align = head[2 + 5 * k : 7 + 5 * k]
        assert (found, found_subtype) == (processor, subtype)
        assert offset % (1 << align) == 0
        assert fat[offset : offset + size] == parts[k]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="links with gcc, which is not installed")
def test_sources_of_two_fmus_can_be_linked_into_one_program(tmp_path):
    """As importers for embedded targets do: with a prefix for the FMI functions; a host's own header asks for it."""
    objects = []
    for name in ("sensor", "detector"):
        folder = tmp_path / name
        folder.mkdir()
        for file, content in sources(MODELS[name](), "{guid}", 3).items():
            (folder / file).write_bytes(content)
        objects.append(str(tmp_path / f"{name}.o"))
        prefix = f"-DFMI3_FUNCTION_PREFIX={name}_"
        command = ["gcc", "-O0", "-c", "fmi3.c", "-o", objects[-1], prefix, "-I", str(fmi_headers())]
        subprocess.run(command, cwd=folder, check=True)
    (tmp_path / "main.c").write_text(
        "const char *sensor_fmi3GetVersion(void), *detector_fmi3GetVersion(void);\n"
        "int main(void) { return sensor_fmi3GetVersion()[0] - detector_fmi3GetVersion()[0]; }\n"
    )
    program = str(tmp_path / "main")
    subprocess.run(["gcc", str(tmp_path / "main.c"), *objects, "-lm", "-o", program], check=True)
    assert subprocess.run([program], check=False).returncode == 0


@pytest.mark.skipif(shutil.which("gcc") is None, reason="looks at the frames of gcc, which is not installed")
def test_the_factors_of_a_large_membrane_are_not_on_the_stack(tmp_path):
    """A host's thread may have some 100 KB; the factors of 100 x 100 elements take 10 MB."""
    for file, content in sources(membrane_model(square_structure(16, 1), compiled=True), "", 2).items():
        (tmp_path / file).write_bytes(content)
    headers = Path(fmpy.__file__).parent / "c-code"
    command = ["gcc", "-O0", "-c", "fmi2.c", "-o", "/dev/null", "-I", str(headers), "-Werror=frame-larger-than=20000"]
    subprocess.run(command, cwd=tmp_path, check=True)
