"""The watch: no alarm in a healthy run, an alarm after damage, its onset and its zones; states and refusals."""

from functools import cache

import numpy as np
import pytest
from gossamer_models import DataError, ParameterError
from gossamer_models.batch import Batch
from gossamer_models.membrane import membrane_model, square_structure
from gossamer_models.sensor import default_artifact, sensor_model
from gossamer_models.twin import MembraneForward
from gossamer_models.twin.evidence import Evidence
from gossamer_models.twin.onset import JudgedWindow, OnsetProblem
from gossamer_models.twin.simulation import SensedForward
from gossamer_models.twin.watch import Watch

SQUARE = square_structure(4, 1)  # coarse, so that a window costs little; twin and truth have the same
STEP, SAMPLES, WINDOWS = 3e-4, 167, 9
NOISE = 0.002 / np.sqrt(12.0)  # a tenth of the thesis' noise
DAMAGES = [f"damage[{k}]" for k in range(1, 17)]


@cache
def strains(onset, zone, depth, load=1.0):
    """Strain of the four sensors, damage beginning at an onset [s], under so much of the load."""
    batch = Batch(membrane_model(SQUARE), [f"strain[{k}]" for k in range(1, 5)], [DAMAGES[zone - 1]])
    time = STEP * np.arange(1, SAMPLES * WINDOWS + 1)
    history = depth * np.clip((time - onset) / STEP, 0.0, 1.0)
    start = {"pressure_amplitude": load * MembraneForward(SQUARE).parameters["pressure_amplitude"]}
    return batch.run(time.size, STEP, start, {DAMAGES[zone - 1]: history}).results[0]


def windows(watch, readings):
    return [watch.advance(part) for part in np.split(readings, WINDOWS, axis=1)]


def noisy(readings, seed):
    return readings + np.random.default_rng(seed).uniform(0.0, np.sqrt(12.0) * NOISE, readings.shape)


@pytest.mark.parametrize("seed", range(3))
def test_a_healthy_run_raises_no_alarm(seed):
    judged = windows(Watch(NOISE, SQUARE), noisy(strains(0.0, 1, 0.0), seed))
    assert not any(window.alarm for window in judged)
    assert np.mean([window.misfit for window in judged]) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(("onset", "zone", "depth"), [(0.2104, 6, 0.3), (0.2333, 1, 0.4), (0.26, 11, 0.2)])
def test_damage_that_begins_is_dated_and_placed(onset, zone, depth):
    """The alarm comes within two windows, onset and damage one window after it."""
    judged = windows(Watch(NOISE, SQUARE), noisy(strains(onset, zone, depth), 4))
    alarms = [window.time for window in judged if window.alarm]
    assert len(alarms) == 1
    assert 0.0 < alarms[0] - onset < 2 * SAMPLES * STEP
    (finding,) = (window.finding for window in judged if window.finding)
    assert finding.onset == pytest.approx(onset, abs=5e-4)
    assert finding.damage == pytest.approx(depth * np.eye(16)[zone - 1], abs=0.03)
    assert 0.0 < finding.deviation[zone - 1] < 0.02
    assert judged[-1].misfit == pytest.approx(1.0, abs=0.1)


def test_a_known_damage_is_no_alarm():
    found = strains(0.0, 6, 0.3)
    watch = Watch(NOISE, SQUARE, damage=0.3 * np.eye(16)[5])
    # the damage of the record sets in with the load, that of the watch before: only the prestress differs
    assert not any(window.alarm for window in windows(watch, noisy(found, 5)))


@pytest.mark.parametrize("load", [0.97, 1.03])
def test_a_load_that_is_not_as_known_raises_no_alarm_and_hides_no_damage(load):
    judged = windows(Watch(NOISE, SQUARE), noisy(strains(0.2833, 7, 0.1, load), 8))
    assert [window.time > 0.2833 for window in judged if window.alarm] == [True]
    (finding,) = (window.finding for window in judged if window.finding)
    assert finding.damage == pytest.approx(0.1 * np.eye(16)[6], abs=0.03)
    assert [window.misfit for window in judged[:5]] == pytest.approx(np.ones(5), abs=0.2)


def test_evidence_of_old_onsets_is_forgotten_exactly():
    """What is left is the least squares of a load and the windows whose onsets are kept."""
    random = np.random.default_rng(9)
    J, r = random.standard_normal((3, 40, 1 + 3 * 2)), random.standard_normal((3, 40))
    evidence = Evidence(1, 2, 1.0)
    for k in range(3):
        J[k, :, 1 + 2 * (k + 1) :] = 0.0  # no damage that begins later
        evidence.add(r[k], J[k][:, np.r_[0, 1 + 2 * max(0, k - 1) : 3 + 2 * k]], min(k, 1))
    J[0, :, 1:] = J[1, :, 1:3] = 0.0  # of onsets that are forgotten
    both, one = np.vstack([*J])[:, [0, 3, 4, 5, 6]], np.vstack([*J])[:, [0]]

    def explained(columns):
        prior = np.diag([1.0, *np.zeros(columns.shape[1] - 1)])
        g = columns.T @ r.ravel()
        return g @ np.linalg.solve(columns.T @ columns + prior, g)

    assert evidence.freedom == 4
    assert evidence.score == pytest.approx((explained(both) - explained(one)) / 4)


def test_readings_may_be_resistances():
    strain = strains(0.2104, 6, 0.3)
    sensor = default_artifact()
    start = {"rest_strain": 0.012 / 0.588, "strain": 0.012 / 0.588}
    sensed = Batch(sensor_model(sensor), ["resistance"], ["strain"])
    resistance = sensed.run(strain.shape[1], STEP, start, {"strain": strain}).results[:, 0]
    readings = resistance + np.random.default_rng(6).normal(0.0, 0.5, resistance.shape)
    judged = windows(Watch(0.5, SQUARE, sensor=sensor), readings)
    (finding,) = (window.finding for window in judged if window.finding)
    assert finding.onset == pytest.approx(0.2104, abs=5e-4)
    assert finding.damage == pytest.approx(0.3 * np.eye(16)[5], abs=0.03)


def test_windows_before_the_onset_are_not_simulated_again_and_the_readings_are_the_same():
    forward, sigma, healthy = (SensedForward(MembraneForward(SQUARE)), np.full(4, NOISE), np.zeros(16))
    place, seen = forward.begin(healthy, {}, STEP), []
    for k in range(3):
        expected, after = forward.advance(place, np.zeros((1, 30, 16)), {}, STEP)
        seen.append(JudgedWindow(30 * STEP * k, place, expected[0], expected[0]))
        place = after
    y = np.concatenate([window.y for window in seen], axis=1)
    whole = OnsetProblem(forward, [JudgedWindow(0.0, seen[0].place, y, y)], sigma, healthy, STEP)
    parts = OnsetProblem(forward, seen, sigma, healthy, STEP)
    for onsets in ([40.5, 70.0], [60.0, 61.0], [3.0, 80.0]):
        unknowns = np.column_stack([onsets, np.full((2, 16), 0.2)])
        np.testing.assert_array_equal(parts.simulate(unknowns)[0], whole.simulate(unknowns)[0])
        np.testing.assert_array_equal(parts.simulate(unknowns)[1].membrane.x, whole.simulate(unknowns)[1].membrane.x)


def test_missing_readings_are_left_out():
    readings = noisy(strains(0.2104, 6, 0.3), 7)
    readings[2, ::5] = np.nan
    (finding,) = (window.finding for window in windows(Watch(NOISE, SQUARE), readings) if window.finding)
    assert finding.damage == pytest.approx(0.3 * np.eye(16)[5], abs=0.03)


@pytest.mark.parametrize("shape", [(3, 100), (4, 10), (100,)])
def test_windows_of_another_shape_are_refused(shape):
    with pytest.raises(DataError, match="20 or more"):
        Watch(NOISE, SQUARE).advance(np.zeros(shape))


@pytest.mark.parametrize("wrong", [{"noise": 0.0}, {"noise": np.nan}, {"step": 0.0}, {"false_alarms": 2.0}])
def test_numbers_without_meaning_are_refused(wrong):
    with pytest.raises(ParameterError):
        Watch(**{"noise": NOISE, **wrong})
