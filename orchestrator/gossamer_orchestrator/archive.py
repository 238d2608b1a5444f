"""Unpack an FMU from anywhere: what its archive says about itself is checked first."""

from __future__ import annotations

import stat
import zipfile
from pathlib import Path, PurePosixPath

from .errors import FmuError

MAX_FILES = 20_000
MAX_BYTES = 2 * 1024**3


def check_archive(path: Path) -> None:
    """Refuse a file that is no ZIP archive, leaves its folder when unpacked, or is absurdly large.

    Raises
    ------
    FmuError
        With the name or number at fault.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except (OSError, zipfile.BadZipFile) as error:
        msg = f"{path} is no FMU: {error}. An FMU is a ZIP archive; build or copy it again."
        raise FmuError(msg) from None
    size = sum(member.file_size for member in members)
    if len(members) > MAX_FILES or size > MAX_BYTES:
        msg = (
            f"{path} holds {len(members)} files of {size / 1024**2:.0f} MiB unpacked, more than {MAX_FILES} files or "
            f"{MAX_BYTES // 1024**2} MiB. It is not unpacked; ask its author for a smaller one."
        )
        raise FmuError(msg)
    for member in members:
        name = member.filename
        place = PurePosixPath(name)
        link = stat.S_ISLNK(member.external_attr >> 16)
        if link or place.is_absolute() or ".." in place.parts or "\\" in name or ":" in name:
            what = "is a link" if link else "would be written outside its folder"
            msg = f"{path}: its member {name!r} {what}. Such an archive is not unpacked; do not trust it."
            raise FmuError(msg)
    names = {member.filename for member in members}
    if "modelDescription.xml" not in names:
        msg = f"{path} is no FMU: it holds no modelDescription.xml. Build or copy it again."
        raise FmuError(msg)


def is_python_fmu(path: Path) -> bool:
    """Tell whether an FMU is one of pythonfmu's, whose log texts are no printf formats."""
    with zipfile.ZipFile(path) as archive:
        return "resources/slavemodule.txt" in archive.namelist()
