"""The watch: no alarm in a healthy run, an alarm after damage, its onset and its zones; states and refusals."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from gossamer_models import DataError, GossamerError, ParameterError
from gossamer_models.batch import Batch
from gossamer_models.membrane import membrane_model, square_structure
from gossamer_models.sensor import default_artifact, sensor_model
from gossamer_models.twin import MembraneForward
from gossamer_models.twin.evidence import Evidence
from gossamer_models.twin.record import still_sensors
from gossamer_models.twin.simulation import SensedForward
from gossamer_models.twin.watch import SURE, Watch
from scipy.special import chdtri
from threadpoolctl import threadpool_info, threadpool_limits

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


def test_whatever_threads_there_are_one_judges_a_window(monkeypatch):
    """So that sums are in one order, and the answer has the same bits on every machine."""
    watch, threads = Watch(NOISE, SQUARE), set()
    advance = watch._sensed.advance

    def counting(*arguments):
        threads.update(each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas")
        return advance(*arguments)

    monkeypatch.setattr(watch._sensed, "advance", counting)
    with threadpool_limits(2):
        watch.advance(noisy(strains(0.0, 1, 0.0), 1)[:, :SAMPLES])
    assert threads == {1}


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


def test_evidence_is_that_of_all_windows_together():
    """What is left is the least squares of what lasts and the onsets that are kept, each damage for itself."""
    random = np.random.default_rng(9)
    J, r = random.standard_normal((3, 40, 2 + 3 * 2)), random.standard_normal((3, 40))
    evidence = Evidence(np.array([0.3, 0.0]), 2)
    for k, stay in enumerate(([], [0], [1])):
        J[k, :, 2 + 2 * (k + 1) :] = 0.0  # no damage that begins later
        columns = np.r_[:2, (2 + 2 * np.r_[k - len(stay) : k + 1][:, None] + np.arange(2)).ravel()].astype(int)
        evidence.add(r[k], J[k][:, columns], np.array(stay, dtype=int))
    J = np.vstack([*J])[:, [0, 1, 4, 5, 6, 7]]  # the first onset is forgotten
    lasting = np.linalg.solve(J[:, :2].T @ J[:, :2] + np.eye(2), J[:, :2].T @ r.ravel() + [0.3, 0.0])
    assert evidence.lasting == pytest.approx(lasting)
    moved = r.ravel() - J[:, :2] @ lasting
    for k, score in enumerate(evidence.scores.ravel(), start=2):
        c, P = J[:, k], J[:, :2]
        left = c @ c - c @ P @ np.linalg.solve(P.T @ P + np.eye(2), P.T @ c)
        assert score == pytest.approx((c @ moved) ** 2 / left)


def test_damage_that_a_watch_says_it_sees_is_seen_in_nine_of_ten_cases():
    """In linear worlds of noise: what raises an alarm is the score of the onset that is tried, and of no other."""
    random, cases = np.random.default_rng(3), 2000
    J = random.standard_normal((60, 3))
    evidence = Evidence(np.zeros(2), 1)
    evidence.add(np.zeros(60), J, np.zeros(0, dtype=int))
    threshold = float(chdtri(1.0, 1e-5))
    damage = (np.sqrt(threshold) + SURE) / np.sqrt(evidence.curvature[0, 0])
    alarms = 0
    for _ in range(cases):
        lasting = random.standard_normal(2)
        seen = Evidence(np.zeros(2), 1)
        seen.add(J @ np.r_[lasting, damage] + random.standard_normal(60), J, np.zeros(0, dtype=int))
        alarms += bool(seen.scores[0, 0] > threshold)
    assert alarms / cases == pytest.approx(0.9, abs=0.02)


def test_a_watch_alarms_for_the_damage_that_it_sees_and_sees_less_where_there_is_more_noise():
    random = np.random.default_rng(8).standard_normal((4, SAMPLES * WINDOWS))
    quiet, loud = (
        windows(Watch(noise, SQUARE), strains(0.2833, 7, 0.0) + noise * random)[-1].sees for noise in (NOISE, 3.0 * NOISE)
    )
    assert (loud > 2.0 * quiet).all()  # priors weigh more there
    for depth, seen in ((2.0 * quiet[6], True), (0.3 * quiet[6], False)):
        judged = windows(Watch(NOISE, SQUARE), noisy(strains(0.2833, 7, depth), 8))
        assert any(window.alarm for window in judged) == seen


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


@pytest.mark.parametrize("what", ["gains", "sensors"])
def test_sensors_that_are_off_neither_alarm_nor_hide(what):
    """One of strain reads 5 % more, those of resistance 20 % less and bent, beside an offset."""
    strain = strains(0.2833, 7, 0.1)
    if what == "gains":
        watch, readings = Watch(NOISE, SQUARE), noisy(strain * np.array([[1.05], [1.0], [0.97], [1.0]]), 8)
    else:
        bank = SensedForward(MembraneForward(SQUARE), default_artifact()).require_bank()
        R = bank.read(strain[None], STEP)[0][0]
        span = np.ptp(R, axis=1, keepdims=True)
        u = (R - R[:, :1]) / span
        sigma = 1e-3 * float(span.mean())
        readings = R - span * (0.2 * u + 0.05 * u**2 - 0.1) + sigma * np.random.default_rng(8).standard_normal(R.shape)
        watch = Watch(sigma, SQUARE, sensor=default_artifact())
    judged = windows(watch, readings)
    assert [window.time > 0.2833 for window in judged if window.alarm] == [True]
    (finding,) = (window.finding for window in judged if window.finding)
    assert finding.valid
    assert finding.damage == pytest.approx(0.1 * np.eye(16)[6], abs=0.03)


def test_neighbours_are_fewer_the_older_they_are():
    watch = Watch(NOISE, SQUARE)
    forward = MembraneForward(SQUARE)
    state, _ = forward.begin(np.zeros(len(forward.zones)), {})
    damage, ages = np.zeros((1, 60, len(forward.zones))), []
    for _ in range(20):
        strain, state = forward.advance(state, damage, {}, STEP)
        watch.advance(noisy(strain[0], 0))
        ages.append(len(watch._onsets))
    assert max(ages) <= 8


def test_missing_readings_are_left_out():
    readings = noisy(strains(0.2104, 6, 0.3), 7)
    readings[2, ::5] = np.nan
    readings[1, 2 * SAMPLES - 30 :] = np.nan  # for good
    readings[:, 2 * SAMPLES : 3 * SAMPLES] = np.nan
    (finding,) = (window.finding for window in windows(Watch(NOISE, SQUARE), readings) if window.finding)
    assert finding.damage == pytest.approx(0.3 * np.eye(16)[5], abs=0.03)


@pytest.mark.parametrize(
    ("begin", "end", "without"),
    [(400, 1503, [2, 3, 4, 5, 6, 7, 8]), (400, 600, [2, 3]), (656, 1503, [3, 4, 5, 6, 7, 8]), (531, 683, [3, 4])],
)
def test_a_sensor_that_repeats_one_reading_is_left_out_until_it_moves_again(begin, end, without):
    readings = noisy(strains(0.0, 1, 0.0), 1)
    readings[2, begin:end] = readings[2, begin]
    seen = windows(Watch(NOISE, SQUARE, step=STEP), readings)
    assert not any(window.alarm for window in seen)
    assert [k for k, window in enumerate(seen) if window.without] == without
    assert {sensor for window in seen for sensor in window.without} == {3}
    assert max(window.misfit for window in seen) < 1.5


def test_what_does_not_move_while_nothing_does_is_a_reading():
    values = np.zeros((2, 60))
    assert not still_sensors(values).any()
    values[0, 30:] = np.arange(1.0, 31.0)
    assert still_sensors(values)[1].tolist() == [False] * 30 + [True] * 30
    values[0, 40:] = np.nan
    assert still_sensors(values)[1].tolist() == [False] * 30 + [True] * 10 + [False] * 20  # where another one has readings


@pytest.mark.parametrize("shape", [(3, 100), (4, 10), (100,)])
def test_windows_of_another_shape_are_refused(shape):
    with pytest.raises(DataError, match="20 or more"):
        Watch(NOISE, SQUARE).advance(np.zeros(shape))


@pytest.mark.parametrize("wrong", [{"noise": 0.0}, {"noise": np.nan}, {"step": 0.0}, {"false_alarms": 2.0}])
def test_numbers_without_meaning_are_refused(wrong):
    with pytest.raises(ParameterError):
        Watch(**{"noise": NOISE, **wrong})


def test_a_window_that_is_refused_changes_nothing():
    """The same window without the mistake is judged as if there had been none."""
    parts = np.split(noisy(strains(0.0, 1, 0.0), 6), WINDOWS, axis=1)[:3]
    watch, other = Watch(NOISE, SQUARE), Watch(NOISE, SQUARE)
    still = {"pressure": np.zeros(SAMPLES)}
    for part in parts[:2]:
        for each in (watch, other):
            each.advance(part, still)
    with pytest.raises(GossamerError):
        watch.advance(parts[2], {"pressure": np.full(SAMPLES, np.nan)})
    with pytest.raises(DataError, match="has the loads none, and the watch knows pressure"):
        watch.advance(parts[2])
    with pytest.raises(DataError, match="has the loads presure, and the watch knows none"):
        Watch(NOISE, SQUARE).advance(parts[0], {"presure": np.zeros(SAMPLES)})
    assert watch.advance(parts[2], still).evidence == pytest.approx(other.advance(parts[2], still).evidence)


def test_a_sensor_that_drifts_from_window_to_window_does_not_bend_the_finding():
    """Twenty deviations of the noise a window, which is any offset in each."""
    drift = np.zeros((4, SAMPLES * WINDOWS))
    drift[1] = 20.0 * NOISE * (np.arange(SAMPLES * WINDOWS) // SAMPLES)
    judged = windows(Watch(NOISE, SQUARE), noisy(strains(0.2104, 6, 0.3), 4) + drift)
    (finding,) = (window.finding for window in judged if window.finding)
    assert finding.damage == pytest.approx(0.3 * np.eye(16)[5], abs=0.03)
    assert finding.chi2_per_sample == pytest.approx(1.0, abs=0.1)


def test_a_sensor_that_reads_noise_alone_is_blamed_and_the_watch_goes_on_without_it():
    readings = noisy(strains(0.0, 1, 0.0), 3)
    after = readings[2, 700:]
    after[:] = readings[2, :700].mean() + 0.03 * np.random.default_rng(3).standard_normal(after.size)
    judged = windows(Watch(NOISE, SQUARE), readings)
    assert [window.alarm for window in judged] == [False] * 4 + [True] + [False] * 4
    assert [window.blamed for window in judged] == [()] * 5 + [(3,)] + [()] * 3
    assert not any(window.finding for window in judged)
    assert judged[-1].without == (3,)
    assert judged[-1].misfit == pytest.approx(1.0, abs=0.15)
    assert judged[-1].sees.max() < 0.05


def test_a_film_of_finer_elements_hides_less_where_a_finer_mesh_is_simulated_beside():
    """The film of the readings has three times as many elements a side, the finer mesh twice as many."""
    film, truth = square_structure(8, 1), MembraneForward(square_structure(24, 1))
    damage = np.zeros((1, 5 * SAMPLES, 16))
    damage[0, int(0.23 / STEP) :, 10] = 0.3
    state, _ = truth.begin(np.zeros(16), {})
    readings = truth.advance(state, damage, {}, STEP)[0][0]
    readings = np.split(readings + 1e-3 * np.random.default_rng(1).standard_normal(readings.shape), 5, axis=1)
    beside, alone = Watch(1e-3, film), Watch(1e-3, film, exact_mesh=True)
    one, other = ([watch.advance(part) for part in readings] for watch in (beside, alone))
    assert [window.alarm for window in one] == [False] * 4 + [True]
    assert not any(window.alarm for window in other[:-1])
    assert one[-1].statistic > 3.0 * other[-1].statistic
    assert np.isinf(one[-1].sees).all()  # the mesh is too coarse to say
    assert 0.1 < one[-1].mesh < 0.4  # so much do finer elements add to the strain of this film
    assert other[-1].mesh == 0.0


def test_readings_of_the_same_mesh_have_nothing_of_a_finer_one():
    judged = windows(Watch(NOISE, SQUARE), noisy(strains(0.0, 1, 0.0), 0))
    assert max(window.mesh for window in judged[1:]) < 0.02


def test_neighbours_do_not_come_apart_where_a_cycle_of_the_load_ends():
    """Their states are compared: a phase that had begun anew was a whole cycle away, and moved the watch into nowhere."""
    forward = MembraneForward(square_structure(4, 1))
    frequency = forward.parameters["pressure_frequency"]
    begins = [forward.begin(np.zeros(16), {"pressure_frequency": f})[0] for f in frequency * np.array([1.0001, 0.9999])]
    joined = {name: np.concatenate([getattr(each, name) for each in begins]) for name in ("x", "values")}
    _, state = forward.advance(replace(begins[0], **joined), np.zeros((2, 100, 16)), {}, 1.0 / (100.0 * frequency))
    distance = np.abs(state.x[1] - state.x[0]).max()
    assert 1e-4 < distance < 0.1
