"""The choice of a sensor within its training stretch: what it is judged by, its baselines, its numbers of the filter."""

import re
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import DataError
from gossamer_models.automatic import HERE, Standing, choose, defeats, standings
from gossamer_models.automatic import choice as compensators
from gossamer_models.automatic.choice import OPTIMISM, calibrated, error_model, motion
from gossamer_models.automatic.trials import Bench, error_on, shortened
from gossamer_models.compensator.particle import DELAY
from gossamer_models.fitting.records import FITTED, cut
from gossamer_models.identify import settings_for
from gossamer_models.replay import recover_by_fit
from gossamer_models.sensor.artifact import DEFAULT_TRACKING
from gossamer_models.sensor.fit.align import align
from oracles.records import everything, record, zigzag


def half(r):
    return (np.arange(r.time.size) < r.time.size // 2,)


def plays(strain, width=0.1):
    out = np.empty_like(strain)
    level = strain[0]
    for k, s in enumerate(strain):
        out[k] = level = max(s - width, min(s + width, level))
    return out


def test_a_cut_keeps_the_order_of_time_and_every_training_sample():
    rows = np.zeros(50, dtype=bool)
    rows[10:40] = True
    early, late = cut([rows], 0.6)
    assert np.flatnonzero(early[0]).tolist() == list(range(10, 28))
    assert ((early[0] ^ late[0]) == rows).all()


def test_records_that_are_too_long_are_thinned_with_their_training_samples():
    r = record(zigzag(turns=800, per=14), np.arange(800 * 13 + 1.0))
    (short,), (rows,) = shortened((r,), half(r))
    assert short.time.size < 4100
    assert (short.time[rows] <= r.time[half(r)[0]].max()).all()
    assert (short.time[~rows] > r.time[half(r)[0]].max()).all()


def test_the_error_model_of_a_known_process_is_found():
    """White noise of 0.02 plus a first-order process of 0.05 with a correlation time of 40 samples of 0.1 s."""
    rng, n, left = np.random.default_rng(0), 40_000, np.exp(-1.0 / 40.0)
    slow = np.zeros(n)
    for k in range(1, n):
        slow[k] = left * slow[k - 1] + 0.05 * np.sqrt(1.0 - left**2) * rng.standard_normal()
    model = error_model([slow + 0.02 * rng.standard_normal(n)], 0.1)
    assert (model.white, model.slow, model.time) == (
        pytest.approx(0.0225, rel=0.05),  # the slow part adds a little to the difference of neighbours
        pytest.approx(0.05, rel=0.1),
        pytest.approx(4.0, rel=0.2),
    )


def test_the_motion_of_a_triangle_with_rests_is_found():
    one = np.concatenate([np.linspace(0, 1, 101), np.ones(100), np.linspace(1, 0, 101), np.zeros(100)])
    strain = np.tile(one, 4)
    found = motion([0.1 * np.arange(strain.size)], [strain], 0.1)
    assert found["rate"] == pytest.approx(0.1, rel=0.01)
    assert found["hold"] == pytest.approx(0.5, abs=0.05)
    assert found["turns"] == pytest.approx(4 / 40.2, rel=0.5)


def test_a_calibrated_deviation_is_larger_than_the_errors_of_the_trials_by_a_fixed_factor():
    rng = np.random.default_rng(0)
    scatter, errors = rng.uniform(0.01, 0.03, 1000), 0.04 * rng.standard_normal(1000)
    start = replace(DEFAULT_TRACKING, floor=1e-6)
    numbers = calibrated(start, errors, scatter)
    stated = np.sqrt(numbers.factor**2 * scatter**2 + numbers.floor**2)
    assert np.sqrt(np.mean(stated**2)) == pytest.approx(OPTIMISM * np.sqrt(np.mean(errors**2)), rel=1e-3)


def test_the_geometric_mean_over_the_cuts_chooses_and_what_cannot_be_fitted_is_left_out():
    def first(setting):
        if setting == "broken":
            msg = "no fit"
            raise DataError(msg)
        return {"a": 1.0, "b": 1.1, "c": 9.0}[setting]

    bench = Bench(lambda _share, _text: None, np.inf)
    found = bench.best(
        "stage", ["broken", "a", "b", "c"], str, [first, lambda s: {"a": 4.0, "b": 1.1, "c": 9.0}[s]], share=(0, 1)
    )
    assert found == [(pytest.approx(1.1), "b"), (pytest.approx(2.0), "a"), (pytest.approx(9.0), "c")]
    assert np.isnan(next(t for t in bench.trials if t.what == "broken").error)


def test_a_baseline_that_is_better_is_said_in_words():
    """A sensor that predicts the mean loses to a cubic on an output that is a cubic of strain."""
    strain = zigzag()
    strain[1:3] = strain.max(), strain.min()  # both ends are in the training stretch: beyond them a baseline is held
    r = record(strain, 2.0 + strain + strain**3)
    table = standings((r,), half(r), (np.full(strain.size, r.resistance.mean()),), ())
    assert [each.model for each in table] == [HERE, "static cubic", "regression on lags"]
    assert table[1].forward[0] < 1e-9
    low, high = table[0].forward[1:]
    assert low < table[0].forward[0] < high
    assert (
        "a static cubic predicts the output of the test stretch better than this sensor, 0.00 against" in defeats(table)[0]
    )


def test_a_baseline_whose_interval_overlaps_that_of_the_sensor_is_as_good_or_has_less_error_but_is_not_better():
    def named(model, error):
        return Standing(record="r", model=model, forward=error, strain=None)

    (sentence,) = defeats((named(HERE, (0.871, 0.8, 0.95)), named("static cubic", (0.866, 0.79, 0.94))))
    assert "as well as this sensor, 0.87 against 0.87 % of range: the intervals of confidence overlap." in sentence
    assert defeats((named(HERE, (0.871, 0.8, 0.95)), named("static cubic", (0.88, 0.8, 0.94)))) == ()
    (sentence,) = defeats((named(HERE, (3.1, 1.9, 4.0)), named("regression on lags", (1.62, 1.2, 2.0))))
    assert "with less error than this sensor, 1.62 against 3.10 % of range, though the intervals" in sentence


STRAIN = zigzag(turns=24, per=12)
PLAY = record(STRAIN, 3.0 + 0.3 * STRAIN + plays(STRAIN))


@pytest.fixture(scope="module")
def hasty():
    """A choice without time: of every stage what is tried first."""
    shares = []
    chosen = choose((PLAY,), half(PLAY), full_scale=1.0, budget=1e-6, progress=lambda share, _text: shares.append(share))
    return chosen, shares


def test_nothing_that_comes_after_the_training_stretch_is_seen(hasty):
    first, (rows,) = hasty[0], half(PLAY)
    changed = {"resistance": np.where(rows, PLAY.resistance, 3.0), "strain": np.where(rows, STRAIN, 0.5)}
    other = choose((replace(PLAY, **changed),), (rows,), full_scale=1.0, budget=1e-6)
    assert [(t.what, t.error) for t in first.trials] == [(t.what, t.error) for t in other.trials]
    assert first.fit.artifact == other.fit.artifact


def test_a_machine_that_is_ten_times_as_slow_chooses_the_same_sensor_to_the_bit(monkeypatch):
    """Few settings, so that it takes seconds; two processes that spin take the cores meanwhile."""
    monkeypatch.setattr("gossamer_models.automatic.sensors.EXTENSIONS", ("reversing",))
    monkeypatch.setattr("gossamer_models.automatic.sensors.RIDGES", ())
    quick = choose((PLAY,), half(PLAY), full_scale=1.0)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    try:
        clock = time.monotonic
        monkeypatch.setattr("time.monotonic", lambda: 10.0 * clock())
        slow = choose((PLAY,), half(PLAY), full_scale=1.0, budget=1e4)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert [(t.what, t.error) for t in quick.trials] == [(t.what, t.error) for t in slow.trials]
    assert quick.untried == slow.untried == 0
    assert quick.fit.artifact == slow.fit.artifact


def test_what_is_chosen_recovers_strain_better_than_a_cubic(hasty):
    chosen, shares = hasty
    assert shares == sorted(shares)
    assert {t.stage for t in chosen.trials} == {"sensor", "direct inverse", "compensator"}
    assert chosen.fit.artifact.compensator == chosen.method.name
    assert chosen.fit.artifact.tracking is not None
    found = recover_by_fit(chosen.fit, PLAY)
    rivals = standings((PLAY,), half(PLAY), (PLAY.resistance,), (found,))
    assert error_on([found.strain], [STRAIN], [~half(PLAY)[0]]) < rivals[1].strain[0]


def test_the_direct_inverse_is_a_finalist_beside_the_filter_however_little_time_there_is(hasty):
    finalists = {trial.what: trial.error for trial in hasty[0].trials if trial.stage == "compensator" and trial.final}
    assert len(finalists) == 2
    assert "direct inverse" in finalists
    kept = compensators.NEAR * min(finalists.values())
    assert finalists[hasty[0].method.text] <= kept


def test_what_is_chosen_is_said_in_the_words_of_the_options(hasty):
    words = hasty[0].text
    assert re.match(r"sensor: extension reversing, .*ridge [\d.]+.*, with an error of [\d.]+ % of range, ", words)
    for stage in ("sensor", "compensator"):
        count = sum(trial.stage == stage and trial.final for trial in hasty[0].trials)
        assert (f"of {count} finalists" if count > 1 else "the only finalist") in words
    method = compensators.Method(sensor=hasty[0].fit.settings, name="filter", direct=True)
    assert method.text.endswith("with direct inverse, trusting its models less")
    assert replace(method, tail=compensators.SURE, wander=compensators.CALM).text.endswith("trusting its models more")


def test_the_stated_deviation_is_scaled_to_what_every_cut_predicts(monkeypatch):
    given = []

    def watched(tracking, errors, stated):
        given.append(errors.size)
        return calibrated(tracking, errors, stated)

    monkeypatch.setattr(compensators, "calibrated", watched)
    choose((PLAY,), half(PLAY), full_scale=1.0, budget=1e-6)
    predicted = [int(rows.sum()) for share in FITTED for rows in cut(half(PLAY), share)[1]]
    assert given == [sum(predicted) - DELAY * len(FITTED)]  # what the filter delivers before a trial ends


def test_records_of_one_sensor_are_brought_to_the_scale_of_the_first_and_weighted_by_their_noise():
    """The second is 7 + 2.5 times the first sensor's, with noise of 3 % of its range."""
    strains = zigzag(turns=14, per=12), zigzag(seed=8, turns=14, per=12)
    noise = 0.08 * np.random.default_rng(0).standard_normal(strains[1].size)
    records = (
        record(strains[0], 3.0 + 0.3 * strains[0] + plays(strains[0]), name="first"),
        record(strains[1], 7.0 + 2.5 * (3.0 + 0.3 * strains[1] + plays(strains[1])) + noise, name="second"),
    )
    rows = tuple(everything(r)[0] for r in records)
    settings = settings_for("preisach-hats", knots=5, relaxations=0, starts=1)
    aligned, scales = align(records, rows, settings, full_scale=1.0)
    assert (scales[0].offset, scales[0].gain) == (0.0, 1.0)
    assert scales[1].gain == pytest.approx(2.5, rel=0.03)
    assert scales[1].offset + 3.5 * scales[1].gain == pytest.approx(7.0 + 2.5 * 3.5, abs=0.03)
    assert aligned[1].weight < 0.5 * aligned[0].weight
    falling = replace(records[1], resistance=-records[1].resistance)
    with pytest.raises(DataError, match=r"second does not follow first.*Leave it out"):
        align((records[0], falling), rows, settings, full_scale=1.0)


def test_a_record_too_short_to_be_cut_is_refused_with_the_remedy():
    strain = zigzag(turns=5, per=12)
    r = record(strain, 1.0 + strain)
    with pytest.raises(DataError, match="Name a longer one"):
        choose((r,), everything(r), full_scale=1.0)
