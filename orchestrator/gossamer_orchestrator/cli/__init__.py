"""The command ``gossamer``, one file per theme.

A command parses, calls one function and returns one answer: paths and values on stdout, or JSON; progress, tables and errors
on stderr. Heavy imports stand inside the commands.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import Annotated

import typer

from .assess import CommandWithColumns, assess
from .assess_detector import assess_detector
from .build import build
from .campaign import campaign
from .command import Command, Group
from .exchange import container, export
from .identify import CommandWithFields, identify
from .inspect import info, verify
from .new import new
from .pictures import export_vtk, plot
from .place_sensors import place_sensors
from .report import report, view
from .run import demo, run
from .sweep import sweep
from .train import train
from .twin import twin
from .validate import validate
from .watch import watch

app = typer.Typer(
    cls=Group,
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
    _version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    pass


app.command(cls=Command)(new)
app.command(cls=Command)(build)
app.command(cls=Command)(validate)
app.command(cls=Command)(run)
app.command("export-ssp", cls=Command)(export)
app.command(cls=Command)(container)
app.command(cls=Command)(sweep)
app.command(cls=Command)(demo)
app.command(cls=Command)(report)
app.command(cls=Command)(view)
app.command(cls=Command)(plot)
app.command("export-vtk", cls=Command)(export_vtk)
app.command(cls=Command)(verify)
app.command(cls=Command)(info)
app.command(cls=Command)(train)
app.command(cls=Command)(twin)
app.command(cls=Command)(watch)
app.command(cls=Command)(campaign)
app.command(cls=CommandWithColumns)(assess)
app.command("assess-detector", cls=Command)(assess_detector)
app.command("place-sensors", cls=Command)(place_sensors)
app.command(cls=CommandWithFields)(identify)
