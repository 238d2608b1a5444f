"""The site, built once for all tests of it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def site(once):
    """Folder of the site, built as ``make site`` does: a warning is an error."""
    pytest.importorskip("mkdocs", reason="the site needs the packages of the extra docs")
    root = Path(__file__).resolve().parents[2]

    def build(folder):
        command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
        quiet = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
        done = subprocess.run(command, cwd=root, env=quiet, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert "WARNING" not in done.stderr
        assert "Documentation built" in done.stderr  # with --quiet, mkdocs counts no warning

    return once("site", build)
