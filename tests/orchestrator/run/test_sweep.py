"""A sweep runs all combinations of values, keeps what is finished, and gathers it."""

from __future__ import annotations

import csv

import pytest
import xarray as xr
from gossamer_orchestrator import ScenarioError
from gossamer_orchestrator.cli import app
from gossamer_orchestrator.run.sweep import make_cases, read_ranges
from typer.testing import CliRunner

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

    def sweep(*ranges, out="out"):
        options = [f"--set={each}" for each in ranges]
        return CliRunner().invoke(
            app, ["sweep", str(tmp_path / "s.toml"), "--fmus", str(fmus), "--out", str(tmp_path / out), *options]
        )

    return sweep


def test_ranges_are_numbers_whole_numbers_and_lists():
    ranges = read_ranges(["a.x=0:0.5:3", "seed=1:3", "b.n=1,2.5,true", "c.v=[1, 2]", "d.t='x,y'"])
    assert ranges == {
        "a.x": [0.0, 0.25, 0.5],
        "seed": [1, 2, 3],
        "b.n": [1, 2.5, True],
        "c.v": [[1, 2]],
        "d.t": ["x,y"],
    }


def test_all_values_are_combined_the_last_fastest():
    cases = make_cases({"a": [1, 2], "b": [3, 4]})
    assert [(case.name, *case.values.values()) for case in cases] == [
        ("case_0001", 1, 3),
        ("case_0002", 1, 4),
        ("case_0003", 2, 3),
        ("case_0004", 2, 4),
    ]


@pytest.mark.parametrize("text", ["a.x=0:1:0", "a.x=3:1", "a.x=x:y", "a.x=0:1:2:3", "a.x="])
def test_a_range_that_is_none_is_named(text):
    with pytest.raises(ScenarioError, match=r"a\.x"):
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
        assert list(csv.reader(file)) == [
            ["case", "one.u", "ended"],
            *([str(u), str(u), "complete"] for u in (1, 2, 3)),
        ]
    kept = (tmp_path / "out/case_0001/results.nc").stat()
    (tmp_path / "out/case_0002/results.nc").unlink()
    assert call("one.u=1,2,3").exit_code == 0
    assert (tmp_path / "out/case_0001/results.nc").stat() == kept
    assert (tmp_path / "out/case_0002/results.nc").is_file()
    assert "holds another sweep" in call("one.u=1,2").stderr


def test_a_case_that_fails_is_said_and_the_others_are_kept(call, tmp_path):
    done = call("one.limit=1, 0.001")
    assert done.exit_code == 1
    assert "refused the step of 0.1 s" in " ".join(done.stderr.split())
    assert xr.open_zarr(tmp_path / "out/sweep.zarr", consolidated=False)["one.y"].sizes["case"] >= 1
