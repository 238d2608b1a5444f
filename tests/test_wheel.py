"""The wheel works where nothing else of Gossamer is: in an environment of its own, in another folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("gossamer_files", "gossamer_models", "gossamer_fmus", "gossamer_orchestrator", "gossamer")
SCRIPTS = Path(sysconfig.get_path("scripts", vars={"base": "."})).name


def run(folder, *command, **options):
    """Run a command in a folder without this checkout on any path."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(command, cwd=folder, env=environment, check=True, text=True, **options)


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Folder of the commands of an environment with the wheel, and all that it depends on."""
    folder = tmp_path_factory.mktemp("wheel")
    run(ROOT, sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder))
    (wheel,) = folder.glob("gossamer-*.whl")
    run(folder, sys.executable, "-m", "venv", "environment")
    commands = folder / "environment" / SCRIPTS
    run(folder, commands / "python", "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", str(wheel))
    # Dependencies are seen in the environment of this test. A path file that lies in a path of a path file is not read, so
    # the checkout, which is installed there by one, is not seen.
    find = [commands / "python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    packages = Path(run(folder, *find, capture_output=True).stdout.strip())
    paths = dict.fromkeys(sysconfig.get_path(kind) for kind in ("purelib", "platlib"))
    (packages / "dependencies.pth").write_text("\n".join(paths), encoding="utf-8")
    return commands


def test_all_packages_come_from_the_wheel(installed, tmp_path):
    script = f"import json, importlib; print(json.dumps([importlib.import_module(n).__file__ for n in {PACKAGES}]))"
    files = json.loads(run(tmp_path, installed / "python", "-c", script, capture_output=True).stdout)
    for file in files:
        assert Path(file).is_relative_to(installed.parent)
        assert Path(file).with_name("py.typed").is_file()


def test_the_demo_runs_in_another_folder(installed, tmp_path):
    printed = run(tmp_path, installed / "gossamer", "demo", capture_output=True)
    written = [tmp_path / line for line in printed.stdout.splitlines()]
    assert {"results.nc", "report.html", "watch.json"} <= {path.name for path in written}
    assert all(path.is_file() for path in written)
    assert "Open out/damage_begins/report.html" in " ".join(printed.stderr.split())
    alarms = json.loads((tmp_path / "out/damage_begins/watch.json").read_text())["alarms"]
    assert 0.7671 < alarms[0] < 0.9  # damage begins at 0.7671 s; an alarm comes within two windows


def test_what_it_writes_is_read_in_python(installed, tmp_path):
    script = "import gossamer; print(*gossamer.build('sensor', out='fmus'), gossamer.verify('fmus/sensor.fmu').passed)"
    assert run(tmp_path, installed / "python", "-c", script, capture_output=True).stdout.split() == ["sensor", "True"]
