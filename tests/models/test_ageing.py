"""Ageing of a sensor that any compensator follows: gain and offset where the strain is known."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import ParameterError, simulate
from gossamer_models.compensator import compensator_model
from gossamer_models.sensor import default_artifact, sensor_model
from oracles.direct import direct_inverse
from oracles.preisach import drive, spring, start

H = 0.1  # [s]
N = 1500
METHODS = ("inverse", "estimator", "filter", "direct")
OUTPUTS = ("gain", "gain_deviation", "offset", "offset_deviation")
rng = np.random.default_rng(3)
STRAIN = np.interp(np.arange(N), np.linspace(0, N, 30), rng.uniform(0.1, 0.9, 30))
FRESH = drive(start(sensor_model(), rest_strain=STRAIN[0]), STRAIN, H)
GAIN, OFFSET = np.linspace(1.0, 0.8, N), np.linspace(0.0, -0.05, N)
PER_DAY = np.sqrt(86400.0 / (N * H))  # what wanders by 1 in the run
WANDER = {"gain_per_day": 0.2 * PER_DAY, "offset_per_day": 0.05 * PER_DAY}


def models(method, **options):
    """A compensator of the default sensor, or a direct one of a spring."""
    if method == "direct":
        return compensator_model(replace(spring(), inverse=direct_inverse((1, 2))), **options)
    return compensator_model(default_artifact(), method, **options)


def run(model, output, known=None, names=("strain",), **parameters):
    """Feed outputs of the sensor, and strain where it is known; return results by name."""
    stepper = start(model, rest_strain=STRAIN[0], **parameters)
    inputs = {"resistance": output} if known is None else {"resistance": output, "known": known, "known_strain": STRAIN}
    return simulate(stepper, np.full(len(output), H), inputs, names)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("told", [False, True])
def test_a_sensor_that_does_not_age_gives_the_strain_of_before_to_the_bit(method, told):
    """Also where a known strain is told, which the estimator has always taken."""
    plain, aware = models(method), models(method, ageing=True)
    output = 0.98 * FRESH + 0.003 * np.random.default_rng(1).standard_normal(N)
    names = tuple(v.name for v in plain.variables if v.causality == "output")
    known = (np.arange(N) % 50 == 49) * 1.0 if told else None
    before = run(plain, output, known if method == "estimator" else None, names)
    found = run(aware, output, known, (*names, *OUTPUTS))
    for name in names:
        assert found[name].tobytes() == before[name].tobytes(), name
    assert [set(found[name]) for name in OUTPUTS] == [{1.0}, {0.0}, {0.0}, {0.0}]


def test_gain_and_offset_are_those_of_a_random_walk_given_all_readings_at_once():
    """Conditioning a Gaussian on all readings, without a recursion; of a sensor without memory."""
    n, r = 300, 0.02
    first, wander = np.diag([0.1**2, 0.2**2]), np.diag([WANDER["gain_per_day"], WANDER["offset_per_day"]]) ** 2 * H / 86400.0
    strain, known = STRAIN[:n], (np.arange(n) % 7 == 3) * 1.0
    output = 0.9 * strain + 0.05 + r * np.random.default_rng(2).standard_normal(n)
    given = {"initial_gain_deviation": 0.1, "initial_offset_deviation": 0.2, "known_deviation": r} | WANDER
    stepper = start(compensator_model(spring(), ageing=True), rest_strain=STRAIN[0], **given)
    found = simulate(stepper, np.full(n, H), {"resistance": output, "known": known, "known_strain": strain}, OUTPUTS)
    at = np.flatnonzero(known)
    rows = np.column_stack([strain[at], np.ones(at.size)])
    times = np.minimum.outer(at + 1.0, at + 1.0)
    together = np.einsum("ia,ab,jb->ij", rows, first, rows) + times * np.einsum("ia,ab,jb->ij", rows, wander, rows)
    with_now = first @ rows.T + wander @ (rows.T * (at + 1.0))
    gain = with_now @ np.linalg.inv(together + r**2 * np.eye(at.size))
    mean = np.array([1.0, 0.0]) + gain @ (output[at] - rows @ [1.0, 0.0])
    left = first + wander * n - gain @ with_now.T
    assert [found[name][-1] for name in ("gain", "offset")] == pytest.approx(mean, abs=1e-10)
    assert [found[f"{name}_deviation"][-1] for name in ("gain", "offset")] == pytest.approx(np.sqrt(np.diag(left)), rel=1e-8)


@pytest.mark.parametrize("method", ["inverse", "estimator", "filter"])
def test_a_sensor_that_loses_a_fifth_of_its_gain_is_followed_by_every_compensator(method):
    """Strain is known every five seconds; without that it is wrong by several times as much, and the deviations are true."""
    noise = 0.0 if method == "inverse" else 1e-3
    output = GAIN * FRESH + OFFSET + noise * np.random.default_rng(1).standard_normal(N)
    known = (np.arange(N) % 50 == 49) * 1.0
    late = 0 if method == "inverse" else 24
    own = {} if method == "inverse" else {"noise": noise}
    names = ("strain", *OUTPUTS)
    found = run(models(method, ageing=True), output, known, names, known_deviation=0.005, **own, **WANDER)
    plain = run(models(method), output, **own)
    errors = [np.sqrt(np.mean((each["strain"][200 + late :] - STRAIN[200 : N - late]) ** 2)) for each in (plain, found)]
    assert errors[0] > 0.1
    assert errors[1] < 0.012
    for name, true in (("gain", GAIN), ("offset", OFFSET)):
        miss = (found[name] - true)[200:] / found[f"{name}_deviation"][200:]
        assert np.sqrt(np.mean(miss**2)) < 1.0


def test_the_prestrain_at_rest_alone_tells_the_offset_and_leaves_the_gain_to_its_deviation():
    given = {"initial_gain_deviation": 0.1, "initial_offset_deviation": 0.2, "known_deviation": 1e-3}
    rest = {"rest_strain": 0.0, "known": 1.0, "known_strain": 0.0}
    stepper = start(compensator_model(spring(), ageing=True), **given, **rest)
    drive(stepper, np.full(50, 0.03), H)
    assert stepper.get("offset") == pytest.approx(0.03, abs=1e-4)
    assert stepper.get("offset_deviation") < 2e-4
    assert stepper.get("gain") == 1.0
    assert stepper.get("gain_deviation") == pytest.approx(0.1, rel=1e-12)
    assert stepper.get("strain") == pytest.approx(0.0, abs=1e-4)


def test_what_is_not_known_for_a_century_has_a_bounded_deviation_and_a_wire_that_breaks_teaches_nothing():
    given = {"gain_per_day": 0.1, "offset_per_day": 0.1, "known_deviation": 0.01}
    stepper = start(compensator_model(spring(), ageing=True), rest_strain=0.5, **given)
    drive(stepper, np.full(10, 0.5), 10 * 365.25 * 86400.0)
    assert [stepper.get(f"{name}_deviation") for name in ("gain", "offset")] == pytest.approx([0.5, 1.0], rel=1e-12)
    stepper.set("known", 1.0)
    stepper.set("known_strain", 0.5)
    drive(stepper, [1e4, -1e4], H)
    assert (stepper.get("gain"), stepper.get("offset")) == (1.0, 0.0)
    drive(stepper, np.full(50, 3.0), H)
    assert 0.5 <= stepper.get("gain") <= 2.0
    assert stepper.get("offset") <= 1.0


def test_a_drift_that_is_negative_is_refused():
    with pytest.raises(ParameterError, match="gain_per_day"):
        start(models("inverse", ageing=True), gain_per_day=-1.0)
