"""``gossamer calibrate``: healthy records in, a table of numbers and a JSON file out, which a twin and a watch take."""

import json

import numpy as np
import pytest
from command_line import invoke
from gossamer import Calibrated, calibrate
from gossamer_models.membrane import square_structure
from gossamer_models.twin import MembraneForward

pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")

MESH = ("--elements-per-side", "4", "--order", "1")
STEP, STEPS, NOISE = 3e-4, 400, 5e-4


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """Two healthy records of a square that is stretched 6 % more than drawn, and one with 20 % in zone 6."""
    folder, random = tmp_path_factory.mktemp("records"), np.random.default_rng(1)
    forward = MembraneForward(square_structure(4, 1), {"edge_displacement": 0.00636})
    for name, load, depth in (("a", 1.0, 0.0), ("b", 1.05, 0.0), ("torn", 1.0, 0.2)):
        damage = depth * np.eye(16)[5:6]
        strain = forward.strain(damage, {"pressure_amplitude": np.array([1e4 * load])}, {}, STEPS, STEP)[0]
        strain = strain + NOISE * random.standard_normal(strain.shape)
        head = "time [s]," + ",".join(f"strain[{k}] [1]" for k in range(1, 5))
        table = np.column_stack([STEP * np.arange(1, STEPS + 1), strain.T])
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header=head, comments="")
    return folder


def test_healthy_records_calibrate_and_a_twin_and_a_watch_take_it(records, tmp_path):
    out = tmp_path / "square.json"
    healthy = [str(records / name) for name in ("a.csv", "b.csv")]
    result = invoke(["calibrate", *healthy, *MESH, "--no-mesh-error", "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert "prestrain" in result.stderr
    assert f"--calibration {out}" in " ".join(result.stderr.split())
    known = json.loads(out.read_text(encoding="utf-8"))
    assert known["valid"]
    assert known["factors"][known["names"].index("prestrain")] == pytest.approx(1.06, abs=0.01)
    given = [*MESH, "--calibration", str(out), "--noise", str(NOISE)]
    torn = invoke(["twin", str(records / "torn.csv"), *given, "--out", str(tmp_path / "twin.json")])
    assert torn.exit_code == 0, torn.output
    damage = json.loads((tmp_path / "twin.json").read_text(encoding="utf-8"))["damage"]
    assert damage[5] == pytest.approx(0.2, abs=0.03)
    watched = invoke(["watch", str(records / "b.csv"), *given, "--out", str(tmp_path / "watch.json")])
    assert watched.exit_code == 0, watched.output
    assert "0 alarms in 2 windows" in watched.stderr


def test_a_torn_structure_is_no_healthy_one(records, tmp_path):
    out = tmp_path / "torn.json"
    paths = [str(records / name) for name in ("a.csv", "torn.csv")]
    result = invoke(["calibrate", *paths, *MESH, "--no-mesh-error", "--out", str(out)])
    assert result.exit_code == 3, result.output
    assert "Record 2 is not healthy: zone zone_6 seems damaged by" in " ".join(result.stderr.split())
    assert not json.loads(out.read_text(encoding="utf-8"))["valid"]
    later = invoke(["twin", str(records / "a.csv"), *MESH, "--calibration", str(out)])
    assert later.exit_code == 1
    assert "is not valid: record 1 is not explained" in " ".join(later.stderr.split())
    missing = invoke(["twin", str(records / "a.csv"), *MESH, "--calibration", str(tmp_path / "none.json")])
    assert "none.json is no calibration" in " ".join(missing.stderr.split())


def test_in_python_it_is_a_dataset(records, tmp_path):
    found = calibrate(
        records / "a.csv", prior={"thickness": 0.0, "damping": 0.0, "gain": 0.0}, elements_per_side=4, order=1,
        mesh_error=False, out=tmp_path / "known.json",
    )  # fmt: skip
    assert isinstance(found, Calibrated)
    assert found.data["number"].to_numpy().tolist() == ["modulus", "density", "prestrain"]
    assert float(found.data["factor"].sel(number="prestrain")) == pytest.approx(1.06, abs=0.01)
    assert found.sentence == "Calibrated 3 numbers on 1 healthy record."


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--prior", "stiffness=0.1"], "no number 'stiffness' to calibrate"),
        (["--prior", "density=much"], "'much' is no number"),
        (["--calibration", "none.json"], "Leave --calibration out"),
    ],
)
def test_options_that_make_no_sense_are_refused(records, tmp_path, options, message):
    result = invoke(["calibrate", str(records / "a.csv"), *MESH, *options, "--out", str(tmp_path / "known.json")])
    assert result.exit_code == 1
    assert message in " ".join(result.stderr.split())


def test_a_twin_of_several_records_and_what_has_grown_since(records, tmp_path):
    spring, autumn = tmp_path / "spring.json", tmp_path / "autumn.json"
    given = [*MESH, "--noise", str(NOISE)]
    first = invoke(["twin", str(records / "a.csv"), str(records / "b.csv"), *given, "--out", str(spring)])
    assert first.exit_code == 0, first.output
    assert "record 2: chi2 per sample" in first.stderr
    answer = json.loads(spring.read_text(encoding="utf-8"))
    assert [each["valid"] for each in answer["records"]] == [True, True]
    assert max(answer["estimate"]) == 0.0
    later = ["twin", str(records / "torn.csv"), *given, "--since", str(spring), "--faults", "--out", str(autumn)]
    second = invoke(later)
    assert second.exit_code == 0, second.output
    found = json.loads(autumn.read_text(encoding="utf-8"))
    assert found["growth"][5] == pytest.approx(0.2, abs=0.03)
    assert found["explanations"][0][1][0].startswith("zone_6")
    assert {each["name"] for each in found["faults"]} >= {"loss of prestrain", "mass added", "sensor 1 loose"}
    page = (tmp_path / "autumn" / "report.html").read_text(encoding="utf-8")
    assert "Grown since the last inspection: 6 by" in page
    healed = invoke(["twin", str(records / "a.csv"), *given, "--since", str(autumn), "--out", str(tmp_path / "healed.json")])
    assert healed.exit_code == 3
    assert "--repaired zone_6" in " ".join(healed.stderr.split())
    lost = invoke(["twin", str(records / "a.csv"), *given, "--repaired", "zone_6"])
    assert lost.exit_code == 1
    assert "repaired since an inspection" in " ".join(lost.stderr.split())
