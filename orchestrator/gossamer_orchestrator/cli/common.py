"""What commands share: folders, consoles, expected errors."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from ..errors import OrchestratorError

FMUS = Path("out/fmus")
FmuFolder = Annotated[Path, typer.Option("--fmus", help="Folder of the FMUs that scenarios name.", metavar="FOLDER")]


def wide(*, stderr: bool = False) -> Console:
    """Return a console as wide as its terminal, or 160 columns where there is none."""
    return Console(stderr=stderr, width=None if (sys.stderr if stderr else sys.stdout).isatty() else 160)


@contextmanager
def model_errors() -> Iterator[None]:
    """Turn the errors of the models into expected errors of this program."""
    from gossamer_models import GossamerError

    try:
        yield
    except (GossamerError, ModuleNotFoundError) as error:
        raise OrchestratorError(str(error)) from error
    except OSError as error:
        msg = f"cannot write there: {error}. Name another place with --out."
        raise OrchestratorError(msg) from error


def print_kinds(what: str, paths: Iterable[Path]) -> None:
    """Print one line on stderr: what FMUs run in and on which platforms."""
    from ..fmi.archive import describe_fmu

    kinds: dict[str, list[str]] = {}
    for path in dict.fromkeys(paths):
        kinds.setdefault(describe_fmu(path), []).append(path.stem)
    typer.echo(f"{what}: " + "; ".join(f"{', '.join(names)} ({kind})" for kind, names in kinds.items()), err=True)
