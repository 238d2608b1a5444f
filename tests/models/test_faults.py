"""Faults that are no torn zones: found by a twin beside damage, with the probability of each explanation."""

import numpy as np
import pytest
from gossamer_models import ParameterError
from gossamer_models.membrane import (
    Fault,
    Gas,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    make_structure,
    square_structure,
    surface_mesh,
)
from gossamer_models.mistakes import DescriptionError
from gossamer_models.twin import MembraneForward, ResponseRecord, StaticRecord, Twin, inspect, known_faults
from gossamer_models.twin.faults import with_faults
from oracles.meshes import disc, meshed

COARSE = square_structure(4, 1)  # twin and truth have the same mesh, so that a simulation costs little
NOISE, STEP = 1e-3, 3e-4


def record(zone=6, depth=0.0, seed=0, reads=(1.0, 1.0, 1.0, 1.0), **true):
    damage = depth * np.eye(16)[zone - 1 : zone]
    y = np.array(reads)[:, None] * MembraneForward(COARSE, true).strain(damage, {}, {}, 500, STEP)[0]
    return ResponseRecord(step=STEP, values=y + NOISE * np.random.default_rng(seed).standard_normal(y.shape), noise=NOISE)


@pytest.fixture(scope="module")
def twin():
    return Twin(COARSE, discrepancy=None, faults="known")


@pytest.mark.parametrize(
    ("true", "fault", "share"),
    [
        ({"edge_displacement": 4.5e-3}, "loss of prestrain", 0.25),
        ({"density": 1540.0}, "mass added", 0.4),
        ({"reads": (1.0, 0.7, 1.0, 1.0)}, "sensor 2 loose", 0.3),
    ],
)
@pytest.mark.parametrize("depth", [0.0, 0.2])
def test_the_right_explanation_stands_first(twin, true, fault, share, depth):
    answer = twin.fit(record(depth=depth, seed=3, **true))
    assert answer.valid
    probability, what = answer.explanations[0]
    assert probability > 0.8
    assert [text.rpartition(" ")[0].rpartition(" ")[0] for text in what] == ["zone_6"] * bool(depth) + [fault]
    found = next(each for each in answer.faults if each.name == fault)
    assert found.share == pytest.approx(share, abs=3.5 * found.deviation)
    assert found.probability > 0.8
    assert len(answer.zones) == len(answer.damage) == 16
    assert answer.damage[5] == pytest.approx(depth, abs=0.02)


def test_a_healthy_structure_has_no_fault(twin):
    answer = twin.fit(record(seed=5))
    assert answer.explanations[0][1] == ()
    assert max(fault.probability for fault in answer.faults) < 0.05
    document = answer.as_json()
    assert {each["name"] for each in document["faults"]} == {fault.name for fault in known_faults(COARSE)}


def test_records_share_their_faults(twin):
    both = inspect(twin, [record(seed=k, edge_displacement=4.5e-3) for k in (1, 2)])
    one = twin.fit(record(seed=1, edge_displacement=4.5e-3))
    found, alone = (next(f for f in answer.faults if f.name == "loss of prestrain") for answer in (both, one))
    assert both.valid
    assert found.share == pytest.approx(0.25, abs=3.5 * found.deviation)
    assert found.deviation < 1.05 * alone.deviation  # an unknown modulus does the same in both
    assert both.damage.max() == 0.0


def test_what_no_record_and_no_gauge_tells_apart_is_said():
    """Two faults that do the same, of a record in time: other loads, another frequency and more gauges were tried."""
    faults = [Fault(name=name, parameter="density", change="rises") for name in ("wet", "dusty")]
    answer = Twin(COARSE, discrepancy=None, faults=faults, known=("density", "modulus")).fit(record(seed=3, density=1540.0))
    assert [what[0].split()[0] for _, what in answer.explanations[:2]] in (["wet", "dusty"], ["dusty", "wet"])
    assert (
        answer.further == "The two likeliest explanations stay alike under half and twice the loads, and with a gauge more."
    )


LENS = {"rim": lambda x, y, z: np.hypot(x, y) > 1.0 - 1e-9}


def film(faults=(), stiffness=0.0, directional=False):
    """A round film over gas, whose rim is held, or drawn by springs in its plane."""
    region = Region(youngs_modulus=1e7, poisson_ratio=0.3, density=1e3, thickness=1e-3, prestress=(2e4, 2e4, 0.0))
    places = [(0.5 * np.cos(a), 0.5 * np.sin(a), 0.0) for a in (0.3, 1.7, 3.9, 5.1)]
    sensors = tuple(Sensor(point=place, direction=(1.0, 0.3 * k, 0.0)) for k, place in enumerate(places))
    springs = (Support(group="rim", fixed="z"), Support(group="rim", fixed="xy", stiffness=stiffness))
    supports = springs if stiffness else (Support(group="rim"),)
    gas = None if stiffness else Gas(pressure=60.0, ambient=0.0, volume=0.5)
    setup = Setup(
        regions=(region,), supports=supports, gas=gas, zones=(Zone(rings=1, sectors=(3,)),), sensors=sensors, faults=faults,
        directional=directional,
    )  # fmt: skip
    return make_structure(setup, surface_mesh(meshed(disc(1.0), 4, points=LENS), 1))


PRESSURES = {"pressure": np.array([20.0, 60.0, 120.0, 200.0])}


def states(structure, given, damage=(0.0, 0.0, 0.0), noise=1e-5, pressures=PRESSURES):
    strain = MembraneForward(structure, given).states(np.array([damage]), {}, pressures)[0]
    values = strain + noise * np.random.default_rng(0).standard_normal(strain.shape)
    names = tuple("abcd"[: len(pressures["pressure"])])
    return StaticRecord(step=1.0, values=values, noise=noise, inputs=pressures, names=names, state=np.arange(len(names)))


def test_a_tear_in_one_direction_is_told_from_one_in_all():
    """Of a film with two yarns: what is left along one of them, in a zone, against damage of that zone."""
    structure = film(directional=True)
    assert sum(each.parameter.startswith("left") for each in known_faults(structure)) == 6
    faults = [each for each in known_faults(structure) if each.parameter.startswith("left") and "[2]" in each.parameter]
    known = ("offset", "gain", "amplitude", "modulus", "density")
    answer = Twin(structure, known=known, faults=faults).fit(states(structure, {"left_across[2]": 0.7}))
    assert answer.valid
    assert answer.damage == pytest.approx(0.0, abs=0.01)
    assert [each.share for each in answer.faults] == pytest.approx([0.0, 0.3], abs=0.01)


def test_a_further_record_is_named_that_tells_two_explanations_apart_and_does():
    """At one pressure, gas that is lost softens a film like a pump that gives less; at twice the pressure it does not.

    The pump is the only load, so that there is none with a factor of its own.
    """
    structure = film((Fault(name="weak pump", parameter="pressure"),))
    faults = [each for each in known_faults(structure) if each.parameter in ("gas_amount", "pressure")]
    twin = Twin(structure, known=("offset", "gain", "modulus", "density"), faults=faults)
    one, two = (
        twin.fit(states(structure, {"gas_amount": 0.95}, pressures={"pressure": np.array(each)}))
        for each in ([20.0], [20.0, 40.0])
    )
    assert [len(what) for _, what in one.explanations] == [1, 1]
    assert one.further.startswith(
        "A record with 2 times the pressure would tell the two likeliest explanations apart: a chi2 of"
    )
    assert one.as_json()["further"] == one.further
    assert two.explanations[0][0] > 0.95
    assert two.explanations[0][1][0].startswith("loss of gas")
    assert two.further == ""


@pytest.mark.parametrize("damage", [(0.0, 0.0, 0.0), (0.0, 0.2, 0.0)])
@pytest.mark.parametrize(
    ("stiffness", "given", "fault", "share"),
    [(0.0, {"gas_amount": 0.9}, "loss of gas", 0.1), (2e4, {"support_stiffness[1]": 1e4}, "loose support rim", 0.5)],
)
def test_gas_that_leaks_and_a_support_that_loosens_are_found_at_rest(stiffness, given, fault, share, damage):
    structure = film(stiffness=stiffness)
    known = ("offset", "gain", "amplitude", "modulus", "density")
    faults = [each for each in known_faults(structure) if not each.parameter.startswith(("density", "sensor"))]
    answer = Twin(structure, known=known, faults=faults).fit(states(structure, given, damage))
    found = next(each for each in answer.faults if each.name == fault)
    assert answer.valid
    assert found.share == pytest.approx(share, abs=max(3.5 * found.deviation, 1e-3))
    assert found.probability > 0.9
    assert answer.damage == pytest.approx(damage, abs=0.01)


def test_a_setup_may_describe_faults_of_its_own():
    own = Fault(name="heater stuck", parameter="pressure", change="rises", most=0.5, probability=0.2)
    structure = film((own,))
    assert known_faults(structure)[0] == own
    forward = MembraneForward(structure, {}, faults=(own,))
    read = forward.states(np.array([[0.0, 0.0, 0.0, 0.25]]), {}, PRESSURES)
    loaded = {"pressure": 1.25 * PRESSURES["pressure"]}
    assert read == pytest.approx(MembraneForward(structure).states(np.zeros((1, 3)), {}, loaded), abs=1e-12)


def test_slopes_of_equilibria_by_faults_are_those_of_differences():
    """Two faults change the same pressure, one a modulus, one a sensor: of loads, of parameters and of readings."""
    pump = Fault(name="pump stuck", parameter="pressure", change="rises", most=0.5, probability=0.2)
    structure = film((pump,))
    forward = with_faults(MembraneForward(structure), known_faults(structure))
    share = np.r_[0.1, 0.05, 0.02, np.linspace(0.02, 0.2, len(forward.faults))]
    slopes = forward.state_slopes(share, {"youngs_modulus[1]": 1.1 * forward.parameters["youngs_modulus[1]"]}, PRESSURES)
    step = 1e-5 * np.eye(share.size)
    rows = np.concatenate([share + step, share - step])
    given = {"youngs_modulus[1]": np.full(len(rows), 1.1 * forward.parameters["youngs_modulus[1]"])}
    ahead, behind = np.split(forward.states(rows, given, PRESSURES), 2)
    assert {"pressure", "sensor[1]"} <= {each.parameter for each in forward.faults}
    assert slopes == pytest.approx((ahead - behind) / 2e-5, rel=1e-4, abs=1e-7)


def test_what_is_no_fault_is_refused():
    with pytest.raises(ParameterError, match=r"acts on 'boom', which this membrane does not have. It has youngs_modulus"):
        Twin(film(), faults=(Fault(name="broken boom", parameter="boom"),))
    with pytest.raises(DescriptionError, match="2 faults have the name 'leak'"):
        film((Fault(name="leak", parameter="gas_amount"),) * 2)
    with pytest.raises(DescriptionError, match="probability"):
        Fault(name="leak", parameter="gas_amount", probability=0.9)
