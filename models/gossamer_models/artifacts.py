"""Stored results of identification and training: JSON with a schema, a version and where the numbers come from."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from .errors import ArtifactError


def write_artifact(path: Path, schema: str, version: int, provenance: dict[str, str], content: dict[str, Any]) -> None:
    """Write an artifact.

    Parameters
    ----------
    path : Path
        File to write; its folder exists.
    schema, version : str, int
        What the content is; a reader refuses every other.
    provenance : dict
        Data digest, command, error reached: whatever lets a reader repeat the work.
    content : dict
        JSON values; arrays as nested lists.
    """
    card = {"schema": schema, "version": version, "provenance": provenance, **content}
    path.write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


def read_artifact(path: Path, schema: str, version: int) -> dict[str, Any]:
    """Read an artifact that ``write_artifact`` wrote.

    Raises
    ------
    ArtifactError
        The file is missing or truncated, or of another schema or version.
    """
    try:
        card = json.loads(path.read_text(encoding="utf-8"))
        found = (card["schema"], card["version"])
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError) as error:
        msg = f"cannot read the artifact {path}: {error!r}. Make it again or name another file."
        raise ArtifactError(msg) from error
    if found != (schema, version):
        msg = (
            f"{path} holds {found[0]!r} version {found[1]!r}; this program reads {schema!r} version {version}. "
            "Make it again with this version of Gossamer."
        )
        raise ArtifactError(msg)
    return dict(card)
