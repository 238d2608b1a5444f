"""The conditions of the assessment: what is simulated, and what sensors read of it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import ParameterError
from gossamer_models.assessment import conditions, detections, readings
from gossamer_models.assessment.conditions import (
    HELD_OUT,
    SHARES,
    SHORT,
    SIZES,
    TUNED,
    chosen,
    finer,
    plan_of_square,
    single_damages,
)
from gossamer_models.assessment.records import make_records
from gossamer_models.assessment.truths import as_setup, partial_damages, quartered, tilt, tilted, whole_zones
from gossamer_models.campaign import Mesh
from gossamer_models.detector.thesis_tables import as_array
from gossamer_models.twin import MembraneForward

COARSE = Mesh(elements_per_side=4, order=1)


def test_single_damages_fill_every_zone_evenly_wherever_they_stop():
    damage = as_array(single_damages(60, 16))
    assert ((damage > 0.0).sum(axis=1) == 1).all()
    for stop in (8 * 16, 60 * 16):
        for zone in range(16):
            size = np.sort(damage[:stop, zone][damage[:stop, zone] > 0.0])
            u = np.interp(np.log(size), np.log(SIZES), SHARES)
            assert len(u) == stop // 16
            assert np.diff(u).max() < 2.5 / len(u)
    assert 0.005 <= damage[damage > 0.0].min() < damage.max() <= 0.5
    assert len(np.unique(damage[damage > 0.0])) == 960


def test_conditions_that_share_a_store_share_its_campaign():
    put = conditions(plan_of_square(), COARSE, 8)
    put += [condition for pair in detections(plan_of_square(), 8) for condition in (pair.healthy, pair.damaged)]
    assert len({condition.name for condition in put}) == len(put)
    for condition in put:
        assert all(other.campaign == condition.campaign for other in put if other.store == condition.store)


def test_the_square_has_every_condition_and_half_are_kept_out_of_tuning():
    names = {condition.name: condition for condition in conditions(plan_of_square(COARSE), finer(COARSE), 4)}
    assert set(names) == TUNED | HELD_OUT
    assert len(TUNED) == len(HELD_OUT)
    assert not TUNED & HELD_OUT
    assert [condition.name for condition in chosen([*names.values()], ["short"])] == list(SHORT)
    assert names["outliers"].held_out
    with pytest.raises(ParameterError, match="Choose from all, short, clean"):
        chosen([*names.values()], ["hail"])


def test_the_square_as_a_setup_moves_as_the_square_does():
    mesh = Mesh(elements_per_side=4, order=2, parameters={"density": 1200.0, "edge_displacement": 0.005})
    damage = 0.3 * np.eye(16)[2:3]
    own, general = (
        MembraneForward(each.structure, each.parameters).strain(damage, {}, {}, 200, 3e-4) for each in (mesh, as_setup(mesh))
    )
    assert np.ptp(own) > 0.01
    assert general == pytest.approx(own, abs=1e-12)


def test_damage_of_parts_is_the_mean_over_the_area_of_each_zone():
    """Square: a band holds half of four zones, a corner a quarter of four, a hole a quarter of one."""
    structure = quartered(Mesh()).structure
    assert structure.n_zones == 4 * 16
    for kind, zones, share in (("band", 4, 0.5), ("corner", 4, 0.25), ("hole", 1, 0.25)):
        listed = np.zeros((6, 64))
        for row, parts in zip(listed, partial_damages(kind, structure, 6, seed=1), strict=True):
            row[[part - 1 for part in parts]] = [*parts.values()]
        found = whole_zones(structure, listed)
        assert (found > 0.0).sum(axis=1).tolist() == [zones] * 6
        assert found.max(axis=1) == pytest.approx(share * listed.max(axis=1))


def test_a_tilted_pressure_is_that_of_the_middle_on_the_mean():
    plan = plan_of_square(tilted(Mesh()), 0.03)
    loads = tilt(replace(plan, cases=2))
    assert len(loads) == 8
    assert {values.shape for values in loads.values()} == {(2, 100)}
    assert sum(loads.values()) == pytest.approx(0.0, abs=1e-9)
    ends = loads["of_strip_7"] - loads["of_strip_0"]
    assert np.abs(ends).max() == pytest.approx(0.05 * 1e4 * 7 / 8 * math.sin(2 * math.pi * 7.9 * 0.03), rel=1e-2)


def test_sensors_off_their_place_late_records_and_noise_are_what_they_say():
    random = np.random.default_rng(1)
    strain, noise, numbers = random.random((8, 4, 900)), 0.01 * random.standard_normal((8, 4, 900)), np.arange(8)
    late = readings.late(5, strain, 0.0 * noise, numbers)
    assert (late[:, :, 5:] == strain[:, :, :-5]).all()
    gain = readings.one_gain(strain, 0.0 * noise, numbers) / strain
    assert [np.flatnonzero(row.min(axis=1) < 0.96).tolist() for row in gain] == [[k % 4] for k in range(8)]
    coloured = readings.coloured(0.0 * strain, noise, numbers)
    assert np.corrcoef(coloured[0, 0, 1:], coloured[0, 0, :-1])[0, 1] == pytest.approx(0.9, abs=0.05)
    far = readings.outliers(0.0 * strain, noise, numbers) - noise
    assert 0.002 < (far > 0.0).mean() < 0.008
    thrice = random.random((8, 12, 9))
    moved = readings.off_place(thrice, 0.0 * thrice, numbers)
    assert ((moved == thrice[:, :4]).all(axis=2).sum(axis=1) == 3).all()
    assert (moved[5, 1] == thrice[5, 9]).all()  # the second way of the second sensor


def test_few_cases_are_simulated_at_once_as_a_campaign_does(tmp_path):
    plan = plan_of_square(COARSE, 0.03)
    varied = {c.name: c for c in conditions(plan, None, 3)}["everything varied"]
    at_once = make_records(varied, tmp_path)
    assert not any(tmp_path.iterdir())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gossamer_models.assessment.records.FEW", 0)
        stored = make_records(varied, tmp_path, workers=1)
    assert (stored.damage == at_once.damage).all()
    assert stored.strain == pytest.approx(at_once.strain, abs=1e-6)


def test_a_dead_sensor_repeats_its_first_reading_and_swapped_ones_change_places():
    histories = np.random.default_rng(1).random((12, 4, 9))
    noise = 0.0 * histories
    dead, swapped = (read(histories, noise, np.arange(12)) for read in (readings.dead, readings.swapped))
    for k in range(12):
        still = np.ptp(dead[k], axis=1) == 0.0
        assert np.flatnonzero(still).tolist() == [k % 4]
        assert (dead[k, ~still] == histories[k, ~still]).all()
        assert (swapped[k] != histories[k]).any(axis=1).sum() == 2
        assert (np.sort(swapped[k], axis=0) == np.sort(histories[k], axis=0)).all()


def test_records_through_the_chain_are_in_time_with_the_membrane(tmp_path):
    chain = next(c for c in conditions(plan_of_square(COARSE, 0.06), COARSE, 4) if c.name == "whole chain")
    clean = next(c for c in conditions(plan_of_square(COARSE, 0.06), COARSE, 4) if c.name == "clean")
    measured, true = (make_records(condition, tmp_path, workers=1) for condition in (chain, clean))
    assert measured.strain.shape == true.strain.shape == (4, 4, 200)
    assert measured.resistance.shape == (4, 4, 200)
    assert (measured.damage == true.damage).all()
    error = [np.abs(measured.strain[:, :, 8:192] - true.strain[:, :, 8 + s : 192 + s]).mean() for s in range(-8, 9, 2)]
    assert int(np.argmin(error)) == 4
