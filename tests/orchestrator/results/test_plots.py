"""Plots say what they show, and are drawn for what was recorded."""

from __future__ import annotations

import json
import re
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from gossamer_files.plots import draw
from gossamer_orchestrator import judge
from gossamer_orchestrator.results.readers import Recorded, readers_of
from gossamer_orchestrator.results.report import save_pictures
from gossamer_orchestrator.results.report.damage import DamageHistory, history_charts, zone_charts
from gossamer_orchestrator.results.report.membrane import deflection_chart, deflection_map
from gossamer_orchestrator.results.report.pictures import PICTURES
from gossamer_orchestrator.results.report.sensors import loop_charts, strain_charts
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


@pytest.fixture
def run(tmp_path):
    """Return what makes charts of results; beside them may be what the twin saw."""

    def of(data, watch=None):
        if watch:
            (tmp_path / "watch.json").write_text(json.dumps(watch))
        return Recorded(data, tmp_path)

    return of


def axes(chart, size=(9.0, 4.8)):
    """Draw a chart into a figure, whole."""
    figure = Figure(figsize=size, layout="constrained")
    ax = draw(chart, figure.subplots())
    FigureCanvasAgg(figure).draw()
    return ax


def history(run):
    (chart,) = history_charts(DamageHistory(run))
    return axes(chart)


def strain(run, number=1):
    return [chart for reader in readers_of(run.data) if reader.number == number for chart in strain_charts(run, reader)]


def loop(run, number=1):
    return next(loop_charts(run, reader)[0] for reader in readers_of(run.data) if reader.number == number)


def named(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_every_picture_has_units_on_its_axes_where_they_have_any(data, run):
    recorded = run(data)
    for name, make in PICTURES.items():
        for chart in make(recorded).charts:
            ax = axes(chart)
            assert ax.get_title()
            assert ax.get_xlabel().endswith("]") or ax.get_xlabel() in ("zone", "x →")
            assert ax.get_ylabel().endswith("]") or name == "damage"


def test_titles_say_when_and_how_well(data, later_window_invalid, run):
    (zones, _) = PICTURES["damage"](run(data)).charts
    assert zones.title == "Damage of the zones, judged at t = 8.0000 s"
    assert "RMS error < 1e-9 % of range" in axes(strain(run(data))[0]).get_title()
    ax = history(run(later_window_invalid(data)))
    markers = {line.get_marker(): list(line.get_xdata()) for line in ax.lines if line.get_marker() in ("o", "x")}
    assert markers == {"o": [4.0], "x": [8.0]}


def test_a_judgement_spans_its_window_also_the_last(data, run):
    """It is known from the end of its window on; after the last one nothing would be left to span."""
    (chart,) = history_charts(DamageHistory(run(data)))
    (line,) = (trace for trace in chart.traces if trace["name"] == "zone 2")
    known = np.isfinite(line["y"])
    assert line["x"][known].tolist() == [0.0, 4.0, 4.0, 8.0]
    assert line["y"][known].tolist() == [0.0, 0.0, 20.0, 20.0]


def test_the_history_of_damage_marks_what_the_twin_saw(data, run, tmp_path):
    watch = {"alarms": [6.0, 7.0], "findings": [{"onset": 5.2, "onset_deviation": 0.1, "damage": [0.3]}]}
    ax = history(run(data, watch))
    assert {name: named(ax).count(name) for name in ("alarm, twin", "onset, twin")} == {"alarm, twin": 1, "onset, twin": 1}
    dashed = [line.get_xdata()[0] for line in ax.lines if line.get_linestyle() == "-."]
    assert [x for x in dashed if np.isfinite(x)] == [6.0, 7.0]
    assert [5.2] in [line.get_xdata().tolist() for line in ax.lines if line.get_marker() == "D"]
    save_pictures(data, tmp_path / "without")
    save_pictures(data, tmp_path)
    plain, marked = (folder / "damage_history.png" for folder in (tmp_path / "without", tmp_path))
    assert plain.read_bytes() != marked.read_bytes()


def test_the_legend_of_the_history_is_whole_however_many_zones_are_damaged(data, later_window_invalid, run):
    data["detector.deviation"] = (data["detector.damage"].dims, np.full((10, 16), 0.02))
    data["membrane.damage"][5:, :12] = 0.3
    data["detector.damage"][4:] = 0.2
    watch = {"alarms": [6.0], "findings": [{"onset": 5.2, "onset_deviation": 0.1, "damage": [0.3]}]}
    ax = history(run(later_window_invalid(data), watch))
    legend, whole = ax.get_legend().get_window_extent(), ax.figure.bbox
    assert len(named(ax)) == 17
    assert whole.x0 <= legend.x0
    assert legend.x1 <= whole.x1
    assert whole.y0 <= legend.y0
    assert legend.y1 <= ax.xaxis.label.get_window_extent().y0  # it hides nothing
    assert ax.get_window_extent().height > 0.4 * whole.height


def test_what_is_no_valid_judgement_has_neither_colour_nor_band_and_no_band_is_below_zero(data, later_window_invalid, run):
    data["detector.damage"][4:, 1] = 0.1
    data["detector.damage"][8:, 2:14] = 0.8  # of the window that is not valid
    data["detector.deviation"] = (data["detector.damage"].dims, np.full((10, 16), 0.2))
    ax = history(run(later_window_invalid(data)))
    assert [name for name in named(ax) if "zone" in name] == ["zone 2", "zone 2, true"]
    (band,) = ax.collections
    places = np.vstack([path.vertices for path in band.get_paths()])
    assert places[places[:, 1] > 0.0, 0].max() <= 4.0
    assert (places[:, 1].min(), places[:, 1].max()) == pytest.approx((0.0, 50.0))
    (line,) = (line for line in ax.lines if line.get_label() == "zone 2")
    known = np.isfinite(line.get_ydata())
    assert line.get_xdata()[known].max() == 4.0
    data["detector.valid"][:] = 0.0
    assert named(history(run(data))) == ["largest of the others", "not valid", "zone 2, true"]


def test_the_compensated_strain_is_a_thin_line_on_the_broad_true_one(data, run):
    true, compensated = axes(strain(run(data))[0]).lines
    assert true.get_linewidth() > 3.0 * compensated.get_linewidth()
    assert true.get_zorder() <= compensated.get_zorder()


def test_no_number_beside_a_strain_is_long_however_little_it_changes(data, run):
    for change in (1e-9, 1e-6, 1e-3, 1.0):
        few = 0.0204081632653 + change * (data["membrane.strain"] - 0.02)
        both = data.assign({"membrane.strain": few, "compensator1.strain": few[:, 0]})
        ax = axes(strain(run(both))[0], (5.5, 3.5))
        assert max(len(re.findall(r"\d", label.get_text())) for label in ax.get_yticklabels()) <= 4


def test_a_compensator_that_is_late_is_compared_with_the_strain_of_that_time(data, run):
    """The estimator states its delay; by it, its strain is drawn earlier."""
    data["compensator1.delay"] = ("time", [2.0] * 10)
    now = data["compensator1.strain"].to_numpy()
    data["compensator1.strain"] = ("time", np.r_[now[:2], now[:-2]])
    ax = axes(strain(run(data))[0])
    assert "RMS error < 1e-9 % of range" in ax.get_title()
    assert "drawn 2 s earlier" in named(ax)[1]
    assert ax.lines[1].get_xdata().tolist() == (np.arange(10.0) - 2.0).tolist()


@pytest.mark.parametrize("rows", [slice(5, None), slice(None)])
def test_a_strain_that_is_no_number_can_be_drawn(data, rows, run):
    data["compensator2.strain"][rows] = np.nan
    for chart in strain(run(data), 2):
        assert np.isfinite(axes(chart).get_ylim()).all()


def test_errors_of_a_strain_that_hardly_changes_are_strains(data, run):
    """A run of a few steps ends before the load bends the membrane."""
    data["membrane.strain"] = 0.02 + 1e-9 * data["membrane.strain"]
    data["compensator1.strain"] = ("time", np.full(10, 0.0203))
    assert axes(strain(run(data))[0]).get_title() == "Strain: sensor 1, RMS error 0.03 % strain"


def test_no_numbers_on_the_axes_of_a_loop_overlap_however_little_the_strain_changes(data, run):
    for change in (1e-12, 1e-9, 1e-6, 1e-3, 1.0):
        few = data.assign({"membrane.strain": 0.02 + change * (data["membrane.strain"] - 0.02)})
        ax = axes(loop(run(few)), (4.5, 3.5))
        boxes = [label.get_window_extent() for label in ax.get_xticklabels()]
        assert all(left.x1 < right.x0 for left, right in pairwise(boxes))
        assert ax.xaxis.get_offset_text().get_text() == ""


def test_the_damage_map_has_zone_1_at_the_origin_and_x_to_the_right(data, run):
    judged = DamageHistory(run(data))
    ax = axes(zone_charts(judged, [(9.0, 1, 1)])[0])
    drawn = {text.get_text(): text.get_position() for text in ax.texts}
    assert drawn["2\n20.0\ntrue 30"] == (2.0, 1.0)
    assert ax.collections[0].get_array()[0, 1] == pytest.approx(20.0)
    places = ax.get_window_extent()
    assert places.width == pytest.approx(places.height)


def test_maps_of_the_membrane_know_its_size(data, run):
    assert deflection_map(run(data)).x == "x [side]"
    data["membrane.side_length"], data["membrane.edge_displacement"] = ("time", [0.588] * 10), ("time", [0.006] * 10)
    ax = axes(deflection_map(run(data)))
    assert ax.get_xlabel() == "x [m]"
    assert ax.get_xlim() == pytest.approx((0.0, 0.6), abs=0.01)


def test_the_edge_of_the_membrane_is_within_the_contours(data, run):
    """A spline is zero there only up to rounding."""
    data["membrane.w"] *= 0.193 * np.random.default_rng(2).uniform(0.9, 1.1, (7, 7))
    contours = axes(deflection_map(run(data))).collections[0]
    assert contours.zmin >= contours.levels[0]
    assert deflection_chart(run(data)).result.startswith("largest ")


def test_a_long_run_shows_the_first_and_the_last_window_of_a_sensor(data, run):
    data["detector.index"][6:8] = 1.5
    first, last = loop(run(data)).traces
    assert (first["name"], last["name"]) == ("first window", "last window")
    assert (first["y"].tolist(), last["y"].tolist()) == ([100.0, 101.0, 102.0, 103.0, 104.0], [106.0, 107.0, 108.0])
    (whole,) = loop(run(data.isel(time=slice(4)))).traces
    assert whole["name"] == "end of the run"


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
    one = [path.read_bytes() for path in save_pictures(data, tmp_path / "one")]
    assert one == [path.read_bytes() for path in save_pictures(other, tmp_path / "other")]
    assert len(one) == 5


def test_pictures_are_drawn_for_what_was_recorded(data, tmp_path):
    names = {path.stem for path in save_pictures(data, tmp_path / "all")}
    assert names == {"sensors", "strains", "damage", "damage_history", "deflection"}
    names = {path.stem for path in save_pictures(data.drop_vars("membrane.w"), tmp_path / "some")}
    assert names == {"sensors", "strains", "damage", "damage_history"}
    judged = data[["membrane.damage", *(name for name in data if name.startswith("detector."))]]
    names = {path.stem for path in save_pictures(judged.isel(time=slice(6)), tmp_path / "one_window")}
    assert "damage_history" in names  # damage changes
    names = {path.stem for path in save_pictures(judged.isel(time=slice(5)), tmp_path / "constant")}
    assert "damage_history" not in names


def test_what_was_recorded_of_some_places_only_is_not_drawn_at_others(data, tmp_path):
    nodes = np.arange(1, 8)
    some = data.assign_coords(w_i=nodes, w_j=nodes).isel(zone=slice(7), sensor=slice(2), w_i=[3], w_j=[3])
    assert [path.stem for path in save_pictures(some, tmp_path)] == ["damage", "damage_history"]  # bars, by number


def test_nothing_is_drawn_of_a_stranger_s_run_and_one_line_says_why(tmp_path, caplog):
    assert save_pictures(xr.Dataset({"a.y": ("time", [0.0])}), tmp_path) == []
    (record,) = caplog.records
    assert (
        "no pictures: no component is a membrane. A membrane is an FMU with the model name 'membrane'."
        in record.getMessage()
    )
    assert "\n" not in record.getMessage()


def test_any_title_can_stand_above_a_picture(data, tmp_path):
    """A long one is cut; one in dollars is no formula."""
    assert save_pictures(data.assign_attrs(title=2_000 * r"$\nonsense{$ "), tmp_path)


def test_the_estimate_of_damage_is_drawn_alone_where_the_truth_is_not_recorded(data, tmp_path, run):
    unknown = data.drop_vars([name for name in data if "membrane" in name])
    assert [path.stem for path in save_pictures(unknown, tmp_path)] == ["damage", "damage_history"]
    assert named(history(run(unknown))) == ["largest of the others", "zone 2", "judgement"]
