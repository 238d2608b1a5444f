"""The watch that needs no simulation: its statistics are those of the watch on the ground, and what it does with samples."""

import casadi as ca
import numpy as np
import pytest
from gossamer_models import ParameterError, Stepper
from gossamer_models.membrane import square_structure
from gossamer_models.twin.evidence import Evidence
from gossamer_models.twin.on_board import LAGS, StoredWindows, example_inputs, moved, watch_model
from gossamer_models.twin.settled import StoredResponses, stored_responses
from gossamer_models.variables import modulo, pack, unpack
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import chdtri

SENSORS, ZONES, LASTING, WINDOWS, SAMPLES = 2, 3, 4, 2, 30  # of a period, and of a window
NOISE, FALSE_ALARMS = 1e-3, 1e-5


def at_places(rows, places):
    """Rows that repeat at places between their columns, by their waves."""
    N = rows.shape[-1]
    waves = np.fft.rfft(rows) / N
    waves[..., 1:] *= 2.0
    return (waves @ np.exp(2j * np.pi / N * np.outer(np.arange(waves.shape[-1]), places))).real


@pytest.fixture(scope="module")
def stored():
    """Any smooth responses: the law is that of linear models."""
    random = np.random.default_rng(3)
    N = WINDOWS * SAMPLES

    def any_of(*shape):
        waves = np.zeros((*shape, N // 2 + 1), dtype=complex)
        waves[..., 1:7] = random.standard_normal((*shape, 6)) + 1j * random.standard_normal((*shape, 6))
        return np.fft.irfft(waves, N) * N / 4.0

    return StoredResponses(
        zones=("a", "b", "c"),
        step=1e-3,
        windows=WINDOWS,
        healthy=0.1 * any_of(SENSORS),
        lasting=2e-3 * any_of(LASTING, SENSORS),
        slopes=2e-2 * any_of(ZONES, SENSORS),
    )


def readings(stored, count, random, damage=0.0, since=0, drift=0.0, nuisances=1.0):
    """Strain of a period and some windows, with a sample before, lasting nuisances and an offset."""
    at = np.arange(-1, (WINDOWS + count) * SAMPLES)
    place = (1.0 + drift) * at
    strain = at_places(stored.healthy, place)
    strain += np.tensordot(nuisances * random.standard_normal(LASTING), at_places(stored.lasting, place), 1)
    strain += damage * (at >= (WINDOWS + since) * SAMPLES) * at_places(stored.slopes[1], place) + 0.05
    return strain + NOISE * random.standard_normal(strain.shape)


def watched(stored, strain, skip=(), acquire=(), model=None):
    """Results of each sample, by name."""
    stepper = Stepper(model or watch_model(stored, NOISE, FALSE_ALARMS))
    names = stepper.model.names[stepper.model.slices()[2].start :]
    rows, wait = [], 1
    for k, sample in enumerate(strain.T):
        if k in skip:
            wait += 1
            continue
        for i, value in enumerate(sample, start=1):
            stepper.set(f"strain[{i}]", float(value))
        stepper.set("acquire", float(k in acquire))
        stepper.step(wait * stored.step) if k else stepper.initialize()
        wait = 1
        rows.append([stepper.get(name) for name in names])
    return dict(zip(names, np.array(rows).T, strict=True))


def judging(windows):
    """Return the state before the first window, and the function that adds the sums of a window to it."""
    like = windows.start()
    x, g, kind = ca.MX.sym("x", pack(like).numel()), ca.MX.sym("g", LASTING + ZONES), ca.MX.sym("kind")
    squares = ca.MX.sym("squares")
    after = windows.judge(unpack(like, x), g, squares, kind, ca.MX(0.0), ca.MX(1.0))
    said = [after.said.evidence, ca.fmax(1.0, ca.mmax(after.means)), after.said.misfit]
    return np.array(ca.evalf(pack(like))), ca.Function("judge", [x, g, squares, kind], [pack(after), *said])


def test_its_scores_are_those_of_the_watch_on_the_ground(stored):
    """With what a shift of the load and offsets of the sensors change left out of each window."""
    count = LAGS[-1]
    windows = StoredWindows(stored, np.full(SENSORS, NOISE), FALSE_ALARMS)
    strain = readings(stored, count, np.random.default_rng(1), 0.01, 6)[:, 1 + WINDOWS * SAMPLES :]
    changes = np.concatenate([stored.lasting, stored.slopes])
    evidence, stay = Evidence(np.zeros(LASTING), ZONES), np.arange(0)
    state, judge = judging(windows)
    means, misfits = [], []
    for window in range(count):
        columns = (window % WINDOWS) * SAMPLES + np.arange(SAMPLES)
        rows = [*changes[:, :, columns], strain[:, window * SAMPLES :][:, :SAMPLES] - stored.healthy[:, columns]]
        motion = moved(stored.healthy)[0][:, columns]
        rows, motion = (np.array(each) / NOISE for each in (rows, motion))
        rows, motion = (each - each.mean(axis=-1, keepdims=True) for each in (rows, motion))
        rows = rows.reshape(len(rows), -1)
        rows -= np.outer(rows @ motion.ravel(), motion.ravel()) / (motion**2).sum()
        J, r = rows[:-1].T, rows[-1]
        evidence.add(r, np.hstack([J[:, :LASTING], *[J[:, LASTING:]] * (window + 1)]), stay)
        stay = np.arange(window + 1)
        ago = [window + 1 - lag for lag in LAGS if lag <= window + 1]
        scores = evidence.scores[ago]
        # an onset before the first window is one at its beginning
        means.append(np.concatenate([scores, np.repeat(evidence.scores[:1], len(LAGS) - len(ago), axis=0)]).mean())
        state, found, scale, misfit = map(np.array, judge(state, J.T @ r, r @ r, window % WINDOWS))
        misfits.append(misfit.item())
        assert scale.item() == pytest.approx(max(1.0, np.mean(means), np.mean(misfits)))
        assert found.ravel() == pytest.approx(
            evidence.scores[[*ago, 0]].max(axis=0) / scale.item() / chdtri(1.0, FALSE_ALARMS / (len(LAGS) * ZONES)), rel=1e-9
        )


def test_an_alarm_comes_with_damage_and_stays_and_not_without(stored):
    random = np.random.default_rng(2)
    healthy, damaged = (watched(stored, readings(stored, 40, random, damage, 30)) for damage in (0.0, 0.05))
    assert not healthy["alarm"].any()
    first = int(np.flatnonzero(damaged["alarm"])[0]) - WINDOWS * SAMPLES
    assert 30 * SAMPLES < first <= 32 * SAMPLES
    assert damaged["alarm"][WINDOWS * SAMPLES + first :].all()
    assert damaged["sees"][WINDOWS * SAMPLES + first - 1] < 0.05
    assert healthy["misfit"][-1] == pytest.approx(1.0, abs=0.4)


def test_noise_that_is_larger_than_stated_raises_no_alarm(stored):
    """Twice as large: scores are four times as large, but for their scale."""
    strain = readings(stored, 60, np.random.default_rng(9))
    strain += np.sqrt(3.0) * NOISE * np.random.default_rng(10).standard_normal(strain.shape)
    found = watched(stored, strain)
    assert found["misfit"][-1] == pytest.approx(4.0, abs=1.2)
    assert not found["alarm"].any()


@pytest.mark.parametrize("drift", [-2e-4, 0.0, 3e-4])
def test_the_phase_of_the_load_is_found_and_followed(stored, drift):
    """From anywhere in a period; where the board's clock is off the load moves through the table, and no alarm comes."""
    N, count, begin = WINDOWS * SAMPLES, 100, 23
    strain = readings(stored, count, np.random.default_rng(7), drift=drift, nuisances=0.3)[:, begin:]
    model = watch_model(stored, NOISE, FALSE_ALARMS)
    inputs = np.vstack([strain[:, 1:], np.zeros(strain.shape[1] - 1)])
    x = model.init(np.append(strain[:, 0], 0.0), 1.0)[0]
    states, results = map(
        np.array, model.step.mapaccum(inputs.shape[1])(x, inputs, np.ones((1, inputs.shape[1])), stored.step)
    )
    place = (1.0 + drift) * (begin + np.arange(inputs.shape[1]))
    off = (states[0] + states[1] - place + N / 2.0) % N - N / 2.0
    assert abs(off[N : 2 * N]).max() < 0.6
    assert abs(off[-20 * SAMPLES :]).max() < 0.15
    assert not results[0].any()


def test_the_phase_is_sought_anew_when_it_is_wanted_and_what_was_learned_stays(stored):
    random = np.random.default_rng(8)
    strain = readings(stored, 40, random)
    jumped = np.hstack([strain[:, : 20 * SAMPLES], strain[:, 20 * SAMPLES + 17 :]])
    blind, found = watched(stored, jumped), watched(stored, jumped, acquire={20 * SAMPLES})
    assert blind["alarm"].any()
    assert not found["alarm"].any()
    assert not found["valid"][20 * SAMPLES : 22 * SAMPLES - 1].any()
    assert found["valid"][-1] == 1.0


def test_statistics_are_no_larger_than_their_law_where_nothing_changes(stored):
    """Chi2 of one degree of freedom, largest of four onsets: of 2000 streams between 1/4 and 1 of 5 % are above."""
    windows, random, streams = StoredWindows(stored, np.full(SENSORS, NOISE), FALSE_ALARMS), np.random.default_rng(4), 2000
    start, judge = judging(windows)
    judge = judge.map(streams)
    state, p = np.tile(start, streams), random.standard_normal((LASTING, streams))
    for window in range(30):
        G = windows.information[window % WINDOWS]
        sums = G[:, :LASTING] @ p + np.linalg.cholesky(G) @ random.standard_normal((len(G), streams))
        state, evidence, scale, _ = map(np.array, judge(state, sums, 0.0, float(window % WINDOWS)))
    share = np.mean(
        evidence * scale * chdtri(1.0, FALSE_ALARMS / (len(LAGS) * ZONES)) > chdtri(1.0, 0.05 / len(LAGS)), axis=1
    )
    assert (share > 0.0125).all()
    assert (share < 0.05).all()


def test_a_window_with_a_missing_sample_is_not_counted_and_the_next_one_is(stored):
    strain = readings(stored, 20, np.random.default_rng(5))
    missing = (WINDOWS + 15) * SAMPLES + 7
    found, whole = watched(stored, strain, {missing}), watched(stored, strain)
    before, after = (np.flatnonzero(np.diff(each["misfit"])) for each in (found, whole))
    assert whole["valid"][missing:].all()
    assert not found["valid"][missing + SAMPLES - 8 : missing + 2 * SAMPLES - 9].any()
    assert found["valid"][-1] == 1.0
    assert before.size == after.size - 1


def test_a_start_in_the_middle_of_a_window_waits_for_the_next(stored):
    seen = watched(stored, readings(stored, 8, np.random.default_rng(6))[:, 7:])["misfit"]
    first = int(np.flatnonzero(seen)[0])
    assert WINDOWS * SAMPLES + SAMPLES < first < (WINDOWS + 2) * SAMPLES
    assert seen[first] < 2.0


def test_the_example_of_a_membrane_raises_an_alarm_of_its_zone():
    stored = stored_responses(square_structure(8, 1), exact_mesh=True)
    n = stored.healthy.shape[1] // stored.windows
    assert stored.step == pytest.approx(3e-4, rel=1e-2)
    assert n * stored.windows * stored.step == pytest.approx(1.0 / 7.9)
    strain = example_inputs(stored, NOISE)[:-1]
    found = watched(stored, strain, model=watch_model(stored, NOISE))
    assert np.flatnonzero(found["alarm"])[0] == strain.shape[1] - 1 - 2 * n  # one window after the onset
    assert max(found[f"evidence[{z}]"][-1] for z in range(1, 17)) == found["evidence[1]"][-1]


def test_a_load_that_does_not_repeat_and_noise_that_is_none_are_refused(stored):
    with pytest.raises(ParameterError, match="needs a load that repeats"):
        stored_responses(square_structure(4, 1), parameters={"pressure_amplitude": 0.0})
    with pytest.raises(ParameterError, match="Shorten the step"):
        stored_responses(square_structure(4, 1), step=0.01)
    with pytest.raises(ParameterError, match="without damping no response settles"):
        stored_responses(square_structure(4, 1), parameters={"mass_damping": 0.0})
    with pytest.raises(ParameterError, match=r"fade in 2.18e\+05 periods of the load. Raise it"):
        stored_responses(square_structure(4, 1), parameters={"mass_damping": 1e-3})
    with pytest.raises(ParameterError, match="positive noise"):
        watch_model(stored, 0.0)


@pytest.mark.parametrize("damping", [160.0, 1500.0])
def test_a_response_of_much_damping_settles_slowly_too(damping):
    much = {"mass_damping": damping}
    stored = stored_responses(square_structure(4, 1), parameters=much, step=2e-3, exact_mesh=True)
    assert np.ptp(stored.healthy) > 1e-4


@given(whole=st.integers(-5000, 5000), n=st.integers(1, 500))
def test_a_whole_number_modulo_another_is_that_of_python(whole, n):
    assert float(modulo(ca.DM(whole), n)) == whole % n


def test_a_response_of_little_damping_is_simulated_until_it_repeats():
    done = []
    little = {"mass_damping": 1.0, "pressure_amplitude": 10.0}  # the start fades to 1e-6 in 28 s
    stored_responses(square_structure(4, 1), parameters=little, step=2e-3, exact_mesh=True, report=done.append)
    assert 150 < len(done) < 300
    assert 0.9 < done[-1] < 1.0
