"""The shipped scenarios fit this project's FMUs, run, and find the damage."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from building import build_fmu
from gossamer.descriptions import load_structure
from gossamer.records import find_in_results
from gossamer_fmus import build_all
from gossamer_models.identify import identify_files, settings_for
from gossamer_models.membrane import membrane_model
from gossamer_orchestrator import judge, load_results, load_scenario, make_plan, parse_scenario, run_scenario
from gossamer_orchestrator.results.judgements import windows
from gossamer_orchestrator.results.shapes import load_shapes
from gossamer_orchestrator.scenario.source import shipped_scenarios
from studies.specimen.files import write_datasets


@pytest.fixture
def real_fmus(built) -> Path:
    return built("python")["sensor"].parent


OF_SETUPS = {name for name in shipped_scenarios() if name.removesuffix("_damaged") in shipped_scenarios("membrane")}


@pytest.mark.parametrize("name", sorted(OF_SETUPS))
def test_a_shipped_setup_has_a_scenario_in_which_one_of_its_zones_is_damaged(name, tmp_path):
    structure = load_structure(shipped_scenarios("membrane")[name.removesuffix("_damaged")])
    assert structure.n_zones >= 12
    assert structure.n_sensors == 8
    build_fmu(membrane_model(structure), tmp_path)
    scenario = load_scenario(shipped_scenarios()[name])
    data = run_scenario(scenario, tmp_path)
    assert data["membrane.strain"].sizes["sensor"] == 8
    (damaged,) = np.flatnonzero(data["membrane.damage"].isel(time=-1))
    words = set(structure.zone_names[damaged].split())
    assert words <= set(re.findall(r"\w+", scenario.title))  # which says where


@pytest.mark.parametrize("name", sorted(set(shipped_scenarios()) - OF_SETUPS))
def test_a_shipped_scenario_fits_the_fmus(name, real_fmus):
    plan = make_plan(load_scenario(shipped_scenarios()[name]), real_fmus)
    if name.startswith("own_sensor"):
        recovers = "filter" if name == "own_sensor_filter" else "estimator"
        assert [c.name for c in plan.components] == ["membrane", "sensor1", "sensor4", f"{recovers}1", f"{recovers}4"]
        return
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
    record, true = (find_in_results(data, kind).record for kind in ("compensated", "strain"))
    late = np.isnan(record.values)
    assert late[:, -24:].all()
    assert late.sum() == 4 * 24
    assert np.nanstd(record.values - true.values) < 4.0 * np.mean(record.least_noise) < 4e-3  # what the estimators state


def test_in_service_nothing_but_what_instruments_see_is_recorded_and_the_damage_is_found(built, tmp_path):
    """30 % in zone 10 from 0.4 s on: within the second window, which is no judgement; the later ones find it."""
    data = run_scenario(shipped_scenarios()["in_service"], built("native")["sensor"].parent, tmp_path)
    assert load_shapes(tmp_path) == {}
    assert {str(name).partition(".")[0] for name in data.data_vars} == {*(f"estimator{k}" for k in range(1, 5)), "detector"}
    found = windows(data)
    assert [judgement.valid for judgement in found] == [True, False, True, True]
    assert found[0].estimated.max() == 0.0
    for judgement in found[2:]:
        assert np.isnan(judgement.true).all()
        assert set(np.flatnonzero(judgement.estimated) + 1) == {10}
        assert judgement.estimated[9] == pytest.approx(0.3, abs=0.01)


def test_the_sensor_of_the_tutorial_measures_the_slow_membrane_within_its_range(tmp_path, built):
    """The commands of the README, then the shipped scenario: 0.11 and 0.09 % of the range when this was written."""
    write_datasets(tmp_path)
    record = tmp_path / "synthetic_dataset_1.csv"
    found = identify_files([record], train="0:200", settings=settings_for("preisach", modes=7, relaxations=7))
    found.fit.artifact.write(tmp_path / "sensor.json")
    build_all(tmp_path, ["sensor", "estimator"], artifact=tmp_path / "sensor.json")
    shutil.copy(built("native")["membrane"], tmp_path)
    data = run_scenario(shipped_scenarios()["own_sensor"], tmp_path)
    range_of_sensor = 0.075
    assert 0.8 * range_of_sensor < float(data["membrane.strain"].max()) < range_of_sensor
    late, begun = 24, 50
    for k in (1, 4):
        assert not data[f"sensor{k}.saturated"].any()
        assert not data[f"estimator{k}.saturated"].any()
        assert float(data[f"estimator{k}.delay"][-1]) == pytest.approx(late * 0.1)
        true = data["membrane.strain"].to_numpy()[begun:-late, k - 1]
        error = data[f"estimator{k}.strain"].to_numpy()[begun + late :] - true
        deviation = data[f"estimator{k}.strain_deviation"].to_numpy()[begun + late :]
        assert np.sqrt(np.mean(error**2)) < 0.002 * range_of_sensor
        assert np.sqrt(np.mean((error / deviation) ** 2)) < 1.0


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
