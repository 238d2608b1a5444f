"""What commands take: types of arguments for Python and for the command line, and how values of both are read.

A command is a function with ``@command``. Its signature and its docstring are the command line, see ``cli.py``.
"""

from __future__ import annotations

import errno
import inspect
import json
import os
import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache, reduce, wraps
from operator import or_
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, ParamSpec, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

from gossamer_files import GossamerError
from gossamer_files.inputs import keeping
from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError, require

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
    read : callable or None
        What reads it from a text, or raises ``ValueError``.
    like : str
        What it is read as, and what to write instead of what cannot be read.
    default : object
        Of an option that commands share; else None, or False of one that is given or not.
    """

    placeholder: str | None = None
    many: bool = False
    least: float | None = None
    most: float | None = None
    read: Callable[[str], Any] | None = None
    like: str = ""
    default: object = None


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(map(float, text.split(",")))


def _number_or_auto(text: str) -> float | str:
    return text if text == "auto" else float(text)


def _count_or_auto(text: str) -> int | str:
    if text != "auto" and not text.isdecimal():
        raise ValueError
    return text if text == "auto" else int(text)


WITH_COMMAS = "as numbers. Write them with commas"
ONE = "as a number. Write one number such as 0.01, or auto."
COUNT = "as a count. Write a whole number such as 40, or auto."
AnyPath: TypeAlias = str | os.PathLike[str]
File: TypeAlias = Annotated[AnyPath, Written("FILE")]
Folder: TypeAlias = Annotated[AnyPath, Written("FOLDER")]
Files: TypeAlias = Annotated[AnyPath | Sequence[AnyPath], Written("FILE", many=True)]
Names: TypeAlias = Annotated[str | Sequence[str], Written("NAME", many=True)]  # an option for each
NamesWithCommas: TypeAlias = Annotated[str | Sequence[str], Written("NAMES")]
Numbers: TypeAlias = Annotated[str | Sequence[float], Written("LIST", read=_numbers, like=f"{WITH_COMMAS}: 3,100.")]
Scales: TypeAlias = Annotated[str | Sequence[float], Written("LIST", read=_numbers, like=f"{WITH_COMMAS}: 1000,150,0.2.")]
NumberOrAuto: TypeAlias = Annotated[float | str, Written("NUMBER", read=_number_or_auto, like=ONE)]
CountOrAuto: TypeAlias = Annotated[int | str, Written("NUMBER", read=_count_or_auto, like=COUNT)]
Values: TypeAlias = Annotated[Mapping[str, object] | Sequence[str], Written("NAME=VALUE", many=True)]
Ranges: TypeAlias = Annotated[Mapping[str, object] | Sequence[str], Written("NAME=VALUES", many=True)]
Name: TypeAlias = Annotated[str, Written("NAME")]
Address: TypeAlias = Annotated[str, Written("URL")]
Seconds: TypeAlias = Annotated[float, Written("SECONDS")]
CallLimit: TypeAlias = Annotated[float, Written("SECONDS", least=1e-3)]
Budget: TypeAlias = Annotated[float, Written("SECONDS", least=1.0)]
Cases: TypeAlias = Annotated[int, Written("N", least=4)]
NotNegative: TypeAlias = Annotated[float, Written(least=0.0)]
Count: TypeAlias = Annotated[int, Written("N", least=1)]
CountOrNone: TypeAlias = Annotated[int, Written("N", least=0)]
Threads: TypeAlias = Annotated[int, Written("N", least=1, most=64)]
FmiVersion: TypeAlias = Literal[2, 3]
Form: TypeAlias = Literal["png", "svg", "pdf"]  # of pictures

GROUPS: dict[type, tuple[type, ...]] = {}  # of options that commands share: the classes that declare them, by their sum
COMMANDS: dict[str, Callable[..., Any]] = {}  # by name


@dataclass(frozen=True)
class Argument:
    """An argument of a command, as it is declared.

    Attributes
    ----------
    name : str
        Its name in Python.
    hint : type
        Its type, with how it is written.
    default : object
        ``inspect.Parameter.empty`` where it must be given.
    is_option : bool
        Whether it is given by name.
    owner : type or None
        The class that declares it, for several commands; None for an argument of the function's own.
    """

    name: str
    hint: Any
    default: Any
    is_option: bool
    owner: type | None = None

    @property
    def kinds(self) -> tuple[Any, ...]:
        """The types that it may have, without those within sequences."""
        return _kinds(self.hint)

    @property
    def written(self) -> Written:
        """How the command line writes it."""
        return _written(self.hint)

    @property
    def choices(self) -> list[Any]:
        """What it may be, where that is one of a few."""
        return [each for kind in self.kinds if get_origin(kind) is Literal for each in get_args(kind)]


@cache
def declared(function: Callable[..., Any]) -> dict[str, Argument]:
    """List the arguments of a command by name; those of ``**options: Unpack[...]`` each by its own."""
    function = inspect.unwrap(function)
    hints = get_type_hints(function, include_extras=True)
    found = {}
    for each in inspect.signature(function, follow_wrapped=False).parameters.values():
        if each.kind is not each.VAR_KEYWORD:
            found[each.name] = Argument(each.name, hints[each.name], each.default, each.kind is each.KEYWORD_ONLY)
            continue
        (shared,) = get_args(hints[each.name])
        for owner in GROUPS.get(shared, (shared,)):
            for name, hint in get_type_hints(owner, include_extras=True).items():
                default = _written(hint).default
                default = False if default is None and type(None) not in _kinds(hint) else default
                found[name] = Argument(name, hint, default, is_option=True, owner=owner)
    return found


def command(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function a command: its arguments are checked, and what goes wrong is an ``OrchestratorError``.

    The files that are its arguments, but for ``out``, are not written over while it works.

    Options that it shares stand in its signature and in its docstring, each as if it were the function's own.
    """
    taken = declared(function)
    kinds = {True: inspect.Parameter.KEYWORD_ONLY, False: inspect.Parameter.POSITIONAL_OR_KEYWORD}
    listed = [
        inspect.Parameter(name, kinds[each.is_option], default=each.default, annotation=_plain_type(each.hint))
        for name, each in taken.items()
    ]
    signature = inspect.signature(function).replace(parameters=listed)
    owners = dict.fromkeys(each.owner for each in taken.values() if each.owner)
    filled = {name: each.default for name, each in taken.items() if each.owner}

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            given = filled | signature.bind(*args, **kwargs).arguments
        except TypeError as error:  # one is missing, unknown or given twice
            unknown = next((name for name in kwargs if name not in taken), "")
            meant = get_close_matches(unknown, taken, 1)
            hint = f". Did you mean '{meant[0]}'?" if meant else ""
            msg = f"{function.__name__}() {error}{hint}"
            raise TypeError(msg) from None
        checked: Any = {name: check(taken[name], value) for name, value in given.items()}
        read = [value for name, value in checked.items() if name != "out" and os.PathLike in taken[name].kinds]
        with expected_errors(taken), keeping(*(path for value in read for path in several(value))):
            return function(**checked)  # type: ignore[call-arg]

    call.__signature__ = signature  # type: ignore[attr-defined]
    told = "\n".join((inspect.getdoc(owner) or "").partition("-\n")[2] for owner in owners)
    call.__doc__ = re.sub(r"^\*\*\w+\n(?: +.*\n)+", f"{told}\n", inspect.getdoc(function) or "", flags=re.MULTILINE)
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
    OrchestratorError
        It is a text that cannot be read as numbers.
    """
    kinds, name = wanted.kinds, _called(wanted)
    if value is None and type(None) in kinds:
        return None
    require(value is not None, f"{name} is None. Give a value.", ArgumentError)
    value = value.item() if hasattr(value, "item") and not getattr(value, "shape", ()) else value
    if wanted.written.read is not None:
        text = with_commas(value)
        try:
            return wanted.written.read(text)
        except ValueError:
            msg = f"cannot read {option(wanted.name)} {text!r} {wanted.written.like}"
            raise OrchestratorError(msg) from None
    if wanted.choices:
        if value not in wanted.choices:
            msg = f"{name} is {value!r}. Give {' or '.join(map(repr, wanted.choices))}."
            raise ArgumentError(msg)
        return value
    if str in kinds or Mapping in kinds:
        return _texts(wanted, value)
    kind = next(each for each in (bool, int, float) if each in kinds)
    if not isinstance(value, (int, float) if kind is float else kind) or (isinstance(value, bool) and kind is not bool):
        noun = {float: "a number", int: "a whole number", bool: "True or False"}[kind]
        msg = f"{name} is {value!r}. Give {noun}."
        raise ArgumentError(msg)
    bounds = (("at least", wanted.written.least, 1), ("at most", wanted.written.most, -1))
    if any(bound is not None and sign * (value - bound) < 0 for _, bound, sign in bounds):
        allowed = " and ".join(f"{word} {bound:g}" for word, bound, _ in bounds if bound is not None)
        msg = f"{name} is {value!r}. Give {allowed}."
        raise ArgumentError(msg)
    return kind(value)


def _texts(wanted: Argument, value: Any) -> Any:  # noqa: ANN401
    """Return paths, texts, or values by name, which are read where they are used."""
    kinds = wanted.kinds
    if Mapping in kinds and isinstance(value, Mapping):
        return value
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if is_number and Sequence not in kinds and os.PathLike not in kinds:
        return f"{value:.15g}"  # such as the unit 1
    nouns = {os.PathLike: "a path", Mapping: "values by name, such as {'seed': 2}"}
    nouns |= {Sequence: "a name, or a list of names", str: "a text"}
    noun = next(text for kind, text in nouns.items() if kind in kinds)
    allowed = (str, os.PathLike) if os.PathLike in kinds else (str,)
    one = Sequence not in kinds or isinstance(value, str | os.PathLike)
    every = [value] if one else several(value)
    require(
        every or wanted.default is not inspect.Parameter.empty, f"{_called(wanted)} is empty. Give {noun}.", ArgumentError
    )
    for each in every:
        require(isinstance(each, allowed), f"{_called(wanted)} is {each!r}. Give {noun}.", ArgumentError)
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


def names_of(given: NamesWithCommas) -> tuple[str, ...]:
    """Return names of a list with commas; "none" stands for no name."""
    return tuple(name.strip() for name in with_commas(given).split(",") if name.strip() != "none")


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


def _plain_type(hint: Any) -> Any:  # noqa: ANN401
    """Return a type as Python's own help writes it: without what only the command line knows."""
    if get_origin(hint) is Annotated:
        return _plain_type(get_args(hint)[0])
    if get_origin(hint) in (Union, UnionType):
        return reduce(or_, map(_plain_type, get_args(hint)))
    return hint


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
