"""Results survive the disk."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
import xarray as xr
from building import build_fmu
from gossamer_orchestrator import ProgressBar, ResultsError, ScenarioError, load_results, parse_scenario, run_scenario
from gossamer_orchestrator.results.dataset import RecordedScalar, arrange
from gossamer_orchestrator.results.files import UNFINISHED_WATCH
from rich.console import Console
from sails import sail_model
from saving import save_results
from stopping import KeepStates, WaitAt


def test_netcdf_and_csv_give_back_what_was_recorded(chain, fmus, tmp_path):
    noise = ('to = "integral.u"', 'to = "integral.u"\nnoise = { kind = "normal", amplitude = 1.0 }')
    data = run_scenario(chain(noise), fmus, tmp_path)
    xr.testing.assert_identical(load_results(tmp_path), data)
    table = load_results(tmp_path / "results.csv")
    xr.testing.assert_equal(table, data)
    assert {name: table[name].attrs["units"] for name in table} == {name: data[name].attrs["units"] for name in data}


def test_what_the_twin_saw_of_an_earlier_run_goes_with_its_results(chain, fmus, tmp_path):
    """An observer writes a file that becomes the watch with the results, as the twin does that watches a run."""
    watch, fit = tmp_path / "watch.json", [tmp_path / "twin.json", tmp_path / "twin/report.html"]
    (tmp_path / "twin").mkdir()
    for path in fit:
        path.touch()
    for _ in range(2):
        run_scenario(chain(), fmus, tmp_path, observers=[KeepStates(tmp_path / UNFINISHED_WATCH)])
        assert watch.is_file()
    with pytest.raises(ScenarioError):
        run_scenario(chain(), fmus / "nowhere", tmp_path)
    assert watch.is_file()
    run_scenario(chain(), fmus, tmp_path)
    assert not any(path.exists() for path in (watch, *fit))


def test_results_carry_scenario_units_guids_and_versions(chain, fmus, tmp_path):
    scenario = chain()
    run_scenario(scenario, fmus, tmp_path)
    data = load_results(tmp_path)
    assert data.attrs["scenario"] == scenario.source.text
    assert data.attrs["title"] == "A constant, integrated"
    assert json.loads(data.attrs["fmus"])["source"]["start"] == {"u": 2.0, "offset[1]": 0.0, "offset[2]": 0.0}
    integral = json.loads(data.attrs["fmus"])["integral"]
    assert len(integral["guid"]) > 10
    assert integral["model"] == "ToyIntegrator"
    assert integral["parameters"] == {"limit": 1e9, "until": 1e9}
    assert json.loads(data.attrs["connections"]) == [["source.y", "integral.u"]]
    assert set(json.loads(data.attrs["versions"])) == {"gossamer", "FMPy", "numpy"}
    assert data.attrs["ended"] == "complete"
    assert data["time"].attrs["units"] == "s"


def test_results_carry_the_units_that_the_fmu_states_of_parameters_and_inputs(tmp_path):
    build_fmu(sail_model(), tmp_path)
    inputs = '"pull" = 0.0, "pressure" = 0.0, "temperature[*]" = 0.0, "base_acceleration[*]" = 0.0, "damage[1]" = 0.2'
    text = f"step = 1e-3\nstop = 1e-3\n[components.sail]\nfmu = 'membrane'\ninputs = {{ {inputs} }}\n"
    sail = json.loads(run_scenario(parse_scenario(text), tmp_path).attrs["fmus"])["sail"]
    assert set(sail["units"]) == {*sail["parameters"], *sail["start"]}
    named = ("youngs_modulus[1]", "pressure", "damage[1]")
    assert [sail["units"][name] for name in named] == ["Pa", "Pa", "1"]


def test_elements_become_dimensions_with_their_indices_as_labels():
    labels = [(f"m.w[{i},{j}]", "m", "") for i in (1, 2) for j in (1, 2, 3)]
    labels += [("m.s[2]", "1", "Strain at sensor 2, x = 1"), ("m.s[4]", "1", "Strain at sensor 4, x = 1")]
    labels += [("d.s[1]", "1", ""), ("m.y", "Pa", "scalar")]
    table = np.arange(20.0).reshape(2, 10)
    data = arrange(np.array([0.0, 1.0]), table, [RecordedScalar(*label) for label in labels])
    assert data["m.w"].dims == ("time", "w_i", "w_j")
    assert data["m.w"].sel(w_i=2, w_j=1).values.tolist() == [3.0, 13.0]
    assert data["m.s"].sel(s_index=4).values.tolist() == [7.0, 17.0]
    assert data["d.s"].dims == ("time", "d.s_index")
    assert data["m.s"].attrs["long_name"] == "Strain"
    assert data["m.y"].values.tolist() == [9.0, 19.0]
    assert data["m.y"].attrs == {"units": "Pa", "long_name": "scalar"}


def test_what_membranes_and_detectors_give_by_zone_and_sensor_says_so():
    labels = [(f"m.damage[{k}]", "1", f"Lost fraction in zone {k} of 2", "membrane") for k in (1, 2)]
    labels += [(f"m.strain[{k}]", "1", f"Strain along y, at x = {k}", "membrane") for k in (1, 2, 3)]
    labels += [(f"d.deviation[{k}]", "1", "", "detector") for k in (1, 2)]
    labels += [(f"e.damage[{k}]", "1", "", "detector") for k in (1, 2, 3)]
    labels += [(f"other.damage[{k}]", "1", "", "stranger") for k in (1, 2)]
    data = arrange(np.zeros(1), np.ones((1, 12)), [RecordedScalar(*label) for label in labels])
    assert data["m.damage"].dims == data["d.deviation"].dims == ("time", "zone")
    assert data["m.strain"].dims == ("time", "sensor")
    assert data["e.damage"].dims == ("time", "damage_index")
    assert data["other.damage"].dims == ("time", "other.damage_index")
    assert data["m.damage"].attrs["long_name"] == "Lost fraction"
    assert data["m.strain"].attrs["long_name"] == "Strain along y"


def test_a_mixture_of_a_scalar_and_elements_of_one_name_is_kept_apart():
    data = arrange(np.zeros(1), np.ones((1, 3)), [RecordedScalar(name, "1", "") for name in ("a.x", "a.x[1]", "a.x[2]")])
    assert set(data.data_vars) == {"a.x", "a.x[1]", "a.x[2]"}


def test_only_the_wanted_is_recorded_at_every_nth_step_and_the_last(chain, fmus, tmp_path):
    data = run_scenario(chain(more='[record]\nvariables = ["integral.?", "*.factor"]\nevery = 3\n'), fmus, tmp_path)
    assert set(data.data_vars) == {"integral.u", "integral.y", "source.factor"}
    assert data["time"].values.tolist() == [0.0, 3 * 0.1, 6 * 0.1, 9 * 0.1, 10 * 0.1]
    assert data["integral.y"].values == pytest.approx(2.0 * data["time"].values)
    xr.testing.assert_equal(load_results(tmp_path / "results.csv"), data)


def test_what_is_not_ours_is_refused(tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(ResultsError, match=r"the folder .*empty has no results. Make them with 'gossamer run'."):
        load_results(tmp_path / "empty")
    (tmp_path / "results.nc").write_bytes(b"CDF\x02 truncated")
    with pytest.raises(ResultsError, match=r"cannot read results from"):
        load_results(tmp_path)
    (tmp_path / "results.csv").write_text("")
    with pytest.raises(ResultsError, match=r"cannot read results from"):
        load_results(tmp_path / "results.csv")
    (tmp_path / "mine.toml").write_text("step = 0.1\n")
    with pytest.raises(ResultsError, match=r"mine.toml is a scenario. Name the folder of its run, out/mine by default"):
        load_results(tmp_path / "mine.toml")
    (tmp_path / "results.dat").write_text("no results\n")
    with pytest.raises(ResultsError, match=r"cannot read results from .*results.dat: [^\n]*. Run the scenario again.$"):
        load_results(tmp_path / "results.dat")
    save_results(xr.Dataset({"a.x": ("time", [1.0])}, coords={"time": [0.0]}), tmp_path)
    with pytest.raises(ResultsError, match=r"holds 'no schema', this program reads 'gossamer.results' version 1. Run"):
        load_results(tmp_path)


def test_a_folder_that_cannot_be_made_is_refused_before_the_run(chain, fmus, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultsError, match=r"cannot write .*file/out: .* Name another place with out=."):
        run_scenario(chain(), fmus, tmp_path / "file/out")


def test_the_progress_bar_draws_on_a_terminal_and_is_quiet_elsewhere(chain, fmus):
    for terminal in (True, False):
        console = Console(file=io.StringIO(), force_terminal=terminal, width=120)
        run_scenario(chain(), fmus, progress=ProgressBar("chain", console))
        text = console.file.getvalue()
        assert ("100%" in text and "t = 1.0000 s" in text) if terminal else text == ""


def test_the_progress_bar_says_what_an_observer_waits_for(chain, fmus):
    console = Console(file=io.StringIO(), force_terminal=True, color_system=None, width=120)
    run_scenario(chain(), fmus, progress=ProgressBar("chain", console), observers=[WaitAt(5, "waiting for a friend")])
    shown, _, after = console.file.getvalue().rpartition("waiting for a friend,")
    assert "t = 0.4000 s, " in shown  # where the step under way began
    assert "simulated s per s" in after
