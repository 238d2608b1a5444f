"""The command ``gossamer``, one file per theme.

A command parses, calls one function and prints one result: paths and values on stdout; progress, tables and errors on
stderr. Heavy imports stand inside the commands.
"""

from __future__ import annotations

import logging
import sys
from importlib.metadata import version
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from ..errors import OrchestratorError
from .assess import CommandWithColumns, assess
from .assess_detector import assess_detector
from .build import build
from .campaign import campaign
from .exchange import container, export
from .identify import CommandWithFields, identify
from .inspect import info, verify
from .pictures import export_vtk, plot
from .report import report, view
from .run import demo, run
from .sweep import sweep
from .train import train
from .twin import twin
from .watch import watch


class _Group(TyperGroup):
    """Print expected errors as their message alone."""

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401
        try:
            return super().invoke(ctx)
        except OrchestratorError as error:
            for text in (str(error), *getattr(error, "__notes__", ())):
                typer.echo(text, err=True)
            raise typer.Exit(1) from None


app = typer.Typer(
    cls=_Group,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""Structural health monitoring of gossamer membranes with Functional Mock-up Units.

Start with **gossamer demo**, then look at **out/**.
""",
    epilog="Every command has its own help: gossamer run --help",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(version("gossamer"))
        raise typer.Exit


@app.callback()
def _configure(
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Show all log messages, not only warnings.")] = False,
    _version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING,
        format="%(levelname)s %(name)s: %(message)s",
        stream=sys.stderr,
    )


app.command()(build)
app.command()(run)
app.command("export-ssp")(export)
app.command()(container)
app.command()(sweep)
app.command()(demo)
app.command()(report)
app.command()(view)
app.command()(plot)
app.command("export-vtk")(export_vtk)
app.command()(verify)
app.command()(info)
app.command()(train)
app.command()(twin)
app.command()(watch)
app.command()(campaign)
app.command(cls=CommandWithColumns)(assess)
app.command("assess-detector")(assess_detector)
app.command(cls=CommandWithFields)(identify)
