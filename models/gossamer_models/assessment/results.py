"""Results of an assessment: what was found, in a JSON file and CSV tables.

Numbers that have no meaning or are infinite, such as the bound of a detection that was never shown, are null in the file and
not a number here.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from gossamer_files import as_json, replacing

from ..artifacts import read_as, write_artifact
from .figures import Figures
from .pod import Share

SCHEMA, VERSION = "gossamer.assessment", 3
FILE = "assessment.json"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One judge under one condition.

    Attributes
    ----------
    judge, condition : str
        Names.
    held_out : bool
        Whether the condition is kept out of tuning.
    figures : Figures
        Of all records.
    reliability : list of float
        Observed share [1] of damages in the stated intervals ``figures.NOMINAL``; empty without a stated deviation.
    largest : list of float
        Largest valid estimate [1] of each record; only of healthy ones.
    """

    judge: str
    condition: str
    held_out: bool = False
    figures: Figures
    reliability: list[float] = field(default_factory=list)
    largest: list[float] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class DetectionRow:
    """Probability of detection of one judge in one zone.

    Attributes
    ----------
    judge, condition : str
        Names.
    zone : int
        From 1, or 0 for all zones together.
    score : {"P(damaged)", "estimate"}
        What a call is decided by.
    threshold : float
        Of a call [1], chosen on half of the healthy records.
    false_calls : Share
        Calls among the other half.
    sizes, hits : int
        How many sizes there were, and how many were hit.
    a50, a90, a90_95, by_counts : float
        See ``Pod``.
    remark : str
        See ``Pod``.
    curve : list of list of float
        Rows of size, probability of detection, not a number if the likelihood has no maximum, and its lower bound [1].
    hit_sizes, missed_sizes : list of float
        Sizes that were hit and missed [1].
    """

    judge: str
    condition: str
    zone: int
    score: str
    threshold: float
    false_calls: Share
    sizes: int
    hits: int
    a50: float
    a90: float
    a90_95: float
    by_counts: float
    remark: str
    curve: list[list[float]]
    hit_sizes: list[float] = field(default_factory=list)
    missed_sizes: list[float] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class ConfusionRow:
    """Zones that one judge calls first: see ``figures.confusion``."""

    judge: str
    condition: str
    counts: list[list[float]]


@dataclass(frozen=True, kw_only=True)
class TableRow:
    """One case of a table of the thesis: table, case, and what a judge says of it, damage and deviation in %."""

    table: str
    case: int
    judge: str
    condition: str
    damage: list[float]
    deviation: list[float] = field(default_factory=list)
    valid: bool = True


@dataclass(frozen=True, kw_only=True)
class AssessmentResults:
    """Everything that was found.

    Attributes
    ----------
    provenance : dict of str
        Meshes, number of cases, version.
    zone_names : list of str
        What the zones are called; empty for numbers.
    rows, detections, confusions, tables : list
        See there.
    """

    provenance: dict[str, str]
    zone_names: list[str] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    detections: list[DetectionRow] = field(default_factory=list)
    confusions: list[ConfusionRow] = field(default_factory=list)
    tables: list[TableRow] = field(default_factory=list)

    @property
    def judges(self) -> list[str]:
        """Names of the judges, in their order."""
        rows: list[Row | DetectionRow | TableRow] = [*self.rows, *self.detections, *self.tables]
        return list(dict.fromkeys(row.judge for row in rows))

    def zone_name(self, zone: int) -> str:
        """Return what a zone is called, 0 for all."""
        return "all" if zone == 0 else self.zone_names[zone - 1] if self.zone_names else str(zone)

    def row(self, judge: str, condition: str) -> Row | None:
        """Return the row of a judge and a condition; None if there is none."""
        return next((row for row in self.rows if (row.judge, row.condition) == (judge, condition)), None)


def write_assessment(assessment: AssessmentResults, folder: Path) -> list[Path]:
    """Write the results as JSON and, in percent, as CSV; return the paths."""
    content = as_json(assessment)
    write_artifact(folder / FILE, SCHEMA, VERSION, content.pop("provenance"), content)
    tables = {
        "conditions.csv": [_condition_line(row) for row in assessment.rows],
        "detection.csv": [_detection_line(row, assessment.zone_name(row.zone)) for row in assessment.detections],
        "thesis_tables.csv": [_table_line(row) for row in assessment.tables],
    }
    for name, lines in tables.items():
        with replacing(folder / name) as path, path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(lines[0]) if lines else [])
            writer.writeheader()
            writer.writerows(lines)
    return [folder / name for name in (FILE, *tables)]


def read_assessment(folder: Path) -> AssessmentResults:
    """Read what ``write_assessment`` wrote.

    Raises
    ------
    ArtifactError
        There is no assessment in the folder, or one of another version or incomplete.
    """
    return read_as(AssessmentResults, "assessment", folder / FILE, SCHEMA, VERSION, _numbers)


def _numbers(value: Any) -> Any:  # noqa: ANN401
    """Turn None back into what is not a number."""
    if isinstance(value, dict):
        return {key: _numbers(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_numbers(each) for each in value]
    return math.nan if value is None else value


def _condition_line(row: Row) -> dict[str, str]:
    line = {"judge": row.judge, "condition": row.condition, "kept out of tuning": str(int(row.held_out))}
    for name, value in ((part.name, getattr(row.figures, part.name)) for part in fields(Figures)):
        if isinstance(value, Share):
            line |= {f"{name} [%]": _percent(value.value), f"{name} low": _percent(value.low)}
            line |= {f"{name} high": _percent(value.high)}
        else:
            line[name] = f"{value:.6g}" if math.isfinite(value) else ""
    return line


def _detection_line(row: DetectionRow, zone: str) -> dict[str, str]:
    percent = {
        "threshold": row.threshold,
        "false calls": row.false_calls.value,
        "false calls high": row.false_calls.high,
        "a50": row.a50,
        "a90": row.a90,
        "a90/95": row.a90_95,
        "by counts": row.by_counts,
    }
    line = {"judge": row.judge, "condition": row.condition, "zone": zone}
    line |= {"sizes": str(row.sizes), "hits": str(row.hits)}
    return line | {f"{name} [%]": _percent(value) for name, value in percent.items()} | {"remark": row.remark}


def _table_line(row: TableRow) -> dict[str, str]:
    line = {"table": row.table, "case": str(row.case), "judge": row.judge, "condition": row.condition}
    zones = {f"zone {zone} [%]": f"{value:.2f}" for zone, value in enumerate(row.damage, start=1)}
    return line | {"valid": str(int(row.valid))} | zones


def _percent(value: float) -> str:
    return f"{100.0 * value:.4g}" if math.isfinite(value) else ""
