"""The page of a sweep: verdict, judgements over what varies, curves, links to the pages of cases."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from command_line import invoke
from gossamer.pages.sweep import sweep_page
from gossamer_orchestrator.pages import write_page
from gossamer_orchestrator.results.report.cases import open_cases
from gossamer_orchestrator.run.sweep import combine, make_cases
from reading_pages import read_page, values
from saving import save_results

DEPTHS, GAINS = [0.0, 0.2, 0.4], [1.0, 2.0]


def results(depth: float, gain: float) -> xr.Dataset:
    """Four zones of which the second is damaged; the detector finds nine tenths of it in the last of three rows."""
    time, ended = np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.0, 1.0])
    true = np.tile([0.0, depth, 0.0, 0.0], (3, 1))
    zones = ("time", "zone")
    return xr.Dataset(
        {
            "membrane.damage": (zones, true),
            "membrane.deflection": ("time", gain * np.array([0.0, -3.0, 1.0]), {"units": "m"}),
            "detector.damage": (zones, 0.9 * true * ended[:, None]),
            "detector.deviation": (zones, 0.1 * true * ended[:, None]),
            "detector.valid": ("time", ended),
        },
        {"time": time},
        {"schema": "gossamer.results", "version": 1, "ended": "complete"},
    )


@pytest.fixture
def swept(tmp_path):
    """Six cases, of which the last failed without results."""
    cases = make_cases({"membrane.damage[2]": DEPTHS, "sensor1.gain": GAINS})
    for case in cases[:-1]:
        save_results(results(*case.values.values()), tmp_path / case.name)
    return cases, ["complete"] * 5 + ["the membrane <diverged>"], tmp_path


def page_of(swept, variable=None):
    cases, ended, folder = swept
    store = combine(cases, folder)
    data = None if store is None else open_cases(store)
    return read_page(write_page(sweep_page("mine", cases, ended, data, folder, variable), folder / "report.html"))


def test_the_verdict_counts_cases_and_compares_with_always_zero(swept):
    """The mean over four zones and five cases of a tenth of the damage, 0, 0, 0.2, 0.2 and 0.4."""
    page, _ = page_of(swept)
    text = page.inside[None]
    assert page.inside["verdict"] == "6 cases: 5 finished, 1 failed."
    assert "Varied: membrane.damage[2], 3 values from 0 to 0.4; sensor1.gain, 2 values from 1 to 2." in text
    assert "Case 6 failed: the membrane <diverged>" in text
    assert "5 of 5 finished cases end with a valid judgement" in text
    assert "is 0.40 % damage; the answer 'always 0' has 4.00 %." in text
    assert "as good here" not in text


def test_a_sweep_without_damage_says_nothing_of_how_well_damage_is_found(swept):
    """Of healthy membranes the answer 'always 0' is right, whatever the detector is worth."""
    cases, ended, folder = swept
    page, _ = page_of((cases[:2], ended[:2], folder))
    assert "is 0.00 % damage; the answer 'always 0' has 0.00 %." in page.inside[None]
    assert "as good here" not in page.inside[None]


def test_a_reason_of_many_failures_is_named_once(swept):
    cases, _, folder = swept
    page, _ = page_of((cases, ["no FMU 'x'"] * 4 + ["diverged"] * 2, folder))
    assert page.inside["verdict"] == "6 cases: 0 finished, 6 failed."
    assert "Case 1 and 3 more failed: no FMU 'x'Case 5 and 1 more failed: diverged" in page.inside[None]


def test_the_last_judgements_stand_over_what_varies_with_their_deviations(swept):
    _, charts = page_of(swept)
    zone = charts["Last valid judgement over membrane.damage[2]"]["traces"][0]
    assert zone["name"] == "zone 2"
    assert values(zone["x"]) == pytest.approx([0.0, 0.0, 0.2, 0.2, 0.4])
    assert values(zone["y"]) == pytest.approx([0.0, 0.0, 18.0, 18.0, 36.0])
    assert values(zone["error_y"]["array"]) == pytest.approx([0.0, 0.0, 2.0, 2.0, 4.0])
    assert charts["Last valid judgement over membrane.damage[2]"]["layout"]["xaxis"]["ticktext"] == ["0", "0.2", "0.4"]
    cells = charts["Mean absolute error over all zones [% damage]"]["traces"][0]
    assert (cells["x"], cells["y"]) == (["0", "0.2", "0.4"], ["1", "2"])
    assert values(cells["z"]) == [pytest.approx([0.0, 0.5, 1.0]), pytest.approx([0.0, 0.5, np.nan], nan_ok=True)]


def test_a_scalar_is_drawn_over_time_and_over_what_varies(swept):
    _, charts = page_of(swept)
    last, largest, rms = charts["Last value, largest size and RMS over sensor1.gain"]["traces"]
    assert values(last["y"]) == [1.0, 2.0, 1.0, 2.0, 1.0]
    assert values(largest["y"]) == [3.0, 6.0, 3.0, 6.0, 3.0]
    assert values(rms["y"])[0] == pytest.approx(np.sqrt(10.0 / 3.0))
    curves = charts["Over time"]["traces"]
    assert [each["name"] for each in curves[:2]] == ["1: damage[2] = 0, gain = 1", "2: damage[2] = 0, gain = 2"]
    assert values(curves[1]["y"]) == [0.0, -6.0, 2.0]
    assert charts["Over time"]["y"] == "membrane.deflection [m]"


def test_of_an_array_the_largest_element_is_drawn(swept):
    cases, ended, folder = swept
    chosen = cases[2:5], ended[2:5], folder
    assert page_of(chosen, "detector.damage")[1]["Over time"]["y"] == "detector.damage[2] [1]"


def test_a_case_is_linked_where_it_has_a_page(swept):
    (swept[2] / "case_0002/report.html").touch()
    page, _ = page_of(swept)
    links = [attributes["href"] for tag, attributes in page.tags if tag == "a"]
    assert [link for link in links if not link.startswith("#")] == ["case_0002/report.html"]


def test_a_page_that_cannot_be_written_is_one_warning(fmus, tmp_path, monkeypatch):
    """So is one of a program that has a bug."""
    scenario = tmp_path / "s.toml"
    scenario.write_text('step = 0.1\nstop = 0.2\n[components.one]\nfmu = "integrator"\ninputs = { u = 1.0 }\n')
    command = ["sweep", str(scenario), "--fmus", str(fmus), "--out", str(tmp_path / "out"), "--set=one.u=1,2"]
    done = invoke(command)
    assert done.stdout.split()[-1] == str(tmp_path / "out/report.html")
    assert f"or type 'gossamer view {tmp_path / 'out'}'." in done.stderr
    page, _ = read_page(tmp_path / "out/report.html")
    assert page.inside["verdict"] == "All 2 cases finished."
    monkeypatch.setattr("gossamer.pages.sweep.read_cases", lambda *_: 1 / 0)
    again = invoke(command)
    assert again.exit_code == 0
    assert "report.html" not in again.stdout
    assert again.stderr.count("WARNING") == 1
    assert "was not written: ZeroDivisionError" in again.stderr
