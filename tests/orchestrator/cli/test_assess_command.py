"""``gossamer assess-detector``: what it prints and writes; the simulations are replaced by their cases."""

import numpy as np
import pytest
from command_line import invoke
from gossamer_models.assessment.records import Records
from gossamer_models.assessment.truths import whole_zones
from gossamer_models.campaign import draw_cases


@pytest.fixture
def quick(monkeypatch):
    def records(condition, folder, **options):
        damage = draw_cases(condition.campaign, range(condition.campaign.count)).damage
        damage = whole_zones(condition.campaign.membrane.structure, damage) if condition.parts else damage
        return Records(damage=damage, strain=np.zeros((len(damage), 4, 9)), resistance=None, step=3e-4, failed=0)

    monkeypatch.setattr("gossamer_models.assessment.run.make_records", records)
    monkeypatch.setattr("gossamer_models.assessment.shipped_judges", list)


def test_paths_are_printed_and_tables_stand_on_stderr(quick, tmp_path):
    result = invoke(["assess-detector", "--cases", "4", "--out", str(tmp_path)])
    assert result.exit_code == 0
    paths = result.stdout.split()
    assert paths
    assert {str(path) for path in tmp_path.iterdir()} == set(paths)
    assert "always 0" in result.stderr
    assert "nothing was hit" in result.stderr


def test_some_conditions_alone_have_a_table_and_no_probability_of_detection(quick, tmp_path):
    command = ["assess-detector", "--conditions", "outliers", "--conditions", "noise", "--cases", "3", "--noise", "1e-3"]
    result = invoke([*command, "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert "outliers *" in result.stderr  # kept out of tuning
    assert "wrong and valid" in result.stderr
    assert "a90/95" not in result.stderr
    refused = invoke(["assess-detector", "--conditions", "hail", "--out", str(tmp_path)])
    assert refused.exit_code == 1
    assert "no condition 'hail'" in refused.stderr


def test_a_file_that_is_no_detector_is_one_sentence(quick, tmp_path):
    (tmp_path / "other.json").write_text("{}")
    result = invoke(["assess-detector", "--artifact", str(tmp_path / "other.json"), "--out", str(tmp_path)])
    assert result.exit_code == 1
    assert "cannot read the artifact" in result.stderr
    assert "Traceback" not in result.stderr
