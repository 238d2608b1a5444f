"""``gossamer identify --from-twin``: a record of resistance in flight in, an artifact for each sensor out."""

import numpy as np
import pytest
from command_line import invoke
from gossamer import Recalibration, identify, recalibrating
from gossamer_models.membrane import square_structure
from gossamer_models.sensor import SensorArtifact, default_artifact
from gossamer_models.twin import MembraneForward, Twin

pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")

STEP, STEPS = 3e-4, 600


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """Resistance of four sensors, the third of which is 8 % more sensitive than its model; 20 % damage in zone 6."""
    structure = square_structure(4, 1)
    bank = Twin(structure, sensor=default_artifact()).bank
    strain = MembraneForward(structure).strain(0.2 * np.eye(16)[5:6], {}, {}, STEPS, STEP)
    read = bank.read(strain, STEP)[0][0]
    read[2] += 0.08 * (read[2] - read[2, 0])
    read += 0.05 * np.random.default_rng(1).standard_normal(read.shape)
    path = tmp_path_factory.mktemp("flight") / "flight.csv"
    head = "time [s]," + ",".join(f"resistance[{k}] [ohm]" for k in range(1, 5))
    np.savetxt(path, np.column_stack([STEP * np.arange(1, STEPS + 1), read.T]), delimiter=",", header=head, comments="")
    return path


@pytest.fixture
def coarse(monkeypatch):
    """Let the square of the twin have the mesh that made the record, so that a simulation costs little."""
    own = recalibrating.TwinOptions
    monkeypatch.setattr(recalibrating, "TwinOptions", lambda **given: own(**given | {"order": 1}))


@pytest.mark.usefixtures("coarse")
def test_each_sensor_of_a_flight_gets_an_artifact_and_the_one_that_is_off_is_told(flight, tmp_path):
    result = invoke(["identify", "--from-twin", str(flight), "--out", str(tmp_path / "sensors")])
    assert result.exit_code == 0, result.output
    said = " ".join(result.stderr.split())
    assert "beyond that its tables are the old ones." in said
    found = identify(flight, from_twin=True, out=tmp_path / "again")
    assert isinstance(found, Recalibration)
    assert found.sentence.startswith("Identified 4 sensors again, from the strain of the twin: off by up to")
    assert found.data["before"].to_numpy().argmax() == 2
    assert found.data["before"].to_numpy()[2] > 5.0 * found.data["after"].to_numpy()[2]
    assert found.sensors[3].gain[0] == pytest.approx(1.08, abs=max(0.01, 3.0 * found.sensors[3].gain[1]))
    assert found.sensors[1].gain[0] == pytest.approx(1.0, abs=max(0.01, 3.0 * found.sensors[1].gain[1]))
    page = (tmp_path / "sensors" / "report.html").read_text(encoding="utf-8")
    assert "Sensors identified again from flight.csv" in page
    assert all(f"Sensor {k}" in page for k in range(1, 5))
    for k, each in found.sensors.items():
        assert SensorArtifact.read(tmp_path / "sensors" / f"sensor_{k}.json") == each.artifact


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--from-twin", "--model", "preisach"], "--model is not for --from-twin, which keeps to the old"),
        (["--sensor", "old.json"], "--sensor is for --from-twin. Leave it out."),
        (["more.csv", "--from-twin"], "a twin explains one record at a time, not 2"),
    ],
)
def test_what_does_not_go_with_it_is_refused(flight, tmp_path, options, message):
    result = invoke(["identify", str(flight), *options, "--out", str(tmp_path / "sensors")])
    assert result.exit_code != 0
    assert message in " ".join(result.stderr.split())
