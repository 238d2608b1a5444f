"""The text of a scenario file and the line on which each of its keys stands.

``tomllib`` gives values without positions. So it parses the file once more when an error message needs a line, a statement
at a time; an array over several lines is closed after each of them to see what has been added.
"""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ..errors import ScenarioError

Location = tuple[str | int, ...]


@dataclass(frozen=True)
class Source:
    """Where a scenario was read from.

    Attributes
    ----------
    name : str
        File name for messages.
    text : str
        The whole file.
    options : mapping of tuple to str
        Options that gave a value in place of the file's, by the location of its key.
    """

    name: str
    text: str = field(repr=False)
    options: Mapping[Location, str] = field(default_factory=dict)

    @cached_property
    def _lines(self) -> dict[Location, int]:
        """The line on which each table, key and element of an array begins."""
        found: dict[Location, int] = {}
        counts: Counter[Location] = Counter()
        table: Location = ()
        statement = ""
        for number, line in enumerate(self.text.splitlines(), start=1):
            statement += f"{line}\n"
            content, complete = _parse(statement)
            header = statement.lstrip().startswith("[")
            inside = [place if header else (*table, *place) for place in _locations(content)]
            if header:
                *outer, table = inside
                if table[-1] == 0:  # one more of an array of tables
                    counts[table] += 1
                    table = (*table[:-1], counts[table] - 1)
                inside = [*outer, table]
            for place in inside:
                found.setdefault(place, number)
            statement = "" if complete else statement
        return found

    def gives(self, key: str) -> bool:
        """Tell whether an option gives the value of a key at the top of the file."""
        return (key,) in self.options

    def where(self, location: Location) -> str:
        """Return ``file:line`` for a key, or for the innermost table around it that is there, or the file's first line.

        For a key that an option gives, return the option.
        """
        around = [location[:size] for size in range(len(location), 0, -1)]
        if option := next((self.options[place] for place in around if place in self.options), ""):
            return option
        line = next((self._lines[place] for place in around if place in self._lines), 1)
        return f"{self.name}:{line}" if self.text else self.name


def _parse(statement: str) -> tuple[dict[str, Any], bool]:
    """Parse a statement as far as it goes: its content, and whether it is complete or an array in it is still open."""
    for end in ("", "]", "]]"):
        with suppress(tomllib.TOMLDecodeError):
            return tomllib.loads(statement + end), not end
    return {}, False


def _locations(value: Any) -> Iterator[Location]:  # noqa: ANN401
    """List the locations of everything inside a value, outer ones first."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (key,)
        for location in _locations(inner):
            yield (key, *location)


@dataclass
class Problems:
    """Mistakes found so far; all of them are reported at once."""

    source: Source
    found: list[str] = field(default_factory=list)

    def add(self, location: Location, text: str) -> None:
        """Note a mistake at a key."""
        self.found.append(f"{self.source.where(location)}: {text}")

    def raise_if_any(self) -> None:
        """Raise ``ScenarioError`` with every mistake on a line of its own."""
        if self.found:
            raise ScenarioError("\n".join(dict.fromkeys(self.found)))
