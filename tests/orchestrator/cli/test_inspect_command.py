"""``gossamer inspect``: a year of inspections from one file, and the history of a folder of answers."""

import csv
import json

import numpy as np
import pytest
from command_line import invoke
from gossamer import inspect

ANSWER = {"doubts": [], "nuisances": {"gain[1]": [1.01, 0.002]}, "zones": ["left", "right"]}
LEAK = {"name": "loss of gas", "share": 0.05, "deviation": 0.003, "probability": 1.0}


def answer(left, right, deviation=0.002, valid=True, **more):
    damage = [left, right]
    bounds = [[max(0.0, (d or 0.1) - 2 * deviation), (d or 0.1) + 2 * deviation] for d in damage]
    shown = {"damage": damage, "deviation": [deviation] * 2, "bounds": bounds}
    return ANSWER | (shown if valid else dict.fromkeys(shown)) | {"valid": valid} | more


@pytest.fixture
def answers(tmp_path):
    folder = tmp_path / "dish"
    folder.mkdir()
    found = {
        "2027-07-15": answer(0.04, 0.0, faults=[LEAK]),
        "2027-01-15": answer(0.0, 0.0),
        "2027-04-15": answer(None, None, valid=False, doubts=["the load is off"]),
        "2027-12-15_late": answer(0.10, None),
        "calibration": {"schema": "gossamer.calibration"},
    }
    for name, content in found.items():
        (folder / f"{name}.json").write_text(json.dumps(content))
    return folder


def test_a_folder_of_answers_is_a_history_with_growth_by_zone(answers):
    result = invoke(["inspect", str(answers)])
    assert result.exit_code == 0, result.output
    page = (answers / "report.html").read_text(encoding="utf-8")
    assert "Withheld, since they are not valid: 2027-04-15" in page
    rows = list(csv.DictReader((answers / "history.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["date"] for row in rows[::2]] == ["2027-01-15", "2027-04-15", "2027-07-15", "2027-12-15"]
    assert [row["damage [1]"] for row in rows[::2]] == ["0", "", "0.04", "0.1"]
    found = inspect(answers).data
    assert found["growth"].to_numpy()[0] == pytest.approx(0.1 / 11.0, rel=0.15)
    assert "left grows by" in inspect(answers).sentence
    assert found["growth"].to_numpy()[1] == pytest.approx(0.0)


def test_what_is_not_valid_is_no_growth_even_where_it_was_shown(answers):
    shown = answer(0.9, 0.0) | {"valid": False}
    (answers / "2028-01-01.json").write_text(json.dumps(shown))
    assert inspect(answers).data["growth"].to_numpy()[0] == pytest.approx(0.1 / 11.0, rel=0.15)


def test_the_last_inspection_decides_the_exit_code(answers):
    (answers / "2028-01-01.json").write_text(json.dumps(answer(None, None, valid=False)))
    assert invoke(["inspect", str(answers)]).exit_code == 3


@pytest.mark.parametrize("name", ["history.csv", "report.html"])
def test_an_answer_is_not_written_over_by_a_link_in_the_folder_of_the_page(answers, tmp_path, name):
    answer = next(answers.glob("*.json"))
    before = answer.read_bytes()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).symlink_to(answer)
    assert f"out/{name} would overwrite" in invoke(["inspect", str(answers), "--out", str(tmp_path / "out")]).stderr
    assert answer.read_bytes() == before


def test_answers_that_make_no_history_are_named(answers, tmp_path):
    other = answer(0.0, 0.0) | {"zones": ["up", "down"]}
    (answers / "2028-02-01.json").write_text(json.dumps(other))
    assert "2028-02-01 has other zones than that of 2027-01-15" in invoke(["inspect", str(answers)]).stderr
    (answers / "2028-02-01.json").write_text("{}")
    assert "2028-02-01.json is no answer of a twin: it lacks" in " ".join(invoke(["inspect", str(answers)]).stderr.split())
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "holds no answers whose names begin with a date" in " ".join(invoke(["inspect", str(empty)]).stderr.split())


PLAN = """
noise = 2e-4
stop = 0.12
mesh_error = false
[[inspections]]
date = {first}
[[inspections.simulated]]
damage = {{ zone_6 = 0.05 }}
[[inspections]]
date = 2027-02-01
[[inspections.simulated]]
damage = {{ {zone} = 0.10 }}
seed = 1
"""


def test_inspections_of_a_file_build_on_each_other(tmp_path):
    pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")
    (tmp_path / "square.toml").write_text(PLAN.format(first="2027-03-01", zone="zone_6").replace("0.10", "0.02"))
    found = inspect(tmp_path / "square.toml", out=tmp_path / "out")
    assert [str(day) for day in found.history.dates] == ["2027-02-01", "2027-03-01"]  # in order, whatever the file says
    assert found.history.valid.all()
    assert found.history.damage[:, 5] == pytest.approx([0.02, 0.05], abs=0.01)
    later = json.loads((tmp_path / "out" / "2027-03-01.json").read_text())
    assert later["growth"][5] == pytest.approx(0.03, abs=0.01)
    assert np.delete(later["growth"], 5).max() < 0.005
    assert (tmp_path / "out" / "report.html").is_file()


@pytest.mark.parametrize(
    ("first", "zone", "message"),
    [
        ('"yesterday"', "zone_6", "'yesterday' is no date. Write YYYY-MM-DD."),
        ("2027-02-01", "zone_6", "2027-02-01 stands twice"),
        ("2027-01-01", "zone_99", "there is no zone 'zone_99'. Choose from zone_1"),
        ("2027-01-01\nrecord = 3", "zone_6", "record"),
    ],
)
def test_mistakes_in_a_file_of_inspections_are_named_before_anything_runs(first, zone, message, tmp_path):
    path = tmp_path / "square.toml"
    path.write_text(PLAN.format(first=first, zone=zone))
    result = invoke(["inspect", str(path), "--out", str(tmp_path / "out")])
    assert result.exit_code == 1
    assert message in " ".join(result.stderr.split())


def test_the_file_that_new_writes_is_one_of_inspections(tmp_path, monkeypatch):
    from gossamer.inspections import load_plan

    monkeypatch.chdir(tmp_path)
    assert invoke(["new", "inspection"]).exit_code == 0
    plan, _ = load_plan(tmp_path / "inspection.toml")
    assert [each.date for each in plan.inspections] == ["2027-01-15", "2027-07-15", "2027-12-15"]
    assert plan.healthy is not None
