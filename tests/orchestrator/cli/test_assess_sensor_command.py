"""The command ``gossamer assess``: a sensor judged on another record, and what it says on the way."""

from dataclasses import replace

import numpy as np
import pytest
from command_line import invoke
from gossamer_models.sensor import Scales, default_artifact


@pytest.fixture
def folder(tmp_path):
    """The sensor that ships with the package, with scales, and a record in units of its own."""
    scales = Scales(rest_resistance=1000.0, full_scale_resistance_change=300.0, full_scale_strain=0.1)
    replace(default_artifact(), scales=scales).write(tmp_path / "sensor.json")
    time = 0.5 * np.arange(300)
    strain = 0.04 * (1.0 - np.cos(0.25 * time))
    rows = zip(1e3 * time, 100.0 * strain, 1.1 + 3.0 * strain + 1e-4 * time, strict=True)
    text = "".join(f"{t};{s};{r}\n".replace(".", ",") for t, s, r in rows)
    (tmp_path / "other.csv").write_text("Zeit;Dehnung;R\nms;%;kΩ\n" + text, encoding="utf-16")
    return tmp_path


def test_another_record_is_read_judged_and_drawn(folder):
    out = folder / "out"
    arguments = [str(folder / name) for name in ("sensor.json", "other.csv")]
    result = invoke(["assess", *arguments, "--fit-scales", "--out", str(out)])
    assert result.exit_code == 0, result.output
    names = ("predicted.csv", "loop.png", "history.png", "residual.png", "strain.png", "strain_residual.png")
    files = [out / name for name in (*(f"other_{name}" for name in names), "report.html")]
    assert result.stdout.split() == [str(path) for path in files]
    assert all(path.is_file() for path in files)
    told = result.stderr
    assert told.index("UTF-16, semicolons") < told.index("NRMSE")  # what was read stands before any result
    for text in ("decimal commas", "kΩ", "ms", "0 to 7.9", "300 samples", "0.5 s", "no gap", "scales fitted"):
        assert text in told, text


def test_without_scales_of_its_own_the_record_is_judged_as_it_is(folder):
    arguments = [str(folder / name) for name in ("sensor.json", "other.csv")]
    options = ["--no-pictures", "--out", str(folder / "out"), "--compensator", "exact", "--stretch", "0:60"]
    result = invoke(["assess", *arguments, *options])
    assert result.exit_code == 0, result.output
    assert "the sensor knows nothing of these records" in " ".join(result.stderr.split())
    assert (folder / "out" / "other_predicted.csv").read_text().splitlines()[1].endswith(",0")


def test_what_cannot_be_assessed_is_said_in_one_message(folder):
    for arguments, message in (
        (["absent.json", "other.csv"], "Make it with 'gossamer identify'"),
        (["sensor.json", "absent.csv"], "cannot read"),
        (["sensor.json", "other.csv", "--compensator", "oracle"], "Choose one of inverse, estimator, filter, exact."),
        (["sensor.json", "other.csv", "--strain-unit", "1"], "column 'Dehnung' is in 1, but the row of units says %"),
        (["sensor.json", "other.csv", "--stretch", "900:"], "no sample lies in '900:'"),
        (["sensor.json", "other.csv", "--stretch", "0:900"], "other.csv ends at 149.5 s"),
    ):
        paths = [str(folder / each) if each.endswith((".json", ".csv")) else each for each in arguments]
        result = invoke(["assess", *paths, "--out", str(folder / "out")])
        assert (result.exit_code, result.stdout) == (1, "")
        assert message in result.stderr
        assert "Traceback" not in result.output
