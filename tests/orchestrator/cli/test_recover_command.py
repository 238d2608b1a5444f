"""``gossamer recover``: lines of resistance in, a line of strain out for each, before the next one is read."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from command_line import invoke
from gossamer import recover
from gossamer_models import DataError, Stepper, simulate
from gossamer_models.compensator import compensator_model
from gossamer_models.live import recover_lines
from gossamer_models.sensor import Scales, TemperatureEffect, default_artifact, sensor_model

STEP = 0.02


@pytest.fixture(scope="module")
def artifact(tmp_path_factory):
    path = tmp_path_factory.mktemp("sensor") / "sensor.json"
    default_artifact().write(path)
    return path


@pytest.fixture(scope="module")
def read():
    """Strain that rises and falls, and the resistance of the shipped sensor at each step."""
    time = STEP * np.arange(200)
    strain = 0.1 * (1.0 - np.cos(3.0 * time)) * (1.0 + 0.3 * np.sin(11.0 * time))
    sensor = Stepper(sensor_model())
    sensor.initialize()
    resistance = simulate(sensor, np.full(199, STEP), {"strain": strain[1:]}, ["resistance"])["resistance"]
    return time, strain, np.append(sensor_start(), resistance)


def sensor_start():
    sensor = Stepper(sensor_model())
    sensor.initialize()
    return sensor.get("resistance")


def test_every_line_is_answered_before_the_next_one_through_a_pipe_with_a_gap(artifact, read):
    time, strain, resistance = read
    command = [sys.executable, "-m", "gossamer", "recover", str(artifact), "-"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:

        def ask(text):
            process.stdin.write(f"{text}\n")
            process.stdin.flush()
            return process.stdout.readline().strip()

        process.stdin.write("time [s],resistance [ohm]\n")
        process.stdin.flush()
        assert process.stdout.readline().strip() == "time [s],strain [1],deviation [1],delay [s]"
        found = []
        for k in range(0, 120, 1):
            line = ask(f"{float(time[k])!r},{'' if k == 60 else repr(float(resistance[k]))}")
            found.append(line.split(","))
            assert float(found[-1][0]) == time[k]
        assert found[60][1:] == ["", "", ""]
        recovered = np.array([float(cells[1] or "nan") for cells in found])
        assert np.nanmax(np.abs(recovered - strain[:120])) < 2e-3  # the gap is a longer step
        process.stdin.close()
        assert process.wait(timeout=60) == 0


@pytest.mark.parametrize("method", ["inverse", "estimator", "filter"])
def test_lines_give_what_the_compensator_gives(read, method):
    time, _, resistance = read
    model = Stepper(compensator_model(default_artifact(), method))
    model.set("resistance", float(resistance[0]))
    model.initialize()
    expected = simulate(model, np.diff(time), {"resistance": resistance[1:]}, ["strain"])["strain"]
    lines = [
        "resistance [ohm],other,time [s]",
        *(f"{r!r},x,{t!r}" for t, r in zip(time.tolist(), resistance.tolist(), strict=True)),
    ]
    found = list(recover_lines(lines, default_artifact(), method))
    assert [each.strain for each in found[1:]] == pytest.approx(expected, abs=1e-12)
    assert np.isnan(found[-1].deviation) == (method != "estimator")  # the shipped sensor has no numbers of a filter
    assert (found[-1].delay > 0.0) == (method != "inverse")


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["0,100", "0,101"], "line 2: time 0 s does not follow 0 s"),
        (["0,100", "1,high"], "line 2: 'high' is no number"),
        (["0,100", "1"], "line 2 has 1 columns"),
        (["time [ms],resistance [ohm]"], r"time is in ms; write it in s"),
        (["time,strain"], "names no single column 'resistance'"),
    ],
)
def test_a_line_that_cannot_be_read_is_named(lines, message):
    with pytest.raises(DataError, match=message):
        list(recover_lines(lines, default_artifact()))


def test_a_file_is_read_to_its_end(artifact, read, tmp_path, capsys):
    time, _, resistance = read
    path = tmp_path / "resistance.csv"
    np.savetxt(path, np.column_stack([time, resistance])[:20], delimiter=",", header="time,resistance", comments="")
    result = invoke(["recover", str(artifact), str(path), "--method", "estimator", "--set", "noise=0.05"])
    assert result.exit_code == 0, result.output
    assert len(result.stdout.splitlines()) == 21
    assert recover(artifact, path).sentence == "Recovered strain from 20 readings."
    assert len(capsys.readouterr().out.splitlines()) == 21


def test_a_sensor_that_feels_temperature_needs_it_and_recovers_the_same_strain_warm_and_cold(read):
    time, _, cold = read
    effect = TemperatureEffect(reference=293.0, gain=2e-3, offset=0.01)
    scales = Scales(full_scale_strain=0.3, rest_resistance=100.0, full_scale_resistance_change=100.0)
    sensor = replace(default_artifact(), temperature=effect, scales=scales)
    model = Stepper(sensor_model(sensor))
    model.set("temperature", 313.0)
    model.initialize()
    first = model.get("resistance")
    inputs = {"strain": read[1][1:], "temperature": np.full(len(time) - 1, 313.0)}
    warm = np.append(first, simulate(model, np.diff(time), inputs, ["resistance"])["resistance"])
    assert np.ptp(warm) > 1.03 * np.ptp(cold)
    lines = [
        f"{t!r},{r!r},{'' if k == 70 else 313.0}" for k, (t, r) in enumerate(zip(time.tolist(), warm.tolist(), strict=True))
    ]
    found = np.array([each.strain for each in recover_lines(lines, sensor, "inverse")])
    assert np.abs(found - read[1]).max() < 1e-9
    with pytest.raises(DataError, match=r"line 1 has 2 columns: .* The sensor takes time, resistance, temperature"):
        list(recover_lines(["0,1000"], sensor))


@pytest.mark.parametrize(("begin", "says"), [(b"\xef\xbb\xbf", ""), (b"0.01,1\xbf0\n", "line 1: '1\ufffd0' is no number")])
def test_a_stream_may_begin_with_a_byte_order_mark_and_noise_on_its_line_is_refused(artifact, tmp_path, begin, says):
    path = tmp_path / "lines.csv"
    path.write_bytes(begin + b"0.02,100.0\n0.04,100.1\n")
    result = invoke(["recover", str(artifact), str(path)])
    assert result.exit_code == (1 if says else 0)
    assert says in result.stderr
    assert says or len(result.stdout.splitlines()) == 3
