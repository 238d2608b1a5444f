"""The digital twin: exact where it can be, calibrated under noise, and silent about nothing that is wrong."""

import json
from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import DataError, ParameterError
from gossamer_models.membrane import MembraneParams, square_structure
from gossamer_models.sensor import default_artifact
from gossamer_models.twin import MembraneForward, ResponseRecord, Twin, make_record, read_loads, read_table
from gossamer_models.twin.discrepancy import SPACING, Discrepancy, is_load_learned
from gossamer_models.twin.nuisances import BY_DEFAULT
from gossamer_models.twin.record import StaticRecord, dead_sensors, less_healthy
from gossamer_models.twin.simulation import SensedForward

pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")

MESH = (4, 1)  # bilinear elements of one zone each: another membrane, but a fast one
SQUARE = square_structure(*MESH)
STEP, STEPS = 3e-4, 600
NOISE = 0.02 / np.sqrt(12.0)  # of the thesis' U(0, 0.02)


@pytest.fixture(scope="module")
def forward():
    return SensedForward(MembraneForward(SQUARE), default_artifact())


@pytest.fixture(scope="module")
def twin():
    return Twin(SQUARE, sensor=default_artifact())


def damage(**zones):
    found = np.zeros(16)
    for zone, value in zones.items():
        found[int(zone[1:]) - 1] = value
    return found


def strain(forward, damages, noise=0.0, seed=0, **parameters):
    given_ = {name: np.array([value]) for name, value in parameters.items()}
    found = forward.forward.strain(damages[None], given_, {}, STEPS, STEP)[0]
    return found + noise * np.random.default_rng(seed).random(found.shape)


TWO = damage(z6=0.3, z11=0.15)


def test_without_noise_the_damage_is_exact_and_how_far_it_is_was_said(forward, twin):
    said = []
    answer = twin.fit(
        ResponseRecord(step=STEP, values=strain(forward, TWO), noise=1e-6), report=lambda *each: said.append(each)
    )
    np.testing.assert_allclose(answer.damage, TWO, atol=1e-6)
    lengths = sorted({seconds for seconds, _ in said})
    assert lengths[-1] == pytest.approx(STEPS * STEP)
    assert all(0 < made < answer.simulations for seconds, made in said[-3:])
    assert answer.valid
    assert answer.left_out == ()
    assert answer.doubts == ()


def test_all_zones_at_once_are_exact_without_noise(forward):
    many = np.linspace(0.0, 0.6, 16)[np.random.default_rng(1).permutation(16)]
    twin = Twin(SQUARE, sparse=False, known=BY_DEFAULT)
    answer = twin.fit(ResponseRecord(step=STEP, values=strain(forward, many), noise=1e-5))
    np.testing.assert_allclose(answer.damage, many, atol=1e-5)


def test_errors_under_noise_are_as_large_as_stated(forward, twin):
    """Twelve records of two to four damaged zones: z is a standard normal number."""
    random, z, valid = np.random.default_rng(5), [], 0
    for seed in range(12):
        true = np.zeros(16)
        zones = random.choice(16, random.integers(2, 5), replace=False)
        true[zones] = random.uniform(0.1, 0.5, zones.size)
        answer = twin.fit(ResponseRecord(step=STEP, values=strain(forward, true, 0.02, seed), noise=NOISE))
        z.extend(((answer.damage - true) / answer.deviation)[zones])
        valid += answer.valid
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.4
    assert valid == 12


def test_noise_is_estimated_from_the_record_itself(forward, twin):
    record = ResponseRecord(step=STEP, values=strain(forward, TWO, 0.02))
    np.testing.assert_allclose(record.noise_deviation(), NOISE, rtol=0.15)
    answer = twin.fit(record)
    assert answer.valid
    np.testing.assert_allclose(answer.damage, TWO, atol=0.03)


def test_load_and_damping_are_found_with_the_damage(forward):
    values = strain(forward, TWO, 0.02, pressure_amplitude=1.07e4, pressure_frequency=7.7, mass_damping=30.0)
    twin = Twin(SQUARE, nuisances=("offset", "amplitude", "frequency", "damping"))
    answer = twin.fit(ResponseRecord(step=STEP, values=values, noise=NOISE))
    assert answer.valid
    np.testing.assert_allclose(answer.damage, TWO, atol=0.03)
    for name, true in (("amplitude", 1.07), ("frequency", 7.7 / 7.9), ("damping", 1.5), ("offset[1]", 0.01)):
        value, deviation = answer.nuisances[name]
        assert abs(value - true) < 4.0 * deviation, name


def test_a_gain_and_a_phase_are_found_with_the_damage(forward):
    values = strain(forward, TWO, pressure_phase=0.06)
    values[2] *= 1.015
    answer = Twin(SQUARE, nuisances=("gain", "phase")).fit(ResponseRecord(step=STEP, values=values, noise=1e-4))
    np.testing.assert_allclose(answer.damage, TWO, atol=2e-3)
    assert answer.nuisances["gain[3]"][0] == pytest.approx(1.015, abs=2e-3)
    assert answer.nuisances["phase"][0] == pytest.approx(0.06, abs=2e-3)


def test_an_unknown_pressure_is_found_with_the_damage(forward):
    """The twin's own load is off; all of the pressure, 10 kPa at 7.9 Hz, is unknown."""
    answer = Twin(square_structure(*MESH, params=MembraneParams(pressure_phase=np.pi / 3)), nuisances=("pressure",)).fit(
        ResponseRecord(step=STEP, values=strain(forward, TWO)[:, :300], noise=1e-3)
    )
    assert answer.valid
    np.testing.assert_allclose(answer.damage, TWO, atol=0.03)


def test_on_resistance_the_sensor_runs_inside_the_twin(forward, twin):
    resistance = forward.resistance(strain(forward, TWO)[None], STEP)[0]
    noise = 1e-3 * forward.bank.parameters["full_scale_resistance_change"][:, None]
    noisy = resistance + noise * np.random.default_rng(3).standard_normal(resistance.shape)
    answer = twin.fit(ResponseRecord(step=STEP, values=noisy, kind="resistance"))
    assert answer.valid
    np.testing.assert_allclose(answer.damage, TWO, atol=0.01)


@pytest.mark.parametrize(
    ("name", "true", "parameters"),
    [
        ("amplitude", 0.97, {"pressure_amplitude": 0.97e4}),
        ("frequency", 1.02, {"pressure_frequency": 7.9 * 1.02}),
        ("damping", 1.5, {"mass_damping": 30.0}),
        ("modulus", 0.95, {"youngs_modulus": 0.95e7}),
        ("density", 1.05, {"density": 1155.0}),
        ("prestrain", 0.95, {"edge_displacement": 0.0057}),
        ("gain[2]", 0.95, {}),
        ("clock", 2.0, {}),
    ],
)
def test_what_is_off_beside_the_damage_is_allowed_for_and_told(forward, twin, name, true, parameters):
    """The twin is told nothing; what is off by more than two deviations of its prior is said."""
    values = strain(forward, TWO, 2e-3, **parameters)
    values[1] *= true if name == "gain[2]" else 1.0
    if name == "clock":
        values = np.hstack([values[:, :1], values[:, :1], values[:, :-2]])
    answer = twin.fit(ResponseRecord(step=STEP, values=values, noise=NOISE / 10.0))
    assert answer.valid
    np.testing.assert_allclose(answer.damage, TWO, atol=0.01)
    value, deviation = answer.nuisances[name]
    assert abs(value - true) < 4.0 * deviation
    told = [each[: len("sensor 2 has a gain of 0.95")] for each in answer.doubts]
    assert told == (["sensor 2 has a gain of 0.95"] if name == "gain[2]" else [])


@pytest.mark.parametrize(
    ("parameters", "gain", "reason"),
    [
        ({"pressure_amplitude": 0.9e4}, 1.0, "most likely the load is 0.9 times as large: with amplitude fitted too"),
        ({"pressure_frequency": 7.6}, 1.0, "most likely the load has 0.962 times the frequency"),
        ({"mass_damping": 30.0}, 1.0, "most likely the damping is 1.5"),
        ({}, 0.97, "most likely sensor 1 has a gain of 0.97"),
    ],
)
def test_what_is_wrong_beside_the_damage_is_not_valid_and_named(forward, parameters, gain, reason):
    """Where it was said to be known."""
    values = gain * strain(forward, TWO, 2e-3, **parameters)
    answer = Twin(SQUARE, nuisances=("offset",), known=BY_DEFAULT).fit(
        ResponseRecord(step=STEP, values=values, noise=NOISE / 10.0)
    )
    assert not answer.valid
    assert answer.doubts[0].startswith(reason)
    assert "does not explain the record" in answer.doubts[-1]


def test_zones_that_are_not_determined_have_bounds_and_what_is_not_valid_is_withheld(forward, twin):
    answer = twin.fit(ResponseRecord(step=STEP, values=strain(forward, TWO, 0.02), noise=NOISE))
    doubtful = replace(answer, deviation=np.where(TWO == 0.15, 0.03, answer.deviation))
    assert answer.determined[[5, 10]].all()
    assert answer.as_json()["damage"][10] == answer.damage[10]
    assert not doubtful.determined[10]
    assert doubtful.as_json()["damage"][10] is None
    np.testing.assert_allclose(doubtful.bounds[10], answer.damage[10] + [-1.96 * 0.03, 1.96 * 0.03])
    untold = replace(answer, unresolved=(3,))
    assert untold.bounds[2].tolist() == [0.0, 1.0]
    assert not untold.determined[2]
    wrong = replace(answer, valid=False)
    assert wrong.as_json()["damage"] is None
    assert wrong.as_json(show_invalid=True)["damage"][10] == answer.damage[10]


def test_a_softer_membrane_is_no_damage_of_all_zones(forward):
    """Young's modulus and equal damage everywhere are the same to a record."""
    record = ResponseRecord(step=STEP, values=strain(forward, np.zeros(16), youngs_modulus=0.97e7), noise=1e-4)
    answer = Twin(SQUARE).fit(record)
    assert answer.valid
    assert not answer.damage.any()
    value, deviation = answer.nuisances["modulus"]
    assert abs(value - 0.97) < 3.0 * deviation < 0.06
    answer = Twin(SQUARE, known=[name for name in BY_DEFAULT if name not in ("modulus", "offset")]).fit(record)
    assert answer.valid
    assert not answer.damage.any()
    assert answer.nuisances["modulus"][0] == pytest.approx(0.97, abs=1e-3)
    everywhere = Twin(SQUARE, sparse=False).fit(record)
    assert np.all(everywhere.damage < 3.0 * everywhere.deviation)


def test_gaps_and_a_dead_sensor_are_left_out(forward, twin):
    values = strain(forward, TWO)
    values[1] = 0.02
    values[0, 100:150] = np.nan
    values[3, ::17] = np.nan
    answer = twin.fit(ResponseRecord(step=STEP, values=values, noise=1e-5))
    np.testing.assert_allclose(answer.damage, TWO, atol=1e-4)
    assert answer.valid
    assert answer.left_out == (2,)
    assert answer.doubts == ("sensor 2 does not move and is left out",)


def test_a_wrong_sensor_is_recognised_and_left_out(forward, twin):
    values = strain(forward, TWO)
    values[2] *= 1.2
    answer = twin.fit(ResponseRecord(step=STEP, values=values, noise=1e-3))
    np.testing.assert_allclose(answer.damage, TWO, atol=0.02)
    assert answer.left_out == (3,)
    assert "sensor 3 contradicts the others" in answer.doubts[0]


def test_swapped_sensors_are_recognised_and_the_answer_is_not_valid(forward, twin):
    """A mirrored damage cannot be told apart, so the answer cannot be used."""
    values = strain(forward, TWO)[[2, 1, 0, 3]]
    answer = twin.fit(ResponseRecord(step=STEP, values=values, noise=1e-3))
    assert answer.order == (3, 2, 1, 4)
    assert not answer.valid
    assert "1 and 3, or 2 and 4" in answer.doubts[0]


def test_a_short_record_says_which_zones_it_cannot_tell(forward, twin):
    values = strain(forward, TWO, 0.02)[:, :60]
    answer = twin.fit(ResponseRecord(step=STEP, values=values, noise=NOISE))
    assert len(answer.unresolved) > 4
    assert twin.fit(ResponseRecord(step=STEP, values=strain(forward, TWO, 0.02), noise=NOISE)).unresolved == ()


def test_an_answer_is_written_as_json(forward, twin):
    answer = twin.fit(ResponseRecord(step=STEP, values=strain(forward, TWO), noise=1e-4))
    text = json.loads(json.dumps(answer.as_json()))
    np.testing.assert_array_equal(text["damage"], answer.damage)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"values": np.zeros(100)}, "one row for each sensor"),
        ({"values": np.zeros((4, 10))}, "needs 60 or more"),
        ({"values": np.full((4, 100), np.inf)}, "infinite"),
        ({"step": 0.0}, "positive time"),
        ({"noise": -1.0}, "positive deviation"),
        ({"kind": "stress"}, "'stress'"),
    ],
)
def test_a_record_without_meaning_is_refused(wrong, message):
    with pytest.raises(DataError, match=message):
        ResponseRecord(**{"step": STEP, "values": np.random.default_rng(0).random((4, 100)), **wrong})


def test_what_the_twin_cannot_fit_is_refused(forward, twin):
    record = ResponseRecord(step=STEP, values=strain(forward, TWO), kind="resistance")
    with pytest.raises(ParameterError, match="has no sensor"):
        Twin(SQUARE).fit(record)
    with pytest.raises(ParameterError, match="no nuisance 'colour'"):
        Twin(SQUARE, nuisances=("colour",))
    with pytest.raises(DataError, match="one row for each of 4 sensors"):
        twin.fit(replace(record, values=record.values[:3]))
    with pytest.raises(DataError, match="no sensor has values that move"):
        twin.fit(ResponseRecord(step=STEP, values=np.full((4, 100), 0.02)))


def test_a_sensor_that_does_not_move_is_dead():
    values = np.random.default_rng(0).random((4, 100))
    values[2], values[3] = 1e-3, np.nan
    assert dead_sensors(ResponseRecord(step=STEP, values=values)) == [2]


def test_tables_are_read_by_the_names_of_their_columns(tmp_path):
    path = tmp_path / "r.csv"
    rows = [f"{k * 1e-3},{k},{k + 1},,{k + 3}" for k in range(101) if k != 50]
    path.write_text("\n".join(["time [s],strain[1] [1],strain[2] [1],strain[3],strain[4] [1]", *rows]))
    record = read_table(path)
    assert record.step == pytest.approx(1e-3)
    assert record.samples == 100  # the sample of time 0 is the membrane at rest
    assert record.sensors == [0, 1, 3]
    assert np.isnan(record.values[0, 49])
    assert record.values[1, 50] == 52


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,load\n0,1\n", "line 1: the twin needs the columns time and"),
        ("", "it is empty"),
        ("time,strain[1],resistance[1]\n0,1,2\n", "kind="),
        ("time,strain[1]\n0,1\n0.1,abc\n", "line 3: 'abc'"),
        ("time,strain[1]\n0,1\n0.1,1\n0.1,1\n", "line 4: 0.1 s stands twice"),
        ("time,strain[1],strain[5]\n0,1,1\n", r"'strain\[5\]' is of none of the 4 sensors"),
        ("time,strain[1],strain[1] [%]\n0,1,1\n", r"'strain\[1\]' stands twice"),
        ("time,strain[1]\n5.03,1\n5.1,1\n5.2,1\n5.3,1\n", "no multiples of one step"),
        ("time [s],strain[1]\n-1,1\n0,1\n", "begin at -1 s"),
        ("time,strain[1]\n0,1\n0.1,1\n", "needs 60 or more"),
    ],
)
def test_a_table_that_is_no_record_is_refused(tmp_path, text, message):
    path = tmp_path / "r.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=message):
        read_table(path)


def test_loads_alone_are_read_over_time_or_by_state(tmp_path):
    """Units are those of the columns; a table whose last row is the first again is repeated after it, else a step later."""
    path = tmp_path / "loads.csv"
    path.write_text("time [ms],pressure [kPa],base_acceleration [m/s2]\n100,0,0\n101,1,0.5\n103,0,0\n")
    table = read_loads(path, square_structure())
    assert table.time == pytest.approx((0.0, 1e-3, 3e-3))
    assert table.values["pressure"] == pytest.approx((0.0, 1e3, 0.0))
    acting = table.loads(6, 1e-3)
    assert acting.start == {"pressure": 0.0, "base_acceleration": 0.0}
    np.testing.assert_allclose(acting.histories["pressure"], [1e3, 500.0, 0.0, 1e3, 500.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(acting.histories["base_acceleration"][0], 0.5)
    path.write_text("time [s],pressure [Pa]\n0,0\n1,1\n2,2\n")
    assert read_loads(path, square_structure()).length == 3.0
    path.write_text("state,pressure [Pa]\na,1\nb,2\n")
    assert read_loads(path, square_structure()).loads(2, 0.0).histories["pressure"].tolist() == [1.0, 2.0]
    for text, message in (
        ("state,pressure [Pa]\na,1\na,2\n", "a name of its own for each state"),
        ("time [s],pressure\n0,1\n1,2\n", r"line 1: column 'pressure' has no unit"),
        ("time [s],pressur [Pa]\n0,1\n1,2\n", "no load 'pressur'. Did you mean 'pressure'"),
        ("time [s],date\n0,1\n1,2\n", "holds no load"),
        ("time [s],pressure [Pa]\n0,1\n2,2\n1,2\n", "line 4: time goes backwards"),
        ("time [s],pressure [Pa]\n0,1\n,2\n2,2\n", "line 3"),
        ("time [s],pressure [Pa]\n0,1\n0,2\n", "line 3: 0 s stands twice"),
    ):
        path.write_text(text)
        with pytest.raises(DataError, match=message):
            read_loads(path, square_structure())


def test_a_record_may_begin_after_the_load():
    time = STEP * np.arange(50, 200)
    record = make_record(time, np.random.default_rng(0).random((4, 150)), "strain", None, "it")
    assert record.samples == 199
    assert not record.present[:, :49].any()


def test_what_the_learned_error_does_not_cover_is_neither_compared_nor_simulated(forward):
    length = 45 * SPACING  # 0.15 of 0.18 s
    none = Discrepancy(elements_per_side=4, order=1, length=length, components=np.zeros((1, 4, 48)), provenance={})
    twin = Twin(SQUARE, discrepancy=none)
    values = strain(forward, TWO, 0.02)
    whole, beginning = (
        twin.fit(ResponseRecord(step=STEP, values=part, noise=NOISE)) for part in (values, values[:, : round(length / STEP)])
    )
    assert whole.valid
    assert (whole.damage == beginning.damage).all()
    assert whole.simulations == beginning.simulations


def test_a_hopeless_record_is_given_up_soon(forward, twin):
    """Noise of a thousandth of that of the record: no damage explains it, and no other start is tried."""
    right = strain(forward, TWO, 0.02)
    wrong = right[:, ::-1]
    given_up, found = (twin.fit(ResponseRecord(step=STEP, values=values, noise=NOISE)) for values in (wrong, right))
    assert not given_up.valid
    assert given_up.simulations < 2 * found.simulations


def test_a_record_in_another_order_takes_the_noise_of_each_sensor_along():
    values = np.arange(180.0).reshape(3, 60)
    noise, correlation = np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.1, 0.2])
    moved = ResponseRecord(step=1e-3, values=values, noise=noise, correlation=correlation).ordered([2, 0, 1])
    assert moved.values.tolist() == values[[2, 0, 1]].tolist()
    assert moved.noise.tolist() == [3.0, 1.0, 2.0]
    assert moved.follows.tolist() == [0.2, 0.0, 0.1]


def test_a_record_under_other_loads_than_the_error_of_the_mesh_was_learned_with_is_not_valid(forward):
    learned = Discrepancy(elements_per_side=4, order=1, length=0.18, components=np.zeros((1, 4, 57)), provenance={})
    load = np.full(STEPS, 5e3)  # half of the built-in one
    values = forward.forward.strain(TWO[None], {}, {"pressure": load}, STEPS, STEP)[0]
    values = values + NOISE * np.random.default_rng(0).standard_normal(values.shape)
    answer = Twin(SQUARE, discrepancy=learned).fit(
        ResponseRecord(step=STEP, values=values, noise=NOISE, inputs={"pressure": load})
    )
    assert not answer.valid
    assert any("the record has other loads beside it" in doubt for doubt in answer.doubts)


@pytest.mark.parametrize(("name", "small", "large"), [("pressure", 1e3, 2e3), ("base_acceleration", 200.0, 2000.0)])
def test_small_loads_beside_the_built_in_one_change_no_error_of_the_mesh(forward, name, small, large):
    for load, learned in ((small, True), (large, False)):
        of_time = ResponseRecord(step=STEP, values=np.ones((4, 60)), inputs={name: np.linspace(0.0, -load, 60)})
        from_start = ResponseRecord(step=STEP, values=np.ones((4, 60)), start={name: load})
        assert is_load_learned(forward.forward, of_time) == is_load_learned(forward.forward, from_start) == learned


def test_too_few_samples_of_what_is_compared_ask_for_a_shorter_step():
    record = ResponseRecord(step=10e-3, values=np.random.default_rng(0).standard_normal((4, 90)))
    with pytest.raises(DataError, match=r"30 samples of the record are compared; the twin needs 60\. Record with a shorter"):
        Twin().fit(record)


def test_likelihoods_of_one_record_with_other_noises_are_compared(twin, forward):
    """Of white noise of deviation s alone, the determinant of n values is s^(2 n)."""
    record = ResponseRecord(step=STEP, values=strain(forward, TWO), noise=NOISE)
    exact = Twin(SQUARE, known=BY_DEFAULT)
    for noise in (np.full(4, NOISE), NOISE * np.arange(1.0, 5.0)):
        determinant = exact._problem(record, noise=noise).log_determinant
        assert determinant == pytest.approx(2.0 * STEPS * np.log(noise).sum())


def test_a_gap_in_a_healthy_reading_of_a_load_state_loses_no_other():
    state = np.repeat([0, 1], 10)
    values = np.add.outer(np.arange(3.0), np.where(state == 0, 1.0, 2.0))
    record = StaticRecord(values=values + 0.5, noise=0.1, state=state, names=("a", "b"))
    healthy = replace(record, values=np.where((np.arange(20) == 4) & (np.arange(3)[:, None] == 1), np.nan, values))
    left = less_healthy(record, healthy, np.zeros((3, 20)))
    assert left.values == pytest.approx(np.full((3, 20), 0.5))
    assert left.noise == pytest.approx(0.1 * np.sqrt([2.0, 1.0 + 10.0 / 9.0, 2.0]))  # ten readings share a mean of nine


def test_noise_that_nobody_has_stated_stays_unknown_beside_a_healthy_record():
    random = np.random.default_rng(0)
    one, other = (ResponseRecord(step=STEP, values=random.standard_normal((4, 2000))) for _ in range(2))
    left = less_healthy(one, other, np.zeros((4, 2000)))
    assert left.noise is None
    assert left.noise_deviation() == pytest.approx(np.full(4, np.sqrt(2.0)), rel=0.15)
