"""fmutool (FMU Manipulation Toolbox) checks model descriptions against the standard's schema and rules."""

import subprocess
import sys
import zipfile

import pytest
from gossamer_fmus import NAMES


def check(fmu):
    command = [sys.executable, "-m", "fmu_manipulation_toolbox", "-input", fmu, "-check"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("name", NAMES)
def test_fmutool_finds_nothing_wrong(name, fmus):
    status, said = check(fmus / f"{name}.fmu")
    assert "seems to be compliant with FMI-2.0" in said
    assert "No semantic error against the FMI-2 standard" in said
    assert (status, said.count("ERROR")) == (0, 0), said


def test_fmutool_finds_what_is_wrong(fmus, tmp_path):
    wrong = tmp_path / "sensor.fmu"
    with zipfile.ZipFile(fmus / "sensor.fmu") as old, zipfile.ZipFile(wrong, "w") as new:
        description = old.read("modelDescription.xml")
        new.writestr("modelDescription.xml", description.replace(b'causality="output"', b'causality="parameter"', 1))
    status, said = check(wrong)
    assert status != 0
    assert "which is not an output" in said
