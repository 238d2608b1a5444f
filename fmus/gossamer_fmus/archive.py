"""An archive whose bytes depend on nothing but its content, and an identifier of that content."""

from __future__ import annotations

import hashlib
import uuid
import zipfile
from pathlib import Path

from gossamer_files import replacing

_NAMESPACE = uuid.UUID("6f2ad6c2-5a57-5d3c-9c1d-2f4a3c1f6d10")


def identifier(members: dict[str, bytes]) -> str:
    """Return the guid of some files, given by name."""
    content = hashlib.sha256()
    for name, data in sorted(members.items()):
        content.update(name.encode() + b"\0" + data + b"\0")
    return f"{{{uuid.uuid5(_NAMESPACE, content.hexdigest())}}}"


def write_archive(path: Path, members: dict[str, bytes]) -> Path:
    """Write files, given by name, as an FMU; its folder is made if needed, and an interrupted write leaves nothing."""
    with replacing(path) as unfinished, zipfile.ZipFile(unfinished, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in sorted(members.items(), key=lambda item: (item[0] != "modelDescription.xml", item[0])):
            member = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            member.compress_type = zipfile.ZIP_DEFLATED
            member.external_attr = 0o644 << 16
            member.create_system = 3
            archive.writestr(member, data)
    return path
