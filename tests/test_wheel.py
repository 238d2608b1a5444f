"""Gossamer works in environments of its own: as a wheel with the packages of a lock file alone, and on the newest Python."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import sysconfig
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("gossamer_files", "gossamer_models", "gossamer_fmus", "gossamer_orchestrator", "gossamer")
SCRIPTS = Path(sysconfig.get_path("scripts", vars={"base": "."})).name
PYTHONS = ("3.13", "3.12", "3.11")  # as the README says, newest first
LOCKS = {"light": ("constraints-light.txt",), "demo": ("constraints-light.txt", "ziglang"), "all": ("constraints.txt",)}


def run(folder, *command, warnings="default", **options):
    """Run a command in a folder without this checkout on any path."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    environment["PYTHONWARNINGS"] = warnings
    return subprocess.run(command, cwd=folder, env=environment, check=True, text=True, **options)


def build_run_and_fit(folder, gossamer, **options):
    """Build FMUs, run them, and let the twin find the damage."""
    for words in (["build"], ["build", "membrane", "--order", "1"], ["run", "damaged", "--stop", "0.024"]):
        run(folder, gossamer, *words, stdout=subprocess.DEVNULL, **options)
    assert (folder / "out/damaged/report.html").is_file()
    twin = [gossamer, "twin", "out/damaged", "--elements-per-side", "4", "--order", "1", "--json"]
    answer = json.loads(run(folder, *twin, stdout=subprocess.PIPE, **options).stdout)
    assert answer["valid"]
    assert answer["damage"][0] == pytest.approx(0.4, abs=0.02)


def packages(*sources):
    """Names of packages, of the lock files among ``sources`` those that they pin."""
    for source in sources:
        lock = ROOT / source
        pinned = re.findall(r"^([\w-]+)==", lock.read_text(encoding="utf-8"), re.MULTILINE) if lock.is_file() else [source]
        yield from dict.fromkeys(pinned)


def link(name, folder):
    """Make an installed package importable in a folder of another environment."""
    try:
        found = distribution(name)
    except PackageNotFoundError:  # another Python needs it
        return
    for top in {file.parts[0] for file in found.files if file.parts[0] not in ("..", "__pycache__")}:
        if not (folder / top).exists():
            (folder / top).symlink_to(found.locate_file(top))


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Return the folder of the commands of an environment with the wheel and the packages of a lock, made once each."""
    folder = tmp_path_factory.mktemp("wheel")
    run(ROOT, sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder))
    (wheel,) = folder.glob("gossamer-*.whl")

    def environment(lock):
        commands = folder / lock / SCRIPTS
        if not commands.exists():
            run(folder, sys.executable, "-m", "venv", "--without-pip", lock)
            pip = [sys.executable, "-m", "pip", "--python", str(commands / "python"), "install", "--quiet"]
            run(folder, *pip, "--no-index", "--no-deps", str(wheel))
            where = [commands / "python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
            site_packages = Path(run(folder, *where, capture_output=True).stdout.strip())
            for name in packages(*LOCKS[lock]):
                link(name, site_packages)
        return commands

    return environment


def test_all_packages_come_from_the_wheel(installed, tmp_path):
    commands = installed("all")
    script = f"import json, importlib; print(json.dumps([importlib.import_module(n).__file__ for n in {PACKAGES}]))"
    files = json.loads(run(tmp_path, commands / "python", "-c", script, capture_output=True).stdout)
    for file in files:
        assert Path(file).is_relative_to(commands.parent)
        assert Path(file).with_name("py.typed").is_file()


def test_the_demo_runs_in_another_folder_with_what_make_demo_installs(installed, tmp_path):
    printed = run(tmp_path, installed("demo") / "gossamer", "demo", capture_output=True)
    written = [tmp_path / line for line in printed.stdout.splitlines()]
    assert {"results.nc", "report.html", "watch.json"} <= {path.name for path in written}
    assert all(path.is_file() for path in written)
    assert "Open out/damage_begins/report.html" in " ".join(printed.stderr.split())
    alarms = json.loads((tmp_path / "out/damage_begins/watch.json").read_text())["alarms"]
    assert 0.7671 < alarms[0] < 0.9  # damage begins at 0.7671 s; an alarm comes within two windows


def test_what_it_writes_is_read_in_python(installed, tmp_path):
    script = "import gossamer; print(*gossamer.build('sensor', out='fmus'), gossamer.verify('fmus/sensor.fmu').passed)"
    assert run(tmp_path, installed("all") / "python", "-c", script, capture_output=True).stdout.split() == ["sensor", "True"]


def test_the_light_install_runs_identifies_and_fits_the_twin(installed, tmp_path):
    commands = installed("light")
    for absent in ("ziglang", "cmake", "dask", "zarr", "meshio", "nbformat"):
        with pytest.raises(subprocess.CalledProcessError):
            run(tmp_path, commands / "python", "-c", f"import {absent}", stderr=subprocess.DEVNULL)
    build_run_and_fit(tmp_path, commands / "gossamer")
    time = np.arange(0.0, 60.0, 0.5)
    strain = 0.02 * (1.0 - np.cos(0.3 * time))
    record = np.column_stack([time, strain, 100.0 + 500.0 * strain + 20.0 * np.sqrt(strain)])
    np.savetxt(tmp_path / "mine.csv", record, delimiter=",", header="time [s],strain [1],resistance [ohm]", comments="")
    model = ("--model", "preisach", "--modes", "2", "--relaxations", "1")
    run(tmp_path, commands / "gossamer", "identify", "mine.csv", *model, "--out", "mine.json", stdout=subprocess.DEVNULL)
    assert (tmp_path / "mine/report.html").is_file()


def newest():
    """Return the newest Python of the README on this machine and its version: from the path, or among those of pyenv."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for version in PYTHONS:
        for python in (f"python{version}", *pyenv.glob(f"{version}.*/bin/python")):
            try:
                subprocess.run([python, "-c", "import ensurepip, venv"], capture_output=True, check=True)
            except (OSError, subprocess.CalledProcessError):  # not there, or a name of pyenv without its Python
                continue
            return python, version
    return sys.executable, "{}.{}".format(*sys.version_info)


def test_the_newest_python_builds_runs_and_fits_without_a_warning(tmp_path):
    """With the light packages, in an environment that is kept in ``build`` as long as these stay the same."""
    python, version = newest()
    if version == "{}.{}".format(*sys.version_info):
        pytest.skip(f"all tests run on Python {version}, the newest on this machine")
    lock = ROOT / "constraints-light.txt"
    depends_on = hashlib.sha256(lock.read_bytes() + (ROOT / "pyproject.toml").read_bytes())
    folder = ROOT / f"build/python{version}_{depends_on.hexdigest()[:12]}"
    if not (folder / "complete").exists():
        subprocess.run([python, "-m", "venv", "--clear", folder], check=True)
        pip = [folder / "bin/python", "-m", "pip", "install", "--quiet", "--no-compile", "--no-deps"]
        done = subprocess.run([*pip, "--require-hashes", "-r", lock], capture_output=True, text=True, check=False)
        if done.returncode:
            pytest.skip(f"the packages for Python {version} cannot be installed: {done.stderr[-300:]}")
        subprocess.run([*pip, "--no-build-isolation", "--editable", ROOT], check=True)
        (folder / "complete").touch()
    build_run_and_fit(tmp_path, folder / "bin/gossamer", warnings="error")
