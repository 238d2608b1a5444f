"""What is in a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..display import as_html

if TYPE_CHECKING:
    from rich.console import Console


@dataclass(frozen=True, kw_only=True, repr=False)
class FmuInfo:
    """An FMU.

    Attributes
    ----------
    path : Path
        The FMU.
    name, description : str
        What it is.
    fmi : str
        Version of the standard.
    variables : dict of str to mapping
        By name: causality, type, unit, start, min, max and description, None where the FMU does not say; for pandas,
        ``pandas.DataFrame(info.variables).T``.
    """

    path: Path
    name: str
    description: str
    fmi: str
    variables: Mapping[str, Mapping[str, Any]]

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"FmuInfo({str(self.path)!r}: {self.description}, FMI {self.fmi}, {len(self.variables)} variables)"

    def _repr_html_(self) -> str:
        return as_html([f"{self.name}: {self.description}"], self._print, None, "")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.inspect import variable_table

        rows: Sequence[Mapping[str, Any]] = [{"variable": name, **each} for name, each in self.variables.items()]
        console.print(variable_table(f"FMI {self.fmi}", rows))
