"""``gossamer info`` and ``gossamer verify``: look into an FMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .command import Result, show, stderr

if TYPE_CHECKING:
    from rich.table import Table

    from ..verify import Finding

MOST_ROWS = 2000
SHOWN = ("structuralParameter", "parameter", "input", "output")  # causalities
HEADINGS = ("variable", "causality", "type", "unit", "start", "min", "max", "description")


def info(
    fmu: Annotated[Path, typer.Argument(help="An FMU file.")],
    locals_: Annotated[bool, typer.Option("--locals", help="List local variables too.")] = False,
) -> Result:
    """Show an FMU's parameters, inputs and outputs.

    More than 2000 variables are printed a line each, with tabs between the columns.

    For example:

        gossamer info out/fmus/sensor.fmu
    """
    content = look_into(fmu, locals_)
    variables = content["variables"]
    if len(variables) > MOST_ROWS:  # a table of these takes minutes to lay out
        show("\n".join("\t".join(_cells(each)) for each in variables))
    else:
        show(variable_table(f"{content['name']}: {content['description']}", variables))
    return Result(content)


def look_into(fmu: Path, locals_: bool) -> dict[str, Any]:
    """Return name, description and FMI version of an FMU, and its variables by causality, each by ``HEADINGS``."""
    from ..fmi.file import FmuFile

    file = FmuFile(fmu, validate=False)
    about = file.description
    rows: dict[str, list[dict[str, Any]]] = {causality: [] for causality in (*SHOWN, *(("local",) if locals_ else ()))}
    for v in about.modelVariables:
        if v.causality in rows:
            kind = f"{v.type}[{','.join(map(str, v.shape))}]" if v.shape else v.type
            unit = v.unit or (v.declaredType.unit if v.declaredType is not None else None)
            cells = (v.name, v.causality, kind, unit, v.start, v.min, v.max, v.description)
            rows[v.causality].append(dict(zip(HEADINGS, cells, strict=True)))
    return {
        "name": file.name,
        "description": about.description or about.modelName,
        "fmi": about.fmiVersion,
        "variables": [each for group in rows.values() for each in group],
    }


def variable_table(title: str, variables: Sequence[Mapping[str, Any]]) -> Table:
    """Return a table of the variables of an FMU, a section for each causality."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(title), expand=False)
    for heading in HEADINGS:
        table.add_column(heading, overflow="fold", no_wrap=heading in ("variable", "causality", "type"))
    for _, group in groupby(variables, key=lambda each: each["causality"]):
        for each in group:
            table.add_row(*map(escape, _cells(each)))
        table.add_section()
    return table


def _cells(variable: Mapping[str, Any]) -> list[str]:
    return ["" if cell is None else str(cell) for cell in variable.values()]


def verify(
    fmus: Annotated[list[Path], typer.Argument(help="FMU files of any tool.")],
    limit: Annotated[float, typer.Option(help="Time that one call of the FMU may take [s].")] = 30.0,
) -> Result:
    """Check FMUs against FMI and against their declared capabilities.

    Checks archive, model description and binary of FMUs, FMI 2.0 and 3.0, and the behaviour of those for co-simulation. An
    FMU runs in a process of its own, which it may crash or hang. Prints a table per FMU; exits 1 if a check failed.

    For example:

        gossamer verify out/fmus/*.fmu
    """
    from rich.markup import escape

    from ..verify import FAILED, verify

    reports = {}
    for path in fmus:
        with stderr().status(f"verifying {escape(str(path))}"):
            reports[str(path)] = findings = verify(path, limit=limit)
        show(findings_table(path, findings))
    failed = any(finding.verdict == FAILED for findings in reports.values() for finding in findings)
    return Result(reports, int(failed))


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
