"""Results of the chain of FMUs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from ..display import as_html, first_of

if TYPE_CHECKING:
    from gossamer_orchestrator import Judgement
    from gossamer_orchestrator.results.verdict import Verdict
    from gossamer_orchestrator.run.child import Outline
    from gossamer_orchestrator.run.sweep import Case
    from gossamer_orchestrator.verify import Finding
    from rich.console import Console

RUN_PICTURES = ("damage_history.png", "damage.png", "deflection.png", "sensors.png")


@dataclass(frozen=True, kw_only=True, repr=False)
class Run:
    """Results of a run.

    Attributes
    ----------
    folder : Path
        Where its files are.
    data : xarray.Dataset
        What was recorded, over ``time`` [s], with units and provenance; by ``zone``, ``sensor`` and node where that is
        known, see ``gossamer_orchestrator.results.places``.
    """

    folder: Path
    data: xr.Dataset

    @cached_property
    def judgements(self) -> list[Judgement]:
        """Judgement of the detector at the end of every window; none without a detector."""
        from gossamer_orchestrator.results.judgements import windows_of

        return windows_of(self.data)

    @cached_property
    def verdict(self) -> Verdict:
        """What the page of the run says first."""
        from gossamer_orchestrator.results.files import read_watch
        from gossamer_orchestrator.results.verdict import make_verdict

        return make_verdict(self.data, self.judgements, read_watch(self.folder))

    def __fspath__(self) -> str:
        return str(self.folder)

    def __getitem__(self, name: str) -> xr.DataArray:
        return self.data[name]

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r}: {self.verdict.sentence})"

    def _repr_html_(self) -> str:
        sentences = [self.verdict.sentence, *self.verdict.more, f"Files are in {self.folder}."]
        pictures = [self.folder / name for name in RUN_PICTURES]
        return as_html(sentences, self._print, first_of(pictures), self.verdict.sentence)

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.results.tables import history_table, zone_table

        if len(self.judgements) > 1:
            console.print(history_table(self.judgements))
        for judgement in [each for each in self.judgements if each.valid][-1:]:
            console.print(zone_table(judgement))


@dataclass(frozen=True, kw_only=True, repr=False)
class Validation:
    """A scenario that can run.

    Attributes
    ----------
    outline : gossamer_orchestrator.run.child.Outline
        ``components`` in stepping order, ``connections``, times, what is recorded, and ``warnings``.
    """

    outline: Outline

    def __repr__(self) -> str:
        from gossamer_orchestrator.cli.validate import summary

        return f"Validation({' '.join([summary(self.outline), *self.outline.warnings])})"

    def _repr_html_(self) -> str:
        from gossamer_orchestrator.cli.validate import summary

        return as_html([summary(self.outline), *self.outline.warnings], self._print, None, "")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.validate import tables

        for table in tables(self.outline):
            console.print(table)


@dataclass(frozen=True, kw_only=True, repr=False)
class Verification:
    """What the checks of FMUs found.

    Attributes
    ----------
    findings : dict of str to list of Finding
        By the path of the FMU.
    """

    findings: Mapping[str, Sequence[Finding]]

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

    @property
    def _verdict(self) -> str:
        return f"{len(self.failed) or 'No'} check{'s' * (len(self.failed) > 1)} failed."

    def __repr__(self) -> str:
        return f"Verification({', '.join(self.findings)}: {' '.join([self._verdict, *self.failed])})"

    def _repr_html_(self) -> str:
        return as_html([self._verdict], self._print, None, "")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.inspect import findings_table

        for path, found in self.findings.items():
            console.print(findings_table(Path(path), found))


@dataclass(frozen=True, kw_only=True, repr=False)
class Sweep:
    """Runs of a scenario with many values.

    Attributes
    ----------
    folder : Path
        Where the cases are.
    cases : list of Case
        Number and values of each.
    ended : list of str
        How each ended: "complete", or what the run said.
    data : xarray.Dataset or None
        What the cases recorded, along ``case``, with the values that vary as coordinates; it stays on the disk until it is
        used. None if no case has results.
    """

    folder: Path
    cases: list[Case]
    ended: list[str]
    data: xr.Dataset | None

    @property
    def _verdict(self) -> str:
        from gossamer_orchestrator.run.sweep import is_finished

        return f"{sum(map(is_finished, self.ended))} of {len(self.cases)} cases are finished."

    def __fspath__(self) -> str:
        return str(self.folder)

    def __repr__(self) -> str:
        return f"Sweep({str(self.folder)!r}: {self._verdict})"

    def _repr_html_(self) -> str:
        return as_html([self._verdict, f"Files are in {self.folder}."], self._print, None, "")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.sweep import case_table

        console.print(case_table(self.cases, self.ended))
