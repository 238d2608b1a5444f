"""Files of scenarios: where they are, shipped or not, their text, and the line on which each key stands.

``tomllib`` gives values without positions. So it parses the file once more when an error message needs a line, a statement
at a time; an array over several lines is closed after each of them to see what has been added.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from gossamer_files import NotFiniteError, exit_code
from gossamer_files.inputs import keep

from ..errors import OrchestratorError, ScenarioError, check_path, explain_file, writing
from ..names import suggest

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

    def is_finite(self, location: Location) -> bool:
        """Tell whether all numbers of the file at a key, or in a table, are finite."""
        value: Any = tomllib.loads(self.text) if location else {}
        for place in location:
            inside = isinstance(value, dict) and place in value
            inside |= isinstance(value, list) and isinstance(place, int) and place < len(value)
            value = value[place] if inside else None
        inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else [value]
        return all(not isinstance(each, float) or math.isfinite(each) for each in inner)

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
    """Mistakes found so far; all of them are reported at once, with a note below them if there is one."""

    source: Source
    found: list[str] = field(default_factory=list)
    note: str = ""
    cause: BaseException | None = None  # an error of data, of which the first with a number that is not finite counts

    def add(self, location: Location, text: str) -> None:
        """Note a mistake at a key."""
        self.found.append(f"{self.source.where(location)}: {text}")
        if exit_code(self.cause) == 1 and not self.source.is_finite(location):
            self.cause = NotFiniteError(self.found[-1])

    @contextmanager
    def noting(self, location: Location) -> Iterator[None]:
        """Note an error of the ``with`` block as a mistake at a key."""
        try:
            yield
        except OrchestratorError as error:
            self.add(location, str(error))
            self.cause = self.cause if exit_code(self.cause) > 1 else error

    def raise_if_any(self) -> None:
        """Raise ``ScenarioError`` with every mistake on a line of its own."""
        if self.found:
            error = ScenarioError("\n".join(dict.fromkeys(self.found)))
            if self.note:
                error.add_note(self.note)
            raise error from self.cause


LONGEST = 200  # characters of a value in a message
_DEEPEST = 50  # levels of tables and arrays


def read_text(path: Path, what: str) -> str:
    """Return the text of a file; ``what`` it should be, for instance ``scenario``, stands in messages.

    Raises
    ------
    ScenarioError
        There is no such file, or it is no text in UTF-8.
    """
    check_path(path, ScenarioError)
    keep(path)
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
        content = tomllib.loads(text)
        level: list[Any] = [content]
        for _ in range(_DEEPEST):
            level = [each for value in level for each in (value.values() if isinstance(value, dict) else value)]
            level = [value for value in level if isinstance(value, dict | list)]
            if not level:
                return content
        raise RecursionError
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
    advice = ""
    if kind in ("list_type", "tuple_type"):
        advice = " Write a list in brackets, for instance [1, 2, 3]."
    elif isinstance(value, dict) and "value" in value:
        advice = " Write the value alone; how far a number of a membrane may be off goes into 'priors'."
    return f"{key!r}{place}: {message[0].lower()}{message[1:]}, not {_short(value)}.{advice}"


def _short(value: Any) -> str:  # noqa: ANN401
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."


Kind = Literal["scenario", "campaign", "membrane"]
NEW = Path(__file__).with_name("new.toml")
INSPECTION = Path(__file__).with_name("inspection.toml")
_PACKAGE = Path(__file__).resolve().parent.parent


def shipped_scenarios(kind: Kind = "scenario") -> dict[str, Path]:
    """Return the shipped files of a kind by name."""
    for folder in (_PACKAGE / f"{kind}s", _PACKAGE.parent / f"{kind}s"):
        if folder.is_dir():
            return {path.stem: path for path in sorted(folder.glob("*.toml"))}
    return {}


def find_scenario(text: str, kind: Kind = "scenario") -> Path:
    """Return the file of a path or of the name of a shipped one.

    Raises
    ------
    ScenarioError
        There is neither.
    """
    shipped = shipped_scenarios(kind)
    path = Path(text)
    check_path(path, ScenarioError)
    if path.is_file() or (path.suffix == ".toml" and path.stem not in shipped):
        return path  # a missing file is reported where it is read
    if path.stem in shipped and path.suffix in ("", ".toml") and path.parent == Path():
        return shipped[path.stem]
    msg = f"there is no {kind} file {text!r}, and no shipped {kind} of that name. {suggest(text, shipped)}"
    raise ScenarioError(msg)


def write_new(path: Path) -> Path:
    """Write a scenario with a comment on every table and key, and return its path; of the name inspection, inspections.

    Raises
    ------
    ScenarioError
        There is such a file already, or it cannot be written.
    """
    template = INSPECTION if path.stem == INSPECTION.stem else NEW
    text = template.read_text(encoding="utf-8").replace("{name}", path.stem).replace("{file}", str(path))
    try:
        with writing(path, ScenarioError, "Name a file in another folder."), path.open("x", encoding="utf-8") as file:
            file.write(text)
    except ScenarioError as error:
        if isinstance(error.__cause__, FileExistsError):
            msg = f"{path} is there already. Take another name, or remove it."
            raise ScenarioError(msg) from None
        raise
    return path
