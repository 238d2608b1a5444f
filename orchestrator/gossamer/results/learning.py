"""Sensors that were identified, and judged."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from ..display import as_html, first_loop, page_of

if TYPE_CHECKING:
    from gossamer_models.identify import Identified
    from gossamer_models.review import Judged
    from rich.console import Console


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
        By the name of the record: strain [1], resistance and predicted resistance (in ohm, unless the file states a
        signal or no unit) over ``time`` [s], and ``fitted``; where the model has a compensator the recovered strain [1],
        and its stated ``deviation`` [1] if any.
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
        return page_of(self.files)

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
        By the name of the record: strain [1], resistance and predicted resistance (in ohm, unless the file states a
        signal or no unit) over ``time`` [s]; recovered strain and its stated deviation [1] by ``compensator``.
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
        return page_of(self.files)

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
