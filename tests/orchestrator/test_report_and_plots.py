"""Judgements and pictures from made-up results with known damage."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
import xarray as xr
from gossamer_orchestrator import ResultsError, judge
from gossamer_orchestrator.results import plots
from gossamer_orchestrator.results.judgements import doubts, judgements, windows
from gossamer_orchestrator.results.tables import history_table, zone_table
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


def later_window_invalid(data: xr.Dataset) -> xr.Dataset:
    data["detector.valid"][8:] = 0.0
    data["detector.similarity"][8:] = 0.28
    return data


def test_a_run_without_a_judgement_says_whether_a_window_ended_and_what_resembled_nothing(data):
    with pytest.raises(ResultsError, match=r"No window of the detector ended until t = 3 s, .* Run longer"):
        judge(data.isel(time=slice(4)))
    with pytest.raises(ResultsError, match=r"the results lack detector.damage. Add it to \[record\] variables"):
        judge(data.drop_vars("detector.damage"))
    data["detector.valid"][:] = 0.0
    with pytest.raises(
        ResultsError, match=r"2 windows .* the last at 8.0000 s, .* in spite of a similarity of 0.5. Give"
    ):
        judge(data)
    data["detector.similarity"][:] *= 0.5
    with pytest.raises(ResultsError, match=r"similarity with every trained case is below one half: 0.25"):
        judge(data)
    with pytest.raises(ResultsError, match=r"its similarity was not recorded"):
        judge(data.drop_vars("detector.similarity"))


def test_doubts_name_sensors_out_of_range_and_a_last_window_that_is_not_valid(data):
    assert doubts(data, windows(data)) == []
    data["sensor2.saturated"] = ("time", (data["time"].values == 3.0).astype(float))
    data = later_window_invalid(data)
    assert judge(data).time == 4.0
    unknown, beyond = doubts(data, windows(data))
    assert unknown == (
        "The last window, ended at 8.0000 s, was not valid (similarity 0.28); shown is the judgement at 4.0000 s."
    )
    assert beyond.startswith("Beyond their range during the run: sensor2.")


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


def test_the_table_of_judgements_marks_windows_that_are_not_valid(data):
    table = history_table(windows(later_window_invalid(data)))
    cells = {str(column.header): list(column.cells) for column in table.columns}
    assert cells["valid"] == ["yes", "no"]
    console = Console(file=io.StringIO(), width=120)
    console.print(table)
    assert "t [s]" in console.file.getvalue()


def test_every_picture_has_units_on_its_axes(data):
    from matplotlib.figure import Figure

    draw = [
        lambda ax: plots.plot_sensor_loop(data, 2, ax=ax),
        lambda ax: plots.plot_strain(data, 3, ax=ax),
        lambda ax: plots.plot_strain_error(data, 3, ax=ax),
        lambda ax: plots.plot_damage_map(data, "true", ax=ax),
        lambda ax: plots.plot_damage_history(data, ax=ax),
        lambda ax: plots.plot_deflection(data, ax=ax),
        lambda ax: plots.plot_deflection_history(data, ax=ax),
    ]
    for function in draw:
        ax = function(Figure().add_subplot())
        assert ax.get_xlabel().endswith("]")
        assert ax.get_ylabel().endswith("]")


def test_titles_say_when_and_how_well(data):
    from matplotlib.figure import Figure

    assert plots.plot_damage_map(data, ax=Figure().add_subplot()).get_title() == "Estimated damage [%] at t = 8.0000 s"
    assert "RMS error < 1e-9 % of range" in plots.plot_strain(data, ax=Figure().add_subplot()).get_title()
    ax = plots.plot_damage_history(later_window_invalid(data), ax=Figure().add_subplot())
    assert ax.get_xlim()[1] > 9.0
    markers = {line.get_marker(): list(line.get_xdata()) for line in ax.lines if line.get_marker() in ("o", "x")}
    assert markers == {"o": [4.0], "x": [8.0]}


def test_the_damage_map_has_zone_1_at_the_origin_and_x_to_the_right(data):
    from matplotlib.figure import Figure

    ax = plots.plot_damage_map(data, "true", ax=Figure().add_subplot())
    drawn = {text.get_text(): text.get_position() for text in ax.texts}
    assert drawn["30.0"] == pytest.approx((1.5 / 4, 0.5 / 4))
    assert ax.images[0].get_array()[0, 1] == pytest.approx(30.0)
    assert ax.get_xlabel() == "x [side]"
    data["membrane.side_length"], data["membrane.edge_displacement"] = ("time", [0.588] * 10), ("time", [0.006] * 10)
    ax = plots.plot_damage_map(data, "true", ax=Figure().add_subplot())
    assert ax.get_xlabel() == "x [m]"
    assert ax.get_xlim() == pytest.approx((0.0, 0.6))


def test_the_edge_of_the_membrane_is_within_the_contours(data):
    """A spline is zero there only up to rounding."""
    from matplotlib.figure import Figure

    data["membrane.w"] *= 0.193 * np.random.default_rng(2).uniform(0.9, 1.1, (7, 7))
    contours = plots.plot_deflection(data, ax=Figure().add_subplot()).collections[0]
    assert contours.zmin >= contours.levels[0]


def test_a_long_run_shows_the_first_and_the_last_window_of_a_sensor(data):
    from matplotlib.figure import Figure

    ax = plots.plot_sensor_loop(data, ax=Figure().add_subplot())
    assert len(ax.collections[0].get_segments()) == 9
    data["detector.index"][6:8] = 1.5
    ax = plots.plot_sensor_loop(data, ax=Figure().add_subplot())
    assert ax.get_title() == "Sensor 1, first and last window"
    assert list(ax.collections[0].get_array()) == [1.0, 2.0, 3.0, 4.0, 7.0, 8.0]


def renamed(data: xr.Dataset) -> xr.Dataset:
    """The same run under other names; strain 1 is read by the sensor that stands last."""
    names = {"membrane": "skin", "detector": "shm"}
    names |= {f"{kind}{k}": f"{kind[0]}{5 - k}" for kind in ("sensor", "compensator") for k in range(1, 5)}
    models = {new: old.rstrip("1234") for old, new in sorted(names.items(), key=lambda item: item[1])}
    wires = [(f"skin.strain[{5 - k}]", f"s{k}.strain") for k in range(1, 5)]
    wires += [(f"s{k}.resistance", f"c{k}.resistance") for k in range(1, 5)]
    split = {name: str(name).split(".", 1) for name in data.data_vars}
    other = data.rename_vars({name: f"{names[c]}.{v}" for name, (c, v) in split.items()})
    fmus = json.dumps({name: {"model": model} for name, model in models.items()})
    return other.assign_attrs(fmus=fmus, connections=json.dumps(wires))


def test_components_are_known_by_their_fmus_whatever_they_are_called(data, tmp_path):
    for k in range(1, 5):
        data[f"sensor{k}.resistance"] += 10.0 * k
        data["membrane.strain"][:, k - 1] *= k
    other = renamed(data)
    assert judge(other).largest_error == judge(data).largest_error
    one = [path.read_bytes() for path in plots.save_pictures(data, tmp_path / "one")]
    assert one == [path.read_bytes() for path in plots.save_pictures(other, tmp_path / "other")]
    assert len(one) == 5


def test_pictures_are_drawn_for_what_was_recorded(data, tmp_path):
    names = {path.stem for path in plots.save_pictures(data, tmp_path / "all")}
    assert names == {"sensors", "strains", "damage", "damage_history", "deflection"}
    names = {path.stem for path in plots.save_pictures(data.drop_vars("membrane.w"), tmp_path / "some")}
    assert names == {"sensors", "strains", "damage", "damage_history"}
    names = {path.stem for path in plots.save_pictures(data.isel(time=slice(6)), tmp_path / "one_window")}
    assert "damage_history" in names  # damage changes
    names = {path.stem for path in plots.save_pictures(data.isel(time=slice(5)), tmp_path / "constant")}
    assert "damage_history" not in names


def test_nothing_is_drawn_of_a_stranger_s_run_and_one_line_says_why(tmp_path, caplog):
    assert plots.save_pictures(xr.Dataset({"a.y": ("time", [0.0])}), tmp_path) == []
    (record,) = caplog.records
    assert "no pictures: no component is a membrane: an FMU with the model name 'membrane'." in record.getMessage()
    assert "\n" not in record.getMessage()


def test_the_history_puts_estimate_and_truth_under_their_headings(data):
    table = history_table(judgements(data))
    cells = {str(column.header): list(column.cells) for column in table.columns}
    for row, judgement in enumerate(judgements(data)):
        zone = int(np.argmax(judgement.estimated))
        assert cells["estimated [%]"][row] == f"{100 * judgement.estimated[zone]:.1f}"
        assert cells["true there [%]"][row] == f"{100 * judgement.true[zone]:.0f}"
