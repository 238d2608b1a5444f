"""What the functions of this package return: data for xarray, where the files are, and a display for notebooks.

A result is a path too, of its folder or its main file: ``gossamer.twin(gossamer.run("damaged"))``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from .display import as_html, draw_png, first_loop, first_of

if TYPE_CHECKING:
    from gossamer_models.identify import Identified
    from gossamer_models.review import Judged
    from gossamer_models.twin import Answer
    from gossamer_orchestrator import Judgement
    from gossamer_orchestrator.results.report.verdict import Verdict
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
        from gossamer_orchestrator.results.report.content import windows_of

        return windows_of(self.data)

    @cached_property
    def verdict(self) -> Verdict:
        """What the page of the run says first."""
        from gossamer_orchestrator.results.report.content import read_watch
        from gossamer_orchestrator.results.report.verdict import make_verdict

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


def _page_of(files: Sequence[Path]) -> Path | None:
    """Return the page among files, if there is one."""
    from gossamer_orchestrator.pages import PAGE

    return next((path for path in files if path.name == PAGE), None)


@dataclass(frozen=True, kw_only=True, repr=False)
class Identification:
    """A sensor that was identified.

    Attributes
    ----------
    path : Path
        Its artifact.
    result : gossamer_models.identify.Identified
        Fit, errors and remarks.
    records : dict of str to xarray.Dataset
        By the name of the record: strain [1], resistance [ohm] and predicted resistance [ohm] over ``time`` [s], and
        ``fitted``; where the model has a compensator the recovered strain [1], and its stated ``deviation`` [1] if any.
    rest : str
        The resistance from which changes count, in words.
    files : list of Path
        The artifact, predictions, pictures and page.
    """

    path: Path
    result: Identified
    records: dict[str, xr.Dataset]
    rest: str
    files: list[Path]

    @property
    def page(self) -> Path | None:
        """Page of the identification; None where none was written."""
        return _page_of(self.files)

    @property
    def _verdict(self) -> str:
        errors = [f"{each.nrmse:.3g} % on the {each.stretch} stretch of {each.record}" for each in self.result.errors]
        return f"The resistance is predicted with an error (NRMSE) of {', '.join(errors)}."

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"Identification({str(self.path)!r}: {self._verdict})"

    def _repr_html_(self) -> str:
        sentences = [self._verdict, *self.result.remarks, f"The artifact is {self.path}."]
        return as_html(sentences, self._print, first_loop(self.files), "Resistance over strain, measured and modelled")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.identify_report import print_result

        print_result(console, self.result, self.rest)


@dataclass(frozen=True, kw_only=True, repr=False)
class Assessment:
    """A sensor that was judged on other records.

    Attributes
    ----------
    judged : tuple of gossamer_models.review.Judged
        One for each record.
    records : dict of str to xarray.Dataset
        By the name of the record: strain [1], resistance [ohm] and predicted resistance [ohm] over ``time`` [s]; recovered
        strain and its stated deviation [1] by ``compensator``.
    stretch : str
        First stretch of each record.
    files : list of Path
        Predictions, pictures and page.
    """

    judged: tuple[Judged, ...]
    records: dict[str, xr.Dataset]
    stretch: str
    files: list[Path]

    @property
    def page(self) -> Path | None:
        """Page of the assessment; None where none was written."""
        return _page_of(self.files)

    @property
    def _verdict(self) -> str:
        each = [
            f"{one.forward(one.stretches().get('judged', one.first)):.3g} % for {one.record.name}"
            for one in self.judged
        ]
        return f"The resistance is predicted with an error (NRMSE) of {', '.join(each)}."

    def __repr__(self) -> str:
        return f"Assessment({self._verdict})"

    def _repr_html_(self) -> str:
        sentences = [self._verdict, *(text for each in self.judged for text in each.sentences())]
        return as_html(sentences, self._print, first_loop(self.files), "Resistance over strain, measured and modelled")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.assess import tables

        for table in tables(self.judged, self.stretch):
            console.print(table)


@dataclass(frozen=True, kw_only=True, repr=False)
class TwinAnswer:
    """Damage that a simulation fitted to a record shows.

    Attributes
    ----------
    path : Path
        JSON file of the answer.
    answer : gossamer_models.twin.Answer
        The whole answer: validity, doubts, and what else was fitted.
    data : xarray.Dataset
        ``damage``, ``deviation`` and ``probability`` [1] by ``zone``, with row and column; ``covariance`` [1].
    """

    path: Path
    answer: Answer
    data: xr.Dataset

    @property
    def _verdict(self) -> str:
        from gossamer_orchestrator.cli.twin import summary

        return summary(self.answer).splitlines()[0].capitalize() + "."

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"TwinAnswer({str(self.path)!r}: {self._verdict})"

    def _repr_html_(self) -> str:
        doubts = [f"{text[0].upper()}{text[1:]}." for text in self.answer.doubts]
        return as_html([self._verdict, *doubts], self._print, self._picture(), "Damage of the zones")

    def _picture(self) -> bytes:
        from gossamer_orchestrator.results.plots.damage import plot_zones

        percent, bars = 100.0 * self.answer.damage, 100.0 * self.answer.deviation
        return draw_png(lambda ax: plot_zones(percent, bars, (1.0, "side"), ax=ax), (4.7, 4.4))

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.twin import zone_table

        console.print(zone_table(self.answer))
