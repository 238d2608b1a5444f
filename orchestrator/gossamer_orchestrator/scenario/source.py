"""The text of a scenario file and the line on which each of its keys stands.

``tomllib`` gives values without positions. This scan finds tables and keys by their line starts, which is all that an
error message needs: a key inside an inline table is looked for below the line where its table begins.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property

from ..errors import ScenarioError

Location = tuple[str | int, ...]

_HEADER = re.compile(r"\s*(\[\[?)([^\[\]]+(?:\"[^\"]*\")?)\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"""\s*((?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+)(?:\s*\.\s*(?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+))*)\s*=""")
_TOKEN = re.compile(r"""#|"(?:[^"\\]|\\.)*"|'[^']*'|[\[\]{},]|[^\s\[\]{},"'#]+""")
_PART = re.compile(r"""("[^"]*"|'[^']*'|[A-Za-z0-9_-]+)""")


@dataclass(frozen=True)
class Source:
    """Where a scenario was read from.

    Attributes
    ----------
    name : str
        File name for messages.
    text : str
        The whole file.
    """

    name: str
    text: str = field(repr=False)

    @cached_property
    def _lines(self) -> dict[Location, int]:
        found: dict[Location, int] = {}
        counts: dict[tuple[str, ...], int] = {}
        table: Location = ()
        for number, line in enumerate(self.text.splitlines(), start=1):
            if header := _HEADER.match(line):
                parts = tuple(part.strip("\"'") for part in _PART.findall(header[2]))
                table = parts
                if header[1] == "[[":
                    found.setdefault(parts, number)
                    counts[parts] = counts.get(parts, -1) + 1
                    table = (*parts, counts[parts])
                found.setdefault(table, number)
            elif key := _KEY.match(line):
                parts = tuple(part.strip("\"'") for part in _PART.findall(key[1]))
                found.setdefault((*table, *parts), number)
        return found

    def line(self, location: Location) -> int | None:
        """Return the line of a key, or of the innermost table around it that can be found; None for the whole file."""
        for size in range(len(location), 0, -1):
            start = self._lines.get(location[:size])
            if start is None:
                continue
            if size < len(location) and isinstance(location[size], int):
                return self._element(start, int(location[size]))
            return self._below(start, str(location[-1])) if size < len(location) else start
        return None

    def _element(self, start: int, index: int) -> int:
        """Find the line on which an element of an inline array begins; the array's key stands on line ``start``."""
        depth, commas, begun = 0, 0, False
        for number, line in enumerate(self.text.splitlines()[start - 1 :], start=start):
            text = line.partition("=")[2] if number == start else line
            for token in _TOKEN.findall(text):
                if token.startswith("#"):
                    break
                if depth == 1 and token == ",":
                    commas, begun = commas + 1, False
                elif depth == 1 and token != "]" and not begun:
                    begun = True
                    if commas == index:
                        return number
                depth += (token in "[{") - (token in "]}")
                if depth == 0:
                    return start
        return start

    def _below(self, start: int, key: str) -> int:
        """Look for a key from its table's line to the next line that is known to begin something else."""
        end = min((n for n in self._lines.values() if n > start), default=start + 1)
        for number, line in enumerate(self.text.splitlines()[start - 1 : end - 1], start=start):
            if re.search(rf"(?<![\w]){re.escape(key)}[\"']?\s*=", line):
                return number
        return start

    def where(self, location: Location) -> str:
        """Return ``file:line`` for a key, its first line for what is not there."""
        return f"{self.name}:{self.line(location) or 1}" if self.text else self.name


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
