"""The command ``gossamer identify``: from a CSV file to FMUs, and what it says on the way."""

import numpy as np
import pytest
from gossamer_models.sensor import SensorArtifact
from gossamer_orchestrator.cli import app
from typer.testing import CliRunner


@pytest.fixture
def measured(tmp_path):
    """A small record: an elastic sensor with a play of 10 % and a little drift."""
    time = 0.5 * np.arange(240)
    strain = 0.04 * (1.0 - np.cos(0.25 * time)) * (0.5 + time / 240.0)
    play = np.zeros_like(strain)
    for k in range(1, strain.size):
        play[k] = max(strain[k] - 0.004, min(strain[k] + 0.004, play[k - 1]))
    resistance = 100.0 + 400.0 * strain + 600.0 * play + 0.01 * time
    path = tmp_path / "measured.csv"
    rows = zip(time, 100.0 * strain, resistance, strict=True)
    path.write_text("time_s,strain [%],R_ohm\n" + "".join(f"{t},{s},{r}\n" for t, s, r in rows))
    return path


def test_a_record_becomes_an_artifact_pictures_and_fmus(measured, tmp_path):
    out = tmp_path / "sensor.json"
    options = ["--modes", "2", "--relaxations", "1", "--train", "0:80", "--starts", "1", "--out", str(out)]
    result = CliRunner().invoke(app, ["identify", str(measured), *options])
    assert result.exit_code == 0, result.output
    printed = result.stdout.split()
    assert printed[0] == str(out)
    assert {p.rsplit("/", 1)[-1] for p in printed[1:]} >= {"mu.png", "eta.png", "everett.png", "measured_loop.png"}
    assert "NRMSE" in result.stderr
    assert "without holds, eta" in " ".join(result.stderr.split())
    assert SensorArtifact.read(out).provenance["data"] == "measured.csv"
    assert str(tmp_path) not in out.read_text()
    built = CliRunner().invoke(app, ["build", "sensor", "compensator", "--artifact", str(out), "--out", str(tmp_path)])
    assert built.exit_code == 0, built.output
    assert (tmp_path / "compensator.fmu").exists()


def test_kernels_may_be_fixed_in_time_and_exponent(measured, tmp_path):
    out = tmp_path / "sensor.json"
    options = ["--relaxations", "2", "--tau", "3,40", "--exponents", "0.5,1", "--starts", "1", "--no-pictures"]
    options += ["--model", "preisach-hats", "--knots", "4", "--out", str(out)]
    result = CliRunner().invoke(app, ["identify", str(measured), *options])
    assert result.exit_code == 0, result.output
    artifact = SensorArtifact.read(out)
    known = {(3.0, 0.5), (40.0, 1.0)}
    assert artifact.relaxation
    assert {(round(t.rate ** (-1.0 / t.exponent), 9), t.exponent) for t in artifact.relaxation} <= known
    assert "without holds" in artifact.provenance["doubts"]
    assert "n_knots=4" in artifact.provenance["settings"]


def test_what_cannot_be_identified_is_said_in_one_message(measured, tmp_path):
    for arguments, message in (
        ([str(measured), "--model", "neural"], "there is no 'neural'"),
        ([str(measured), "--train", "900:"], "no sample lies in '900:'"),
        ([str(measured), "--tau", "soon"], "cannot read --tau 'soon' as numbers"),
        ([str(measured), "--tau", "3,100"], "need one of tau per relaxation: 2 != 7"),
        ([str(measured), "--exponents", "1.5", "--relaxations", "1"], "exponents in (0, 1]"),
        ([str(measured), "--knots", "6"], "preisach has no knots"),
        ([str(measured), "--extension", "reversing", "--tau", "3"], "fixed kernels of its own"),
        ([str(tmp_path / "absent.csv")], "cannot read"),
        ([str(measured), "--strain-unit", "1"], "the option says 1"),
    ):
        result = CliRunner().invoke(app, ["identify", *arguments, "--out", str(tmp_path / "s.json")])
        assert result.exit_code == 1
        assert message in result.stderr
        assert "Traceback" not in result.output
