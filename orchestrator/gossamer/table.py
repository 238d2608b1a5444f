"""The table of the command line: what each command takes, under which names, with which defaults.

The functions of this package are made from it (``docs/make_front_door.py``), and read their arguments with it.
"""

from __future__ import annotations

import inspect
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any, get_args

from gossamer_orchestrator import OrchestratorError
from gossamer_orchestrator.cli import app
from typer.models import ArgumentInfo, CommandInfo, OptionInfo

FOR_A_TERMINAL = ("json", "quiet", "verbose", "log_file")  # options that say how a command prints
_OPTION = re.compile(r"'gossamer [^']*'|--([a-z][a-z-]*)")  # but for commands to type in a shell
NAMED = "NAME="  # what the placeholder of an option begins with that gives values by name


@dataclass(frozen=True)
class Parameter:
    """An argument or an option of a command.

    Attributes
    ----------
    name : str
        In Python: as on the command line, with underscores and without ``--``.
    field : str
        As the function of the command calls it.
    kind : type
        ``str``, ``int``, ``float``, ``bool``, ``Path``, or an enumeration of texts.
    many, optional : bool
        Whether it takes several values; whether it takes None.
    default : object
        Default of the command; ``inspect.Parameter.empty`` where it must be given.
    about : ArgumentInfo or OptionInfo
        What typer knows: help, placeholder, bounds.
    """

    name: str
    field: str
    kind: type[Any]
    many: bool
    optional: bool
    default: Any
    about: ArgumentInfo | OptionInfo

    @property
    def is_argument(self) -> bool:
        """Whether it is given by its place."""
        return isinstance(self.about, ArgumentInfo)


@cache
def commands() -> dict[str, CommandInfo]:
    """Return what typer knows of each command, by its name in Python: as on the command line, with underscores."""
    named = {str(each.name or getattr(each.callback, "__name__", "")): each for each in app.registered_commands}
    return {name.replace("-", "_"): each for name, each in named.items()}


@cache
def parameters(command: str) -> dict[str, Parameter]:
    """List what a command takes, by name: arguments first, then options in the order of its help."""
    found = commands()[command]
    assert found.callback is not None
    declared = list(inspect.signature(found.callback, eval_str=True).parameters.values())
    if more := getattr(found.cls, "declared", None):
        declared += more().values()
    listed = [_parameter(each) for each in declared if hasattr(each.annotation, "__metadata__")]
    return {each.name: each for each in listed if each.name not in FOR_A_TERMINAL}


def values(command: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the function of a command takes, by its own names, for what was given in Python.

    Raises
    ------
    OrchestratorError
        A value has the wrong type, or is out of its bounds.
    """
    return {each.field: _read(each, given[each.name]) for each in parameters(command).values()}


@contextmanager
def words_of_python(command: str) -> Iterator[None]:
    """Name the arguments of a function in its errors as Python does."""
    try:
        yield
    except OrchestratorError as error:
        error.args = (in_python(command, str(error)), *error.args[1:])
        raise


def in_python(command: str, text: str) -> str:
    """Return a text with the options of a command as Python names them: ``strain_unit=``, not ``--strain-unit``."""

    def named(found: re.Match[str]) -> str:
        name = (found[1] or "").replace("-", "_")
        wanted = parameters(command).get(name)
        return found[0] if wanted is None else f"{name}={'True' * (wanted.kind is bool)}"

    return _OPTION.sub(named, text)


def as_call(command: str, taken: Mapping[str, Any]) -> str:
    """Write a call as Python does, for a provenance: what differs from the defaults, files without their folders."""
    told = {each: taken[each.field] for each in parameters(command).values() if taken[each.field] != each.default}
    words = [f"{each.name}={_without_folders(value)!r}" for each, value in told.items()]
    return f"gossamer.{command}({', '.join(words)})"


def _without_folders(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, list):
        return [_without_folders(each) for each in value]
    return value.name if isinstance(value, Path) else value


def _parameter(declared: inspect.Parameter) -> Parameter:
    kind, about = declared.annotation.__origin__, declared.annotation.__metadata__[0]
    optional = type(None) in get_args(kind)
    if optional:
        kind = next(each for each in get_args(kind) if each is not type(None))
    many = bool(get_args(kind))
    named = [about.default, *(about.param_decls or ())]  # in ``Annotated``, typer keeps the first name as a default
    flag = next((text for text in named if isinstance(text, str) and text.startswith("--")), declared.name)
    return Parameter(
        name=flag.strip("-").replace("-", "_"),
        field=declared.name,
        kind=get_args(kind)[0] if many else kind,
        many=many,
        optional=optional,
        default=declared.default,
        about=about,
    )


def _read(wanted: Parameter, value: Any) -> Any:  # noqa: ANN401
    if value is None:
        if wanted.optional:
            return None
        msg = f"{wanted.name} is None. Give a value."
        raise OrchestratorError(msg)
    if not wanted.many:
        return _one(wanted, value)
    if isinstance(value, Mapping) and (wanted.about.metavar or "").startswith(NAMED):
        several = wanted.about.metavar != "NAME=VALUE"
        return [f"{name}={_listed(each) if several else _text(each)}" for name, each in value.items()]
    is_one = isinstance(value, str | os.PathLike) or not isinstance(value, Iterable)
    return [_one(wanted, each) for each in ([value] if is_one else value)]


def _one(wanted: Parameter, value: Any) -> Any:  # noqa: ANN401
    value = value.item() if hasattr(value, "item") and not getattr(value, "shape", ()) else value  # a number of numpy
    if wanted.kind is Path and isinstance(value, str | os.PathLike):
        return Path(value)
    if issubclass(wanted.kind, str):
        text = _listed(os.fspath(value) if isinstance(value, os.PathLike) else value)
        choices = [str(each) for each in wanted.kind] if issubclass(wanted.kind, StrEnum) else [text]
        if text not in choices:
            msg = f"{wanted.name} is {text!r}. Give {' or '.join(map(repr, choices))}."
            raise OrchestratorError(msg)
        return text
    fits = {float: (int, float), int: (int,), bool: (bool,)}.get(wanted.kind, ())
    if not isinstance(value, fits) or (isinstance(value, bool) and wanted.kind is not bool):
        msg = f"{wanted.name} is {value!r}. Give {_NOUNS.get(wanted.kind, 'a value')}."
        raise OrchestratorError(msg)
    least, most = wanted.about.min, wanted.about.max
    if (least is not None and value < least) or (most is not None and value > most):
        bounds = [f"{word} {bound:g}" for word, bound in (("at least", least), ("at most", most)) if bound is not None]
        msg = f"{wanted.name} is {value!r}. It is {' and '.join(bounds)}."
        raise OrchestratorError(msg)
    return wanted.kind(value)


_NOUNS = {Path: "a path", float: "a number", int: "a whole number", bool: "True or False"}


def _listed(value: Any) -> str:  # noqa: ANN401
    """Return a value as text; several with commas between."""
    several = isinstance(value, Iterable) and not isinstance(value, str) and getattr(value, "shape", None) != ()
    return ",".join(map(_text, value)) if several else _text(value)


def _text(value: Any) -> str:  # noqa: ANN401
    """Return a value as the command line writes it."""
    return value if isinstance(value, str) else json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:  # noqa: ANN401
    """Return what JSON does not know as what it knows."""
    if hasattr(value, "tolist"):  # of numpy
        return value.tolist()
    if isinstance(value, range):
        return list(value)
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    msg = f"{value!r} is no value. Give a number, a text, True or False, or a list of them."
    raise OrchestratorError(msg)
