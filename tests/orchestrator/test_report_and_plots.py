"""Judgements and pictures from made-up results with known damage."""

from __future__ import annotations

import io

import numpy as np
import pytest
import xarray as xr
from gossamer_orchestrator import ResultsError, judge, plots
from gossamer_orchestrator.report import doubts, history_table, judgements, zone_table
from rich.console import Console


@pytest.fixture
def data() -> xr.Dataset:
    """Zone 2 loses 30 % at t = 5; judged 0 at t = 4 and 20 % at t = 8; zone 7 falsely 4 %."""
    time = np.arange(10.0)
    true, estimated, index, valid = np.zeros((10, 16)), np.zeros((10, 16)), np.ones((10, 16)), np.zeros(10)
    true[5:, 1], estimated[8:, 1], estimated[8:, 6] = 0.3, 0.2, 0.04
    index[4:], index[8:] = 1.1, 2.0
    valid[4:] = 1.0
    i, j = np.meshgrid(np.arange(1, 8), np.arange(1, 8), indexing="ij")
    shape = np.sin(np.pi * i / 8) * np.sin(np.pi * j / 8)
    strains = 0.02 + 0.01 * np.sin(time)[:, None] * np.ones(4)
    variables = {
        "membrane.damage": (("time", "damage_index"), true),
        "membrane.strain": (("time", "strain_index"), strains),
        "membrane.deflection": ("time", np.sin(time)),
        "membrane.w": (("time", "w_i", "w_j"), np.sin(time)[:, None, None] * shape),
        "detector.damage": (("time", "damage_index"), estimated),
        "detector.index": (("time", "index_index"), index),
        "detector.valid": ("time", valid),
        "detector.similarity": ("time", 0.5 * valid),
    }
    for k in range(1, 5):
        variables[f"sensor{k}.resistance"] = ("time", 100.0 + time)
        variables[f"compensator{k}.strain"] = ("time", strains[:, 0])
    coordinates = {"time": time, "damage_index": np.arange(1, 17), "strain_index": np.arange(1, 5)}
    return xr.Dataset(variables, coords=coordinates, attrs={"title": "made up"})


def test_a_judgement_is_made_when_a_window_ends(data):
    found = judgements(data)
    assert [judgement.time for judgement in found] == [4.0, 8.0]
    last = judge(data)
    assert last.time == 8.0
    assert last.mean_absolute_error == pytest.approx((0.1 + 0.04) / 16)
    assert last.worst_zone == 2
    assert last.largest_error == pytest.approx(-0.1)
    assert last.similarity == 0.5


def test_a_run_without_a_judgement_says_so(data):
    with pytest.raises(ResultsError, match=r"no valid judgement until t = 3 s. Run for at least one window"):
        judge(data.isel(time=slice(4)))
    with pytest.raises(ResultsError, match=r"the results lack detector.damage. Add it to \[record\] variables"):
        judge(data.drop_vars("detector.damage"))


def test_doubts_name_sensors_out_of_range_and_unknown_cases(data):
    assert doubts(data, judgements(data)) == []
    data["sensor2.saturated"] = ("time", (data["time"].values == 3.0).astype(float))
    data["detector.similarity"][:] = 1e-9
    beyond, unknown = doubts(data, judgements(data))
    assert beyond.startswith("Beyond their range during the run: sensor2.")
    assert "nothing like this (similarity 1e-09)" in unknown


def test_tables_show_the_membrane_as_it_is_seen(data):
    console = Console(file=io.StringIO(), width=100)
    console.print(zone_table(judge(data)), history_table(judgements(data)))
    lines = console.file.getvalue().splitlines()
    rows = [line.split() for line in lines if "zone" in line and "│" in line]
    assert [row.count("zone") for row in rows[:4]] == [4] * 4
    assert rows[0][2] == "13"
    assert rows[3][2] == "1"
    assert any("0 -> 0.0" in line and "30 -> 20.0" in line for line in lines)
    assert any("-10.00 % in zone 2" in line for line in lines)


def test_every_picture_has_units_on_its_axes(data):
    from matplotlib.figure import Figure

    draw = [
        lambda ax: plots.plot_sensor_loop(data, 2, ax=ax),
        lambda ax: plots.plot_strain(data, 3, ax=ax),
        lambda ax: plots.plot_damage_map(data, "true", ax=ax),
        lambda ax: plots.plot_damage_history(data, ax=ax),
        lambda ax: plots.plot_deflection(data, ax=ax),
        lambda ax: plots.plot_deflection_history(data, ax=ax),
    ]
    for function in draw:
        ax = function(Figure().add_subplot())
        assert ax.get_xlabel().endswith("]")
        assert ax.get_ylabel().endswith("]")
        assert ax.get_title()


def test_the_damage_map_has_zone_1_at_the_origin_and_x_to_the_right(data):
    from matplotlib.figure import Figure

    ax = plots.plot_damage_map(data, "true", ax=Figure().add_subplot())
    drawn = {text.get_text(): text.get_position() for text in ax.texts}
    assert drawn["30.0"] == pytest.approx((0.225, 0.075))
    assert ax.images[0].get_array()[0, 1] == pytest.approx(30.0)


def test_pictures_are_drawn_for_what_was_recorded(data, tmp_path):
    names = {path.stem for path in plots.save_pictures(data, tmp_path / "all")}
    assert names == {"sensors", "strains", "damage", "damage_history", "deflection"}
    names = {path.stem for path in plots.save_pictures(data.drop_vars("membrane.w"), tmp_path / "some")}
    assert names == {"sensors", "strains", "damage", "damage_history"}
    names = {path.stem for path in plots.save_pictures(data.isel(time=slice(6)), tmp_path / "one_window")}
    assert "damage_history" not in names


def test_nothing_is_drawn_of_a_stranger_s_run(tmp_path):
    assert plots.save_pictures(xr.Dataset({"a.y": ("time", [0.0])}), tmp_path) == []


def test_the_history_puts_estimate_and_truth_under_their_headings(data):
    table = history_table(judgements(data))
    cells = {str(column.header): list(column.cells) for column in table.columns}
    for row, judgement in enumerate(judgements(data)):
        zone = int(np.argmax(judgement.estimated))
        assert cells["estimated [%]"][row] == f"{100 * judgement.estimated[zone]:.1f}"
        assert cells["true there [%]"][row] == f"{100 * judgement.true[zone]:.0f}"
