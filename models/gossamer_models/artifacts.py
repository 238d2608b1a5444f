"""Stored results of identification and training.

A JSON card holds a schema, a version and the provenance of the numbers. Large arrays lie beside it in an NPZ file of
the same name, whose digest the card holds. So that a card is never without its arrays, whatever ends the writer, new arrays
first get a name with their digest, then the card is replaced, then they take the name of the old ones; a reader takes
whichever belongs to the card.
"""

import hashlib
import io
import json
import re
import types
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np
from gossamer_files import read_json, reason, replacing, write_text
from numpy.typing import NDArray

from .arrays import Vector
from .errors import ArtifactError, NotFiniteError, require

Content = TypeVar("Content")
PREAMBLE = ("schema", "version", "arrays_sha256")


def write_artifact(
    path: Path,
    schema: str,
    version: int,
    provenance: dict[str, str],
    content: dict[str, Any],
    arrays: Mapping[str, NDArray[Any]] | None = None,
) -> None:
    """Write an artifact.

    Parameters
    ----------
    path : Path
        JSON file to write; its folder is made if needed.
    schema, version : str, int
        Kind and version of the content; a reader refuses every other.
    provenance : dict
        Data digest, command, error reached: everything that a reader needs to repeat the work.
    content : dict
        JSON values.
    arrays : mapping of str to ndarray, optional
        Large arrays, written to the NPZ file beside the card.
    """
    card = {"schema": schema, "version": version, "provenance": provenance, **content}
    if arrays is not None:
        buffer = io.BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, **arrays)
        card["arrays_sha256"] = hashlib.sha256(buffer.getvalue()).hexdigest()
        with replacing(_new_arrays(path, card)) as unfinished:
            unfinished.write_bytes(buffer.getvalue())
    text = json.dumps(card, indent=1)
    text = re.sub(r"\[\n[^\[\]{}\"]*\]", lambda row: " ".join(row[0].split()), text)  # a row of numbers on one line
    write_text(path, text + "\n")
    if arrays is not None:
        _new_arrays(path, card).replace(path.with_suffix(".npz"))


def _new_arrays(path: Path, card: dict[str, Any]) -> Path:
    """Return where the arrays of a card are until it has been written."""
    return path.with_name(f".{path.stem}.{str(card.get('arrays_sha256'))[:16]}.npz")


def read_artifact(path: Path, schema: str, *versions: int) -> dict[str, Any]:
    """Read the card of an artifact that ``write_artifact`` wrote.

    Raises
    ------
    ArtifactError
        The file is missing or truncated, or of another schema or version.
    """
    card = _card(path)
    if card["schema"] != schema or card["version"] not in versions:
        msg = (
            f"{path} holds {card['schema']!r} version {card['version']!r}; this program reads {schema!r} version "
            f"{' or '.join(map(str, versions))}. Make it again with this version of Gossamer."
        )
        raise ArtifactError(msg)
    return card


def read_as(
    kind: type[Content], what: str, path: Path, schema: str, version: int, turned: Callable[[Any], Any] = lambda card: card
) -> Content:
    """Read an artifact whose content is the fields of a dataclass, with its provenance.

    Parameters
    ----------
    kind, what : type, str
        The dataclass, and what it is in words.
    path, schema, version
        As of ``write_artifact``.
    turned : callable, optional
        What turns the card before it is used.

    Raises
    ------
    ArtifactError
        As ``read_artifact``; or the content is not usable.
    """
    card = turned(read_artifact(path, schema, version))
    try:
        made: Content = made_from(kind, {name: value for name, value in card.items() if name not in PREAMBLE})
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        msg = f"{path} does not hold a usable {what}: {error}. Identify it again or name another file."
        raise ArtifactError(msg) from error
    return made


def made_from(kind: Any, value: Any) -> Any:  # noqa: ANN401
    """Make a value of a type from JSON: of a dataclass, a tuple or what stands for one, a dictionary, a number, a text."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is types.UnionType:  # with None, or of a number and a tuple
        known = [part for part in parts if part is not type(None)]
        return None if value is None else made_from(known[-1 if isinstance(value, list) else 0], value)
    if origin in (tuple, list):
        return origin(made_from(parts[0], each) for each in value)
    if origin is dict:
        return {str(key): made_from(parts[1], each) for key, each in value.items()}
    if is_dataclass(kind):
        hints, make = get_type_hints(kind), cast("Callable[..., Any]", kind)
        return make(**{name: made_from(hints.get(name, str), each) for name, each in value.items()})
    return value if origin is not None else kind(*value) if hasattr(kind, "_fields") else kind(value)


def artifact_schema(path: Path) -> str:
    """Return the schema of an artifact, which determines its reader.

    Raises
    ------
    ArtifactError
        The file is missing or truncated.
    """
    return str(_card(path)["schema"])


def _card(path: Path) -> dict[str, Any]:
    """Read a card that holds at least its schema and version."""
    try:
        card = dict(read_json(path))
        card["schema"], card["version"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        msg = f"cannot read the artifact {path}: {reason(error)}. Make it again or name another file."
        raise ArtifactError(msg) from error
    return card


def read_arrays(path: Path, card: dict[str, Any]) -> dict[str, Vector]:
    """Read the arrays beside a card.

    Raises
    ------
    ArtifactError
        The NPZ file is missing or truncated, or the card belongs to another one.
    """
    beside = path.with_suffix(".npz")
    try:
        new = _new_arrays(path, card)
        content = (new if new.is_file() else beside).read_bytes()
        if hashlib.sha256(content).hexdigest() != card.get("arrays_sha256"):
            msg = f"{beside} is not the file that {path} was written with: its SHA-256 differs. Make both again."
            raise ArtifactError(msg)
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            found = {name: np.asarray(arrays[name], dtype=float) for name in arrays.files}
        for name, array in found.items():
            require(np.isfinite(array).all(), f"{name} holds a number that is not finite", NotFiniteError)
        return found
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        if isinstance(error, ArtifactError):
            raise
        msg = f"cannot read the arrays {beside}: {reason(error)}. Make the artifact again."
        raise ArtifactError(msg) from error
