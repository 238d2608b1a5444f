"""No silent unit: however a file is written, its numbers are read in their unit, or refused by name."""

import datetime
import re

import numpy as np
import pytest
from gossamer_files.measured.columns import WORDS
from gossamer_files.measured.units import factor, is_unit
from gossamer_models import DataError
from gossamer_models.fitting import Columns, read_record

pytestmark = pytest.mark.usefixtures("dashes")

T = 0.1 * np.arange(40)
STRAIN = 0.05 * np.abs(np.sin(T))
OHM = 1000.0 + 2000.0 * STRAIN


def text_of(header="time_s,strain [1],R_ohm", time=T, strain=STRAIN, ohm=OHM, above="", below="", mark=None):
    """A file as a meter may write it; with a mark for decimals, semicolons part the cells."""
    rows = [header, *([below] if below else [])]
    for t, s, r in zip(time, strain, ohm, strict=True):
        row = ",".join(x if isinstance(x, str) else f"{x:.10g}" for x in (t, s, r))
        rows.append(row.replace(",", ";").replace(".", mark) if mark else row)
    return above + "\n".join(rows) + "\n"


def read(tmp_path, text, columns=None, encoding="utf-8"):
    path = tmp_path / "r.csv"
    path.write_bytes(text.encode(encoding))
    return read_record(path, columns)


def same(record):
    assert record.time == pytest.approx(T, abs=1e-9)
    assert record.strain == pytest.approx(STRAIN, abs=1e-9)
    assert record.resistance == pytest.approx(OHM, rel=1e-9)
    return record


@pytest.mark.parametrize(
    ("what", "units"),
    [
        ("resistance", {"kΩ": 1e3, "k\N{OHM SIGN}": 1e3, "MΩ": 1e6, "mΩ": 1e-3, "kOhm": 1e3, "KOHM": 1e3, "Ohms": 1.0}),
        ("resistance", {"MOhm": 1e6, "mohm": 1e-3, "megohm": 1e6, "1": 1.0, "%": 0.01}),
        ("time", {"s": 1.0, "S": 1.0, "ms": 1e-3, "µs": 1e-6, "us": 1e-6, "min": 60.0, "h": 3600.0, "Seconds": 1.0}),
        ("strain", {"%": 0.01, "µε": 1e-6, "με": 1e-6, "ustrain": 1e-6, "‰": 1e-3, "permille": 1e-3, "mm/mm": 1.0}),
    ],
)
def test_a_unit_has_one_meaning_however_it_is_spelled(what, units):
    for name, wanted in units.items():
        assert factor(name, what) == pytest.approx(wanted, rel=1e-12), name


@pytest.mark.parametrize(("what", "text"), [("resistance", "V"), ("time", "ohm"), ("strain", "rad"), ("strain", "foo")])
def test_what_is_no_unit_of_a_column_has_no_factor(what, text):
    assert factor(text, what) is None


def test_any_unit_may_stand_in_a_row_of_units_but_no_name_of_time_or_resistance():
    assert all(map(is_unit, ["s", "µε", "kΩ", "°C", "N/mm²", "V", "mm/s", "1/s", "deg C"]))
    names = [*WORDS["time"], *WORDS["resistance"], "R", "T", "R_ohm", "strain1", "time_s", "by hand", "0.5", "9**9**9"]
    assert not any(map(is_unit, names))


@pytest.mark.parametrize(
    ("header", "factors"),
    [
        ("t_s,strain [1],R_ohm", (1, 1, 1)),
        ("time [ms],strain [%],R_kohm", (1e-3, 0.01, 1e3)),
        ("Time (min),Strain [1],Resistance (kOhm)", (60, 1, 1e3)),
        ("t / ms,ε / %,R / kΩ", (1e-3, 1e-2, 1e3)),
        ("Time [s],microstrain,R (MΩ)", (1.0, 1e-6, 1e6)),
        ("milliseconds,Strain (µε),kOhm", (1e-3, 1e-6, 1e3)),
        ("Zeit in min,Dehnung [%],Widerstand [kOhm]", (60.0, 1e-2, 1e3)),
        ("time_ms,strain_pct,R_MOhm", (1e-3, 1e-2, 1e6)),
    ],
)
def test_units_in_names_are_read(tmp_path, header, factors):
    found = same(read(tmp_path, text_of(header, *(x / f for x, f in zip((T, STRAIN, OHM), factors, strict=True)))))
    assert [q.column.factor for q in found.summary.quantities] == pytest.approx(factors)
    assert (found.summary.remarks, found.repairs) == ((), ())


def test_a_row_of_units_is_read(tmp_path):
    found = same(read(tmp_path, text_of("time,strain,R", 1e3 * T, 100 * STRAIN, 1e-3 * OHM, below="ms,[%],kOhm")))
    assert [q.column.unit for q in found.summary.quantities] == ["ms", "%", "kOhm"]
    assert found.repairs == ()
    same(read(tmp_path, text_of("time,strain,R", T, STRAIN, 1e-3 * OHM, below="s,-,kΩ")))


@pytest.mark.parametrize("header", ["time,strain,R", "# time,strain,R"])
def test_a_row_of_units_may_be_a_comment_above_the_first_sample(tmp_path, header):
    for below in ("# ms,%,kohm", "# by hand, in lab 3\n#[ms],[%],[kΩ]", "# ms,%,kohm\n# s,1,ohm"):
        text = text_of(header, 1e3 * T, 100 * STRAIN, 1e-3 * OHM, below=below)
        assert same(read(tmp_path, text)).repairs == ()
        same(read(tmp_path, text.replace(",", " ") if "lab" not in below else text))
    for below in ("# of,hand,ohm", "# ms,%", "# 0,0,1000", "# 1,1,1", "# t,e,R", "#,,"):
        assert same(read(tmp_path, text_of(header, below=below))).repairs == ()
    later = text_of(header) + "# ms,%,kohm\n4,0.01,1020\n"
    assert read(tmp_path, later).strain[-1] == pytest.approx(0.01)
    with pytest.raises(DataError, match=r"line 2: column 'R_ohm' is in ohm, but the row of units says kohm"):
        read(tmp_path, text_of("time,strain,R_ohm", below="# s,%,kohm"))


def test_a_row_of_words_is_no_row_of_units_and_is_told_where_units_are_stated(tmp_path):
    stated = Columns(time_unit="s", strain_unit="%", resistance_unit="kohm")
    row = (T, 100 * STRAIN, 1e-3 * OHM)
    assert same(read(tmp_path, text_of("time,strain,R", *row, below="s,Prozent,kOhm"), stated)).repairs == ()
    (repair,) = same(read(tmp_path, text_of("time,strain,R", *row, below="Zeit,Dehnung,Widerstand"), stated)).repairs
    assert "left out, the first in line 2: Zeit | Dehnung | Widerstand" in repair


@pytest.mark.parametrize(
    ("header", "below", "message"),
    [
        ("time,strain,R", "s,furlong,kOhm", r"line 2: .*'furlong' is neither a number nor a unit of strain"),
        ("time_s,strain,R_ohm", "s,1,kOhm", r"line 2: column 'R_ohm' is in ohm, but the row of units says kOhm"),
        ("time_s,strain,R [V]", "", r"line 1: 'V' in 'R \[V\]' is not a unit of resistance"),
        ("time_s,strain,R_inner_ohm", "", None),
        ("time_s,strain,resistance,R_outer_ohm", "", None),
    ],
)
def test_a_unit_that_is_none_or_contradicts_is_refused(tmp_path, header, below, message):
    if message is None:
        same(read(tmp_path, text_of(header)))
        return
    with pytest.raises(DataError, match=message):
        read(tmp_path, text_of(header, below=below))


def test_of_two_resistances_one_must_be_named(tmp_path):
    header = "t_s,strain,R_inner_ohm,R_outer_ohm"
    text = text_of(header, ohm=[f"{r:.10g},{2 * r:.10g}" for r in OHM])
    with pytest.raises(DataError, match=r"2 columns may be the resistance: R_inner_ohm, R_outer_ohm\. Name one \(--resis"):
        read(tmp_path, text)
    found = read(tmp_path, text, Columns(resistance="R_outer_ohm"))
    assert found.resistance == pytest.approx(2 * OHM)
    found = same(read(tmp_path, text.replace("R_inner_ohm", "resistance")))
    assert "'resistance' is taken as resistance; 'R_outer_ohm' may be it too (--resistance)." in found.summary.remarks


@pytest.mark.parametrize("step", [1.0, 100.0, 12.5])
def test_times_without_a_unit_that_may_be_milliseconds_are_refused(tmp_path, step):
    text = text_of("time,strain,R_ohm", step * np.arange(40))
    with pytest.raises(
        DataError,
        match=r"'time' has no unit, .* apart may be seconds, milliseconds or a count\. State the unit \(--time-unit\)",
    ):
        read(tmp_path, text)
    assert read(tmp_path, text, Columns(time_unit="ms")).time[-1] == pytest.approx(39e-3 * step)
    assert read(tmp_path, text.replace("time", "time_s", 1)).time[-1] == pytest.approx(39 * step)


def test_a_strain_that_may_be_in_per_cent_is_said_and_one_beyond_a_ratio_of_one_refused_until_its_unit_is_stated(tmp_path):
    remarks = read(tmp_path, text_of("t_s,strain,R_ohm", strain=16 * STRAIN)).summary.remarks
    assert [sentence for sentence in remarks if "it reaches 80%" in sentence and "--strain-unit %" in sentence]
    assert read(tmp_path, text_of(strain=16 * STRAIN)).summary.remarks == ()
    text = text_of("t_s,strain,R_ohm", strain=32 * STRAIN)
    with pytest.raises(
        DataError, match=r"has no unit, and may be \d+% or 1\.\d+ %\. State the unit \(--strain-unit\): 1, %"
    ):
        read(tmp_path, text)
    assert read(tmp_path, text, Columns(strain_unit="%")).strain.max() == pytest.approx(0.32 * STRAIN.max())
    assert read(tmp_path, text, Columns(strain_unit="1")).strain.max() == pytest.approx(32 * STRAIN.max())


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
@pytest.mark.parametrize("mark", [None, ","])
def test_encodings_and_decimal_commas_are_read(tmp_path, encoding, mark):
    header = "Zeit [s],Dehnung [µm/m],R [kOhm]"
    text = text_of(header.replace(",", ";") if mark else header, T, 1e6 * STRAIN, 1e-3 * OHM, mark=mark)
    found = same(read(tmp_path, text, encoding=encoding)).summary
    assert ("decimal commas" in found.written) == (mark == ",")
    assert ("LATIN-1" in found.written) == (encoding == "latin-1")
    assert ("UTF-16" in found.written) == encoding.startswith("utf-16")


def test_a_preamble_is_passed_over(tmp_path):
    above = "Tensile tester 5;serial 12,5\n# operator: Maß\n\nspecimen,7,3\n"
    found = same(read(tmp_path, text_of(above=above))).summary
    assert "header in line 5" in found.written
    same(read(tmp_path, text_of("# time_s strain R_ohm").replace(",", " ")))


def test_a_comment_is_a_header_only_where_no_other_line_above_the_numbers_is(tmp_path):
    found = same(read(tmp_path, text_of(above="# time, strain, resistance of specimen 3, by hand.\n"))).summary
    assert "header in line 2" in found.written
    for header, message in (
        (
            "# Measured on Monday, at 10.\n# in lab 3\nzeta,kappa,no.",
            r"line 3: no column .* time among zeta, kappa, no\. Name",
        ),
        ("# zeta,kappa,lambda", "line 1: no column is recognised as time among zeta, kappa, lambda"),
        ("# Measured on Monday", "line 2: numbers, but no names of columns"),
    ):
        with pytest.raises(DataError, match=message):
            read(tmp_path, text_of(header))


@pytest.mark.parametrize("units", [Columns(), Columns(time_unit="s", strain_unit="1", resistance_unit="ohm")])
@pytest.mark.parametrize("between", ["time_s,strain1,strain2,R_ohm", "t,strain,strain,R", "Operator: Max"])
def test_a_comment_above_other_text_is_no_header_whatever_units_are_stated(tmp_path, units, between):
    text = text_of(f"# time, strain, resistance, by hand\n{between}", ohm=[f"{s:.10g},1000" for s in STRAIN])
    with pytest.raises(DataError, match=r"r\.csv, line 2: "):
        read(tmp_path, text, units)


@pytest.mark.parametrize("below", ["s,%,kOhm,°C", "# by hand\ns,[%],kOhm,", "s,%,kOhm,N/mm²\n--,--,--,--\n0,nan,nan,20"])
def test_a_comment_above_units_and_samples_without_values_is_the_header(tmp_path, below):
    ohm = [f"{r:.10g},20" for r in 1e-3 * OHM]
    record = same(read(tmp_path, text_of("# time,strain,R,other", T, 100 * STRAIN, ohm, below=below)))
    assert [q.column.unit for q in record.summary.quantities] == ["s", "%", "kOhm"]


def test_of_many_columns_twelve_are_named(tmp_path):
    names = ",".join(f"channel{k}" for k in range(19))
    with pytest.raises(DataError, match=r"channel10, channel11 and 7 more\. Name one \(--strain\)"):
        read(tmp_path, f"{names}\n" + 3 * (",".join(["1"] * 19) + "\n"))


def test_the_result_of_a_run_is_called_so_and_read_where_columns_are_named(tmp_path):
    text = text_of("time [s],membrane.strain[1] [1],sensor1.resistance [ohm]")
    with pytest.raises(DataError) as refused:
        read(tmp_path, text)
    assert re.search(r"r\.csv is a result of a run, .* Name a file that was measured", str(refused.value))
    assert "no column" not in str(refused.value)
    same(read(tmp_path, text, Columns(strain="membrane.strain[1] [1]", resistance="sensor1.resistance [ohm]")))


@pytest.mark.parametrize(
    "header", ["elapsed,Elongation [1],R_ohm", "Elapsed Time (s),dehnung_x [1],R_ohm", "elapsed_s,Strain mm/mm,R_ohm"]
)
def test_elapsed_time_and_elongation_are_recognised(tmp_path, header):
    same(read(tmp_path, text_of(header)))


@pytest.mark.parametrize("header", ["time_s,elongation [mm],R_ohm", "time_s,strain_mm,R_ohm", "time_s,Dehnung / µm,R_ohm"])
def test_a_displacement_is_no_strain_and_the_remedy_is_said(tmp_path, header):
    remedy = "divide it by the gauge length first, and write the ratio"
    with pytest.raises(DataError, match=rf"line 1: '.m' in '.*' is not a unit of strain\. That is a displacement: {remedy}"):
        read(tmp_path, text_of(header))
    with pytest.raises(DataError, match=f"'mm' is not a unit of strain. .*{remedy}"):
        read(tmp_path, text_of("time_s,strain,R_ohm"), Columns(strain_unit="mm"))


def test_an_elongation_without_a_unit_may_be_a_length(tmp_path):
    with pytest.raises(DataError, match=r"line 1: column 'Elongation' has no unit, and may be a length\. State"):
        read(tmp_path, text_of("time_s,Elongation,R_ohm"))
    same(read(tmp_path, text_of("time_s,Elongation,R_ohm", below="s,1,ohm")))
    same(read(tmp_path, text_of("time_s,Elongation,R_ohm"), Columns(strain_unit="1")))


@pytest.mark.parametrize("stamp", ["2024-05-31T12:00:00", "12:00:00"])
def test_a_clock_that_stands_is_not_called_a_date(tmp_path, stamp):
    with pytest.raises(DataError, match="the record is too short"):
        read(tmp_path, text_of("time,strain,R_ohm", [stamp] * 40))


def test_a_date_is_the_time_only_with_the_time_of_day_and_where_no_other_column_is(tmp_path):
    rows = list(zip(T, STRAIN, OHM, strict=True))
    beside = "".join(f"2024-05-31,{t:.10g},{s:.10g},{r:.10g}\n" for t, s, r in rows)
    assert same(read(tmp_path, f"date,elapsed,strain [1],R_ohm\n{beside}")).summary.remarks == ()
    for header in ("date", "Date/Time"):
        same(read(tmp_path, text_of(f"{header},strain,R_ohm", [f"2024-05-31T12:00:0{t:.1f}" for t in T])))
    with pytest.raises(
        DataError, match=r"line 2: column 'date' holds dates without times of day, 1 for 40 samples\. Name one"
    ):
        read(tmp_path, text_of("date,strain,R_ohm", ["2024-05-31"] * 40))
    with pytest.raises(DataError, match=r"column 'Date' holds numbers, which may be days\. State the unit \(--time-unit\)"):
        read(tmp_path, text_of("Date,strain,R_ohm", 45443.5 + T))


@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
def test_iso_timestamps_are_seconds_after_the_first(tmp_path, zone):
    begin = datetime.datetime(2024, 3, 31, 1, 59, 58)  # an hour later clocks in Europe are put forward
    stamps = [(begin + datetime.timedelta(seconds=t)).isoformat(timespec="milliseconds") + zone for t in T.tolist()]
    same(read(tmp_path, text_of("timestamp,strain,R_ohm", stamps)))
    with pytest.raises(DataError, match="is in ms, but holds timestamps"):
        read(tmp_path, text_of("timestamp [ms],strain,R_ohm", stamps))


def test_times_of_day_are_read_and_other_dates_refused_for_what_they_are(tmp_path):
    same(
        read(
            tmp_path,
            text_of("time,strain,R_ohm", [f"10:59:{57 + t:06.3f}"[:12] if t < 3 else f"11:00:{t - 3:06.3f}" for t in T]),
        )
    )
    dates = [f"31.05.2024 12:00:{t:04.1f}" for t in T]
    with pytest.raises(DataError, match=r"It looks like a date or a time: write it in ISO 8601") as caught:
        read(tmp_path, text_of("time,strain,R_ohm", dates))
    assert "decimal" not in str(caught.value)


def test_marks_that_contradict_each_other_are_refused(tmp_path):
    text = text_of("time_s;strain;R_ohm", mark=",")
    lines = text.splitlines()
    mixed = "\n".join([*lines[:4], lines[4].replace(",", "."), *lines[5:]])
    with pytest.raises(DataError, match=r"decimal commas \(line 3\) and decimal points \(line 5\) in one file"):
        read(tmp_path, mixed)
    with pytest.raises(DataError, match=r"'1\.000,5' marks thousands"):
        read(
            tmp_path,
            text_of("time_s;strain;R_ohm", ohm=["1.000,5"] * 40).replace(",5", "#").replace(",", ";").replace("#", ",5"),
        )


def test_a_gap_at_constant_strain_is_said_with_its_line(tmp_path):
    time = np.where(np.arange(40) < 20, T, T + 200.0)
    strain = STRAIN.copy()
    strain[20] = strain[19]
    (gap,) = read(tmp_path, text_of(time=time, strain=strain)).summary.gaps
    assert (gap.line, gap.strain) == (22, 0.0)
    assert gap.seconds == pytest.approx(200.1)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PK\x03\x04rest", "is a spreadsheet of another program. Save it as CSV"),
        (b"\x01\x02\x00\x03\x04\x05\x00", "holds no text"),
        (b"0,1,2\n1,2,3\n", "numbers, but no names of columns"),
        (b"\n \n", "it is empty"),
        (b"", "it is empty"),
        (b"time,strain,resistance\n", "holds no samples"),
    ],
)
def test_a_file_without_a_table_is_refused_by_what_it_is(tmp_path, content, message):
    with pytest.raises(DataError, match="cannot read"):
        read_record(tmp_path / "r.csv")
    (tmp_path / "r.csv").write_bytes(content)
    with pytest.raises(DataError, match=message):
        read_record(tmp_path / "r.csv")


@pytest.mark.parametrize("header", ["time_s,strain [1],R_ohm,T", "t [s],strain [1],R_ohm,T [°C]"])
def test_a_temperature_called_t_is_not_taken_for_the_time(tmp_path, header):
    rows = "".join(f"{t:.10g},{s:.10g},{r:.10g},{20.0 + 0.01 * t}\n" for t, s, r in zip(T, STRAIN, OHM, strict=True))
    same(read(tmp_path, f"{header}\n{rows}"))


@pytest.mark.parametrize("sort", [False, True])
def test_times_of_day_that_pass_midnight_are_not_sorted(tmp_path, sort):
    begin = datetime.datetime(2026, 5, 1, 23, 59, 58)
    times = [f"{begin + datetime.timedelta(seconds=0.1 * k):%H:%M:%S.%f}" for k in range(40)]
    with pytest.raises(DataError, match="It passes midnight: write dates before the times"):
        read(tmp_path, text_of(time=times, header="time,strain [1],R_ohm"), Columns(sort=sort))


@pytest.mark.parametrize(
    ("header", "first"), [("time_s,strain [1],R_ohm,state", "-1,nan,nan,A"), ("# time_s,strain [1],R_ohm", "-1,OVER,OVER")]
)
def test_a_first_sample_without_values_is_left_out(tmp_path, header, first):
    """A, like V or C, is a unit, but here the mark of a sample."""
    same(read(tmp_path, text_of(header, below=first)))
