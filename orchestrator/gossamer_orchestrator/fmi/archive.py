"""Unpack archives that are not trusted, and write archives.

What an archive declares is checked first, and no more than that is unpacked.
"""

from __future__ import annotations

import stat
import zipfile
import zlib
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from gossamer_files.options import option

from ..errors import FmuError, OrchestratorError, check_path, explain_file
from ..names import suggest

MAX_FILES = 20_000
MAX_BYTES = 2 * 1024**3
_ENCRYPTED = 0x1


class Kind(NamedTuple):
    """What an archive should be: its name for messages, the member that makes it one, and the error if it is none."""

    name: str
    needs: str
    failure: type[OrchestratorError]


FMU = Kind("FMU", "modelDescription.xml", FmuError)


def check_archive(path: Path, kind: Kind = FMU) -> None:
    """Refuse a file that is not a ZIP archive, leaves its folder when unpacked, is ambiguous, or is absurdly large.

    Raises
    ------
    FmuError
        Or what ``kind`` says, with the name or number at fault.
    """
    check_path(path, kind.failure)
    if not path.exists():
        known = sorted(p.name for p in path.parent.glob(f"*{path.suffix}"))
        msg = f"there is no file {path}. {suggest(path.name, known) if known else ''}".rstrip()
        raise kind.failure(msg)
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except (OSError, zipfile.BadZipFile):
        msg = f"{path} is not an {kind.name}. {explain_file(path)}"
        raise kind.failure(msg) from None
    size = sum(member.file_size for member in members)
    if len(members) > MAX_FILES or size > MAX_BYTES:
        msg = (
            f"{path} holds {len(members)} files of {size / 1024**2:.0f} MiB unpacked, more than {MAX_FILES} files or "
            f"{MAX_BYTES // 1024**2} MiB. It is not unpacked; ask its author for a smaller one."
        )
        raise kind.failure(msg)
    seen: set[PurePosixPath] = set()
    for member in members:
        what = _explain_member(member, seen)
        if what is not None:
            msg = f"{path}: its member {member.filename!r} {what}. Such an archive is not unpacked; do not trust it."
            raise kind.failure(msg)
        seen.add(PurePosixPath(member.filename))
    if PurePosixPath(kind.needs) not in seen:
        msg = f"{path} is not an {kind.name}: it holds no {kind.needs}. {explain_file(path)}"
        raise kind.failure(msg)


def _explain_member(member: zipfile.ZipInfo, seen: set[PurePosixPath]) -> str | None:
    """Return what is wrong with a member; None if nothing is."""
    name, place = member.filename, PurePosixPath(member.filename)
    if stat.S_ISLNK(member.external_attr >> 16):
        return "is a link"
    if place.is_absolute() or ".." in place.parts or "\\" in name or ":" in name:
        return "would be written outside its folder"
    if member.flag_bits & _ENCRYPTED:
        return "is encrypted"
    if place in seen and not member.is_dir():
        return "is in it twice, so that two programs may read different files"
    return None


def unpack(path: Path, folder: Path, kind: Kind = FMU) -> None:
    """Check an archive and unpack it; ``zipfile`` unpacks no more of a member than was declared and checked.

    Raises
    ------
    FmuError
        Or what ``kind`` says: see ``check_archive``; or a member is damaged, or larger than declared.
    """
    check_archive(path, kind)
    try:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
    except (OSError, zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, zlib.error) as error:
        msg = f"{path} cannot be unpacked: {error}. Build or copy it again."
        raise kind.failure(msg) from error


def describe_fmu(path: Path) -> str:
    """Describe what an FMU runs in and on which platforms."""
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    places = [PurePosixPath(name).parts for name in names]
    platforms = sorted({parts[1] for parts in places if parts[0] == "binaries" and len(parts) > 2})
    kind = "in Python" if "resources/slavemodule.txt" in names else "native"
    return f"{kind}, on {' or '.join(platforms) or 'no platform'}"


def check_target(path: Path, ending: str) -> None:
    """Refuse to write an archive to a file with another ending, or over a folder.

    Raises
    ------
    OrchestratorError
        It cannot be written there.
    """
    if path.suffix != ending:
        msg = f"cannot write {path}: its name must end in {ending}. Name another file with {option('out')}."
        raise OrchestratorError(msg)
    if path.is_dir():
        msg = f"cannot write {path}: it is a folder. Name a file in it with {option('out')}."
        raise OrchestratorError(msg)
