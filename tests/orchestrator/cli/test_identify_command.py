"""The command ``gossamer identify``: from a CSV file to FMUs, and what it says on the way."""

import json
import re
import shlex

import fmpy
import numpy as np
import pytest
from command_line import invoke
from gossamer_models.fitting import read_record
from gossamer_models.fractional import FractionalArtifact, predict
from gossamer_models.sensor import SensorArtifact

QUICK = ["--modes", "2", "--relaxations", "1", "--starts", "1"]


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
    """The artifact is named without its ending: the folder beside it has that name."""
    out = tmp_path / "sensor.json"
    options = [*QUICK, "--train", "0:80", "--out", str(out.with_suffix(""))]
    result = invoke(["identify", str(measured), *options])
    assert result.exit_code == 0, result.output
    printed = result.stdout.split()
    assert printed[0] == str(out)
    assert {p.rsplit("/", 1)[-1] for p in printed[1:]} >= {"mu.png", "everett.png", "measured_loop.png"}
    assert {p.rsplit("/", 1)[-1] for p in printed[1:]} >= {"measured_strain.png", "measured_strain_residual.png"}
    table = (out.with_suffix("") / "measured_predicted.csv").read_text().splitlines()
    assert table[0] == "time [s],strain [1],resistance [ohm],predicted [ohm],recovered strain [1],fitted"
    assert len(table) == 241
    assert "not stated" not in result.stderr  # time, strain and resistance have units in this file
    assert "0.5 s" in result.stderr
    assert "NRMSE" in result.stderr
    assert "without holds, the data do not separate eta" in " ".join(result.stderr.split())
    assert SensorArtifact.read(out).provenance["data"] == "measured.csv"
    assert str(tmp_path) not in out.read_text()
    built = invoke(["build", "sensor", "compensator", "--artifact", str(out), "--out", str(tmp_path)])
    assert built.exit_code == 0, built.output
    assert (tmp_path / "compensator.fmu").exists()


def test_an_output_that_adds_up_over_many_cycles_is_said_in_table_answer_and_artifact(measured, tmp_path):
    out = tmp_path / "sensor.json"
    result = invoke(["identify", str(measured), *QUICK, "--no-pictures", "--json", "--out", str(out)])
    size = json.loads(result.stdout)["own_model"][0]["range_over_100_cycles"]
    assert size == pytest.approx(1.55, abs=0.05)  # eta below 1: every cycle leaves a little
    assert SensorArtifact.read(out).provenance["measured.csv over 100 cycles"] == f"{size:.2f} of range"
    told = " ".join(result.stderr.split())
    assert "range of 100 cycles" in told
    assert "over 100 cycles within its strain the sensor's output covers" in told


def test_without_options_of_a_model_it_is_chosen_and_build_takes_the_compensator_that_won(measured, tmp_path):
    out = tmp_path / "sensor.json"
    result = invoke(["identify", str(measured), "--budget", "1", "--out", str(out)])
    assert result.exit_code == 0, result.output
    told = " ".join(result.stderr.split())
    for words in (
        "choice of",
        "direct inverse",
        "static cubic",
        "regression on lags",
        "90 % confidence",
        "Chosen by predicting",
        "is in no training stretch",
    ):
        assert words in told
    page = (tmp_path / "sensor" / "report.html").read_text(encoding="utf-8")
    assert re.search(r"<summary>\d+ trials of the automatic choice</summary>", page)
    artifact = SensorArtifact.read(out)
    assert artifact.compensator in ("inverse", "estimator", "filter")
    assert f"gossamer build sensor compensator --artifact {out} --out {tmp_path}" in result.stderr
    arguments = shlex.split(re.search(r"type 'gossamer (build .*)'", result.stderr)[1])
    for more in ([], ["filter"]):  # the command that is printed, and the FMU that the scenario of gossamer new names
        built = invoke(arguments + more)
        assert built.exit_code == 0, built.output
    names = [v.name for v in fmpy.read_model_description(str(tmp_path / "compensator.fmu")).modelVariables]
    assert ("strain_deviation" in names) == (artifact.compensator != "inverse" or artifact.inverse is not None)


@pytest.mark.parametrize("kind", ["python", "native"])
def test_a_record_becomes_a_fractional_sensor_that_runs_as_its_model(measured, tmp_path, kind):
    out = tmp_path / "fractional.json"
    options = ["--model", "fractional-sub-model-1", "--terms", "2", "--train", "0:80", "--starts", "2", "--seed", "3"]
    options += ["--rest-resistance", "100", "--full-scale", "0.12", "--out", str(out)]
    result = invoke(["identify", str(measured), *options])
    assert result.exit_code == 0, result.output
    names = ("predicted.csv", "loop.png", "history.png", "residual.png")
    files = [out.with_suffix("") / name for name in (*(f"measured_{name}" for name in names), "report.html")]
    assert result.stdout.split() == [str(path) for path in (out, *files)]
    assert all(path.is_file() for path in files)
    told = " ".join(result.stderr.split())
    assert "E1 [% of change]" in told
    assert "from the given 100 ohm at rest" in told
    artifact = FractionalArtifact.read(out)
    assert (len(artifact.terms), artifact.full_scale_strain, artifact.rest_resistance) == (2, 0.12, 100.0)
    assert artifact.provenance["data"] == "measured.csv"
    assert "sub-model-1" in artifact.provenance["settings"]
    assert float(artifact.provenance["measured.csv train"].split()[1]) < 10.0
    assert str(tmp_path) not in out.read_text()

    flags = ["--native"] if kind == "native" else []
    if flags:
        pytest.importorskip("ziglang", reason="native FMUs need the compiler ziglang")
    built = invoke(["build", "sensor", *flags, "--artifact", str(out), "--out", str(tmp_path)])
    assert built.exit_code == 0, built.output
    record = read_record(measured)
    given = np.array(
        list(zip(record.time, np.append(record.strain[1:], 0.0), strict=True)), dtype=[("t", "f8"), ("strain", "f8")]
    )
    ran = fmpy.simulate_fmu(
        str(tmp_path / "sensor.fmu"), stop_time=119.5, step_size=0.5, output_interval=0.5, input=given, output=["resistance"]
    )
    assert ran["resistance"][1:] == pytest.approx(predict(artifact, record.strain, 0.5)[1:], abs=1e-6)


def test_a_fractional_model_that_needs_the_whole_record_says_so_and_is_not_built(measured, tmp_path):
    out = tmp_path / "offline.json"
    options = ["--terms", "1", "--fading", "1", "--starts", "1", "--no-pictures", "--out", str(out)]
    result = invoke(["identify", str(measured), "--model", "fractional-model-1", *options])
    assert result.exit_code == 0, result.output
    told = " ".join(result.stderr.split())
    assert "works offline only: no FMU can be built from it" in told
    assert "gossamer build" not in told
    assert "from the fitted" in told
    built = invoke(["build", "sensor", "--artifact", str(out), "--out", str(tmp_path)])
    assert (built.exit_code, built.stdout) == (1, "")
    assert "its phases need the whole record" in built.stderr
    assert "--model fractional-sub-model-1" in built.stderr
    built = invoke(["build", "compensator", "--artifact", str(out), "--out", str(tmp_path)])
    assert (built.exit_code, built.stdout) == (1, "")
    assert "has no inverse" in built.stderr
    assert "--model preisach" in built.stderr


def test_what_a_fractional_fit_assumed_of_steps_and_of_rest_is_said(measured, tmp_path):
    lines = measured.read_text().splitlines()
    measured.write_text("\n".join([*lines[:50], *lines[51:]]) + "\n")
    options = ["--model", "fractional-sub-model-1", "--terms", "1", "--starts", "1", "--no-pictures"]
    result = invoke(["identify", str(measured), *options, "--out", str(tmp_path / "s.json")])
    assert result.exit_code == 0, result.output
    told = " ".join(result.stderr.split())
    assert "samples 0.5 to 1 s apart were brought to steps of 0.5 s" in told
    assert "begins unstrained with a resistance of 100" in told
    assert "give the resistance at rest" in told


def test_kernels_may_be_fixed_in_time_and_exponent(measured, tmp_path):
    out = tmp_path / "sensor.json"
    options = ["--relaxations", "2", "--tau", "3,40", "--exponents", "0.5,1", "--starts", "1", "--no-pictures"]
    options += ["--model", "preisach-hats", "--knots", "4", "--least-slope", "0.3", "--out", str(out)]
    result = invoke(["identify", str(measured), *options])
    assert result.exit_code == 0, result.output
    artifact = SensorArtifact.read(out)
    known = {(3.0, 0.5), (40.0, 1.0)}
    assert artifact.relaxation
    assert {(round(t.rate ** (-1.0 / t.exponent), 9), t.exponent) for t in artifact.relaxation} <= known
    assert "without holds" in artifact.provenance["doubts"]
    assert "least_slope=0.3" in artifact.provenance["settings"]
    assert "knots=4" in artifact.provenance["settings"]


def test_cells_without_numbers_and_a_row_cut_short_are_told_with_the_columns_before_the_fit_and_once(measured, tmp_path):
    lines = measured.read_text().splitlines()
    for line, cells in ((10, 2), (30, 2), (31, 1), (50, 1)):
        lines[line] = ",".join([*lines[line].split(",")[:cells], *[["OL", "n/a"][cells == 1]] * (line in (10, 50))])
    measured.write_text("\n".join(lines) + "\n")
    options = [*QUICK, "--no-pictures", "--out", str(tmp_path / "s.json")]
    result = invoke(["identify", str(measured), *options])
    assert result.exit_code == 0, result.output
    said = "4 samples without a finite number were left out, the first in line 11: "
    assert result.stderr.count("236 samples of 240 rows") == result.stderr.count(said) == 1
    assert f"{said}{' | '.join(lines[10].split(','))}." in " ".join(result.stderr.split())
    assert result.stderr.index(said) < result.stderr.index("NRMSE")


def test_a_signal_whose_unit_is_not_stated_is_not_called_ohm(measured, tmp_path):
    measured.write_text(measured.read_text().replace("R_ohm", "R", 1))
    options = [*QUICK, "--no-pictures", "--out", str(tmp_path / "s.json")]
    told = {}
    for unit in ([], ["--resistance-unit", "1"], ["--resistance-unit", "ohm"]):
        result = invoke(["identify", str(measured), *options, *unit])
        assert result.exit_code == 0, result.output
        told[unit[-1] if unit else ""] = " ".join(result.stderr.split())
        header = (tmp_path / "s" / "measured_predicted.csv").read_text().splitlines()[0].split(",")[2]
        assert header == ("resistance" + f" [{unit[-1]}]" if unit else "resistance")
    assert re.search(r"from the fitted [\d.]+ \(unit not stated\) at rest", told[""])
    assert re.search(r"from the fitted [\d.]+ at rest", told["1"])
    assert re.search(r"from the fitted [\d.]+ ohm at rest", told["ohm"])
    assert ["ohm" in told[unit] for unit in ("", "1", "ohm")] == [False, False, True]


def test_a_simple_model_that_recovers_strain_better_is_a_warning_beside_the_command_to_build(measured, tmp_path):
    lines = measured.read_text().splitlines()
    cells = [line.split(",") for line in lines[1:]]
    strains = np.array([float(strain) for _, strain, _ in cells])
    ohm = 100.0 + 40.0 * strains + 10.0 * strains**3  # without memory, which the sensor below supposes alone
    rows = (f"{t},{s},{r}" for (t, s, _), r in zip(cells, ohm, strict=True))
    measured.write_text("\n".join([lines[0], *rows]) + "\n")
    options = ["--modes", "1", "--relaxations", "0", "--starts", "1", "--no-pictures", "--full-scale", "0.13"]
    result = invoke(["identify", str(measured), *options, "--out", str(tmp_path / "s.json")])
    assert result.exit_code == 0, result.output
    told = " ".join(result.stderr.split())
    warning = r"Warning: measured\.csv: a static cubic recovers the strain .* this sensor, [\d.]+ against [\d.]+ % of range"
    assert told.count("a static cubic recovers the strain") == 1
    assert re.search(rf"To build its FMUs, type '[^']+'\. {warning}", told)


def test_what_cannot_be_identified_is_said_in_one_message(measured, tmp_path):
    for arguments, message in (
        ([str(measured), "--model", "neural"], "there is no model 'neural'; choose one of auto, preisach"),
        ([str(measured), "--model", "preisach", "--budget", "9"], "--budget is the time for the choice of --model auto"),
        ([str(measured), "--modes", "3", "--budget", "9"], "and preisach chooses nothing"),
        ([str(measured), "--model", "auto", "--modes", "3"], "--model auto chooses modes itself"),
        ([str(measured), "--train", "900:"], "no sample lies in '900:'"),
        ([str(measured), "--train", "0:9000"], "measured.csv ends at 119.5 s, counted from its first sample"),
        ([str(measured), "--strain-unit", "mm"], "divide it by the gauge length first"),
        ([str(measured), "--tau", "soon"], "cannot read --tau 'soon' as numbers"),
        ([str(measured), "--tau", "3,100"], "need one value of tau per relaxation: 2 != 7"),
        ([str(measured), "--exponents", "1.5", "--relaxations", "1"], "exponents in (0, 1]"),
        ([str(measured), "--least-slope", "0"], "the least slope is 0"),
        ([str(measured), "--knots", "6"], "preisach has no knots"),
        ([str(measured), "--extension", "reversing", "--tau", "3"], "its own fixed kernels"),
        ([str(tmp_path / "absent.csv")], "cannot read"),
        ([str(measured), "--strain-unit", "1"], "but the option is 1"),
        ([str(measured), "--model", "preisach-hats", "--modes", "3"], "Leave --modes out, or choose --model preisach."),
        ([str(measured), "--terms", "3"], "preisach has no terms"),
        ([str(measured), "--model", "fractional-sub-model-1", "--direct-inverse"], "Leave --direct-inverse out"),
        ([str(measured), "--model", "fractional-sub-model-1", "--fading", "1"], "choose --model fractional-model-1."),
        ([str(measured), "--model", "fractional-sub-model-1", "--full-scale", "0.01"], "outside 0 to full scale"),
        ([str(measured), "--model", "fractional-sub-model-1", "--train", "0:5"], "samples are too few"),
    ):
        result = invoke(["identify", *arguments, "--out", str(tmp_path / "s.json")])
        assert result.exit_code == 1
        assert message in result.stderr
        assert "Traceback" not in result.output


def test_a_form_that_no_picture_has_is_refused_before_a_record_is_read(tmp_path):
    for command in (["identify"], ["assess", str(tmp_path / "sensor.json")]):
        result = invoke([*command, str(tmp_path / "measured.csv"), "--format", "gif"])
        assert result.exit_code == 2
        assert 'Choose from: "png", "svg", "pdf".' in result.stderr
