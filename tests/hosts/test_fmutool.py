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


def assert_nothing_wrong(fmu, version):
    status, printed = check(fmu)
    assert f"seems to be compliant with FMI-{version}.0" in printed
    assert f"No semantic error against the FMI-{version} standard" in printed
    assert (status, printed.count("ERROR")) == (0, 0), printed


@pytest.mark.parametrize("name", NAMES)
def test_fmutool_finds_nothing_wrong(name, fmus):
    assert_nothing_wrong(fmus / f"{name}.fmu", 2)


@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_fmutool_finds_nothing_wrong_in_fmi_3(with_fmi3):
    for fmu in {component["fmu"] for component in with_fmi3()}:
        assert_nothing_wrong(fmu, 3)


def test_fmutool_finds_what_is_wrong(fmus, tmp_path):
    wrong = tmp_path / "sensor.fmu"
    with zipfile.ZipFile(fmus / "sensor.fmu") as old, zipfile.ZipFile(wrong, "w") as new:
        description = old.read("modelDescription.xml")
        new.writestr("modelDescription.xml", description.replace(b'causality="output"', b'causality="parameter"', 1))
    status, printed = check(wrong)
    assert status != 0
    assert "which is not an output" in printed
