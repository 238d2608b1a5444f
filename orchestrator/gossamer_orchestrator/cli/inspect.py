"""``gossamer info`` and ``gossamer verify``: look into an FMU."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from .common import wide

if TYPE_CHECKING:
    from rich.table import Table

    from ..verify import Finding

MOST_ROWS = 2000


def info(
    fmu: Annotated[Path, typer.Argument(help="An FMU file.")],
    locals_: Annotated[bool, typer.Option("--locals", help="List local variables too.")] = False,
) -> None:
    """Show an FMU's parameters, inputs and outputs.

    More than 2000 variables are printed a line each, with tabs between the columns.

    For example:

        gossamer info out/fmus/sensor.fmu
    """
    from rich.markup import escape
    from rich.table import Table

    from ..fmi.file import FmuFile

    file = FmuFile(fmu, validate=False)
    table = Table(title=f"{file.name}: {file.description.description or file.description.modelName}", expand=False)
    for heading in ("variable", "causality", "type", "unit", "start", "min", "max", "description"):
        table.add_column(heading, overflow="fold", no_wrap=heading in ("variable", "causality", "type"))
    shown = ("structuralParameter", "parameter", "input", "output", *(("local",) if locals_ else ()))
    rows: dict[str, list[list[str]]] = {causality: [] for causality in shown}
    for v in file.description.modelVariables:
        if v.causality in rows:
            kind = f"{v.type}[{','.join(map(str, v.shape))}]" if v.shape else v.type
            unit = v.unit or (v.declaredType.unit if v.declaredType is not None else None)
            cells = (v.name, v.causality, kind, unit, v.start, v.min, v.max, v.description)
            rows[v.causality].append([str(cell) if cell is not None else "" for cell in cells])
    if sum(map(len, rows.values())) > MOST_ROWS:  # a table of these takes minutes to lay out
        typer.echo("\n".join("\t".join(row) for group in rows.values() for row in group))
        return
    for group in rows.values():
        for row in group:
            table.add_row(*map(escape, row))
        table.add_section()
    wide().print(table)


def verify(
    fmus: Annotated[list[Path], typer.Argument(help="FMU files of any tool.")],
    limit: Annotated[float, typer.Option(help="Time that one call of the FMU may take [s].")] = 30.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON in place of tables.")] = False,
) -> None:
    """Check FMUs against FMI and against their declared capabilities.

    Checks archive, model description and binary of FMUs, FMI 2.0 and 3.0, and the behaviour of those for co-simulation. An
    FMU runs in a process of its own, which it may crash or hang. Prints a table per FMU; exits 1 if a check failed.

    For example:

        gossamer verify out/fmus/*.fmu
    """
    import json
    from dataclasses import asdict

    from rich.markup import escape

    from ..verify import FAILED, verify

    console = wide()
    reports = {}
    for path in fmus:
        with Console(stderr=True).status(f"verifying {escape(str(path))}"):
            reports[str(path)] = findings = verify(path, limit=limit)
        if not as_json:
            console.print(findings_table(path, findings))
    if as_json:
        typer.echo(json.dumps({path: [asdict(f) for f in findings] for path, findings in reports.items()}, indent=1))
    if any(finding.verdict == FAILED for findings in reports.values() for finding in findings):
        raise typer.Exit(1)


def findings_table(path: Path, findings: Sequence[Finding]) -> Table:
    """Return a table of what the checks of an FMU found."""
    from rich.markup import escape
    from rich.table import Table
    from rich.text import Text

    colours = {"passed": "green", "failed": "bold red", "remark": "yellow"}
    table = Table("check", "verdict", "why", title=escape(str(path)), expand=False)
    for finding in findings:
        table.add_row(finding.check, Text(finding.verdict, colours.get(finding.verdict, "")), escape(finding.why))
    return table
