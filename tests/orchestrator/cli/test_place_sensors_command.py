"""``gossamer place-sensors``: a setup and its mesh in; a table, a picture and sensors out."""

import csv
import json
import tomllib
from pathlib import Path

import gossamer
import numpy as np
import pytest
from command_line import invoke
from reading_pages import read_page, values

pytest.importorskip("meshio", reason="a mesh file needs the extra mesh")

SETUP = """\
mesh = "square.inp"
mass_damping = 20.0

[[regions]]
youngs_modulus = 1e7
poisson_ratio = 0.33
density = 1100.0
thickness = 1e-3

[[supports]]
group = "rim"
stretch = [1.02, 1.02, 1.0]

[[zones]]
group = "left"

[[zones]]
group = "right"
"""
SENSOR = """
[[sensors]]
point = [0.3, 0.25, 0.0]
direction = [0.0, 1.0, 0.0]
"""
LOAD = ("--set", "pressure_amplitude=1000", "--set", "pressure_frequency=8", "--stop", "0.06", "--points", "4")


@pytest.fixture
def setup(tmp_path):
    """A sail of 4 x 4 quadrilaterals in two zones, held at its rim."""
    node = np.arange(1, 26).reshape(5, 5)
    quads = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1).reshape(-1, 4)
    rim = sorted({*node[0], *node[-1], *node[:, 0], *node[:, -1]})
    lines = ["*NODE"]
    lines += [f"{n}, {0.15 * ((n - 1) % 5)}, {0.15 * ((n - 1) // 5)}, 0.0" for n in node.ravel()]
    lines += ["*ELEMENT, TYPE=S4", *(", ".join(map(str, (k + 1, *quad))) for k, quad in enumerate(quads))]
    for name, first in (("left", 0), ("right", 2)):
        lines += [f"*ELSET, ELSET={name}", ", ".join(str(k + 1) for k in range(16) if k % 4 - first in (0, 1))]
    lines += ["*NSET, NSET=rim", ", ".join(map(str, rim))]
    (tmp_path / "square.inp").write_text("\n".join(lines) + "\n")
    path = tmp_path / "sail.toml"
    path.write_text(SETUP)
    return path


def call(*arguments):
    return invoke(["place-sensors", *(str(a) for a in arguments)])


def test_a_setup_gets_sensors_that_it_can_take_over(setup, tmp_path):
    pytest.importorskip("ziglang", reason="the simulations need the compiler for their speed")
    setup.write_text(SETUP + SENSOR)
    result = call("--setup", setup, *LOAD, "--count", 2, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    for name in ("placement.csv", "placement.png", "sensors.toml", "report.html"):
        assert str(tmp_path / "out" / name) in result.stdout.splitlines()
    with (tmp_path / "out" / "placement.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == ["left", "right"]
    worst = {name: max(float(row[f"{name} a90 [1]"]) for row in rows) for name in ("own", "chosen")}
    assert worst["chosen"] < worst["own"]
    assert "worst" in result.stderr

    page, charts = read_page(tmp_path / "out" / "report.html")
    assert f"a90 = {100.0 * worst['chosen']:.3g} % damage" in page.inside["verdict"]
    chosen = charts["Smallest damage found in 90 % of cases"]["traces"][1]
    assert values(chosen["y"]) == pytest.approx([100.0 * float(row["chosen a90 [1]"]) for row in rows], rel=1e-4)
    drawn = charts["1 own sensors, worst zone a90 = 95 % or more"]["traces"]
    areas = [each for each in drawn if each.get("fill")]
    assert [each["name"].partition(":")[0] for each in areas] == ["zone 1", "zone 2"]
    assert np.nanmax(values(areas[0]["x"])) == pytest.approx(0.3)

    text = (tmp_path / "out" / "sensors.toml").read_text()
    assert len(tomllib.loads(text)["sensors"]) == 2
    setup.write_text(SETUP + "\n" + text)
    again = call("--setup", setup, *LOAD, "--count", 2, "--out", tmp_path / "again", "--check", 1, "--json")
    assert again.exit_code == 0, again.output
    content = json.loads(again.stdout)
    load = {"pressure_amplitude": 1000, "pressure_frequency": 8}
    placed = gossamer.place_sensors(setup=setup, set=load, stop=0.06, points=4, count=2, out=tmp_path / "python")
    assert placed.data["a90"].sel(placement="own").to_numpy().tolist() == content["own"]["a90"]
    assert placed.data["name"].to_numpy().tolist() == ["left", "right"]
    assert placed.data["point"].attrs["units"] == "m"
    assert placed.data["point"].to_numpy().tolist() == [each["point_m"] for each in content["chosen"]["sensors"]]
    assert len(tomllib.loads(Path(placed).read_text())["sensors"]) == 2
    worst = f"{100.0 * max(content['own']['a90']):.3g} %"
    assert f"with the membrane&#x27;s own 2 it has {worst}" in placed._repr_html_()
    taken = content["own"]["a90"]
    assert content["zones"] == ["left", "right"]
    assert content["chosen"]["check"]["records"] == 1
    np.testing.assert_allclose(taken, [float(row["chosen a90 [1]"]) for row in rows], rtol=1e-4)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--set", "pressure_amplitude"], "write a name and a number"),
        (["--set", "wind=1"], "no parameter or input 'wind'"),
        (["--stop", "0"], "--stop is 0"),
    ],
)
def test_a_mistake_is_one_sentence(setup, tmp_path, arguments, message):
    result = call("--setup", setup, *arguments, "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert message in result.stderr
    assert "Traceback" not in result.output
    assert not (tmp_path / "out").exists()


def test_a_table_of_loads_takes_the_place_of_the_pressure(setup, tmp_path):
    """States of rest under a dead pressure; the target that no number of sensors reaches is said."""
    setup.write_text(SETUP + '\n[[loads]]\nkind = "pressure"\nname = "wind"\n')
    states = tmp_path / "states.csv"
    states.write_text("state,wind [kPa]\nnone,0\nsome,0.5\nmore,1\n")
    options = ("--setup", setup, "--load", states, "--points", 4, "--noise", 1e-2, "--known", "all")
    result = call(*options, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "3 states of rest" in result.output
    assert "No number of sensors reaches 2 %" in result.output.replace("\n", " ")
    refused = call(*options[:-1], "gain", "--out", tmp_path / "no")
    assert refused.exit_code == 1
    assert "gain cannot be --known; amplitude and damping can." in refused.stderr
    over = call(*options, "--out", tmp_path / "no", "--load", tmp_path / "none.csv")
    assert over.exit_code == 1
    assert not (tmp_path / "no").exists()


def test_a_mesh_needs_its_setup(tmp_path):
    result = call("--mesh", tmp_path / "square.inp")
    assert result.exit_code == 1
    assert "--mesh needs a setup" in result.stderr


def test_the_setup_is_not_overwritten(setup):
    kept = setup.with_name("sensors.toml")
    kept.write_text(SETUP)
    result = call("--setup", kept, "--out", kept.parent)
    assert result.exit_code == 1
    assert "would overwrite" in result.stderr
    assert kept.read_text() == SETUP
