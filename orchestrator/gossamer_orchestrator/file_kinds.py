"""Explain what a file is when a command expected another kind."""

from __future__ import annotations

import zipfile
from pathlib import Path

_MEMBERS = {
    "modelDescription.xml": "It is an FMU: look at it with 'gossamer info' or 'gossamer verify'.",
    "SystemStructure.ssd": "It is an SSP: run it with 'gossamer run'.",
}
_HEADS = {
    b"PK": "It is an incomplete ZIP archive. Build or copy it again.",
    b"\x89PNG": "It is a picture (PNG).",
    b"\xff\xd8": "It is a picture (JPEG).",
    b"%PDF": "It is a PDF.",
    b"CDF": "It is a results file (netCDF): open it with xarray.",
    b"\x89HDF": "It is HDF5.",
    b"\xff\xfe": "It is text in UTF-16: save it as UTF-8.",
    b"\xfe\xff": "It is text in UTF-16: save it as UTF-8.",
    b"\x7fELF": "It is a Linux binary.",
}


def explain_file(path: Path) -> str:
    """Say what a file is and which command takes it, as a sentence."""
    if path.is_dir():
        return "It is a folder."
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                names = archive.namelist()
            return next(
                (text for name, text in _MEMBERS.items() if name in names), "It is a ZIP archive of another kind."
            )
        with path.open("rb") as file:
            head = file.read(4096)
    except (OSError, zipfile.BadZipFile):
        return "It cannot be read; build or copy it again."
    kind = next((text for start, text in _HEADS.items() if head.startswith(start)), None)
    if kind is None and path.suffix == ".toml":
        return "It seems to be a scenario: run it with 'gossamer run'."
    return kind or ("It is empty." if not head else "It is some other data." if b"\0" in head else "It is text.")
