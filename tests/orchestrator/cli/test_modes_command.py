"""``gossamer modes``: a setup in; frequencies, shapes and what damage does to them out."""

import json

import gossamer
import numpy as np
import pytest
import xarray as xr
from building import build_fmu
from command_line import invoke
from gossamer_models.membrane import Linearised, membrane_model
from gossamer_orchestrator import parse_scenario, run_scenario
from reading_pages import content_of, read_page
from sails import sail


def call(*arguments):
    return invoke(["modes", *(str(a) for a in arguments)])


def test_the_square_has_modes_that_files_table_and_page_show(tmp_path):
    result = call("--count", 4, "--set", "damage[6]=0.3", "--out", tmp_path, "--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    frequencies = [mode["frequency_Hz"] for mode in said["modes"]]
    assert frequencies == sorted(frequencies)
    with xr.open_dataset(tmp_path / "modes.nc", engine="scipy") as data:
        np.testing.assert_allclose(data["frequency"], frequencies)
        assert data["shape"].sizes == {"mode": 4, "node": 289, "direction": 3}
        assert data["frequency_change"].sizes == {"mode": 4, "zone": 16}
        assert (data["frequency_change"] < 0.0).all()
    page, charts = read_page(tmp_path / "report.html")
    content = content_of(page.unpacked("data"))
    assert content["instants"][0].startswith("mode 1: ")
    assert len(content["instants"]) == 4 * 16
    assert set(charts) == {"Shapes", "Effective mass", "Relative change of frequency by damage"}


def test_a_setup_gets_shapes_for_paraview(tmp_path):
    meshio = pytest.importorskip("meshio", reason="a mesh file needs the extra mesh")
    found = gossamer.modes("drum", count=3, out=tmp_path)
    shapes = meshio.read(tmp_path / "modes.vtu").point_data
    assert [name.split(",")[0] for name in shapes] == ["mode 1", "mode 2", "mode 3"]
    np.testing.assert_allclose(list(shapes.values()), found.data["shape"])
    assert "Hz" in repr(found)


def test_the_membrane_of_a_run_has_the_modes_of_its_structure_as_the_scenario_starts_it(tmp_path):
    """Its tension and a damage are those of the scenario; what is set on the command line comes last."""
    structure = sail(law="relaxed")
    build_fmu(membrane_model(structure), tmp_path)
    stated = '"youngs_modulus[2]" = 3e7', 'pressure = 0.0, pull = 0.5, "temperature[*]" = 0.0, "base_acceleration[*]" = 0.0'
    text = f'[components.sail]\nfmu = "membrane"\nparameters = {{ {stated[0]} }}\n'
    text = f'step = 1e-3\nstop = 2e-3\n{text}inputs = {{ {stated[1]}, "damage[1]" = 0.2 }}\n'
    run_scenario(parse_scenario(text, name="sail.toml"), tmp_path, tmp_path / "run")
    found = gossamer.modes(tmp_path / "run", count=3, set={"damage[1]": 0.3}, out=tmp_path / "modes")
    own = Linearised(structure, {"youngs_modulus[2]": 3e7, "pull": 0.5, "damage[1]": 0.3}).modes(3)
    np.testing.assert_allclose(found.data["frequency"], own.frequencies, rtol=1e-9)


def test_wrong_names_and_too_many_modes_are_refused(tmp_path):
    assert "no parameter or input 'damag'" in call("--set", "damag=1", "--out", tmp_path).output
    assert "ask for 1 to 675" in call("--count", 9999, "--out", tmp_path).output
    assert not list(tmp_path.iterdir())
