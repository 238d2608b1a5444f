"""The twin of any setup: a dish in motion under a measured pressure, a strip at rest against its closed form."""

import numpy as np
import pytest
from gossamer_models import DataError, ParameterError
from gossamer_models.membrane import Load, Region, Sensor, Setup, Support, Zone, make_structure, surface_mesh
from gossamer_models.membrane.portable import read_structure, structure_text
from gossamer_models.sensor import default_artifact
from gossamer_models.twin import MembraneForward, ResponseRecord, StaticRecord, Twin, Watch, read_arriving, read_table
from gossamer_models.twin.groups import alike, untold
from gossamer_models.twin.nuisances import BY_DEFAULT
from gossamer_models.twin.record import best_wiring, other_wirings
from gossamer_models.twin.simulation import SensedForward
from gossamer_models.twin.weights import RecordWeights
from oracles.dish import dish_file, dish_setup
from oracles.meshes import meshed, rectangle

pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")

STEP, STEPS, NOISE = 1e-3, 200, 1e-4
TIME = STEP * np.arange(1, STEPS + 1)
PRESSURE = -500.0 * (1.0 + 0.5 * np.sin(2.0 * np.pi * 12.0 * TIME))
TRUE = np.array([0.0, 0.3, 0.0, 0.0, 0.15])
LENGTH, WIDTH, THICKNESS, MODULUS = 1.0, 0.1, 1e-4, 1e8
LOADS = np.array([2.0, 4.0, 6.0, 8.0])  # N on each of the two nodes at the end


@pytest.fixture(scope="module")
def dish():
    file = dish_file()
    return make_structure(dish_setup(file), surface_mesh(file))


@pytest.fixture(scope="module")
def forward(dish):
    return MembraneForward(dish)


@pytest.fixture(scope="module")
def recorded(forward):
    strain = forward.strain(TRUE[None], {}, {"pressure": PRESSURE}, STEPS, STEP)[0]
    return strain + NOISE * np.random.default_rng(1).standard_normal(strain.shape)


@pytest.fixture(scope="module")
def strip():
    """A strip of four zones in a row, pulled at its end, as wide as one element; Poisson's ratio is zero."""
    groups = {f"part{k}": (lambda x, y, z, k=k: np.floor(4.0 * x / LENGTH) == k) for k in range(4)}
    points = {"left": lambda x, y, z: x < 1e-9, "right": lambda x, y, z: x > LENGTH - 1e-9, "all": lambda x, y, z: x > -1.0}
    file = meshed([rectangle(LENGTH, WIDTH)], (8, 1), groups, points)
    setup = Setup(
        regions=(Region(youngs_modulus=MODULUS, poisson_ratio=0.0, density=1000.0, thickness=THICKNESS),),
        supports=(Support(group="left"), Support(group="all", fixed="yz")),
        zones=tuple(Zone(group=name) for name in groups),
        loads=(Load(name="pull", kind="force", groups=("right",), direction=(1.0, 0.0, 0.0), start=2.0),),
        sensors=tuple(Sensor(point=(x, 0.05, 0.0), direction=(1.0, 0.0, 0.0)) for x in (0.1, 0.4, 0.6, 0.9)),
    )
    return make_structure(setup, surface_mesh(file))


def pulled(damage):
    """Strain e of parts in series under dead forces F, St Venant and Kirchhoff: F/(w t) = E (1 - d) (e + e^2/2) (1 + e)."""
    stress = 2.0 * LOADS[None] / (WIDTH * THICKNESS) / (MODULUS * (1.0 - np.asarray(damage)[:, None]))
    e = stress.copy()
    for _ in range(50):
        e -= ((e + e**2 / 2.0) * (1.0 + e) - stress) / (1.0 + 3.0 * e + 1.5 * e**2)
    return e


def static(values, noise=1e-6, **more):
    state = np.arange(values.shape[1])
    names = tuple(f"pull {k}" for k in state)
    return StaticRecord(values=values, noise=noise, inputs={"pull": LOADS}, state=state, names=names, **more)


def test_a_dish_under_a_measured_pressure_is_found_with_stated_errors(dish, recorded):
    record = ResponseRecord(
        step=STEP, values=recorded, noise=NOISE, inputs={"pressure": PRESSURE}, start={"pressure": -500.0}
    )
    answer = Twin(dish).fit(record)
    assert answer.valid
    assert answer.zones == dish.zone_names
    assert "ring 2 sector 1" in answer.zones
    assert np.all(np.abs(answer.damage - TRUE) < 4.0 * answer.deviation + 1e-3)
    assert np.max(np.abs(answer.damage - TRUE)) < 0.03
    assert not any(answer.together_with)


def test_an_unknown_scale_of_the_load_is_found_with_the_damage(dish, forward):
    """The history that was measured is 5 % too small; the static part of the load is in it."""
    strain = forward.strain(TRUE[None], {}, {"pressure": PRESSURE}, STEPS, STEP)[0]
    record = ResponseRecord(
        step=STEP,
        values=strain + NOISE * np.random.default_rng(2).standard_normal(strain.shape),
        noise=NOISE,
        inputs={"pressure": PRESSURE / 1.05},
        start={"pressure": -500.0 / 1.05},
    )
    answer = Twin(dish, nuisances=("offset", "amplitude")).fit(record)
    value, deviation = answer.nuisances["amplitude[pressure]"]
    assert answer.valid
    assert abs(value - 1.05) < 4.0 * deviation


def test_a_watch_of_a_dish_takes_its_loads_window_by_window(dish, forward):
    damage = np.where(TIME[:, None] > 0.1, TRUE, 0.0)
    state, _ = forward.begin(np.zeros(5), {})
    strain, _ = forward.advance(state, damage[None], {"pressure": PRESSURE}, STEP)
    readings = strain[0] + NOISE * np.random.default_rng(3).standard_normal(strain[0].shape)
    watch, windows = Watch(NOISE, dish, step=STEP), np.split(np.arange(STEPS), 5)
    judged = [watch.advance(readings[:, part], {"pressure": PRESSURE[part]}) for part in windows]
    assert [window.alarm for window in judged] == [False, False, True, False, False]
    (finding,) = (window.finding for window in judged if window.finding)
    assert finding.zones == dish.zone_names
    assert finding.onset == pytest.approx(0.1, abs=3.0 * STEP)
    assert finding.damage == pytest.approx(TRUE, abs=0.03)


def test_sensors_of_a_setup_rest_at_its_own_strain(forward):
    """Under the pressure that keeps the dish in shape; while it stays, their resistance stays."""
    sensed = SensedForward(forward, default_artifact())
    _, strain = forward.begin(np.zeros(5), {})
    assert np.all(strain > 1e-4)
    np.testing.assert_array_equal(sensed.bank.parameters["rest_strain"], strain)
    still = np.repeat(strain[None, :, None], 3, axis=2)
    resistance = sensed.bank.read(still, STEP, sensed.bank.rest(strain, STEP))[0]
    np.testing.assert_allclose(resistance[0], np.repeat(resistance[0, :, :1], 3, axis=1), rtol=1e-12)


def test_equilibria_are_those_of_the_closed_form(strip):
    damage = np.array([0.0, 0.2, 0.0, 0.45])
    found = MembraneForward(strip).states(damage[None], {}, {"pull": LOADS})[0]
    np.testing.assert_allclose(found, pulled(damage), rtol=1e-9)


def test_the_slopes_of_equilibria_are_those_of_the_closed_form(strip):
    damage, d = np.array([0.1, 0.2, 0.0, 0.45]), 1e-6
    slopes = MembraneForward(strip).state_slopes(damage, {}, {"pull": LOADS})
    expected = np.array([(pulled(damage + d * e) - pulled(damage - d * e)) / (2.0 * d) for e in np.eye(4)])
    np.testing.assert_allclose(slopes, expected, rtol=1e-6, atol=1e-8)


def test_damage_is_found_from_load_states_of_the_closed_form(strip):
    damage = np.array([0.0, 0.25, 0.0, 0.4])
    answer = Twin(strip, known=BY_DEFAULT).fit(static(pulled(damage)))
    assert answer.valid
    np.testing.assert_allclose(answer.damage, damage, atol=1e-4)


def test_zones_that_act_alike_are_answered_together(strip):
    """Sensors on the first two parts, and a displacement between: of the last two no sensor tells anything."""
    J = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.5, 0.5]]) / 1e-3
    assert alike(J.T @ J).tolist() == [0, 1, 1]
    assert alike(np.eye(3) / 1e-6).tolist() == [0, 1, 2]
    assert alike(np.diag([1e6, 0.0, 0.0])).tolist() == [0, 1, 2]  # nothing known of them, together neither


def test_what_cannot_be_told_is_said_before_the_fit(dish, recorded):
    J = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.5, 0.5]]) / 1e-3
    (together,) = untold(J.T @ J, ("rim", "left", "right"))
    assert together.startswith("left and right act alike on the sensors")
    (lost,) = untold(np.diag([1e6, 1e6, 0.0]), ("rim", "left", "right"))
    assert lost.startswith("Damage of right hardly moves the sensors")
    start = {"pressure": PRESSURE}
    clear = ResponseRecord(step=STEP, values=recorded, noise=NOISE, inputs=start)
    assert Twin(dish).untold(clear) == []
    drowned = Twin(dish).untold(ResponseRecord(step=STEP, values=recorded, noise=1.0, inputs=start))
    assert len(drowned) >= 1


def test_load_states_are_in_no_order_so_none_of_them_is_said_to_be_late(strip):
    values = pulled(np.zeros(4))[:, [0, 0, 1, 2]]
    answer = Twin(strip, known=BY_DEFAULT).fit(static(values))
    assert not answer.valid
    assert not [doubt for doubt in answer.doubts if "late" in doubt]


def test_readings_are_weighed_by_noise_and_model_error():
    random = np.random.default_rng(4)
    present, noise = np.ones((2, 6), dtype=bool), np.array([1.0, 2.0])
    error, y = random.standard_normal((3, 2, 6)), random.standard_normal((1, 2, 6))
    S = np.diag(np.repeat(noise**2, 6)) + error.reshape(3, -1).T @ error.reshape(3, -1)
    z = RecordWeights(present, noise, error).weigh(y)[0]
    assert z @ z == pytest.approx(y.ravel() @ np.linalg.solve(S, y.ravel()))


@pytest.mark.parametrize("count", [3, 8])
def test_two_swapped_sensors_are_among_the_other_readings(count):
    random = np.random.default_rng(5)
    true = random.standard_normal((count, 100))
    order = [1, 0, *range(2, count)]
    record = ResponseRecord(step=STEP, values=true[order], noise=1e-3)
    wirings = other_wirings(record, true)
    misfits = [float(np.abs(np.nan_to_num(w.applied(record).values - true)).max()) for w in wirings]
    found = best_wiring([w for w in wirings if w.moved], [m for w, m in zip(wirings, misfits, strict=True) if w.moved])
    assert found.order == tuple(order)
    assert "1 and 2" in found.doubt


def write(path, rows, head="state,pull [N],strain[1],strain[2],strain[3],strain[4] [%]"):
    path.write_text("\n".join([head, *rows]))
    return path


def test_a_table_of_load_states_is_read_with_repeated_readings(strip, tmp_path):
    loads = {"low": 2.0, "high": 4.0}
    rows = [f"{name},{pull},0.01{k},0.02{k},,{k}" for name, pull in loads.items() for k in range(5)]
    record = read_table(write(tmp_path / "r.csv", rows), structure=strip)
    assert isinstance(record, StaticRecord)
    assert record.names == ("low", "high")
    assert record.inputs["pull"].tolist() == [2.0, 4.0]
    assert record.values[3, 4] == pytest.approx(0.04)
    assert record.noise_deviation()[3] == pytest.approx(0.01 * np.sqrt(2.5))
    assert record.sensors == [0, 1, 3]


def test_loads_of_a_table_are_in_the_units_of_the_membrane(dish, tmp_path):
    rows = [f"{100.0 + k * STEP:.4f},{-0.5 - 0.001 * k},{k % 7 / 1e4}" for k in range(101)]
    head = "time [s],pressure [kPa],strain[2]"
    record = read_table(write(tmp_path / "r.csv", rows, head), structure=dish)
    assert record.samples == 100
    assert record.start == {"pressure": -500.0}
    assert record.inputs["pressure"][:2] == pytest.approx([-501.0, -502.0])
    from_rest = read_table(write(tmp_path / "r.csv", [row[2:] for row in rows[1:]], head), structure=dish, begins="rest")
    assert (from_rest.samples, from_rest.start) == (100, {})


@pytest.mark.parametrize("what", ["the load stops", "rows are missing"])
def test_a_record_ends_where_its_loads_are_not_known(dish, tmp_path, caplog, what):
    rows = [f"{k * STEP},{k},{k % 7 / 1e4}" for k in range(201)]
    if what == "the load stops":
        rows[101:] = [f"{k * STEP},,{k % 7 / 1e4}" for k in range(101, 201)]
    else:
        del rows[101:107], rows[50:55]  # 6 of them, and before that 5, in which the load is straight
    record = read_table(write(tmp_path / "r.csv", rows, "time,pressure [Pa],strain[2]"), structure=dish)
    assert record.samples == 100
    np.testing.assert_allclose(record.inputs["pressure"], np.arange(1.0, 101.0))
    assert f"the loads are not known after t = {100 * STEP:g} s (line " in caplog.text


def test_a_table_that_arrives_is_read_in_parts_that_are_the_whole(dish, tmp_path):
    rows = [f"{k * STEP:.5f},{k % 11},{k % 7 / 1e4}" for k in range(511)]
    lines = ["measured on a Friday\n", "time [s],pressure [Pa],strain[2]\n", *(f"{row}\n" for row in rows)]
    (tmp_path / "r.csv").write_text("".join(lines))
    whole = read_table(tmp_path / "r.csv", structure=dish)
    parts = list(read_arriving(lines, noise=1e-4, structure=dish))
    assert [part.samples for part in parts] == [117, 120, 120, 153]
    assert parts[0].start == whole.start
    np.testing.assert_array_equal(np.hstack([part.values for part in parts]), whole.values)
    np.testing.assert_allclose(np.concatenate([part.inputs["pressure"] for part in parts]), whole.inputs["pressure"])


def test_what_arrives_is_read_until_it_makes_no_sense(dish):
    rows = [f"{k * STEP:.5f},{k % 11},{k % 7 / 1e4}\n" for k in range(400)]
    head, wrong = "time [s],pressure [Pa],strain[2]\n", "0.1,1,abc\n"
    parts = read_arriving([head, *rows[:300], wrong, *rows[301:]], noise=1e-4, structure=dish)
    assert next(parts).samples == 118
    with pytest.raises(DataError, match=r"what arrived after t = 0.238 s, line 64: 'abc' under 'strain\[2\]' is no number"):
        list(parts)
    with pytest.raises(DataError, match=r"the loads are not known after t = 0.011 s \(line 13\)"):
        list(read_arriving([head, *rows[:250], *rows[280:]], noise=1e-4, structure=dish))


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("time,presure [Pa],strain[1]", "no load 'presure'. Did you mean 'pressure'"),
        ("time,pressure,strain[1]", r"'pressure' has no unit. Write pressure \[Pa\]"),
        ("time,pressure [m],strain[1]", r"'m' of 'pressure \[m\]' is no unit of pressure"),
        ("time,pressure [Pa],strain[6]", r"'strain\[6\]' is of none of the 5 sensors"),
    ],
)
def test_columns_that_the_membrane_does_not_know_are_named(dish, tmp_path, head, message):
    rows = [f"{k * STEP},1,0" for k in range(70)]
    with pytest.raises(DataError, match=message):
        read_table(write(tmp_path / "r.csv", rows, head), structure=dish)


def test_what_a_record_cannot_tell_is_refused(strip, tmp_path):
    with pytest.raises(DataError, match="8 unknowns, 4 of them damages, cannot be told from 4 readings"):
        Twin(strip, nuisances=("offset",)).fit(
            StaticRecord(
                values=pulled(np.zeros(4))[:, :1],
                noise=1e-4,
                inputs={"pull": LOADS[:1]},
                state=np.zeros(1, int),
                names=("a",),
            )
        )
    with pytest.raises(DataError, match="'pull' differs within state 'a'"):
        read_table(write(tmp_path / "r.csv", ["a,1,0,0,0,0", "a,2,0,0,0,0"]), structure=strip)
    with pytest.raises(DataError, match="holds strain"):
        static(pulled(np.zeros(4)), kind="resistance")
    with pytest.raises(ParameterError, match="'frequency' cannot be fitted"):
        Twin(strip, nuisances=("frequency",)).fit(static(pulled(np.zeros(4))))
    with pytest.raises(ParameterError, match="no parameter or input 'wind'"):
        Twin(strip, parameters={"wind": 1.0})


def test_a_structure_survives_as_text(dish, strip):
    for structure in (dish, strip):
        again = read_structure(structure_text(structure))
        assert (again.setup, again.zone_names) == (structure.setup, structure.zone_names)
        np.testing.assert_array_equal(again.mesh.nodes, structure.mesh.nodes)
    with pytest.raises(DataError, match="no structure of a membrane"):
        read_structure("{}")
