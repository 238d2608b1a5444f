"""Judgements of the detector, and their tables."""

from __future__ import annotations

import io
import json
import math

import numpy as np
import pytest
from gossamer.results import print_tables
from gossamer_orchestrator import ResultsError, judge
from gossamer_orchestrator.results.judgements import doubts, window_table, windows, zone_table
from gossamer_orchestrator.results.report.page import run_page
from gossamer_orchestrator.results.verdict import make_verdict, sensor_doubts
from gossamer_orchestrator.words import percent, uncertain
from rich.console import Console


def test_a_judgement_is_made_when_a_window_ends(data):
    found = windows(data)
    assert [judgement.time for judgement in found] == [4.0, 8.0]
    last = judge(data)
    assert last.time == 8.0
    assert last.mean_absolute_error == pytest.approx((0.1 + 0.04) / 16)
    assert last.worst_zone == 2
    assert last.largest_error == pytest.approx(-0.1)
    assert (last.likeness, last.likeness_value) == ("similarity", 0.5)
    assert np.isnan(last.deviation).all()


def test_a_run_without_a_judgement_says_whether_a_window_ended_and_what_resembled_nothing(data):
    with pytest.raises(ResultsError, match=r"No window of the detector ended until t = 3 s, .* Run longer"):
        judge(data.isel(time=slice(4)))
    with pytest.raises(ResultsError, match=r"the results lack detector.damage. Add it to \[record\] variables"):
        judge(data.drop_vars("detector.damage"))
    data["detector.valid"][:] = 0.0
    with pytest.raises(ResultsError, match=r"2 windows .* the last at 8.0000 s, .* in spite of a similarity of 0.5. Give"):
        judge(data)
    data["detector.similarity"][:] *= 0.5
    with pytest.raises(ResultsError, match=r"similarity with every trained case is below one half: 0.25"):
        judge(data)
    with pytest.raises(ResultsError, match=r"its similarity or misfit was not recorded"):
        judge(data.drop_vars("detector.similarity"))


def test_a_detector_that_is_not_a_number_from_some_time_on_ended_one_window_then(data):
    for name in ("damage", "index", "valid", "similarity"):
        data[f"detector.{name}"][5:] = np.nan
    assert [judgement.time for judgement in windows(data)] == [4.0, 5.0]
    assert "its similarity is not a number. Look" in doubts(data, windows(data))[0]


def test_damage_of_some_zones_is_not_that_of_other_zones(data):
    some = data.isel(zone=slice(8, 12))
    with pytest.raises(ResultsError, match=r"lack detector\.damage of some zones\. Record detector\.damage\*"):
        windows(some)
    true = some["membrane.damage"].rename(zone="damage_index")
    beside = data.drop_vars("membrane.damage").assign({"membrane.damage": true})
    assert np.isnan(judge(beside).true).all()


def test_doubts_say_why_a_window_is_not_valid_from_what_was_recorded(data):
    data = data.drop_vars("detector.similarity")
    data["detector.misfit"] = 0.24 + 0.0 * data["detector.valid"]
    data["detector.valid"][4:8] = 0.0  # the first of two windows
    (unknown,) = doubts(data, windows(data))
    assert unknown == (
        "The window that ended at 4.0000 s gave no valid judgement; in spite of a misfit of 0.24. Give it the 'start_time', "
        "'window_length' and 'sampling_step' it was trained for."
    )
    data["detector.misfit"][:] = 1.7
    (unlike,) = doubts(data, windows(data))
    assert "its misfit with what it was trained on is above one: 1.7." in unlike


def test_doubts_name_a_last_window_that_is_not_valid(data, later_window_invalid):
    assert doubts(data, windows(data)) == []
    data = later_window_invalid(data)
    assert judge(data).time == 4.0
    (unknown,) = doubts(data, windows(data))
    assert unknown.startswith("The window that ended at 8.0000 s gave no valid judgement; its similarity")
    assert unknown.endswith(
        "is below one half: 0.28. It was trained on nothing like this. The judgement shown is that at 4.0000 s."
    )


def test_doubts_name_what_left_its_identified_range_how_far_and_that_range(data):
    assert sensor_doubts(data) == []
    for name in ("sensor2", "compensator3"):
        data[f"{name}.saturated"] = ("time", (data["time"].values == 2.0).astype(float))
    unknown = sensor_doubts(data)
    assert unknown[0] == "sensor2 reached 2.909 % strain, outside its identified range, in 10 % of the run."
    limits = {"rest_resistance": 100.0, "full_scale_resistance_change": 1.5, "full_scale_strain": 0.025}
    roles = {"membrane": "membrane"} | {f"{role}{k}": role for role in ("sensor", "compensator") for k in range(1, 5)}
    data.attrs["fmus"] = json.dumps({name: {"model": role, "parameters": limits} for name, role in roles.items()})
    data["compensator3.resistance"] = data["sensor3.resistance"]
    assert sensor_doubts(data) == [
        "sensor2 reached 2.909 % strain, outside its identified range, 0 to 2.5 % strain, in 10 % of the run.",
        "compensator3 read 102 ohm, and in 10 % of the run no strain explains what it read within its identified range, "
        "0 to 2.5 % strain: from 100 ohm at rest to 101.5 ohm when first loaded.",
        "Do not trust the strain and damage that follow from what was outside its identified range.",
    ]


def test_what_was_outside_all_along_was_so_in_100_percent_and_a_late_refusal_quotes_what_was_read_before(data):
    """The compensator is a row late: what it refuses at 2 s it read at 1 s or so."""
    late = data.assign({"compensator3.saturated": ("time", (data["time"].values == 2.0).astype(float))})
    late["compensator3.delay"] = ("time", np.full(10, float(data["time"][1] - data["time"][0])))
    late["compensator3.resistance"] = late["sensor3.resistance"].copy()
    late["compensator3.resistance"][int(np.flatnonzero(data["time"].values == 2.0)[0]) - 1] = 999.0
    assert sensor_doubts(late)[0].startswith("compensator3 read 999 ohm, and in 10 % of the run")
    data["sensor2.saturated"] = ("time", np.ones(10))
    assert sensor_doubts(data)[0].endswith("in 100 % of the run.")
    assert percent(0.999) == "100 %"
    assert percent(1e-5) == "less than 0.01 %"
    many = data.assign({"sensor2.saturated": (("time", "zone"), np.ones((10, data.sizes["zone"])))})
    assert sensor_doubts(many)[0] == "sensor2 was outside its identified range in 100 % of the run."


def test_a_run_whose_recovered_strain_is_far_off_the_true_one_says_so_also_without_a_detector(data):
    data["compensator2.strain"] = data["compensator2.strain"] + 0.03
    (wrong,) = sensor_doubts(data)
    assert wrong.startswith("The strain that compensator2 recovers is wrong: its RMS error of 3 % strain is 15")
    alone = data.drop_vars([name for name in data.data_vars if str(name).startswith("detector.")])
    verdict = make_verdict(alone, [], None)
    assert (verdict.kind, verdict.more) == ("invalid", [wrong])
    data["detector.damage"] = 0.0 * data["detector.damage"]
    assert make_verdict(data, windows(data), None).kind == "invalid"  # no damage is not green on wrong strain
    said = data.assign({"compensator2.strain_deviation": 0.0 * data["compensator2.strain"] + 0.03})
    assert sensor_doubts(said) == []  # the compensator has said so itself


def test_the_table_has_every_zone_also_where_they_are_no_square(data):
    text = printed(zone_table(judge(data.isel(zone=slice(7)))))
    assert all(f"zone {zone} " in text for zone in range(1, 8))


def printed(*tables):
    console = Console(file=io.StringIO(), width=100)
    print_tables(console, tables)
    return console.file.getvalue()


def test_tables_show_the_membrane_as_it_is_seen(data):
    lines = printed(zone_table(judge(data)), window_table(windows(data))).splitlines()
    rows = [line.split() for line in lines if "zone" in line and "│" in line]
    assert [row.count("zone") for row in rows[:4]] == [4] * 4
    assert rows[0][2] == "13"
    assert rows[3][2] == "1"
    assert any("0 -> 0.0" in line and "30 -> 20.0" in line for line in lines)
    assert any("-10.00 % in zone 2" in line for line in lines)


def test_the_table_of_judgements_marks_windows_that_are_not_valid(data, later_window_invalid):
    table = window_table(windows(later_window_invalid(data)))
    assert [row[table.head.index("valid")] for row in table.rows] == ["yes", "no"]
    assert "t [s]" in printed(table)


def test_the_history_puts_estimate_and_truth_under_their_headings(data):
    table = window_table(windows(data))
    cells = dict(zip(table.head, zip(*table.rows, strict=True), strict=True))
    for row, judgement in enumerate(windows(data)):
        zone = int(np.argmax(judgement.estimated))
        assert cells["estimated [%]"][row] == f"{100 * judgement.estimated[zone]:.1f}"
        found = judgement.estimated[zone] > 0.0  # where no zone is damaged, none is named
        assert cells["true there [%]"][row] == (f"{100 * judgement.true[zone]:.0f}" if found else "-")
        assert cells["most damaged zone"][row] == (f"{zone + 1}" if found else "-")


def test_a_detector_that_states_its_deviation_is_shown_with_it(data):
    """The posterior networks: standard deviations, and a misfit in place of a similarity."""
    data = data.drop_vars("detector.similarity")
    data["detector.deviation"] = 0.05 * data["detector.damage"]
    data["detector.misfit"] = 0.4 + 0.0 * data["detector.valid"]
    text = printed(zone_table(judge(data)), window_table(windows(data)))
    assert "30 -> 20.0 +- 1.0" in text
    assert "misfit with training 0.4" in text
    data["detector.misfit"][8:] = 3.0
    data["detector.valid"][:] = 0.0
    with pytest.raises(ResultsError, match=r"misfit with what it was trained on is above one: 3. .* Check load"):
        judge(data)


def test_where_no_true_damage_is_recorded_tables_show_the_estimate_alone(data):
    for unknown in (data.drop_vars("membrane.damage"), data.drop_vars([name for name in data if "membrane" in name])):
        last = judge(unknown)
        assert np.isnan(last.true).all()
        assert last.estimated[1] == 0.2
        text = printed(zone_table(last), window_table(windows(unknown)))
        assert "estimated [%]" in text
        assert "20.0" in text
        assert not any(word in text for word in ("nan", "->", "true", "mean absolute error"))


def test_a_value_has_the_unit_and_the_digits_of_its_deviation():
    assert uncertain(0.767098, 3.6e-6, "s") == "0.767098 ± 0.000004 s"
    assert uncertain(0.767098, 4e-4, "s") == "0.7671 ± 0.0004 s"
    assert uncertain(0.0123, 0.00119) == "0.0123 ± 0.0012"
    assert uncertain(9871.3, 42.0, "Pa") == "9871 ± 42 Pa"
    assert uncertain(0.767098, 0.0, "s") == "0.767098 s"
    assert uncertain(0.767098, math.inf, "s") == "0.767098 ± unknown s"
    assert uncertain(2.0, 3e-12) == "2 ± 3e-12"
    assert uncertain(-0.0001, 0.02) == "0.00 ± 0.02"
    assert uncertain(-1.67e-5, 4e-7) == "(-16.7 ± 0.4)e-6"
    assert uncertain(9e-15, 7e-10, "ohm") == "(0 ± 700)e-12 ohm"


def test_zones_of_a_setup_stand_by_their_names(data, tmp_path):
    """In the tables, the verdict and the picture; of a membrane without names by their numbers."""
    assert windows(data)[-1].labels[2] == "3"
    names = [f"ring {1 + k // 4} sector {1 + k % 4}" for k in range(16)]
    data.attrs["fmus"] = json.dumps({"membrane": {"setup": json.dumps({"zone_names": names})}})
    ended = windows(data)
    found = int(np.argmax(ended[-1].estimated))
    assert window_table(ended).rows[-1][1] == names[found]
    assert f"zone {names[found]} lost" in make_verdict(data, ended, None).sentence
    assert f"largest error -10.00 % in zone {names[1]}" in " ".join(printed(zone_table(ended[-1])).split())
    page = run_page(data, tmp_path)
    assert f"<td>{names[found]}</td>" in "".join(map(str, page.facts))
    bars = next(chart for chart in page.charts if chart.title.startswith("Damage of each zone"))
    assert bars.layout["xaxis"]["ticktext"] == names
    assert page.content["surface"]["names"] == names
