"""Calibration of a structure: numbers from healthy records, what they do not decide, and what a twin makes of it."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from gossamer_models import DataError, ParameterError
from gossamer_models.membrane import Region, Support, Zone, make_structure, square_structure, surface_mesh
from gossamer_models.membrane.gauges import beside
from gossamer_models.membrane.setup import Sensor, Setup
from gossamer_models.mistakes import DescriptionError
from gossamer_models.twin import Calibration, MembraneForward, ResponseRecord, StaticRecord, Twin, Watch, calibrate
from gossamer_models.twin.nuisances import PLACES, Nuisances, Spread
from oracles.meshes import disc, meshed

COARSE = square_structure(4, 1)  # twin and truth have the same mesh, so that a simulation costs little
TRUE = {"density": 1155.0, "edge_displacement": 0.00635, "mass_damping": 26.0}
NOISE, STEP = 2e-4, 3e-4


@cache
def strain(load, zone, depth):
    forward = MembraneForward(COARSE, TRUE)
    damage = depth * np.eye(16)[zone - 1 : zone]
    return forward.strain(damage, {"pressure_amplitude": np.array([1e4 * load])}, {}, 500, STEP)[0]


def record(load=1.0, zone=1, depth=0.0, seed=0):
    """Half a period of the load; the noise is a small part of the thesis'."""
    y = strain(load, zone, depth)
    return ResponseRecord(step=STEP, values=y + NOISE * np.random.default_rng(seed).standard_normal(y.shape), noise=NOISE)


@pytest.fixture(scope="module")
def known():
    return calibrate(COARSE, [record(1.0, seed=1), record(1.05, seed=2)], mesh_error=False)


def test_numbers_of_the_structure_are_found_with_their_deviations(known):
    assert known.valid
    found = dict(zip(known.names, zip(known.factors, known.deviation, strict=True), strict=True))
    gains = tuple(f"gain[{k}]" for k in range(1, 5))
    assert known.names == ("damping", "modulus", "density", "prestrain", "thickness", *gains)
    for name, true in (
        ("damping", 1.3),
        ("density", 1.05),
        ("prestrain", 0.00635 / 0.006),
        ("modulus", 1.0),
        ("thickness", 1.0),
        *((name, 1.0) for name in gains),
    ):
        value, deviation = found[name]
        assert abs(value - true) < 3.5 * deviation
    assert found["damping"][1] < 0.01
    assert found["prestrain"][1] < 0.01


def test_gains_of_gauges_are_calibrated_and_the_twin_and_the_watch_know_them():
    gains = np.array([1.04, 1.0, 0.97, 1.01])[:, None]
    healthy, damaged = (
        [replace(each, values=gains * each.values) for each in some]
        for some in ([record(1.0, seed=1), record(1.05, seed=2)], [record(0.98, zone=6, depth=0.2, seed=3)])
    )
    known = calibrate(COARSE, healthy, mesh_error=False)
    found = known.factors[-4:]
    assert known.valid
    assert known.names[-4:] == ("gain[1]", "gain[2]", "gain[3]", "gain[4]")
    assert found / found.mean() == pytest.approx(
        gains[:, 0] / gains.mean(), abs=2e-3
    )  # all of them: with load and prestrain
    assert (np.abs(found - gains[:, 0]) < 3.5 * known.deviation[-4:]).all()
    twin = Twin(COARSE, discrepancy=None, calibration=known)
    answer = twin.fit(damaged[0])
    assert answer.valid
    assert answer.damage[5] == pytest.approx(0.2, abs=0.02)
    assert answer.nuisances["gain[3]"] == pytest.approx((found[2], known.deviation[-2]), abs=2e-3)
    carried = replace(COARSE, setup=replace(COARSE.setup, calibration=known.known))
    again = Twin(carried, discrepancy=None, parameters=known.parameters).fit(damaged[0])
    assert again.damage == pytest.approx(answer.damage, abs=1e-9)
    watch = Watch(NOISE, COARSE, calibration=known, exact_mesh=True, step=STEP)
    for part in np.split(gains * record(1.03, seed=4).values[:, :480], 3, axis=1):
        assert not watch.advance(part).alarm
    with pytest.raises(ParameterError, match="gains of 4 sensors, and the structure has 1"):
        Twin(replace(COARSE, setup=replace(COARSE.setup, sensors=COARSE.setup.sensors[:1])), calibration=known)


def test_a_simulation_of_a_calibrated_structure_has_no_gains(known):
    there = known.of_structure
    assert there.names == ("damping", "modulus", "density", "prestrain", "thickness")
    assert there.covariance == pytest.approx(known.covariance[:5, :5])
    assert there.known == known.known.of_structure
    with pytest.raises(DescriptionError, match="there are 3 gains, and 'names' has 4 of them"):
        replace(known.known, gains=(1.0, 1.0, 1.0))
    with pytest.raises(DescriptionError, match="no positive variance"):
        replace(known.known, covariance=tuple(tuple(row) for row in np.zeros((9, 9)).tolist()))


def test_what_acts_in_the_same_way_stays_as_uncertain_as_it_was(known):
    """Equal factors on density, modulus and load change nothing, nor do those on thickness and load: only priors tell them.

    The deviation of the density is then that of its prior, the modulus' and that of two loads of 10 %.
    """
    deviation = dict(zip(known.names, np.sqrt(np.diag(known.covariance)), strict=True))
    together = np.array([[2 / 0.05**2 + 2 / 0.1**2, 2 / 0.1**2], [2 / 0.1**2, 1 / 0.05**2 + 2 / 0.1**2]])
    alone = np.sqrt(np.diag(np.linalg.inv(together)))
    assert deviation["density"] == pytest.approx(alone[0], rel=0.15)
    assert deviation["thickness"] == pytest.approx(alone[1], rel=0.15)
    said = " ".join(known.untold)
    assert "thickness" in said
    assert "density" in said


def test_a_calibrated_twin_finds_damage_where_the_drawing_alone_is_off(known):
    damaged = record(0.98, zone=6, depth=0.2, seed=3)
    answer = Twin(COARSE, discrepancy=None, calibration=known).fit(damaged)
    assert answer.valid
    assert answer.damage[5] == pytest.approx(0.2, abs=0.02)
    assert np.delete(answer.damage, 5).max() < 0.02
    assert answer.nuisances["prestrain"][0] == pytest.approx(1.0, abs=0.01)  # of the calibrated one
    assert answer.nuisances["prestrain"][1] < 0.01
    watch = Watch(NOISE, COARSE, calibration=known, exact_mesh=True, step=STEP)
    for part in np.split(record(1.03, seed=4).values[:, :480], 3, axis=1):
        window = watch.advance(part)
        assert not window.alarm
        assert window.misfit == pytest.approx(1.0, abs=0.25)


def test_a_record_that_is_not_healthy_is_named_with_its_zone():
    found = calibrate(COARSE, [record(1.0, seed=1), record(1.0, zone=7, depth=0.15, seed=2)], mesh_error=False)
    assert not found.valid
    assert any("record 2 is not healthy: zone zone_7 seems damaged by" in doubt for doubt in found.doubts)


def test_a_number_that_runs_into_its_bound_is_named():
    found = calibrate(COARSE, [record()], priors={"prestrain": 1e-3, "damping": 0.0}, mesh_error=False)
    assert "damping" not in found.names
    assert any(doubt.startswith("the prestrain runs into its bound, 5 deviations") for doubt in found.doubts)


def test_a_calibration_is_read_as_it_was_written(known, tmp_path):
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps(known.as_json()))
    again = Calibration.read(path)
    assert again.parameters == known.parameters
    assert np.array_equal(again.covariance, known.covariance)
    assert again.untold == known.untold
    path.write_text("{}")
    with pytest.raises(DataError, match="is no calibration"):
        Calibration.read(path)


@pytest.mark.parametrize(
    ("records", "priors", "error", "message"),
    [
        ([], {}, DataError, "needs a healthy record"),
        ([0], {"stiffness": 0.1}, ParameterError, "no number 'stiffness' to calibrate. Choose from damping, modulus"),
        ([0], {"density": -0.1}, ParameterError, "the prior of 'density' is -0.1"),
        (
            [0],
            dict.fromkeys(("damping", "modulus", "density", "prestrain", "thickness", "gain"), 0.0),
            ParameterError,
            "nothing is left to calibrate",
        ),
    ],
)
def test_what_cannot_be_calibrated_is_refused(records, priors, error, message):
    with pytest.raises(error, match=message):
        calibrate(COARSE, [record() for _ in records], priors=priors, mesh_error=False)


RIM = {"rim": lambda x, y, z: np.hypot(x, y) > 1.0 - 1e-9}


def film(thickness=1e-3, density=1e3, prestress=1e4, factors=()):
    region = Region(
        youngs_modulus=1e7, poisson_ratio=0.3, density=density, thickness=thickness, prestress=(prestress, prestress, 0.0)
    )
    sensors = tuple(
        Sensor(point=(0.5 * np.cos(a), 0.5 * np.sin(a), 0.0), direction=(1.0, 0.0, 0.0)) for a in (0.3, 1.7, 3.9)
    )
    setup = Setup(
        regions=(region,),
        supports=(Support(group="rim"),),
        zones=(Zone(rings=1, sectors=(3,)),),
        sensors=sensors,
        factors=factors,
        mass_damping=20.0,
    )
    return make_structure(setup, surface_mesh(meshed(disc(1.0), 4, points=RIM), 1))


def test_a_factor_on_a_number_of_the_setup_is_that_number():
    given = {"thickness_factor": 1.1, "density_factor": 0.9, "prestress_factor": 1.2}
    one = MembraneForward(film(factors=("thickness", "density", "prestress")), given)
    other = MembraneForward(film(1.1e-3, 900.0, 1.2e4))
    load = {"pressure": np.linspace(0.0, 200.0, 40)}
    found, wanted = (each.strain(np.zeros((1, 3)), {}, load, 40, 1e-3) for each in (one, other))
    assert found == pytest.approx(wanted, abs=1e-12)
    assert one.limit == pytest.approx(other.limit, rel=1e-9)


def test_a_factor_on_what_a_setup_does_not_have_is_refused():
    with pytest.raises(DescriptionError, match="no 'tension' that a factor could multiply"):
        film(factors=("tension",))


def test_a_film_is_calibrated_from_load_states():
    """Strain under pressures: thickness and prestress, the modulus being known."""
    true = MembraneForward(film(thickness=1.06e-3, prestress=1.1e4))
    pressures = {"pressure": np.array([20.0, 60.0, 120.0, 200.0])}
    strain = true.states(np.zeros((1, 3)), {}, pressures)[0]
    values = strain + 1e-7 * np.random.default_rng(0).standard_normal(strain.shape)
    states = StaticRecord(
        step=1.0, values=values, noise=1e-7, inputs=pressures, names=("a", "b", "c", "d"), state=np.arange(4)
    )
    found = calibrate(film(), [states], priors={"modulus": 0.0, "place": 0.0}, mesh_error=False)
    assert found.valid
    for name, true_factor in (("thickness", 1.06), ("prestress", 1.1)):
        k = found.names.index(name)
        assert abs(found.factors[k] - true_factor) < 3.5 * found.deviation[k]


def test_factors_that_are_known_together_move_together():
    covariance = np.array([[0.04, 0.03], [0.03, 0.09]])
    nuisances = Nuisances(
        ("modulus", "density"),
        {"youngs_modulus": 2.0, "density": 3.0},
        {},
        0,
        spread=Spread(("density", "modulus"), covariance),
    )
    z = np.random.default_rng(0).standard_normal((200_000, 2))
    moved = nuisances.moved(z)
    logs = np.log([moved["density"] / 3.0, moved["youngs_modulus"] / 2.0])
    assert np.cov(logs) == pytest.approx(covariance, abs=2e-3)
    (_, modulus), (_, density) = nuisances.values(np.zeros(2), np.ones(2)).values()
    assert (modulus, density) == pytest.approx((0.3, 0.2))


TAUT = (2e4, 2e4, 0.0)


def two_halves(right=1.0, stiffness=3e5):
    """A round film of two materials whose rim is drawn by springs, over a gas whose amount may change."""
    left, other = (
        Region(group=group, youngs_modulus=factor * 1e7, poisson_ratio=0.3, density=1e3, thickness=1e-3, prestress=TAUT)
        for group, factor in (("left", 1.0), ("right", right))
    )
    places = [(0.5 * np.cos(a), 0.5 * np.sin(a), 0.0) for a in (0.3, 1.7, 2.9, 3.9, 5.1)]
    sensors = tuple(
        Sensor(point=place, direction=direction) for place in places for direction in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    )
    supports = (Support(group="rim", fixed="z"), Support(group="rim", fixed="xy", stiffness=stiffness))
    setup = Setup(regions=(left, other), supports=supports, zones=(Zone(rings=1, sectors=(3,)),), sensors=sensors)
    faces = {"left": lambda x, y, z: x < 0.0, "right": lambda x, y, z: x > 0.0}
    return make_structure(setup, surface_mesh(meshed(disc(1.0), 4, points=RIM, faces=faces), 1))


def test_modulus_by_region_and_the_stiffness_of_supports_are_calibrated():
    true = MembraneForward(two_halves(right=1.08, stiffness=2e5))
    pressures = {"pressure": np.array([300.0, 900.0])}
    strain = true.states(np.zeros((1, 3)), {}, pressures)[0]
    values = strain + 1e-5 * np.random.default_rng(0).standard_normal(strain.shape)
    states = StaticRecord(step=1.0, values=values, noise=1e-5, inputs=pressures, names=("a", "b"), state=np.arange(2))
    structure = two_halves()
    priors = dict.fromkeys(("thickness", "prestress", "place"), 0.0)
    found = calibrate(structure, [states], priors=priors, mesh_error=False)
    assert found.valid
    assert {"modulus[1]", "modulus[2]", "support"} <= {*found.names}
    value, deviation = (dict(zip(found.names, each, strict=True)) for each in (found.factors, found.deviation))
    ratio = np.array([-1.0, 1.0]) @ [[name == each for each in found.names] for name in ("modulus[1]", "modulus[2]")]
    deviation_of_ratio = np.sqrt(ratio @ found.covariance @ ratio)
    assert deviation_of_ratio < 0.04  # the prior's is 7 %
    assert ratio @ np.log(found.factors) == pytest.approx(np.log(1.08), abs=3.0 * deviation_of_ratio)
    assert value["support"] == pytest.approx(2.0 / 3.0, abs=3.5 * deviation["support"])
    assert found.parameters["support_stiffness[1]"] == pytest.approx(3e5 * value["support"])
    kinds = Twin(structure, calibration=found).least_squares(states).nuisances.names
    assert {"modulus[1]", "modulus[2]", "support"} <= {*kinds}
    assert "modulus" not in kinds


AROUND = [2.0 * np.pi * (k + 0.3) / 6.0 for k in range(6)]
OFF = np.array([[4.0, 1.0], [-3.0, 2.0], [5.0, -1.0], [-4.0, 0.0], [2.0, -2.0], [-5.0, 1.0]]) * 1e-3  # [m]
PULLS = np.array([0.4, 0.7, 1.0])
KNOWN = dict.fromkeys(("thickness", "prestress", "density", "modulus", "gain"), 0.0)


def quarter(turn):
    def patch(s, t):
        angle, r = np.pi / 2.0 * (s + turn), 0.3 * (1.0 / 0.3) ** t
        return r * np.cos(angle), r * np.sin(angle), 0.0 * s

    return patch


def ring():
    """A flat ring whose hole is drawn together: the strain that six radial gauges read falls as the radius squared."""
    region = Region(youngs_modulus=1e7, poisson_ratio=0.3, density=1e3, thickness=1e-3, prestress=(5e5, 5e5, 0.0))
    sensors = tuple(
        Sensor(point=(0.5 * np.cos(a), 0.5 * np.sin(a), 0.0), direction=(np.cos(a), np.sin(a), 0.0)) for a in AROUND
    )
    supports = (Support(group="rim"), Support(group="hole", stretch=(0.95, 0.95, 1.0), motion="pull"))
    setup = Setup(regions=(region,), supports=supports, zones=(Zone(sectors=(3,)),), sensors=sensors, order=2)
    points = RIM | {"hole": lambda x, y, z: np.hypot(x, y) < 0.3 + 1e-9}
    return make_structure(setup, surface_mesh(meshed([quarter(k) for k in range(4)], 2, points=points, kind="quad9"), 2))


def misplaced(structure):
    """The same with its gauges glued on elsewhere."""
    sensors = []
    for sensor, move in zip(structure.setup.sensors, OFF.tolist(), strict=True):
        for way, by in enumerate(move):
            sensor = beside(structure.mesh, structure.normals, sensor, by, way)
        sensors.append(sensor)
    return make_structure(replace(structure.setup, sensors=tuple(sensors)), structure.mesh)


def pulled(forward, damage=(0.0, 0.0, 0.0), factor=1.0, seed=0, noise=1e-5):
    loads = {"pull": factor * PULLS}
    strain = forward.states(np.array([damage]), {}, loads)[0]
    values = strain + noise * np.random.default_rng(seed).standard_normal(strain.shape)
    return StaticRecord(step=1.0, values=values, noise=noise, inputs=loads, names=("a", "b", "c"), state=np.arange(3))


def test_places_of_gauges_are_found_and_the_calibrated_setup_reads_there():
    """The load is known to 10 %, so that all gauges may be as far inward together; across, nothing changes."""
    drawn = ring()
    truth = MembraneForward(misplaced(drawn))
    healthy = [pulled(truth, seed=1), pulled(truth, factor=1.1, seed=2)]
    known = calibrate(drawn, healthy, priors={**KNOWN, "place": 0.005}, mesh_error=False)
    assert known.valid, known.doubts
    assert known.names == tuple(f"{kind}[{k}]" for kind in PLACES for k in range(1, 7))
    assert (np.abs(known.factors - OFF.T.ravel()) < 3.5 * known.deviation).all()
    apart = np.eye(12)[:6] - np.eye(12)[:6].mean(axis=0)
    assert apart @ known.factors == pytest.approx(OFF[:, 0] - OFF[:, 0].mean(), abs=5e-4)
    assert np.sqrt(np.diag(apart @ known.covariance @ apart.T)).max() < 3e-4
    (sentence,) = known.untold
    assert sentence == "the records hardly tell how far sensors 1, 2, 3, 4, 5, 6 are off across the direction"
    torn = pulled(truth, (0.0, 0.15, 0.0), 0.95, seed=3)
    exact = {"known": ("gain", "density", "modulus"), "discrepancy": None}
    answer = Twin(drawn, calibration=known, **exact).fit(torn)
    assert answer.valid, answer.doubts
    assert answer.damage == pytest.approx([0.0, 0.15, 0.0], abs=0.02)
    assert abs(answer.damage[1] - 0.15) < 3.5 * answer.deviation[1]
    carried = make_structure(replace(drawn.setup, calibration=known.known), drawn.mesh)
    there = MembraneForward(carried).states(np.zeros((1, 3)), {}, {"pull": PULLS})
    assert there == pytest.approx(
        MembraneForward(known.applied(drawn, None)[0]).states(np.zeros((1, 3)), {}, {"pull": PULLS})
    )
    assert there == pytest.approx(truth.states(np.zeros((1, 3)), {}, {"pull": PULLS}), rel=0.02)
    blind = calibrate(drawn, healthy, priors={**KNOWN, "modulus": 0.05, "place": 0.0}, mesh_error=False)
    assert any("record 1 is not explained" in doubt for doubt in blind.doubts)


def test_a_prior_of_places_is_in_metres_and_not_of_the_square():
    with pytest.raises(ParameterError, match=r"the prior of 'place' is 2 m\. Write a standard deviation up to 0\.1 m"):
        calibrate(ring(), [record()], priors={"place": 2.0}, mesh_error=False)
    with pytest.raises(ParameterError, match="on the square places are not calibrated"):
        calibrate(COARSE, [record()], priors={"place": 0.002}, mesh_error=False)
