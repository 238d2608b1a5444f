"""FMUs of the behaviour of the FMI project's test FMUs give its reference outputs, and every type and array arrives."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from gossamer_orchestrator import (
    FmuFile,
    ScenarioError,
    Simulation,
    SimulationError,
    build_container,
    export_ssp,
    make_plan,
    parse_scenario,
    run_scenario,
)
from state_spaces import state_spaces

EXPERIMENTS = {  # step and stop [s]
    "BouncingBall": (0.01, 3.0),
    "Dahlquist": (0.1, 10.0),
    "Resource": (1.0, 1.0),
    "Stair": (0.2, 10.0),
    "VanDerPol": (0.01, 20.0),
}
TYPES = [
    "Float32_continuous",
    "Float32_discrete",
    "Float64_continuous",
    "Float64_discrete",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "String",
    "Binary",
    "Enumeration",
]


def scenario(fmu, step, stop, more=""):
    return parse_scenario(f'step = {step}\nstop = {stop}\n[components.c]\nfmu = "{fmu}"\n{more}')


def read_rows(path):
    with path.open(newline="") as file:
        return list(csv.reader(file))


def read_reference(folder, name):
    """Return the header and the numbers of a reference output; an array is several numbers."""
    header, *rows = read_rows(folder / f"{name}_out.csv")
    return header, np.array([[float(text) for cell in row for text in cell.split()] for row in rows])


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_a_run_gives_the_reference_output(reference_fmus, reference_outputs, name, fmi):
    """To the bit, but for the height of a resting ball, which is the smallest float there and 0 here."""
    (_, *columns), expected = read_reference(reference_outputs, name)
    data = run_scenario(scenario(f"{name}{fmi}", *EXPERIMENTS[name]), reference_fmus)
    found = np.column_stack([data["time"], *(data[f"c.{column}"] for column in columns)])
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() <= (1.2e-38 if name == "BouncingBall" else 0.0)


def test_a_state_space_of_three_states_gives_the_reference_output(reference_fmus, reference_outputs):
    _, expected = read_reference(reference_outputs, "StateSpace")
    data = run_scenario(scenario("StateSpace3", 1.0, 10.0, "inputs = { u = [0.0, 0.0, 0.0] }"), reference_fmus)
    assert data["c.y"].values == pytest.approx(expected[:, 1:], rel=1e-14)


def test_structural_parameters_set_the_sizes_of_arrays(reference_fmus):
    """Two states that grow by forward Euler with a step of 1e-3 s, and a sum of both; nothing is read of a third."""
    more = (
        "parameters = { m = 1, n = 2, r = 1, A = [[1, 0], [0, 2]], B = [[0], [0]], C = [[1, 1]], D = [[0]], "
        '"x0[*]" = 1.0 }\n'
        "inputs = { u = [0.0] }\n"
    )
    data = run_scenario(scenario("StateSpace3", 0.5, 1.0, more), reference_fmus)
    assert data["c.y"].shape == (3, 1)
    assert data["c.y"].values[-1, 0] == pytest.approx(1.001**1000 + 1.002**1000, rel=1e-12)


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_that_ends_the_simulation_ends_the_run_in_peace(reference_fmus, fmi, caplog, tmp_path):
    data = run_scenario(scenario(f"Stair{fmi}", 0.2, 20.0), reference_fmus, tmp_path)
    assert data.attrs["ended"] == "component 'c' ended the simulation at t = 9 s"
    assert data.attrs["ended"] in caplog.text
    assert (data["time"].values[-1], data["c.counter"].values[-1]) == (pytest.approx(9.0), 10.0)
    assert (tmp_path / "results.csv").read_text().splitlines()[-1].endswith(",10.0")


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_end_within_a_step_leaves_the_results_until_that_step(reference_fmus, fmi):
    data = run_scenario(scenario(f"Stair{fmi}", 2.0, 20.0), reference_fmus)
    assert data.attrs["ended"] == "component 'c' ended the simulation at t = 9 s"
    assert data["time"].values[-1] == 8.0


def test_triggered_clocks_are_refused_by_name(reference_fmus):
    with pytest.raises(ScenarioError, match=r"scenario:4: FMU 'Clocks3' has clocks that are triggered: clock_in. Clocks"):
        make_plan(scenario("Clocks3", 0.1, 1.0), reference_fmus)


@pytest.mark.parametrize("build", [export_ssp, build_container])
def test_what_is_rounded_is_not_exported(reference_fmus, build, tmp_path):
    scenario = converted((2, 2), "Float64_continuous", "Int32", "2.6", "gain = 1.0")
    scenario = scenario.model_copy(update={"events": []})
    with pytest.raises(
        ScenarioError, match=r"'b.Int32_input' is of type Integer,|of type Integer, and a container does not round"
    ):
        build(scenario, reference_fmus, tmp_path / ("c.ssp" if build is export_ssp else "c.fmu"))


# --- types ---

SET = {
    "Float32_continuous": "0.5",
    "Float32_discrete": "-0.25",
    "Float64_continuous": "0.1",
    "Float64_discrete": "1e300",
    "Int8": "-128",
    "UInt8": "255",
    "Int16": "-32768",
    "UInt16": "65535",
    "Int32": "-2147483648",
    "UInt32": "4294967295",
    "Int64": "9223372036854775807",
    "UInt64": "18446744073709551615",
    "Boolean": "true",
    "String": '"Grüße"',
    "Binary": '"00ff"',
    "Enumeration": "2",
}
EXPECTED = [0.5, -0.25, 0.1, 1e300, -128, 255, -32768, 65535, -(2**31), 2**32 - 1, 2**63 - 1, 2**64 - 1, True, "Grüße"]
EXPECTED += [b"\x00\xff", 2]


class Last:
    """Keep what an FMU's outputs are at the end of a run, read one by one."""

    def begin(self, simulation):
        pass

    def sample(self, simulation):
        instance = next(member.instance for member in simulation.members if member.name == "b")
        ports = {v: instance.port([v], instance.fmu.variables[v].type) for v in instance.fmu.names("output")}
        for port in ports.values():
            instance.read(port)
        self.outputs = {v.removesuffix("_output"): port.get()[0] for v, port in ports.items()}

    def end(self, simulation):
        pass


def pair(fmi, to, types, more="", master="gauss-seidel"):
    """One FMU feeds another some types; all other inputs are given."""
    given = {2: ALL2, 3: TYPES}
    starts = [
        ", ".join(f"{name}_input = {ZERO[name]}" for name in given[version] if name not in left)
        for version, left in ((fmi, ()), (to, types))
    ]
    wires = "".join(f'[[connections]]\nfrom = "a.{name}_output"\nto = "b.{name}_input"\n' for name in types)
    return parse_scenario(
        f'step = 0.1\nstop = 1.0\nmaster = "{master}"\n[components]\n'
        f'a = {{ fmu = "Feedthrough{fmi}", inputs = {{ {starts[0]} }} }}\n'
        f'b = {{ fmu = "Feedthrough{to}", inputs = {{ {starts[1]} }} }}\n{wires}{more}'
    )


def event(types):
    """Set values of some types half way."""
    values = ", ".join(f"{name}_input = {SET[name]}" for name in types)
    return f'[[events]]\ntime = 0.5\ncomponent = "a"\nset = {{ {values} }}\n'


ZERO = dict.fromkeys(TYPES, "0") | {"Boolean": "false", "String": '"Set me!"', "Binary": '"666f6f"', "Enumeration": "1"}
ALL2 = ["Float64_continuous", "Float64_discrete", "Int32", "Boolean", "String", "Enumeration"]


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize(("fmi", "to"), [(2, 2), (3, 3), (2, 3), (3, 2)])
def test_a_value_of_every_type_goes_from_an_event_through_a_connection_exactly(reference_fmus, fmi, to, master):
    """A Real of FMI 2.0 is a Float64 of 3.0, an Integer an Int32."""
    types = TYPES if (fmi, to) == (3, 3) else ALL2
    plan, last = make_plan(pair(fmi, to, types, event(types), master), reference_fmus), Last()
    with Simulation(plan) as simulation:
        simulation.run([last])
    expected = dict(zip(TYPES, EXPECTED, strict=True))
    assert {name: last.outputs[name] for name in types} == {name: expected[name] for name in types}


def test_numbers_and_truth_values_are_recorded_and_texts_are_said_to_be_left_out(reference_fmus, caplog):
    data = run_scenario(pair(3, 3, TYPES, event(TYPES)), reference_fmus)
    assert data["b.Int8_output"].values[[0, -1]].tolist() == [0.0, -128.0]
    assert data["b.Boolean_output"].values[[0, -1]].tolist() == [0.0, 1.0]
    assert data["b.Float32_discrete_output"].values[[0, -1]].tolist() == [0.0, -0.25]
    assert data["b.Enumeration_output"].values[[0, -1]].tolist() == [1.0, 2.0]
    assert data["b.Int64_output"].values[-1] == 2.0**63
    assert "texts are not recorded: a.String_input, a.String_output, a.Binary_input" in caplog.text
    assert "b.UInt64_output is larger than 2^53: components receive it exactly, results hold the nearest" in caplog.text
    assert not any("String" in str(name) for name in data.data_vars)


def test_without_inputs_the_reference_output_is_repeated(reference_fmus, reference_outputs):
    """The start values; texts are compared, too."""
    header, *rows = read_rows(reference_outputs / "Feedthrough_out.csv")
    last = Last()
    plan = make_plan(pair(3, 3, TYPES), reference_fmus)
    with Simulation(plan) as simulation:
        simulation.run([last])
    written = {"false": False, "Set me!": "Set me!", "666f6f": b"foo"}
    expected = {name.removesuffix("_output"): written.get(text, text) for name, text in zip(header, rows[-1], strict=True)}
    for name, value in last.outputs.items():
        assert value == (type(value)(expected[name]) if isinstance(value, int | float) else expected[name])


def converted(fmi, sent, received, value, more="", master="gauss-seidel"):
    """Return a scenario in which an input receives what an event sets of another type."""
    inputs = [
        ", ".join(f"{name}_input = {ZERO[name]}" for name in (ALL2 if version == 2 else TYPES) if name != left)
        for version, left in zip(fmi, ("", received), strict=True)
    ]
    return parse_scenario(
        f'step = 0.1\nstop = 1.0\nmaster = "{master}"\n[components]\n'
        f'a = {{ fmu = "Feedthrough{fmi[0]}", inputs = {{ {inputs[0]} }} }}\n'
        f'b = {{ fmu = "Feedthrough{fmi[1]}", inputs = {{ {inputs[1]} }} }}\n'
        f'[[connections]]\nfrom = "a.{sent}_output"\nto = "b.{received}_input"\n{more}\n'
        f'[[events]]\ntime = 0.5\ncomponent = "a"\nset = {{ {sent}_input = {value} }}\n'
    )


WIDENED = [
    ("Int32", "Enumeration", "2", 2),
    ("Enumeration", "Int32", "2", 2),
    ("Int32", "Float64_continuous", "-7", -7.0),
    ("Int32", "Float64_discrete", "2147483647", 2147483647.0),
    ("Boolean", "Int32", "true", 1),
    ("Boolean", "Float64_continuous", "true", 1.0),
    ("Enumeration", "Float64_continuous", "2", 2.0),
]
WIDENED3 = [
    ("Int8", "Int64", "-128", -128),
    ("UInt32", "Int64", "4294967295", 2**32 - 1),
    ("UInt8", "Float32_continuous", "255", 255.0),
    ("Enumeration", "Int64", "2", 2),
    ("Boolean", "UInt64", "true", 1),
]
ROUNDED = [
    ("Float64_continuous", "Int32", "2.6", "gain = 1.0", 3),
    ("Float64_continuous", "Int32", "2.6", "gain = -10.0\nbias = 0.4", -26),
    ("Int64", "Float64_continuous", "9007199254740993", "gain = 1.0", 2.0**53),
    ("Int32", "Boolean", "-4", "gain = 1.0", True),
    ("UInt64", "Int8", "100", "gain = 0.5", 50),
]
CASES = [((fmi, to), *case[:3], "", case[3]) for fmi, to in ((2, 2), (3, 3), (2, 3), (3, 2)) for case in WIDENED]
CASES += [((3, 3), *case[:3], "", case[3]) for case in WIDENED3] + [((3, 3), *case) for case in ROUNDED]


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
def test_a_value_goes_to_a_wider_type_and_with_a_gain_to_a_narrower_one(reference_fmus, master):
    for fmi, sent, received, value, more, expected in CASES:
        last = Last()
        with Simulation(make_plan(converted(fmi, sent, received, value, more, master), reference_fmus)) as simulation:
            simulation.run([last])
        found = last.outputs[received]
        assert (found, type(found)) == (expected, type(expected)), (fmi, sent, received)


@pytest.mark.parametrize(("value", "says"), [("300.0", "300 is no Int8"), ("-128.6", "-128.6 is no Int8")])
def test_a_value_that_a_narrower_type_has_not_ends_the_run_by_name(reference_fmus, value, says):
    scenario = converted((3, 3), "Float64_continuous", "Int8", value, "gain = 1.0")
    with pytest.raises(SimulationError, match=rf"^b.Int8_input cannot receive its value: {says}. Correct 'gain' and 'bias'"):
        run_scenario(scenario, reference_fmus)


WIRE = '[[connections]]\nfrom = "a.{}_output"\nto = "b.{}_input"\n'
REFUSALS = {
    "another type": (
        WIRE.format("Int32", "Int8"),
        "scenario:9: 'a.Int32_output' is of type Integer and 'b.Int8_input' of type Int8, "
        "which does not hold all its values. State a 'gain' if values are to be rounded.",
    ),
    "a text to a number": (
        WIRE.format("String", "Int8") + "gain = 1.0",
        "scenario:9: 'a.String_output' is of type String and 'b.Int8_input' of type Int8, "
        "which does not hold all its values. Connect variables of one type.",
    ),
    "a gain of an integer": (
        WIRE.format("Int8", "Int8") + "gain = 2.0",
        "scenario:10: 'b.Int8_input' is of type Int8, and only a Real can have a gain. Remove it.",
    ),
    "out of the type's range": (
        event(["UInt8"]).replace("255", "256"),
        "input 'UInt8_input' of FMU 'Feedthrough3' is of type UInt8 and cannot be larger than 255.",
    ),
    "negative": (event(["UInt8"]).replace("255", "-1"), "is of type UInt8 and cannot be smaller than 0."),
    "no integer": (event(["UInt8"]).replace("255", "1.5"), "is of type UInt8 and cannot be 1.5."),
    "no item": (
        event(["Enumeration"]).replace("2 }", "3 }"),
        "input 'Enumeration_input' of FMU 'Feedthrough3' must lie in 1 to 2, not 3.",
    ),
    "no hexadecimal digits": (
        event(["Binary"]).replace("00ff", "xy"),
        "is of type Binary, written as hexadecimal digits, and cannot be 'xy'.",
    ),
    "a text to record": (
        '[record]\nvariables = ["a.String_input"]',
        "scenario:8: 'a.String_input' is a text, and results are numbers. Record something else.",
    ),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_what_does_not_fit_a_type_is_refused(reference_fmus, case):
    more, message = REFUSALS[case]
    scenario = pair(3, 3, ["Int8"] if more.startswith("[[conn") else [])
    text = scenario.source.text.split("[[connections]]")[0]
    with pytest.raises(ScenarioError, match=message):
        make_plan(parse_scenario(text + more), reference_fmus)


def test_the_suggested_start_values_are_toml(reference_fmus):
    text = pair(3, 3, ["Boolean", "String"]).source.text.split("[[connections]]")[0]
    message = r'neither connected nor given: .* inputs = \{ "Boolean_input" = false, "String_input" = "Set me!" \}'
    with pytest.raises(ScenarioError, match=message):
        make_plan(parse_scenario(text), reference_fmus)


# --- arrays ---


def test_an_array_is_connected_whole(reference_fmus):
    text = state_spaces("") + '[[connections]]\nfrom = "a.y"\nto = "b.u"\n'
    data = run_scenario(parse_scenario(text), reference_fmus)
    assert data["b.y"].values.tolist() == data["a.y"].values.tolist()
    assert data["b.y"].values[-1, 2] == pytest.approx(3.0 * 1.001**100)


def test_an_element_of_an_array_is_connected_and_events_change_the_others(reference_fmus):
    text = state_spaces('"u[1]" = 5.0, "u[3]" = 6.0') + (
        '[[connections]]\nfrom = "a.y[3]"\nto = "b.u[2]"\n[[events]]\ntime = 0.1\ncomponent = "b"\nset = { "u[1]" = 7.0 }\n'
    )
    data = run_scenario(parse_scenario(text.replace("stop = 0.1", "stop = 0.2")), reference_fmus)
    third = data["a.y"].values[:, 2]
    assert data["b.y"].values == pytest.approx(np.column_stack([[5.0, 5.0, 7.0], third, [6.0] * 3]))


@pytest.mark.parametrize(("change", "message"), [
    ('[[connections]]\nfrom = "a.y"\nto = "b.u[1]"', "'a.y' is an array of 3 elements and 'b.u\\[1\\]' is a scalar"),
    ('[[connections]]\nfrom = "a.y"\nto = "b.A"', "'a.y' is an array of 3 elements and 'b.A' is an array of 3 x 3"),
])  # fmt: skip
def test_arrays_of_two_shapes_are_not_connected(reference_fmus, change, message):
    with pytest.raises(ScenarioError, match=message):
        make_plan(parse_scenario(state_spaces('"u[*]" = 0.0') + change), reference_fmus)


@pytest.mark.parametrize("values", ["[1, 2]", "[[1, 2, 3]]", "[1, 2, 3, 4]"])
def test_an_array_given_in_another_shape_is_refused(reference_fmus, values):
    message = "'A' of FMU 'StateSpace3' is an array of 3 x 3 elements, and . are given. Give each element once."
    with pytest.raises(ScenarioError, match=message):
        make_plan(parse_scenario(state_spaces("u = [0, 0, 0]", more=f", A = {values}")), reference_fmus)


def test_an_absurdly_large_array_is_refused(reference_fmus):
    with pytest.raises(ScenarioError, match=r"its array 'A' has 100000 x 100000 elements, and at most 1000000"):
        make_plan(scenario("StateSpace3", 0.1, 1.0, "parameters = { n = 100000 }"), reference_fmus)


@pytest.mark.parametrize("fmi", [2, 3])
def test_info_reads_them_without_a_finding(reference_fmus, fmi):
    for path in sorted(reference_fmus.glob(f"*{fmi}.fmu")):
        file = FmuFile(path)
        assert file.version == fmi
        assert file.findings == []
