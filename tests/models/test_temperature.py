"""Temperature: what it does to sensor and compensators, and how it is found from records that hold it."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import Stepper, simulate
from gossamer_models.compensator import compensator_model
from gossamer_models.errors import DataError
from gossamer_models.fitting import read_record
from gossamer_models.fitting.records import Record
from gossamer_models.identify import identify_files, settings_for
from gossamer_models.sensor import SensorArtifact, TemperatureEffect, default_artifact, sensor_model
from gossamer_models.sensor.fit.temperature import fit_warming

H, N = 0.1, 1600
rng = np.random.default_rng(0)
STRAIN = np.interp(np.arange(N), np.linspace(0, N, 40), rng.uniform(0.05, 0.45, 40))
KELVIN = 295.0 + 5.0 * np.sin(2.0 * np.pi * np.arange(N) / 700)
WARM = {"gain_per_kelvin": 2e-3, "offset_per_kelvin": 0.3, "reference_temperature": 295.0}
NOISE = 0.05 * rng.standard_normal(N)


def run(model, inputs, output, **parameters):
    stepper = Stepper(model, rest_strain=STRAIN[0], **parameters)
    stepper.initialize()
    return simulate(stepper, np.full(N, H), inputs, [output])[output]


COLD = run(sensor_model(), {"strain": STRAIN}, "resistance")
HOT = run(sensor_model(), {"strain": STRAIN, "temperature": KELVIN}, "resistance", **WARM)


def measured(resistance, temperature=KELVIN):
    time = H * np.arange(N)
    return Record(name="warm", time=time, strain=STRAIN, resistance=resistance, lines=np.arange(N), temperature=temperature)


def written(path, resistance, head="temperature [degC]", shift=-273.15):
    columns = [H * np.arange(N), STRAIN, resistance, KELVIN + shift]
    named = f"time [s],strain [1],resistance [ohm],{head}"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=named, comments="", fmt="%.9g")
    return path


def test_a_warm_sensor_has_another_gain_about_another_resistance_at_rest():
    dT = KELVIN - 295.0
    assert pytest.approx(100.0 + 0.3 * dT + (1.0 + 2e-3 * dT) * (COLD - 100.0), rel=1e-13) == HOT


@pytest.mark.parametrize("method", ["inverse", "estimator", "filter"])
@pytest.mark.parametrize("ageing", [False, True])
def test_a_compensator_that_is_given_the_temperature_recovers_what_it_recovers_at_the_reference(method, ageing):
    """Also behind the stage that follows ageing, once it has learned."""
    model = compensator_model(None, method, ageing=ageing)
    cold, hot = {"resistance": COLD + NOISE}, {"resistance": HOT + NOISE * (1.0 + 2e-3 * (KELVIN - 295.0))}
    hot["temperature"] = KELVIN
    known = {"known": (np.arange(N) % 50 == 49) * 1.0, "known_strain": STRAIN} if ageing else {}
    age = {"initial_gain_deviation": 0.1, "offset_per_day": 10.0} if ageing else {}
    expected = run(model, cold | known, "strain", **age)
    assert run(model, hot | known, "strain", **age, **WARM) == pytest.approx(expected, abs=1e-7)


def test_the_effect_is_found_beside_the_sensor_within_its_deviations():
    found = fit_warming([measured(HOT + NOISE)], [np.arange(N) < 0.7 * N], 0.5)
    assert found is not None
    assert found.clear
    assert found.a == pytest.approx(2e-3, abs=3.0 * found.deviations[0])
    assert found.b == pytest.approx(0.3 + 2e-3 * (found.level - 100.0), abs=3.0 * found.deviations[1])
    assert found.deviations[0] < 1e-3
    effect = found.effect(100.0, 100.0)
    assert 100.0 * effect.offset == pytest.approx(0.3, abs=0.1)
    back = found.at_reference(measured(HOT))
    assert found.done(back, back.resistance) == pytest.approx(HOT, rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_that_temperature_leaves_alone_is_left_alone(seed):
    noise = 0.05 * np.random.default_rng(seed).standard_normal(N)
    found = fit_warming([measured(COLD + noise)], [np.arange(N) < 0.7 * N], 0.5)
    assert found is not None
    assert not found.clear
    assert "not taken into account" in found.sentence
    assert fit_warming([measured(COLD, np.full(N, 293.0))], [np.arange(N) < 0.7 * N], 0.5) is None


def test_a_record_with_a_column_of_temperature_gives_a_sensor_that_knows_what_it_does(tmp_path):
    """Beside the sensor of the same record without the column, on the later part, which is colder."""
    settings = settings_for("preisach-hats", starts=1, relaxations=2)
    warm = identify_files([written(tmp_path / "warm.csv", HOT + NOISE)], settings=settings)
    blind = identify_files([written(tmp_path / "blind.csv", HOT + NOISE, head="T_room")], settings=settings)
    errors = [each.errors[1].nrmse for each in (warm, blind)]
    assert errors[0] < 0.5 * errors[1]
    effect = warm.fit.artifact.temperature
    assert isinstance(effect, TemperatureEffect)
    assert blind.fit.artifact.temperature is None
    assert any("A kelvin above" in text for text in warm.remarks)
    assert warm.in_its_file(0)[0].resistance == pytest.approx(HOT + NOISE, rel=1e-8)
    path = tmp_path / "sensor.json"
    warm.fit.artifact.write(path)
    artifact = SensorArtifact.read(path)
    starts = {v.name: v.start for v in compensator_model(artifact, ageing=True).variables}
    assert starts["temperature"] == starts["reference_temperature"] == effect.reference
    assert starts["gain_per_kelvin"] == effect.gain
    assert starts["offset_per_kelvin"] == effect.offset * artifact.scales.full_scale_resistance_change


@pytest.mark.parametrize(
    ("head", "shift"), [("temperature [degC]", -273.15), ("Temp (K)", 0.0), ("Temperatur [°C]", -273.15)]
)
def test_temperature_is_read_in_kelvin(tmp_path, head, shift):
    record = read_record(written(tmp_path / "record.csv", HOT, head, shift))
    assert record.temperature == pytest.approx(KELVIN, abs=1e-6)
    assert record.summary.quantities[-1].column.name == head


def test_temperature_without_a_unit_is_not_read(tmp_path):
    assert read_record(written(tmp_path / "record.csv", HOT, "temperature")).temperature is None


def test_temperature_must_be_finite_and_the_reference_absolute():
    with pytest.raises(DataError, match="not finite"):
        measured(HOT, np.where(np.arange(N) == 5, np.nan, KELVIN))
    with pytest.raises(ValueError, match="absolute temperatures"):
        replace(default_artifact(), temperature=TemperatureEffect(reference=-3.0, gain=0.0, offset=0.0))
