"""A sweep runs all combinations of values, keeps what is finished, and gathers it."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest
import xarray as xr
from command_line import invoke
from gossamer_files.plots import draw_panels
from gossamer_orchestrator import ScenarioError
from gossamer_orchestrator.results.report.cases import case_panels
from gossamer_orchestrator.run.sweep import make_cases, read_ranges
from matplotlib.figure import Figure

SCENARIO = """
step = 0.1
stop = 0.3
[components.one]
fmu = "integrator"
inputs = { u = 1.0 }
"""


@pytest.fixture
def call(fmus, tmp_path):
    (tmp_path / "s.toml").write_text(SCENARIO)

    def sweep(*ranges, out="out", more=()):
        options = [f"--set={each}" for each in ranges]
        return invoke(
            ["sweep", str(tmp_path / "s.toml"), "--fmus", str(fmus), "--out", str(tmp_path / out), *options, *more]
        )

    return sweep


def test_ranges_are_numbers_whole_numbers_and_lists():
    ranges = read_ranges(["a.x=0:0.5:3", "seed=1:3", "b.n=1,2.5,true", "c.v=[1, 2]", "d.t='x,y'"])
    assert ranges == {"a.x": [0.0, 0.25, 0.5], "seed": [1, 2, 3], "b.n": [1, 2.5, True], "c.v": [[1, 2]], "d.t": ["x,y"]}


def test_all_values_are_combined_the_last_fastest():
    cases = make_cases({"a": [1, 2], "b": [3, 4]})
    assert [(case.name, *case.values.values()) for case in cases] == [
        ("case_0001", 1, 3),
        ("case_0002", 1, 4),
        ("case_0003", 2, 3),
        ("case_0004", 2, 4),
    ]


@pytest.mark.parametrize(
    "text", ["a.x=0:1:0", "a.x=3:1", "a.x=x:y", "a.x=0:1:2:3", "a.x=", "a.x", "a.x=1,,2", "a.x=nan:1:3", "a.x=0:inf:3"]
)
def test_a_range_that_is_none_is_named(text):
    with pytest.raises(ScenarioError, match=rf"^'{re.escape(text)}': (?!'it).*\. Write NAME="):
        read_ranges([text])


@pytest.mark.parametrize("text", ["a.x=0:0.5", "a.x=0:0.5:b"])
def test_a_range_without_a_count_is_told_how_to_write_it(text):
    with pytest.raises(ScenarioError, match=r"say how many values|how many values, such as 0:0.5:6"):
        read_ranges([text])


def test_too_many_cases_are_refused():
    with pytest.raises(ScenarioError, match="the values make 1000000 cases"):
        make_cases({"a": list(range(1000)), "b": list(range(1000))})


def test_a_sweep_gathers_its_cases_and_goes_on_where_it_was_ended(call, tmp_path):
    done = call("one.u=1,2,3")
    assert done.exit_code == 0, done.stderr
    data = xr.open_zarr(tmp_path / "out/sweep.zarr", consolidated=False)
    assert data["one.y"].sel(case=3).values == pytest.approx([0.0, 0.3, 0.6, 0.9])
    assert data["one.u"].values.tolist() == [1, 2, 3]
    with (tmp_path / "out/cases.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head == ["case", "one.u", "ended", "last one.u [1]", "last one.y [1]"]
    assert [row[:3] for row in rows] == [[str(u), str(u), "complete"] for u in (1, 2, 3)]
    assert [float(row[4]) for row in rows] == pytest.approx([0.3, 0.6, 0.9])
    kept = (tmp_path / "out/case_0001/results.nc").stat()
    (tmp_path / "out/case_0002/results.nc").unlink()
    assert call("one.u=1,2,3").exit_code == 0
    assert (tmp_path / "out/case_0001/results.nc").stat() == kept
    assert (tmp_path / "out/case_0002/results.nc").is_file()
    assert "holds another sweep" in call("one.u=1,2").stderr
    assert str(tmp_path) not in (tmp_path / "out/sweep.json").read_text()  # a folder may move
    (tmp_path / "out/sweep.json").write_text("cut o")  # which ended in a traceback
    assert "holds another sweep" in call("one.u=1,2,3").stderr


def test_other_fmus_of_the_same_name_make_another_sweep(fmus, tmp_path):
    (tmp_path / "s.toml").write_text(SCENARIO)
    (tmp_path / "fmus").mkdir()

    def call(source):
        (tmp_path / "fmus/integrator.fmu").write_bytes((fmus / source).read_bytes())
        given = ["--fmus", str(tmp_path / "fmus"), "--out", str(tmp_path / "out"), "--no-pictures", "--set", "one.u=1,2"]
        return invoke(["sweep", str(tmp_path / "s.toml"), *given])

    assert call("integrator.fmu").exit_code == call("integrator.fmu").exit_code == 0
    assert "holds another sweep" in call("gain.fmu").stderr


def test_a_sweep_draws_a_panel_per_case_of_what_is_asked_for(call, tmp_path):
    done = call("one.u=1,2,3", more=["--plot", "one.y", "--json"])
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["files"] == [
        str(tmp_path / "out" / name) for name in ("cases.csv", "sweep.zarr", "sweep.png", "report.html")
    ]
    assert [case["values"] for case in found["cases"]] == [{"one.u": u} for u in (1, 2, 3)]
    assert {case["ended"] for case in found["cases"]} == {"complete"}
    assert "no case recorded 'one.z'. Did you mean 'one.y'?" in call("one.u=1,2,3", more=["--plot", "one.z"]).stderr


def test_the_panels_show_the_cases_and_share_their_axes():
    values = np.arange(12.0).reshape(3, 4)
    coordinates = {"case": [1, 2, 5], "time": [0.0, 0.1, 0.2, 0.3], "one.u": ("case", [0.5, 1.0, 2.0])}
    data = xr.DataArray(values, coordinates, ("case", "time"), name="one.y", attrs={"units": "m"})
    panels, figure = case_panels(data, ["one.u"]), Figure()
    draw_panels(panels, figure)
    drawn = [ax for ax in figure.axes if ax.lines]
    assert [ax.get_title() for ax in drawn] == ["1: u=0.5", "2: u=1", "5: u=2"]
    assert [ax.lines[0].get_ydata().tolist() for ax in drawn] == values.tolist()
    assert len({ax.get_ylim() for ax in drawn}) == 1
    assert (figure.get_suptitle(), drawn[0].get_ylabel()) == ("one.y", "y [m]")


def test_of_an_array_with_many_elements_the_last_values_are_bars_in_percent_with_the_truth():
    """The second case ended before the last time: its last values are those before. The truth is that of the last window."""
    values = np.arange(2 * 3 * 16.0).reshape(2, 3, 16)
    values[1, 2] = np.nan
    coordinates = {"case": [1, 2], "time": [0.0, 0.1, 0.2], "zone": range(1, 17)}
    valid = xr.DataArray([[0, 0, 1], [0, 0, np.nan]], {k: coordinates[k] for k in ("case", "time")}, ("case", "time"))
    found = xr.DataArray(values / 100.0, coordinates, ("case", "time", "zone"), name="d.damage")
    panels = case_panels(found, [], xr.Dataset({"d.valid": valid, "d.damage": found}), 0.5 * found)
    drawn = [chart.traces for chart in panels.charts]
    assert [bars["y"] for bars, *_ in drawn] == [pytest.approx(values[0, 2]), pytest.approx(values[1, 1])]
    assert [true["y"] for _, true, *_ in drawn] == [pytest.approx(values[0, 2] / 2), pytest.approx(values[1, 1] / 2)]
    assert [bars["marker"]["color"] for bars, *_ in drawn] == ["@0", "@grey"]
    assert [[each["text"] for each in more] for _, _, *more in drawn] == [[], [["not valid"]]]
    assert (panels.title, panels.charts[0].y) == ("last d.damage", "damage [%]")


def test_the_truth_beside_a_judgement_is_that_of_its_window():
    """Damage begins after the only window ended: neither the bars nor the diamonds know it."""
    coordinates = {"case": [1], "time": [0.0, 0.1, 0.2], "zone": range(1, 17)}
    found = xr.DataArray(np.zeros((1, 3, 16)), coordinates, ("case", "time", "zone"), name="d.damage")
    true = found.copy()
    true[0, 2, 5] = 0.35
    valid = xr.DataArray([[0.0, 1.0, 1.0]], {k: coordinates[k] for k in ("case", "time")}, ("case", "time"))
    (chart,) = case_panels(found, [], xr.Dataset({"d.valid": valid, "d.damage": found}), true).charts
    assert chart.traces[1]["y"].tolist() == [0.0] * 16


def test_of_many_cases_some_are_drawn_and_the_title_says_so():
    data = xr.DataArray(np.zeros((100, 2)), {"case": range(1, 101), "time": [0.0, 1.0]}, ("case", "time"), name="y")
    panels = case_panels(data, [])
    assert len(panels.charts) == 34
    assert panels.title == "y, one in 3 of 100 cases"


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
# The worker is in this process here; Dask's profiler seems to hold frames of its threads, and their arrays, when files close
@pytest.mark.filterwarnings("ignore:Cannot close a netcdf_file")
def test_a_sweep_runs_on_a_cluster_of_dask(call, tmp_path, monkeypatch):
    """One scheduler and one worker, in threads of this process: every case arrives, and it was run there."""
    distributed = pytest.importorskip("distributed", reason="clusters need the extra 'campaign'")
    monkeypatch.setattr("gossamer_orchestrator.run.sweep.on_cores", None)
    monkeypatch.setattr("gossamer_models.campaign.run.SCHEDULER_PATIENCE", 120.0)  # on a machine that is busy too
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, protocol="tcp"
    ) as cluster:
        done = call("one.u=1,2", more=["--scheduler", cluster.scheduler_address, "--no-pictures"])
    assert done.exit_code == 0, done.stderr
    data = xr.open_zarr(tmp_path / "out/sweep.zarr", consolidated=False)
    assert data["one.y"].isel(time=-1).values == pytest.approx([0.3, 0.6])


def test_a_scheduler_that_is_not_there_is_named(call, monkeypatch):
    pytest.importorskip("distributed", reason="clusters need the extra 'campaign'")
    monkeypatch.setattr("gossamer_models.campaign.run.SCHEDULER_PATIENCE", 1.0)
    done = call("one.u=1", more=["--scheduler", "tcp://127.0.0.1:9"])
    assert (done.exit_code, done.stdout) == (1, "")
    assert "there is no Dask scheduler at tcp://127.0.0.1:9" in done.stderr


def test_a_case_that_fails_is_said_and_the_others_are_kept(call, tmp_path):
    done = call("one.limit=1, 0.001")
    assert done.exit_code == 1
    assert "refused the step of 0.1 s" in " ".join(done.stderr.split())
    assert xr.open_zarr(tmp_path / "out/sweep.zarr", consolidated=False)["one.y"].sizes["case"] >= 1
