"""The newest Python that the README promises and this machine has: build, run and twin there; a warning is an error."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "constraints-light.txt"
PYTHONS = ("3.13", "3.12", "3.11")  # as the README says, newest first


def newest():
    """Return the newest of them and its version: from the path, or among the versions of pyenv."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for version in PYTHONS:
        for python in (f"python{version}", *pyenv.glob(f"{version}.*/bin/python")):
            try:
                subprocess.run([python, "-c", "import ensurepip, venv"], capture_output=True, check=True)
            except (OSError, subprocess.CalledProcessError):  # not there, or a name of pyenv without its Python
                continue
            return python, version
    return sys.executable, "{}.{}".format(*sys.version_info)


@pytest.fixture(scope="module")
def newer():
    """Command of an environment with Gossamer and the light packages, kept in ``build`` as long as these stay the same."""
    python, version = newest()
    if version == "{}.{}".format(*sys.version_info):
        pytest.skip(f"all tests run on Python {version}, the newest on this machine")
    depends_on = hashlib.sha256(LOCK.read_bytes() + (ROOT / "pyproject.toml").read_bytes())
    folder = ROOT / f"build/python{version}_{depends_on.hexdigest()[:12]}"
    if not (folder / "complete").exists():
        subprocess.run([python, "-m", "venv", "--clear", folder], check=True)
        pip = [folder / "bin/python", "-m", "pip", "install", "--quiet", "--no-compile", "--no-deps"]
        done = subprocess.run([*pip, "--require-hashes", "-r", LOCK], capture_output=True, text=True, check=False)
        if done.returncode:
            pytest.skip(f"the packages for Python {version} cannot be installed: {done.stderr[-300:]}")
        subprocess.run([*pip, "--no-build-isolation", "--editable", ROOT], check=True)
        (folder / "complete").touch()
    return folder / "bin/gossamer"


def test_the_newest_python_builds_runs_and_fits_without_a_warning(newer, tmp_path):
    strict = {**os.environ, "PYTHONWARNINGS": "error"}

    def gossamer(*words):
        return subprocess.run(
            [newer, *words], cwd=tmp_path, env=strict, check=True, text=True, stdout=subprocess.PIPE
        ).stdout

    gossamer("build")
    gossamer("build", "membrane", "--order", "1")
    gossamer("run", "damaged", "--stop", "0.024")
    answer = json.loads(gossamer("twin", "out/damaged", "--elements-per-side", "4", "--order", "1", "--json"))
    assert answer["valid"]
    assert answer["damage"][0] == pytest.approx(0.4, abs=0.02)
