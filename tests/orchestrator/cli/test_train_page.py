"""The page of a training: errors beside those of the answer 0, estimates of held-out cases, what is not valid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gossamer.pages.detectors import thesis_page, training_page
from gossamer_models.assessment import AlwaysZero, Verdicts, share
from gossamer_models.assessment.figures import errors
from gossamer_models.detector import DetectorArtifact, PosteriorArtifact
from gossamer_orchestrator.pages import write_page
from reading_pages import read_page, values

RECORDS = 160
CLEAN, NOISY = "window 1, damaged, no noise", "window 1, damaged, noise"


def judged(clean: float, noisy: float, records: int = RECORDS, valid: bool = True):
    """Say multiples of the true damage of one zone a record, 10 to 50 %, ten records for each zone."""
    damage = np.zeros((records, 16))
    damage[np.arange(records), np.arange(records) % 16] = np.linspace(0.1, 0.5, records)

    def said(factor: float) -> tuple[np.ndarray, Verdicts]:
        deviation = np.where(damage > 0.0, 0.1 * damage, 1e-6)
        return damage, Verdicts(damage=factor * damage, deviation=deviation, valid=np.full(records, valid))

    zero = damage, AlwaysZero()(damage, 1.0)
    return {AlwaysZero.name: zero, CLEAN: said(clean), NOISY: said(noisy)}


def page_of(found, folder, **more):
    held_out = {kind: errors(*pair) for kind, pair in found.items()}
    artifact = replace(PosteriorArtifact.default(), held_out=held_out, **more)
    return read_page(write_page(training_page("mine", artifact, found), folder / "new" / "report.html"))


def test_errors_stand_beside_those_of_the_answer_zero(tmp_path):
    """The mean damage is 30 %: a tenth of it is 3 %, and a sixteenth of that over all zones 0.19 %."""
    page, charts = page_of(judged(0.9, 1.2), tmp_path)
    assert "is off by 0.19 % damage over all zones and 3.00 % over damaged ones" in page.inside["verdict"]
    assert "the answer 'always 0' is off by 1.88 % and 30.00 %." in page.inside["verdict"]
    assert "100.0 % of damages within the stated 95 % band" in page.inside[None]
    all_zones, damaged = charts["Mean absolute error"]["traces"]
    assert all_zones["y"] == [AlwaysZero.name, *(kind.replace(", damaged", "") for kind in (CLEAN, NOISY))]
    assert values(damaged["x"]) == pytest.approx([30.0, 3.0, 6.0])
    assert values(charts["Mean absolute error of a zone where it is damaged"]["traces"][0]["x"]) == list(range(1, 17))


def test_a_detector_that_is_no_better_than_zero_is_not_praised(tmp_path):
    page, _ = page_of(judged(2.5, 3.0), tmp_path)
    assert page.inside["verdict"].startswith("This detector tells nothing: the answer 'always 0' is as good.")
    page, _ = page_of(judged(0.9, 2.5), tmp_path)
    assert f"'always 0' is as good or better over all zones: {NOISY}." in page.inside[None]
    assert any(attributes.get("class") == "verdict invalid" for _, attributes in page.tags)


def test_few_records_and_invalid_ones_are_stated(tmp_path):
    page, charts = page_of(judged(0.9, 1.0, records=32, valid=False), tmp_path)
    assert "Of some kinds only 32 records were held out: rough figures." in page.inside[None]
    assert page.inside["verdict"].startswith("Not a single record is valid, so no estimate is to be used. On held-out")
    assert "Observed over stated share of damages within an interval" not in charts
    page, _ = page_of(judged(0.9, 1.0) | {NOISY: judged(0.9, 1.0, valid=False)[NOISY]}, tmp_path)
    assert f"Not a single record is valid, so no estimate is to be used: {NOISY}." in page.inside[None]


def test_estimates_and_calls_stand_over_the_true_damage(tmp_path):
    _, charts = page_of(judged(0.9, 1.0), tmp_path, losses=[[2.0, 1.0]])
    valid = charts["Estimated over true damage, no noise"]["traces"][1]
    assert values(valid["y"]) == pytest.approx((0.9 * np.array(values(valid["x"]))).tolist())
    assert len(valid["x"]["bytes"]) > 0
    called = charts["Damaged zones that are called"]["traces"][0]
    assert values(called["y"]) == pytest.approx([100.0] * 9)
    assert values(called["error_y"]["arrayminus"])[4] == pytest.approx(100.0 * (1.0 - share(np.ones(17)).low), rel=0.1)
    assert values(charts["Mean negative log likelihood of a case"]["traces"][0]["y"]) == [2.0, 1.0]


def test_a_training_of_the_thesis_stands_beside_its_own_figures(tmp_path):
    rows = {
        "13 single": {"all zones": 1.0, "damaged zones": 8.0},
        "13 single: the thesis": {"all zones": 2.0, "damaged zones": 9.0},
    }
    page, charts = read_page(write_page(thesis_page("single", DetectorArtifact.default(), rows), tmp_path / "report.html"))
    assert page.inside["verdict"] == "13 single: off by 8.00 % damage over damaged zones; the thesis prints 9.00 %."
    assert values(charts["Mean absolute error"]["traces"][1]["x"]) == [8.0, 9.0]
