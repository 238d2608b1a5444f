"""Inputs from files: what they are between rows, in which unit, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from command_line import invoke
from gossamer_orchestrator import ScenarioError, load_scenario, make_plan, run_scenario
from gossamer_orchestrator.fmi.types import definition_of
from gossamer_orchestrator.scenario.histories import History

TEXT = """
step = 0.5
stop = 2.0
{head}
[components.gain]
fmu = "{fmu}"
inputs = {{ "offset[*]" = 0.0 }}
[[inputs]]
to = "gain.u"
file = "{file}"
column = "load"
{more}
"""


@pytest.fixture
def measured(fmus, tmp_path):
    """Run or plan a gain whose input comes from a file."""

    def make(rows, more="", *, fmu="kilo", head="", file="measured.csv", act=run_scenario):
        if isinstance(rows, str):
            (tmp_path / "measured.csv").write_text(rows)
        (tmp_path / "s.toml").write_text(TEXT.format(fmu=fmu, more=more, head=head, file=file))
        return act(load_scenario(tmp_path / "s.toml"), fmus)

    return make


ROWS = "time [s],load [Pa]\n0,0\n1,1000\n2,500\n"


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
def test_a_history_is_linear_between_its_rows_converted_and_held_over_a_step(measured, master):
    """The output at the end of a step belongs to the input at its beginning."""
    data = measured(ROWS, head=f'master = "{master}"')
    assert data["gain.y"].values == pytest.approx([0.0, 0.0, 0.5, 1.0, 0.75])


def test_what_a_file_feeds_is_recorded_unless_a_scenario_says_what(measured):
    """It stands beside the output that belongs to it."""
    data = measured(ROWS)
    assert data["gain.u"].values == pytest.approx([0.0, 0.0, 0.5, 1.0, 0.75])
    assert "gain.u" not in measured(ROWS, '[record]\nvariables = ["gain.y"]')


def test_a_history_may_be_held(measured):
    data = measured(ROWS, 'between = "held"')
    assert data["gain.y"].values == pytest.approx([0.0, 0.0, 0.0, 1.0, 1.0])


def test_a_history_may_be_periodic(measured):
    data = measured("t,load [kPa]\n0,0\n0.5,3\n1.0,0\n", "periodic = true")
    assert data["gain.y"].values == pytest.approx([0.0, 0.0, 3.0, 0.0, 3.0])


def test_a_history_may_come_from_netcdf_and_in_a_stated_unit(measured, tmp_path):
    def write(last, unit):
        values = xr.DataArray([0.0, 1.0, last], {"t": [0.0, 1e3, 2e3]}, "t", attrs={"units": "MPa"})
        values["t"].attrs["units"] = unit
        xr.Dataset({"load": values}).to_netcdf(tmp_path / "measured.nc", engine="scipy")

    write(2.0, "ms")
    assert measured(None, file="measured.nc")["gain.y"].values[-1] == pytest.approx(1500.0)
    assert measured(None, 'unit = "hPa"', file="measured.nc")["gain.y"].values[-1] == pytest.approx(0.15)
    for last, unit, message in ((np.inf, "ms", "no finite number at 2 s"), (2.0, "V", "'t' is 'V', which is none of time")):
        write(last, unit)
        with pytest.raises(ScenarioError, match=message):
            measured(None, file="measured.nc", act=make_plan)


def test_a_periodic_history_goes_on_before_and_after_its_times():
    wave = History(times=np.array([1.0, 2.0, 3.0]), values=np.array([0.0, 1.0, 0.0]), linear=True, periodic=True)
    assert [wave(t) for t in (0.5, 1.0, 2.0, 3.0, 3.5, 103.0)] == pytest.approx([0.5, 0.0, 1.0, 0.0, 0.5, 0.0])


@pytest.mark.parametrize("linear", [True, False])
def test_every_period_begins_with_the_first_value_whatever_rounding_says(linear):
    """0.3 % 0.1 is nearly 0.1: the last value of a saw tooth instead of its first."""
    saw = History(times=np.array([0.0, 0.1]), values=np.array([0.0, 1.0]), linear=linear, periodic=True)
    assert [saw(0.1 * k) for k in range(100)] == pytest.approx([0.0] * 100, abs=1e-6)
    assert saw(0.3) == 0.0


@pytest.mark.parametrize(("cell", "value"), [("True", 1.0), ("TRUE", 1.0), ("1", 1.0), ("False", 0.0), ("0", 0.0)])
def test_truth_values_are_read_as_other_programs_write_them(reference_fmus, tmp_path, cell, value):
    (tmp_path / "m.csv").write_text(f"t,on\n0,{cell}\n")
    others = '"Float*" = 0.0, "Int*" = 0, "UInt*" = 0, String_input = "", Binary_input = "", Enumeration_input = 1'
    text = f'step = 0.5\nstop = 0.5\n[components.c]\nfmu = "Feedthrough3"\ninputs = {{ {others} }}\n'
    (tmp_path / "s.toml").write_text(text + '[[inputs]]\nto = "c.Boolean_input"\nfile = "m.csv"\ncolumn = "on"\n')
    assert run_scenario(load_scenario(tmp_path / "s.toml"), reference_fmus)["c.Boolean_output"].values[-1] == value
    (tmp_path / "m.csv").write_text("t,on\n0,1\n1,on\n")
    with pytest.raises(ScenarioError, match=r"m\.csv, line 3: column 'on' cannot be read as Boolean: 'on' is neither true"):
        make_plan(load_scenario(tmp_path / "s.toml"), reference_fmus)


@pytest.mark.parametrize(("name", "expected"), [
    ("kPa", (1e3, 0.0)), ("degC", (1.0, 273.15)), ("%", (0.01, 0.0)), ("cm", (0.01, 0.0)), ("min", (60.0, 0.0)),
    ("degF", (5 / 9, 459.67 * 5 / 9)), ("mN", (1e-3, 0.0)),
])  # fmt: skip
def test_common_units_are_known(name, expected):
    unit = definition_of(name)
    assert (unit.factor, unit.offset) == pytest.approx(expected)
    assert definition_of("parsnip") is definition_of("dBm") is None


REFUSALS = {
    "no such column": ("t,lode\n0,0\n", "", "measured.csv, line 1: there is no column 'load'. Did you mean 'lode'?"),
    "two columns": ("t,load [Pa],load [kPa]\n0,0,0\n", "", "line 1: several columns are called 'load'. Rename all but one"),
    "no number": ("t,load\n0,zero\n", "", "measured.csv, line 2: 'zero' under 'load' is no number"),
    "nothing": ("", "", "cannot read .*measured.csv: it is empty. Name a CSV file"),
    "a short row": ("t,load\n0\n", "", "measured.csv, line 2: there is no value under 'load'. Correct"),
    "too short": (
        "t,load\n0,0\n1,0\n",
        "",
        "holds times from 0 to 1 s and the run needs 0 to 2 s. Change the run, or write",
    ),
    "too late": ("t,load\n0.5,0\n9,0\n", 'between = "held"', "holds times from 0.5 to 9 s and the run needs 0 to 2 s"),
    "another dimension": (
        "t,load [m]\n0,0\n9,0\n",
        "",
        "column 'load' of .*measured.csv: its unit 'm' cannot be converted to 'kPa', that of 'u'",
    ),
    "an unknown unit": ("t,load [psf]\n0,0\n9,0\n", "", "its unit 'psf' cannot be converted to 'kPa'"),
    "a wrong key": ("t,load\n0,0\n9,0\n", "kind = 1", "unknown key 'kind' in 'inputs'"),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_a_file_that_does_not_fit_is_refused_with_its_line(measured, case):
    rows, more, message = REFUSALS[case]
    with pytest.raises(ScenarioError, match=rf"s.toml:\d+: .*{message}"):
        measured(rows, more, act=make_plan)


def test_an_input_that_is_not_finite_ends_with_the_exit_code_of_that(measured, fmus, tmp_path):
    for cell, code in (("inf", 3), ("zero", 1)):
        with pytest.raises(ScenarioError):
            measured(f"t,load\n0,0\n9,{cell}\n", act=make_plan)
        assert invoke(["run", str(tmp_path / "s.toml"), "--fmus", str(fmus), "--out", str(tmp_path)]).exit_code == code


def test_a_missing_file_is_refused(measured):
    with pytest.raises(ScenarioError, match=r"s.toml:\d+: there is no file /.*none.csv; 'file' is looked for beside"):
        measured(None, file="none.csv", act=make_plan)


def test_an_input_is_fed_once_and_lies_in_its_range(reference_fmus, tmp_path):
    (tmp_path / "m.csv").write_text("t,option\n0,1\n1,3\n")
    more = '[[inputs]]\nto = "c.Enumeration_input"\nfile = "m.csv"\ncolumn = "option"\n'
    text = f'step = 0.5\nstop = 1.0\n[components.c]\nfmu = "Feedthrough2"\n{more}'
    (tmp_path / "s.toml").write_text(text)
    with pytest.raises(ScenarioError, match="at 1 s input 'Enumeration_input' would be 3, and it must lie in 1 to 2"):
        make_plan(load_scenario(tmp_path / "s.toml"), reference_fmus)
    (tmp_path / "s.toml").write_text(text + more)
    with pytest.raises(ScenarioError, match=r"input 'c\.Enumeration_input' is fed twice"):
        make_plan(load_scenario(tmp_path / "s.toml"), reference_fmus)


def test_the_driven_reference_repeats_its_inputs_exactly(reference_fmus, reference_outputs, tmp_path):
    """Integers of every width from Feedthrough_in.csv; what is recorded of those of 64 bits is the nearest float."""
    import csv

    with (reference_outputs / "Feedthrough_in.csv").open(newline="") as file:
        names, *rows = csv.reader(file)
    (tmp_path / "in.csv").write_bytes((reference_outputs / "Feedthrough_in.csv").read_bytes())
    feeds = "".join(f'[[inputs]]\nto = "c.{name}"\nfile = "in.csv"\ncolumn = "{name}"\n' for name in names[1:])
    others = '"Float*" = 0.0, Boolean_input = false, String_input = "", Binary_input = "", Enumeration_input = 1'
    text = f'step = 0.1\nstop = 2.0\n[components.c]\nfmu = "Feedthrough3"\ninputs = {{ {others} }}\n{feeds}'
    (tmp_path / "s.toml").write_text(text)
    data = run_scenario(load_scenario(tmp_path / "s.toml"), reference_fmus)
    for place, name in enumerate(names[1:], start=1):
        before, after = (float(int(row[place])) for row in rows)
        found = data[f"c.{name.removesuffix('_input')}_output"].values
        assert found.tolist() == [before] * 11 + [after] * 10
    assert np.all(data["c.Boolean_output"].values == 0.0)
