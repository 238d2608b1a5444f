"""Plots say what they show, and are drawn for what was recorded."""

from __future__ import annotations

import json
import re
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from gossamer_orchestrator import judge
from gossamer_orchestrator.results import plots
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


def test_every_picture_has_units_on_its_axes(data):
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


def test_titles_say_when_and_how_well(data, later_window_invalid):
    assert plots.plot_damage_map(data, ax=Figure().add_subplot()).get_title() == "Estimated damage [%] at t = 8.0000 s"
    assert "RMS error < 1e-9 % of range" in plots.plot_strain(data, ax=Figure().add_subplot()).get_title()
    ax = plots.plot_damage_history(later_window_invalid(data), ax=Figure().add_subplot())
    assert ax.get_xlim()[1] > 9.0
    markers = {line.get_marker(): list(line.get_xdata()) for line in ax.lines if line.get_marker() in ("o", "x")}
    assert markers == {"o": [4.0], "x": [8.0]}


def test_the_history_of_damage_names_its_band_and_marks_what_the_twin_saw(data, tmp_path):
    data["detector.deviation"] = (data["detector.damage"].dims, 0.1 * data["detector.damage"].to_numpy())
    watch = {"alarms": [6.0, 7.0], "findings": [{"onset": 5.2, "onset_deviation": 0.1, "damage": [0.3]}]}
    ax = plots.plot_damage_history(data, watch=watch, ax=Figure().add_subplot())
    named = [text.get_text() for text in ax.get_legend().get_texts()]
    assert {name: named.count(name) for name in ("± 2 standard deviations", "alarm, twin", "onset, twin")} == {
        "± 2 standard deviations": 1,
        "alarm, twin": 1,
        "onset, twin": 1,
    }
    assert [line.get_xdata()[0] for line in ax.lines if line.get_linestyle() == "-."] == [6.0, 7.0]
    assert [line.get_xdata().tolist() for line in ax.lines if line.get_marker() == "v"] == [[5.2]]
    plots.save_pictures(data, tmp_path / "without")
    (tmp_path / "watch.json").write_text(json.dumps(watch))
    plots.save_pictures(data, tmp_path)
    plain, marked = (folder / "damage_history.png" for folder in (tmp_path / "without", tmp_path))
    assert plain.read_bytes() != marked.read_bytes()


def test_the_legend_of_the_history_is_whole_however_many_zones_are_damaged(data, later_window_invalid, tmp_path):
    data["detector.deviation"] = (data["detector.damage"].dims, np.full((10, 16), 0.02))
    data["membrane.damage"][5:, :12] = 0.3
    data["detector.damage"][4:] = 0.2
    watch = {"alarms": [6.0], "findings": [{"onset": 5.2, "onset_deviation": 0.1, "damage": [0.3]}]}
    figure = Figure(figsize=(9.0, 4.8), layout="constrained")
    ax = plots.plot_damage_history(later_window_invalid(data), watch=watch, ax=figure.subplots())
    FigureCanvasAgg(figure).draw()
    legend, whole = ax.get_legend().get_window_extent(), figure.bbox
    assert len(ax.get_legend().get_texts()) == 18
    assert whole.x0 <= legend.x0
    assert legend.x1 <= whole.x1
    assert whole.y0 <= legend.y0
    assert ax.get_window_extent().height > 0.4 * whole.height


def test_what_is_no_valid_judgement_has_neither_colour_nor_band_and_no_band_is_below_zero(data, later_window_invalid):
    data["detector.damage"][4:, 1] = 0.1
    data["detector.damage"][8:, 2:14] = 0.8  # of the window that is not valid
    data["detector.deviation"] = (data["detector.damage"].dims, np.full((10, 16), 0.2))
    ax = plots.plot_damage_history(later_window_invalid(data), ax=Figure().add_subplot())
    named = [text.get_text() for text in ax.get_legend().get_texts()]
    assert [name for name in named if "zone" in name] == [
        "other zones, or not valid",
        "zone 2, estimated",
        "zone 2, true",
    ]
    (band,) = ax.collections
    places = np.vstack([path.vertices for path in band.get_paths()])
    assert places[:, 0].max() <= 8.0
    assert (places[:, 1].min(), places[:, 1].max()) == pytest.approx((0.0, 50.0))
    (line,) = (line for line in ax.lines if line.get_label() == "zone 2, estimated")
    assert np.isfinite(line.get_ydata()).tolist() == [4 <= k < 8 for k in range(10)]
    data["detector.valid"][:] = 0.0
    none = plots.plot_damage_history(data, ax=Figure().add_subplot()).get_legend().get_texts()
    assert [text.get_text() for text in none] == ["other zones, or not valid", "zone 2, true", "not valid"]


def test_the_compensated_strain_is_a_thin_line_on_the_broad_true_one(data):
    ax = plots.plot_strain(data, 1, ax=Figure().add_subplot())
    true, compensated = ax.lines
    assert true.get_linewidth() > 3.0 * compensated.get_linewidth()
    assert true.get_zorder() <= compensated.get_zorder()


def test_no_number_beside_a_strain_is_long_however_little_it_changes(data):
    for change in (1e-9, 1e-6, 1e-3, 1.0):
        few = 0.0204081632653 + change * (data["membrane.strain"] - 0.02)
        both = data.assign({"membrane.strain": few, "compensator1.strain": few[:, 0]})
        figure = Figure(figsize=(5.5, 3.5))
        ax = plots.plot_strain(both, ax=figure.add_subplot())
        FigureCanvasAgg(figure).draw()
        assert max(len(re.findall(r"\d", label.get_text())) for label in ax.get_yticklabels()) <= 4


def test_a_compensator_that_is_late_is_compared_with_the_strain_of_that_time(data):
    """The estimator states its delay; by it, its strain is drawn earlier."""
    data["compensator1.delay"] = ("time", [2.0] * 10)
    now = data["compensator1.strain"].to_numpy()
    data["compensator1.strain"] = ("time", np.r_[now[:2], now[:-2]])
    ax = plots.plot_strain(data, 1, ax=Figure().add_subplot())
    assert "RMS error < 1e-9 % of range" in ax.get_title()
    assert "drawn 2 s earlier" in ax.get_legend().get_texts()[1].get_text()
    assert len(ax.lines[0].get_xdata()) == 8


def test_an_error_that_is_a_rounding_error_is_seen_on_its_log_scale(data):
    """The exact inverse leaves one at all but the first sample."""
    data["compensator1.strain"] = data["compensator1.strain"] + 1e-4 * (data["time"] == 0.0)
    ax = plots.plot_strain_error(data, 1, ax=Figure().add_subplot())
    low, high = ax.get_ylim()
    assert low < ax.lines[0].get_ydata().min()
    assert ax.lines[0].get_ydata().max() < high


@pytest.mark.parametrize("rows", [slice(5, None), slice(None)])
def test_a_strain_that_is_no_number_can_be_drawn(data, rows):
    data["compensator2.strain"][rows] = np.nan
    plots.plot_strain(data, 2, ax=Figure().add_subplot())
    assert np.isfinite(plots.plot_strain_error(data, 2, ax=Figure().add_subplot()).get_ylim()).all()


def test_errors_of_a_strain_that_hardly_changes_are_strains(data):
    """A run of a few steps ends before the load bends the membrane."""
    data["membrane.strain"] = 0.02 + 1e-9 * data["membrane.strain"]
    data["compensator1.strain"] = ("time", np.full(10, 0.0203))
    assert plots.plot_strain(data, 1, ax=Figure().add_subplot()).get_title() == "Sensor 1: RMS error 0.0003 in strain"
    assert plots.plot_strain_error(data, 1, ax=Figure().add_subplot()).get_ylabel() == "error [1]"


def test_no_numbers_on_the_axes_of_a_loop_overlap_however_little_the_strain_changes(data):
    for change in (1e-12, 1e-9, 1e-6, 1e-3, 1.0):
        figure = Figure(figsize=(4.5, 3.5), dpi=100)
        few = data.assign({"membrane.strain": 0.02 + change * (data["membrane.strain"] - 0.02)})
        ax = plots.plot_sensor_loop(few, ax=figure.add_subplot(), bar=False)
        FigureCanvasAgg(figure).draw()
        boxes = [label.get_window_extent() for label in ax.get_xticklabels()]
        assert all(left.x1 < right.x0 for left, right in pairwise(boxes))
        assert ax.xaxis.get_offset_text().get_text() == ""


def test_the_damage_map_has_zone_1_at_the_origin_and_x_to_the_right(data):
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
    data["membrane.w"] *= 0.193 * np.random.default_rng(2).uniform(0.9, 1.1, (7, 7))
    contours = plots.plot_deflection(data, ax=Figure().add_subplot()).collections[0]
    assert contours.zmin >= contours.levels[0]


def test_a_long_run_shows_the_first_and_the_last_window_of_a_sensor(data):
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
    judged = data[["membrane.damage", *(name for name in data if name.startswith("detector."))]]
    names = {path.stem for path in plots.save_pictures(judged.isel(time=slice(6)), tmp_path / "one_window")}
    assert "damage_history" in names  # damage changes
    names = {path.stem for path in plots.save_pictures(judged.isel(time=slice(5)), tmp_path / "constant")}
    assert "damage_history" not in names


def test_what_was_recorded_of_some_places_only_is_not_drawn_at_others(data, tmp_path):
    nodes = np.arange(1, 8)
    some = data.assign_coords(w_i=nodes, w_j=nodes).isel(zone=slice(7), sensor=slice(2), w_i=[3], w_j=[3])
    assert [path.stem for path in plots.save_pictures(some, tmp_path)] == ["damage_history"]


def test_nothing_is_drawn_of_a_stranger_s_run_and_one_line_says_why(tmp_path, caplog):
    assert plots.save_pictures(xr.Dataset({"a.y": ("time", [0.0])}), tmp_path) == []
    (record,) = caplog.records
    assert (
        "no pictures: no component is a membrane. A membrane is an FMU with the model name 'membrane'."
        in record.getMessage()
    )
    assert "\n" not in record.getMessage()


def test_any_title_can_stand_above_a_picture(data, tmp_path):
    """A long one is cut; one in dollars is no formula."""
    assert plots.save_pictures(data.assign_attrs(title=2_000 * r"$\nonsense{$ "), tmp_path)


def test_the_estimate_of_damage_is_drawn_alone_where_the_truth_is_not_recorded(data, tmp_path):
    unknown = data.drop_vars([name for name in data if "membrane" in name])
    assert [path.stem for path in plots.save_pictures(unknown, tmp_path)] == ["damage", "damage_history"]
    drawn = plots.plot_damage_history(unknown, ax=Figure().add_subplot()).get_legend().get_texts()
    assert [text.get_text() for text in drawn] == ["other zones", "zone 2, estimated", "zone 7, estimated", "judgement"]
    ax = plots.plot_damage_map(unknown, ax=Figure().add_subplot())
    assert ax.get_title() == "Estimated damage [%] at t = 8.0000 s"
