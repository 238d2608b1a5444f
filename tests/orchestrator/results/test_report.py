"""The page of a run: whole, from disk, without a network, and true."""

from __future__ import annotations

import json
import os
import re

import numpy as np
import pytest
import xarray as xr
from command_line import invoke
from gossamer_files.charts import Chart
from gossamer_files.thinning import Pixels
from gossamer_orchestrator import ResultsError
from gossamer_orchestrator.pages import Page, write_page
from gossamer_orchestrator.pages.page import unbroken
from gossamer_orchestrator.results.judgements import windows
from gossamer_orchestrator.results.readers import StrainError
from gossamer_orchestrator.results.report import run_page, write_report
from gossamer_orchestrator.words import duration
from hypothesis import given
from hypothesis import strategies as st
from long_run import long_run
from reading_pages import Reader, numbers, with_spaces
from saving import save_results


@pytest.fixture
def certain(data) -> xr.Dataset:
    """Results of a detector that states its deviation, in place of a similarity."""
    data = data.drop_vars("detector.similarity").assign_attrs(schema="gossamer.results", version=1)
    data["detector.deviation"] = (data["detector.damage"].dims, 0.08 * data["detector.damage"].to_numpy())
    data["detector.misfit"] = ("time", np.full(10, 0.4))
    return data


def page_of(data, folder):
    return Reader(write_report(data, folder).read_text(encoding="utf-8"))


def charts_of(data, folder, choice=""):
    """Return the charts of a page by title, of a sensor those of it."""
    return {each.title: each for each in run_page(data, folder).charts if not each.choice or each.choice.startswith(choice)}


def trace(chart, name):
    return next(each for each in chart.traces if each["name"].startswith(name) and each.get("showlegend", True))


def test_the_page_is_one_valid_file_that_needs_no_network(certain, tmp_path):
    path = write_report(certain, tmp_path)
    text = path.read_text(encoding="utf-8")
    page = Reader(text)
    assert [each.name for each in tmp_path.iterdir()] == ["report.html"]
    assert text.startswith("<!DOCTYPE html>")
    names = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(names) == len(set(names))
    for _, attributes in page.tags:
        assert "src" not in attributes
        assert attributes.get("href", "#").startswith("#")
        for reference in ("for", "aria-labelledby"):
            assert attributes.get(reference, names[0]) in names
    assert not re.search(r"https?:|@import|url\(", text)
    (policy,) = [attributes["content"] for tag, attributes in page.tags if attributes.get("http-equiv")]
    assert policy.startswith("default-src 'none'")
    assert path.stat().st_size < 3e6
    assert "plotly.js v" in page.unpacked("library")[:200]


def test_the_verdict_is_a_sentence_with_its_uncertainty(certain, tmp_path):
    page = page_of(certain, tmp_path)
    assert page.inside["verdict"] == (
        "Damaged: zone 2 lost 20.0 ± 1.6 % of its stiffness and zone 7 lost 4.0 ± 0.3 %, judged at "
        "t = 8.0000 s; 14 other zones are undamaged, each within ± 0.1 % (± is one standard deviation)."
    )
    assert "True then: 30 % in zone 2; the mean absolute error over all zones is 0.8" in page.inside[None]


def test_the_twin_s_answer_stands_on_top_where_it_explains_the_record_and_the_detector_s_beside_it(certain, tmp_path):
    damage, deviation = np.zeros(16), np.full(16, 0.001)
    damage[[1, 6]], deviation[6] = (0.2, 0.305), 0.0062
    finding = {"onset": 5.0, "onset_deviation": 3e-3, "damage": damage.tolist(), "deviation": deviation.tolist()}

    def page(misfit):
        (tmp_path / "watch.json").write_text(json.dumps({"alarms": [6.0], "findings": [finding], "misfit": [misfit]}))
        return page_of(certain, tmp_path)

    lost = "zone 7 lost 30.50 ± 0.62 % of its stiffness and zone 2 lost 20.00 ± 0.10 %"
    explained = page(1.0)
    assert explained.inside["verdict"] == (
        f"Damaged: {lost}, since t = 5.000 ± 0.003 s, by the digital twin, which explains the record "
        "(± is one standard deviation)."
    )
    assert (
        "The detector differs by up to 26.5 % in zone 7, for its window began before that onset: zone 2 lost 20.0 ± 1.6 %"
        in (explained.inside[None])
    )
    assert "the mean absolute error over all zones is 2.53 %" in explained.inside[None]
    text = page(3.0).inside[None]
    assert "The digital twin raised its first alarm at t = 6.0000 s." in text
    assert f"The digital twin dates the onset of damage to t = 5.000 ± 0.003 s: {lost}." in text
    assert page(3.0).inside["verdict"].startswith("Damaged: zone 2 lost 20.0 ± 1.6 % of its stiffness and zone 7")
    assert "Damage since t = 5.000 ± 0.003 s, by the digital twin" in text
    html = with_spaces((tmp_path / "report.html").read_text(encoding="utf-8"))
    for zone, damage in (("2", "20.00 ± 0.10"), ("7", "30.50 ± 0.62")):
        assert f'<tr><th scope="row">{zone}</th><td>{damage}</td></tr>' in html


def test_no_line_of_a_page_ends_between_a_number_and_its_unit(certain, tmp_path):
    text = write_report(certain, tmp_path).read_text(encoding="utf-8")
    assert "zone 2 lost 20.0\xa0±\xa01.6\xa0% of its stiffness" in text
    assert "30\xa0% in zone 2" in text  # of the list below the headline
    assert "0\xa0s to 9\xa0s" in text  # of a table
    assert unbroken("5 steps of 3e-4 s, 20 mm and 3 more") == "5 steps of 3e-4\xa0s, 20\xa0mm and 3 more"
    one = Page(title="one", sentence="One.", charts=[Chart("First 5 s", note="Within 2 %.")])
    (chart,) = json.loads(Reader(write_page(one, tmp_path / "one.html").read_text(encoding="utf-8")).unpacked("data"))[
        "charts"
    ]
    assert (chart["title"], chart["note"]) == ("First 5\xa0s", "Within 2\xa0%.")


def test_a_verdict_says_what_is_not_known(data, certain, later_window_invalid, tmp_path):
    assert "the detector states no uncertainty" in page_of(data, tmp_path).inside["verdict"]
    healthy = certain.copy(deep=True)
    healthy["detector.damage"][:] = 0.0
    assert page_of(healthy, tmp_path).inside["verdict"].startswith("No damage: judged at t = ")
    healthy["detector.deviation"][:, 4] = 0.05
    page = page_of(healthy, tmp_path)
    assert page.inside["verdict"].startswith("No damage that is certain: judged at t = ")
    assert "; 15 other zones are undamaged, each within" in page.inside["verdict"]
    assert page.inside["verdict"].endswith("; not determined: zone 5 below 10 %.")
    assert any(attributes.get("class") == "verdict invalid" for _, attributes in page.tags)
    never = data.copy(deep=True)
    never["detector.valid"][:] = 0.0
    assert page_of(never, tmp_path).inside["verdict"].startswith("No valid judgement. 2 windows of the detector ended")
    page = page_of(later_window_invalid(data), tmp_path)
    assert "The window that ended at 8.0000 s gave no valid judgement" in page.inside[None]
    assert page.inside["verdict"].startswith("No damage: judged at t = 4.0000 s")
    assert any(attributes.get("class") == "verdict invalid" for _, attributes in page.tags)


@pytest.mark.parametrize(
    ("findings", "kind"), [([], "invalid"), ([0.2], "invalid"), ([0.0], "healthy"), ([0.0, 0.2], "invalid")]
)
def test_no_damage_is_no_verdict_where_the_twin_raised_an_alarm_that_it_did_not_take_back(certain, tmp_path, findings, kind):
    certain["detector.damage"][:] = 0.0
    found = [{"onset": 5.0, "onset_deviation": 0.1, "damage": [d] * 16, "deviation": [0.01] * 16} for d in findings]
    (tmp_path / "watch.json").write_text(json.dumps({"alarms": [6.0, 7.0][: max(1, len(found))], "findings": found}))
    page = page_of(certain, tmp_path)
    assert any(attributes.get("class") == f"verdict {kind}" for _, attributes in page.tags)
    assert page.inside["verdict"].endswith("But the digital twin raised an alarm.") == (kind == "invalid")


def test_where_no_true_damage_is_recorded_the_estimate_stands_alone(certain, tmp_path):
    for unknown in (certain.drop_vars("membrane.damage"), certain.drop_vars([n for n in certain if "membrane" in n])):
        page = page_of(unknown, tmp_path)
        assert page.inside["verdict"].startswith("Damaged: zone 2 lost 20.0 ± 1.6 %")
        assert "The true damage is not recorded." in (tmp_path / "report.html").read_text(encoding="utf-8")
        *_, (bars,) = charts_of(unknown, tmp_path)["Damage of each zone with two standard deviations"].steps.traces
        assert bars["y"] == pytest.approx(100.0 * windows(unknown)[-1].estimated)


def test_nodes_beside_the_edge_are_drawn_at_the_slider_s_instants(certain, tmp_path):
    content = run_page(certain, tmp_path).content
    w = content["surface"]["places"].reshape(10, 9, 9, 3)[..., 2]
    assert w[:, 1:-1, 1:-1] == pytest.approx(certain["membrane.w"].to_numpy(), abs=1e-6)
    assert not w[:, 0].any()
    assert content["frames"].tolist() == certain["time"].to_numpy().tolist()
    flat = charts_of(certain.drop_vars("membrane.w"), tmp_path)["Membrane"]
    assert "not recorded, so it is drawn flat" in flat.note


def test_compensated_strain_is_compared_with_the_true_strain_of_its_time(certain, tmp_path):
    certain["compensator1.delay"] = ("time", [2.0] * 10)
    certain["compensator1.strain_deviation"] = ("time", [1e-3] * 10)
    now = certain["compensator1.strain"].to_numpy()
    certain["compensator1.strain"] = ("time", np.r_[now[:2], now[:-2]])
    charts = charts_of(certain, tmp_path, "1")
    assert charts["Strain"].result == "sensor 1, RMS error < 1e-9 % of range"
    low, high = (each["y"] for each in charts["Strain"].traces[:2])
    assert high - low == pytest.approx(0.4)  # [%]
    assert trace(charts["Strain"], "compensated")["x"].tolist() == (np.arange(10.0) - 2.0).tolist()
    error = charts["Error of the compensated strain"]
    assert np.isnan(trace(error, "error")["y"][-2:]).all()
    assert error.result.startswith("0 % of the points leave the band")


def test_the_page_knows_what_share_of_the_points_leaves_the_band(certain, tmp_path):
    certain["compensator1.strain_deviation"] = ("time", [1e-3] * 10)
    certain["compensator1.strain"] = certain["compensator1.strain"] + 3e-3 * (certain["time"] < 2.5)
    results = [charts_of(certain, tmp_path, f"{k}")["Error of the compensated strain"].result for k in range(1, 5)]
    assert results == ["30 % of the points leave the band; 5 % would be right", "", "", ""]


def test_a_loop_has_resistance_and_strain_of_the_same_time(certain, tmp_path):
    """What a late compensator states is recorded two seconds later; of the last two nothing is known."""
    known = 100.0 * certain["compensator1.strain"].to_numpy()
    late = certain.drop_vars("membrane.strain").assign({"compensator1.delay": ("time", [2.0] * 10)})
    chart = charts_of(late, tmp_path, "1")["Resistance against strain"]
    now = {name: np.concatenate([dots[0][name] for dots in chart.steps.traces]) for name in ("x", "y")}
    for loop in (chart.traces[0], now):
        rows = np.asarray(loop["y"]).round().astype(int) - 100  # 100 ohm at first, one more each second
        assert loop["x"][rows < 8] == pytest.approx(known[rows[rows < 8] + 2])
        assert np.isnan(loop["x"][rows >= 8]).all()


def test_a_strain_that_a_file_feeds_to_a_sensor_is_its_true_one(certain, tmp_path):
    replayed, fed = 0.03 + 0.01 * np.cos(np.arange(10.0)), json.dumps([["membrane.strain[1]", "sensor1.strain"]])
    beside = certain.assign({"sensor1.strain": ("time", replayed)})
    alone = beside.drop_vars([name for name in beside if str(name).startswith("membrane")])
    felt = certain["membrane.strain"].to_numpy()[:, 0]
    for data, true in ((beside, replayed), (alone, replayed), (beside.assign_attrs(connections=fed), felt)):
        chart = charts_of(data, tmp_path, "1")["Strain"]
        assert trace(chart, "true")["y"] == pytest.approx(100.0 * true)
        assert "RMS error" in chart.result


def test_errors_are_in_two_digits_and_without_powers_of_ten(certain):
    shares = (1e-10, 0.023, 8.31, 99.4, 99.6, 185.4)  # [%]
    said = [StrainError(share / 100.0, 1.0, np.nan, np.zeros(1), None).sentence for share in shares]
    assert said == [f"RMS error {size} % of range" for size in ("< 1e-9", "0.023", "8.3", "99", "100", "185")]


def test_the_load_and_what_it_does_to_the_membrane_stand_on_the_page(certain, tmp_path):
    built_in = {"pressure_amplitude": 2.0, "pressure_frequency": 0.25, "pressure_phase": 0.0}
    certain.attrs["fmus"] = json.dumps({"membrane": {"model": "membrane", "parameters": built_in}})
    certain.attrs["connections"] = json.dumps([["wind.y", "membrane.pressure"]])
    certain["wind.y"], certain["membrane.base_acceleration"] = ("time", np.arange(10.0)), ("time", np.arange(10.0))
    certain["membrane.largest_strain"] = ("time", np.full(10, 0.05))
    charts = charts_of(certain, tmp_path)
    built, added = charts["Load: pressure on the membrane"].traces
    assert built["y"] == pytest.approx(2.0 * np.sin(0.5 * np.pi * np.arange(10.0)))
    assert added["y"] == pytest.approx(np.arange(10.0))
    assert charts["Load: motion of the base"].traces[0]["y"] == pytest.approx(np.arange(10.0))
    assert charts["Largest strain of the membrane"].traces[0]["y"] == pytest.approx(5.0)
    assert "What else was recorded" not in {each.section for each in charts.values()}


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=300), st.integers(1, 20))
def test_no_peak_is_lost_by_thinning(values, pixels):
    thinned = Pixels(len(values), pixels)
    curve = np.concatenate([thinned.thin(np.array(values)[rows]) for rows in thinned.parts()])
    times = np.concatenate([thinned.times(np.arange(float(len(values)))[rows]) for rows in thinned.parts()])
    assert len(times) == len(curve) <= 2 * pixels
    assert (curve.min(), curve.max()) == (min(values), max(values))
    assert (np.diff(times) >= 0.0).all()


def test_a_long_run_stays_small_and_says_how_it_was_thinned(tmp_path):
    n = 50_000
    values = np.random.default_rng(1).normal(size=n)
    values[31_234] = 99.0
    data = xr.Dataset({f"a.y{k}": ("time", values) for k in range(8)}, coords={"time": np.arange(n) * 1e-3})
    page = page_of(data, tmp_path)
    (chart,) = json.loads(page.unpacked("data"))["charts"]
    curve = numbers(chart["traces"][0]["y"])
    assert curve.max() == 99.0
    assert len(curve) <= 5000
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Of the 50000 recorded points, curves over time show the smallest and the largest of every 20" in text
    assert len(text) < 3e6


def test_a_page_of_ten_minutes_stays_under_ten_megabytes(tmp_path):
    data = long_run()
    assert data.sizes["time"] * 3e-4 == pytest.approx(600.0)
    assert write_report(data, tmp_path).stat().st_size < 10e6


def test_the_tables_say_what_connections_do_and_count_in_plain_words(certain, tmp_path):
    changes = {"gain": 2.0, "noise": {"kind": "normal", "amplitude": 0.1}, "dropout": {"probability": 0.001, "seed": 3}}
    certain.attrs["connections"] = json.dumps([["a.y", "b.u", changes]])
    given = {"start": {"stiff": 3e6}, "parameters": {"stiff": 3e6}, "units": {"stiff": "Pa"}}
    certain.attrs["fmus"] = json.dumps({"a": given})
    certain["a.limit"] = ("time", np.full(10, 4.0), {"units": "ohm"})
    write_report(certain.isel(time=slice(6)), tmp_path)
    text = with_spaces((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert (
        "gain 2; normal noise, standard deviation 0.1, seed 0; 0.1 % of the samples are lost, the last is held, seed 3"
        in text
    )
    assert '<th scope="row">stiff</th><td>3000000</td><td>Pa</td><td>scenario</td>' in text
    assert '<th scope="row">a.limit</th><td>4</td><td>ohm</td>' in text
    for summary in ("1 connection", "1 window"):
        assert f"<summary>{summary}</summary>" in text


@pytest.mark.parametrize(("seconds", "words"), [(12.0, "12 s"), (1200.0, "1200 s"), (7.2e-3, "7.2 ms"), (0.5, "500 ms")])
def test_durations_are_without_powers_of_ten(seconds, words):
    assert duration(seconds) == words


def test_a_stranger_s_run_has_a_page_and_its_words_are_only_words(tmp_path):
    data = xr.Dataset({"a.y": ("time", [0.0, np.nan])}, coords={"time": [0.0, 1.0]}, attrs={"title": "<script>$x</script>"})
    page = page_of(data, tmp_path)
    assert page.inside["verdict"].startswith("No judgement: the run had no detector.")
    data["detector.valid"] = 0.0 * data["time"]
    page = page_of(data, tmp_path)
    assert page.inside["verdict"].startswith("No judgement: the results lack detector.damage. Add it to [record]")
    data["detector.damage"] = (("time", "zone"), np.zeros((2, 4)))
    page = page_of(data, tmp_path)
    assert page.inside["verdict"].startswith("No judgement: until t = 1 s no window ended.")
    assert "&lt;script&gt;$x" in (tmp_path / "report.html").read_text(encoding="utf-8")
    with pytest.raises(ResultsError, match="have no row"):
        write_report(data.isel(time=slice(0)), tmp_path)


def test_report_writes_a_page_and_view_opens_it(certain, tmp_path, monkeypatch):
    save_results(certain, tmp_path)
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda url: bool(opened.append(url)))
    result = invoke(["view", str(tmp_path)])
    assert result.stdout == f"{tmp_path / 'report.html'}\n"
    assert "No browser could be started" in result.stderr
    assert opened == [(tmp_path / "report.html").as_uri()]
    first = (tmp_path / "report.html").read_bytes()
    result = invoke(["report", str(tmp_path / "results.nc")])
    assert (result.exit_code, result.stdout) == (0, f"{tmp_path / 'report.html'}\n")
    assert (tmp_path / "report.html").read_bytes() == first
    (tmp_path / "watch.json").write_text('{"alarms": [0.8], "findings": [], "time": [], "misfit": [], "score": []}')
    os.utime(tmp_path / "watch.json", ns=(0, (tmp_path / "report.html").stat().st_mtime_ns + 1_000_000))
    assert invoke(["view", str(tmp_path)]).exit_code == 0  # the twin watched it since
    assert "The digital twin raised" in (tmp_path / "report.html").read_text(encoding="utf-8")
    result = invoke(["report", str(tmp_path / "nowhere")])
    assert result.exit_code == 1
    assert "there are no results at" in result.stderr


def test_a_folder_without_results_names_those_below_it_or_beside_it(certain, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_results(certain, tmp_path / "out/damaged")
    (tmp_path / "out/fmus").mkdir()

    def said(*arguments):
        result = invoke(list(arguments))
        assert (result.exit_code, result.stdout) == (1, "")
        return result.stderr

    assert said("view", "out") == "the folder out has no page and no results. Did you mean out/damaged?\n"
    assert said("view", ".") == "the folder . has no page and no results. Did you mean out/damaged?\n"
    assert said("report", "out/fmus") == "the folder out/fmus has no results. Did you mean out/damaged?\n"
    assert said("report", "out/damagd") == "there are no results at out/damagd. Did you mean out/damaged?\n"
    assert said("view", "sensor.json") == "there is no file or folder sensor.json. Did you mean out/damaged?\n"
    for name in "abc":
        save_results(certain, tmp_path / "out" / name)
    assert said("plot", "out").endswith("Did you mean out/a or out/b or out/c, or another of the 4 in out?\n")
    assert said("view", "out/damagd").endswith("Did you mean out/damaged or out/a or out/b, or another of the 4 in out?\n")
