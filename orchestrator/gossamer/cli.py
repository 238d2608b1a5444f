"""The command ``gossamer``, made from the public functions: their signatures are its options, their docstrings its help.

An answer is paths and values on stdout, or JSON; progress, tables and errors are on stderr.
"""

from __future__ import annotations

import inspect
import json
import logging
import os
import re
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

import cyclopts
from gossamer_files import as_json, exit_code
from gossamer_files.inputs import is_pipe, keep, keeping
from gossamer_files.options import DASHES, STYLE, option
from gossamer_orchestrator.errors import OrchestratorError

from . import HOMES
from .arguments import COMMANDS, Argument, ArgumentError, declared
from .results import Result, print_tables
from .working import NO_TERMINAL, TERMINAL, stderr

OURS = ("gossamer_files", "gossamer_models", "gossamer_fmus", "gossamer_orchestrator", "gossamer")  # loggers
MORE = "Every command has its own help: gossamer run --help"
ORDER = (  # of the commands in the help: that of work
    *("new", "build", "validate", "run", "export-ssp", "container", "sweep", "demo"),
    *("report", "view", "plot", "export-vtk", "verify", "info", "train", "calibrate", "twin", "inspect", "watch"),
    *("campaign", "assess", "assess-detector", "place-sensors", "modes", "reduce", "identify", "recover", "flight"),
)
NOTHING = inspect.Parameter.empty
USAGE, INTERRUPTED = 2, 130  # exit codes
COMMON = {  # options of all commands: how they are written, and the help
    "json": (("--json",), bool, "Print the answer as one JSON document."),
    "quiet": (("--quiet", "-q"), bool, "Print nothing but the answer and errors."),
    "verbose": (("--verbose", "-v"), bool, "Print what is done, and how long it takes."),
    "log_file": (("--log-file",), Path, "Append to this file what --verbose prints, warnings and errors, with times."),
}

LOGGED = re.compile(rb"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} [A-Z]+ |$")  # what a log begins with

_log = logging.getLogger(__name__)
_log_of_errors = logging.getLogger(f"{__name__}.errors")  # to the file only: the message is on stderr already


def main(tokens: Sequence[str] | None = None) -> None:
    """Run the command line; exit with its code."""
    words = list(sys.argv[1:] if tokens is None else tokens)
    if {"watch", "recover"} & set(words):  # no other commands read lines as they arrive
        words = ["/dev/stdin" if word == "-" else word for word in words]
    style = os.environ.get(STYLE)
    os.environ[STYLE] = DASHES  # processes that this one starts write as it does
    code = 0
    try:
        code = _run(words)
        print(end="", flush=True)
    except OSError as error:  # of stdout: those of commands are sentences already
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # where Python sends what is left when it ends
        if not isinstance(error, BrokenPipeError):  # where nobody reads any more, nobody is told
            print(f"cannot write the answer: {error.strerror or error}. Send it elsewhere.", file=sys.stderr)
        code = code or 1
    finally:
        TERMINAL.quiet, TERMINAL.talks, TERMINAL.typed = False, False, None
        del os.environ[STYLE]
        if style is not None:
            os.environ[STYLE] = style
    sys.exit(code)


def commands(wanted: str = "") -> dict[str, Callable[..., Any]]:
    """Return the commands by name: all of them, or at least the one that is wanted, if there is one."""
    name = wanted.replace("-", "_")
    if name in HOMES:
        import_module(HOMES[name])
    if name not in COMMANDS:
        for home in dict.fromkeys(HOMES.values()):
            import_module(home)
    return COMMANDS


def parsed(words: Sequence[str]) -> tuple[str, dict[str, Any], Callable[[], Any] | None]:
    """Read a command line.

    Returns
    -------
    str
        Name of the command in Python.
    dict
        Its arguments and the common options, by name.
    callable or None
        What prints a help or the version, where they are wanted.

    Raises
    ------
    cyclopts.CycloptsError
        It has an unknown command, or options that are unknown, missing or of another type.
    """
    words = _common_behind(words)
    called, bound, _ = _app(words[0] if words else "").parse_args(words, print_error=False, exit_on_error=False)
    if called.__name__ not in COMMANDS:
        return "", {}, lambda: called(*bound.args, **bound.kwargs)
    return called.__name__, dict(bound.arguments), None


def _run(words: list[str]) -> int:
    try:
        name, given, other = parsed(words)
    except cyclopts.CycloptsError as error:
        wanted = next((word for word in words if word.replace("-", "_") in COMMANDS), "run")
        print(f"{error}\n{MORE.replace('run', wanted)}", file=sys.stderr)
        return USAGE
    if other is not None:
        other()
        return 0 if words else USAGE
    common = {each: given.pop(each, None) for each in COMMON}
    TERMINAL.quiet, TERMINAL.talks, TERMINAL.typed = bool(common["quiet"]), True, words
    try:
        with _logging(bool(common["verbose"]), common["log_file"]):
            return _answer(COMMANDS[name](**given), bool(common["json"]))
    except ArgumentError as error:
        print(error, file=sys.stderr)
        return USAGE
    except (OrchestratorError, KeyboardInterrupt) as error:
        print(str(error) or "Interrupted.", *getattr(error, "__notes__", ()), sep="\n", file=sys.stderr)
        return exit_code(error) if isinstance(error, OrchestratorError) else INTERRUPTED


def _answer(found: Any, wants_json: bool) -> int:  # noqa: ANN401
    """Print what a command found; return its exit code."""
    if not isinstance(found, Result):  # a file, or several
        one = isinstance(found, Path)
        content = {"page" if one and found.suffix == ".html" else "file" if one else "files": found}
        print(_json(content) if wants_json else "\n".join(map(str, [found] if one else found)))
        return 0
    console = stderr()
    stdout = type(console)(width=None if sys.stdout.isatty() else NO_TERMINAL)
    if found.TABLES == "stderr":
        print_tables(console, found.tables())
    elif found.TABLES == "stdout" and not wants_json:
        print_tables(stdout, found.tables())
    for line in found.lines():
        console.print(line, highlight=False, markup=False)
    for line in found.doubts():
        console.print(line, style="bold yellow", highlight=False, markup=False)
    if wants_json:
        print(_json(found.to_json()))
    else:
        for path in found.files:
            print(path)
    for line in found.hints():
        style = "bold red" if line.startswith("Warning: ") else None
        console.print(line, style=style, highlight=False, markup=False, soft_wrap=True)
    return found.exit_code()


def _json(content: Any) -> str:  # noqa: ANN401
    return json.dumps(as_json(content), indent=1, allow_nan=False)


def _common_behind(words: Sequence[str]) -> list[str]:
    """Put options of all commands that stand before the command's name behind it."""
    left, before = list(words), []
    flags = {flag for flags, kind, _ in COMMON.values() if kind is bool for flag in flags}
    while left and (left[0] in flags or left[0].partition("=")[0] == "--log-file"):
        before.append(left.pop(0))
        if before[-1] == "--log-file" and left:
            before.append(left.pop(0))
    return [*left[:1], *before, *left[1:]]


def _app(wanted: str) -> cyclopts.App:
    """Return all commands, with the options of the one that is wanted."""
    known, one = commands(wanted), wanted.replace("-", "_") in COMMANDS
    common = ", ".join(" or ".join(flags) for flags, _, _ in COMMON.values())
    app = cyclopts.App(
        name="gossamer",
        help="Structural health monitoring of gossamer membranes with Functional Mock-up Units.\n\n"
        "Start with 'gossamer demo', then look at out/.",
        help_epilogue="" if one else f"All commands take {common}.\n{MORE}",
        help_format="markdown" if one else "plaintext",
        version=_version,
    )
    for name, function in known.items():
        flag = name.replace("_", "-")
        place = ORDER.index(flag) if flag in ORDER else len(ORDER)

        def call() -> None:
            pass

        call.__name__ = name
        text = inspect.getdoc(function) or ""
        if flag == wanted:
            call.__signature__, call.__doc__ = _signature(function), text  # type: ignore[attr-defined]
            text = _help(text)
        app.command(call, name=flag, help=text if flag == wanted else text.partition("\n")[0], sort_key=place)
    return app


def _version() -> str:
    from importlib.metadata import version

    return version("gossamer")


def _help(text: str) -> str:
    """Return the help of a command: what stands above its parameters, and its examples of the command line."""
    about, _, rest = text.partition("\nParameters\n")
    examples = re.sub(r"\n\s*\n", "\n", rest.partition("On the command line::")[2].strip("\n"))
    return f"{about.replace('``', '')}\nFor example:\n\n{examples}"


def _signature(function: Callable[..., Any]) -> inspect.Signature:
    """Return the arguments and options of a command as cyclopts reads them."""
    group = cyclopts.Group("Options of all commands", sort_key=100)
    listed = [_parameter(each) for each in declared(function).values()]
    for name, (flags, kind, text) in COMMON.items():
        how = cyclopts.Parameter(name=flags, help=text, group=group, negative=(), show_default=False, allow_repeating=True)
        hint, default = Annotated[kind | None, how], None
        listed.append(inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=hint, default=default))
    return inspect.Signature(listed)


def _parameter(argument: Argument) -> inspect.Parameter:
    """Return an argument as cyclopts reads it: the one place that knows how Python's types are written in a shell."""
    kinds, written = argument.kinds, argument.written
    kind: Any = next((each for each in (bool, int, float) if each in kinds), str)
    if argument.choices:
        kind = Literal[tuple(argument.choices)]
    elif written.many and argument.is_option:
        kind = list[str]
    elif str in kinds:
        kind = str
    hint = kind | None if argument.default is None else kind
    title = (inspect.getdoc(argument.owner) or "").partition(".")[0] if argument.owner else ""
    panel = cyclopts.Group(title, sort_key=50) if title else "Parameters" if argument.is_option else "Arguments"
    how = cyclopts.Parameter(
        metavar=written.placeholder,
        negative=None if kind is bool and argument.default is not False else (),
        converter=None if kind is bool else partial(_value, kind),
        show_default=not any(argument.default is each for each in (None, False, NOTHING)),
        allow_repeating=True,
        allow_leading_hyphen=written.read is not None,  # a list may begin with a negative number
        required=argument.default is NOTHING,
        group=panel,
    )
    if argument.is_option or not written.many:
        place = inspect.Parameter.KEYWORD_ONLY if argument.is_option else inspect.Parameter.POSITIONAL_ONLY
        return inspect.Parameter(argument.name, place, annotation=Annotated[hint, how], default=argument.default)
    return inspect.Parameter(argument.name, inspect.Parameter.VAR_POSITIONAL, annotation=Annotated[str, how])


def _value(kind: Any, _hint: Any, tokens: Sequence[cyclopts.Token]) -> Any:  # noqa: ANN401
    """Read what was typed; cyclopts itself takes the word none for nothing where an option may be left out."""
    texts = [token.value for token in tokens]
    if get_origin(kind) is list:
        return texts
    if get_origin(kind) is Literal:
        choices = {str(each): each for each in get_args(kind)}
        if texts[0] not in choices:
            raise cyclopts.CoercionError(token=tokens[0], target_type=kind)
        return choices[texts[0]]
    try:
        return kind(texts[0])
    except ValueError:
        noun = "a whole number" if kind is int else "a number"
        msg = f"{tokens[0].keyword} is {texts[0]}. Give {noun}."
        raise cyclopts.CoercionError(msg=msg) from None


@contextmanager
def _logging(verbose: bool, file: Path | None) -> Iterator[None]:
    """Send log messages to stderr, and to a file if there is one, inside the ``with`` block."""
    root, begun = logging.getLogger(), time.perf_counter()
    with keeping(), ExitStack() as ending:
        for handler in (_Stderr(verbose), *([] if file is None else [_open_log(file)])):
            root.addHandler(handler)
            ending.callback(handler.close)
            ending.callback(root.removeHandler, handler)
        keep(*([] if file is None else [file]))
        for logger in map(logging.getLogger, OURS):
            ending.callback(logger.setLevel, logger.level)
            logger.setLevel(logging.INFO if verbose or file else logging.WARNING)
        try:
            if _log.isEnabledFor(logging.INFO):
                typed = shlex.join(TERMINAL.typed or ())
                _log.info("gossamer %s, Python %s: %s", _version(), sys.version.split()[0], typed)
            yield
            _log.info("done in %.1f s", time.perf_counter() - begun)
        except BaseException as error:
            _log_of_errors.info("ended after %.1f s: %s: %s", time.perf_counter() - begun, type(error).__name__, error)
            raise


def _open_log(file: Path) -> logging.Handler:
    try:
        if is_pipe(file):
            msg = "it is a pipe"
            raise OSError(msg)
        handler = _LogFile(file, encoding="utf-8")
        with file.open("rb") if file.is_file() else nullcontext() as there:
            begin = b"" if there is None else there.read(40)
        if not LOGGED.match(begin):
            handler.close()
            msg = f"{file} is there and is no log of Gossamer. Name another file with {option('log_file')}."
            raise OrchestratorError(msg)
    except OSError as error:
        msg = f"cannot write {file}: {error.strerror or error}. Name another file with {option('log_file')}."
        raise OrchestratorError(msg) from error
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    return handler


class _LogFile(logging.FileHandler):
    """Append messages to a file; where it takes no more, say so once, and let the command go on."""

    def handleError(self, record: logging.LogRecord) -> None:
        if not isinstance(error := sys.exc_info()[1], OSError):
            super().handleError(record)
        elif self.level <= logging.CRITICAL:
            self.setLevel(logging.CRITICAL + 1)
            print(f"WARNING: {self.baseFilename} is not complete: {error.strerror}.", file=sys.stderr)

    def close(self) -> None:
        with suppress(OSError):
            super().close()


class _Stderr(logging.Handler):
    """Print messages on what stderr is at that time: a progress bar stands in for it while it is drawn."""

    def __init__(self, verbose: bool) -> None:
        super().__init__(logging.INFO if verbose else logging.ERROR if TERMINAL.quiet else logging.WARNING)
        self.setFormatter(logging.Formatter(f"%(levelname)s{' %(name)s' if verbose else ''}: %(message)s"))
        self.addFilter(lambda record: record.name != _log_of_errors.name)

    def emit(self, record: logging.LogRecord) -> None:
        print(self.format(record), file=sys.stderr)
