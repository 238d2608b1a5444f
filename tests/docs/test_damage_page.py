"""The generator of docs/damage.md, from a small assessment made by hand."""

import math
import re

import numpy as np
import pytest
from gossamer_models.assessment import AssessmentResults, Verdicts, figures, fit_pod, share
from gossamer_models.assessment.results import ConfusionRow, DetectionRow, Row, TableRow
from gossamer_models.detector.thesis_tables import GROUPS, TABLES
from studies.damage import write
from studies.damage_targets import DETECTION, TARGETS, metrics

LINK = re.compile(r"!\[[^]]*\]\(([^)]+)\)")
NETWORK = "posterior nominal"
ERRORS = {"all zones": 0.5, "damaged zones": 2.0}
BOTH = {what: (ERRORS, ERRORS) for what, *_ in GROUPS}
TRAINED = {"single": BOTH, "multiple_noisy": BOTH}


def detection(judge, zone):
    size = np.geomspace(0.005, 0.5, 60)
    hit = (size > 0.02) ^ (np.arange(60) % 11 == 3)
    pod = fit_pod(size, hit)
    return DetectionRow(
        judge=judge,
        condition="noise, 0.9 s",
        zone=zone,
        score="P(damaged)",
        threshold=0.01,
        false_calls=share([False] * 50),
        sizes=60,
        hits=int(hit.sum()),
        curve=[[0.01, 0.1, 0.05], [0.5, 0.99, 0.95]],
        a50=pod.a50,
        a90=pod.a90,
        a90_95=math.nan if zone == 7 else pod.a90_95,
        by_counts=pod.by_counts,
        remark=pod.remark,
    )


@pytest.fixture(scope="module")
def found():
    truth = TABLES[0].damage
    said = Verdicts(damage=truth + 0.02, deviation=np.full(truth.shape, 0.02), valid=np.arange(17) % 2 == 0)
    shown = figures(truth, said)
    return AssessmentResults(
        provenance={"mesh": "coarse", "cases": "17", "another mesh": "fine"},
        rows=[
            Row(judge=judge, condition=condition, figures=shown, reliability=[0.5] * 11, largest=[0.0, 0.1])
            for judge in ("always 0", NETWORK)
            for condition in ("noise", "healthy, noise")
        ],
        detections=[detection(NETWORK, zone) for zone in range(17)],
        confusions=[ConfusionRow(judge=NETWORK, condition="noise, 0.9 s", counts=np.eye(16, 17).tolist())],
        tables=[
            TableRow(
                table=table.name,
                case=case,
                judge=NETWORK,
                condition="noise",
                damage=(100.0 * damage + 2.0).tolist(),
                valid=case % 2 == 0,
            )
            for table in TABLES
            for case, damage in zip(table.cases, table.damage, strict=True)
        ],
    )


@pytest.fixture(scope="module")
def page(found, tmp_path_factory):
    folder = tmp_path_factory.mktemp("docs")
    write(found, TRAINED, folder)
    return folder


def test_the_page_links_every_picture(page):
    text = (page / "damage.md").read_text()
    assert {page / link for link in LINK.findall(text)} == set((page / "damage").glob("*.png"))
    assert "nan" not in text


def test_the_page_shows_the_trainings_of_the_thesis(page):
    text = (page / "damage.md").read_text()
    assert "| multiple, noisy | Tables 7.4 and 7.5, 8 multiple | 0.50 / 2.00 | 0.50 / 2.00 |" in text
    assert "| single | Tables 7.4" not in text


def test_the_page_shows_every_case_of_the_thesis_beside_ours(page):
    text = (page / "damage.md").read_text()
    assert (
        "| 17 | 1: 30, 4: 30, 13: 40 | 1: 34.2, 4: 23.1, 7: 2.01, 10: 5.54, 12: 3.02, 13: 67.9, 15: 2.11 | - | 1: 32" in text
    )
    line = next(line for line in text.splitlines() if line.startswith("| Tables 7.1 and 7.2, 13 single | noise |"))
    assert line == "| Tables 7.1 and 7.2, 13 single | noise | 0.77 / 1.07 | - | 2.00 / 2.00 |"


def test_every_target_has_a_line_and_what_was_not_assessed_a_dash(found, page):
    lines = list(metrics(found))
    assert len(lines) == len(TARGETS) + len(DETECTION)
    reached = {what: metric for what, _, _, metric in lines}
    assert reached[f"{NETWORK}, noise: error, all zones"].value == pytest.approx(2.0)
    assert reached["twin, noise: error, all zones"] is None
    assert reached[f"{NETWORK}, noise: a90/95 of the worst zone (100: none)"].value == 100.0  # zone 7 has no bound
    assert "| twin, noise: error, all zones | % damage | - (target 0.15) | - |" in (page / "damage.md").read_text()
