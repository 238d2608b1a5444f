"""A run that is interrupted and resumed is, to the bit, the run that was not: values of every type, arrays, groups."""

from __future__ import annotations

import coupled
import pytest
from gossamer_orchestrator import Recorder, Simulation, make_plan, parse_scenario, run_scenario
from gossamer_orchestrator.results.dataset import make_dataset
from stopping import KeepStates, StopAt


@pytest.fixture(scope="module")
def fmus(reference_fmus, tmp_path_factory):
    """Folder of FMUs whose state can be serialized, without event mode."""
    folder = tmp_path_factory.mktemp("resumed")
    for name in ("Stair2", "Feedthrough2", "Feedthrough3", "StateSpace3"):
        (folder / f"{name}.fmu").write_bytes((reference_fmus / f"{name}.fmu").read_bytes())
    coupled.build("mass", folder)
    return folder


VALUES = {  # at the start, set before the interruption, and after it
    "Int32": ("1", "-2147483648", "7"),
    "Boolean": ("false", "true", "false"),
    "String": ('"a"', '"Grüße"', '"c"'),
    "Enumeration": ("1", "2", "1"),
    "Int8": ("0", "-128", "5"),
    "Int64": ("0", "9007199254740993", "-9007199254740993"),
    "UInt64": ("0", "18446744073709551615", "3"),
    "Float32_continuous": ("0.1", "0.5", "-0.25"),
    "Binary": ('"00"', '"00ff"', '"01"'),
}
OF_FMI_2 = ["Int32", "Boolean", "String", "Enumeration"]


def typed(fmi, first, second):
    """Two FMUs, one feeds the other a value of every type; two events change them all."""
    names = OF_FMI_2 if fmi == 2 else list(VALUES)
    rest = "Float64_continuous_input = 0, Float64_discrete_input = 0"
    if fmi == 3:
        rest += ", Float32_discrete_input = 0, UInt8_input = 0, Int16_input = 0, UInt16_input = 0, UInt32_input = 0"
    given = [", ".join(f"{name}_input = {VALUES[name][i]}" for name in names) for i in range(3)]
    events = "".join(
        f'[[events]]\ntime = {time}\ncomponent = "a"\nset = {{ {given[i]} }}\n' for i, time in ((1, first), (2, second))
    )
    wires = "".join(f'[[connections]]\nfrom = "a.{name}_output"\nto = "b.{name}_input"\n' for name in names)
    return (
        f'[components]\na = {{ fmu = "Feedthrough{fmi}", inputs = {{ {given[0]}, {rest} }} }}\n'
        f'b = {{ fmu = "Feedthrough{fmi}", inputs = {{ {rest} }} }}\n{wires}{events}'
    )


COUNTER = """
[components]
stair = { fmu = "Stair2" }
b = { fmu = "Feedthrough2", inputs = { Float64_continuous_input = 0, Float64_discrete_input = 0, Boolean_input = true, \
String_input = "", Enumeration_input = 1 } }
[[connections]]
from = "stair.counter"
to = "b.Int32_input"
"""
ARRAYS = """
[components]
a = { fmu = "StateSpace3", parameters = { x0 = [1, 2, 3] }, inputs = { u = [0, 0, 0] } }
b = { fmu = "StateSpace3", parameters = { "A[*]" = 0 }, inputs = { "u[1]" = 5.0, "u[3]" = 6.0 } }
[[connections]]
from = "a.y[3]"
to = "b.u[2]"
noise = { kind = "normal", amplitude = 0.1, seed = 2 }
[[events]]
time = 0.3
component = "b"
set = { "u[1]" = 7.0 }
[[events]]
time = 0.8
component = "b"
set = { "u[3]" = 8.0 }
[[events]]
time = 0.3
component = "a"
set = { "u[2]" = -1.0 }
"""
MASSES = """
[components]
one = { fmu = "mass", parameters = { m = 1.0, k = 40.0, x0 = 0.3 } }
two = { fmu = "mass", parameters = { m = 0.5, x0 = -0.1 } }
[[connections]]
from = "two.x"
to = "one.u"
noise = { kind = "normal", amplitude = 0.01, seed = 2 }
[[connections]]
from = "one.force"
to = "two.u"
gain = -1.0
[[groups]]
components = ["one", "two"]
tolerance = 1e-4
"""
SCENARIOS = {
    "every type of FMI 2.0": typed(2, 0.3, 0.8),
    "every type of FMI 3.0": typed(3, 0.3, 0.8),
    "every type, by Jacobi, with an event in the very step of the break": 'master = "jacobi"\n' + typed(3, 0.3, 0.6),
    "a counter": COUNTER,
    "elements of arrays": ARRAYS,
    "a group": MASSES,
}


@pytest.mark.parametrize("case", SCENARIOS)
def test_a_resumed_run_equals_one_without_a_break(fmus, tmp_path, case):
    scenario = parse_scenario(f"step = 0.1\nstop = 1.2\n{SCENARIOS[case]}")
    out, states = tmp_path / "out", (tmp_path / "whole", tmp_path / "resumed")
    plan = make_plan(scenario, fmus)
    recorder = Recorder(plan)
    with Simulation(plan) as simulation:
        simulation.run([recorder, KeepStates(states[0])])
    with pytest.raises(KeyboardInterrupt):
        run_scenario(scenario, fmus, out, observers=[StopAt(6)])
    resumed = run_scenario(scenario, fmus, out, resume=True, observers=[KeepStates(states[1])])
    assert resumed.equals(make_dataset(plan, recorder.time, recorder.table, divided_steps=0))
    assert states[1].read_bytes() == states[0].read_bytes()
