"""The pages of an identification and of an assessment: whole, true, and delivered beside the artifact."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from browsing import opened
from command_line import invoke
from gossamer.pages.sensors import Comparison, verdict
from gossamer_models.automatic import HERE
from gossamer_models.fitting.errors import nrmse
from gossamer_models.sensor import RelaxationTerm, SensorArtifact, default_artifact
from gossamer_models.sensor.plots import sensor_charts
from reading_pages import read_page, values

QUICK = ["--modes", "2", "--relaxations", "2", "--starts", "1"]


def write_record(path, seconds, seed):
    """An elastic sensor with a play and a little noise, in unequal cycles."""
    time = 0.5 * np.arange(int(2 * seconds))
    strain = 0.04 * (1.0 - np.cos(0.25 * time)) * (0.6 + 0.4 * np.sin(0.017 * time) ** 2)
    play = np.zeros_like(strain)
    for k in range(1, strain.size):
        play[k] = max(strain[k] - 0.004, min(strain[k] + 0.004, play[k - 1]))
    noise = np.random.default_rng(seed).normal(scale=0.05, size=time.size)
    rows = zip(time, 100.0 * strain, 100.0 + 400.0 * strain + 600.0 * play + noise, strict=True)
    path.write_text("time_s,strain [%],R_ohm\n" + "".join(f"{t},{s},{r}\n" for t, s, r in rows))
    return path


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """What the command printed, in a folder with the record, the artifact and the page."""
    folder = tmp_path_factory.mktemp("identified")
    record, out = write_record(folder / "measured.csv", 240, 0), folder / "sensor.json"
    answer = invoke(["identify", str(record), *QUICK, "--train", "0:120", "--out", str(out)])
    assert answer.exit_code == 0, answer.output
    return folder, answer


@pytest.fixture(scope="module")
def assessed(identified, tmp_path_factory):
    folder, _ = identified
    out = tmp_path_factory.mktemp("assessed")
    other = write_record(out / "other.csv", 200, 1)
    arguments = ["assess", str(folder / "sensor.json"), str(other), "--fit-scales", "--out", str(out / "judged")]
    arguments += ["--compensator", "exact", "--compensator", "estimator"]
    answer = invoke(arguments)
    assert answer.exit_code == 0, answer.output
    return out / "judged", answer


def table_of(folder, name):
    """Predictions as the command wrote them, by column."""
    return np.genfromtxt(folder / name, delimiter=",", names=True)


def words(page):
    return " ".join(unescape(page.inside[None]).split())


def test_an_identification_ends_with_its_page(identified):
    folder, answer = identified
    page = folder / "sensor" / "report.html"
    assert answer.stdout.splitlines()[-1] == str(page)
    assert answer.stderr.splitlines()[-1] == f"Open {page}, or type 'gossamer view {page.parent}'."
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"https?:|@import|url\(", text)
    assert page.stat().st_size < 3e6


def test_the_curves_of_the_page_are_those_of_the_predictions(identified):
    folder, _ = identified
    _, charts = read_page(folder / "sensor" / "report.html")
    assert list(charts) == [
        "Resistance over time",
        "Residual",
        "Loop",
        "Strain over time",
        "Error of the recovered strain",
        "Error beside that of simple models",
        "Density mu",
        "Everett surface",
    ]
    table = table_of(folder / "sensor", "measured_predicted.csv")
    measured, fitted, predicted = charts["Resistance over time"]["traces"]
    assert [each["name"] for each in (measured, fitted, predicted)] == ["measured", "fitted", "predicted"]
    assert values(measured["x"]) == pytest.approx(table["time_s"])
    assert values(measured["y"]) == pytest.approx(table["resistance_ohm"], rel=1e-6)
    both = np.where(table["fitted"] == 1.0, values(fitted["y"]), values(predicted["y"]))
    assert both == pytest.approx(table["predicted_ohm"], rel=1e-6)
    (area,) = charts["Resistance over time"]["marks"]
    assert (area["x0"], area["x1"]) == (0.0, 120.0)
    chart = charts["Error of the recovered strain"]
    error = 100.0 * (table["recovered_strain_1"] - table["strain_1"]) / np.ptp(table["strain_1"])
    assert values(chart["traces"][0]["y"]) == pytest.approx(error, rel=1e-4, abs=1e-3)
    assert chart["y"] == "recovered - applied [% of range]"  # as the picture beside the artifact has it
    linked = {each["linked"] for each in charts.values() if each["x"] == "time [s]"}
    assert linked == {"time of measured.csv"}
    assert all(each["text"] for each in charts.values())


def test_the_verdict_and_the_facts_have_the_numbers_of_the_fit(identified):
    folder, answer = identified
    page, charts = read_page(folder / "sensor" / "report.html")
    table = table_of(folder / "sensor", "measured_predicted.csv")
    test, size = table["fitted"] == 0.0, float(np.ptp(table["resistance_ohm"]))
    error = nrmse(table["resistance_ohm"][test], table["predicted_ohm"][test], size)
    said = page.inside["verdict"]
    assert said.startswith(f"On the test stretch of measured.csv: Resistance is predicted with an error of {error:.2f} %")
    assert "90 % interval" in said
    assert "better than a static cubic" in said
    bars = charts["Error beside that of simple models"]["traces"]
    assert [each["name"] for each in bars] == [HERE, "static cubic", "regression on lags"]
    assert values(bars[0]["y"])[0] == pytest.approx(error, rel=1e-4)
    text = words(page)
    for path in (folder / "sensor.json", folder / "measured.csv"):
        assert hashlib.sha256(path.read_bytes()).hexdigest() in text
    artifact = SensorArtifact.read(folder / "sensor.json")
    for fact in ("strain [%]", "R_ohm", "480 samples", "no gap", "Wall time", "casadi", artifact.provenance["settings"]):
        assert fact in text, fact
    assert " ".join(answer.stderr.split()).count("90 % confidence") == 1


def test_an_assessment_shows_every_compensator_its_band_and_the_fitted_scales(assessed):
    out, answer = assessed
    path = out / "report.html"
    assert answer.stdout.splitlines()[-1] == str(path)
    assert answer.stderr.splitlines()[-1] == f"Open {path}, or type 'gossamer view {out}'."
    page, charts = read_page(path)
    assert page.inside["verdict"].startswith("On the judged stretch of other.csv: Resistance is predicted with an error of")
    assert "Strain by exact is recovered" in page.inside["verdict"]
    table = table_of(out, "other_predicted.csv")
    history = {each["name"]: each for each in charts["Strain over time"]["traces"] if each.get("showlegend", True)}
    assert list(history) == ["applied", "exact", "± 2 stated deviations, estimator", "estimator"]
    recovered, deviation = table["recovered_strain_by_estimator_1"], table["its_deviation_by_estimator_1"]
    assert values(history["estimator"]["y"]) == pytest.approx(100.0 * recovered, rel=1e-4, nan_ok=True)
    top = values(history["± 2 stated deviations, estimator"]["y"])
    assert top == pytest.approx(100.0 * (recovered + 2.0 * deviation), rel=1e-4, nan_ok=True)
    assert {"Fitted gain", "Fitted offset"} <= set(charts)
    chart = charts["Error of the recovered strain"]
    assert "No deviation is stated by exact." in chart["note"]
    (edge,) = (each for each in chart["traces"] if each["name"].startswith("±") and each.get("showlegend", True))
    reach = 200.0 * deviation / np.ptp(table["strain_1"])  # in % of the range, as the errors
    assert values(edge["y"]) == pytest.approx(reach, rel=1e-4, nan_ok=True)
    assert "Scales of each record" in words(page)


def test_a_fractional_sensor_has_a_table_of_its_parameters_and_no_strain(identified, tmp_path):
    record = identified[0] / "measured.csv"
    options = ["--model", "fractional-sub-model-1", "--terms", "1", "--starts", "1", "--rest-resistance", "100"]
    answer = invoke(["identify", str(record), *options, "--out", str(tmp_path / "fractional.json")])
    assert answer.exit_code == 0, answer.output
    page, charts = read_page(tmp_path / "fractional" / "report.html")
    assert "Strain over time" not in charts
    term = json.loads((tmp_path / "fractional.json").read_text())["terms"][0]
    text = (tmp_path / "fractional" / "report.html").read_text(encoding="utf-8")
    assert f'<th scope="row">a_1</th><td>{term["order"]:.5g}</td>' in text
    assert "none: a fractional model has no inverse" in words(page)


def test_view_opens_the_page_of_an_artifact_or_of_its_folder(identified, assessed, monkeypatch):
    folder, _ = identified
    seen = []
    monkeypatch.setattr("webbrowser.open", lambda url: seen.append(url) or True)
    for path in (folder / "sensor.json", folder / "sensor", folder / "sensor" / "report.html"):
        answer = invoke(["view", str(path)])
        assert answer.stdout == f"{folder / 'sensor' / 'report.html'}\n"
    assert invoke(["view", str(assessed[0])]).exit_code == 0
    assert seen == [(folder / "sensor" / "report.html").as_uri()] * 3 + [(assessed[0] / "report.html").as_uri()]
    answer = invoke(["view", str(folder)])
    assert (answer.exit_code, answer.stdout) == (1, "")


def test_a_page_that_cannot_be_written_leaves_artifact_and_predictions(identified, tmp_path):
    (tmp_path / "sensor" / "report.html").mkdir(parents=True)  # in the way
    record, out = identified[0] / "measured.csv", tmp_path / "sensor.json"
    answer = invoke(["identify", str(record), *QUICK, "--train", "0:120", "--out", str(out)])
    assert answer.exit_code == 0, answer.output
    assert "report.html was not written" in answer.stderr
    assert "Open " not in answer.stderr
    assert str(out) in answer.stdout
    assert "report.html" not in answer.stdout
    assert SensorArtifact.read(out)


def test_without_pictures_there_is_no_page(identified, tmp_path):
    record, out = identified[0] / "measured.csv", tmp_path / "sensor.json"
    answer = invoke(["identify", str(record), *QUICK, "--no-pictures", "--out", str(out)])
    assert answer.exit_code == 0, answer.output
    assert not (tmp_path / "sensor" / "report.html").exists()
    assert "Open " not in answer.stderr
    answer = invoke(["view", str(out)])
    assert (answer.exit_code, answer.stdout) == (1, "")
    assert f"{out} has no page" in answer.stderr


def test_a_constant_eta_is_a_sentence_and_another_one_a_picture():
    kernel = {"rate": 0.1, "exponent": 1.0, "decay_rates": (0.1,), "weights": (1.0,)}
    terms = tuple(RelaxationTerm(amplitude=size, power=power, **kernel) for size, power in ((0.2, 0), (0.1, 1)))
    sensor = replace(default_artifact(), relaxation=terms)
    flat = replace(sensor, nu=sensor.mu)
    charts = {each.title: each for each in sensor_charts(flat)}
    assert list(charts) == ["Density mu", "Everett surface", "Relaxation"]
    assert "eta, the share of mu that a down-switch removes, is 1 everywhere." in charts["Density mu"].note
    (plane,) = charts["Density mu"].traces
    assert plane["z"][3, 1] == sensor.mu[2][3]  # bin 3 of the line 2 below the elastic one
    (surface,) = charts["Everett surface"].traces
    assert surface["z"][-1, 0] == pytest.approx(np.sum(sensor.mu) / sensor.n_lines)
    terms = {each["name"]: (each["x"].tolist(), each["y"].tolist()) for each in charts["Relaxation"].traces}
    assert terms == {"rising strain": ([10.0], [0.2]), "rising strain times strain": ([10.0], [0.1])}
    less = replace(sensor, nu=tuple(tuple(0.5 * value if i else value for value in row) for i, row in enumerate(sensor.mu)))
    charts = {each.title: each for each in sensor_charts(less)}
    assert charts["Share eta"].traces[0]["z"][3, 1] == pytest.approx(0.5)
    assert "What a cycle leaves" in charts


def compared(own, rival, record="a.csv", quantity="resistance"):
    rivals = {"static cubic": rival}
    return Comparison(record=record, quantity=quantity, does="is predicted", own=own, rivals=rivals)


def test_a_verdict_claims_no_more_than_the_intervals_show():
    clear, open_, level, more_error, lost = (
        ((1.0, 0.8, 1.2), (2.0, 1.5, 2.5)),
        ((1.0, 0.5, 1.8), (2.0, 1.5, 2.5)),
        ((2.1, 1.6, 2.6), (2.0, 1.5, 2.5)),
        ((3.1, 2.4, 4.0), (2.0, 1.5, 2.5)),
        ((3.0, 2.6, 4.0), (2.0, 1.5, 2.5)),
    )
    for pair, kind, said in (
        (clear, "healthy", "90 % interval 0.80 to 1.20 %): better than a static cubic (2.00 %)."),
        (open_, "none", "not clearly better than a static cubic (2.00 %)."),
        (level, "none", "no better than a static cubic (2.00 %)."),
        (more_error, "none", "with more error, though the intervals overlap, than a static cubic (2.00 %)."),
        (lost, "invalid", "worse than a static cubic (2.00 %)."),
    ):
        found, sentence, more = verdict([compared(*pair)], "test stretch")
        assert found == kind
        assert sentence.endswith(said)
        assert "NRMSE" in more[0]
    kind, sentence, more = verdict([compared(*clear), compared(*lost, record="b.csv")], "test stretch")
    assert kind == "invalid"
    assert sentence == (
        "On the test stretches of 2 records resistance is predicted with errors of 1.00 to 3.00 %; a static cubic is "
        "clearly better in 1 of 2 comparisons."
    )
    assert more[2].startswith("b.csv: Resistance is predicted with an error of 3.00 %")


@pytest.mark.parametrize(
    ("name", "figures", "width", "scheme"), [("identified", 8, 1400, "light"), ("assessed", 8, 400, "dark")]
)
def test_in_a_browser_a_page_fits_zooms_together_and_asks_for_nothing(browser, request, name, figures, width, scheme):
    (path,) = request.getfixturevalue(name)[0].rglob("report.html")
    troubles: list[str] = []
    view = {"viewport": {"width": width, "height": 900}, "color_scheme": scheme}
    page = opened(browser, path.as_uri(), troubles, **view)
    assert page.locator("figure").count() == figures
    assert page.evaluate("Math.min(...page.figures.map((each) => each.div.clientHeight))") >= 300
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    over_time = "page.figures.filter((each) => each.linked)"
    page.evaluate(f"Plotly.relayout({over_time}[0].div, {{'xaxis.range[0]': 10, 'xaxis.range[1]': 30}})")
    page.wait_for_function(f"{over_time}.every((each) => each.div.layout.xaxis.range[1] === 30)")
    assert troubles == []
    page.close()
