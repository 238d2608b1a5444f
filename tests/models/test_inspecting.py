"""Inspections: one damage for several records, and what has grown since the last one."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from gossamer_models import DataError
from gossamer_models.membrane import square_structure
from gossamer_models.twin import Earlier, MembraneForward, ResponseRecord, Twin, inspect

COARSE = square_structure(4, 1)  # twin and truth have the same mesh, so that a simulation costs little
NOISE, STEP = 1e-3, 3e-4


@cache
def strain(load, zone, depth):
    damage = depth * np.eye(16)[zone - 1 : zone]
    return MembraneForward(COARSE).strain(damage, {"pressure_amplitude": np.array([1e4 * load])}, {}, 500, STEP)[0]


def record(load=1.0, zone=6, depth=0.0, seed=0):
    y = strain(load, zone, depth)
    return ResponseRecord(step=STEP, values=y + NOISE * np.random.default_rng(seed).standard_normal(y.shape), noise=NOISE)


@pytest.fixture(scope="module")
def twin():
    return Twin(COARSE, discrepancy=None)


@pytest.fixture(scope="module")
def spring(twin):
    return inspect(twin, [record(load, depth=0.05, seed=k) for k, load in enumerate((0.95, 1.0, 1.05, 1.0))])


def test_four_records_tell_a_damage_twice_as_well_as_one(twin, spring):
    alone = twin.fit(record(0.95, depth=0.05, seed=0))
    assert spring.valid
    assert alone.valid
    assert spring.damage[5] == pytest.approx(0.05, abs=3.5 * spring.deviation[5])
    assert np.delete(spring.damage, 5).max() == 0.0
    assert spring.deviation[5] == pytest.approx(0.5 * alone.deviation[5], rel=0.2)


def test_each_record_has_loads_of_its_own_and_the_structure_one_value(spring):
    loads = np.array([each.nuisances["amplitude"][0] for each in spring.records])
    assert loads / loads[1] == pytest.approx([0.95, 1.0, 1.05, 1.0], abs=5e-3)  # the modulus scales all of them
    assert len({each.nuisances["density"] for each in spring.records}) == 1
    assert "density" in spring.nuisances
    assert "amplitude" not in spring.nuisances


def test_one_record_is_answered_as_it_is_alone(twin):
    one = record(depth=0.1, seed=3)
    assert inspect(twin, [one]).damage == pytest.approx(twin.fit(one).damage)


def test_what_has_grown_since_the_last_inspection_is_told_by_zone(twin, spring):
    later = inspect(twin, [record(depth=0.08, seed=7)], since=spring)
    assert later.valid
    assert later.growth[5] == pytest.approx(0.03, abs=3.5 * later.growth_deviation[5])
    assert later.growth_deviation[5] < 0.005
    assert later.growth_probability[5] > 0.99
    assert np.delete(later.growth, 5).max() == 0.0
    assert later.damage[5] == pytest.approx(0.08, abs=3.5 * later.deviation[5])


def test_nothing_has_grown_where_nothing_changed(twin, spring):
    later = inspect(twin, [record(depth=0.05, seed=8), record(1.03, depth=0.05, seed=9)], since=spring)
    assert later.valid
    assert later.growth.max() == 0.0
    assert later.growth_probability.max() < 0.1
    assert later.deviation[5] < spring.deviation[5]  # both inspections count


def test_a_zone_that_healed_is_named_unless_it_was_repaired(twin, spring):
    healed = inspect(twin, [record(seed=10)], since=spring)
    assert not healed.valid
    assert any("zone_6 was damaged by" in doubt and "repaired" in doubt for doubt in healed.doubts)
    repaired = inspect(twin, [record(seed=10)], since=spring, repaired=["zone_6"])
    assert repaired.valid
    assert repaired.damage[5] < 0.01


def test_a_record_that_contradicts_the_others_is_named(twin):
    records = [record(seed=1), record(1.04, seed=2), record(depth=0.4, seed=3)]
    found = inspect(twin, records)
    assert not found.valid
    assert any(doubt.startswith("record ") for doubt in found.doubts)


def test_an_inspection_is_read_as_it_was_written(spring, tmp_path):
    path = tmp_path / "spring.json"
    path.write_text(json.dumps(spring.as_json()))
    again = Earlier.read(path)
    assert again.damage == pytest.approx(spring.damage)
    assert again.covariance == pytest.approx(spring.covariance)
    vague = replace(spring, deviation=np.full(16, 0.05))  # no zone is determined
    path.write_text(json.dumps(vague.as_json()))
    assert vague.as_json()["damage"] == [None] * 16
    assert Earlier.read(path).damage == pytest.approx(Earlier.of(vague).damage)


def test_zones_that_were_answered_together_are_known_by_their_mean_alone(spring):
    pair = ("zone_6", "zone_7")
    together = tuple(tuple(name for name in pair if name != zone) if zone in pair else () for zone in spring.zones)
    found = Earlier.of(replace(spring, together_with=together))
    mean, difference = np.zeros(16), np.zeros(16)
    mean[5:7], difference[5:7] = 0.5, (1.0, -1.0)
    assert mean @ found.covariance @ mean == pytest.approx(mean @ spring.covariance @ mean)
    assert difference @ found.covariance @ difference > 0.02**2


@pytest.mark.parametrize(
    ("content", "message"),
    [("{}", "is no answer of a twin"), ('{"valid": false, "zones": []}', "is not valid, so nothing can be said since")],
)
def test_what_is_no_inspection_is_refused(content, message, tmp_path):
    path = tmp_path / "spring.json"
    path.write_text(content)
    with pytest.raises(DataError, match=message):
        Earlier.read(path)


def test_wrong_zones_are_refused(twin, spring):
    with pytest.raises(DataError, match=r"no zone 'zone_99' to be repaired. Choose from zone_1"):
        inspect(twin, [record()], since=spring, repaired=["zone_99"])
    with pytest.raises(DataError, match="repaired since an inspection"):
        inspect(twin, [record(), record()], repaired=["zone_1"])
    with pytest.raises(DataError, match="needs a record or more"):
        inspect(twin, [])
