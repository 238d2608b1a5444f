"""Read a TOML file that a person wrote, and say what is wrong in it, with its lines and names."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import ScenarioError
from ..file_kinds import explain_file
from ..names import suggest
from .source import Location

LONGEST = 200  # characters of a value in a message


def read_text(path: Path, what: str) -> str:
    """Return the text of a file; ``what`` it should be, for instance ``scenario``, stands in messages.

    Raises
    ------
    ScenarioError
        There is no such file, or it is no text in UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig")  # some editors begin it with a byte order mark
    except FileNotFoundError:
        near = suggest(path.name, sorted(p.name for p in path.parent.glob("*.toml")))
        msg = f"there is no {what} file {path}. {near}"
        raise ScenarioError(msg) from None
    except (OSError, UnicodeDecodeError):
        msg = f"{path} is not a {what} (a TOML file in UTF-8). {explain_file(path)}"
        raise ScenarioError(msg) from None


def parse_toml(text: str, name: str, what: str) -> dict[str, Any]:
    """Return the content of a text; ``name`` of its file and ``what`` it should be stand in messages.

    Raises
    ------
    ScenarioError
        It is not TOML.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.fullmatch(r"(.*) \(at line (\d+), (column \d+)\)", str(error))
        problem, line, column = found.groups() if found else (str(error), len(text.splitlines()), "")
        msg = f"{name}:{line}: {problem}{', ' * bool(column)}{column}. Correct the TOML syntax there."
        raise ScenarioError(msg) from None
    except RecursionError:
        msg = f"{name}: its tables or arrays are nested too deeply. A {what} needs four levels."
        raise ScenarioError(msg) from None


def explain(kind: str, location: Location, message: str, value: Any, known: Iterable[str]) -> str:  # noqa: ANN401
    """Turn one error of pydantic into a sentence; ``known`` are the keys of the table around it."""
    key, table = str(location[-1]), ".".join(part for part in location[:-1] if isinstance(part, str))
    place = f" in {table!r}" if table else ""
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"unknown key {key!r}{place}. {suggest(key, known)}"
    if kind == "missing":
        return f"key {key!r}{place} is missing. Add it."
    if key == "[key]":
        return f"{location[-2]!r} cannot be a name. Use letters, digits and underscores, and no digit at the start."
    if kind == "string_pattern_mismatch" and key in ("from", "to"):
        return f"{key!r}{place}: write component.variable, not {value!r}."
    return f"{key!r}{place}: {message[0].lower()}{message[1:]}, not {_short(value)}."


def _short(value: Any) -> str:  # noqa: ANN401
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."
