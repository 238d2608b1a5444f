"""Watching, campaigns and assessments in Python; training and placement are beside their commands."""

from __future__ import annotations

import json
import re
from pathlib import Path

import gossamer
import numpy as np
import pytest
from gossamer_models.assessment.records import Records
from gossamer_models.assessment.truths import whole_zones
from gossamer_models.campaign import draw_cases

CAMPAIGN = 'title = "Small"\ncases = 6\nchunk = 4\nstop = 0.003\n[membrane]\nelements_per_side = 4\norder = 1\n'


def words(html):
    return " ".join(re.sub("<[^>]*>", " ", html).split())


def test_a_record_is_watched_window_by_window(tmp_path):
    """Twin and truth are the same coarse mesh; zone 6 loses 30 % of its stiffness at 0.0903 s."""
    pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")
    from gossamer_models.batch import Batch
    from gossamer_models.membrane import membrane_model, square_structure

    step, onset = 3e-4, 0.0903
    batch = Batch(membrane_model(square_structure(4, 1)), [f"strain[{k}]" for k in range(1, 5)], ["damage[6]"])
    time = step * np.arange(1, 801)
    strain = batch.run(time.size, step, inputs={"damage[6]": 0.3 * (time > onset)}).results[0]
    strain += np.random.default_rng(1).normal(0.0, 5e-4, strain.shape)
    head = "time,strain[1],strain[2],strain[3],strain[4]"
    path = tmp_path / "record.csv"
    np.savetxt(path, np.column_stack([time, strain.T]), delimiter=",", header=head, comments="")
    seen = gossamer.watch(path, window=0.048, elements_per_side=4, order=1)
    assert seen.data["time"].to_numpy() == pytest.approx(0.048 * np.arange(1, 6))
    assert seen.alarms == pytest.approx([0.096])  # the end of the window in which it begins
    scores = seen.data["score"].max("zone")
    assert scores.sel(time=0.096, method="nearest") > 10.0 * scores.sel(time=0.048, method="nearest")
    found = seen.data.isel(onset=0)
    assert float(found["onset"]) == pytest.approx(onset, abs=5e-4)
    assert float(found["damage"].sel(zone=6)) == pytest.approx(0.3, abs=0.03)
    assert found["onset"].attrs["units"] == "s"
    assert json.loads(Path(seen).read_text())["alarms"] == seen.alarms
    html = seen._repr_html_()
    assert words(html).startswith("1 alarm in 5 windows: at 0.096 s.")
    assert "data:image/png" in html


def test_a_campaign_gives_its_cases(tmp_path):
    pytest.importorskip("zarr", reason="campaigns need the extra 'campaign'")
    (tmp_path / "small.toml").write_text(CAMPAIGN)
    campaign = gossamer.campaign(tmp_path / "small.toml", out=tmp_path / "small.zarr", workers=1)
    assert Path(campaign) == tmp_path / "small.zarr"
    assert campaign.data.sizes == {"case": 6, "sensor": 4, "time": 10, "zone": 16}
    assert campaign.data["strain"].attrs["units"] == "1"
    assert words(campaign._repr_html_()).startswith("6 cases, 6 of them simulated now.")
    assert "Small" in campaign._repr_html_()


def test_judged_detectors_are_tabled_by_condition(tmp_path, monkeypatch):
    """The simulations are replaced by their cases, so that every detector is the answer 'always 0'."""

    def records(condition, folder, **options):
        damage = draw_cases(condition.campaign, range(condition.campaign.count)).damage
        damage = whole_zones(condition.campaign.membrane.structure, damage) if condition.parts else damage
        return Records(damage=damage, strain=np.zeros((len(damage), 4, 9)), resistance=None, step=3e-4, failed=0)

    monkeypatch.setattr("gossamer_models.assessment.run.make_records", records)
    monkeypatch.setattr("gossamer_models.assessment.shipped_judges", list)
    judged = gossamer.assess_detector(cases=4, out=tmp_path)
    assert judged.data["detector"].to_numpy().tolist() == ["always 0"]
    row = judged.result.row("always 0", "clean")
    clean = judged.data.sel(detector="always 0", condition="clean")
    assert float(clean["error_damaged"]) == row.figures.error_damaged > 0.0
    assert clean["error_damaged"].attrs["units"] == "%"
    assert (float(clean["hits_low"]), float(clean["hits"])) == (row.figures.hits.low, 0.0)
    assert judged.detections["a90"].sel(zone=0).isnull().all()  # nothing was hit
    html = judged._repr_html_()
    assert words(html).startswith(f"1 detector under {judged.data.sizes['condition']} conditions.")
    assert "data:image/png" in html
