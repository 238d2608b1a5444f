"""``gossamer train``: from a small campaign, or a scenario, to a detector and its figures."""

from __future__ import annotations

import json
import math

import gossamer
import pytest
from command_line import invoke
from gossamer.plans import is_scenario, planned
from gossamer_models.detector import PosteriorArtifact
from gossamer_orchestrator.errors import ScenarioError
from gossamer_orchestrator.scenario.source import shipped_scenarios
from reading_pages import read_page, values

SMALL = """
cases = 640
seed = 3
stop = 0.06
[damage]
zones = [1, 2]
depth = [0.3, 0.5]
healthy = 0.1
[coarser]
order = 1
times = 1
"""


def test_a_campaign_becomes_a_detector_that_states_what_it_was_trained_for(tmp_path, monkeypatch):
    """Two windows of 0.03 s; again from the store, in Python, to the bit."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(SMALL)
    options = ["--window", "0.03", "--steps", "40"]
    result = invoke(["train", "small.toml", *options])
    assert result.exit_code == 0, result.output
    assert "always 0" in result.stderr
    artifact = PosteriorArtifact.read(tmp_path / "out/detector/small.json")
    assert len(artifact.windows) == 2
    assert artifact.samples == 100
    assert artifact.provenance["command"] == "gossamer train small --steps 40 --window 0.03"
    assert artifact.trained_over["damage [1]"] == [0.3, 0.5]
    found = artifact.held_out["window 1, damaged, no noise"]
    assert found["all zones"] < artifact.held_out["always 0"]["all zones"]
    assert result.stdout.split() == ["out/detector/small.json", "out/detector/small/report.html"]
    page, charts = read_page(tmp_path / "out/detector/small/report.html")
    assert f"off by {found['all zones']:.2f} % damage over all zones" in page.inside["verdict"]
    first, second = charts["Mean negative log likelihood of a case"]["traces"]
    assert values(first["y"]) == pytest.approx(artifact.losses[0], rel=1e-5)
    assert len(values(second["x"])) == 60  # 20 of them on the coarser mesh
    assert artifact.losses[1][-1] < artifact.losses[1][0]
    again = gossamer.train("out/campaigns/small.zarr", window=0.03, steps=40, out="again")
    assert again.held_out == artifact.held_out
    assert float(again.data["all_zones"].sel(cases="window 1, damaged, no noise")) == found["all zones"]
    assert math.isnan(again.data["damaged_zones"].sel(cases="window 1, healthy, no noise"))
    assert "The mean absolute error over all zones is" in again._repr_html_()
    assert (str(again.path), str(again.page)) == ("again.json", "again/report.html")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "out/detector/small.npz").read_bytes()
    further = gossamer.train("out/campaigns/small.zarr", window=0.03, steps=10, start="again.json", out="further")
    assert PosteriorArtifact.read(further.path).losses[0][0] < artifact.losses[0][-1] + 0.5
    other = invoke(["train", "out/campaigns/small.zarr", "--window", "0.02", "--start", "again.json"])
    assert "the networks to go on from have other windows, their samples, block, zones and sensors" in other.output


def test_a_campaign_that_is_too_short_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(SMALL.replace("640", "64").replace("0.06", "0.03"))
    result = invoke(["train", "small.toml", "--window", "0.03"])
    assert result.exit_code == 1
    assert "held-out cases are too few to calibrate a detector, 40 are the least. Run 533 cases or more." in result.output
    result = invoke(["train", "out/campaigns/small.zarr", "--window", "0.3"])
    assert result.exit_code == 1
    assert "Make its 'stop' longer" in result.output


def test_a_scenario_gives_its_membrane_and_windows(tmp_path):
    text = shipped_scenarios()["damaged"].read_text()
    assert is_scenario("damaged")
    assert not is_scenario("detector_nominal")
    file = tmp_path / "mine.toml"
    file.write_text(text.replace('fmu = "membrane"\n', 'fmu = "membrane"\nparameters = { pressure_amplitude = 8e3 }\n'))
    assert is_scenario(str(file))
    campaign, *_ = planned(file, None)
    assert campaign.membrane.parameters["pressure_amplitude"] == 8e3
    assert campaign.steps == 3 * 844 + 2
    other = tmp_path / "other.toml"
    other.write_text(text.replace('fmu = "membrane"\n', 'fmu = "elsewhere/plate"\n'))
    with pytest.raises(ScenarioError, match="Write a campaign file"):
        planned(other, None)


def test_the_card_of_the_shipped_detector_states_ranges_and_errors():
    card = json.loads(shipped_card().read_text())
    assert card["trained_over"]["damaged zones"] == [0.0, 4.0]
    assert card["held_out"]["window 1, damaged, no noise"]["all zones"] < 0.25
    assert card["held_out"]["window 3, healthy, noise"]["false calls"] <= 0.02


def shipped_card():
    from gossamer_models.detector.posterior_artifact import NOMINAL

    return NOMINAL
