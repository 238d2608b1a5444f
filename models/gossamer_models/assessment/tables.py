"""Tables of an assessment of detectors, and of the errors of one on held-out cases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gossamer_files.tables import TableText, number, percent

from ..detector.thesis_tables import TABLES
from .results import AssessmentResults, DetectionRow, Row

CONDITIONS = (
    "Errors [% damage] and shares [%]. call: valid estimate above 5 % and 2 stated deviations; false calls: records with a "
    "call in an undamaged zone, and the upper 95 % bound; determined: zones of valid records with a deviation of 2 % or "
    "less; wrong: error above 10 % in a zone; marked: not valid, or no such error above 3 stated deviations; z rms, in "
    "95 %: of the stated deviations, damaged zones of valid records; wrong and valid: records with an error above 5 % and 3 "
    "stated deviations in a zone that is determined; *: kept out of tuning"
)


def condition_table(found: AssessmentResults) -> TableText:
    """Return errors and shares, a row for each judge and condition."""
    head = ("detector", "condition", "records", "error, all zones", "damaged zones", "hits", "false calls")
    shares = ("valid", "determined", "wrong, of them marked", "wrong and valid")
    rows = [_of_condition(row) for row in found.rows]
    return TableText((*head, *shares, "worst healthy zone", "z rms", "in 95 %"), rows, CONDITIONS)


def _of_condition(row: Row) -> tuple[str, ...]:
    f = row.figures
    errors = (number(f.error_all), number(f.error_damaged), percent(f.hits.value), _calls(row))
    wrong = (f"{f.wrong.number}, {percent(f.wrong_and_marked.value)}", f"{f.wrong_and_valid.number} of {f.records}")
    shares = (percent(f.valid.value), percent(f.determined.value), *wrong)
    stated = (number(f.worst_healthy), number(f.damaged_z_rms), percent(f.damaged_within_95))
    return row.judge, row.condition + " *" * row.held_out, str(f.records), *errors, *shares, *stated


def _calls(row: Row | DetectionRow) -> str:
    """Return the share of false calls and its upper bound."""
    share = row.figures.false_calls if isinstance(row, Row) else row.false_calls
    return f"{percent(share.value)} (< {100.0 * share.high:.1f})"


def detection_table(found: AssessmentResults) -> TableText:
    """Return the probability of detection, a row for each judge, condition and zone; zones without a hit are left out."""
    head = ("detector", "condition", "zone", "call above", "false calls", "hits of sizes", "a50", "a90", "a90/95", "remark")
    rows = []
    for row in (row for row in found.detections if row.hits or not row.zone):
        call, hits = f"{row.score} > {100.0 * row.threshold:.2g} %", f"{row.hits} of {row.sizes}"
        sizes = map(percent, (row.a50, row.a90, row.a90_95))
        rows.append((row.judge, row.condition, found.zone_name(row.zone), call, _calls(row), hits, *sizes, row.remark))
    return TableText(head, rows, "Probability of detection: sizes [% damage]")


def thesis_tables(found: AssessmentResults) -> dict[str, TableText]:
    """Return the cases of the thesis by table and condition: true damage, and what each judge says."""
    true = {(t.name, case): 100.0 * damage for t in TABLES for case, damage in zip(t.cases, t.damage, strict=True)}
    tables = {}
    for name, condition in dict.fromkeys((row.table, row.condition) for row in found.tables):
        rows: list[tuple[str, ...]] = []
        for row in (row for row in found.tables if (row.table, row.condition) == (name, condition)):
            if (name, row.case) in true and row.judge == found.judges[0]:
                rows.append((f"{row.case}", "true", *(f"{d:g}" if d else "" for d in true[name, row.case])))
            remark = "" if row.valid else ", not valid"
            rows.append((f"{row.case}", f"{row.judge}{remark}", *(f"{d:.1f}" if d >= 0.05 else "" for d in row.damage)))
        rows.sort(key=lambda row: int(row[0]))
        head = ("case", "judge", *map(str, range(1, len(rows[0]) - 1)))
        shown = TableText(head, rows, "Damage of each zone [%]; empty below 0.05")
        tables[f"{name} of the thesis, {condition}"] = shown
    return tables


def error_table(found: Mapping[str, Mapping[str, float]]) -> TableText:
    """Return the errors on held-out cases, a row for each kind of record."""
    errors = ("all zones", "damaged zones")
    shares = ("in 95 % band", "valid", "determined", "false calls", "wrong", "wrong and valid")
    rows: Sequence[tuple[str, ...]] = [
        (
            kind,
            *(f"{row[name]:.2f}" if name in row else "" for name in errors),
            *(f"{100.0 * row[name]:.1f}" if name in row else "" for name in shares),
        )
        for kind, row in found.items()
    ]
    return TableText(("cases", *errors, *shares), rows, "Mean absolute error [% damage]; shares [%]")
