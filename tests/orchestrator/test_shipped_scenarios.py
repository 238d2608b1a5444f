"""The shipped scenarios fit this project's FMUs, run, and find the damage."""

from __future__ import annotations

from pathlib import Path

import pytest
from gossamer_fmus import build_all
from gossamer_orchestrator import judge, load_results, load_scenario, make_plan, run_scenario
from gossamer_orchestrator.report import judgements
from gossamer_orchestrator.scenario_files import shipped_scenarios


@pytest.fixture(scope="module")
def real_fmus(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("real")
    build_all(folder)
    return folder


@pytest.mark.parametrize("name", sorted(shipped_scenarios()))
def test_a_shipped_scenario_fits_the_fmus(name, real_fmus):
    plan = make_plan(load_scenario(shipped_scenarios()[name]), real_fmus)
    assert len(plan.components) == 10
    assert len(plan.files) == 4
    assert [c.name for c in plan.components][-1] == "detector"


def test_the_damaged_membrane_is_found_out(real_fmus, tmp_path):
    """40 % in zone 1, within the detector's own resolution of a few percent, through sensors and compensators."""
    data = run_scenario(shipped_scenarios()["damaged"], real_fmus, tmp_path)
    judgement = judge(data)
    assert judgement.time == pytest.approx(0.2532)
    assert judgement.true[0] == 0.4
    assert judgement.estimated[0] == pytest.approx(0.4, abs=0.05)
    assert judgement.mean_absolute_error < 0.02
    assert data.attrs["divided_steps"] == 0
    assert judge(load_results(tmp_path)).time == judgement.time


def test_damage_that_begins_half_way_is_seen_in_the_windows_after_it(real_fmus):
    data = run_scenario(shipped_scenarios()["damage_begins"], real_fmus)
    found = judgements(data)
    assert [judgement.time for judgement in found] == pytest.approx([0.2532 * k for k in range(1, 7)])
    assert max(judgement.estimated.max() for judgement in found[:3]) < 0.05
    assert [int(judgement.estimated.argmax()) for judgement in found[3:]] == [0, 0, 0]
    assert found[-1].estimated[0] == pytest.approx(0.4, abs=0.05)
