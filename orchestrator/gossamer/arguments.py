"""What commands take: types of arguments for Python and for the command line, and how values of both are read.

A command is a function with ``@command``. Its signature and its docstring are the command line, see ``cli.py``.
"""

from __future__ import annotations

import errno
import inspect
import json
import os
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache, wraps
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, ParamSpec, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

from gossamer_files import GossamerError
from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError

LONG = 200  # characters of a name

P = ParamSpec("P")
R = TypeVar("R")


class ArgumentError(OrchestratorError, ValueError):
    """An argument of the wrong type, or out of its bounds."""


@dataclass(frozen=True)
class Written:
    """How an argument is written on the command line.

    Attributes
    ----------
    placeholder : str or None
        What stands for its value in the help.
    many : bool
        Whether it may be repeated.
    least, most : float or None
        Bounds of a number.
    """

    placeholder: str | None = None
    many: bool = False
    least: float | None = None
    most: float | None = None


AnyPath: TypeAlias = str | os.PathLike[str]
File: TypeAlias = Annotated[AnyPath, Written("FILE")]
Folder: TypeAlias = Annotated[AnyPath, Written("FOLDER")]
Files: TypeAlias = Annotated[AnyPath | Sequence[AnyPath], Written("FILE", many=True)]
Names: TypeAlias = Annotated[str | Sequence[str], Written("NAME", many=True)]  # an option for each
NamesWithCommas: TypeAlias = Annotated[str | Sequence[str], Written("NAMES")]
NUMBERS = Written("LIST")
Numbers: TypeAlias = Annotated[str | Sequence[float], NUMBERS]  # with commas
NumberOrAuto: TypeAlias = Annotated[float | str, Written("NUMBER")]
Values: TypeAlias = Annotated[Mapping[str, object] | Sequence[str], Written("NAME=VALUE", many=True)]
Ranges: TypeAlias = Annotated[Mapping[str, object] | Sequence[str], Written("NAME=VALUES", many=True)]
Name: TypeAlias = Annotated[str, Written("NAME")]
Form: TypeAlias = Annotated[str, Written("FORM")]
Address: TypeAlias = Annotated[str, Written("URL")]
Seconds: TypeAlias = Annotated[float, Written("SECONDS")]
CallLimit: TypeAlias = Annotated[float, Written("SECONDS", least=1e-3)]
Elements: TypeAlias = Annotated[int, Written("N")]
Budget: TypeAlias = Annotated[float, Written("SECONDS", least=1.0)]
Cases: TypeAlias = Annotated[int, Written("N", least=4)]
NotNegative: TypeAlias = Annotated[float, Written(least=0.0)]
Count: TypeAlias = Annotated[int, Written("N", least=1)]
CountOrNone: TypeAlias = Annotated[int, Written("N", least=0)]
Threads: TypeAlias = Annotated[int, Written("N", least=1, most=64)]
FmiVersion: TypeAlias = Annotated[int, Written("N", least=2, most=3)]

GROUPS: dict[type, tuple[type, ...]] = {}  # of options that commands share: the classes that declare them, by their sum
COMMANDS: dict[str, Callable[..., Any]] = {}  # by name


@dataclass(frozen=True)
class Argument:
    """An argument of a command, as it is declared.

    Attributes
    ----------
    name : str
        Its name in Python.
    kinds : tuple
        The types that it may have, without those within sequences.
    default : object
        ``inspect.Parameter.empty`` where it must be given.
    written : Written
        How the command line writes it.
    is_option : bool
        Whether it is given by name.
    owner : type or None
        The class that declares it, for several commands; None for an argument of the function's own.
    hint : str
        Its type as that class writes it.
    """

    name: str
    kinds: tuple[Any, ...]
    default: Any
    written: Written
    is_option: bool
    owner: type | None = None
    hint: str = ""


@cache
def declared(function: Callable[..., Any]) -> dict[str, Argument]:
    """List the arguments of a command by name; those of ``**options: Unpack[...]`` each by its own."""
    function = inspect.unwrap(function)
    hints = get_type_hints(function, include_extras=True)
    found = {}
    for each in inspect.signature(function).parameters.values():
        hint = hints[each.name]
        if each.kind is each.VAR_KEYWORD:
            (shared,) = get_args(hint)
            for owner in GROUPS.get(shared, (shared,)):
                for name, inner in get_type_hints(owner, include_extras=True).items():
                    default = None if type(None) in _kinds(inner) else False
                    hint = owner.__annotations__[name].__forward_arg__
                    found[name] = Argument(name, _kinds(inner), default, _written(inner), True, owner, hint)
        else:
            is_option = each.kind is each.KEYWORD_ONLY
            found[each.name] = Argument(each.name, _kinds(hint), each.default, _written(hint), is_option)
    return found


def command(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function a command: its arguments are checked, and what goes wrong is an ``OrchestratorError``."""
    taken = declared(function)
    signature = inspect.signature(function)
    listed = [each for each in signature.parameters.values() if each.kind is not each.VAR_KEYWORD]
    shared = [each for each in taken.values() if each.owner]
    listed += [
        inspect.Parameter(each.name, inspect.Parameter.KEYWORD_ONLY, default=each.default, annotation=each.hint)
        for each in shared
    ]
    signature = signature.replace(parameters=listed)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            given = signature.bind(*args, **kwargs).arguments
        except TypeError as error:  # one is missing, unknown or given twice
            unknown = next((name for name in kwargs if name not in taken), "")
            meant = get_close_matches(unknown, taken, 1)
            hint = f". Did you mean '{meant[0]}'?" if meant else ""
            msg = f"{function.__name__}() {error}{hint}"
            raise TypeError(msg) from None
        checked: Any = {name: check(taken[name], value) for name, value in given.items()}
        with expected_errors(taken):
            return function(**checked)  # type: ignore[call-arg]

    call.__signature__ = signature  # type: ignore[attr-defined]
    COMMANDS[function.__name__] = call
    return call


@contextmanager
def expected_errors(taken: Container[str] = ("out",)) -> Iterator[None]:
    """Turn the errors of the models and of the disk into those that the front door raises."""
    try:
        yield
    except OrchestratorError:
        raise
    except (GossamerError, ModuleNotFoundError) as error:
        lacking = isinstance(error, ModuleNotFoundError) and error.name  # none where the sentence is ours
        text = f"The package {lacking} is missing, which this needs: 'make install' installs all." if lacking else error
        raise OrchestratorError("\n".join((str(text), *getattr(error, "__notes__", ())))) from error
    except OSError as error:
        other = f"place with {option('out')}" if "out" in taken and error.errno != errno.ENAMETOOLONG else "one"
        msg = f"cannot use {shortened(error.filename or 'the disk')}: {error.strerror or error}. Name another {other}."
        raise OrchestratorError(msg) from error


def shortened(name: object) -> str:
    """Return a name as a sentence holds it: the middle of one that is longer than any that was meant is left out."""
    text = str(name)
    return text if len(text) < LONG else f"{text[:60]}...{text[-20:]}"


def check(wanted: Argument, value: Any) -> Any:  # noqa: ANN401
    """Return a value that was given in Python, a number of NumPy as one of Python.

    Raises
    ------
    ArgumentError
        It has the wrong type, or is out of its bounds.
    """
    kinds, name = wanted.kinds, _called(wanted)
    if value is None and type(None) in kinds:
        return None
    if value is None:
        msg = f"{name} is None. Give a value."
        raise ArgumentError(msg)
    value = value.item() if hasattr(value, "item") and not getattr(value, "shape", ()) else value
    if str in kinds or Mapping in kinds:
        return _texts(wanted, value)
    choices = [each for kind in kinds if get_origin(kind) is Literal for each in get_args(kind)]
    if choices:
        if value not in choices:
            msg = f"{name} is {value!r}. Give {' or '.join(map(repr, choices))}."
            raise ArgumentError(msg)
        return value
    kind = next(each for each in (bool, int, float) if each in kinds)
    if not isinstance(value, (int, float) if kind is float else kind) or (isinstance(value, bool) and kind is not bool):
        noun = {float: "a number", int: "a whole number", bool: "True or False"}[kind]
        msg = f"{name} is {value!r}. Give {noun}."
        raise ArgumentError(msg)
    bounds = (("at least", wanted.written.least, 1), ("at most", wanted.written.most, -1))
    said = [f"{word} {bound:g}" for word, bound, _ in bounds if bound is not None]
    if any(bound is not None and sign * (value - bound) < 0 for _, bound, sign in bounds):
        msg = f"{name} is {value!r}. Give {' and '.join(said)}."
        raise ArgumentError(msg)
    return kind(value)


def _texts(wanted: Argument, value: Any) -> Any:  # noqa: ANN401
    """Return paths, texts, numbers in texts, or values by name, which are read where they are used."""
    kinds, is_list = wanted.kinds, wanted.written == NUMBERS
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if is_list or (Mapping in kinds and isinstance(value, Mapping)) or (is_number and float in kinds):
        return value
    if is_number and Sequence not in kinds and os.PathLike not in kinds:
        return f"{value:.15g}"  # such as the unit 1
    nouns = {os.PathLike: "a path", Mapping: "values by name, such as {'seed': 2}", float: "a number or a text"}
    nouns |= {Sequence: "a name, or a list of names", str: "a text"}
    noun = next(text for kind, text in nouns.items() if kind in kinds)
    allowed = (str, os.PathLike) if os.PathLike in kinds else (str,)
    one = Sequence not in kinds or isinstance(value, str | os.PathLike)
    every = [value] if one else several(value)
    for each in every:
        if not isinstance(each, allowed):
            msg = f"{_called(wanted)} is {each!r}. Give {noun}."
            raise ArgumentError(msg)
    return value if one else every


def _called(wanted: Argument) -> str:
    """Return the name of an argument as it is given: in Python, or on the command line."""
    return option(wanted.name).removesuffix("=") if wanted.is_option else wanted.name


def several(value: Any) -> list[Any]:  # noqa: ANN401
    """Return what may be one or many as a list; nothing for None."""
    if value is None:
        return []
    return [value] if isinstance(value, str | os.PathLike) or not isinstance(value, Iterable) else list(value)


def assigned(values: Mapping[str, object] | Sequence[str] | None, *, many: bool = False) -> list[str]:
    """Return values by name as the command line writes them, ``NAME=VALUE``; with ``many``, several by name with commas."""
    if isinstance(values, Mapping):
        return [f"{name}={with_commas(each) if many else _text(each)}" for name, each in values.items()]
    return several(values)


def with_commas(value: Any) -> str:  # noqa: ANN401
    """Return a value as text; several with commas between."""
    one = isinstance(value, str) or not isinstance(value, Iterable) or getattr(value, "shape", None) == ()
    return _text(value) if one else ",".join(map(_text, value))


def numbers_of(name: str, value: str | Sequence[float], example: str) -> tuple[float, ...]:
    """Read numbers with commas between."""
    text = with_commas(value)
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        msg = f"cannot read {option(name)} {text!r} as numbers. Write them with commas: {example}."
        raise OrchestratorError(msg) from None


def call_of(name: str, given: Mapping[str, Any]) -> str:
    """Write a call as Python does, for a provenance: what differs from the defaults, files without their folders."""
    taken = declared(COMMANDS[name])
    told = {key: value for key, value in given.items() if key in taken and value not in (None, taken[key].default)}
    return f"gossamer.{name}({', '.join(f'{key}={_without_folders(value)!r}' for key, value in told.items())})"


def _without_folders(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, list | tuple):
        return [_without_folders(each) for each in value]
    return Path(value).name if isinstance(value, os.PathLike) else value


def _kinds(hint: Any) -> tuple[Any, ...]:  # noqa: ANN401
    """Return the types that a hint allows."""
    if get_origin(hint) is Annotated:
        return _kinds(get_args(hint)[0])
    if get_origin(hint) in (Union, UnionType):
        return tuple(kind for each in get_args(hint) for kind in _kinds(each))
    origin = get_origin(hint)
    return (hint if origin in (None, Literal) else origin,)


def _written(hint: Any) -> Written:  # noqa: ANN401
    if get_origin(hint) is Annotated:
        return next(each for each in get_args(hint)[1:] if isinstance(each, Written))
    return next((_written(each) for each in get_args(hint) if get_origin(each) is Annotated), Written())


def _text(value: Any) -> str:  # noqa: ANN401
    """Return a value as the command line writes it."""
    return value if isinstance(value, str) else json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:  # noqa: ANN401
    """Return what JSON does not know as what it knows."""
    if hasattr(value, "tolist"):  # of NumPy
        return value.tolist()
    if isinstance(value, range):
        return list(value)
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    msg = f"{value!r} is no value. Give a number, a text, True or False, or a list of them."
    raise ArgumentError(msg)


def numbers(text: str) -> tuple[float, ...]:
    """Read a list of numbers, ``3,100``; raise ``ValueError`` with what to write for anything else."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        msg = "as numbers. Write them with commas: 3,100."
        raise ValueError(msg) from None


def number_or_auto(text: str) -> float | str:
    """Read a number or the word ``auto``; raise ``ValueError`` with what to write for anything else."""
    try:
        return text if text == "auto" else float(text)
    except ValueError:
        msg = "as a number. Write one number such as 0.01, or auto."
        raise ValueError(msg) from None


def count_or_auto(text: str) -> int | str:
    """Read a number of 0 or more or the word ``auto``; raise ``ValueError`` with what to write for anything else."""
    if text != "auto" and not text.isdecimal():
        msg = "as a count. Write a whole number such as 40, or auto."
        raise ValueError(msg)
    return text if text == "auto" else int(text)
