"""``gossamer reduce``: a setup in; an FMU, matrices for NumPy and MATLAB, and how far they reach out."""

import json

import gossamer
import numpy as np
import pytest
from command_line import invoke
from fmpy import simulate_fmu
from reading_pages import read_page
from scipy.io import loadmat


def call(*arguments):
    return invoke(["reduce", *(str(a) for a in arguments)])


def stepped(path, pressure, h, *names):
    """Step an FMU once and read it."""
    found = simulate_fmu(
        str(path),
        stop_time=h,
        step_size=h,
        output_interval=h,
        start_values={"pressure": pressure},
        output=list(names),
        validate=False,
    )
    return [found[name][-1] for name in names]


def test_the_square_is_reduced_to_matrices_with_names_and_units(tmp_path):
    result = call("--modes", 6, "--nodes", "145,37", "--out", tmp_path, "--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    load = said["wrong_by_5_percent"][0]
    assert load["load"] == "pressure"
    assert 50.0 < load["strain"][0] < load["displacement"][0] < 500.0
    with np.load(tmp_path / "reduced.npz") as arrays, (tmp_path / "reduced.mat").open("rb") as file:
        matlab = loadmat(file)
        assert arrays["A"].shape == (12, 12)
        assert arrays["M"].shape == arrays["K"].shape == (12, 12)
        assert arrays["output"].tolist()[-6:] == [f"{part}[{k}]" for part in ("force", "torque") for k in (1, 2, 3)]
        assert dict(zip(arrays["input"].tolist(), arrays["input_unit"].tolist(), strict=True))["pressure"] == "Pa"
        np.testing.assert_array_equal(matlab["A"], arrays["A"])
        assert 1 <= len(arrays["spring_mass"]) <= 6
        assert matlab["input"].ravel()[0][0] == arrays["input"][0]
    variables = gossamer.info(tmp_path / "reduced_membrane.fmu").variables
    assert {"pressure", "damage[16]", "strain[4]", "displacement[6]"} <= set(variables)
    assert (tmp_path / "nodes_42.txt").read_text().count("node ") == 2
    assert (tmp_path / "flex_42.txt").read_text().endswith("[EOF]\n")
    _, charts = read_page(tmp_path / "report.html")
    assert "Shapes" in charts


def test_the_native_fmu_is_the_python_one_and_rides_on_a_frame(tmp_path):
    pytest.importorskip("ziglang", reason="native FMUs need the compiler")
    python = gossamer.reduce(modes=2, out=tmp_path / "python", set={"pressure": 30.0})
    native = gossamer.reduce(modes=2, out=tmp_path / "native", set={"pressure": 30.0}, native=True, frame=True)
    assert {"frame_acceleration[3]", "torque[2]", "held_inertia[6]"} <= set(gossamer.info(native).variables)
    names = ["strain[1]", "displacement[3]"]
    np.testing.assert_allclose(
        stepped(native.path, 31.0, 2e-3, *names), stepped(python.path, 31.0, 2e-3, *names), rtol=1e-12
    )
    assert python.data["A"].sizes == {"state": 4, "state_too": 4}


def test_a_node_beyond_the_mesh_is_refused(tmp_path):
    assert (
        "node 290 is none of the mesh, which has 1 to 289" in call("--nodes", "290", "--modes", 2, "--out", tmp_path).output
    )
    assert not list(tmp_path.iterdir())
