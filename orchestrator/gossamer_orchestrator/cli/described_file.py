"""Read a TOML file into a dataclass of the models: keys and types are those of the class, mistakes have lines."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from gossamer_models.mistakes import DescriptionError
from pydantic import ValidationError, create_model

from ..names import suggest
from ..scenario.schema import ScenarioTable
from ..scenario.source import Location, Problems, Source, explain, parse_toml, read_text

T = TypeVar("T")

VECTORS = ("prestress", "direction", "displacement", "stretch", "centre", "point")  # arrays of three numbers


def read_description(path: Path, what: str, kind: type[T], tables: Mapping[str, type]) -> tuple[T, Source]:
    """Read and check a file.

    Parameters
    ----------
    path : Path
        A TOML file.
    what : str
        What it should be, for messages.
    kind : type
        The dataclass; its file holds the keys at the top.
    tables : mapping of str to type
        Dataclasses by the names of the tables in it, for suggestions.

    Returns
    -------
    T
        The content.
    Source
        The text.

    Raises
    ------
    ScenarioError
        The file cannot be read, is not TOML, or has unknown, missing or meaningless keys; one line per mistake.
    """
    source = Source(path.name, read_text(path, what))
    content = parse_toml(source.text, source.name, what)
    problems = Problems(source)
    file: Any = create_model("File", __base__=ScenarioTable, content=(kind, ...))
    try:  # as JSON, so that arrays are tuples and tables are what they are for, while types stay strict
        found: T = file.model_validate_json(json.dumps({"content": content}, default=str)).content
    except ValidationError as error:
        for item in error.errors():
            place = item["loc"][1:]
            cause = item.get("ctx", {}).get("error")
            if isinstance(cause, DescriptionError):
                _note(cause, problems, place)
            elif item["type"] == "too_long" or (item["type"] == "missing" and place and isinstance(place[-1], int)):
                array = place if item["type"] == "too_long" else place[:-1]
                problems.add(array, f"{array[-1]!r} needs {_shape(item, place)}.")
            else:
                problems.add(
                    place, explain(item["type"], place, item["msg"], item["input"], _known(place, kind, tables))
                )
        problems.raise_if_any()
        raise
    return found, source


@contextmanager
def locating(source: Source) -> Iterator[None]:
    """Give the mistakes of a description that show inside the ``with`` block the lines of its file."""
    try:
        yield
    except DescriptionError as error:
        problems = Problems(source)
        _note(error, problems)
        problems.raise_if_any()


def _note(error: DescriptionError, problems: Problems, place: Location = ()) -> None:
    for mistake in error.mistakes:
        advice = f" {suggest(mistake.name, mistake.known)}" if mistake.known else ""
        problems.add((*place, *mistake.place), mistake.text + advice)


def _shape(item: Any, place: Location) -> str:  # noqa: ANN401
    """Say how many numbers an array needs: pydantic knows it of one that is too long, and the first that one lacks."""
    size = item["ctx"]["max_length"] if item["type"] == "too_long" else None
    if size == 2 or (size is None and place[-1] in (0, 1) and place[-2] not in VECTORS):
        return "two numbers, [low, high]"
    return "three numbers"


def _known(location: Location, kind: type, tables: Mapping[str, type]) -> list[str]:
    """List the keys of the table around a location."""
    owner = next((tables[part] for part in reversed(location[:-1]) if part in tables), kind)  # type: ignore[index]
    return [field.name for field in fields(owner)]
