"""The direct inverse: its operators beside their equations, its delay, and what it makes of records."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import Stepper, simulate
from gossamer_models.compensator import compensator_model
from gossamer_models.errors import GossamerError
from gossamer_models.fitting.records import cut
from gossamer_models.sensor import SensorArtifact, sensor_model
from gossamer_models.sensor.fit.direct import fit_direct, recovered
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.direct import direct_inverse, features, read
from oracles.preisach import drive, spring, start
from oracles.records import record, zigzag

RESULTS = ["strain", "present_strain", "strain_deviation", "delay"]
H = 0.1


def run(inverse, measured, h=H, **parameters):
    model = compensator_model(replace(spring(), inverse=inverse))
    return simulate(start(model, **parameters), np.broadcast_to(h, len(measured)), {"resistance": measured}, RESULTS)


def some_outputs(n=60, seed=5):
    return np.clip(np.cumsum(np.random.default_rng(seed).normal(0.0, 0.2, n)) + 0.5, 0.0, 1.2)


def test_strain_and_deviation_are_those_of_the_equations():
    y = some_outputs()
    found = run(direct_inverse(), y)
    strain, deviation = read(direct_inverse().networks, features(y, H))
    assert found["strain"] == pytest.approx(strain, abs=1e-5)  # the oracle's low-passes are integrated
    assert found["strain_deviation"] == pytest.approx(deviation, abs=1e-5)
    assert found["present_strain"].tolist() == found["strain"].tolist()
    assert not found["delay"].any()
    assert np.ptp(strain) > 0.2


def test_the_delayed_strain_is_told_by_the_outputs_since():
    """Its networks see what those of the present one saw three samples ago, and what the output has changed by since."""
    ahead, y = (1, 3), some_outputs()
    inverse = direct_inverse(ahead)
    found, rows = run(inverse, y), features(y, H)
    u = rows[:, 0]
    since = np.column_stack([u[1:-2], u[3:]]) - u[:-3, None]
    strain, deviation = read(inverse.later, np.hstack([rows[:-3], since]))
    assert found["delay"][3:] == pytest.approx(3 * H)
    assert found["strain"][3:] == pytest.approx(strain, abs=1e-5)
    assert found["strain_deviation"][3:] == pytest.approx(deviation, abs=1e-5)
    assert found["present_strain"] == pytest.approx(read(inverse.networks, rows)[0], abs=1e-5)


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(1, 5)), min_size=2, max_size=8))
@settings(deadline=None, max_examples=25)
def test_a_ramp_may_be_cut_into_any_steps(ramps):
    """Without delay every operator is exact for an output that is linear over a step."""
    ends = np.array([0.5, *(end for end, _ in ramps)])
    cuts = [1, *(parts for _, parts in ramps)]
    fine = np.concatenate(
        [[0.5], *(np.linspace(a, b, k + 1)[1:] for a, b, k in zip(ends[:-1], ends[1:], cuts[1:], strict=True))]
    )
    h = np.concatenate([[H], *(np.full(k, H / k) for k in cuts[1:])])
    last = np.cumsum(cuts) - 1
    assert run(direct_inverse(), fine, h)["strain"][last] == pytest.approx(run(direct_inverse(), ends)["strain"], abs=1e-9)


def test_samples_that_are_closer_than_those_of_training_are_left_out_of_the_delay():
    """Four times as many samples: the strain is as late, in seconds, and hardly another one."""
    y = 0.5 + 0.3 * np.sin(np.linspace(0.0, 9.0, 91))
    fine = np.interp(np.arange(0.0, 90.0 + 1e-9, 0.25), np.arange(91.0), y)
    inverse = direct_inverse((1, 2, 3), step=0.9 * H)
    coarse, found = run(inverse, y), run(inverse, fine, H / 4.0)
    assert found["strain"][4::4] == pytest.approx(coarse["strain"][1:], abs=0.01)
    assert found["delay"][40:].min() == pytest.approx(3 * H)
    assert found["delay"][40:].max() == pytest.approx(3 * H + 0.75 * H)


def test_a_low_pass_on_the_resistance_acts_before_the_inverse():
    y = some_outputs()
    plain = run(direct_inverse(), y)["strain"]
    assert np.abs(run(direct_inverse(), y, filter_time=0.3)["strain"] - plain).max() > 0.01


def test_every_parameter_changes_the_strain():
    model = compensator_model(replace(spring(), inverse=direct_inverse((1, 2))))
    changes = {
        "rest_resistance": 0.05,
        "full_scale_resistance_change": 1.3,
        "full_scale_strain": 0.7,
        "rest_strain": 0.2,
        "filter_time": 0.5,
        "gain_per_kelvin": 0.01,
        "offset_per_kelvin": 0.01,
        "reference_temperature": 310.0,
    }
    assert set(changes) == {v.name for v in model.variables if v.causality == "parameter"}

    def strains(**parameters):
        stepper = start(model, **parameters)
        return [stepper.get("strain"), *drive(stepper, [0.3, 0.6, 0.4, 0.5])]

    usual = {"filter_time": 0.2, "gain_per_kelvin": 0.02, "temperature": 300.0}
    plain = np.array(strains(**usual))
    for name, value in changes.items():
        assert np.abs(strains(**usual | {name: value}) - plain).max() > 1e-3, name


@pytest.mark.parametrize("measured", [1e300, -1e300])
def test_no_resistance_leaves_the_range_or_is_no_number_later(measured):
    found = run(direct_inverse((1, 2)), [0.5, 0.5, measured, *[0.5] * 400])
    assert all(np.isfinite(values).all() for values in found.values())
    assert ((found["strain"] >= 0.0) & (found["strain"] <= 1.0)).all()


STRAIN = zigzag(turns=60, per=12)
OUTPUT = drive(start(sensor_model()), STRAIN, H)
MADE = record(STRAIN, 100.0 + 50.0 * OUTPUT)
ROWS = (np.arange(STRAIN.size) < 0.6 * STRAIN.size,)


@pytest.fixture(scope="module")
def fitted():
    return fit_direct((MADE,), ROWS, 1.0, delay=6)


def test_strain_is_recovered_from_samples_that_it_was_not_trained_on_and_the_deviation_says_how_well(fitted):
    told = recovered(fitted, MADE)
    late = ~ROWS[0] & np.isfinite(told[:, 0])
    error = (told[:, 0] - STRAIN)[late]
    cubic = np.polynomial.Polynomial.fit(MADE.resistance[ROWS[0]], STRAIN[ROWS[0]], 3)(MADE.resistance) - STRAIN
    assert np.sqrt(np.mean(error**2)) < 0.6 * np.sqrt(np.mean(cubic[late] ** 2))
    deviation = fitted.factor * np.sqrt(told[late, 1] ** 2 + fitted.floor**2 + (0.2 * told[late, 2]) ** 2)
    assert np.mean(np.abs(error) < 1.96 * deviation) > 0.85
    assert np.sqrt(np.mean(deviation**2)) < 4.0 * np.sqrt(np.mean(error**2))


def test_samples_that_are_not_even_are_as_late_in_training_as_in_the_compensator():
    """Every third sample comes soon after the one before, and is left out of the delay."""
    k, even = np.arange(STRAIN.size), H * np.arange(STRAIN.size)
    times = H * (k - 0.8 * (k % 3 == 1))
    uneven = replace(
        MADE, time=times, **{name: np.interp(times, even, getattr(MADE, name)) for name in ("strain", "resistance")}
    )
    errors = []
    for delay in (0, 6):
        told = recovered(fit_direct((uneven,), ROWS, 1.0, delay=delay, calibrated=False), uneven)[:, 0]
        late = ~ROWS[0] & np.isfinite(told)
        errors.append(np.sqrt(np.mean((told - uneven.strain)[late] ** 2)))
    assert errors[1] < 1.3 * errors[0]


def test_what_comes_after_training_changes_nothing(fitted):
    later = replace(MADE, strain=np.where(ROWS[0], STRAIN, 0.5), resistance=np.where(ROWS[0], MADE.resistance, 120.0))
    assert fit_direct((later,), ROWS, 1.0, delay=6) == fitted


def test_a_strain_that_is_not_delayed_has_the_networks_of_the_present_one():
    early = cut(ROWS, 0.6)[0]
    one, other = (fit_direct((MADE,), early, 1.0, delay=delay, calibrated=False) for delay in (0, 6))
    assert one.networks == other.networks
    assert (one.ahead, other.ahead) == ((), (1, 2, 3, 4, 6))


def test_an_inverse_without_networks_or_with_a_falling_range_is_refused(tmp_path):
    for wrong in ({"networks": ()}, {"later": ()}):
        with pytest.raises(GossamerError, match="lacks networks"):
            replace(spring(), inverse=replace(direct_inverse((1, 2)), **wrong))
    with pytest.raises(GossamerError, match="rising range"):
        replace(direct_inverse(), lowest=1.0)
    with pytest.raises(GossamerError, match="see 5 features"):
        replace(direct_inverse(), networks=direct_inverse((1,)).later)
    path = tmp_path / "sensor.json"
    artifact = replace(spring(), inverse=direct_inverse((1, 2)))
    artifact.write(path)
    assert SensorArtifact.read(path) == artifact


def test_fewer_samples_than_the_delay_are_refused_and_a_record_that_short_has_no_strain(fitted):
    with pytest.raises(GossamerError, match="too few samples for a strain that is 24 samples late"):
        fit_direct((MADE,), (np.arange(STRAIN.size) < 20,), 1.0, delay=24, calibrated=False)
    assert np.isnan(recovered(fitted, MADE.at(np.arange(4)))[-2:]).all()


def test_a_constant_resistance_is_refused():
    still = replace(MADE, resistance=np.full(STRAIN.size, 100.0))
    with pytest.raises(GossamerError, match="the resistance is constant"):
        fit_direct((still,), ROWS, 1.0)


def test_the_compensator_is_a_stepper_that_any_host_may_run():
    stepper = Stepper(compensator_model(replace(spring(), inverse=direct_inverse((1, 2)))))
    stepper.initialize()
    stepper.step(0.1)
    assert np.isfinite(stepper.get("strain"))
