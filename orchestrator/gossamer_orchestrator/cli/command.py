"""What every command offers, made once: --json, --quiet, --verbose, --log-file, and how an answer is printed.

A command returns its ``Result``. Paths and tables of the answer go to stdout by ``show``; with --json they do not, and the
answer is printed as one JSON document instead. Everything else is on stderr: ``note`` and the console of ``stderr``.
"""

from __future__ import annotations

import inspect
import json
import logging
import math
import shlex
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from typer.core import TyperCommand, TyperGroup

from ..errors import OrchestratorError

INVALID = 3  # exit code: all went well, and the judgement is not valid
OURS = ("gossamer_models", "gossamer_fmus", "gossamer_orchestrator")  # loggers
NO_TERMINAL = 160  # columns

_log = logging.getLogger(__name__)
_log_of_errors = logging.getLogger(f"{__name__}.errors")  # to the file only: the message is on stderr already


@dataclass
class _Output:
    """Where this program prints what; set when a command begins."""

    json: bool = False
    quiet: bool = False


_OUTPUT = _Output()


@dataclass(frozen=True)
class Result:
    """What a command found.

    Attributes
    ----------
    content : mapping
        As JSON: keys end in the unit (``time_s``), ratios have none, or ``units`` stands beside them. Paths, arrays and data
        classes become texts, lists and mappings; what is not finite becomes null.
    code : int
        Exit code.
    """

    content: Mapping[str, Any]
    code: int = 0


def show(thing: Any) -> None:  # noqa: ANN401
    """Print a path, a text or a table of the answer on stdout, unless the answer is JSON."""
    if _OUTPUT.json:
        return
    if isinstance(thing, str | Path):
        typer.echo(thing)
    else:
        Console(width=None if sys.stdout.isatty() else NO_TERMINAL).print(thing)


def note(text: str) -> None:
    """Print a sentence on stderr, unless the user wants quiet."""
    if not _OUTPUT.quiet:
        typer.echo(text, err=True)


def stderr() -> Console:
    """Return a console for tables and progress, as wide as the terminal; it prints nothing if the user wants quiet."""
    return Console(stderr=True, quiet=_OUTPUT.quiet, width=None if sys.stderr.isatty() else NO_TERMINAL)


def is_quiet() -> bool:
    """Tell whether the user wants errors alone, for what another process prints."""
    return _OUTPUT.quiet


@cache
def _common_options() -> list[Any]:
    def common(
        as_json: Annotated[bool, typer.Option("--json", help="Print the answer as one JSON document.")] = False,
        quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but the answer and errors.")] = False,
        verbose: Annotated[
            bool, typer.Option("--verbose", "-v", help="Print what is done, and how long it takes.")
        ] = False,
        log_file: Annotated[
            Path | None,
            typer.Option(
                help="Append to this file what --verbose prints, warnings and errors, with times.", metavar="FILE"
            ),
        ] = None,
    ) -> None:
        pass

    options = as_options(dict(inspect.signature(common, eval_str=True).parameters))
    for option in options:
        option.rich_help_panel = "Options of all commands"
    return options


def as_options(declared: dict[str, inspect.Parameter]) -> list[Any]:
    """Return the options that typer makes of the parameters of a function."""
    command = typer.Typer(add_completion=False)

    @command.command()
    def only_options() -> None:
        """Stand for the signature below."""

    only_options.__signature__ = inspect.Signature(list(declared.values()))  # type: ignore[attr-defined]
    return list(typer.main.get_command(command).params)


def _given(ctx: Any) -> None:  # noqa: ANN401
    """Take the common options out of the arguments of a function; they may stand before and after a command's name."""
    for option in _common_options():
        ctx.meta[option.name] = ctx.params.pop(option.name) or ctx.meta.get(option.name)


class Group(TyperGroup):
    """All commands, with the options that they share."""

    def get_params(self, ctx: Any) -> list[Any]:  # noqa: ANN401
        """Return all options."""
        *own, help_option = super().get_params(ctx)
        return [*own, *_common_options(), help_option]

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401
        """Call a command."""
        _given(ctx)
        return super().invoke(ctx)


class Command(TyperCommand):
    """A command with the common options; it prints its answer, and an expected error as its message alone."""

    def get_params(self, ctx: Any) -> list[Any]:  # noqa: ANN401
        """Return all options."""
        *own, help_option = super().get_params(ctx)
        return [*own, *_common_options(), help_option]

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401
        """Call the function and print its answer."""
        _given(ctx)
        _OUTPUT.json, _OUTPUT.quiet = bool(ctx.meta["as_json"]), bool(ctx.meta["quiet"])
        try:
            with _logging(bool(ctx.meta["verbose"]), ctx.meta["log_file"]):
                answer = super().invoke(ctx)
        except OrchestratorError as error:
            for text in (str(error), *getattr(error, "__notes__", ())):
                typer.echo(text, err=True)
            raise typer.Exit(1) from None
        if _OUTPUT.json:
            typer.echo(json.dumps(as_json(answer.content), indent=1, allow_nan=False))
        if answer.code:
            raise typer.Exit(answer.code)


def as_json(value: Any) -> Any:  # noqa: ANN401
    """Return a value as JSON can hold it."""
    if isinstance(value, Mapping):
        return {str(name): as_json(each) for name, each in value.items()}
    if is_dataclass(value):
        return {each.name: as_json(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, list | tuple):
        return [as_json(each) for each in value]
    if hasattr(value, "tolist"):
        return as_json(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int | None) else str(value)


@contextmanager
def _logging(verbose: bool, file: Path | None) -> Iterator[None]:
    """Send log messages to stderr, and to a file if there is one, inside the ``with`` block."""
    root, begun = logging.getLogger(), time.perf_counter()
    handlers: list[logging.Handler] = [_Stderr(verbose)]
    if file is not None:
        handlers.append(_open_log(file))
    levels = {name: logging.getLogger(name).level for name in OURS}
    for handler in handlers:
        root.addHandler(handler)
    for name in OURS:
        logging.getLogger(name).setLevel(logging.INFO if verbose or file else logging.WARNING)
    try:
        _log.info("gossamer %s, Python %s: %s", version("gossamer"), sys.version.split()[0], shlex.join(sys.argv[1:]))
        yield
        _log.info("done in %.1f s", time.perf_counter() - begun)
    except BaseException as error:
        _log_of_errors.info("ended after %.1f s: %s: %s", time.perf_counter() - begun, type(error).__name__, error)
        raise
    finally:
        for handler in handlers:
            root.removeHandler(handler)
            handler.close()
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def _open_log(file: Path) -> logging.Handler:
    try:
        handler = logging.FileHandler(file, encoding="utf-8")
    except OSError as error:
        msg = f"cannot write {file}: {error.strerror or error}. Name another file with --log-file."
        raise OrchestratorError(msg) from error
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    return handler


class _Stderr(logging.Handler):
    """Print messages on what stderr is at that time: a progress bar stands in for it while it is drawn."""

    def __init__(self, verbose: bool) -> None:
        super().__init__(logging.INFO if verbose else logging.ERROR if _OUTPUT.quiet else logging.WARNING)
        self.setFormatter(logging.Formatter(f"%(levelname)s{' %(name)s' if verbose else ''}: %(message)s"))
        self.addFilter(lambda record: record.name != _log_of_errors.name)

    def emit(self, record: logging.LogRecord) -> None:
        typer.echo(self.format(record), err=True)
