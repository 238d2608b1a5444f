"""SSP archives as a stranger might write them."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from ssp_structures import EXPERIMENT, SSD


@pytest.fixture
def make(fmus, tmp_path):
    """Write an archive as a stranger might."""

    def write(content: str, rest: str = EXPERIMENT, files: dict[str, str] | None = None, ssd: str = SSD) -> Path:
        path = tmp_path / "other.ssp"
        with zipfile.ZipFile(path, "w") as file:
            for name, text in (files or {}).items():
                file.writestr(name, text)
            for fmu in ("gain", "integrator", "pascal", "kilo", "metre", "delay", "clock"):
                if f"/{fmu}.fmu" in content:
                    file.write(fmus / f"{fmu}.fmu", f"resources/{fmu}.fmu")
            file.writestr("SystemStructure.ssd", ssd.format(content=content, rest=rest))
        return path

    return write
