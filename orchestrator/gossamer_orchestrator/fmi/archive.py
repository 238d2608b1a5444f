"""Unpack archives that are not trusted, and write archives.

What an archive declares is checked first, and no more than that is unpacked.
"""

from __future__ import annotations

import hashlib
import stat
import zipfile
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from gossamer_files.options import option

from ..errors import FmuError, OrchestratorError, check_path, explain_file
from ..names import suggest

MAX_FILES = 20_000
MAX_BYTES = 2 * 1024**3
_ENCRYPTED = 0x1
_DAMAGED = (OSError, zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, zlib.error)


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
    twice = _ambiguous(path, members)
    seen: set[PurePosixPath] = set()
    for member in members:
        what = "is in it twice, so that two programs may read different files" if member.filename in twice else None
        what = what or _explain_member(member)
        if what is not None:
            msg = f"{path}: its member {member.filename!r} {what}. Such an archive is not unpacked; do not trust it."
            raise kind.failure(msg)
        seen.add(PurePosixPath(posix(member.filename)))
    if PurePosixPath(kind.needs) not in seen:
        msg = f"{path} is not an {kind.name}: it holds no {kind.needs}. {explain_file(path)}"
        raise kind.failure(msg)


def posix(name: str) -> str:
    """Return a member's name as ZIP has it: some tools put backslashes between folders."""
    return name.replace("\\", "/")


def _ambiguous(path: Path, members: Iterable[zipfile.ZipInfo]) -> set[str]:
    """Return the names of files that are in an archive more than once, unless they are equal to the byte."""
    homes: dict[PurePosixPath, list[zipfile.ZipInfo]] = {}
    for member in members:
        if not posix(member.filename).endswith("/"):
            homes.setdefault(PurePosixPath(posix(member.filename)), []).append(member)
    return {found[-1].filename for found in homes.values() if len(found) > 1 and not _are_equal(path, found)}


def _are_equal(path: Path, members: Sequence[zipfile.ZipInfo]) -> bool:
    if len({(each.file_size, each.CRC) for each in members}) > 1:
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return len({hashlib.sha256(archive.read(each)).digest() for each in members}) == 1
    except _DAMAGED:
        return False


def _explain_member(member: zipfile.ZipInfo) -> str | None:
    """Return what is wrong with a member; None if nothing is."""
    name = posix(member.filename)
    place = PurePosixPath(name)
    if stat.S_ISLNK(member.external_attr >> 16):
        return "is a link"
    if place.is_absolute() or ".." in place.parts or ":" in name:
        return "would be written outside its folder"
    if member.flag_bits & _ENCRYPTED:
        return "is encrypted"
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
            for member in archive.infolist():
                member.filename = posix(member.filename)
                archive.extract(member, folder)
    except _DAMAGED as error:
        msg = f"{path} cannot be unpacked: {error}. Build or copy it again."
        raise kind.failure(msg) from error


def has_backslashes(path: Path) -> bool:
    """Tell whether names in an archive separate folders by what ZIP does not allow for it."""
    with zipfile.ZipFile(path) as archive:
        return any("\\" in name for name in archive.namelist())


def describe_fmu(path: Path) -> str:
    """Describe what an FMU runs in and on which platforms."""
    with zipfile.ZipFile(path) as archive:
        names = [posix(name) for name in archive.namelist()]
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
