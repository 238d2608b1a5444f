"""Checks: of a scenario, without running it, and of FMUs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from gossamer_files.tables import TableText

from .arguments import AnyPath, Files, command, several
from .options import RunOptions, as_settings
from .results import Result
from .working import stderr

if TYPE_CHECKING:
    from gossamer_orchestrator.run.child import Outline
    from gossamer_orchestrator.verify import Finding
    from rich.table import Table

MOST_CONNECTIONS = 200  # in a table


@dataclass(frozen=True, kw_only=True, repr=False)
class Validation(Result):
    """A scenario that can run.

    Attributes
    ----------
    outline : gossamer_orchestrator.run.child.Outline
        ``components`` in stepping order, ``connections``, times, what is recorded, and ``warnings``.
    """

    outline: Outline
    TABLES = "stdout"

    @property
    def sentence(self) -> str:
        """How long the run is, and what it records."""
        from gossamer_orchestrator.words import counted, recorded

        found = self.outline
        return (
            f"The scenario can run: {counted(len(found.components), 'component')}, "
            f"{counted(len(found.connections), 'connection')}, steps of {found.step:g} s from {found.start:g} to "
            f"{found.stop:g} s, {found.master}; {recorded(found.variables, found.scalars)} are recorded at "
            f"{found.points} points."
        )

    def lines(self) -> list[str]:
        """Return how long the run is."""
        return [self.sentence]

    def more(self) -> list[str]:
        """Return warnings."""
        return self.outline.warnings

    def __repr__(self) -> str:
        return f"Validation({' '.join([self.sentence, *self.outline.warnings])})"

    def tables(self) -> list[TableText]:
        """Return the components, and the connections if there are some and not too many."""
        found, few = self.outline, 0 < len(self.outline.connections) <= MOST_CONNECTIONS
        components = ("component", "FMU", "FMI", "steps at every n-th point", "connected inputs")
        tables = [_cells(components, found.components, "In stepping order")]
        return tables + [_cells(("from", "unit", "to", "unit", "gain", "bias"), found.connections, "Connections")] * few

    def to_json(self) -> dict[str, Any]:
        """Return what the run would do."""
        return asdict(self.outline) | {"units": {"start": "s", "stop": "s", "step": "s"}}


def _cells(head: tuple[str, ...], rows: Iterable[Mapping[str, object]], caption: str) -> TableText:
    return TableText(head, [tuple("" if x is None else str(x) for x in row.values()) for row in rows], caption)


@command
def validate(scenario: AnyPath, **options: Unpack[RunOptions]) -> Validation:
    """Check a scenario and its FMUs without running it.

    Checks names, types, units, inputs without a value, steps, events, what is recorded and the place on the disk, and starts
    the FMUs in a process of their own: what this refuses, a run refuses before its first step, and nothing else. Writes
    nothing.

    Parameters
    ----------
    scenario
        A scenario file, an .ssp, or the name of a shipped scenario.
    **options
        FMUs, times, changes and checks, see ``RunOptions``.

    Returns
    -------
    Validation
        Components in stepping order, connections with the units that are converted, and warnings; displayed in a notebook.

    Examples
    --------
    >>> gossamer.validate("my_scenario.toml")

    On the command line::

        gossamer validate my_scenario.toml
    """
    from gossamer_orchestrator.run.runner import validate_scenario
    from gossamer_orchestrator.scenario.source import find_scenario

    with stderr().status("starting the FMUs"):
        outline = validate_scenario(find_scenario(str(scenario)), **as_settings(**options))
    return Validation(outline=outline)


@dataclass(frozen=True, kw_only=True, repr=False)
class Verification(Result):
    """What the checks of FMUs found.

    Attributes
    ----------
    findings : dict of str to list of Finding
        By the path of the FMU.
    """

    findings: dict[str, list[Finding]]
    TABLES = "stdout"

    @property
    def failed(self) -> list[str]:
        """The checks that failed: FMU, check and reason."""
        from gossamer_orchestrator.verify import FAILED

        listed = [(path, each) for path, found in self.findings.items() for each in found]
        return [f"{path}: {each.check}: {each.why}" for path, each in listed if each.verdict == FAILED]

    @property
    def passed(self) -> bool:
        """Whether no check failed."""
        return not self.failed

    def exit_code(self) -> int:
        """Return the exit code: 1 if a check failed."""
        return int(not self.passed)

    @property
    def sentence(self) -> str:
        """How many checks failed."""
        return f"{len(self.failed) or 'No'} check{'s' * (len(self.failed) > 1)} failed."

    def __repr__(self) -> str:
        return f"Verification({', '.join(self.findings)}: {' '.join([self.sentence, *self.failed])})"

    def tables(self) -> list[Table]:
        """Return what the checks of each FMU found."""
        from rich.markup import escape
        from rich.table import Table
        from rich.text import Text

        colours = {"passed": "green", "failed": "bold red", "remark": "yellow"}
        tables = []
        for path, findings in self.findings.items():
            table = Table("check", "verdict", "why", title=escape(path), expand=False)
            for each in findings:
                table.add_row(each.check, Text(each.verdict, colours.get(each.verdict, "")), escape(each.why))
            tables.append(table)
        return tables

    def to_json(self) -> dict[str, Any]:
        """Return the findings by FMU."""
        return dict(self.findings)


@command
def verify(fmus: Files, *, limit: float = 30.0) -> Verification:
    """Check FMUs against FMI and against their declared capabilities.

    Checks archive, model description and binary of FMUs, FMI 2.0 and 3.0, and the behaviour of those for co-simulation. An
    FMU runs in a process of its own, which it may crash or hang.

    Parameters
    ----------
    fmus
        FMU files of any tool.
    limit
        Time that one call of the FMU may take [s].

    Returns
    -------
    Verification
        Findings by FMU; ``passed`` if no check failed.

    Examples
    --------
    >>> assert gossamer.verify("out/fmus/sensor.fmu").passed

    On the command line::

        gossamer verify out/fmus/*.fmu
    """
    from gossamer_orchestrator.verify import verify as check
    from rich.markup import escape

    findings = {}
    for path in several(fmus):
        with stderr().status(f"verifying {escape(str(path))}"):
            findings[str(path)] = check(Path(path), limit=limit)
    return Verification(findings=findings)
