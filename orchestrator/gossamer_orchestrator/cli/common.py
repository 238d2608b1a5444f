"""What commands share: folders, expected errors."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from gossamer_files.pictures import FORMS

from ..errors import OrchestratorError
from .command import note

if TYPE_CHECKING:
    from ..pages import Page

logger = logging.getLogger(__name__)

FMUS = Path("out/fmus")
FmuFolder = Annotated[Path, typer.Option("--fmus", help="Folder of the FMUs that scenarios name.", metavar="FOLDER")]
ScenarioName = Annotated[str, typer.Argument(help="A scenario file, an .ssp, or the name of a shipped scenario.")]
Step = Annotated[float | None, typer.Option(help="Communication step [s] in place of the file's.")]
Stop = Annotated[float | None, typer.Option(help="Last time [s] in place of the file's.")]
Master = Annotated[str | None, typer.Option(help="gauss-seidel or jacobi, in place of the file's or for an .ssp.")]
Results = Annotated[
    Path,
    typer.Argument(help="Folder of a run, or its results.nc or results.csv.", metavar="RESULTS", show_default=False),
]
PictureForm = Annotated[str, typer.Option("--format", help="Of the pictures: png, svg or pdf.", metavar="FORM")]


def check_form(form: str) -> None:
    """Refuse a form that no picture has."""
    if form not in FORMS:
        msg = f"there are no pictures of form {form!r}. Choose {', '.join(FORMS[:-1])} or {FORMS[-1]}."
        raise OrchestratorError(msg)


@contextmanager
def model_errors() -> Iterator[None]:
    """Turn the errors of the models into expected errors of this program."""
    from gossamer_models import GossamerError

    try:
        yield
    except (GossamerError, ModuleNotFoundError) as error:
        raise OrchestratorError("\n".join((str(error), *getattr(error, "__notes__", ())))) from error
    except OSError as error:
        msg = f"cannot use {error.filename or 'the disk'}: {error.strerror or error}. Name another place with --out."
        raise OrchestratorError(msg) from error


def keep_inputs(inputs: Iterable[Path | None], outputs: Iterable[Path | None]) -> None:
    """Refuse to write over what a command reads, under whatever name.

    Parameters
    ----------
    inputs, outputs : iterable of Path or None
        Files or folders, by relative paths, links or otherwise; None is passed over.

    Raises
    ------
    OrchestratorError
        An output is an input, or lies in one that is a folder.
    """
    read = [path for path in inputs if path is not None]
    for output in (path for path in outputs if path is not None):
        for given in read:
            same = output.exists() and given.exists() and output.samefile(given)
            if same or output.resolve().is_relative_to(given.resolve()):
                msg = f"{output} would overwrite {given}, which is an input. Name another place with --out."
                raise OrchestratorError(msg)


def json_file(out: Path) -> Path:
    """Return the file that was named for an answer, with an ending: its page is in the folder of its name without it.

    Raises
    ------
    OrchestratorError
        The name is that of a folder, or the page would replace that of a run.
    """
    from ..results.files import RECORDED

    if out.name in ("", ".."):
        msg = f"cannot write {out}: it is a folder. Name a file in it with --out."
        raise OrchestratorError(msg)
    folder = out.with_suffix("")
    if any((folder / name).is_file() for name in RECORDED):
        msg = f"the page of {out} would replace that of the run in {folder}. Name another file with --out."
        raise OrchestratorError(msg)
    return out if out.suffix else out.with_name(f"{out.name}.json")


def save_page(describe: Callable[[], Page], path: Path) -> list[Path]:
    """Write a page, the last of what a command writes; return its path.

    Results are on the disk by then. Whatever goes wrong is a warning, and nothing is returned.
    """
    from ..pages import write_page

    try:
        return [write_page(describe(), path)]
    except Exception as error:
        logger.warning("%s was not written: %s: %s", path, type(error).__name__, error)
        logger.debug("where it was raised", exc_info=True)
        return []


def note_page(page: Path) -> None:
    """Say which page to open, and the command that opens it."""
    note(f"Open {page}, or type 'gossamer view {typed(page.parent)}'.")


def typed(path: Path) -> str:
    """Return a path as it is typed in a command."""
    return f'"{path}"' if " " in str(path) else str(path)


def kinds_of(paths: Iterable[Path]) -> str:
    """Say what FMUs run in and on which platforms."""
    from ..fmi.archive import describe_fmu

    kinds: dict[str, list[str]] = {}
    for path in dict.fromkeys(paths):
        kinds.setdefault(describe_fmu(path), []).append(path.stem)
    return "; ".join(f"{', '.join(names)} ({kind})" for kind, names in kinds.items())
