"""Placement of sensors: information, choice, and fits that show what was predicted."""

import tomllib
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from gossamer.descriptions import load_structure
from gossamer_models import ParameterError, membrane
from gossamer_models.membrane.candidates import ANGLES, candidates
from gossamer_models.membrane.gauges import gauge, stacked
from gossamer_models.placement import NOISE, place_sensors, save_picture, sensors_text, write_csv
from gossamer_models.placement.information import THRESHOLD, choose, deviations, information, smallest_damage, weakest
from gossamer_models.placement.placing import _unseen
from gossamer_models.twin import LoadTable, MembraneForward
from gossamer_models.twin.nuisances import OFFSET, Nuisances
from gossamer_models.twin.unknowns import DamageUnknowns
from scipy.stats import norm

SHIPPED = Path(__file__).parents[2] / "orchestrator" / "membranes"
ELEMENTS, ORDER, STEP, STOP = 4, 1, 3e-4, 0.15
LOAD = {
    name: asdict(membrane.MembraneParams())[name] for name in ("pressure_amplitude", "pressure_frequency", "pressure_phase")
}
MIRRORED = np.arange(16).reshape(4, 4)[:, ::-1].ravel()  # zones after x is turned round


@pytest.fixture(scope="module")
def square():
    return membrane.square_structure(ELEMENTS, ORDER)


@pytest.fixture(scope="module")
def found(square):
    pytest.importorskip("ziglang", reason="hundreds of simulations need the compiler")
    return place_sensors(square, LOAD, 4, points=16, step=STEP, stop=STOP, records=8)


def own_gauges(structure):
    return stacked(structure.setup.sensors, list(structure.gauges), len(structure.mesh.nodes))


def test_information_is_that_of_noise_with_an_unknown_offset():
    """The definition: J^T S^-1 J with the covariance S of white noise and a common offset."""
    J = np.random.default_rng(3).normal(size=(5, 2, 40))
    S = 0.01**2 * np.eye(40) + OFFSET**2
    direct = np.array([J[:, g] @ np.linalg.solve(S, J[:, g].T) for g in range(2)])
    np.testing.assert_allclose(information(J, 0.01), direct, rtol=1e-8)


def test_nuisances_are_taken_out_by_the_schur_complement():
    A = np.random.default_rng(4).normal(size=(9, 6))
    total = 1e4 * A.T @ A
    nuisance = np.linalg.inv(total[4:, 4:] + np.eye(2))
    direct = np.linalg.inv(total[:4, :4] - total[:4, 4:] @ nuisance @ total[4:, :4])
    np.testing.assert_allclose(deviations(total, 4) ** 2, np.diag(direct), rtol=1e-6)


def test_a90_is_found_in_nine_of_ten_cases():
    a90 = smallest_damage(np.array([0.01]))[0]
    assert norm.sf(THRESHOLD) == pytest.approx(0.05, rel=1e-12)
    assert norm.sf(THRESHOLD * 0.01, loc=a90, scale=0.01) == pytest.approx(0.9, rel=1e-12)
    assert smallest_damage(np.array([np.inf]))[0] == 0.95


def test_the_choice_takes_the_best_gauge_of_each_zone():
    """Gauges that tell of one zone each: the best pair is known."""
    strength = np.array([[50.0, 0.0], [80.0, 0.0], [0.0, 70.0], [0.0, 60.0]])
    I = np.array([np.diag(row**2) for row in strength])
    assert sorted(choose(I, 2, 2)) == [1, 2]


def test_the_choice_does_not_depend_on_the_order_of_candidates():
    random = np.random.default_rng(5)
    J = 30.0 * random.normal(size=(12, 3, 4))
    I = np.einsum("gat,gbt->gab", np.swapaxes(J, 1, 2), np.swapaxes(J, 1, 2))
    shuffled = random.permutation(12)
    assert set(shuffled[choose(I[shuffled], 4, 3)]) == set(choose(I, 4, 3))


def test_more_sensors_never_know_less():
    J = 30.0 * np.random.default_rng(6).normal(size=(12, 4, 3))
    I = J @ np.swapaxes(J, 1, 2)
    worst = [deviations(I[choose(I, 4, count)].sum(axis=0), 4).max() for count in (2, 3, 5, 8)]
    assert all(np.diff(worst) < 0.0)


def test_candidates_lie_in_the_membrane_with_four_directions_each(square):
    spread = candidates(square, 16)
    assert len(spread.sensors) == 16 * len(ANGLES)
    points = np.unique([sensor.point for sensor in spread.sensors], axis=0)
    distances = np.linalg.norm(points[:, None] - points, axis=2) + np.eye(16)
    assert distances.min() > 0.1 * square.mesh.size
    assert np.linalg.norm([sensor.direction for sensor in spread.sensors], axis=1) == pytest.approx(1.0)
    assert candidates(square, 10**6).sensors[-1]  # no more points than there are
    with pytest.raises(ParameterError, match=r"no gauge of 2 m fits"):
        candidates(square, 16, gauge_length=2.0)


def test_gauges_in_all_directions_read_a_homogeneous_stretch(square):
    stretch = np.array([[1.02, 0.01], [0.0, 0.97]])
    x = square.mesh.nodes.copy()
    x[:, :2] = x[:, :2] @ stretch.T
    spread = candidates(square, 5)
    expected = [np.linalg.norm(stretch @ sensor.direction[:2]) - 1.0 for sensor in spread.sensors]
    np.testing.assert_allclose(spread.strain(x[:, :, None])[:, 0], expected, atol=1e-13)


def test_gauges_read_from_the_nodes_what_the_sensors_of_the_membrane_read(square):
    pytest.importorskip("ziglang", reason="the twin needs the compiler")
    damage = np.zeros((2, 16))
    damage[1, [2, 9]] = 0.2, 0.4
    sensors = MembraneForward(square).strain(damage, {}, {}, 100, STEP)
    nodes = MembraneForward(square, LOAD, own_gauges(square)).strain(damage, {}, {}, 100, STEP)
    np.testing.assert_allclose(nodes, sensors, atol=1e-9)


def test_mirrored_sensors_know_mirrored_zones_equally_well(found):
    a90 = found.own.a90
    np.testing.assert_allclose(a90, a90[MIRRORED], rtol=1e-2)
    assert 0.0 < a90.min() < a90.max() < 0.95


def test_the_worst_zone_is_better_known_with_the_chosen_sensors(found):
    assert found.candidates == 4 + 16 * 4
    assert len(set(found.chosen.sensors)) == 4
    assert found.chosen.a90.max() < 0.8 * found.own.a90.max()


def test_fits_to_noisy_records_scatter_as_predicted(found):
    for placement in (found.own, found.chosen):
        check = placement.check
        assert check.records == 8
        assert check.spread == pytest.approx(1.0, abs=4.0 * check.spread_error)
        # 128 estimates: four deviations of a share of 0.05 and of 0.9
        assert check.false_alarms == pytest.approx(0.05, abs=0.08)
        assert check.found == pytest.approx(0.9, abs=0.11)


def test_the_text_places_the_same_gauges(found, square):
    tables = tomllib.loads(sensors_text(found))["sensors"]
    assert len(tables) == 4
    for table, sensor in zip(tables, found.chosen.sensors, strict=True):
        again, first = (
            gauge(square.mesh, np.array(point), np.array(direction), 0.0).lines.toarray()
            for point, direction in ((table["point"], table["direction"]), (sensor.point, sensor.direction))
        )
        np.testing.assert_allclose(again, first, atol=1e-9)


def test_table_and_picture_are_written(found, tmp_path):
    write_csv(found, tmp_path / "zones.csv")
    rows = [line.split(",") for line in (tmp_path / "zones.csv").read_text().splitlines()]
    assert rows[0][:4] == ["zone", "name", "own deviation [1]", "own a90 [1]"]
    np.testing.assert_allclose([float(row[5]) for row in rows[1:]], found.chosen.a90, rtol=1e-5)
    save_picture(found, tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_what_makes_no_sense_is_refused(square):
    no_zones = replace(square, zone_names=())
    with pytest.raises(ParameterError, match=r"the setup has no zones"):
        place_sensors(no_zones, LOAD)
    with pytest.raises(ParameterError, match=r"noise= is 0"):
        place_sensors(square, LOAD, noise=0.0)
    with pytest.raises(ParameterError, match=r"has 0 samples"):
        place_sensors(square, LOAD, step=1.0)
    with pytest.raises(ParameterError, match=r"no parameter or input 'wind'"):
        place_sensors(square, {"wind": 1.0})
    with pytest.raises(ParameterError, match=r"choose 1 to 3 sensors among 3 candidates, not 4"):
        choose(np.tile(np.eye(2), (3, 1, 1)), 2, 4)


def test_a_response_that_bends_is_smooth_and_a_slack_film_that_flaps_is_not():
    """The square swings for 0.3 s: there differences by two steps differ by 15 %, as they should."""
    pytest.importorskip("ziglang", reason="the simulations need the compiler for their speed")
    sail = load_structure(SHIPPED / "sail.toml")
    slack = {"pressure_amplitude": 0.1, "pressure_frequency": 0.5}
    square, sail = (
        DamageUnknowns(MembraneForward(structure, load), Nuisances((), {}, {}, structure.n_sensors))
        for structure, load in ((membrane.square_structure(), LOAD), (sail, slack))
    )
    assert square.roughness(1000, 3e-4) < 0.1
    assert sail.roughness(100, 0.05) > 0.5


def test_records_last_some_periods_of_the_structure_by_default():
    placing = place_sensors(drum := load_structure(SHIPPED / "drum.toml"), {}, 2, points=2, noise=1e-4)
    period = membrane.first_period(drum)
    assert placing.samples * placing.step == pytest.approx(6.0 * period, rel=0.05)
    assert placing.step == pytest.approx(period / 150.0, rel=0.05)
    assert placing.own.a90.max() < 0.2


def test_a_membrane_at_rest_tells_nothing(square):
    with pytest.raises(ParameterError, match=r"set='pressure_amplitude=100'"):
        place_sensors(square, {"pressure_amplitude": 0.0}, points=2, stop=0.006)


def test_the_noise_is_that_of_the_thesis():
    drawn = np.random.default_rng(0).uniform(0.0, 0.02, 10**6).std()
    assert drawn == pytest.approx(NOISE, rel=2e-3)


def test_candidates_on_a_tilted_sheet_of_triangles_lie_in_it():
    normal = np.array([0.0, -0.6, 0.8])
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.8, 0.6], [0.0, 0.8, 0.6]])
    file = membrane.MeshFile(
        name="sheet",
        nodes=corners,
        quadrilaterals=np.zeros((0, 4), dtype=np.int64),
        triangles=np.array([[0, 1, 2], [0, 2, 3]]),
        faces={"all": np.arange(2)},
        edges={},
        points={"corners": np.arange(4)},
    )
    steel = membrane.Region(youngs_modulus=2e11, poisson_ratio=0.3, density=7800.0, thickness=1e-3, direction=tuple(normal))
    setup = membrane.Setup(
        regions=(steel,), supports=(membrane.Support(group="corners"),), zones=(membrane.Zone(group="all"),)
    )
    spread = candidates(membrane.make_structure(setup, membrane.surface_mesh(file)), 10)
    assert len(spread.sensors) == 2 * len(ANGLES)  # the material's axis is the normal, so a side takes its place
    directions = np.array([sensor.direction for sensor in spread.sensors])
    np.testing.assert_allclose(directions @ normal, 0.0, atol=1e-12)
    np.testing.assert_allclose([np.dot(sensor.point, normal) for sensor in spread.sensors], 0.0, atol=1e-12)
    grown = (1.0 + 0.03) * corners
    np.testing.assert_allclose(spread.strain(grown[:, :, None]), 0.03, atol=1e-12)


def test_the_weakest_combination_is_the_one_that_the_record_lacks():
    total = np.diag([1e4, 1e4, 1e4]) - 1e4 / 3.0  # nothing of damage common to all
    deviation, v = weakest(total, 3)
    np.testing.assert_allclose(v, 1.0)
    assert deviation == pytest.approx(0.95 / np.sqrt(12.0) / np.sqrt(3.0))  # the mean of three that may be anything


def told(I, count=1):
    sheet = membrane.square_structure(4, 1)
    three = replace(sheet, zone_names=("a", "b", "c"))
    return list(_unseen(three, I, list(range(count)), sheet.setup.sensors[: len(I)]))


def test_what_no_sensor_tells_is_said_in_words():
    nothing_common = np.diag([1e4, 1e4, 1e4]) - 1e4 / 3.0
    assert "Damage common to all zones is not in this record" in told(nothing_common[None])[0]
    pair = np.array([[1e4, 0.0, 0.0], [0.0, 1e4, 1e4], [0.0, 1e4, 1e4]])
    assert told(pair[None]) == [
        "Zones 2 (b), 3 (c) can only be told together wherever sensors are: merge them, or load it in another way."
    ]
    third = np.diag([0.0, 0.0, 1e4])
    assert "by the chosen sensors: merge them, or add a sensor at (0.392, 0.196, 0) m." in told(np.array([pair, third]))[0]
    assert told(np.diag([1e4, 1e4, 1e4])[None]) == []


def test_a_combination_of_many_zones_is_as_unknown_as_one_of_few():
    """The mean of twelve damages that may be anything is known four times as well as one, and is not in the record."""
    total = np.diag(np.full(16, 1e4)) - 1e4 / 16.0
    sheet = membrane.square_structure(4, 1)
    assert "Damage common to all zones" in next(_unseen(sheet, total[None], [0], sheet.setup.sensors))


@pytest.fixture(scope="module")
def drum():
    """The shipped drum, which its base shakes and no pressure."""
    pytest.importorskip("ziglang", reason="the simulations need the compiler for their speed")
    return load_structure(SHIPPED / "drum.toml")


def test_a_structure_that_its_base_shakes_gets_sensors(drum):
    time = np.linspace(0.0, 0.04, 81)
    shaken = LoadTable(
        values={"base_acceleration[3]": tuple(300.0 * np.sin(2.0 * np.pi * 50.0 * time))}, time=tuple(time.tolist())
    )
    many = {"points": 4, "noise": 1e-6, "step": 5e-4, "stop": 0.1}
    found = place_sensors(drum, {"pressure_amplitude": 0.0}, 2, loads=shaken, **many)
    known = place_sensors(drum, {"pressure_amplitude": 0.0}, 2, loads=shaken, known=["amplitude", "damping"], **many)
    assert found.simulations == known.simulations + 2
    assert known.own.deviation.max() < found.own.deviation.max() < 1.0


def test_states_of_rest_tell_what_a_fit_to_them_finds():
    """A sail, pulled and pressed on; fits to noisy readings scatter as predicted."""
    sail = load_structure(SHIPPED / "sail.toml")
    states = LoadTable(values={"boom_x": (0.9, 1.2, 0.9), "boom_y": (0.9, 1.2, 0.9), "pressure": (0.1, 0.3, 1.0)})
    found = place_sensors(sail, {}, 12, loads=states, points=8, noise=1e-6, known=["amplitude"], records=3)
    assert found.record == "3 states of rest"
    assert found.chosen.deviation.max() < found.own.deviation.max()
    assert found.chosen.check.agrees
    with pytest.raises(ParameterError, match=r"states have no stop="):
        place_sensors(sail, {}, 2, loads=states, stop=1.0)
    pulled = LoadTable(values={"boom_x": (0.8, 0.9, 1.2), "boom_y": (0.8, 0.9, 1.2)})
    found = place_sensors(sail, {}, 12, loads=pulled, points=8, noise=1e-4, known=["amplitude"])
    assert "Damage common to all zones is not in this record" in found.unseen[0]


def test_without_a_count_as_many_sensors_as_the_target_needs_are_chosen(square):
    many = {"points": 16, "step": STEP, "stop": STOP}
    found = place_sensors(square, LOAD, None, target=0.1, **many)
    counts, worst = zip(*found.curve, strict=True)
    assert list(worst) == sorted(worst, reverse=True)
    assert worst[-1] <= 0.1 < worst[-2]
    assert len(found.chosen.sensors) == counts[-1]
    assert found.chosen.deviation.max() <= worst[-1] * (1.0 + 1e-9)  # more starts
