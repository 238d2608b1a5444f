"""Damage, how certain it is, and what finds it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ..display import as_html, draw_png, first_of, page_of

if TYPE_CHECKING:
    from gossamer_models.assessment import AssessmentResults
    from gossamer_models.campaign import Summary
    from gossamer_models.detector import DetectorArtifact, PosteriorArtifact
    from gossamer_models.placement import Placing
    from gossamer_models.twin import Answer
    from gossamer_orchestrator.cli.watch import WatchReport
    from numpy.typing import NDArray
    from rich.console import Console


@dataclass(frozen=True, kw_only=True, repr=False)
class TwinAnswer:
    """Damage that a simulation fitted to a record shows.

    Attributes
    ----------
    path : Path
        JSON file of the answer.
    page : Path or None
        Its page; None if it could not be written.
    answer : gossamer_models.twin.Answer
        The whole answer: validity, doubts, and what else was fitted.
    compared : str
        A sentence if only the beginning of the record was compared, else empty.
    data : xarray.Dataset
        ``damage``, ``deviation`` and ``probability`` [1] by ``zone``, with row and column; ``covariance`` [1].
    """

    path: Path
    page: Path | None
    answer: Answer
    compared: str
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
        if self.compared:
            doubts.append(self.compared)
        picture = _draw_zones(self.answer.damage, self.answer.deviation)
        return as_html([self._verdict, *doubts], self._print, picture, "Damage of the zones")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.twin import zone_table

        console.print(zone_table(self.answer))


@dataclass(frozen=True, kw_only=True, repr=False)
class Watching:
    """What was seen of a record, window by window.

    Attributes
    ----------
    path : Path
        JSON file of what was seen.
    report : gossamer_orchestrator.cli.watch.WatchReport
        ``alarms`` [s], and ``findings``: onset and damages.
    data : xarray.Dataset
        ``score`` of new damage and ``misfit``, chi2 per sample [1], over ``time`` [s], the ends of the windows; ``damage``
        and ``deviation`` [1] by ``onset`` [s] and ``zone``, with row and column.
    """

    path: Path
    report: WatchReport
    data: xr.Dataset

    @property
    def _verdict(self) -> str:
        times = ", ".join(f"{time:.4g} s" for time in self.report.alarms)
        return f"{self.report.summary}{': at ' * bool(times)}{times}."

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"Watching({str(self.path)!r}: {self._verdict})"

    def _repr_html_(self) -> str:
        doubts = [self.report.doubt] if self.report.doubt else []
        last = self.report.findings[-1:]
        picture = _draw_zones(last[0].damage, last[0].deviation) if last else None
        return as_html([self._verdict, *doubts], self._print, picture, "Damage of the zones since the last onset")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.watch import finding_table

        for finding in self.report.findings:
            console.print(finding_table(finding))


@dataclass(frozen=True, kw_only=True, repr=False)
class Campaign:
    """Many simulations.

    Attributes
    ----------
    folder : Path
        The store.
    page : Path or None
        Its page; None if it could not be written.
    title : str
        Of the campaign.
    summary : gossamer_models.campaign.Summary
        How many cases there are, how many of them this call simulated, how many failed, and the time it took [s].
    data : xarray.Dataset
        Damage by ``case`` and ``zone``, what else was drawn by ``case``, histories over ``time`` [s]; it stays on the disk
        until it is used.
    """

    folder: Path
    page: Path | None
    title: str
    summary: Summary
    data: xr.Dataset

    @property
    def _verdict(self) -> str:
        return f"{self.summary.cases} cases, {self.summary.simulated} of them simulated now."

    def __fspath__(self) -> str:
        return str(self.folder)

    def __repr__(self) -> str:
        return f"Campaign({str(self.folder)!r}: {self._verdict})"

    def _repr_html_(self) -> str:
        from gossamer_orchestrator.cli.campaign import failed

        doubts = [failed(self.summary)] if self.summary.failed else []
        return as_html([self._verdict, *doubts, f"The store is {self.folder}."], self._print, None, "")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.campaign import summary_table

        console.print(summary_table(self.title, self.folder, self.summary))


@dataclass(frozen=True, kw_only=True, repr=False)
class TrainedDetector:
    """A detector that was trained.

    Attributes
    ----------
    path : Path
        Its artifact.
    page : Path or None
        Its page; None if it could not be written.
    artifact : gossamer_models.detector.PosteriorArtifact or DetectorArtifact
        What was trained, and over which ranges; the latter of the thesis.
    held_out : dict of str to dict of str to float
        Errors by kind of record, as ``data`` has them.
    data : xarray.Dataset
        Errors by kind of record, ``cases``: ``all_zones`` and ``damaged_zones`` [%], and shares [1], see
        ``gossamer_models.assessment.figures``.
    """

    path: Path
    page: Path | None
    artifact: PosteriorArtifact | DetectorArtifact
    held_out: dict[str, dict[str, float]]
    data: xr.Dataset

    @property
    def _verdict(self) -> str:
        first = next(each for each in self.held_out if each != "always 0")
        return f"The mean absolute error over all zones is {self.held_out[first]['all zones']:.2g} % damage ({first})."

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"TrainedDetector({str(self.path)!r}: {self._verdict})"

    def _repr_html_(self) -> str:
        return as_html([self._verdict, f"The artifact is {self.path}."], self._print, None, "")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.tables import printed

        from ..pages.train import error_table

        console.print(printed(error_table(self.held_out)))


@dataclass(frozen=True, kw_only=True, repr=False)
class DetectorAssessment:
    """Detectors that were judged under many conditions.

    Attributes
    ----------
    result : gossamer_models.assessment.AssessmentResults
        Everything that was found.
    data : xarray.Dataset
        By ``detector`` and ``condition``: ``error_all``, ``error_damaged`` [%], shares [1] with the bounds ``_low`` and
        ``_high`` of their 95 % intervals, and the other figures of ``gossamer_models.assessment.Figures``.
    detections : xarray.Dataset
        Probability of detection by ``detector``, ``condition`` and ``zone``, 0 for all zones together: ``a50``, ``a90``,
        ``a90_95`` [1], the ``threshold`` of a call and the share of ``false_calls`` [1].
    files : list of Path
        Results, pictures and page.
    """

    result: AssessmentResults
    data: xr.Dataset
    detections: xr.Dataset
    files: list[Path]

    @property
    def page(self) -> Path | None:
        """Its page; None if it could not be written."""
        return page_of(self.files)

    @property
    def _verdict(self) -> str:
        detectors, conditions = self.data.sizes["detector"], self.data.sizes["condition"]
        return f"{detectors} detector{'s' * (detectors != 1)} under {conditions} conditions."

    def __fspath__(self) -> str:
        return str(self.files[0].parent)

    def __repr__(self) -> str:
        return f"DetectorAssessment({self.__fspath__()!r}: {self._verdict})"

    def _repr_html_(self) -> str:
        errors = first_of(path for path in self.files if path.name == "errors.png")
        sentences = [self._verdict, f"Files are in {self.__fspath__()}."]
        return as_html(sentences, self._print, errors, "Errors of the detectors under each condition")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.tables import printed

        from ..pages.assess_detector import condition_table, detection_table

        console.print(printed(condition_table(self.result)))
        console.print(printed(detection_table(self.result)))


@dataclass(frozen=True, kw_only=True, repr=False)
class SensorPlacement:
    """Sensors that were chosen.

    Attributes
    ----------
    path : Path
        The sensors as tables of a setup.
    result : gossamer_models.placement.Placing
        Everything that was found.
    data : xarray.Dataset
        ``a90`` and ``deviation`` [1] by ``placement``, "own" and "chosen", and ``zone`` with its ``group``; ``point`` [m]
        and ``direction`` [1] of each chosen ``sensor`` by ``axis``.
    files : list of Path
        Table, picture, sensors and page.
    """

    path: Path
    result: Placing
    data: xr.Dataset
    files: list[Path]

    @property
    def page(self) -> Path | None:
        """Its page; None if it could not be written."""
        return page_of(self.files)

    @property
    def _verdict(self) -> str:
        placements = {"own": self.result.own, "chosen": self.result.chosen}
        worst = [
            f"{100.0 * p.a90.max():.3g} % with the {name} sensors" for name, p in placements.items() if p is not None
        ]
        return f"The worst zone has an a90 of {', '.join(worst)}."

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"SensorPlacement({str(self.path)!r}: {self._verdict})"

    def _repr_html_(self) -> str:
        from gossamer_orchestrator.cli.place_sensors import summary

        sentences = [self._verdict, *summary(self.result, self.data.attrs["samples"]).splitlines()]
        picture = first_of(path for path in self.files if path.suffix == ".png")
        return as_html(sentences, self._print, picture, "Where the sensors are, and the a90 of each zone")

    def _print(self, console: Console) -> None:
        from gossamer_orchestrator.cli.tables import printed

        from ..pages.place_sensors import zone_table

        console.print(printed(zone_table(self.result)))


def _draw_zones(damage: NDArray[np.float64], deviation: NDArray[np.float64]) -> bytes:
    """Return a picture of the damages [1] of the zones."""
    from gossamer_files.plots import draw

    from ..pages.twin import damage_chart

    return draw_png(lambda ax: draw(damage_chart(damage, deviation), ax), (4.7, 4.4))
