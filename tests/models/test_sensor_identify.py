"""Identification: on measured data, on a known sensor, and what it refuses."""

from pathlib import Path

import numpy as np
import pytest
from gossamer_models import DataError, ParameterError
from gossamer_models.sensor import SensorArtifact, default_artifact, sensor_model
from gossamer_models.sensor.identify import FitSettings, app, identify, read_record
from oracles_preisach import drive, start
from typer.testing import CliRunner

RECORD = Path(__file__).parents[2].parent / "shared" / "data" / "nylon_silver" / "strain_triangular.csv"
needs_data = pytest.mark.skipif(not RECORD.exists(), reason=f"measured data are not here: {RECORD}")


@needs_data
def test_the_default_sensor_reaches_its_stated_error_on_the_data():
    strain, measured = read_record(RECORD, "output", "input")
    stated = default_artifact().provenance
    y = drive(start(sensor_model(), rest_strain=strain[0]), strain, 0.1)
    error = (float(stated["offset"]) + float(stated["scale"]) * y - measured) / np.ptp(measured)
    half = strain.size // 2
    for part, name in ((error[10:half], "train"), (error[half:], "test")):
        rms = 100.0 * np.sqrt(np.mean(part**2))
        assert rms == pytest.approx(float(stated[f"{name}_error_percent_of_range"]), abs=0.002)
    assert rms < 2.3  # the trial with separate weights, linear least squares


@needs_data
def test_the_command_reproduces_the_shipped_sensor(tmp_path):
    out = tmp_path / "sensor.json"
    result = CliRunner().invoke(app, [str(RECORD), "--out", str(out)])
    assert result.exit_code == 0, result.output
    again, shipped = SensorArtifact.read(out), default_artifact()
    assert np.array(again.mu) == pytest.approx(np.array(shipped.mu), rel=1e-3, abs=1e-4)
    assert again.relaxation[0].amplitude == pytest.approx(shipped.relaxation[0].amplitude, rel=1e-3)
    assert again.provenance["sha256"] == shipped.provenance["sha256"]
    assert str(tmp_path) not in again.provenance["data"]


def test_a_known_sensor_is_found_again():
    rng = np.random.default_rng(4)
    strain = np.concatenate(
        [np.linspace(a, b, 12)[1:] for a, b in np.lib.stride_tricks.sliding_window_view(rng.uniform(0, 1, 60), 2)]
    )
    output = 3.0 + 2.0 * drive(start(sensor_model(), rest_strain=strain[0]), strain, 0.1)
    found = identify(strain, output, 0.1, FitSettings(skip=0, ridge=1e-6, least_spring=0.01, least_amplitudes=(0.0,)))
    assert found.train_error < 0.1
    assert found.test_error < 0.2
    assert found.eta == pytest.approx(float(default_artifact().provenance["eta"]), abs=1e-3)
    assert found.scale == pytest.approx(2.0, rel=0.01)
    assert found.offset == pytest.approx(3.0, abs=0.01)


@pytest.mark.parametrize(
    ("strain", "output", "h", "message"),
    [
        (np.linspace(0, 1, 20), np.linspace(0, 1, 20), 0.1, "too few"),
        (np.linspace(0, 1, 400), np.linspace(0, 1, 300), 0.1, "one length"),
        (np.linspace(0, 2, 400), np.linspace(0, 1, 400), 0.1, "from 0 to 2"),
        (np.linspace(0, 1, 400), np.ones(400), 0.1, "constant"),
        (np.linspace(0, 1, 400), np.linspace(0, 1, 400), 0.0, "positive time"),
    ],
)
def test_an_unusable_record_is_refused(strain, output, h, message):
    with pytest.raises(DataError, match=message):
        identify(strain, output, h)


def test_settings_that_do_not_fit_together_are_refused():
    with pytest.raises(ParameterError, match="one least amplitude per term"):
        FitSettings(least_amplitudes=())
    with pytest.raises(ParameterError, match="more lines than knots"):
        FitSettings(n_lines=4)


def test_the_command_prints_an_expected_error_alone(tmp_path):
    record = tmp_path / "record.csv"
    record.write_text("a,b\n1,2\n")
    result = CliRunner().invoke(app, [str(record), "--out", str(tmp_path / "x.json")])
    assert result.exit_code == 1
    assert "cannot read columns" in result.output
