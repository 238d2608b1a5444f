"""A second look at a fit: its columns are those of the structure, and what they explain is said."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models.assessment.conditions import chosen, conditions, finer, plan_of_square
from gossamer_models.assessment.records import make_records
from gossamer_models.campaign import Distribution, MeasurementNoise
from gossamer_models.membrane import square_structure
from gossamer_models.membrane.gauges import BESIDE, gauge, stacked
from gossamer_models.twin import MembraneForward, ResponseRecord, Twin
from gossamer_models.twin.nuisances import BY_DEFAULT
from gossamer_models.twin.second_look import PARTS, Parted
from scipy.signal import lfilter

pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")

SQUARE = square_structure(8, 1)
STEP, STEPS, NOISE = 3e-4, 600, 1e-3


@pytest.fixture(scope="module")
def forward():
    return MembraneForward(SQUARE)


@pytest.fixture(scope="module")
def parted(forward):
    return Parted(forward)


@pytest.fixture(scope="module")
def columns(forward, parted):
    record = ResponseRecord(step=STEP, values=forward.strain(np.zeros((1, 16)), {}, {}, STEPS, STEP)[0], noise=NOISE)
    problem = Twin(SQUARE)._problem(record)
    return parted.columns(problem, np.zeros(problem.size))


def test_causes_have_the_symmetry_of_the_square(columns):
    """A pressure that is tilted along x has the other sign for the mirrored sensors; one that flickers the same."""
    along_x, along_y = columns["tilt"]
    size = np.abs(columns["tilt"]).max()
    np.testing.assert_allclose(along_x[0], -along_x[1], atol=5e-3 * size)
    np.testing.assert_allclose(along_x[2], -along_x[3], atol=5e-3 * size)
    np.testing.assert_allclose(along_y[0], -along_y[2], atol=5e-3 * size)
    flicker = columns["flicker"]
    np.testing.assert_allclose(flicker, flicker[:, [1, 0, 3, 2]], atol=5e-3 * np.abs(flicker).max())


def test_parts_move_no_mean_and_places_are_those_of_moved_gauges(forward, parted, columns):
    parts = parted.forward.structure
    at = parts.zone_places.reshape(16, PARTS, 3).mean(axis=1)
    np.testing.assert_allclose(at, SQUARE.zone_places, atol=1e-12)
    side = SQUARE.mesh.size
    moved = []
    for sensor in SQUARE.setup.sensors:
        point = np.array(sensor.point) + BESIDE * side * np.array([-1.0, 0.0, 0.0])  # across the sensor
        moved.append(gauge(SQUARE.mesh, point, np.array(sensor.direction), 0.0))
    gauges = stacked(SQUARE.setup.sensors, moved, len(SQUARE.mesh.nodes))
    there = MembraneForward(SQUARE, gauges=gauges).strain(np.full((1, 16), 1e-3), {}, {}, STEPS, STEP)[0]
    here = forward.strain(np.full((1, 16), 1e-3), {}, {}, STEPS, STEP)[0]
    slope = (there - here) / BESIDE
    for k in range(4):
        np.testing.assert_allclose(columns["place"][4 + k, k], slope[k], atol=1e-6 * np.abs(slope).max())
        assert not columns["place"][4 + k, [j for j in range(4) if j != k]].any()


def test_damage_that_does_not_fill_its_zones_is_said_to_be_partial(parted):
    """A band over half of four zones: its zones have their mean, as well as is stated, and are said to be partial."""
    parts = np.zeros((16, PARTS))
    middles = parted.forward.structure.zone_places[:, 1].reshape(16, PARTS)
    upper = middles > middles.mean(axis=1, keepdims=True)
    parts[4:8] = 0.4 * upper[4:8]
    clean = parted.forward.strain(parts.reshape(1, -1), {}, {}, STEPS, STEP)[0, :4]
    noise = NOISE * np.random.default_rng(1).standard_normal(clean.shape)
    answer = Twin(SQUARE).fit(ResponseRecord(step=STEP, values=clean + noise, noise=NOISE))
    assert any("does not fill" in doubt for doubt in answer.doubts)
    error = np.abs(answer.damage - parts.mean(axis=1))
    assert not (answer.valid and (answer.determined & (error > 0.05) & (error > 3.0 * answer.deviation)).any())


def test_a_hole_in_one_zone_is_not_answered_as_many_damaged_zones(tmp_path):
    """The record of the assessment that five whole zones explain as well as one in which a quarter has lost 90 %."""
    plan = replace(plan_of_square(), noise=MeasurementNoise(strain=Distribution(normal=5.8e-3)))
    (condition,) = chosen(conditions(plan, finer(plan.membrane), 1), ["hole in a zone"])
    records = make_records(condition, tmp_path)
    answer = Twin().fit(ResponseRecord(step=records.step, values=records.strain[0]))
    assert answer.valid
    assert np.flatnonzero(answer.damage).tolist() == np.flatnonzero(records.damage[0]).tolist()
    assert not answer.determined[answer.damage > 0.0].any()
    assert any(doubt.startswith("partial") for doubt in answer.doubts)


def test_a_right_record_gets_no_second_explanation(forward):
    damage = np.zeros((1, 16))
    damage[0, [5, 10]] = 0.3, 0.15
    clean = forward.strain(damage, {}, {}, STEPS, STEP)[0]
    noise = NOISE * np.random.default_rng(2).standard_normal(clean.shape)
    answer = Twin(SQUARE).fit(ResponseRecord(step=STEP, values=clean + noise, noise=NOISE))
    assert answer.valid
    assert not answer.doubts


def test_noise_that_follows_itself_is_no_white_noise(forward):
    """AR(1) noise as large as stated passes chi2, but its neighbours are alike."""
    random, values = np.random.default_rng(3), forward.strain(np.zeros((1, 16)), {}, {}, STEPS, STEP)[0]
    noise = lfilter([np.sqrt(1.0 - 0.9**2)], [1.0, -0.9], random.standard_normal(values.shape))
    answer = Twin(SQUARE, known=BY_DEFAULT).fit(ResponseRecord(step=STEP, values=values + NOISE * noise, noise=NOISE))
    assert not answer.valid
    assert any("no white noise" in doubt for doubt in answer.doubts)


@pytest.mark.parametrize("noise", [1e-5, 1e-3])
def test_noise_is_that_of_what_a_fit_leaves(forward, noise):
    """The record's own high frequencies are no noise: differences of the record itself show 3e-4."""
    damage = np.zeros((1, 16))
    damage[0, 5] = 0.3
    clean = forward.strain(damage, {}, {}, STEPS, STEP)[0]
    record = ResponseRecord(step=STEP, values=clean + noise * np.random.default_rng(4).standard_normal(clean.shape))
    answer = Twin(SQUARE).fit(record)
    left = answer.record.noise_deviation(answer.predicted)
    np.testing.assert_allclose(left, noise, rtol=0.2)
    assert answer.valid
    assert abs(answer.damage[5] - 0.3) < 3.0 * answer.deviation[5]
    assert answer.deviation[5] < 10.0 * noise


def test_colour_of_noise_that_is_not_given_is_estimated_and_said(forward):
    damage = np.zeros((1, 16))
    damage[0, 5] = 0.3
    noise = lfilter([np.sqrt(1.0 - 0.7**2)], [1.0, -0.7], np.random.default_rng(3).standard_normal((4, 2000)))[:, 1000:]
    values = forward.strain(damage, {}, {}, 1000, STEP)[0] + 5.8e-3 * noise
    answer = Twin(SQUARE).fit(ResponseRecord(step=STEP, values=values))
    assert answer.valid
    np.testing.assert_allclose(answer.record.noise_deviation(), 5.8e-3 * noise.std(axis=1), rtol=0.2)
    np.testing.assert_allclose(answer.record.follows, 0.7, atol=0.1)
    assert sum("is coloured: 0.5" in doubt or "is coloured: 0.6" in doubt for doubt in answer.doubts) == 4
    assert abs(answer.damage[5] - 0.3) < 3.0 * answer.deviation[5]


def test_noise_that_is_many_times_what_is_seen_of_it_is_no_hopeless_record():
    """Sixth differences see so little of it that the search gives up at chi2 of 900 per sample."""
    square, damage = square_structure(4, 2), np.where(np.arange(16) == 5, 0.3, 0.0) + np.where(np.arange(16) == 10, 0.4, 0.0)
    values = MembraneForward(square).strain(damage[None], {}, {}, STEPS, STEP)[0]
    white = np.random.default_rng(1).standard_normal(values.shape)
    values += 6e-3 * lfilter([np.sqrt(1.0 - 0.9**2)], [1.0, -0.9], white)
    answer = Twin(square, discrepancy=None).fit(ResponseRecord(step=STEP, values=values))
    assert answer.valid
    np.testing.assert_allclose(answer.record.follows, 0.9, atol=0.04)
    assert np.abs(answer.damage - damage).max() < 0.02


def test_load_that_is_not_known_is_no_coloured_noise(forward):
    """Its error is as slow as noise may be, and as alike in neighbouring samples."""
    values = forward.strain(np.zeros((1, 16)), {"pressure_amplitude": np.full(1, 1.1e4)}, {}, STEPS, STEP)[0]
    record = ResponseRecord(step=STEP, values=values + NOISE * np.random.default_rng(4).standard_normal(values.shape))
    assert not Twin(SQUARE, known=BY_DEFAULT).fit(record).valid
