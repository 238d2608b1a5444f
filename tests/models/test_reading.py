"""Bad records: each is refused, or repaired by a stated rule, and the line is named."""

import logging
import re
from pathlib import Path

import numpy as np
import pytest
from gossamer_models import DataError
from gossamer_models.fitting import Columns, read_record, read_records

pytestmark = pytest.mark.usefixtures("dashes")

T = 0.1 * np.arange(40)
STRAIN = 0.05 * np.abs(np.sin(T))
OHM = 1000.0 + 2000.0 * STRAIN


def write(path, header="time,strain,resistance", rows=None, change=None):
    rows = [[f"{t:.6g}", f"{s:.9g}", f"{r:.9g}"] for t, s, r in zip(T, STRAIN, OHM, strict=True)] if rows is None else rows
    if change is not None:
        change(rows)
    path.write_text(header + "\n" + "\n".join(",".join(row) for row in rows) + "\n")
    return path


def put(line, column, text):
    """Replace a cell; the header is line 1."""
    return lambda rows: rows[line - 2].__setitem__(column, text)


def test_a_record_without_time_gets_a_sampling_step(tmp_path):
    path = write(tmp_path / "r.csv", "n,output,input")
    with pytest.raises(DataError, match="no column is recognised as strain"):
        read_record(path, Columns(sampling_step=0.5))
    found = read_record(path, Columns(strain="output", resistance="input", sampling_step=0.5))
    assert found.time[-1] == pytest.approx(0.5 * 39)
    with pytest.raises(DataError, match="or give the sampling step"):
        read_record(path, Columns(strain="output", resistance="input"))
    for clock in ({"time": "n"}, {"time_unit": "ms"}):
        with pytest.raises(DataError, match=r"a sampling step are given\. Leave one of them out"):
            read_record(path, Columns(strain="output", resistance="input", sampling_step=0.5, **clock))
    with pytest.raises(DataError, match="must be a positive time"):
        read_record(path, Columns(strain="output", resistance="input", sampling_step=-1.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put(12, 0, "0.2"), r"r.csv, line 12: time goes backwards, 0.9 s to 0.2 s"),
        (put(12, 1, "-0.02"), "line 12: strain -0.02 is negative"),
        (put(12, 2, "1.06"), "line 12: the output jumps from"),
        (put(12, 1, "7.5"), "line 12: strain 7.5 has no unit"),
        (lambda rows: [put(k, 1, "0.01")(rows) for k in range(2, 42)], "lines 2 to 41: the record is of constant strain"),
        (lambda rows: [put(k, 2, "5")(rows) for k in range(2, 42)], "of constant output"),
        (lambda rows: [put(k, 2, "nan")(rows) for k in range(7, 12)], "line 7: 5 of 40 samples hold no finite number"),
        (lambda rows: [put(k, 0, str(0.1 * k + 90))(rows) for k in range(9, 42)], "line 9: a gap of 90.3 s in which strain"),
        (lambda rows: rows.__delitem__(slice(2, None)), "too short"),
        (put(12, 2, "1100,5"), "line 12: 4 cells under 3 names. Write decimal points"),
    ],
)
def test_an_unusable_record_is_refused_by_its_line(tmp_path, change, message):
    with pytest.raises(DataError, match=message):
        read_record(write(tmp_path / "r.csv", change=change))


@pytest.mark.parametrize(
    ("change", "columns", "repair", "size"),
    [
        (put(12, 2, ""), Columns(), "1 sample without a finite number was left out, the first in line 12: 1 | ", 39),
        (put(12, 1, "inf"), Columns(), "the first in line 12", 39),
        (put(12, 0, "0.9"), Columns(), "1 repeated times were averaged, the first in line 12", 39),
        (put(12, 0, "0.85"), Columns(sort=True), "sorted by time, the first out of order in line 12", 40),
        (put(2, 1, "-0.0001"), Columns(), "strain from -0.0001 up to 0 was set to 0", 40),
    ],
)
def test_a_small_fault_is_repaired_and_told(tmp_path, change, columns, repair, size):
    found = read_record(write(tmp_path / "r.csv", change=change), columns)
    assert any(repair in text for text in found.repairs)
    assert found.time.size == size
    assert (np.diff(found.time) > 0.0).all()
    assert found.strain.min() >= 0.0


def test_records_of_one_sensor_in_two_units_are_refused(tmp_path):
    first = write(tmp_path / "first.csv")
    second = write(tmp_path / "second.csv", "time,strain,R_kohm")
    with pytest.raises(DataError, match=r"reaches 1099.96 in first.csv and 1.09996e\+06 in second.csv"):
        read_records([first, second])
    assert len(read_records([first, write(tmp_path / "third.csv")])) == 2
    (tmp_path / "other").mkdir()
    with pytest.raises(DataError, match=r"2 records are called first \(first\.csv, first\.csv\)"):
        read_records([first, write(tmp_path / "other" / "first.csv")])


def test_a_gap_at_rest_is_harmless(tmp_path):
    def rest(rows):
        for k in range(20, 40):
            rows[k][0] = str(0.1 * k + 90.0)
            rows[k][1] = rows[19][1]

    assert read_record(write(tmp_path / "r.csv", change=rest)).time.size == 40


@pytest.mark.parametrize(
    ("header", "columns", "message"),
    [
        ("time,strain,force", Columns(), "no column is recognised as resistance among time, strain, force"),
        ("time,strain,resistance", Columns(strain="eps"), "no column 'eps' for strain"),
        ("time,strain,strain [%]", Columns(resistance="strain"), "2 columns may be the strain"),
        ("t_ms,strain,resistance", Columns(time_unit="s"), "'t_ms' is in ms, but the option is s"),
        ("time,strain,resistance", Columns(strain_unit="furlong"), "'furlong' is not a unit of strain"),
    ],
)
def test_unclear_columns_are_refused(tmp_path, header, columns, message):
    with pytest.raises(DataError, match=message.replace("[", r"\[")):
        read_record(write(tmp_path / "r.csv", header), columns)


def test_records_are_weighted_one_by_one(tmp_path):
    files = [write(tmp_path / name) for name in ("first.csv", "second.csv")]
    assert [r.weight for r in read_records(files, weights=[1.0, 0.25])] == [1.0, 0.25]
    for weights in ([1.0], [1.0, -1.0], [1.0, float("nan")]):
        with pytest.raises(DataError, match="one positive weight per record"):
            read_records(files, weights=weights)


def test_all_unclear_columns_of_all_files_are_named_at_once(tmp_path):
    paths = [write(tmp_path / "a.csv", "n,input,output"), write(tmp_path / "b.csv", "time,strain,ohms law")]
    with pytest.raises(DataError) as refused:
        read_records([*paths, tmp_path / "c.csv"])
    named = [(Path(text.split(",")[0]).name, re.findall("--[a-z-]+", text)) for text in str(refused.value).splitlines()]
    assert named[:4] == [
        ("a.csv", ["--time", "--sampling-step"]),
        ("a.csv", ["--strain"]),
        ("a.csv", ["--resistance"]),
        ("b.csv", ["--resistance"]),
    ]
    assert str(refused.value).splitlines()[4].startswith("cannot read")


def test_strain_that_is_noisier_than_the_output_makes_one_look_whether_they_are_swapped(tmp_path):
    random = np.random.default_rng(2)
    noisy = [
        [f"{t:.6g}", f"{s + 0.004 * e:.9g}", f"{r:.9g}"]
        for t, s, r, e in zip(T, STRAIN, OHM, random.random(40), strict=True)
    ]
    found = read_record(write(tmp_path / "noisy.csv", rows=noisy))
    assert any("strain is noisier than the output" in text and "not swapped" in text for text in found.repairs)
    assert not read_record(write(tmp_path / "clean.csv")).repairs


def test_a_long_table_says_how_far_it_was_read(tmp_path, caplog, monkeypatch):
    monkeypatch.setattr("gossamer_files.measured.reader.TOLD", 15)
    with caplog.at_level(logging.INFO):
        read_record(write(tmp_path / "r.csv"))
    assert caplog.messages == ["r.csv: 15 rows read", "r.csv: 30 rows read"]
