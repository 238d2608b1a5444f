"""The watch that needs no simulation: its statistics are those of the watch on the ground, and what it does with samples."""

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ParameterError, Stepper
from gossamer_models.membrane import square_structure
from gossamer_models.twin.evidence import Evidence
from gossamer_models.twin.on_board import (
    LAGS,
    LEARNING,
    StoredResponses,
    StoredWindows,
    example_strain,
    stored_responses,
    watch_model,
)
from gossamer_models.variables import pack, unpack
from scipy.special import chdtri

SENSORS, ZONES, LASTING, WINDOWS, SAMPLES = 2, 3, 4, 2, 30  # of a period, and of a window
NOISE, FALSE_ALARMS = 1e-3, 1e-5


@pytest.fixture(scope="module")
def stored():
    """Any responses: the law is that of linear models."""
    random = np.random.default_rng(3)
    shape = (SENSORS, WINDOWS * SAMPLES)
    return StoredResponses(
        zones=("a", "b", "c"),
        step=1e-3,
        windows=WINDOWS,
        healthy=0.1 * random.standard_normal(shape),
        lasting=2e-3 * random.standard_normal((LASTING, *shape)),
        slopes=2e-2 * random.standard_normal((ZONES, *shape)),
    )


def readings(stored, count, random, damage=0.0, since=0):
    """Strain of windows from the start of a period, with a sample before, a lasting nuisance and an offset."""
    at = np.arange(-1, count * SAMPLES)
    column = at % stored.healthy.shape[1]
    strain = stored.healthy[:, column] + np.tensordot(random.standard_normal(LASTING), stored.lasting[:, :, column], 1)
    strain += damage * (at >= since * SAMPLES) * stored.slopes[1][:, column] + 0.05
    return strain + NOISE * random.standard_normal(strain.shape)


def watched(stored, strain, skip=()):
    """Results of each sample, by name."""
    stepper = Stepper(watch_model(stored, NOISE, FALSE_ALARMS))
    names = stepper.model.names[stepper.model.slices()[2].start :]
    rows, wait = [], 1
    for k, sample in enumerate(strain.T):
        if k in skip:
            wait += 1
            continue
        for i, value in enumerate(sample, start=1):
            stepper.set(f"strain[{i}]", float(value))
        stepper.step(wait * stored.step) if k else stepper.initialize()
        wait = 1
        rows.append([stepper.get(name) for name in names])
    return dict(zip(names, np.array(rows).T, strict=True))


def test_its_scores_are_those_of_the_watch_on_the_ground(stored):
    count = LAGS[-1]
    strain = readings(stored, count, np.random.default_rng(1), 0.01, 6)
    found = watched(stored, strain)
    changes = np.concatenate([stored.lasting, stored.slopes])
    evidence, stay = Evidence(np.zeros(LASTING), ZONES), np.arange(0)
    means = []
    for window in range(count):
        columns = (window % WINDOWS) * SAMPLES + np.arange(SAMPLES)
        own = changes[:, :, columns] / NOISE
        r = (strain[:, 1 + window * SAMPLES :][:, :SAMPLES] - stored.healthy[:, columns]) / NOISE
        own, r = own - own.mean(axis=2, keepdims=True), r - r.mean(axis=1, keepdims=True)
        J = own.reshape(len(own), -1).T
        evidence.add(r.ravel(), np.hstack([J[:, :LASTING], *[J[:, LASTING:]] * (window + 1)]), stay)
        stay = np.arange(window + 1)
        ago = [window + 1 - lag for lag in LAGS if lag <= window + 1]
        scores = evidence.scores[ago]
        # an onset before the first window is one at its beginning
        means.append(np.concatenate([scores, np.repeat(evidence.scores[:1], len(LAGS) - len(ago), axis=0)]).mean())
        scale = max(1.0, *means[: LEARNING - 1])
        expected = evidence.scores[[*ago, 0]].max(axis=0) / scale / chdtri(1.0, FALSE_ALARMS / (len(LAGS) * ZONES))
        at = (window + 1) * SAMPLES
        assert [found[f"evidence[{z}]"][at] for z in (1, 2, 3)] == pytest.approx(expected, rel=1e-9)


def test_an_alarm_comes_with_damage_and_stays_and_not_without(stored):
    random = np.random.default_rng(2)
    healthy, damaged = (watched(stored, readings(stored, 40, random, damage, 30)) for damage in (0.0, 0.05))
    assert not healthy["alarm"].any()
    first = int(np.flatnonzero(damaged["alarm"])[0])
    assert 30 * SAMPLES < first <= 32 * SAMPLES
    assert damaged["alarm"][first:].all()
    assert damaged["sees"][first - 1] < 0.05
    assert healthy["misfit"][-1] == pytest.approx(1.0, abs=0.4)


def test_statistics_are_no_larger_than_their_law_where_nothing_changes(stored):
    """Chi2 of one degree of freedom, largest of four onsets: of 2000 streams between 1/4 and 1 of 5 % are above."""
    windows, random, streams = StoredWindows(stored, np.full(SENSORS, NOISE), FALSE_ALARMS), np.random.default_rng(4), 2000
    like = windows.start()
    x, g, kind = ca.MX.sym("x", pack(like).numel()), ca.MX.sym("g", LASTING + ZONES), ca.MX.sym("kind")
    after = windows.judge(unpack(like, x), g, ca.MX(0.0), kind)
    judge = ca.Function("judge", [x, g, kind], [pack(after), after.said.evidence * after.scale]).map(streams)
    state, p = np.tile(np.array(ca.evalf(pack(like))), streams), random.standard_normal((LASTING, streams))
    for window in range(30):
        G = windows.information[window % WINDOWS]
        sums = G[:, :LASTING] @ p + np.linalg.cholesky(G) @ random.standard_normal((len(G), streams))
        state, evidence = map(np.array, judge(state, sums, float(window % WINDOWS)))
    share = np.mean(evidence * chdtri(1.0, FALSE_ALARMS / (len(LAGS) * ZONES)) > chdtri(1.0, 0.05 / len(LAGS)), axis=1)
    assert (share > 0.0125).all()
    assert (share < 0.05).all()


def test_a_window_with_a_missing_sample_is_not_counted_and_the_next_one_is(stored):
    strain = readings(stored, 12, np.random.default_rng(5))
    missing = 8 * SAMPLES + 7
    found, whole = watched(stored, strain, {missing}), watched(stored, strain)
    assert found["valid"][9 * SAMPLES - 1] == 0.0  # one row less
    assert found["evidence[1]"][9 * SAMPLES - 1] == whole["evidence[1]"][8 * SAMPLES]
    assert found["valid"][10 * SAMPLES - 1] == 1.0


def test_a_start_in_the_middle_of_a_window_waits_for_the_next(stored):
    strain = readings(stored, 8, np.random.default_rng(6))
    stepper = Stepper(watch_model(stored, NOISE))
    stepper.set("start_time", 10 * stored.step)
    stepper.set("delay", 3 * stored.step)
    seen = []
    for k, sample in enumerate(strain[:, 7:].T):
        for i, value in enumerate(sample, start=1):
            stepper.set(f"strain[{i}]", float(value))
        stepper.step(stored.step) if k else stepper.initialize()
        seen.append(stepper.get("misfit"))
    assert not any(seen[: 2 * SAMPLES - 7])
    assert seen[2 * SAMPLES - 7] == pytest.approx(1.0, abs=0.6)


def test_the_example_of_a_membrane_raises_an_alarm_of_its_zone():
    stored = stored_responses(square_structure(8, 1), exact_mesh=True)
    n = stored.healthy.shape[1] // stored.windows
    assert stored.step == pytest.approx(3e-4, rel=1e-2)
    assert n * stored.windows * stored.step == pytest.approx(1.0 / 7.9)
    strain = example_strain(stored, NOISE)
    found = watched(stored, strain)
    assert np.flatnonzero(found["alarm"])[0] == strain.shape[1] - 1 - 2 * n  # one window after the onset
    assert max(found[f"evidence[{z}]"][-1] for z in range(1, 17)) == found["evidence[1]"][-1]


def test_a_load_that_does_not_repeat_and_noise_that_is_none_are_refused(stored):
    with pytest.raises(ParameterError, match="needs a load that repeats"):
        stored_responses(square_structure(4, 1), parameters={"pressure_amplitude": 0.0})
    with pytest.raises(ParameterError, match="Shorten the step"):
        stored_responses(square_structure(4, 1), step=0.01)
    with pytest.raises(ParameterError, match="positive noise"):
        watch_model(stored, 0.0)
