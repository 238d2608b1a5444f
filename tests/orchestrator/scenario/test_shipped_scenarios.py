"""The shipped scenarios fit this project's FMUs, run, and find the damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gossamer_orchestrator import judge, load_results, load_scenario, make_plan, parse_scenario, run_scenario
from gossamer_orchestrator.results.judgements import windows
from gossamer_orchestrator.scenario.shipped import shipped_scenarios


@pytest.fixture
def real_fmus(built) -> Path:
    return built("python")["sensor"].parent


@pytest.mark.parametrize("name", sorted(shipped_scenarios()))
def test_a_shipped_scenario_fits_the_fmus(name, real_fmus):
    plan = make_plan(load_scenario(shipped_scenarios()[name]), real_fmus)
    if "hub" in plan.scenario.components:
        assert [c.name for c in plan.components] == ["hub", "membrane"]
        return
    assert len(plan.components) == 10
    assert len(plan.files) == 4  # compensators are exact, or estimators
    assert [c.name for c in plan.components][-1] == "detector"


def test_the_damaged_membrane_is_found_out(real_fmus, tmp_path):
    """40 % in zone 1, without noise, through sensors and exact compensators."""
    data = run_scenario(shipped_scenarios()["damaged"], real_fmus, tmp_path)
    judgement = judge(data)
    assert judgement.time == pytest.approx(0.2532)
    assert judgement.true[0] == 0.4
    assert judgement.estimated[0] == pytest.approx(0.4, abs=0.05)
    assert judgement.mean_absolute_error < 0.005
    assert data.attrs["divided_steps"] == 0
    assert judge(load_results(tmp_path)).time == judgement.time


def test_damage_that_begins_half_way_is_seen_through_noise_in_the_windows_after_it(real_fmus):
    """35 % in zone 6 and 20 % in zone 12: no zone is named before, no other one after, and the errors fit the bars."""
    data = run_scenario(shipped_scenarios()["damage_begins"], real_fmus)
    found = windows(data)
    assert [judgement.time for judgement in found] == pytest.approx([0.2532 * k + 0.0072 for k in range(1, 7)])
    assert all(judgement.valid for judgement in found)
    assert max(judgement.estimated.max() for judgement in found[:3]) < 0.05
    for judgement in found[3:]:
        assert set(np.flatnonzero(judgement.estimated > 0.05) + 1) == {6, 12}
        damaged = judgement.true > 0.0
        error = np.abs(judgement.estimated - judgement.true)[damaged]
        assert (error < np.maximum(4.0 * judgement.deviation[damaged], 0.01)).all()
        assert error.max() < 0.04


def test_native_fmus_and_those_that_run_in_python_give_the_same_thousand_steps(built):
    """Asked: 1e-12 relative. Everything that is recorded is compared, from the membrane to the detector."""
    text = shipped_scenarios()["damaged"].read_text(encoding="utf-8").replace("stop = 0.2532 ", "stop = 0.3 ")
    scenario = parse_scenario(text)
    assert scenario.ticks == 1000
    one, other = (run_scenario(scenario, built(kind)["sensor"].parent) for kind in ("python", "native"))
    assert one["membrane.deflection"].std() > 0.01
    for name in one.data_vars:
        scale = float(np.abs(one[name]).max())
        assert float(np.abs(one[name] - other[name]).max()) <= 1e-12 * scale, name
