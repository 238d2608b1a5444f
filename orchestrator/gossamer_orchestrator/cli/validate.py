"""``gossamer validate``: check a scenario without running it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..words import recorded
from .command import Result, show, stderr
from .common import FMUS, FmuFolder, Master, ScenarioName, Step, Stop

if TYPE_CHECKING:
    from rich.table import Table

    from ..run.child import Outline

MOST_ROWS = 200
UNITS = {"start": "s", "stop": "s", "step": "s"}


def validate(
    scenario: ScenarioName,
    fmus: FmuFolder = FMUS,
    step: Step = None,
    stop: Stop = None,
    values: Annotated[
        list[str] | None,
        typer.Option("--set", help="Value in place of the file's, as of gossamer run.", metavar="NAME=VALUE"),
    ] = None,
    master: Master = None,
    limit: Annotated[
        float | None, typer.Option(help="Time that one call of an FMU may take [s].", metavar="SECONDS", min=1e-3)
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse FMUs that break the rules of FMI; else that is a warning.")
    ] = False,
) -> Result:
    """Check a scenario and its FMUs without running it.

    Checks names, types, units, inputs without a value, steps, events, what is recorded and the place on the disk, and starts
    the FMUs in a process of their own: what this refuses, gossamer run refuses before its first step, and nothing else.
    Prints components in stepping order, and connections with the units that are converted. Writes nothing.

    For example:

        gossamer validate my_scenario.toml
    """
    found = validate_given(
        scenario, fmus, step=step, stop=stop, values=values, master=master, limit=limit, strict=strict
    )
    for table in tables(found):
        show(table)
    stderr().print(summary(found), highlight=False)
    return Result({**asdict(found), "units": UNITS})


def validate_given(
    scenario: str,
    fmus: Path,
    *,
    step: float | None,
    stop: float | None,
    values: list[str] | None,
    master: str | None,
    limit: float | None,
    strict: bool,
) -> Outline:
    """Check a scenario with the options of the command; return what a run would do."""
    from ..run.runner import validate_scenario
    from ..scenario.source import find_scenario
    from ..scenario.values import read_changes

    with stderr().status("starting the FMUs"):
        return validate_scenario(
            find_scenario(scenario),
            fmus,
            step=step,
            stop=stop,
            values=read_changes(values or []),
            master=master,
            limit=limit,
            strict=strict,
        )


def summary(found: Outline) -> str:
    """Say how long the run is, and what it records."""
    components, connections = len(found.components), len(found.connections)
    return (
        f"The scenario can run: {components} component{'s' * (components != 1)}, {connections} "
        f"connection{'s' * (connections != 1)}, steps of {found.step:g} s from {found.start:g} to {found.stop:g} s, "
        f"{found.master}; {recorded(found.variables, found.scalars)} are recorded at {found.points} points."
    )


def tables(found: Outline) -> list[Table]:
    """Return a table of the components, and one of the connections if there are some and not too many."""
    return [_components(found), *([_connections(found)] if 0 < len(found.connections) <= MOST_ROWS else [])]


def _components(found: Outline) -> Table:
    from rich.markup import escape
    from rich.table import Table

    table = Table("component", "FMU", "FMI", "steps at every n-th point", "connected inputs", title="In stepping order")
    for each in found.components:
        table.add_row(*(escape(str(cell)) for cell in each.values()))
    return table


def _connections(found: Outline) -> Table:
    from rich.markup import escape
    from rich.table import Table

    table = Table("from", "unit", "to", "unit", "gain", "bias", title="Connections")
    for each in found.connections:
        table.add_row(*("" if cell is None else escape(str(cell)) for cell in each.values()))
    return table
