"""The page of an assessment of detectors: what wins under which condition, shares with bounds, detection, tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from browsing import opened
from gossamer.pages.detectors import MOST, assessment_page
from gossamer_models.assessment import AssessmentResults, Verdicts, confusion, figures, fit_pod, reliability, share
from gossamer_models.assessment.results import ConfusionRow, DetectionRow, Row, TableRow
from gossamer_models.membrane import square_structure
from gossamer_orchestrator.pages import write_page
from reading_pages import read_page, values

RECORDS = 40
NEAR, FAR, ZERO = "net near", "net far", "always 0"


def damages() -> np.ndarray:
    damage = np.zeros((RECORDS, 16))
    damage[np.arange(RECORDS), np.arange(RECORDS) % 16] = np.linspace(0.1, 0.5, RECORDS)
    return damage


def verdicts(factor: float, records: int = RECORDS) -> Verdicts:
    """Say a multiple of the truth, with a deviation of a tenth of it; every fourth record is not valid."""
    damage = factor * damages()[:records]
    return Verdicts(
        damage=damage,
        deviation=np.where(damage > 0.0, 0.1 * damage, 1e-6),
        probability=np.where(damage > 0.0, 0.9, 0.1),
        valid=np.arange(records) % 4 > 0,
    )


def row(judge: str, condition: str, factor: float, records: int = RECORDS) -> Row:
    said, damage = verdicts(factor, records), damages()[:records]
    stated = reliability(damage, said).tolist() if factor else []
    return Row(judge=judge, condition=condition, figures=figures(damage, said), reliability=stated)


def detection(judge: str, zone: int) -> DetectionRow:
    sizes = np.linspace(0.02, 0.5, 30)
    hit = (sizes > 0.2) ^ (np.arange(30) % 10 == 5)
    pod = fit_pod(sizes, hit)
    at = np.array([0.05, 0.2, 0.5])
    parts = {name: getattr(pod, name) for name in ("a50", "a90", "a90_95", "by_counts", "remark")}
    return DetectionRow(
        judge=judge,
        condition="noise, 0.9 s",
        zone=zone,
        score="P(damaged)",
        threshold=0.5,
        false_calls=share(np.zeros(20, dtype=bool)),
        sizes=30,
        hits=int(hit.sum()),
        curve=np.column_stack([at, pod.probability(at), pod.lower_bound(at)]).tolist(),
        **parts,
    )


@pytest.fixture
def found() -> AssessmentResults:
    """A detector that is off by a tenth and, with another load, by twice the damage; one that is too quick to tell."""
    return AssessmentResults(
        provenance={"gossamer": "0.1.0", "cases": str(RECORDS)},
        rows=[
            row(ZERO, "noise", 0.0),
            row(NEAR, "noise", 0.9),
            row(FAR, "noise", 0.99, records=6),
            row(ZERO, "load x 0.9", 0.0),
            row(NEAR, "load x 0.9", 3.0),
        ],
        detections=[detection(NEAR, 0), detection(NEAR, 3)],
        confusions=[
            ConfusionRow(judge=NEAR, condition="noise, 0.9 s", counts=confusion(damages(), verdicts(0.9), 0.5).tolist())
        ],
        tables=[TableRow(table="Tables 7.1 and 7.2", case=2, judge=NEAR, condition="clean", damage=[19.0] + 15 * [0.0])],
    )


def test_the_verdict_is_that_of_the_nearest_detector_with_many_records(found, tmp_path):
    """The mean damage is 30 %, so the error is 3 % in damaged zones; with another load it is 60 %."""
    page, _ = read_page(write_page(assessment_page(found), tmp_path / "report.html"))
    verdict, text = page.inside["verdict"], page.inside[None]
    assert verdict.startswith(f"{NEAR} is the nearest under the condition 'noise'")
    assert "3.00 % damage in the damaged zones of 40 records; that of the answer 'always 0' is 30.00 %" in verdict
    assert f"'always 0' has a smaller error over all zones than {NEAR} under: load x 0.9." in text
    assert f"{NEAR}: error 0.19 % over all zones, 3.00 % over damaged ones; 30 of 40 records valid" in text
    assert f"none for the verdict: {FAR}, 6." in text
    bound = found.detections[0].a90_95
    assert (f"noise, 0.9 s: {NEAR} {100.0 * bound:.3g} %" if bound <= 1.0 else f"not shown for {NEAR}") in text


def test_nothing_better_than_the_answer_zero_is_said_first(found, tmp_path):
    worse = AssessmentResults(provenance={}, rows=[row(ZERO, "noise", 0.0), row(NEAR, "noise", 3.0)])
    assert assessment_page(worse).sentence.startswith("No detector is nearer than the answer 'always 0'")
    alone = AssessmentResults(provenance={}, rows=[row(ZERO, "noise", 0.0)])
    assert assessment_page(alone).sentence == "No detector was assessed, only the answer 'always 0'."


def test_shares_stand_by_condition_with_their_intervals(found, tmp_path):
    _, charts = read_page(write_page(assessment_page(found), tmp_path / "report.html"))
    near = next(each for each in charts["Valid records"]["traces"] if each["name"] == NEAR)
    assert near["y"] == ["noise", "load x 0.9"]
    assert values(near["x"]) == pytest.approx([75.0, 75.0])
    valid = share(np.arange(RECORDS) % 4 > 0)
    assert values(near["error_x"]["array"])[0] == pytest.approx(100.0 * (valid.high - 0.75))
    assert values(near["error_x"]["arrayminus"])[0] == pytest.approx(100.0 * (0.75 - valid.low))
    errors = charts["Mean absolute error over damaged zones"]
    assert [each["name"] for each in errors["traces"]] == [ZERO, NEAR, FAR]
    assert errors["layout"]["yaxis"]["categoryarray"] == ["load x 0.9", "noise"]


def test_detection_reliability_and_zones_are_drawn_as_they_were_found(found, tmp_path):
    _, charts = read_page(write_page(assessment_page(found), tmp_path / "report.html"))
    low, high, best = charts["Probability of detection, noise, 0.9 s"]["traces"]
    expected = np.array(found.detections[0].curve)
    assert values(best["x"]) == pytest.approx(100.0 * expected[:, 0])
    assert values(best["y"]) == pytest.approx(expected[:, 1], rel=1e-6)
    assert values(low["y"]) == pytest.approx(expected[:, 2], rel=1e-6)
    assert values(high["y"]) == values(best["y"])
    stated = charts["Observed over stated share of damages within an interval"]["traces"][1]
    assert values(stated["y"]) == pytest.approx(found.rows[1].reliability, rel=1e-6)
    cells = charts[f"Zone called first: {NEAR}, noise, 0.9 s"]["traces"][0]
    assert np.diag(values(cells["z"])).max() == pytest.approx(100.0)


def test_where_every_size_was_hit_the_bound_is_drawn_alone(found):
    """The likelihood has no maximum, so there is no most likely curve."""
    row = replace(found.detections[0], curve=[[0.1, np.nan, 0.5], [0.5, np.nan, 0.9]])
    charts = assessment_page(replace(found, detections=[row])).charts
    traces = next(each.traces for each in charts if each.title.startswith("Probability of detection"))
    assert [(each["name"], each["y"].tolist()) for each in traces] == [(f"{NEAR}, 95 % bound", [0.5, 0.9])]


def test_the_tables_hold_every_condition_and_the_cases_of_the_thesis(found, tmp_path):
    page, _ = read_page(write_page(assessment_page(found), tmp_path / "report.html"))
    assert sum(tag == "table" for tag, _ in page.tags) == 4
    for text in ("load x 0.9", "Tables 7.1 and 7.2 of the thesis, clean", "P(damaged) > 50 %"):
        assert text in page.inside[None]


def test_in_a_browser_all_names_find_place_and_the_numbers_stand_by_name(browser, found, tmp_path):
    rows = [replace(each, condition=f"condition {k}") for k in range(30) for each in found.rows[:2]]
    path = write_page(assessment_page(replace(found, rows=found.rows + rows)), tmp_path / "report.html")
    troubles: list[str] = []
    page = opened(browser, path.as_uri(), troubles, viewport={"width": 400, "height": 800}, color_scheme="dark")
    figure = page.locator("figure", has=page.get_by_text("Valid records", exact=True))
    tops = sorted(each.bounding_box()["y"] for each in figure.locator(".ytick").all())
    assert len(tops) == 32
    assert np.diff(tops).min() > 12.0
    assert page.evaluate("Math.min(...page.figures.map((each) => each.div.clientHeight))") >= 300
    figure.locator("summary").click()
    figure.locator("tbody td").first.wait_for()
    cells = figure.locator("tbody tr").first.locator("th, td").all_text_contents()
    assert cells[:2] + cells[4:5] == ["noise", "75", "75"]
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    page.close()
    assert troubles == []


def test_what_is_found_where_is_drawn_on_the_membrane_in_space(browser, found, tmp_path):
    """A zone with a bound has its colour, one without is at the end of the scale and is named."""
    structure = square_structure()
    page = assessment_page(found, structure)
    (chart,) = [each for each in page.charts if each.script == "addSurface"]
    surface = page.content["surface"]
    by_zone = {row.zone: row for row in found.detections if row.judge == NEAR and row.zone}
    (values,) = next(each["values"] for each in surface["colours"] if NEAR in each["name"])
    for zone in range(1, 17):
        bound = 100.0 * by_zone[zone].a90_95 if zone in by_zone else MOST
        assert values[zone - 1] == pytest.approx(min(bound, MOST))
    assert f"Not shown to be found by {NEAR}" in chart.note
    troubles: list[str] = []
    shown = opened(browser, write_page(page, tmp_path / "report.html").as_uri(), troubles)
    drawn = shown.evaluate("page.figures[0].div.data[0]")
    assert (drawn["type"], drawn["cmax"]) == ("mesh3d", MOST)
    assert troubles == []
    assert not [each for each in assessment_page(found).charts if each.script]
