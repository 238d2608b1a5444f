"""One reader: whoever reads a measured table, units, decimal commas, time stamps and gaps mean the same."""

import datetime
import math

import numpy as np
import pytest
from gossamer.records import find_record
from gossamer_models import DataError
from gossamer_models.identify import identify_files
from gossamer_models.review import judge_files
from gossamer_models.sensor.artifact import DEFAULT_PATH
from gossamer_orchestrator import ScenarioError, load_scenario, make_plan

T = 0.01 * np.arange(101)
STRAIN = 0.05 * np.abs(np.sin(20.0 * T))
SENSORS = ("identify", "assess")  # leave out samples without a number, and say so


class ReadError(Exception):
    """Ends a command after its records were read."""


def read_by(command, *arguments):
    """Return what a command reads, before it begins to work."""

    def stop(records):
        raise ReadError(records[0].time, records[0].strain)

    with pytest.raises(ReadError) as read:
        command(*arguments, recognised=stop)
    return read.value.args


def fitted(path):
    """What twin and watch are fitted to; they leave out time 0."""
    none = dict.fromkeys(("kind", "noise", "set", "setup", "begins"))
    record = find_record(path, none | {"elements_per_side": 4, "order": 1}).record
    return record.step * np.arange(record.samples + 1), np.r_[0.0, record.values[0]]


@pytest.fixture
def fed(fmus, tmp_path):
    def read(path):
        text = 'step = 0.01\nstop = 1.0\n[components.kilo]\nfmu = "ratio"\ninputs = { "offset[*]" = 0.0 }\n[[inputs]]\n'
        (tmp_path / "s.toml").write_text(text + f'to = "kilo.u"\nfile = "{path.name}"\ncolumn = "strain[1]"\n')
        (history,) = make_plan(load_scenario(tmp_path / "s.toml"), fmus).histories.values()
        return history.times, history.values

    return read


READERS = {
    "identify": lambda path: read_by(identify_files, [path]),
    "assess": lambda path: read_by(judge_files, DEFAULT_PATH, [path]),
    "twin": fitted,
}


@pytest.fixture(params=[*READERS, "inputs"])
def user(request, tmp_path):
    """Who reads: a function from rows to time [s] and strain [1], in a table with a resistance where a sensor needs one."""
    read = READERS.get(request.param) or request.getfixturevalue("fed")
    name, after = ("strain", ";R [ohm]") if request.param in SENSORS else ("strain[1]", "")

    def call(time, strain, head="time [s];strain [1]", mark="."):
        lines = [head.replace("strain", name) + after]
        for k, cells in enumerate(zip(time, strain, strict=True)):
            text = ";".join(cell if isinstance(cell, str) else f"{cell:.12g}" for cell in cells)
            lines.append(text + (";ohm" if "%" in text else f";{1000.0 + k:g}") * bool(after))
        (tmp_path / "r.csv").write_text("\n".join([lines[0], *(line.replace(".", mark) for line in lines[1:])]))
        return read(tmp_path / "r.csv")

    call.of = request.param
    return call


STAMPS = [(datetime.datetime(2026, 5, 31, 12) + datetime.timedelta(seconds=t)).isoformat() for t in T.tolist()]


@pytest.mark.parametrize(
    ("time", "strain", "how"),
    [
        (T, 100.0 * STRAIN, {"head": "time [s];strain [%]"}),
        (1e3 * T, STRAIN, {"head": "time [ms];strain [1]"}),
        (["ms", *1e3 * T], ["%", *100.0 * STRAIN], {"head": "time;strain"}),
        (T, STRAIN, {"mark": ","}),
        (STAMPS, STRAIN, {}),
    ],
    ids=["per cent", "ms", "a row of units", "decimal commas", "time stamps"],
)
def test_a_table_means_the_same_to_all_who_read_it(user, time, strain, how):
    found = user(time, strain, **how)
    np.testing.assert_allclose(found[0], T, atol=1e-9)
    np.testing.assert_allclose(found[1], STRAIN, atol=1e-9)


REFUSED = (DataError, ScenarioError)


def test_a_gap_is_left_out_or_refused_by_its_line(user):
    cells = [*STRAIN[:10], "", *STRAIN[11:]]
    if user.of == "inputs":
        with pytest.raises(REFUSED, match=r"r\.csv, line 12: there is no value under 'strain\[1\]'"):
            user(T, cells)
        return
    time, strain = user(T, cells)
    left = np.isfinite(strain)
    assert left.sum() == 100
    np.testing.assert_allclose(strain[left], np.delete(STRAIN, 10), atol=1e-9)
    np.testing.assert_allclose(time[left], np.delete(T, 10), atol=1e-9)


def test_an_infinite_value_is_none(user):
    cells = [*STRAIN[:10], math.inf, *STRAIN[11:]]
    if user.of in SENSORS:
        assert user(T, cells)[1].size == 100
        return
    with pytest.raises(REFUSED, match=r"r\.csv, line 12: 'inf' under 'strain\[1\].*' is infinite"):
        user(T, cells)


@pytest.mark.parametrize(
    ("time", "strain", "how", "message"),
    [
        (T, STRAIN, {"head": "time [V];strain [1]"}, r"r\.csv, line 1: 'V' in 'time \[V\]' is not a unit of time"),
        ([*T[:5], "noon", *T[6:]], STRAIN, {}, r"r\.csv, line 7: 'noon' under 'time \[s\]' is no number"),
        (T[::-1], STRAIN, {}, r"r\.csv, line 3: time goes backwards, 1 s to 0\.99 s"),
        (T, ["0,5", *STRAIN[1:]], {}, r"r\.csv, line 3: decimal commas \(line 2\) and decimal points \(line 3\)"),
    ],
)
def test_what_makes_no_sense_is_refused_by_its_line(user, time, strain, how, message):
    if "noon" in message and user.of in SENSORS:
        assert user(time, strain, **how)[0].size == 100
        return
    with pytest.raises(REFUSED, match=message):
        user(time, strain, **how)
